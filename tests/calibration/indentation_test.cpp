// SPDX-License-Identifier: MIT
#include <membrane/calibration/indentation.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include <membrane/calibration/fit.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/contact_newton.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;
using test::refusal;

namespace {

using Numbers = std::span<const double>;
using Point = Vector3<double>;

/// Springs and foundation of these stiffnesses.
auto linear_on(const TriangleMesh<double>& mesh) {
    return [&mesh](Numbers c) {
        return std::pair(MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = c[0]}),
                         VirtualVolumeSprings(mesh, {.stiffness = c[1]}));
    };
}

/// Springs of this stiffness and stiffening, on a foundation that is known.
auto stiffening_on(const TriangleMesh<double>& mesh) {
    return [&mesh](Numbers c) {
        const ExponentialSpring law{.stiffening = c[1], .strain_limit = (std::min)(0.5, 50 / c[1])};
        return std::pair(MassSpringNetwork(mesh, law, {.stiffness = c[0]}),
                         VirtualVolumeSprings(mesh, {.stiffness = 2.0}));
    };
}

TriangleMesh<double> sphere(Index subdivisions) {
    return icosphere<double>({.radius = 0.01, .subdivisions = subdivisions});
}

/// From above, onto no vertex, edge or middle of the sphere.
Tool<double> tip(double radius = 2e-3) { return {.position = {1e-3, 5e-4, 0.015}, .radius = radius}; }
const Point down{0, 0, -1};

std::vector<double> depths(Index count, double deepest) {
    std::vector<double> result;
    for (Index i = 1; i <= count; ++i) result.push_back(deepest * i / count);
    return result;
}

template <class Model>
ForceTable table_of(const Model& model, const std::vector<double>& truth, const std::vector<double>& at) {
    return {.depth = at, .force = model(truth, at)};
}

double distance_to(const TriangleMesh<double>& mesh, const Tool<double>& tool) {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& corners : mesh.triangles().colwise()) {
        least = std::fmin(least, test::distance_from_axis(tool, mesh.positions()(Eigen::all, corners)));
    }
    return least;
}

}  // namespace

TEST_CASE("Depth begins where the moving tool first touches") {
    Random random(1);
    const auto mesh = sphere(1);
    for (int i = 0; i < cases(40); ++i) {
        CAPTURE(i);
        Tool<double> tool{.position = 0.03 * random.unit_vector(), .radius = random.number(1e-4, 5e-3)};
        if (random.chance(0.3)) tool.axis = 0.01 * random.unit_vector();
        const Point displacement = 4e-3 * random.vector() - tool.position;
        const Indentation indentation(mesh, tool, displacement, linear_on(mesh));
        const Point moved = indentation.touching().position - tool.position;
        CHECK(norm(cross<double>(moved, displacement)) <= 1e-14 * norm(displacement));
        CHECK(dot<double>(moved, displacement) > 0);
        CHECK(std::abs(distance_to(mesh, indentation.touching()) - tool.radius) < 1e-12);
        for (int k = 0; k < 20; ++k) {  // and not before
            auto before = tool;
            before.position += random.number() * moved;
            CHECK(distance_to(mesh, before) > tool.radius);
        }
    }
}

TEST_CASE("A tool that moves along a surface touches it far from where it started") {
    const auto mesh = sheet<double>({.width = 1, .height = 1, .columns = 4, .rows = 4});
    for (const Index corner : {0, mesh.vertex_count() - 1}) {
        const Point from = point(mesh.positions(), corner) + Point(0, 0, 0.11);
        const Point to = -0.8 * point(mesh.positions(), corner) + Point(0, 0, 0.01);
        const Indentation indentation(mesh, Tool<double>{.position = from, .radius = 0.01}, to - from, linear_on(mesh));
        CHECK(norm<double>(indentation.touching().position - to) < 1e-10);
    }
}

TEST_CASE("Forces of an indentation are those that Newton's method of the tests finds") {
    Random random(2);
    const auto mesh = icosphere<double>({.radius = 1, .subdivisions = 1});
    for (int i = 0; i < cases(4); ++i) {
        CAPTURE(i);
        const Tool<double> tool{.position = 2 * random.unit_vector(), .radius = random.number(0.2, 0.5)};
        const Point displacement = (0.2 * random.vector() - tool.position).normalized();
        const double k = random.number(0.1, 2.0);
        const Indentation indentation(mesh, tool, displacement, linear_on(mesh));
        const auto at = depths(4, 0.2);
        const auto forces = indentation(std::vector{1.0, k}, at);
        const auto [network, foundation] = linear_on(mesh)(std::vector{1.0, k});
        const std::vector<Spring<double>> springs(network.springs().begin(), network.springs().end());
        test::PressedState state{mesh.positions(), {}, true};
        constexpr int parts = 5;  // of a depth: the tests' method wants small steps
        for (int step = 1; step <= 4 * parts; ++step) {
            auto pressing = indentation.touching();
            pressing.position += 0.05 * step / parts * displacement;
            const test::PressedMembrane membrane{mesh.triangles(), springs, mesh.positions(), k, {pressing}};
            state = test::at_rest(membrane, state.x, {.far = 0.15, .max_step = tool.radius / 2});
            REQUIRE(state.converged);
            if (step % parts != 0) continue;
            CHECK(forces[static_cast<std::size_t>(step / parts) - 1] ==
                  Approx(-displacement.dot(state.reactions[0])).epsilon(1e-7));
        }
    }
}

TEST_CASE("By vertices, forces are those of the equilibria by vertices, and a fit finds the constants") {
    const auto mesh = sphere(3);
    const TrackerOptions fine{.fine_triangles = 0.5}, faces{.fine_triangles = 0};
    const Indentation indentation(mesh, tip(), down, linear_on(mesh), fine),
        by_faces(mesh, tip(), down, linear_on(mesh), faces);
    const std::vector truth{40.0, 8.0};
    const auto at = depths(5, 1.5e-3);
    const auto table = table_of(indentation, truth, at);
    const auto [network, foundation] = linear_on(mesh)(truth);
    auto tool = indentation.touching();
    tool.position += at.back() * down;
    ContactTracker<double> tracker(mesh, fine);
    const auto contact = tracker.update(AabbTree<double>(mesh), mesh.positions(), tool);
    const auto rest = equilibrium(mesh.positions(), mesh, network, foundation, {}, press(tool, contact));
    CHECK(table.force.back() == Approx(-down.dot(rest.reactions[0])).epsilon(1e-9));
    CHECK(by_faces(truth, at).back() > 1.1 * table.force.back());
    const auto found = fit(table, {20, 20}, indentation);
    CHECK(found.converged);
    for (std::size_t k = 0; k < 2; ++k) CHECK(found.constants[k] == Approx(truth[k]).epsilon(1e-4));
}

TEST_CASE("Depths may come in any order and repeat, and without touch there is no force") {
    const auto mesh = sphere(1);
    const Indentation indentation(mesh, tip(), down, linear_on(mesh));
    const std::vector constants{40.0, 8.0};
    const auto ordered = indentation(constants, std::vector{-1e-3, 0.0, 4e-4, 9e-4, 1.6e-3});
    const auto mixed = indentation(constants, std::vector{1.6e-3, -1e-3, 4e-4, 9e-4, 4e-4});
    CHECK(ordered[0] == 0);
    CHECK(ordered[1] == Approx(0).margin(1e-9));
    CHECK((0 < ordered[2] && ordered[2] < ordered[3] && ordered[3] < ordered[4]));
    const std::vector<double> expected{ordered[4], ordered[0], ordered[2], ordered[3], ordered[2]};
    for (std::size_t i = 0; i < 5; ++i) CHECK(mixed[i] == Approx(expected[i]).epsilon(1e-8));
    CHECK(indentation(constants, {}).empty());
}

TEST_CASE("A tool that goes on from a deep indentation is still in contact") {
    const int count = cases(20, 60);
    int found = 0;
    for (int seed = 1; seed <= count; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = sphere(2);
        const Point from = 0.02 * random.unit_vector(), to = 0.004 * random.vector();
        const Tool<double> tool{.position = from, .radius = random.number(5e-4, 3e-3)};
        const Indentation indentation(mesh, tool, to - from, linear_on(mesh));
        const double near = random.number(0.0, 3e-3), far = random.number(near, 5e-3);
        const auto forces = indentation(std::vector{40.0, random.number(0.5, 8.0)}, std::vector{near, far});
        if (!is_finite(forces[1])) continue;
        CHECK(forces[1] > 0);
        ++found;
    }
    CHECK(found > 5 * count / 6);
}

TEST_CASE("All stiffnesses times a factor make the force of an indentation times it, in float too") {
    const auto mesh = sphere(1);
    const Indentation indentation(mesh, tip(), down, linear_on(mesh));
    const auto at = depths(3, 2e-3);
    const auto soft = indentation(std::vector{40.0, 8.0}, at), stiff = indentation(std::vector{4e4, 8e3}, at);
    const auto coarse = icosphere<float>({.radius = 0.01, .subdivisions = 1});
    const auto build = [&](Numbers c) {
        return std::pair(MassSpringNetwork(coarse, LinearSpring{}, {.stiffness = static_cast<float>(c[0])}),
                         VirtualVolumeSprings(coarse, {.stiffness = static_cast<float>(c[1])}));
    };
    const Tool<float> tool{.position = tip().position.cast<float>(), .radius = 2e-3F};
    const auto in_float = Indentation(coarse, tool, down.cast<float>(), build)(std::vector{40.0, 8.0}, at);
    for (std::size_t i = 0; i < at.size(); ++i) {
        CHECK(stiff[i] == Approx(1e3 * soft[i]).epsilon(1e-8));
        CHECK(in_float[i] == Approx(soft[i]).epsilon(1e-3));
    }
}

TEST_CASE("A fit finds the stiffness of springs and foundation from an indentation without noise") {
    Random random(3);
    for (int i = 0; i < cases(3, 6); ++i) {
        CAPTURE(i);
        const auto mesh = sphere(i < 3 ? 1 : 2);
        const Indentation model(mesh, tip(), down, linear_on(mesh));
        const std::vector truth{random.number(20.0, 80.0), random.number(2.0, 20.0)};
        const auto table = table_of(model, truth, depths(3, 3e-3));
        const auto found = fit(table, {truth[0] * random.number(0.5, 2.0), truth[1] * random.number(0.5, 2.0)}, model);
        CHECK(found.converged);
        for (std::size_t k = 0; k < 2; ++k) {
            CHECK(found.constants[k] == Approx(truth[k]).epsilon(1e-3));
            CHECK(found.identifiable[k]);
        }
    }
}

namespace {

/// An indentation at fixed depths with springs and foundation of any stiffness, from a few: it is the stiffness of the
/// foundation times what depends on the ratio of the two, a polynomial of its logarithm to four digits.
class ByRatio {
  public:
    template <class Model>
    ByRatio(const Model& model, const std::vector<double>& at) {
        for (int i = 0; i < count; ++i) per_foundation_.push_back(model(std::vector{std::exp(node(i)), 1.0}, at));
    }

    std::vector<double> operator()(Numbers c, Numbers at) const {
        const double x = std::log(c[0] / c[1]);
        std::vector<double> forces(at.size(), std::numeric_limits<double>::quiet_NaN());
        if (x < low || x > high) return forces;
        double sum = 0;
        std::vector<double> weighted(at.size());
        for (int i = 0; i < count; ++i) {  // the barycentric formula for Chebyshev's nodes
            const double angle = std::numbers::pi * (i + 0.5) / count;
            const double weight = (i % 2 == 0 ? 1 : -1) * std::sin(angle) / (x - node(i));
            sum += weight;
            for (std::size_t d = 0; d < at.size(); ++d) {
                weighted[d] += weight * c[1] * per_foundation_[static_cast<std::size_t>(i)][d];
            }
        }
        for (std::size_t d = 0; d < at.size(); ++d) forces[d] = weighted[d] / sum;
        return forces;
    }

  private:
    static constexpr int count = 12;
    static constexpr double low = -1, high = 4;
    static double node(int i) {
        return (low + high) / 2 + (high - low) / 2 * std::cos(std::numbers::pi * (i + 0.5) / count);
    }
    std::vector<std::vector<double>> per_foundation_;
};

}  // namespace

TEST_CASE("The 95 % intervals of stiffnesses hold the truth in 90 to 99 % of indentations with 2 % noise") {
    const auto mesh = sphere(2);
    const Indentation pressed(mesh, tip(), down, linear_on(mesh));
    const std::vector truth{40.0, 8.0};
    const auto at = depths(6, 3e-3);
    const ByRatio model(pressed, at);
    const auto exact = table_of(pressed, truth, at);
    const auto same = model(truth, at);
    for (std::size_t i = 0; i < at.size(); ++i) CHECK(same[i] == Approx(exact.force[i]).epsilon(1e-4));

    constexpr int seeds = 500;
    std::array<int, 2> held{0, 0};
    for (int seed = 1; seed <= seeds; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto table = exact;
        for (double& force : table.force) {
            const double size = std::sqrt(-2 * std::log(1 - random.number()));
            force *= 1 + 0.02 * size * std::cos(2 * std::numbers::pi * random.number());
        }
        const auto found = fit(table, {60, 6}, model);
        for (std::size_t k = 0; k < 2; ++k) {
            held[k] += found.intervals[k].lower <= truth[k] && truth[k] <= found.intervals[k].upper ? 1 : 0;
        }
    }
    for (const int count : held) {
        CAPTURE(count);
        CHECK((count >= 0.9 * seeds && count <= 0.99 * seeds));
    }
}

TEST_CASE("Stiffening is identifiable from deep indentations and not from shallow ones, the stiffness from both") {
    Random random(4);
    const auto mesh = sphere(1);
    const Indentation model(mesh, tip(), down, stiffening_on(mesh));
    const std::vector truth{40.0, 8.0};
    for (const double deepest : {4e-3, 4e-5}) {
        CAPTURE(deepest);
        auto table = table_of(model, truth, depths(5, deepest));
        for (double& force : table.force) force *= 1 + 2e-3 * random.number(-1.0, 1.0);
        const auto found = fit(table, {30, 5}, model);
        CHECK(found.identifiable[0]);
        CHECK(found.constants[0] == Approx(truth[0]).epsilon(0.15));
        CHECK(found.identifiable[1] == (deepest > 1e-3));
    }
}

TEST_CASE("An indentation refuses a tool that cannot touch, and depths that are none") {
    const auto mesh = sphere(0);
    const auto with = [&](const Tool<double>& tool, const Point& displacement) {
        return refusal([&] { static_cast<void>(Indentation(mesh, tool, displacement, linear_on(mesh))); });
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    CHECK(with(tip(), down) == "");
    const auto invalid = "Indentation: the tool must be finite and have a radius [m], got one that is not or has none";
    CHECK(with(tip(0), down) == invalid);
    CHECK(with(tip(nan), down) == invalid);
    const auto nowhere = "Indentation: the direction must be finite and not zero, got one that is not";
    CHECK(with(tip(), Point::Zero()) == nowhere);
    CHECK(with(tip(), {0, nan, 1}) == nowhere);
    const auto touching = "Indentation: the tool must stand outside the surface, got one that touches it";
    CHECK(with(tip(0.02), down) == touching);
    const auto passing = "Indentation: the tool must meet the surface along its direction, got one that misses it";
    CHECK(with(tip(), {0, 1, 0}) == passing);
    CHECK(with(tip(), -down) == passing);
    const Indentation valid(mesh, tip(), down, linear_on(mesh));
    CHECK(refusal([&] {
              static_cast<void>(valid(std::vector{1.0, 1.0}, std::vector{0.0, nan}));
          }) == "Indentation: depth 1 must be finite [m], got nan");
}
