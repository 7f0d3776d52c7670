// SPDX-License-Identifier: MIT
#include <membrane/solve/step_rule.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/orders.hpp"
#include "support/refusal.hpp"
#include "support/run_to_equilibrium.hpp"
#include "support/spring_law_check.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

static_assert(StepRule<MassStep, float> && StepRule<MassStep, double>);
static_assert(StepRule<SafeStep, float> && StepRule<SafeStep, double>);
static_assert(StepRule<BlockStep, float> && StepRule<BlockStep, double>);

TEMPLATE_TEST_CASE("the rules are what they say", "[rule]", TEST_SCALARS) {
    using S = TestType;
    VertexState<S> vertex;
    vertex.stiffness = 8;
    vertex.mass = S(0.5);
    vertex.dt = S(0.1);
    CHECK(MassStep{}.compliance(vertex) == S(0.1) * S(0.1) / S(0.5));
    CHECK(SafeStep{}.compliance(vertex) == S(1) / 8);
    CHECK(SafeStep{.omega = 1.5}.compliance(vertex) == S(1.5) / 8);
    // Where nothing pulls, nothing moves.
    CHECK(SafeStep{}.compliance(VertexState<S>{}) == 0);
    CHECK(BlockStep{}.compliance(VertexState<S>{}) * Vector3<S>(1, 2, 3) == Vector3<S>::Zero());
    // Without a reduction of stiffness a block is the same in all directions.
    CHECK((BlockStep{.omega = 1.5}.compliance(vertex) * Vector3<S>(1, 2, 3) - Vector3<S>(1, 2, 3) * S(1.5) / 8).norm() <
          8 * std::numeric_limits<S>::epsilon());
    // What a constraint acts on is not relaxed beyond its response.
    vertex.constrained = true;
    CHECK(SafeStep{.omega = 1.5}.compliance(vertex) == S(1) / 8);
    CHECK(SafeStep{.omega = 0.5}.compliance(vertex) == S(0.5) / 8);
    STATIC_REQUIRE_FALSE(StepRule<int, S>);
}

TEMPLATE_TEST_CASE("a contact stiffens a block along its normal alone", "[rule]", TEST_SCALARS) {
    using S = TestType;
    const S slack = sizeof(S) == 4 ? S(1e-3) : S(1e-10);
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        VertexState<S> vertex;
        vertex.stiffness = random.number(S(1), S(10));
        vertex.size = random.number(S(0.1), S(10));
        vertex.force = random.vector(S(-1), S(1));
        for (int i = 0; i < 3; ++i)
            vertex.stiffness_reduction += outer<S>(vertex.stiffness / 4, random.unit_vector<S>());
        vertex.constrained = true;
        const auto without = BlockStep{}.compliance(vertex);
        vertex.contact_stiffness = std::pow(S(10), random.number(S(-2), S(2)));
        vertex.stiffness += vertex.contact_stiffness;
        vertex.contact_normal = random.unit_vector<S>();
        const auto with = BlockStep{}.compliance(vertex);
        // (H^-1 + ...)^-1 = H + s n n^T: for the force that moves the vertex by `displacement` with the contact.
        const Vector3<S> force = random.vector(S(-1), S(1)), displacement = with * force;
        const Vector3<S> of_contact =
            vertex.contact_stiffness * dot(vertex.contact_normal, displacement) * vertex.contact_normal;
        REQUIRE(norm<S>(without * Vector3<S>(force - of_contact) - displacement) <= slack * (1 + norm(displacement)));
    }
}

TEMPLATE_TEST_CASE("a safe step that would not be safe is refused by name", "[rule][bad]", SafeStep, BlockStep) {
    const auto refused = [](double omega) { return test::refusal([&] { TestType{.omega = omega}.validate(); }); };
    for (const double omega : {1e-9, 0.5, 1.0, 1.9, 1.999}) CHECK(refused(omega) == "");
    std::string name = std::is_same_v<TestType, SafeStep> ? "SafeStep" : "BlockStep";
    name += ": omega must lie between 0 and 2, got ";
    CHECK(refused(0) == name + "0");
    CHECK(refused(2) == name + "2");
    CHECK(refused(-1) == name + "-1");
    CHECK(refused(std::numeric_limits<double>::infinity()) == name + "inf");
    CHECK(refused(std::nan("")) == name + "nan");
}

// ---- a safe step never raises the energy

namespace {

/// Distance in long double: rounding is no excuse.
long double distance(const Vector3<double>& a, const Vector3<double>& b) {
    long double sum = 0;
    for (int k = 0; k < 3; ++k) {
        const long double displacement = static_cast<long double>(a[k]) - static_cast<long double>(b[k]);
        sum += displacement * displacement;
    }
    return std::sqrt(sum);
}

/// A vertex between springs whose stiffnesses, rest lengths and tangles know no measure.
template <class Law>
struct OddNetwork {
    static constexpr double dt = 0.1;

    OddNetwork(Random& random, const Law& law, const TriangleMesh<double>& mesh)
        : decades(random.number(0.0, 6.0)),
          network(mesh, law, {.stiffness = stiffnesses(30, 0.1, random), .rest_length = rest_lengths(random)}),
          foundation(mesh, {.stiffness = stiffnesses(12, 0.3, random), .damping = stiffnesses(12, 0.5, random)}) {}

    std::vector<double> stiffnesses(int count, double none, Random& random) const {
        std::vector<double> values(static_cast<std::size_t>(count));
        for (double& k : values) k = random.chance(none) ? 0 : std::pow(10, random.number(-decades, decades));
        return values;
    }
    static std::vector<double> rest_lengths(Random& random) {
        std::vector<double> values(30);
        for (double& r : values) r = random.chance(0.1) ? 0 : random.number(0.0, 2.0);
        return values;
    }

    /// What springs and foundation of `v` store and damping takes, less the work of `force`, and the size of its terms.
    struct Energy {
        long double sum = 0, size = 0;
        void add(long double term) { sum += term, size += std::abs(term); }
    };
    Energy energy(Index v, const Points<double>& x, const Vector3<double>& start, const Vector3<double>& force) const {
        Energy total;
        const Vector3<double> here = point(x, v), anchor = point(foundation.anchors(), v);
        const long double u = distance(here, anchor), change = u - distance(start, anchor);
        total.add(foundation.stiffness(v) * u * u / 2);
        total.add(foundation.damping(v) / dt * change * change / 2);
        for (int k = 0; k < 3; ++k) {
            total.add(-static_cast<long double>(force[k]) * (static_cast<long double>(here[k]) - start[k]));
        }
        for (const auto& end : network.springs_of(v)) {
            const long double length = distance(here, point(x, end.other)), stretch = length - end.rest_length;
            if constexpr (never_stiffens<Law>()) {
                total.add(end.stiffness * stretch * stretch / 2);
            } else {
                const SpringState<double> spring{end.stiffness, end.rest_length, static_cast<double>(length)};
                total.add(network.law()(spring).energy);
            }
        }
        return total;
    }

    double decades;
    MassSpringNetwork<double, Law> network;
    VirtualVolumeSprings<double> foundation;
};

/// Twelve vertices, jittered or tangled up.
Points<double> odd_positions(const TriangleMesh<double>& mesh, Random& random) {
    return test::jittered(mesh.positions(), random.chance(0.5) ? 0.05 : 2, random);
}

template <class Rule, class Law>
void no_visit_raises_the_energy(const Rule& rule, const Law& law, int seed) {
    CAPTURE(seed);
    Random random(static_cast<std::uint64_t>(seed));
    static const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const OddNetwork<Law> odd(random, law, mesh);
    QuasiStaticSolver solver(odd.network,
                             {.layers = 0, .sweeps = 1, .force_tolerance = 1e-290, .max_contact_points = 0}, rule);
    Points<double> x = odd_positions(mesh, random);
    for (int visit = 0; visit < 4; ++visit) {
        const std::array<Index, 1> vertex{random.index(12)};
        const auto ends = odd.network.springs_of(vertex[0]);
        if (!ends.empty() && random.chance(0.05)) x.col(vertex[0]) = x.col(ends[0].other);  // a spring of length zero
        const Points<double> from = x;
        const Vector3<double> start = point(x, vertex[0]), none = Vector3<double>::Zero();
        solver.reset();
        solver.wake(vertex);
        const auto report = solver.step(x, OddNetwork<Law>::dt, odd.network, odd.foundation);
        REQUIRE(report.status == StepStatus::advanced);
        REQUIRE(report.vertex_updates == 2);  // one, and the final residual
        const auto before = odd.energy(vertex[0], from, start, none), after = odd.energy(vertex[0], x, start, none);
        REQUIRE(after.sum <= before.sum + 64 * std::numeric_limits<double>::epsilon() * before.size);
        for (Index v = 0; v < 12; ++v) {
            if (v != vertex[0]) REQUIRE(point(x, v) == point(from, v));
        }
    }
}

}  // namespace

TEST_CASE("no safe visit raises the energy, on whatever linear springs", "[rule]") {
    for (int seed = 1; seed <= cases(50'000); ++seed) {
        const double omega = seed % 2 == 0 ? 1.99 : 0.1 + 1e-5 * seed;
        no_visit_raises_the_energy(SafeStep{omega}, LinearSpring{}, seed);
    }
}

TEST_CASE("no block visit raises the energy, on whatever linear springs", "[rule]") {
    for (int seed = 1; seed <= cases(50'000); ++seed) {
        const double omega = seed % 2 == 0 ? 1.99 : 0.1 + 1e-5 * seed;
        no_visit_raises_the_energy(BlockStep{omega}, LinearSpring{}, seed);
    }
}

TEST_CASE("no safe or block visit raises the energy, on springs that stiffen", "[rule]") {
    for (int seed = 1; seed <= cases(10'000); ++seed) {
        const double omega = seed % 2 == 0 ? 1.99 : 0.1 + 1e-5 * seed;
        no_visit_raises_the_energy(SafeStep{omega}, ExponentialSpring{}, seed);
        no_visit_raises_the_energy(BlockStep{omega}, ExponentialSpring{}, seed);
        no_visit_raises_the_energy(BlockStep{omega}, test::CubicSpring{}, seed);
    }
}

TEMPLATE_TEST_CASE("whole steps of safe updates never raise the energy", "[rule]", SafeStep, BlockStep) {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere({.radius = 1, .subdivisions = 2});
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
        const VirtualVolumeSprings foundation(mesh, {.stiffness = random.number()});
        QuasiStaticSolver solver(network, {.sweeps = 1 + random.index(5), .order = test::order_of(seed)},
                                 TestType{random.number(0.1, 1.99)});
        Points<double> x = test::jittered(mesh.positions(), 0.3, random);
        const auto energy = [&] {
            double sum = network.energy(x);
            for (Index v = 0; v < mesh.vertex_count(); ++v) sum += foundation.energy(v, point(x, v));
            return sum;
        };
        solver.wake_all();
        for (double before = energy(); before > 1e-9;) {
            const auto report = solver.step(x, 0.1, network, foundation);
            REQUIRE(report.status == StepStatus::advanced);
            if (report.converged) break;
            const double now = energy();
            REQUIRE(now <= before * (1 + 1e-14));
            before = now;
        }
    }
}

// ---- where the rule as published is stable

namespace {

/// The limit of dt^2 / m for vertex `v` of the mesh at rest, by hand: 2 over the largest eigenvalue of its own block.
template <class S>
S limit_of(const MassSpringNetwork<S, LinearSpring>& network, Index v, const Points<S>& x, S volume) {
    Eigen::Matrix3d block = Eigen::Matrix3d::Identity() * static_cast<double>(volume);
    for (const auto& end : network.springs_of(v)) {
        const Eigen::Vector3d u = (x.col(end.other) - x.col(v)).template cast<double>().normalized();
        block += static_cast<double>(end.stiffness) * u * u.transpose();
    }
    Eigen::Vector3d direction(1, 2, 3);  // power iteration
    for (int i = 0; i < 10'000; ++i) direction = (block * direction).normalized();
    return static_cast<S>(2 / (block * direction).norm());
}

}  // namespace

TEMPLATE_TEST_CASE("the rule as published converges up to its limit, and is refused beyond", "[rule]", TEST_SCALARS) {
    using S = TestType;
    const S dt = S(1e-3), volume = S(0.4);
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 2});
    const auto with_mass = [&](S mass) {
        return MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = S(1), .mass = mass});
    };
    const VirtualVolumeSprings foundation(mesh, {.stiffness = volume});
    S limit = std::numeric_limits<S>::max();
    for (Index v = 0; v < 162; ++v) {
        limit = std::min(limit, limit_of<S>(with_mass(1), v, mesh.positions(), volume));
    }
    // Small displacements, so that the eigenvalues stay what they are at rest.
    Random random(1);
    const Points<S> start = test::jittered(mesh.positions(), S(1e-3), random);
    for (const S part : {S(0.1), S(0.5), S(0.9), S(0.97)}) {
        CAPTURE(part);
        const auto network = with_mass(dt * dt / (part * limit));
        QuasiStaticSolver solver(network, {.layers = unlimited, .sweeps = 10}, MassStep{});
        Points<S> x = start;
        solver.wake_all();
        const auto report = test::run_to_equilibrium(solver, x, dt, network, foundation);
        REQUIRE(report.status == StepStatus::advanced);
        REQUIRE(report.converged);
        REQUIRE((x - mesh.positions()).cwiseAbs().maxCoeff() <
                200 * std::max(S(1e-9), std::numeric_limits<S>::epsilon()));
    }
    for (const S part : {S(1.03), S(1.1), S(2), S(1e3), S(1e9)}) {
        CAPTURE(part);
        const auto network = with_mass(dt * dt / (part * limit));
        QuasiStaticSolver solver(network, {.layers = unlimited, .sweeps = 10}, MassStep{});
        Points<S> x = start;
        solver.wake_all();
        const auto report = solver.step(x, dt, network, foundation);
        CHECK(report.status == StepStatus::unstable);
        CHECK_FALSE(report.converged);
        CHECK(report.moved.empty());
        CHECK(same_bits(x, start));
        // A smaller time step, and it goes on.
        CHECK(solver.step(x, dt * std::sqrt(S(0.5) / part), network, foundation).status == StepStatus::advanced);
    }
}

TEST_CASE("beyond its limit the rule as published does diverge: the refusal is no mere caution", "[rule]") {
    // A single vertex between six that are pinned: its own block is all there is.
    const auto mesh = disc({.radius = 1, .rings = 1});
    const double dt = 1e-3, limit = 2.0 / 3;  // six springs of 1 N/m in the plane
    const auto with_part = [&](double part) {
        return MassSpringNetwork(mesh, LinearSpring{},
                                 {.stiffness = 1.0, .mass = dt * dt / (part * limit), .pinned = {1, 2, 3, 4, 5, 6}});
    };
    const auto largest_displacement = [&](double part) {  // by hand, without the solver's check
        const auto network = with_part(part);
        Points<double> x = mesh.positions();
        x.col(0) = Vector3<double>(1e-6, 0, 0);
        for (int i = 0; i < 3000; ++i) x.col(0) += dt * dt / network.mass(0) * network.force_on(0, x).force;
        return norm(point(x, 0));
    };
    CHECK(largest_displacement(0.99) < 1e-9);
    CHECK(largest_displacement(1.01) > 1e-3);
    for (const auto& [part, status] : {std::pair(0.99, StepStatus::advanced), {1.01, StepStatus::unstable}}) {
        CAPTURE(part);
        const auto network = with_part(part);
        QuasiStaticSolver solver(network, {.layers = 0, .sweeps = 1}, MassStep{});
        Points<double> x = mesh.positions();
        x.col(0) = Vector3<double>(1e-6, 0, 0);
        solver.wake_all();
        CHECK(solver.step(x, dt, network, NoFoundation{}).status == status);
    }
}

TEST_CASE("dt of the rule as published from a millionth to a thousand seconds comes to a safe outcome", "[rule][bad]") {
    const auto mesh = icosphere({.radius = 0.01, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0, .mass = 1e-4});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0, .damping = 0.02});
    const Vector3<double> target = 1.2 * point(mesh.positions(), 7);
    for (double dt = 1e-6; dt <= 1e3; dt *= 3) {
        CAPTURE(dt);
        QuasiStaticSolver published(network, {}, MassStep{});
        QuasiStaticSolver safe(network, {}, SafeStep{});
        Points<double> x = mesh.positions(), y = x;
        for (int i = 0; i < 200; ++i) {
            const Points<double> before = x;
            const auto report = published.step(x, dt, network, foundation, pull(7, target));
            REQUIRE(is_finite(x));
            if (report.status != StepStatus::advanced) {
                REQUIRE(report.status == StepStatus::unstable);
                REQUIRE(same_bits(x, before));
            }
            REQUIRE(safe.step(y, dt, network, foundation, pull(7, target)).status == StepStatus::advanced);
        }
        REQUIRE((y - mesh.positions()).cwiseAbs().maxCoeff() < 0.0021);
    }
}

namespace {

/// A rule of a user's own: half as far as is safe.
struct HalfStep {
    template <Real Scalar>
    [[nodiscard]] Scalar compliance(const VertexState<Scalar>& vertex) const noexcept {
        return vertex.stiffness > 0 ? 1 / (2 * vertex.stiffness) : Scalar(0);
    }
};

}  // namespace

TEST_CASE("a rule of one's own finds the same equilibrium", "[rule]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.5});
    const SolverOptions<double> options{.force_tolerance = 1e-13};
    const Vector3<double> target = 1.2 * point(mesh.positions(), 7);
    QuasiStaticSolver own(network, options, HalfStep{});
    QuasiStaticSolver stock(network, options);
    Points<double> x = mesh.positions(), y = x;
    REQUIRE(test::run_to_equilibrium(own, x, 0.1, network, foundation, pull(7, target)).converged);
    REQUIRE(test::run_to_equilibrium(stock, y, 0.1, network, foundation, pull(7, target)).converged);
    CHECK((x - y).cwiseAbs().maxCoeff() < 1e-11);
}
