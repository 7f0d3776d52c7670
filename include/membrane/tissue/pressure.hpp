// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/tissue/elements.hpp>

/// Loads that keep a stretched membrane in its shape.
///
///     const auto stretched = membrane::triangular_springs(mesh, material, 1.02);             // by 2 % on the mesh
///     const auto tissue = membrane::Tissue(springs, stretched, membrane::pressure(mesh, 2000.0));   // [Pa], or
///     const auto loads = membrane::balancing_loads(mesh, membrane::Tissue(springs, stretched));
///     const auto still = membrane::Tissue(springs, stretched, loads);            // the mesh is its equilibrium
///
/// A stretched sheet resists indentation like a drum: a tension of T [N/m] on a foundation of c [Pa/m] acts over a
/// length of sqrt(T / c). It matters if this is longer than the triangles, or without a foundation.
namespace membrane {

/// A constant pressure on one triangle: its force is along the normal, a third at each corner. On a closed surface, or
/// if the border is pinned, the loads of all triangles together have an energy, -pressure times volume.
template <Number Scalar>
struct PressureLoad {
    static constexpr std::size_t corner_count = 3;  ///< the triangle's
    static constexpr std::array<std::array<std::size_t, 3>, 3> orders{
        {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}}};  ///< see `Element`

    static constexpr bool is_load = true;  ///< see `Element`

    Scalar pressure;  ///< [Pa], positive from inside

    ///@{
    /// As `Element` requires.
    template <Number N>
    [[nodiscard]] CornerForce<N> force_on(const Corners<N, 3>& x, std::size_t i) const noexcept {
        const Vector3<N>&next = x[(i + 1) % 3], &last = x[(i + 2) % 3];
        return {static_cast<N>(pressure) / 6 * cross<N>(next - x[i], last - x[i]), {}, {}};  // linear in the corner
    }
    template <Number N>
    [[nodiscard]] N energy(const Corners<N, 3>& x) const noexcept {
        return -static_cast<N>(pressure) / 6 * dot<N>(x[0], cross(x[1], x[2]));
    }
    template <Number N>
    [[nodiscard]] EnergyChange<N> energy_change(const Corners<N, 3>& x, std::size_t i,
                                                const Vector3<N>& displacement) const noexcept {
        const Vector3<N> force = force_on(x, i).force;
        return {-dot(force, displacement), norm(force) * detail::largest_magnitude(x[i])};
    }
    [[nodiscard]] Eigen::Matrix3d hessian_block(const Corners<double, 3>& x, std::size_t i,
                                                std::size_t j) const noexcept;
    [[nodiscard]] PressureLoad in_order(std::size_t) const noexcept { return *this; }
    ///@}
};

/// A constant force on one vertex.
template <Number Scalar>
struct DeadLoad {
    static constexpr std::size_t corner_count = 1;  ///< the vertex

    Vector3<Scalar> force;  ///< [N]

    ///@{
    /// As `Element` requires.
    template <Number N>
    [[nodiscard]] CornerForce<N> force_on(const Corners<N, 1>&, std::size_t) const noexcept {
        return {force.template cast<N>(), {}, {}};
    }
    template <Number N>
    [[nodiscard]] N energy(const Corners<N, 1>& x) const noexcept {
        return -dot<N>(force.template cast<N>(), x[0]);
    }
    template <Number N>
    [[nodiscard]] EnergyChange<N> energy_change(const Corners<N, 1>& x, std::size_t,
                                                const Vector3<N>& displacement) const noexcept {
        const Vector3<N> f = force.template cast<N>();
        return {-dot(f, displacement), norm(f) * detail::largest_magnitude(x[0])};
    }
    [[nodiscard]] Eigen::Matrix3d hessian_block(const Corners<double, 1>&, std::size_t, std::size_t) const noexcept {
        return Eigen::Matrix3d::Zero();
    }
    ///@}
};

/// A pressure of `value` [Pa] on every triangle of `mesh`. By Laplace's law a sphere of radius r balances it with a
/// tension of value r / 2 [N/m]. @throws InvalidInput for a pressure that is not finite
template <Real Scalar>
[[nodiscard]] Elements<Scalar, PressureLoad<Scalar>> pressure(const TriangleMesh<Scalar>& mesh, double value);

/// The loads for which the shape of `mesh` is an equilibrium of `network`, to the last bit: on each vertex the negative
/// of the force of the network. They stand for pressure, anchors and surrounding tissue that are not modelled.
/// @throws InvalidInput for a network of another mesh
template <Real Scalar, ElasticNetwork<Scalar> Network>
[[nodiscard]] Elements<Scalar, DeadLoad<Scalar>> balancing_loads(const TriangleMesh<Scalar>& mesh,
                                                                 const Network& network);

// The force on corner i is p / 6 x_j x x_k, but for terms that cancel over the triangles around i. The terms that
// depend on the origin, here the middle of the edge, cancel too.
template <Number Scalar>
Eigen::Matrix3d PressureLoad<Scalar>::hessian_block(const Corners<double, 3>& x, std::size_t i,
                                                    std::size_t j) const noexcept {
    if (i == j) return Eigen::Matrix3d::Zero();
    const double sign = j == (i + 1) % 3 ? 1 : -1;
    const Vector3<double> third = x[3 - i - j] - (x[i] + x[j]) / 2;
    Eigen::Matrix3d product;
    product << 0, -third[2], third[1], third[2], 0, -third[0], -third[1], third[0], 0;
    return sign * static_cast<double>(pressure) / 6 * product;
}

template <Real Scalar>
Elements<Scalar, PressureLoad<Scalar>> pressure(const TriangleMesh<Scalar>& mesh, double value) {
    if (!is_finite(value)) refuse("pressure", "value must be finite [Pa], got ", value);
    using All = Elements<Scalar, PressureLoad<Scalar>>;
    std::vector<typename All::Instance> all;
    for (const auto& corners : mesh.triangles().colwise()) {
        all.push_back({{corners[0], corners[1], corners[2]}, {static_cast<Scalar>(value)}});
    }
    return All(mesh, std::move(all));
}

template <Real Scalar, ElasticNetwork<Scalar> Network>
Elements<Scalar, DeadLoad<Scalar>> balancing_loads(const TriangleMesh<Scalar>& mesh, const Network& network) {
    if (network.vertex_count() != mesh.vertex_count()) {
        refuse("balancing_loads", "the network must have as many vertices as the mesh, ", mesh.vertex_count(), ", got ",
               network.vertex_count());
    }
    using All = Elements<Scalar, DeadLoad<Scalar>>;
    std::vector<typename All::Instance> all;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        all.push_back({{v}, {-network.force_on(v, mesh.positions()).force}});
    }
    return All(mesh, std::move(all));
}

}  // namespace membrane
