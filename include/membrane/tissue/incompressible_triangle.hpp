// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/tissue/elements.hpp>

/// Large strain of a triangle of an incompressible sheet: what its elements have in common.
///
///     const auto element = membrane::NeoHookeanTriangle<double>{triangle, stiffness};
///     const double strain = triangle.invariant(x);                                             // I1 - 3
namespace membrane {

/// An invariant of the strain as a function of one corner's position.
template <Number Scalar>
struct InvariantSlope {
    Vector3<Scalar> gradient = Vector3<Scalar>::Zero();  ///< [1/m]
    Symmetric3<Scalar> hessian = {};                     ///< an upper bound, positive semidefinite [1/m^2]
};

/// Change of an invariant by the displacement of one corner.
template <Number Scalar>
struct InvariantChange {
    Scalar change = 0;  ///< [1]
    Scalar size = 0;    ///< of the summed terms: times epsilon, the rounding error [1]
};

/// Energy of an element as a function of its strain: I1 - 3, or another invariant that is 0 at rest.
template <Number Scalar>
struct StrainResponse {
    Scalar energy = 0;     ///< 0 at rest [J]
    Scalar slope = 0;      ///< its derivative, not negative [J]
    Scalar curvature = 0;  ///< its second derivative, not negative [J]
};

/// Rest shape of a triangle of an incompressible sheet in plane stress. With its deformation gradient F (3 x 2) and
/// area ratio J, the sheet is 1 / J times as thick, and I1 = |F|^2 + 1 / J^2 [Holzapfel00] 6.5: 3 at rest, larger
/// everywhere else.
///
/// Below J = `min_area_ratio` 1 / J^2 continues as its second-order Taylor polynomial in J^2. I1 is then finite and
/// twice continuously differentiable everywhere, also for a triangle without area; such a triangle has no force against
/// further collapse.
template <Number Scalar>
struct IncompressibleTriangle {
    static constexpr double min_area_ratio = 0.2;  ///< smallest J at which I1 is exact
    static constexpr std::array<std::array<std::size_t, 3>, 3> orders{
        {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}}};  ///< see `Element`

    ///@{
    /// F = [x1 - x0, x2 - x0] [along skew; 0 across] [1/m].
    Scalar along, skew, across;
    ///@}

    /// Area at rest [m^2].
    [[nodiscard]] Scalar area() const noexcept { return 1 / (2 * (along * across)); }

    /// F, by columns: the triangle's edge from corner 0 to 1 was along the first.
    template <Number N>
    [[nodiscard]] std::array<Vector3<N>, 2> deformation(const Corners<N, 3>& x) const noexcept;

    /// Gradient of barycentric coordinate `i` at rest [1/m]: a displacement d of corner i adds d times it to F.
    template <Number N>
    [[nodiscard]] std::array<N, 2> gradient(std::size_t i) const noexcept;

    ///@{
    /// I1 - 3, also as a function of the position of corner `i`, and its change if that moves.
    template <Number N>
    [[nodiscard]] N invariant(const Corners<N, 3>& x) const noexcept;
    template <Number N>
    [[nodiscard]] InvariantSlope<N> invariant_slope(const Corners<N, 3>& x, std::size_t i) const noexcept;
    template <Number N>
    [[nodiscard]] InvariantChange<N> invariant_change(const Corners<N, 3>& x, std::size_t i,
                                                      const Vector3<N>& displacement) const noexcept;
    ///@}

    /// What I1 may exceed its quadratic expansion by if corner `i` moves, for an energy of 1 J for each unit of I1.
    template <Number N>
    [[nodiscard]] EnergyRemainder<N> invariant_remainder(const Corners<N, 3>& x, std::size_t i) const noexcept;

    /// The corners at rest in the plane z = 0 [m]: corner 0 at the origin, corner 1 on the first axis. Offline.
    [[nodiscard]] Corners<double, 3> corners() const noexcept {
        const double a = along, s = skew, c = across;
        return {{{0, 0, 0}, {1 / a, 0, 0}, {-s / (a * c), 1 / c, 0}}};
    }

    /// The rest shape with its corners in the order `orders[i]`. Offline.
    [[nodiscard]] IncompressibleTriangle in_order(std::size_t i) const noexcept;

    /// The rest shape with the corners `after` in place of `before`, of which this one is a scaled copy. Online.
    [[nodiscard]] IncompressibleTriangle reshaped(const Corners<Scalar, 3>& before,
                                                  const Corners<Scalar, 3>& after) const noexcept;

    /// Exact second derivative of I1 by corners `i` and `j` [1/m^2].
    [[nodiscard]] Eigen::Matrix3d invariant_hessian(const Corners<double, 3>& x, std::size_t i,
                                                    std::size_t j) const noexcept;

    /// Half the derivative of I1 by s if all lengths grow by 1 + s.
    template <Number N>
    [[nodiscard]] N invariant_dilation(const Corners<N, 3>& x) const noexcept;

    /// Mean tension [N/m] from the derivative of the energy by s if all lengths grow by 1 + s [J]; zero if less than
    /// 1e-4 of the area is left.
    template <Number N>
    [[nodiscard]] N mean_tension(const Corners<N, 3>& x, const N& work) const noexcept;
};

/// The rest shape of a triangle with these corners; its edge from corner 0 to 1 is along the first axis. @pre its area
/// is positive.
[[nodiscard]] inline IncompressibleTriangle<double> incompressible_triangle(const Corners<double, 3>& x) noexcept {
    const Vector3<double> first = x[1] - x[0], second = x[2] - x[0];
    const double length = norm(first), height = norm(cross(first, second)) / length;
    return {1 / length, -dot(first, second) / (length * (length * height)), 1 / height};
}

template <Number Scalar>
IncompressibleTriangle<Scalar> IncompressibleTriangle<Scalar>::reshaped(
    const Corners<Scalar, 3>& before, const Corners<Scalar, 3>& after) const noexcept {
    const auto shape = [](const Corners<Scalar, 3>& x) {
        return incompressible_triangle(
            {x[0].template cast<double>(), x[1].template cast<double>(), x[2].template cast<double>()});
    };
    const auto from = shape(before), to = shape(after);
    const double scale = static_cast<double>(along) / from.along;
    return {static_cast<Scalar>(scale * to.along), static_cast<Scalar>(scale * to.skew),
            static_cast<Scalar>(scale * to.across)};
}

namespace detail {

/// A number by its parts above and below zero, max(x, 0) and min(x, 0).
template <Number N>
struct Parts {
    N above, below;
};

template <Number N>
[[nodiscard]] Parts<N> parts_of(const N& x) noexcept {
    return {larger<N>(x, 0), smaller<N>(x, 0)};
}

/// How much the parts of x change if x does by `change`, without cancellation.
template <Number N>
[[nodiscard]] Parts<N> change_of(const Parts<N>& x, const N& change) noexcept {
    return {larger<N>(change + x.below, -x.above), smaller<N>(change + x.above, -x.below)};
}

/// 1 / s for s = J^2, and its derivatives; see `IncompressibleTriangle`.
template <Number N>
class InverseSquare {
  public:
    static constexpr Each<N> largest = 3 / static_cast<Each<N>>(IncompressibleTriangle<double>::min_area_ratio *
                                                                IncompressibleTriangle<double>::min_area_ratio);
    explicit InverseSquare(const N& s) noexcept : parts_(parts_of<N>(s - start)), s_(larger<N>(s, start)) {}

    [[nodiscard]] N value() const noexcept { return 1 / s_ + polynomial(steep * parts_.below - 1, parts_.below); }
    [[nodiscard]] N slope() const noexcept { return cubic() * parts_.below - inverse_square(); }
    [[nodiscard]] N curvature() const noexcept { return 2 * inverse_square() / s_; }

    /// Whether the value is 1 / s also where sqrt(s) is an eighth less.
    [[nodiscard]] auto exact_nearby() const noexcept { return parts_.above > start * static_cast<Real>(15.0 / 49); }

    /// slope + 2 s curvature: half the second derivative by J.
    [[nodiscard]] N by_ratio() const noexcept { return 3 * (inverse_square() + cubic() * parts_.below); }

    /// The change of the value if s changes by `change`, to `after`.
    [[nodiscard]] N change(const N& change, const N& after) const noexcept {
        const auto by = change_of(parts_, larger<N>(change, -(parts_.above + parts_.below) - start));  // s >= 0
        return polynomial(steep * (2 * parts_.below + by.below) - 1, by.below) -
               by.above / s_ / larger<N>(after, start);
    }

  private:
    using Real = Each<N>;
    static constexpr double min_area_ratio = IncompressibleTriangle<double>::min_area_ratio;
    static constexpr Real start = static_cast<Real>(min_area_ratio * min_area_ratio), steep = 1 / start;

    [[nodiscard]] static N polynomial(const N& factor, const N& x) noexcept { return (steep * steep) * x * factor; }
    [[nodiscard]] static N cubic() noexcept { return 2 * steep * steep * steep; }
    [[nodiscard]] N inverse_square() const noexcept { return (1 / s_) * (1 / s_); }

    Parts<N> parts_;  // of s - start
    N s_;             // at least start
};

/// The vector e for which a displacement d of corner `i` adds e x d to the normal of length J.
template <Number N, Number Scalar>
[[nodiscard]] Vector3<N> normal_slope(const IncompressibleTriangle<Scalar>& rest, const Corners<N, 3>& x,
                                      std::size_t i) noexcept {
    return static_cast<N>(rest.along * rest.across) * (x[(i + 2) % 3] - x[(i + 1) % 3]);
}

template <Number N>
[[nodiscard]] N squared_norm_of(const std::array<Vector3<N>, 2>& f) noexcept {
    return squared_norm(f[0]) + squared_norm(f[1]);
}

/// F times a vector of the rest shape.
template <Number N>
[[nodiscard]] Vector3<N> times(const std::array<Vector3<N>, 2>& f, const std::array<N, 2>& a) noexcept {
    return a[0] * f[0] + a[1] * f[1];
}

template <Number N, Number Scalar>
[[nodiscard]] std::array<N, 2> converted(const std::array<Scalar, 2>& a) noexcept {
    return {static_cast<N>(a[0]), static_cast<N>(a[1])};
}

/// a / b, or zero for b = 0: an element whose constants are all zero, as in a lane without one, has no energy.
template <Number N>
[[nodiscard]] N quotient_or_zero(const N& a, const N& b) noexcept {
    return select<N>(b > 0, a / select<N>(b > 0, b, 1), 0);
}

/// Force and Hessian of an energy of one invariant.
template <Number N>
[[nodiscard]] CornerForce<N> corner_force(const StrainResponse<N>& energy, const InvariantSlope<N>& strain) noexcept {
    CornerForce<N> result{-energy.slope * strain.gradient, energy.slope * strain.hessian};
    result.hessian += outer<N>(energy.curvature, strain.gradient);
    return result;
}

/// Calls `add(corners, rest)` for each triangle of `mesh` that has an area, shrunk to 1 / `stretch`.
template <Real Scalar, class Add>
void for_each_rest_triangle(const TriangleMesh<Scalar>& mesh, double stretch, Add add) {
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        const auto corners = mesh.triangles().col(f);
        Corners<double, 3> x;
        for (Index i = 0; i < 3; ++i) {
            x[static_cast<std::size_t>(i)] = point(mesh.positions(), corners[i]).template cast<double>() / stretch;
        }
        if (norm<double>(cross<double>(x[1] - x[0], x[2] - x[0])) > 0) add(f, x);
    }
}

template <Real Scalar>
[[nodiscard]] IncompressibleTriangle<Scalar> rounded(const IncompressibleTriangle<double>& rest) noexcept {
    return {static_cast<Scalar>(rest.along), static_cast<Scalar>(rest.skew), static_cast<Scalar>(rest.across)};
}

}  // namespace detail

template <Number Scalar>
IncompressibleTriangle<Scalar> IncompressibleTriangle<Scalar>::in_order(std::size_t i) const noexcept {
    if (i == 0) return *this;
    const auto x = corners();
    return detail::rounded<Scalar>(incompressible_triangle({x[orders[i][0]], x[orders[i][1]], x[orders[i][2]]}));
}

template <Number Scalar>
template <Number N>
std::array<Vector3<N>, 2> IncompressibleTriangle<Scalar>::deformation(const Corners<N, 3>& x) const noexcept {
    const Vector3<N> first = x[1] - x[0], second = x[2] - x[0];
    return {static_cast<N>(along) * first, static_cast<N>(skew) * first + static_cast<N>(across) * second};
}

template <Number Scalar>
template <Number N>
std::array<N, 2> IncompressibleTriangle<Scalar>::gradient(std::size_t i) const noexcept {
    if (i == 0) return {static_cast<N>(-along), static_cast<N>(-(skew + across))};
    if (i == 1) return {static_cast<N>(along), static_cast<N>(skew)};
    return {N(0), static_cast<N>(across)};
}

template <Number Scalar>
template <Number N>
N IncompressibleTriangle<Scalar>::invariant(const Corners<N, 3>& x) const noexcept {
    const auto f = deformation(x);
    return detail::squared_norm_of(f) + detail::InverseSquare<N>(squared_norm(cross(f[0], f[1]))).value() - 3;
}

// |F|^2 is 2 |n|^2 I curved, n the gradient of the barycentric coordinate. J^2 is a quadratic function too: of the
// height over the opposite edge b alone. So the Hessian is diagonal along b, the height and the normal, and only the
// two latter entries can be negative.
template <Number Scalar>
template <Number N>
InvariantSlope<N> IncompressibleTriangle<Scalar>::invariant_slope(const Corners<N, 3>& x,
                                                                  std::size_t i) const noexcept {
    const auto f = deformation(x);
    const auto n = gradient<N>(i);
    const Vector3<N> normal = cross(f[0], f[1]), edge = detail::normal_slope<N>(*this, x, i);
    const Vector3<N> height = cross(normal, edge);
    const N square = squared_norm(normal), edge_square = squared_norm(edge), all = n[0] * n[0] + n[1] * n[1];
    const detail::InverseSquare<N> inverse(square);
    const N slope = inverse.slope();
    InvariantSlope<N> result{N(2) * (detail::times(f, n) + slope * height), diagonal3<N>(2 * all)};
    const N per_square = 1 / larger<N>(square, (std::numeric_limits<Each<N>>::min)());
    result.hessian += outer<N>(larger<N>(2 * inverse.by_ratio(), 0) * per_square, height);
    result.hessian += outer<N>(-2 * smaller<N>(-slope * edge_square, all) * per_square, normal);
    return result;
}

template <Number Scalar>
template <Number N>
InvariantChange<N> IncompressibleTriangle<Scalar>::invariant_change(const Corners<N, 3>& x, std::size_t i,
                                                                    const Vector3<N>& displacement) const noexcept {
    const auto f = deformation(x);
    const auto n = gradient<N>(i);
    const Vector3<N> normal = cross(f[0], f[1]), edge = detail::normal_slope<N>(*this, x, i);
    const Vector3<N> turn = cross(edge, displacement), by = detail::times(f, n), after = normal + turn;
    const N curved = (n[0] * n[0] + n[1] * n[1]) * squared_norm(displacement), turned = squared_norm(turn);
    const detail::InverseSquare<N> inverse(squared_norm(normal)), there(squared_norm(after));
    const N of_lengths = 2 * dot(displacement, by) + curved;
    const N of_area = inverse.change(2 * dot(normal, turn) + turned, squared_norm(after));
    // 1 / J^2 has a largest value, and so has its rounding error.
    constexpr Each<N> most = detail::InverseSquare<Each<N>>::largest / std::numeric_limits<Each<N>>::epsilon();
    const N steep = -(inverse.slope() + there.slope());
    const N area_size = smaller<N>(steep * (2 * norm(normal) * norm(turn) + turned), most);
    const N size = 2 * norm(displacement) * norm(by) + curved + area_size;
    return {of_lengths + of_area, size};
}

// Only 1 / J^2 is not quadratic. The displacement d adds w = e x d to the normal n of length J. The third derivative of
// 1 / |n|^2 along w is at most 24 |n.w| |w|^2 / |n|^6. While |w| <= J / 8, |n| stays above 7/8 J, and what the
// expansion leaves out is at most 8.92 |n.w| |w|^2 / J^6 + 2.23 |w|^4 / J^6. The Hessian contributes d.Hd / 2 >= 3
// (n.w)^2 / J^6.
template <Number Scalar>
template <Number N>
EnergyRemainder<N> IncompressibleTriangle<Scalar>::invariant_remainder(const Corners<N, 3>& x,
                                                                       std::size_t i) const noexcept {
    const auto f = deformation(x);
    const N square = squared_norm(cross(f[0], f[1]));
    const N edge_square = squared_norm(detail::normal_slope<N>(*this, x, i));
    const N per_square = 1 / larger<N>(square, (std::numeric_limits<Each<N>>::min)()),
            relative = edge_square * per_square;
    const auto is_known = detail::InverseSquare<N>(square).exact_nearby() | (edge_square <= 0);
    constexpr auto unknown = std::numeric_limits<Each<N>>::infinity();
    return {0, 7 * relative * relative * per_square, select<N>(is_known, 64 * relative, unknown)};
}

template <Number Scalar>
Eigen::Matrix3d IncompressibleTriangle<Scalar>::invariant_hessian(const Corners<double, 3>& x, std::size_t i,
                                                                  std::size_t j) const noexcept {
    const auto matrix = [](const Vector3<double>& a) {  // of the cross product with a
        Eigen::Matrix3d result;
        result << 0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0;
        return result;
    };
    const auto f = deformation(x);
    const auto n = gradient<double>(i), m = gradient<double>(j);
    const Vector3<double> normal = cross(f[0], f[1]);
    const Vector3<double> a = detail::normal_slope<double>(*this, x, i), b = detail::normal_slope<double>(*this, x, j);
    const detail::InverseSquare<double> inverse(squared_norm(normal));
    const double sign = i == j ? 0 : j == (i + 1) % 3 ? -1 : 1;
    const Eigen::Matrix3d by_area =
        2 * matrix(a).transpose() * matrix(b) + 2 * sign * static_cast<double>(along * across) * matrix(normal);
    return 2 * (n[0] * m[0] + n[1] * m[1]) * Eigen::Matrix3d::Identity() + inverse.slope() * by_area +
           4 * inverse.curvature() * cross(normal, a) * cross(normal, b).transpose();
}

template <Number Scalar>
template <Number N>
N IncompressibleTriangle<Scalar>::invariant_dilation(const Corners<N, 3>& x) const noexcept {
    const auto f = deformation(x);
    const N square = squared_norm(cross(f[0], f[1]));
    return detail::squared_norm_of(f) + 2 * square * detail::InverseSquare<N>(square).slope();
}

// The work is the current area times the sum of the two principal tensions.
template <Number Scalar>
template <Number N>
N IncompressibleTriangle<Scalar>::mean_tension(const Corners<N, 3>& x, const N& work) const noexcept {
    const N twice_area = norm<N>(cross<N>(x[1] - x[0], x[2] - x[0]));
    const auto has_area = twice_area * static_cast<N>(along * across) > N(Each<N>(1e-4));
    return select<N>(has_area, work / select<N>(has_area, twice_area, 1), 0);
}

}  // namespace membrane
