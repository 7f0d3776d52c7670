// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/arctangent.hpp>
#include <membrane/model/elements.hpp>
#include <membrane/model/material.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/triangle_mesh.hpp>

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
    material.check();
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
        {{0, 1, 2, 3}, {1, 0, 3, 2}, {0, 1, 2, 3}, {1, 0, 3, 2}}};  ///< see `Element`

    Scalar stiffness;  ///< [N m]
    Scalar rest;       ///< between -pi and pi [rad]

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
class Fold {
  public:
    MEMBRANE_INLINE explicit Fold(const Corners<N, 4>& x) noexcept
        : edge(x[1] - x[0]), left(cross<N>(edge, x[2] - x[0])), third(x[3] - x[0]), right(cross<N>(third, edge)) {
        const N on_left = squared_norm(left), on_right = squared_norm(right);
        valid = (on_left > 0) & (on_right > 0);
        by_left_ = 1 / select<N>(valid, on_left, 1), by_right_ = 1 / select<N>(valid, on_right, 1);
        square_ = squared_norm(edge), length_ = root_of<N>(square_);
    }

    [[nodiscard]] MEMBRANE_INLINE N angle() const noexcept {
        return if_valid(arctangent<N>(-length_ * dot<N>(left, third), dot(left, right)));
    }

    [[nodiscard]] MEMBRANE_INLINE Vector3<N> slope(const Corners<N, 4>& x, std::size_t i) const noexcept {
        const N turn_left = if_valid(-length_ * by_left_), turn_right = if_valid(-length_ * by_right_);
        if (i == 2) return turn_left * left;
        if (i == 3) return turn_right * right;
        // The angle does not change if the hinge is translated, or rotated about its edge.
        const N per_square = 1 / select<N>(valid, square_, 1);
        const N on_left = per_square * dot<N>(edge, x[2] - x[0]), on_right = per_square * dot<N>(edge, x[3] - x[0]);
        return i == 0 ? Vector3<N>(((on_left - 1) * turn_left) * left + ((on_right - 1) * turn_right) * right)
                      : Vector3<N>((-on_left * turn_left) * left + (-on_right * turn_right) * right);
    }

    /// 1 / h^2: no eigenvalue of the angle's second derivative by corner i is larger. At an apex h is its distance from the
    /// edge; at the edge's corners it is a sum, over the distances from the two lines through the other end and an apex.
    [[nodiscard]] MEMBRANE_INLINE N curvature(const Corners<N, 4>& x, std::size_t i) const noexcept {
        if (i == 2) return square_ * by_left_;
        if (i == 3) return square_ * by_right_;
        const Vector3<N>& end = x[1 - i];
        return squared_norm<N>(x[2] - end) * by_left_ + squared_norm<N>(x[3] - end) * by_right_;
    }

    [[nodiscard]] MEMBRANE_INLINE N if_valid(const N& number) const noexcept { return select<N>(valid, number, 0); }

    Vector3<N> edge, left, third, right;
    decltype(N() < N()) valid;  // both triangles have areas

  private:
    N by_left_, by_right_;  // the inverse squares of twice the areas
    N square_, length_;     // of the edge
};

/// `angle` less a whole turn if it is beyond half a turn [rad]. @pre between -2 pi and 2 pi
template <Number N>
[[nodiscard]] MEMBRANE_INLINE N within_half_turn(const N& angle) noexcept {
    constexpr auto half = std::numbers::pi_v<Each<N>>;
    using std::abs;
    return select<N>(abs(angle) > half, angle - select<N>(angle > 0, 2 * half, -2 * half), angle);
}

}  // namespace detail

template <Number Scalar>
template <Number N>
MEMBRANE_INLINE CornerForce<N> Hinge<Scalar>::force_on(const Corners<N, 4>& x, std::size_t i) const noexcept {
    using std::abs;
    const detail::Fold<N> fold(x);
    const N k = static_cast<N>(stiffness), curvature = fold.curvature(x, i);
    const Vector3<N> slope = fold.slope(x, i);
    const N moment = fold.if_valid(k * detail::within_half_turn<N>(fold.angle() - static_cast<N>(rest)));
    // Within a quarter of the distances h the curvature grows to at most (4/3)^2 of itself: `bend` is half of that. Without
    // an area nothing is known.
    const N bend = Each<N>(8.0 / 9) * curvature;
    constexpr auto unknown = std::numeric_limits<Each<N>>::infinity();
    const N per_range = select<N>(fold.valid, 16 * curvature, select<N>(k > 0, unknown, 0));
    return {-moment * slope, outer<N>(k, slope), {abs(moment) * bend, k / 2 * (bend * bend), per_range}};
}

template <Number Scalar>
template <Number N>
N Hinge<Scalar>::energy(const Corners<N, 4>& x) const noexcept {
    const detail::Fold<N> fold(x);
    const N by = detail::within_half_turn<N>(fold.angle() - static_cast<N>(rest));
    return fold.if_valid(static_cast<N>(stiffness) * by * by / 2);
}

template <Number Scalar>
template <Number N>
EnergyChange<N> Hinge<Scalar>::energy_change(const Corners<N, 4>& x, std::size_t i,
                                             const Vector3<N>& displacement) const noexcept {
    using std::abs;
    auto there = x;
    there[i] += displacement;
    const N k = static_cast<N>(stiffness), before = energy(x), after = energy(there);
    // The angle is accurate to a few epsilons.
    const N noise =
        k * (1 + abs(static_cast<N>(rest))) * root_of<N>(2 * (before + after) / larger<N>(k, Each<N>(1e-30)));
    return {after - before, before + after + noise};
}

template <Number Scalar>
Eigen::Matrix3d Hinge<Scalar>::hessian_block(const Corners<double, 4>& x, std::size_t i, std::size_t j) const noexcept {
    const detail::Fold<double> fold(x);
    if (!fold.valid) return Eigen::Matrix3d::Zero();
    return static_cast<double>(stiffness) * fold.slope(x, i) * fold.slope(x, j).transpose();
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
        const double areas = (norm(fold.left) + norm(fold.right)) / 2;
        all.push_back(
            {corners,
             {static_cast<Scalar>(rigidity * squared_norm(fold.edge) / areas), static_cast<Scalar>(fold.angle())}});
    });
    return All(mesh, std::move(all));
}

}  // namespace membrane
