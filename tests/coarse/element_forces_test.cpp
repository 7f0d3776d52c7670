// SPDX-License-Identifier: MIT
#include <membrane/coarse/element_forces.hpp>

#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/vertex_forces.hpp"

using namespace membrane;

namespace {

/// Forces of all kinds against those on the vertices, at random positions, and changes of the energy against the work
/// of these forces in between, by Gauss's rule of three points.
template <Real S, class Network, class Volume>
void check(const TriangleMesh<S>& mesh, const Network& network, const Volume& foundation, S tolerance,
           double energy_tolerance) {
    test::Random random(7);
    const auto kinds = element_forces(network, foundation);
    for (int n = 0; n < 20; ++n) {
        const Points<S> x = test::jittered(mesh.positions(), S(2e-4), random);
        test::check_forces<S>(kinds, x, network, foundation, tolerance);

        const Points<S> y = test::jittered(x, S(1e-4), random);
        double work = 0, size = 0;
        for (const auto& [at, weight] : {std::pair(-std::sqrt(0.6), 5.0), {0.0, 8.0}, {std::sqrt(0.6), 5.0}}) {
            const Points<S> between = x + S((1 + at) / 2) * (y - x);
            const Eigen::ArrayXXd along =
                test::forces_at<S>(between, network, foundation).cwiseProduct(y - x).template cast<double>();
            work += weight / 18 * along.sum();
            size += weight / 18 * along.abs().sum();
        }
        double change = 0;
        for (const auto& kind : kinds)
            change += static_cast<double>(kind->energy_change(test::rows_of<S>(x), test::rows_of<S>(y)));
        CHECK(std::abs(change + work) <= energy_tolerance * size);
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

/// A law that takes lanes, and divides by the length at rest.
struct ByStrain {
    template <Number S>
    SpringResponse<S> operator()(const SpringState<S>& spring) const noexcept {
        const S strain = (spring.length - spring.rest_length) / spring.rest_length;
        const S force = spring.stiffness * spring.rest_length;
        return {force * strain, spring.stiffness, force * spring.rest_length * strain * strain / S(2)};
    }
};

}  // namespace

TEMPLATE_TEST_CASE("forces of all elements are those on the vertices, and their work is the energy", "[coarse]", double,
                   float) {
    using S = TestType;
    const bool is_float = sizeof(S) == 4;
    const S tolerance = is_float ? S(2e-5) : S(1e-12);
    const double energy_tolerance = is_float ? 1e-3 : 1e-6;
    const auto mesh = icosphere<S>({.radius = S(0.01), .subdivisions = 2});
    const MassSpringNetwork springs(mesh, LinearSpring{}, {.stiffness = S(40)});
    const VirtualVolumeSprings<S> volume(mesh, {.stiffness = S(8), .damping = S(1)});
    check<S>(mesh, springs, volume, tolerance, energy_tolerance);
    check<S>(mesh, springs, NoFoundation(), tolerance, energy_tolerance);
    check<S>(mesh, MassSpringNetwork(mesh, ByStrain{}, {.stiffness = S(40)}), volume, tolerance, energy_tolerance);
    const Material material = materials::lens_capsule().typical;
    const auto triangles = triangular_springs(mesh, material);
    check<S>(mesh,
             Tissue(springs, triangles, bending_springs(mesh, flexural_rigidity(material)), pressure(mesh, 2000.0)),
             volume, tolerance, energy_tolerance);
    const MassSpringNetwork none(mesh, LinearSpring{}, {.stiffness = S(0)});
    check<S>(mesh, Tissue(none, triangles), NoFoundation(), tolerance, energy_tolerance);
}

TEST_CASE("an element and a foundation that take no lanes have the same forces", "[coarse]") {
    const auto mesh = disc<double>({.radius = 0.005, .rings = 5});
    const MassSpringNetwork springs(mesh, LinearSpring{}, {.stiffness = 1.0});
    std::vector<ElementInstance<Pair>> pairs;
    for (Index v = 0; v + 7 < mesh.vertex_count(); v += 3) pairs.push_back({{v, v + 7}, {2.0 + v}});
    // The energy of the foundation is by the mean of forces that are not linear.
    check<double>(mesh, Tissue(springs, Elements<double, Pair>(mesh, pairs)), Cubic(), 1e-12, 1e-5);
}
