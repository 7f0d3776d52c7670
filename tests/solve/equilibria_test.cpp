// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <membrane/model/moving_foundation.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/reference_table.hpp"
#include "support/run_to_equilibrium.hpp"

using namespace membrane;
using test::ReferenceRow;

namespace {

constexpr int increments = 20;
constexpr double dt = 1e-3;

/// The membrane of a row of the tables, on a sphere of `radius` with all stiffnesses times `factor`. The masses keep
/// rule (4) stable: six springs of stiffness k in a plane have 3 k as their largest eigenvalue.
template <class S>
struct Reference {
    TriangleMesh<S> mesh;
    MassSpringNetwork<S, LinearSpring> network;
    VirtualVolumeSprings<S> foundation;

    explicit Reference(const ReferenceRow& row, S radius = 1, S factor = 1)
        : mesh(icosphere<S>({.radius = static_cast<double>(radius), .subdivisions = row.integer("level")})),
          network(mesh, LinearSpring{},
                  {.stiffness = stiffnesses(mesh, radius, factor, row), .mass = mass(factor, row)}),
          foundation(mesh, {.stiffness = factor * static_cast<S>(row.number("k_volume"))}) {}

    static std::vector<S> stiffnesses(const TriangleMesh<S>& mesh, S radius, S factor, const ReferenceRow& row) {
        const Adjacency adjacency(mesh);
        std::vector<S> result;
        for (const auto& [p, q] : adjacency.edges()) {
            const double x = static_cast<double>((mesh.positions()(0, p) + mesh.positions()(0, q)) / (2 * radius));
            result.push_back(factor * static_cast<S>(row.number("k") * (1 + row.number("vary") * x)));
        }
        return result;
    }
    static S mass(S factor, const ReferenceRow& row) {
        const double largest = (1 + row.number("vary")) * row.number("k");
        return factor * static_cast<S>(dt * dt * (largest + row.number("k_volume")) / 0.45);
    }

    Index vertex_at(const Vector3<double>& place) const {
        const Points<S> directions = mesh.positions().colwise().normalized();
        Eigen::Index nearest = 0;
        REQUIRE((directions.colwise() - place.normalized().cast<S>().eigen()).colwise().norm().minCoeff(&nearest) <
                S(1e-6));
        return static_cast<Index>(nearest);
    }
    Vector3<S> raised(Index v, double by) const { return static_cast<S>(1 + by) * point(mesh.positions(), v); }

    template <class Volume>
    S energy(const Points<S>& x, const Volume& volume) const {
        S sum = network.energy(x);
        for (Index v = 0; v < mesh.vertex_count(); ++v) sum += volume.energy(v, point(x, v));
        return sum;
    }
    S mean_displacement(const Points<S>& x, std::span<const Index> vertices) const {
        S sum = 0;
        for (const Index v : vertices) sum += norm<S>(point(x, v) - point(mesh.positions(), v));
        return sum / static_cast<S>(vertices.size());
    }
};

/// The larger meshes are left to optimised builds.
bool is_slow(const ReferenceRow& row) { return cases(20, 20) < 20 && row.integer("level") > 2; }

/// Runs `check(solver)` with every rule and order of updates that is to find the same equilibria; on the larger meshes
/// but in a long run, with the first.
template <class S, class Check>
void with_each_rule(const Reference<S>& membrane, const SolverOptions<S>& options, Check check) {
    const auto ordered = [&](UpdateOrder order) {
        auto other = options;
        other.order = order;
        return QuasiStaticSolver(membrane.network, other, BlockStep{});
    };
    SECTION("block steps in groups") { check(ordered(UpdateOrder::colour_layers)); }
    if (membrane.mesh.vertex_count() > 200 && cases(1, 2) == 1) return;
    SECTION("in the order of arrival") { check(ordered(UpdateOrder::breadth_first)); }
    SECTION("by colours") { check(ordered(UpdateOrder::colour_all)); }
    SECTION("the rule as published") { check(QuasiStaticSolver(membrane.network, options, MassStep{})); }
    SECTION("safe steps") { check(QuasiStaticSolver(membrane.network, options, SafeStep{.omega = 1})); }
    SECTION("long safe steps") { check(QuasiStaticSolver(membrane.network, options, SafeStep{.omega = 1.9})); }
}

SolverOptions<double> to_the_end(Index layers) { return {.layers = layers, .sweeps = 50, .force_tolerance = 1e-14}; }

/// The force that holds a vertex, component by component: what is zero in the table is the residual of both.
void check_force(const Vector3<double>& found, const ReferenceRow& row, const std::string& number) {
    const Vector3<double> expected(row.number("fx" + number), row.number("fy" + number), row.number("fz" + number));
    CHECK(norm<double>(found - expected) <= 1e-8 * norm(expected));
    for (int k = 0; k < 3; ++k) CHECK(found[k] == Approx(expected[k]).epsilon(1e-8).margin(1e-10));
}

}  // namespace

TEST_CASE("one held vertex: every row of the reference", "[equilibria]") {
    const auto rows = test::reference_table("equilibria.csv");
    REQUIRE(rows.size() == 15);
    for (const auto& row : rows) {
        if (is_slow(row)) continue;
        DYNAMIC_SECTION(row.line()) {
            const Reference<double> membrane(row);
            REQUIRE(membrane.mesh.vertex_count() == row.integer("vertices"));
            const Index held = membrane.vertex_at({0, 1, std::numbers::phi});
            const Index layers = row.integer("layers") == 0 ? unlimited : row.integer("layers");
            with_each_rule(membrane, to_the_end(layers), [&](auto solver) {
                Points<double> x = membrane.mesh.positions();
                StepReport<double> report;
                for (int i = 1; i <= increments; ++i) {
                    const auto target = membrane.raised(held, row.number("delta") * i / increments);
                    report = test::run_to_equilibrium(solver, x, dt, membrane.network, membrane.foundation,
                                                      pull(held, target));
                    REQUIRE(report.converged);
                }
                CHECK(report.residual < 1e-11);
                const Vector3<double> outward = point(membrane.mesh.positions(), held);
                CHECK(-dot(report.reactions[0], outward) == Approx(row.number("holding_force")).epsilon(1e-8));
                CHECK(membrane.energy(x, membrane.foundation) == Approx(row.number("energy")).epsilon(1e-10));
                PropagationQueue all(membrane.mesh.vertex_count());
                all.build(membrane.network, std::array{held}, unlimited);
                for (const Index distance : {1, 2, 4, 8}) {
                    CAPTURE(distance);
                    const double expected = row.number("disp" + std::to_string(distance));
                    const double found = membrane.mean_displacement(x, all.layer(distance));
                    CHECK(found == Approx(expected).epsilon(1e-8).margin(1e-12));
                    CHECK((distance > layers) == (found == 0));
                }
            });
        }
    }
}

TEST_CASE("mixed springs, two held vertices, anchors that moved: every row of the reference", "[equilibria]") {
    const auto rows = test::reference_table("equilibria_more.csv");
    REQUIRE(rows.size() == 7);
    for (const auto& row : rows) {
        if (is_slow(row)) continue;
        DYNAMIC_SECTION(row.line()) {
            const Reference<double> membrane(row);
            const Points<double>& initial = membrane.mesh.positions();
            const auto anchors_at = [&](double part) -> Points<double> {
                Eigen::Matrix3d displacement = Eigen::Matrix3d::Zero();
                if (row.integer("anchors") == 1) displacement(0, 1) = 1;
                if (row.integer("anchors") == 2) displacement.diagonal() << 1, -0.5, -0.5;
                return initial + part * row.number("amount") * displacement * initial;
            };
            const int held = row.integer("held");
            std::array<Index, 2> vertices{};
            std::array<double, 2> deltas{};
            for (int i = 0; i < held; ++i) {
                const std::string n = std::to_string(i + 1);
                const auto at = static_cast<std::size_t>(i);
                vertices[at] = membrane.vertex_at({row.number("x" + n), row.number("y" + n), row.number("z" + n)});
                deltas[at] = row.number("delta" + n);
            }
            with_each_rule(membrane, to_the_end(unlimited), [&](auto solver) {
                Points<double> x = initial;
                StepReport<double> report;
                MovingBody body(membrane.mesh);
                const auto volume = on(body, membrane.foundation);
                for (int i = 1; i <= increments; ++i) {
                    const double part = static_cast<double>(i) / increments;
                    REQUIRE(body.move_to(anchors_at(part), dt, x));
                    const auto hold = [&](std::size_t n) {
                        return pull(vertices[n], membrane.raised(vertices[n], part * deltas[n]));
                    };
                    if (held == 0) report = test::run_to_equilibrium(solver, x, dt, membrane.network, volume);
                    if (held == 1) report = test::run_to_equilibrium(solver, x, dt, membrane.network, volume, hold(0));
                    if (held == 2)
                        report = test::run_to_equilibrium(solver, x, dt, membrane.network, volume, hold(0), hold(1));
                    REQUIRE(report.converged);
                }
                CHECK(report.residual < 1e-11);
                REQUIRE(report.reactions.size() == static_cast<std::size_t>(held));
                if (held > 0) check_force(-report.reactions[0], row, "1");
                if (held > 1) check_force(-report.reactions[1], row, "2");
                CHECK(membrane.energy(x, volume) == Approx(row.number("energy")).epsilon(1e-10));
                const double largest = (x - initial).colwise().norm().maxCoeff();
                CHECK(largest == Approx(row.number("largest_displacement")).epsilon(1e-8));
            });
        }
    }
}

TEST_CASE("the reference on a sphere of a centimetre, with springs of 40 N/m", "[equilibria]") {
    const double radius = 0.01, factor = 40;
    for (const auto& row : test::reference_table("equilibria.csv")) {
        if (row.integer("level") != 2) continue;
        CAPTURE(row.line());
        const Reference<double> membrane(row, radius, factor);
        const Index held = membrane.vertex_at({0, 1, std::numbers::phi});
        QuasiStaticSolver solver(membrane.network, {.layers = unlimited, .sweeps = 50, .force_tolerance = 1e-12});
        Points<double> x = membrane.mesh.positions();
        StepReport<double> report;
        for (int i = 1; i <= increments; ++i) {
            const auto target = membrane.raised(held, row.number("delta") * i / increments);
            report = test::run_to_equilibrium(solver, x, dt, membrane.network, membrane.foundation, pull(held, target));
            REQUIRE(report.converged);
        }
        const Vector3<double> outward = point(membrane.mesh.positions(), held) / radius;
        const double force = row.number("holding_force") * radius * factor;
        CHECK(-dot(report.reactions[0], outward) == Approx(force).epsilon(1e-8));
        const double energy = row.number("energy") * radius * radius * factor;
        CHECK(membrane.energy(x, membrane.foundation) == Approx(energy).epsilon(1e-9));
    }
}

TEST_CASE("the reference in float, as near as float comes", "[equilibria]") {
    for (const auto& row : test::reference_table("equilibria.csv")) {
        if (is_slow(row) || (row.integer("level") != 2 && row.integer("layers") == 0)) continue;
        CAPTURE(row.line());
        const Reference<float> membrane(row);
        const Index held = membrane.vertex_at({0, 1, std::numbers::phi});
        const Index layers = row.integer("layers") == 0 ? unlimited : row.integer("layers");
        QuasiStaticSolver solver(membrane.network, {.layers = layers, .sweeps = 50}, SafeStep{.omega = 1.5});
        Points<float> x = membrane.mesh.positions();
        StepReport<float> report;
        for (int i = 1; i <= increments; ++i) {
            const auto target = membrane.raised(held, row.number("delta") * i / increments);
            report = test::run_to_equilibrium(solver, x, static_cast<float>(dt), membrane.network, membrane.foundation,
                                              pull(held, target));
            REQUIRE(report.converged);
        }
        // A force that is negligible beside the others moves a vertex so far: 64 epsilon k / k_volume.
        REQUIRE(report.residual <= membrane.network.force_tolerance());
        const double error = membrane.network.force_tolerance() / row.number("k_volume");
        REQUIRE(error < 1e-4);
        const Vector3<float> outward = point(membrane.mesh.positions(), held);
        const double force = static_cast<double>(-dot(report.reactions[0], outward));
        CHECK(std::abs(force - row.number("holding_force")) <= error * (row.number("k") + row.number("k_volume")));
        const double energy = static_cast<double>(membrane.energy(x, membrane.foundation));
        CHECK(std::abs(energy - row.number("energy")) <= error * error * row.number("k") + 1e-4 * energy);
        PropagationQueue all(membrane.mesh.vertex_count());
        all.build(membrane.network, std::array{held}, unlimited);
        for (const Index distance : {1, 2, 4, 8}) {
            const double expected = row.number("disp" + std::to_string(distance));
            const auto found = static_cast<double>(membrane.mean_displacement(x, all.layer(distance)));
            CHECK(std::abs(found - expected) <= error);
        }
    }
}
