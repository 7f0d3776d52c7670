// SPDX-License-Identifier: MIT
#include <membrane/model/mass_spring_network.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/model/volume_springs.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/element_check.hpp"
#include "support/meshes.hpp"
#include "support/refusal.hpp"
#include "support/spring_law_check.hpp"
#include "support/vertex_energy.hpp"

using namespace membrane;
using test::Random;

// A member of a class names no law unless it is its own.
static_assert(std::is_same_v<MassSpringNetwork<float>, MassSpringNetwork<float, LinearSpring>>);

// A law without numbers of its own takes no memory.
static_assert(sizeof(MassSpringNetwork<double, LinearSpring>) < sizeof(MassSpringNetwork<double, ExponentialSpring>));

namespace {

/// Side of the smallest box around all points, to measure errors by.
template <class S>
S size_of(const Points<S>& x) {
    return (x.rowwise().maxCoeff() - x.rowwise().minCoeff()).maxCoeff();
}

template <class S>
std::vector<S> random_numbers(std::size_t count, S low, S high, Random& random) {
    std::vector<S> numbers(count);
    for (S& number : numbers) number = random.number(low, high);
    return numbers;
}

/// A mesh with springs of stiffness 1 to 100, every tenth of them left out.
template <class S, class Law>
auto random_network(const TriangleMesh<S>& mesh, const Law& law, Random& random) {
    auto stiffness = random_numbers<S>(edges(mesh).size(), 1, 100, random);
    for (S& k : stiffness) {
        if (random.chance(0.1)) k = 0;
    }
    return MassSpringNetwork(mesh, law, {.stiffness = stiffness});
}

/// The mesh's edges are stretched and pressed, but not beyond what every law can stand.
template <class S>
Points<S> deformed(const TriangleMesh<S>& mesh, Random& random) {
    const Adjacency adjacency(mesh);
    S edge = std::numeric_limits<S>::max();
    for (const auto& [first, second] : adjacency.edges()) {
        edge = std::min(edge, norm<S>(point(mesh.positions(), first) - point(mesh.positions(), second)));
    }
    return test::jittered(mesh.positions(), S(0.2) * edge, random);
}

template <class Law>
void forces_are_minus_the_gradient_of_the_energy(const Law& law) {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto surface = test::random_surface<double>(random);
        surface.x.colwise() -= surface.x.rowwise().mean().eval();
        const auto mesh = surface.mesh();
        const auto network = random_network(mesh, law, random);
        Points<double> x = deformed(mesh, random);
        const double h = 1e-5 * size_of(x) / std::sqrt(x.cols());
        for (int n = 0; n < 10; ++n) {
            const Index v = random.index(mesh.vertex_count());
            const auto pull = network.force_on(v, x);
            Vector3<double> difference;
            for (int k = 0; k < 3; ++k) {
                const double here = x(k, v);
                x(k, v) = here + h;
                const double after = network.energy(x);
                x(k, v) = here - h;
                difference[k] = -(after - network.energy(x)) / (2 * h);
                x(k, v) = here;
            }
            const double scale = norm(pull.force) + pull.stiffness * h;
            REQUIRE(norm<double>(pull.force - difference) <= 1e-6 * scale + 1e-14 * network.energy(x) / h);
        }
    }
}

}  // namespace

TEST_CASE("forces are the negative gradient of the energy, for every law", "[network]") {
    SECTION("linear") { forces_are_minus_the_gradient_of_the_energy(LinearSpring{}); }
    SECTION("exponential") { forces_are_minus_the_gradient_of_the_energy(ExponentialSpring{}); }
    SECTION("exponential beyond its limit") {
        forces_are_minus_the_gradient_of_the_energy(ExponentialSpring{.stiffening = 5, .strain_limit = 0.05});
    }
    SECTION("of one's own") { forces_are_minus_the_gradient_of_the_energy(test::CubicSpring{}); }
}

TEST_CASE("spring forces have zero sum and zero moment", "[network]") {
    const auto check = [](const auto& law) {
        for (int seed = 1; seed <= cases(100); ++seed) {
            CAPTURE(seed);
            Random random(static_cast<std::uint64_t>(seed));
            const auto mesh = test::random_surface<double>(random).mesh();
            const auto network = random_network(mesh, law, random);
            const Points<double> x = deformed(mesh, random);
            const Vector3<double> middle = x.rowwise().mean();
            Vector3<double> sum(0, 0, 0), moment(0, 0, 0);
            double forces = 0, moments = 0;
            for (Index v = 0; v < mesh.vertex_count(); ++v) {
                const Vector3<double> force = network.force_on(v, x).force, arm = point(x, v) - middle;
                sum += force;
                moment += cross(arm, force);
                forces += norm(force);
                moments += norm(arm) * norm(force);
            }
            REQUIRE(forces > 0);
            REQUIRE(norm(sum) <= 1e-12 * forces);
            REQUIRE(norm(moment) <= 1e-12 * moments);
        }
    };
    SECTION("linear") { check(LinearSpring{}); }
    SECTION("exponential") { check(ExponentialSpring{}); }
    SECTION("of one's own") { check(test::CubicSpring{}); }
}

TEMPLATE_TEST_CASE("a rigid motion causes no tension", "[network]", TEST_SCALARS) {
    using S = TestType;
    const auto check = [](const auto& law) {
        for (int seed = 1; seed <= cases(100); ++seed) {
            CAPTURE(seed);
            Random random(static_cast<std::uint64_t>(seed));
            auto surface = test::random_surface<S>(random);
            surface.x.colwise() -= surface.x.rowwise().mean().eval();
            const auto mesh = surface.mesh();
            const auto network = random_network(mesh, law, random);
            const S size = size_of(surface.x);
            Points<S> x = random.rotation<S>() * surface.x;
            x.colwise() += (size * random.vector<S>()).eigen();
            const S error = 16 * std::numeric_limits<S>::epsilon() * size;  // of an elongation
            for (Index s = 0; s < static_cast<Index>(network.springs().size()); ++s) {
                REQUIRE(std::abs(network.tension(s, x)) <= 100 * error);
            }
            for (Index v = 0; v < mesh.vertex_count(); ++v) {
                REQUIRE(norm(network.force_on(v, x).force) <= network.force_on(v, x).stiffness * error);
            }
            REQUIRE(network.energy(x) <= static_cast<S>(network.springs().size()) * 100 * error * error);
            REQUIRE(network.energy(surface.x) == 0);
        }
    };
    SECTION("linear") { check(LinearSpring{}); }
    SECTION("exponential") { check(ExponentialSpring{}); }
}

TEMPLATE_TEST_CASE("one spring, by hand", "[network]", TEST_SCALARS) {
    using S = TestType;
    Points<S> x(3, 3);
    x << 0, 3, 0,  //
        0, 0, 4,   //
        0, 0, 0;
    const TriangleMesh<S> mesh(x, Eigen::Vector3i(0, 1, 2));
    // The edges are 0-1, 0-2, 1-2, of lengths 3, 4, 5.
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = std::vector<S>{2, 0, 10}});
    REQUIRE(network.springs().size() == 2);
    CHECK(network.springs()[0].first == 0);
    CHECK(network.springs()[0].second == 1);
    CHECK(network.springs()[0].stiffness == 2);
    CHECK(network.springs()[0].rest_length == 3);
    CHECK(network.springs()[1].rest_length == 5);
    CHECK(network.springs_of(0).size() == 1);
    CHECK(network.springs_of(1).size() == 2);

    x(0, 1) = 5;  // spring 0-1 is stretched by 2; spring 1-2 is sqrt(41) long
    CHECK(network.tension(0, x) == 4);
    const S length = std::sqrt(S(41));
    CHECK(network.tension(1, x) == Approx(10 * (length - 5)));
    const auto first = network.force_on(0, x);
    CHECK(first.force == Vector3<S>(4, 0, 0));  // towards the other end
    CHECK(first.stiffness == 2);
    const auto second = network.force_on(1, x);
    CHECK(second.force.x() == Approx(-4 - 10 * (length - 5) * 5 / length));
    CHECK(second.force.y() == Approx(10 * (length - 5) * 4 / length));
    CHECK(second.stiffness == 12);
    CHECK(network.energy(x) == Approx(4 + 5 * (length - 5) * (length - 5)));
}

TEST_CASE("springs are the mesh's edges, seen alike from both ends", "[network]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::with_holes(test::random_surface<double>(random), random).mesh();
        const Adjacency adjacency(mesh);
        auto stiffness = random_numbers(adjacency.edges().size(), 1.0, 100.0, random);
        for (double& k : stiffness) {
            if (random.chance(0.2)) k = 0;
        }
        const auto rest = random_numbers(adjacency.edges().size(), 0.0, 1.0, random);
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = stiffness, .rest_length = rest});
        REQUIRE(network.vertex_count() == mesh.vertex_count());
        std::size_t s = 0, ends = 0;
        for (std::size_t e = 0; e < adjacency.edges().size(); ++e) {
            if (stiffness[e] == 0) continue;
            const auto& spring = network.springs()[s++];
            REQUIRE(spring.first == adjacency.edges()[e][0]);
            REQUIRE(spring.second == adjacency.edges()[e][1]);
            REQUIRE(spring.stiffness == stiffness[e]);
            REQUIRE(spring.rest_length == rest[e]);
            for (const auto& [v, other] : {std::pair(spring.first, spring.second), {spring.second, spring.first}}) {
                const auto row = network.springs_of(v);
                const auto end = std::find_if(row.begin(), row.end(), [&, w = other](auto& i) { return i.other == w; });
                REQUIRE(end != row.end());
                REQUIRE(end->stiffness == spring.stiffness);
                REQUIRE(end->rest_length == spring.rest_length);
            }
        }
        REQUIRE(s == network.springs().size());
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            const auto row = network.springs_of(v);
            ends += row.size();
            REQUIRE(std::is_sorted(row.begin(), row.end(), [](auto& a, auto& b) { return a.other < b.other; }));
        }
        REQUIRE(ends == 2 * s);
    }
}

TEMPLATE_TEST_CASE("a spring of length zero has no direction, no force, and its stiffness", "[network]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 1});
    for (const S rest : {S(0), S(1)}) {
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = S(2), .rest_length = rest});
        const Points<S> x = Points<S>::Zero(3, mesh.vertex_count());
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            REQUIRE(network.force_on(v, x).force == Vector3<S>(0, 0, 0));
            REQUIRE(network.force_on(v, x).stiffness == static_cast<S>(2 * network.springs_of(v).size()));
        }
        REQUIRE(network.energy(x) == rest * rest * static_cast<S>(network.springs().size()));
        const MassSpringNetwork stiffening(mesh, ExponentialSpring{}, {.stiffness = S(2), .rest_length = rest});
        REQUIRE(stiffening.force_on(0, x).force == Vector3<S>(0, 0, 0));
        REQUIRE(is_finite(stiffening.energy(x)));
    }
}

TEST_CASE("forces are read from anybody's memory", "[network]") {
    Random random(3);
    const auto mesh = icosphere<float>({.radius = 1, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 5.0F});
    const Points<float> x = test::jittered(mesh.positions(), 0.05F, random);
    std::vector<float> buffer(8 * 162, std::nanf(""));
    Eigen::Map<Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> interleaved(buffer.data(), 3, 162, Eigen::OuterStride<>(8));
    interleaved = x;
    for (Index v = 0; v < 162; ++v) REQUIRE(network.force_on(v, interleaved).force == network.force_on(v, x).force);
    CHECK(network.energy(interleaved) == network.energy(x));
}

TEMPLATE_TEST_CASE("masses, viscosities and pins are as given", "[network]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 0});
    const MassSpringNetwork bare(mesh, LinearSpring{}, {.stiffness = S(1)});
    CHECK_FALSE(bare.has_masses());
    CHECK(bare.viscosity(11) == 0);
    for (Index v = 0; v < 12; ++v) CHECK_FALSE(bare.pinned(v));

    std::vector<S> mass(12), viscosity(12);
    for (std::size_t v = 0; v < 12; ++v) mass[v] = S(1) + S(v), viscosity[v] = S(v) / 10;
    const MassSpringNetwork full(mesh, LinearSpring{},
                                 {.stiffness = S(1), .mass = mass, .viscosity = viscosity, .pinned = {3, 7, 3}});
    CHECK(full.has_masses());
    for (Index v = 0; v < 12; ++v) {
        CHECK(full.mass(v) == mass[static_cast<std::size_t>(v)]);
        CHECK(full.viscosity(v) == viscosity[static_cast<std::size_t>(v)]);
        CHECK(full.pinned(v) == (v == 3 || v == 7));
    }
    const MassSpringNetwork uniform(mesh, LinearSpring{}, {.stiffness = S(1), .mass = S(2), .viscosity = S(3)});
    CHECK(uniform.mass(11) == 2);
    CHECK(uniform.viscosity(11) == 3);
    const MassSpringNetwork clamped(mesh, LinearSpring{},
                                    {.stiffness = S(1), .pinned = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}});
    for (Index v = 0; v < 12; ++v) CHECK(clamped.pinned(v));
}

TEMPLATE_TEST_CASE("a negligible force is small beside the springs' and large beside rounding", "[network]",
                   TEST_SCALARS) {
    using S = TestType;
    const S epsilon = std::numeric_limits<S>::epsilon();
    for (const S radius : {S(1e-3), S(1), S(1e3)}) {
        for (const S k : {S(1e-3), S(1), S(1e3)}) {
            const auto mesh = icosphere<S>({.radius = radius, .subdivisions = 2});
            const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = k});
            S longest = 0;
            for (const auto& spring : network.springs()) longest = std::max(longest, spring.rest_length);
            const S largest = mesh.positions().cwiseAbs().maxCoeff();
            CHECK(network.force_tolerance() ==
                  Approx(k * std::max(longest * S(1e-9), 16 * epsilon * largest)).epsilon(1e-6));
        }
    }
    for (int seed = 1; seed <= cases(50); ++seed) {  // away from the origin: half a spacing in each coordinate
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto sphere = icosphere<S>({.radius = 1, .subdivisions = 2});  // a vertex has six springs
        const S far = random.number<S>(S(2), S(100));
        const Points<S> x = sphere.positions().colwise() + (far * random.unit_vector<S>()).eigen();
        const S force = MassSpringNetwork(TriangleMesh<S>(x, sphere.triangles()), LinearSpring{}, {.stiffness = S(40)})
                            .force_tolerance();
        const S spacing = epsilon * x.cwiseAbs().maxCoeff();
        CHECK(force >= 40 * 6 * std::sqrt(S(0.75)) * spacing);
        CHECK(force <= 40 * std::max({6 * S(0.88) * spacing, 17 * epsilon, S(1e-9)}));
    }
    const auto mesh = icosphere<S>({.subdivisions = 1});
    CHECK(MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = S(0)}).force_tolerance() == 0);
    const MassSpringNetwork slack(mesh, LinearSpring{}, {.stiffness = S(0)});
    CHECK(slack.springs().empty());
}

namespace {

/// Parts of a scene, their constants written where the parts are made: not every compiler takes that lightly.
struct Scene {
    explicit Scene(const TriangleMesh<double>& mesh)
        : network(mesh, LinearSpring{}, {.stiffness = 1.0}), foundation{mesh, {.stiffness = 2.0}} {}
    MassSpringNetwork<double, LinearSpring> network;
    VirtualVolumeSprings<double> foundation;
};

MassSpringNetwork<double, LinearSpring> network_of(const TriangleMesh<double>& mesh) {
    return {mesh, LinearSpring{}, {.stiffness = 3.0}};
}

VirtualVolumeSprings<double> foundation_of(const TriangleMesh<double>& mesh) { return {mesh, {.stiffness = 4.0}}; }

}  // namespace

TEST_CASE("constants may be written in the midst of another initialiser", "[network]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const Scene scene(mesh);
    CHECK(scene.network.springs()[0].stiffness == 1.0);
    CHECK(scene.foundation.stiffness(0) == 2.0);
    const auto network = network_of(mesh);
    CHECK(network.springs()[0].stiffness == 3.0);
    CHECK(foundation_of(mesh).stiffness(0) == 4.0);
}

TEST_CASE("a network owns what it knows", "[network]") {
    Random random(5);
    auto mesh = std::make_unique<TriangleMesh<double>>(test::random_surface<double>(random).mesh());
    const Points<double> x = deformed(*mesh, random);
    auto first = std::make_unique<MassSpringNetwork<double, ExponentialSpring>>(
        *mesh, ExponentialSpring{.stiffening = 7}, NetworkOptions<double>{.stiffness = 3.0});
    mesh.reset();
    const double energy = first->energy(x);
    const auto copy = *first;
    const auto moved = std::move(*first);
    first.reset();
    CHECK(copy.energy(x) == energy);
    CHECK(moved.energy(x) == energy);
    CHECK(moved.law().stiffening == 7);
    STATIC_REQUIRE(noexcept(copy.force_on(0, std::declval<const ConstPointsRef<double>&>())));
    STATIC_REQUIRE(noexcept(copy.energy(std::declval<const ConstPointsRef<double>&>())));
}

TEMPLATE_TEST_CASE("a network that makes no sense is refused by name", "[network][bad]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 0});  // 12 vertices, 30 edges
    const auto refused = [&](const NetworkOptions<S>& options) {
        return test::refusal([&] { MassSpringNetwork(mesh, LinearSpring{}, options); });
    };
    const std::string name = "MassSpringNetwork: ";
    CHECK(refused({}) == name + "stiffness of the springs [N/m] is required");
    CHECK(refused({.stiffness = std::vector<S>(29, 1)}) ==
          name + "stiffness must be one number or one for each spring (30), got 29");
    CHECK(refused({.stiffness = S(1), .mass = std::vector<S>(13, 1)}) ==
          name + "mass must be one number or one for each vertex (12), got 13");
    CHECK(refused({.stiffness = S(1), .viscosity = std::vector<S>(30, 1)}) ==
          name + "viscosity must be one number or one for each vertex (12), got 30");
    CHECK(refused({.stiffness = S(1), .rest_length = std::vector<S>(12, 1)}) ==
          name + "rest length must be one number or one for each spring (30), got 12");

    for (const auto& [wrong, text] : {std::pair<S, std::string>{S(-3), "-3"},
                                      {std::numeric_limits<S>::infinity(), "inf"},
                                      {std::numeric_limits<S>::quiet_NaN(), "nan"}}) {
        std::vector<S> springs(30, 1), vertices(12, 1);
        springs[17] = vertices[11] = wrong;
        CHECK(refused({.stiffness = springs}) ==
              name + "stiffness of spring 17 must be finite and not negative [N/m], got " + text);
        CHECK(refused({.stiffness = wrong}) == name + "stiffness must be finite and not negative [N/m], got " + text);
        CHECK(refused({.stiffness = S(1), .mass = vertices}) ==
              name + "mass of vertex 11 must be finite and positive [kg], got " + text);
        CHECK(refused({.stiffness = S(1), .viscosity = vertices}) ==
              name + "viscosity of vertex 11 must be finite and not negative [N s/m], got " + text);
        CHECK(refused({.stiffness = S(1), .rest_length = springs}) ==
              name + "rest length of spring 17 must be finite and not negative [m], got " + text);
    }
    CHECK(refused({.stiffness = S(1), .mass = S(0)}) == name + "mass must be finite and positive [kg], got 0");
    CHECK(refused({.stiffness = S(1), .rest_length = S(0)}) == "");
    CHECK(refused({.stiffness = S(0), .viscosity = S(0)}) == "");

    CHECK(refused({.stiffness = S(1), .pinned = {0, 12}}) == name + "pinned 1 names vertex 12, expected 0 to 11");
    CHECK(refused({.stiffness = S(1), .pinned = {-1}}) == name + "pinned 0 names vertex -1, expected 0 to 11");
    CHECK(refused({.stiffness = S(1), .pinned = {4, 4, 4}}) == "");
    CHECK(test::refusal([&] { MassSpringNetwork(mesh, ExponentialSpring{.stiffening = -1}, {.stiffness = S(1)}); }) ==
          "ExponentialSpring: stiffening must be finite and positive, got -1");
}

// ---- the energy around a vertex

namespace {

/// A vertex whose springs are stretched, pressed together, without length or rest length, of 1 to 1e6 N/m.
template <class S>
struct OddVertex {
    explicit OddVertex(Random& random)
        : mesh(icosphere<S>({.radius = 1, .subdivisions = 1})),
          network(mesh, LinearSpring{}, {.stiffness = stiffnesses(random), .rest_length = rest_lengths(random)}),
          x(test::jittered(mesh.positions(), static_cast<S>(random.chance(0.5) ? 0.02 : 1), random)),
          v(random.index(42)) {
        if (random.chance(0.2)) x.col(v) = x.col(network.springs_of(v).front().other);
    }
    static std::vector<S> stiffnesses(Random& random) {
        std::vector<S> values(120);
        for (S& k : values) k = static_cast<S>(std::pow(10, random.number(0.0, 6.0)));
        return values;
    }
    static std::vector<S> rest_lengths(Random& random) {
        std::vector<S> values(120);
        for (S& r : values) r = random.chance(0.1) ? S(0) : random.number<S>(0, 2);
        return values;
    }
    TriangleMesh<S> mesh;
    MassSpringNetwork<S, LinearSpring> network;
    Points<S> x;
    Index v;
};

}  // namespace

TEST_CASE("a curved pull is the pull, and bounds the energy all around", "[network]") {
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const OddVertex<double> odd(random);
        const auto curved = test::majoriser(odd.network, odd.v, odd.x);
        const auto pull = odd.network.force_on(odd.v, odd.x);
        REQUIRE(norm<double>(curved.force - pull.force) <= 1e-12 * norm(pull.force));
        REQUIRE(curved.stiffness == Approx(pull.stiffness));

        const Vector3<double> displacement = std::pow(10, random.number(-4.0, 1.0)) * random.vector();
        const double longest = norm(displacement) * (1 + random.index(2) * random.number());
        const Vector3<double> relieved = curved.stiffness_reduction * displacement;
        const double bend =
            curved.stiffness * squared_norm(displacement) - dot(displacement, relieved) / (1 + longest / curved.size);
        Points<double> there = odd.x;
        there.col(odd.v) += displacement;
        const double before = odd.network.energy(odd.x), after = odd.network.energy(there);
        REQUIRE(after <= before - dot(curved.force, displacement) + bend / 2 + 1e-12 * (before + after));
        const auto energy = test::energy_change(odd.network, odd.v, displacement, odd.x);
        REQUIRE(std::abs(energy.change - (after - before)) <= 1e-12 * (before + after + energy.size));
        REQUIRE(dot(displacement, relieved) >= -1e-12 * curved.stiffness * squared_norm(displacement));
        REQUIRE(curved.stiffness_reduction.trace() <= 2 * curved.stiffness * (1 + 1e-12));
    }
}

TEST_CASE("where no spring is pressed together, a curved pull has the curvature of the forces", "[network]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
        const MassSpringNetwork network(mesh, ExponentialSpring{}, {.stiffness = 3.0});
        Points<double> x = 1.1 * test::jittered(mesh.positions(), 0.01, random);
        const Index v = random.index(42);
        const auto curved = test::majoriser(network, v, x);
        const double h = 1e-6;
        for (int k = 0; k < 3; ++k) {
            const Vector3<double> along = Vector3<double>::Unit(k);
            Points<double> there = x, back = x;
            there(k, v) += h;
            back(k, v) -= h;
            const Vector3<double> found =
                (network.force_on(v, back).force - network.force_on(v, there).force) / (2 * h);
            const Vector3<double> expected = curved.stiffness * along - curved.stiffness_reduction * along;
            REQUIRE(norm<double>(found - expected) < 1e-5 * curved.stiffness);
        }
    }
}

TEST_CASE("no spring is less stiff than the bound while its ends are near", "[network]") {
    int known = 0;
    double tightest = 1;
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Spring<double> spring{0, 1, random.number(0.1, 10.0), random.number(0.0, 2.0)};
        const Vector3<double> edge_vector = random.number(0.2, 2.0) * random.unit_vector();
        const double displacement = std::pow(10, random.number(-6.0, 0.0)) * norm(edge_vector);
        CAPTURE(spring.stiffness, spring.rest_length, norm(edge_vector), displacement);
        const auto bound = min_stiffness(spring, edge_vector, displacement);
        if (!bound) continue;
        ++known;
        const Eigen::Matrix3d along = bound->direction * bound->direction.transpose();
        const Eigen::Matrix3d least = bound->along * along + bound->across * (Eigen::Matrix3d::Identity() - along);
        for (int i = 0; i < 10; ++i) {
            const double part = i == 0 ? 1 : random.number();
            const Vector3<double> aside = i == 0 ? Vector3<double>(-bound->direction) : random.unit_vector();
            const Vector3<double> there = edge_vector + part * displacement * aside, u = there / norm(there);
            const double q = spring.rest_length / norm(there);
            const Eigen::Matrix3d stiffness =
                spring.stiffness * ((1 - q) * Eigen::Matrix3d::Identity() + q * u * u.transpose());
            const double above = test::eigenvalues_of(stiffness - least)[0];
            REQUIRE(above >= -1e-13 * spring.stiffness);
            tightest = std::min(tightest, above / spring.stiffness);
            REQUIRE(test::eigenvalues_of(stiffness).cwiseAbs().maxCoeff() <= spring.stiffness * (1 + 1e-12));
        }
    }
    CHECK(known > cases(20'000) / 4);
    CHECK(tightest < 1e-10);
}

TEST_CASE("springs that may become too short have no bound", "[network]") {
    const Spring<double> spring{0, 1, 1, 1};
    CHECK(min_stiffness(spring, {1, 0, 0}, 0.1));
    CHECK_FALSE(min_stiffness(spring, {1, 0, 0}, 0.5));
    CHECK_FALSE(min_stiffness(spring, {0.5, 0, 0}, 0.01));
    CHECK_FALSE(min_stiffness(spring, {0, 0, 0}, 0));
    CHECK(min_stiffness(Spring<double>{0, 1, 1, 0}, {1, 0, 0}, 0.4));
    CHECK_FALSE(min_stiffness(Spring<double>{0, 1, 1, 0}, {1, 0, 0}, 0.6));
}

TEST_CASE("a spring is an element: force, blocks and changes are of one energy", "[network]") {
    const auto check = [](const auto& law, Random& random) {
        const double k = random.number(0.1, 10.0), rest = random.number(0.5, 2.0);
        const SpringElement<double, std::remove_cvref_t<decltype(law)>> spring{&law, k, rest};
        const Vector3<double> here = random.vector();
        const Vector3<double> there = here + rest * random.number(0.4, 1.4) * random.unit_vector();
        const double energy = 100 * k * rest * rest;
        test::check_element(spring, {here, there}, 0.1 * rest, energy, random);
        test::check_hessian(spring, {here, there}, 0.1 * rest, energy);
        const Corners<double, 2> x{here, there};
        const Vector3<double> edge_vector = there - here;
        for (const auto& [i, towards] : {std::pair(0, edge_vector), std::pair(1, Vector3<double>(-edge_vector))}) {
            const auto pull = spring.force_on(x, static_cast<std::size_t>(i));
            REQUIRE(pull.force == spring_force(law, towards, k, rest).force());
            const Eigen::Matrix3d exact = spring.hessian_block(x, static_cast<std::size_t>(i), 0) * (i == 0 ? 1 : -1);
            REQUIRE(test::eigenvalues_of(dense(pull.hessian) - exact)[0] > -1e-12 * k);  // its positive part
        }
    };
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        check(LinearSpring{}, random);
        check(ExponentialSpring{.stiffening = 3}, random);
    }
}

TEST_CASE("a spring without a length has no force, and resists alike in all directions", "[network]") {
    const LinearSpring law;
    const SpringElement<double, LinearSpring> spring{&law, 3, 2};
    const Corners<double, 2> x{Vector3<double>(1, 2, 3), Vector3<double>(1, 2, 3)};
    CHECK(spring.force_on(x, 0).force == Vector3<double>(0, 0, 0));
    CHECK(spring.hessian_block(x, 0, 0) == 3 * Eigen::Matrix3d::Identity());
    CHECK(spring.hessian_block(x, 1, 0) == -3 * Eigen::Matrix3d::Identity());
    CHECK(spring.energy(x) == Approx(6));
}
