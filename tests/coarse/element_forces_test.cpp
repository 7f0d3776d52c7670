// SPDX-License-Identifier: MIT
#include <membrane/coarse/element_forces.hpp>

#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

/// Forces and work of all kinds, against those of network and foundation vertex by vertex, at random positions.
template <Real S, class Network, class Volume>
void check_forces(const TriangleMesh<S>& mesh, const Network& network, const Volume& foundation, S tolerance) {
    test::Random random(7);
    const auto kinds = element_forces(network, foundation);
    for (int n = 0; n < 20; ++n) {
        const Points<S> x = test::jittered(mesh.positions(), S(2e-4), random);
        std::vector<PaddedPoint<S>> rows(static_cast<std::size_t>(mesh.vertex_count()) + 1), forces(rows), moves(rows);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            rows[static_cast<std::size_t>(v)].set(point(x, v));
            moves[static_cast<std::size_t>(v)].set(random.vector<S>(-1, 1));
        }
        for (const auto& kind : kinds) kind->add_forces(rows, forces);
        S largest = 0, worst = 0, work = 0, size = 0;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            const Vector3<S> here = point(x, v), now = forces[static_cast<std::size_t>(v)].point();
            const Vector3<S> expected =
                network.force_on(v, x).force + foundation.force_on(v, here, here, S(1e-3)).force;
            largest = (std::max)(largest, norm(expected));
            worst = (std::max)(worst, norm<S>(expected - now));
            const S one = dot<S>(expected, moves[static_cast<std::size_t>(v)].point());
            work += one, size += std::abs(one);
        }
        CHECK(worst <= tolerance * largest);
        S found = 0;
        for (const auto& kind : kinds) found += kind->work(rows, moves);
        CHECK(std::abs(found - work) <= 10 * tolerance * size);
    }
}

/// An element and a foundation that do not take lanes.
struct Pair {
    static constexpr std::size_t corner_count = 2;
    double stiffness = 0;

    template <Real N>
    [[nodiscard]] CornerForce<N> force_on(const Corners<N, 2>& x, std::size_t i) const noexcept {
        return {.force = N(stiffness) * (x[1 - i] - x[i]), .hessian = diagonal3(N(stiffness))};
    }
    template <Real N>
    [[nodiscard]] N energy(const Corners<N, 2>& x) const noexcept {
        return N(stiffness) * squared_norm<N>(x[1] - x[0]) / 2;
    }
    template <Real N>
    [[nodiscard]] EnergyChange<N> energy_change(const Corners<N, 2>& x, std::size_t i,
                                                const Vector3<N>& d) const noexcept {
        auto moved = x;
        moved[i] += d;
        return {energy(moved) - energy(x), energy(moved) + energy(x)};
    }
    [[nodiscard]] Eigen::Matrix3d hessian_block(const Corners<double, 2>&, std::size_t i, std::size_t j) const {
        return (i == j ? stiffness : -stiffness) * Eigen::Matrix3d::Identity();
    }
};
struct Cubic {
    template <Real S>
    [[nodiscard]] VertexForce<S> force_on(Index v, const Vector3<S>& position, const Vector3<S>&, S) const noexcept {
        return {S(-(v % 3)) * squared_norm(position) * position, S(1)};
    }
};

}  // namespace

TEMPLATE_TEST_CASE("forces of all elements are those on the vertices, one by one", "[coarse]", double, float) {
    using S = TestType;
    const S tolerance = sizeof(S) == 4 ? S(2e-5) : S(1e-12);
    const auto mesh = icosphere<S>({.radius = S(0.01), .subdivisions = 2});
    const MassSpringNetwork springs(mesh, LinearSpring{}, {.stiffness = S(40)});
    const VirtualVolumeSprings<S> volume(mesh, {.stiffness = S(8), .damping = S(1)});
    check_forces<S>(mesh, springs, volume, tolerance);
    check_forces<S>(mesh, springs, NoFoundation(), tolerance);
    const Material material = materials::lens_capsule().typical;
    const Tissue tissue(springs, triangular_springs(mesh, material), bending_springs(mesh, flexural_rigidity(material)),
                        pressure(mesh, 2000.0));
    check_forces<S>(mesh, tissue, volume, tolerance);
}

TEST_CASE("an element and a foundation that take no lanes have the same forces", "[coarse]") {
    const auto mesh = disc<double>({.radius = 0.005, .rings = 5});
    const MassSpringNetwork springs(mesh, LinearSpring{}, {.stiffness = 1.0});
    std::vector<ElementInstance<Pair>> pairs;
    for (Index v = 0; v + 7 < mesh.vertex_count(); v += 3) pairs.push_back({{v, v + 7}, {2.0 + v}});
    check_forces<double>(mesh, Tissue(springs, Elements<double, Pair>(mesh, pairs)), Cubic(), 1e-12);
}
