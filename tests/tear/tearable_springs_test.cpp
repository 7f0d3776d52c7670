// SPDX-License-Identifier: MIT
#include <membrane/tear/tearable_springs.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <set>
#include <type_traits>
#include <vector>

#include <membrane/model/volume_springs.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/fung.hpp>
#include <membrane/tissue/neo_hookean.hpp>
#include <membrane/tissue/spring_stiffness.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random_tear.hpp"
#include "support/refusal.hpp"

using namespace membrane;

static_assert(std::is_same_v<TearableSprings<float>, TearableSprings<float, LinearSpring>>);

namespace {

constexpr Material material{.young_modulus = 2e3, .poisson_ratio = 0.4, .thickness = 1e-3};

// A vertex of the reserve has some mass, which a split replaces.
auto springs_of(const TriangleMesh<double>& mesh) {
    auto mass = vertex_masses(mesh, material);
    for (double& of_vertex : mass) of_vertex = of_vertex > 0 ? of_vertex : 1.0;
    return MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = spring_stiffnesses(mesh, material), .mass = mass});
}

auto tissue_of(const TriangleMesh<double>& mesh, const auto& springs, double rigidity) {
    return Tissue(springs, triangular_springs(mesh, material, 1.1), neo_hookean(mesh, material, 1.05),
                  fung(mesh, material, {.stiffening = 2}, 1.02), bending_springs(mesh, rigidity));
}

Points<double> shaken(const TriangleMesh<double>& mesh, test::Random& random) {
    Points<double> x = mesh.positions();
    for (double& number : x.reshaped()) number = 1.2 * number + random.number(-0.02, 0.02);
    return x;
}

// Moves an inner vertex that is not beside a cut, as a tear does; returns whether it has moved.
bool move_at_random(test::Random& random, TornSurface<double>& surface, PointsRef<double>& x) {
    const Index v = random.index(60);
    if (surface.adjacency().on_border(v)) return false;
    const Vector3<double> from = point(surface.rest_positions(), v);
    const Vector3<double> by(random.number(-0.05, 0.05), random.number(-0.05, 0.05), 0);
    return surface.move_vertex(x, v, from + by, 0.3);
}

template <class Found, class Expected>
void check_equal(const Found& found, const Expected& expected, const Points<double>& x) {
    for (Index v = 0; v < found.vertex_count(); ++v) {
        CAPTURE(v);
        const auto force = found.force_on(v, x), right = expected.force_on(v, x);
        const double size = norm(right.force) + right.stiffness * 1e-3;
        REQUIRE(norm<double>(force.force - right.force) <= 1e-9 * size);
        REQUIRE(force.stiffness == Approx(right.stiffness).epsilon(1e-9));
        std::set<Index> joined, all;
        for (const auto& end : found.neighbours(v)) joined.insert(end.other);
        for (const auto& end : expected.neighbours(v)) all.insert(end.other);
        REQUIRE(std::includes(joined.begin(), joined.end(), all.begin(), all.end()));
        REQUIRE(joined.size() == found.neighbours(v).size());
    }
}

}  // namespace

// The oracle is built anew of the torn triangles at their present rest positions.
TEST_CASE("after random cuts and moved vertices springs and elements are those of the torn mesh", "[tear]") {
    int events = 0, moves = 0;
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = with_reserve(disc<double>({.radius = 1, .rings = 6}), 25);
        Tearing tear(mesh, EnergyRelease{1, 1});
        const bool bends = seed % 2 == 0;  // hinges keep their constants where a vertex moves
        const double rigidity = bends ? 1e-3 : 0;
        TearableSprings springs(mesh, springs_of(mesh));
        auto tissue = tissue_of(mesh, springs, rigidity);
        Points<double> all = mesh.positions();
        TornSurface<double> moved_surface(mesh);
        for (int n = 0; n < 8; ++n) {
            for (const auto& event : test::cut_at_random(random, tear, all)) {
                follow(event, springs, tissue);
                ++events;
            }
            const TriangleMesh<double> torn(tear.surface().rest_positions(), tear.surface().triangles());
            const auto x = shaken(torn, random);
            check_equal(springs, springs_of(torn), x);
            check_equal(tissue, tissue_of(torn, springs_of(torn), rigidity), x);
            double energy = 0, parts = 0;
            tissue.for_each_element([&](const auto& instance) {
                if (instance.corners.size() < 4) energy += instance.element.energy(instance.where(x));
            });
            for (Index f = 0; f < torn.triangle_count(); ++f) {
                parts += tissue.triangle_response(f, tear.surface().corners(f), x).energy;
            }
            REQUIRE(parts == Approx(energy));
        }
        double mass = 0, expected = 0;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            if (!tear.surface().adjacency().triangles_of(v).empty()) mass += springs.mass(v);
        }
        for (const double of_vertex : vertex_masses(mesh, material)) expected += of_vertex;
        CHECK(mass == Approx(expected));

        // Vertices that move, on the mesh before any cut.
        if (bends) continue;
        TearableSprings shifted(mesh, springs_of(mesh));
        auto reshaped = tissue_of(mesh, shifted, 0);
        PointsRef<double> ref = all;
        for (int n = 0; n < 10; ++n) {
            moved_surface.begin();
            if (!move_at_random(random, moved_surface, ref)) continue;
            ++moves;
            follow(moved_surface.events()[0], shifted, reshaped);
            const TriangleMesh<double> torn(moved_surface.rest_positions(), mesh.triangles());
            const auto x = shaken(torn, random);
            check_equal(shifted, springs_of(torn), x);
            check_equal(reshaped, tissue_of(torn, springs_of(torn), 0), x);
        }
    }
    CHECK(events > cases(40));
    CHECK(moves > cases(40));
}

namespace {

template <Real Scalar>
auto network_of(const TriangleMesh<Scalar>& mesh, const std::vector<Index>& pinned) {
    return MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = spring_stiffnesses(mesh, material), .pinned = pinned});
}

template <Real Scalar>
auto sheet_of(const TriangleMesh<Scalar>& mesh, const auto& springs) {
    return Tissue(springs, triangular_springs(mesh, material, 1.1), neo_hookean(mesh, material),
                  fung(mesh, material, {.stiffening = 2}, 1.02));
}

std::set<Index> others_of(const auto& ends) {
    std::set<Index> all;
    for (const auto& end : ends) all.insert(end.other);
    REQUIRE(all.size() == ends.size());
    return all;
}

// Energies, forces and neighbours of all vertices; the tolerance is of stiffness times size.
template <Real Scalar>
void check_same(const auto& found, const auto& expected, const TornSurface<Scalar>& surface, const Points<Scalar>& x,
                double tolerance) {
    std::vector<Vector3<double>> forces(static_cast<std::size_t>(x.cols()), Vector3<double>::Zero());
    double energy = 0, right_energy = 0, all_energy = 0;
    for (Index f = 0; f < surface.triangles().cols(); ++f) {
        const auto corners = surface.corners(f);
        const auto part = found.triangle_response(f, corners, x);
        energy += static_cast<double>(part.energy);
        for (std::size_t k = 0; k < 3; ++k) {
            forces[static_cast<std::size_t>(corners[k])] += part.force[k].template cast<double>();
        }
    }
    const auto add_to = [&](double& sum) {
        return [&](const auto& element) { sum += static_cast<double>(element.element.energy(element.where(x))); };
    };
    expected.for_each_element(add_to(right_energy));
    found.for_each_element(add_to(all_energy));
    REQUIRE(energy == Approx(right_energy).epsilon(tolerance));
    REQUIRE(all_energy == Approx(right_energy).epsilon(tolerance));
    Vector3<double> sum = Vector3<double>::Zero();
    double size = 0;
    for (Index v = 0; v < x.cols(); ++v) {
        CAPTURE(v);
        const auto force = found.force_on(v, x), right = expected.force_on(v, x);
        const double scale = static_cast<double>(right.stiffness + norm(right.force));
        REQUIRE(static_cast<double>(norm<Scalar>(force.force - right.force)) <= tolerance * scale);
        REQUIRE(norm<double>(force.force.template cast<double>() - forces[static_cast<std::size_t>(v)]) <=
                tolerance * scale);
        REQUIRE(static_cast<double>(force.stiffness) ==
                Approx(static_cast<double>(right.stiffness)).epsilon(tolerance));
        REQUIRE(others_of(found.neighbours(v)) == others_of(expected.neighbours(v)));
        REQUIRE(found.pinned(v) == expected.pinned(v));
        sum += force.force.template cast<double>();
        size = std::max(size, scale);
    }
    REQUIRE(norm(sum) <= tolerance * size);
}

}  // namespace

TEMPLATE_TEST_CASE("vertices that split and move in any order leave springs and elements those of the torn mesh",
                   "[tear]", TEST_SCALARS) {
    const double tolerance = 3e4 * static_cast<double>(std::numeric_limits<TestType>::epsilon());
    int splits = 0, moves = 0;
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto whole = seed % 3 != 0 ? disc<TestType>({.radius = 1, .rings = 5})
                                         : icosphere<TestType>({.radius = 1, .subdivisions = 2});
        const auto mesh = with_reserve(whole, 30);
        std::vector<Index> pinned{3, 4, 20, 21, 22};
        TearableSprings springs(mesh, network_of(mesh, pinned));
        auto sheet = sheet_of(mesh, springs);
        FoundationSprings<TestType> layer(mesh, {.normal = TestType(4), .tangential = TestType(2)});
        VirtualVolumeSprings<TestType> volume(mesh, {.stiffness = TestType(3), .damping = TestType(2)});
        std::vector<Index> first(static_cast<std::size_t>(mesh.vertex_count()));  // of which each is a copy
        for (Index v = 0; v < mesh.vertex_count(); ++v) first[static_cast<std::size_t>(v)] = v;
        TornSurface<TestType> surface(mesh);
        Points<TestType> positions = mesh.positions();
        for (int n = 0; n < 60; ++n) {
            test::change_at_random(random, surface, positions, true);
            if (surface.events().empty()) continue;
            for (const auto& event : surface.events()) {
                follow(event, springs, sheet, layer, volume);
                moves += event.moved.vertex != no_index ? 1 : 0;
                if (event.split.vertex == no_index) continue;
                ++splits;
                first[static_cast<std::size_t>(event.split.copy)] = first[static_cast<std::size_t>(event.split.vertex)];
                if (springs.pinned(event.split.vertex)) pinned.push_back(event.split.copy);
            }
            const TriangleMesh<TestType> torn(surface.rest_positions(), surface.triangles());
            Points<TestType> x = torn.positions();
            for (TestType& number : x.reshaped())
                number = TestType(1.2) * number + random.number(TestType(-0.02), TestType(0.02));
            const auto anew = network_of(torn, pinned);
            check_same(springs, TearableSprings(torn, anew), surface, x, tolerance);
            check_same(sheet, sheet_of(torn, TearableSprings(torn, anew)), surface, x, tolerance);
            REQUIRE(springs.springs().size() == anew.springs().size());
        }
        std::vector<double> normal(first.size(), 0), stiffness(first.size(), 0), damping(first.size(), 0);
        for (std::size_t v = 0; v < first.size(); ++v) {
            const auto at = static_cast<std::size_t>(first[v]);
            if (static_cast<Index>(at) >= whole.vertex_count()) continue;  // of the reserve
            normal[at] += static_cast<double>(layer.normal_stiffness(static_cast<Index>(v)));
            stiffness[at] += static_cast<double>(volume.stiffness(static_cast<Index>(v)));
            damping[at] += static_cast<double>(volume.damping(static_cast<Index>(v)));
            REQUIRE(volume.anchors().col(static_cast<Index>(v)) == surface.rest_positions().col(static_cast<Index>(v)));
            REQUIRE(layer.anchors().col(static_cast<Index>(v)) == surface.rest_positions().col(static_cast<Index>(v)));
        }
        for (Index v = 0; v < whole.vertex_count(); ++v) {
            const auto at = static_cast<std::size_t>(v);
            REQUIRE(normal[at] == Approx(4).epsilon(tolerance));
            REQUIRE(stiffness[at] == Approx(3).epsilon(tolerance));
            REQUIRE(damping[at] == Approx(2).epsilon(tolerance));
        }
    }
    CAPTURE(splits, moves);
    CHECK(splits > 10 * cases(40));
    CHECK(moves > 10 * cases(40));
}

TEST_CASE("before a tear the springs have the bits of the network", "[tear]") {
    const auto mesh = with_reserve(icosphere<float>({.radius = 1, .subdivisions = 2}), 5);
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = spring_stiffnesses(mesh, material)});
    const TearableSprings springs(mesh, network);
    const Points<float> x = 1.1F * mesh.positions();
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        REQUIRE(springs.force_on(v, x).force == network.force_on(v, x).force);
    }
    CHECK(springs.springs().size() == network.springs().size());
    CHECK(test::refusal([&] { TearableSprings(icosphere<float>({.subdivisions = 1}), network); }) ==
          "TearableSprings: network must be of the mesh of 42 vertices, got one of 167");
    // The same vertices, the other diagonal.
    const TriangleMesh<float> one(Points<float>{{0, 1, 1, 0}, {0, 0, 1, 1}, {0, 0, 0, 0}},
                                  Triangles{{0, 0}, {1, 2}, {2, 3}});
    const TriangleMesh<float> other(one.positions(), Triangles{{0, 1}, {1, 2}, {3, 3}});
    CHECK(test::refusal([&] { TearableSprings(one, MassSpringNetwork(other, LinearSpring{}, {.stiffness = 1.0F})); }) ==
          "TearableSprings: network must be of the mesh, spring 3 is no edge of it");
}

TEST_CASE("a split divides mass and viscosity by area, and keeps a pin", "[tear]") {
    const auto mesh = with_reserve(disc<double>({.radius = 1, .rings = 3}), 2);
    TearableSprings springs(mesh, MassSpringNetwork(mesh, LinearSpring{},
                                                    {.stiffness = 1.0, .mass = 6.0, .viscosity = 3.0, .pinned = {0}}));
    TornSurface<double> surface(mesh);
    Points<double> all = mesh.positions();
    PointsRef<double> x = all;
    const Index copy = surface.split(x, 0, 1, 4);  // half of the six triangles
    REQUIRE(copy != no_index);
    springs.split(surface.events()[0].split);
    CHECK(springs.mass(0) == Approx(3));
    CHECK(springs.mass(copy) == Approx(3));
    CHECK(springs.viscosity(0) == Approx(1.5));
    CHECK(springs.viscosity(copy) == Approx(1.5));
    CHECK(springs.pinned(copy));
}

TEST_CASE("foundations divide a vertex by area", "[tear]") {
    const auto mesh = with_reserve(disc<double>({.radius = 1, .rings = 4}), 2);
    VirtualVolumeSprings<double> volume(mesh, {.stiffness = 3.0, .damping = 2.0});
    FoundationSprings<double> layer(mesh, {.normal = 4.0, .tangential = 2.0});
    CohesiveSprings<double> cohesive(mesh, {.stiffness = 1e3, .strength = 10.0, .energy = 1.0});
    const Vector3<double> u(0.001, 0.002, 0.003), at = point(mesh.positions(), 0) + u;
    const auto force = cohesive.force_on(0, at, at, 1).force;
    const VertexSplit split{0, mesh.vertex_count() - 2, {}, {}, 0.25};
    MovedVertex<double> moved{.vertex = 1, .rest = {0.1, 0, 0}};
    volume.split(split), layer.split(split), cohesive.split(split);
    CHECK(volume.stiffness(split.copy) == 0.75);
    CHECK(volume.stiffness(0) == 2.25);
    CHECK(volume.damping(split.copy) == 0.5);
    CHECK(layer.normal_stiffness(split.copy) == 1);
    CHECK(layer.tangential_stiffness(0) == 1.5);
    const auto parts = cohesive.force_on(0, at, at, 1).force + cohesive.force_on(split.copy, at, at, 1).force;
    CHECK(norm<double>(parts - force) < 1e-12 * norm(force));
    volume.reshape(moved), layer.reshape(moved), cohesive.reshape(moved);
    for (const auto* anchors : {&volume.anchors(), &layer.anchors(), &cohesive.anchors()}) {
        CHECK(anchors->col(1) == Eigen::Vector3d(0.1, 0, 0));
        CHECK(anchors->col(split.copy) == mesh.positions().col(0));
    }
}

TEMPLATE_TEST_CASE("a solver that follows a cut finds the equilibrium that a new solver keeps", "[tear]",
                   TEST_SCALARS) {
    const auto mesh = with_reserve(disc<TestType>({.radius = 1, .rings = 8}), 10);
    const auto pinned = border(mesh);
    const auto make = [&](const TriangleMesh<TestType>& of) {
        return MassSpringNetwork(of, LinearSpring{}, {.stiffness = TestType(10), .pinned = pinned});
    };
    TearableSprings springs(mesh, make(mesh));
    VirtualVolumeSprings<TestType> volume(mesh, {.stiffness = TestType(0)});
    Tearing tear(mesh, EnergyRelease{1, 1});
    QuasiStaticSolver<TestType> solver(springs, {.layers = unlimited, .sweeps = 20});
    Points<TestType> x = TestType(1.3) * mesh.positions();
    for (const Index v : border(mesh)) x.col(v) = TestType(1.3) * mesh.positions().col(v);
    const auto relaxed = [&](auto& by, const auto& network, Points<TestType>& at) {
        by.wake_all();
        StepReport<TestType> report;
        for (int n = 0; n < 400 && !report.converged; ++n) report = by.step(at, TestType(1e-3), network, volume);
        return report;
    };
    static_cast<void>(relaxed(solver, springs, x));
    const std::vector<Index> path{1, 0, 4};
    const auto events = tear.cut_along(path, x);
    REQUIRE(events.size() == 1);
    for (const auto& event : events) follow(event, springs, volume, solver);
    CHECK(relaxed(solver, springs, x).converged);
    Points<TestType> fresh = x;
    QuasiStaticSolver<TestType> other(springs, {.layers = unlimited, .sweeps = 20});
    CHECK(relaxed(other, springs, fresh).converged);
    CHECK((fresh - x).template cast<double>().colwise().norm().maxCoeff() <
          (std::is_same_v<TestType, double> ? 1e-6 : 1e-3));
    // The two sides of the cut part, and each is in balance by its own springs.
    CHECK(norm<TestType>(point(x, 0) - point(x, tear.tips()[0].behind[1])) > TestType(0.01));
}
