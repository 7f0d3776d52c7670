// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/arctangent.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/tissue/elements.hpp>
#include <membrane/tissue/material.hpp>

/// Bending stiffness.
///
///     const double rigidity = membrane::flexural_rigidity(material);
///     const auto tissue = membrane::Tissue(springs, membrane::bending_springs(mesh, rigidity));
///
/// A flat, unstretched sheet has normal stiffness only from bending and its foundation. With a flexural rigidity D
/// bending acts over a length of (D / c)^(1/4) on a foundation of c [Pa/m], 0.1 mm for a cornea's 3 uN m on 30 GPa/m,
/// and of sqrt(D / T) under a tension T [N/m]. Larger triangles do not resolve it.
namespace membrane {

/// E t^3 / (12 (1 - nu^2)) [N m]. @throws InvalidInput for a material out of its range
[[nodiscard]] inline double flexural_rigidity(const Material& material) {
    material.validate();
    const double nu = material.poisson_ratio, t = material.thickness;
    return material.young_modulus * (t * t * t) / (12 * (1 - nu * nu));
}

/// Two triangles at the edge from corner 0 to corner 1, with the apexes 2 and 3; 2 is on the left seen from outside. At
/// the fold angle a, positive if the apexes turn inward, it stores stiffness (a - rest)^2 / 2 [Grinspun03]. The Hessian
/// leaves out the term that vanishes at rest, the only one that may be negative.
template <Number Scalar>
struct Hinge {
    static constexpr std::size_t corner_count = 4;  ///< two of the edge, two apexes
    static constexpr std::array<std::array<std::size_t, 2>, 5> edges{
        {{0, 1}, {0, 2}, {1, 2}, {0, 3}, {1, 3}}};  ///< see `Element`
    static constexpr std::array<std::array<std::size_t, 4>, 4> orders{
        {{0, 1, 2, 3}, {1, 0, 3, 2}, {0, 1, 2, 3}, {1, 0, 3, 2}}};                                 ///< see `Element`
    static constexpr std::array<std::array<std::size_t, 3>, 2> triangles{{{0, 1, 2}, {1, 0, 3}}};  ///< see `Element`

    Scalar stiffness;        ///< [N m]
    Scalar rest_sine = 0;    ///< sine of the angle at rest
    Scalar rest_cosine = 1;  ///< its cosine

    /// The angle at rest, between -pi and pi [rad].
    [[nodiscard]] Scalar rest() const noexcept { return arctangent(rest_sine, rest_cosine); }

    ///@{
    /// As `Element` requires.
    template <Number N>
    [[nodiscard]] CornerForce<N> force_on(const Corners<N, 4>& x, std::size_t i) const noexcept;
    template <Number N>
    [[nodiscard]] N energy(const Corners<N, 4>& x) const noexcept;
    template <Number N>
    [[nodiscard]] EnergyChange<N> energy_change(const Corners<N, 4>& x, std::size_t i,
                                                const Vector3<N>& displacement) const noexcept;
    [[nodiscard]] Eigen::Matrix3d hessian_block(const Corners<double, 4>& x, std::size_t i,
                                                std::size_t j) const noexcept;
    [[nodiscard]] Hinge in_order(std::size_t) const noexcept { return *this; }
    ///@}
};

/// A hinge at each edge between two triangles of `mesh`, whose shape is the rest shape, for a flexural rigidity D [N
/// m]. Its stiffness is D l^2 / (A + B), l the edge's length, A and B the areas. On equilateral triangles the energy is
/// that of a plate bent to a cylinder. Under bending in two directions the Poisson ratio is -1/3: that term depends
/// only on the slopes at the border [Seung88].
/// @throws InvalidInput for a rigidity that is not finite, or negative. O(F log F).
template <Real Scalar>
[[nodiscard]] Elements<Scalar, Hinge<Scalar>> bending_springs(const TriangleMesh<Scalar>& mesh, double rigidity);

namespace detail {

/// The angle of a hinge, and its derivatives by each corner; all are zero if a triangle has no area.
template <Number N>
struct Fold {
    MEMBRANE_INLINE explicit Fold(const Corners<N, 4>& x) noexcept
        : edge(x[1] - x[0]),
          to_left(x[2] - x[1]),
          from_right(x[1] - x[3]),
          left(cross(edge, to_left)),
          right(cross(edge, from_right)) {
        const N on_left = squared_norm(left), on_right = squared_norm(right);
        valid = smaller(on_left, on_right) > 0;
        length = root_of<N>(squared_norm(edge));
        const auto inverse = [&](const N& number)
                                 MEMBRANE_INLINE_LAMBDA { return if_valid(1 / select<N>(valid, number, 1)); };
        per_length = inverse(length), by_left = inverse(on_left), by_right = inverse(on_right);
        sine = length * dot(left, from_right), cosine = dot(left, right);
    }

    /// The angle less that of a hinge's rest, between -pi and pi: rotates before it takes the angle [rad].
    template <class Hinge>
    [[nodiscard]] MEMBRANE_INLINE N angle_from_rest(const Hinge& hinge) const noexcept {
        const auto rest_sine = static_cast<N>(hinge.rest_sine), rest_cosine = static_cast<N>(hinge.rest_cosine);
        return arctangent<N>(rest_cosine * sine - rest_sine * cosine, rest_cosine * cosine + rest_sine * sine);
    }

    /// The derivative of the angle by corner i, negative [1/m].
    [[nodiscard]] MEMBRANE_INLINE Vector3<N> descent(std::size_t i) const noexcept {
        if (i == 2) return (length * by_left) * left;
        if (i == 3) return (length * by_right) * right;
        // The angle does not change if the hinge is translated, or rotated about its edge.
        const auto [on_left, on_right] = beyond_other_end(i);
        const N by = i == 0 ? N(1) : N(-1);
        return (by * (on_left * by_left)) * left - (by * (on_right * by_right)) * right;
    }

    /// 1 / h^2: no eigenvalue of the angle's second derivative by corner i is larger. At an apex h is its distance from
    /// the edge; at the edge's corners it is a sum, over the distances from the two lines through the other end and an
    /// apex.
    [[nodiscard]] MEMBRANE_INLINE N curvature(std::size_t i) const noexcept {
        if (i == 2) return length * (length * by_left);
        if (i == 3) return length * (length * by_right);
        const auto [on_left, on_right] = beyond_other_end(i);
        return 2 * (per_length * per_length) + (on_left * (on_left * by_left) + on_right * (on_right * by_right));
    }

    [[nodiscard]] MEMBRANE_INLINE N if_valid(const N& number) const noexcept { return select<N>(valid, number, 0); }

    Vector3<N> edge, to_left, from_right;  // from corner 0 to 1, from there to one apex, to there from the other
    Vector3<N> left, right;                // normals, twice as long as the areas
    decltype(N() < N()) valid;             // both triangles have areas
    N length, per_length;                  // of the edge, and its inverse
    N by_left, by_right;                   // the inverse squares of twice the areas
    N sine, cosine;                        // of the angle, times the product of twice the areas

  private:
    // How far the apexes are beyond the end that is not corner i, along the edge, and the right one negative.
    [[nodiscard]] MEMBRANE_INLINE std::array<N, 2> beyond_other_end(std::size_t i) const noexcept {
        const N on_left = per_length * dot(edge, to_left), on_right = per_length * dot(edge, from_right);
        return i == 0 ? std::array<N, 2>{on_left, on_right} : std::array<N, 2>{on_left + length, on_right - length};
    }
};

}  // namespace detail

template <Number Scalar>
template <Number N>
MEMBRANE_INLINE CornerForce<N> Hinge<Scalar>::force_on(const Corners<N, 4>& x, std::size_t i) const noexcept {
    using std::abs;
    const detail::Fold<N> fold(x);
    const N k = static_cast<N>(stiffness);
    const N moment = k * fold.angle_from_rest(*this);
    const Vector3<N> descent = fold.descent(i);
    // Within 0.28 of the distances h the curvature at most doubles. Without an area nothing is known.
    const N bend = fold.curvature(i);
    constexpr auto infinity = std::numeric_limits<Each<N>>::infinity();
    const N unknown = select<N>((!fold.valid) & (k > 0), infinity, 0);
    return {moment * descent, outer<N>(k, descent), {abs(moment) * bend, k / 2 * (bend * bend), 12 * bend + unknown}};
}

template <Number Scalar>
template <Number N>
N Hinge<Scalar>::energy(const Corners<N, 4>& x) const noexcept {
    const detail::Fold<N> fold(x);
    const N by = fold.angle_from_rest(*this);
    return fold.if_valid(static_cast<N>(stiffness) * by * by / 2);
}

template <Number Scalar>
template <Number N>
EnergyChange<N> Hinge<Scalar>::energy_change(const Corners<N, 4>& x, std::size_t i,
                                             const Vector3<N>& displacement) const noexcept {
    auto there = x;
    there[i] += displacement;
    const N before = energy(x), after = energy(there);
    // The angle is accurate to a few epsilons.
    const N noise = root_of<N>(2 * static_cast<N>(stiffness) * (before + after));
    return {after - before, before + after + noise};
}

template <Number Scalar>
Eigen::Matrix3d Hinge<Scalar>::hessian_block(const Corners<double, 4>& x, std::size_t i, std::size_t j) const noexcept {
    const detail::Fold<double> fold(x);
    return static_cast<double>(stiffness) * fold.descent(i) * fold.descent(j).transpose();
}

template <Real Scalar>
Elements<Scalar, Hinge<Scalar>> bending_springs(const TriangleMesh<Scalar>& mesh, double rigidity) {
    detail::check_option("bending_springs", rigidity, "rigidity", "N m");
    using All = Elements<Scalar, Hinge<Scalar>>;
    std::vector<typename All::Instance> all;
    const auto sides = half_edges(mesh.triangles());
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        if (edge.size() != 2) return;
        const HalfEdge &left = edge[0].forward ? edge[0] : edge[1], &right = edge[0].forward ? edge[1] : edge[0];
        const std::array<Index, 4> corners{left.first, left.second, left.apex, right.apex};
        Corners<double, 4> x;
        for (std::size_t i = 0; i < 4; ++i) x[i] = point(mesh.positions(), corners[i]).template cast<double>();
        const detail::Fold<double> fold(x);
        if (!fold.valid || rigidity == 0) return;
        const double twice_left = norm(fold.left), twice_right = norm(fold.right), product = twice_left * twice_right;
        all.push_back({corners,
                       {static_cast<Scalar>(rigidity * squared_norm(fold.edge) / ((twice_left + twice_right) / 2)),
                        static_cast<Scalar>(fold.sine / product), static_cast<Scalar>(fold.cosine / product)}});
    });
    return All(mesh, std::move(all));
}

}  // namespace membrane
