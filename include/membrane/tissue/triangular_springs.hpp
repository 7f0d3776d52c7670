// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/tissue/elements.hpp>
#include <membrane/tissue/material.hpp>

/// A sheet of any Poisson ratio on any mesh.
///
///     const auto tissue = membrane::Tissue(springs, membrane::triangular_springs(mesh, material));
namespace membrane {

/// Triangular biquadratic springs [Delingette08]: a triangle with edges of length l_k, L_k at rest, stores d.K d / 2
/// where d_k = l_k^2 - L_k^2: springs along its edges, and three that couple two edges each. This is exactly the energy
/// of a linear triangle of Saint Venant-Kirchhoff material in plane stress: results converge with the size of the
/// triangles, for any shape. Like that material it collapses if compressed to less than about 60 %.
template <Number Scalar>
struct TriangularSpring {
    static constexpr std::size_t corner_count = 3;  ///< the triangle's
    static constexpr std::array<std::array<std::size_t, 3>, 3> orders{
        {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}}};  ///< see `Element`

    Symmetric3<Scalar> stiffness;  ///< K [N/m^3]
    Vector3<Scalar> rest;          ///< L_k^2, edge k is opposite of corner k [m^2]

    ///@{
    /// As `Element` requires.
    template <Number N>
    [[nodiscard]] CornerForce<N> force_on(const Corners<N, 3>& x, std::size_t i) const noexcept;
    template <Number N>
    [[nodiscard]] N energy(const Corners<N, 3>& x) const noexcept;
    template <Number N>
    [[nodiscard]] EnergyChange<N> energy_change(const Corners<N, 3>& x, std::size_t i,
                                                const Vector3<N>& displacement) const noexcept;
    [[nodiscard]] Eigen::Matrix3d hessian_block(const Corners<double, 3>& x, std::size_t i,
                                                std::size_t j) const noexcept;
    [[nodiscard]] TriangularSpring in_order(std::size_t i) const noexcept;
    [[nodiscard]] TriangularSpring reshaped(const Corners<Scalar, 3>& before,
                                            const Corners<Scalar, 3>& after) const noexcept;
    ///@}

    /// Mean of the two principal tensions, force per current width [N/m].
    template <Number N>
    [[nodiscard]] N mean_tension(const Corners<N, 3>& x) const noexcept;
};

/// One for each triangle of `mesh`, whose lengths are `stretch` times those at rest. A triangle without area is left
/// out.
/// @throws InvalidInput for a material or a stretch out of its range. O(F).
template <Real Scalar>
[[nodiscard]] Elements<Scalar, TriangularSpring<Scalar>> triangular_springs(const TriangleMesh<Scalar>& mesh,
                                                                            const Material& material,
                                                                            double stretch = 1);

namespace detail {

// The numbers of the two corners after a corner.
struct OtherCorners {
    explicit OtherCorners(std::size_t i) noexcept : next((i + 1) % 3), last((i + 2) % 3) {}
    std::size_t next, last;
};

template <Number N>
[[nodiscard]] MEMBRANE_INLINE Vector3<N> squares_of_edges(const Corners<N, 3>& x) noexcept {
    return {squared_norm<N>(x[2] - x[1]), squared_norm<N>(x[0] - x[2]), squared_norm<N>(x[1] - x[0])};
}

// K d, the derivative of the energy by the squared edges [N/m]: half the force on an edge over its length.
template <Number N, Number Scalar>
[[nodiscard]] MEMBRANE_INLINE Vector3<N> times(const Symmetric3<Scalar>& k, const Vector3<N>& d) noexcept {
    const auto cast = [](const Scalar& number) { return static_cast<N>(number); };
    return Symmetric3<N>{cast(k.xx), cast(k.yy), cast(k.zz), cast(k.xy), cast(k.xz), cast(k.yz)} * d;
}

template <Number N, Number Scalar>
[[nodiscard]] MEMBRANE_INLINE Vector3<N> stretch(const TriangularSpring<Scalar>& spring,
                                                 const Corners<N, 3>& x) noexcept {
    return squares_of_edges(x) - spring.rest.template cast<N>();
}

template <Number Scalar>
[[nodiscard]] Scalar entry(const Symmetric3<Scalar>& k, std::size_t i, std::size_t j) noexcept {
    if (i == j) return i == 0 ? k.xx : i == 1 ? k.yy : k.zz;
    return i + j == 1 ? k.xy : i + j == 2 ? k.xz : k.yz;
}

/// K of a triangle with these corners, for the Lame constants of the sheet [N/m]. With n_i the gradient of barycentric
/// coordinate i, the strain is -1/4 of the sum of d_k (n_i n_j^T + n_j n_i^T), k opposite of the edge from i to j.
[[nodiscard]] inline Symmetric3<double> stiffness_of(const Corners<double, 3>& x, double lame, double shear) noexcept {
    const std::array<Vector3<double>, 3> edges{x[2] - x[1], x[0] - x[2], x[1] - x[0]};
    const double area = norm<double>(cross(edges[0], edges[1])) / 2;
    const auto gradients = [&](std::size_t i, std::size_t j) { return dot(edges[i], edges[j]) / (4 * area * area); };
    const auto of = [&](std::size_t k, std::size_t l) {
        const OtherCorners a(k), b(l);
        const double traces = 4 * gradients(a.next, a.last) * gradients(b.next, b.last);
        const double products = 2 * (gradients(a.next, b.next) * gradients(a.last, b.last) +
                                     gradients(a.next, b.last) * gradients(a.last, b.next));
        return area / 16 * (lame * traces + 2 * shear * products);
    };
    return {of(0, 0), of(1, 1), of(2, 2), of(0, 1), of(0, 2), of(1, 2)};
}

/// K of a triangle with these corners.
[[nodiscard]] inline Symmetric3<double> stiffness_of(const Corners<double, 3>& x, const Material& material) noexcept {
    const double nu = material.poisson_ratio, sheet = material.young_modulus * material.thickness;
    return stiffness_of(x, sheet * nu / (1 - nu * nu), sheet / (2 * (1 + nu)));
}

}  // namespace detail

template <Number Scalar>
template <Number N>
MEMBRANE_INLINE CornerForce<N> TriangularSpring<Scalar>::force_on(const Corners<N, 3>& x,
                                                                  std::size_t i) const noexcept {
    const detail::OtherCorners other(i);
    const Vector3<N> tensions = detail::times(stiffness, detail::stretch(*this, x));
    const N to_next = 2 * tensions[static_cast<Eigen::Index>(other.last)];
    const N to_last = 2 * tensions[static_cast<Eigen::Index>(other.next)];
    const Vector3<N> next = x[other.next] - x[i], last = x[other.last] - x[i];
    // The edge to the next corner is opposite of the last corner, and the edge to the last corner opposite of the next.
    const auto along_next = static_cast<N>(detail::entry(stiffness, other.last, other.last));
    const auto along_last = static_cast<N>(detail::entry(stiffness, other.next, other.next));
    const auto both = static_cast<N>(detail::entry(stiffness, other.next, other.last));
    CornerForce<N> result{to_next * next + to_last * last, outer<N>(4 * (along_next - both), next)};
    result.hessian += outer<N>(4 * (along_last - both), last);
    result.hessian += outer<N>(4 * both, next + last);
    result.hessian += diagonal3(larger<N>(to_next + to_last, N(0)));  // compression across the edges is left out
    // A displacement adds its square to both squared edges.
    result.remainder.fourth = larger<N>((along_next + along_last) / 2 + both, N(0));
    result.remainder.per_range = 0;
    return result;
}

template <Number Scalar>
TriangularSpring<Scalar> TriangularSpring<Scalar>::in_order(std::size_t i) const noexcept {
    const auto [a, b, c] = orders[i];
    const auto of = [this](std::size_t k, std::size_t l) { return detail::entry(stiffness, k, l); };
    const auto at = [this](std::size_t k) { return rest[static_cast<Eigen::Index>(k)]; };
    return {{of(a, a), of(b, b), of(c, c), of(a, b), of(a, c), of(b, c)}, {at(a), at(b), at(c)}};
}

// The Lame constants are those that come nearest to K, by least squares.
template <Number Scalar>
TriangularSpring<Scalar> TriangularSpring<Scalar>::reshaped(const Corners<Scalar, 3>& before,
                                                            const Corners<Scalar, 3>& after) const noexcept {
    const auto in_double = [](const Corners<Scalar, 3>& x) {
        return Corners<double, 3>{x[0].template cast<double>(), x[1].template cast<double>(),
                                  x[2].template cast<double>()};
    };
    const auto numbers = [](const auto& k) { return std::array<double, 6>{k.xx, k.yy, k.zz, k.xy, k.xz, k.yz}; };
    const auto from = in_double(before), to = in_double(after);
    const auto traces = numbers(detail::stiffness_of(from, 1, 0)), products = numbers(detail::stiffness_of(from, 0, 1));
    const auto own = numbers(stiffness);
    double tt = 0, tp = 0, pp = 0, tk = 0, pk = 0;
    for (std::size_t i = 0; i < 6; ++i) {
        tt += traces[i] * traces[i], tp += traces[i] * products[i], pp += products[i] * products[i];
        tk += traces[i] * own[i], pk += products[i] * own[i];
    }
    const double determinant = tt * pp - tp * tp;
    const double lame = (tk * pp - pk * tp) / determinant, shear = (pk * tt - tk * tp) / determinant;
    const auto k = detail::stiffness_of(to, lame, shear);
    const auto cast = [](double number) { return static_cast<Scalar>(number); };
    const Vector3<Scalar> squares = detail::squares_of_edges<Scalar>(after),
                          old = detail::squares_of_edges<Scalar>(before);
    return {{cast(k.xx), cast(k.yy), cast(k.zz), cast(k.xy), cast(k.xz), cast(k.yz)},
            {rest[0] * (squares[0] / old[0]), rest[1] * (squares[1] / old[1]), rest[2] * (squares[2] / old[2])}};
}

template <Number Scalar>
template <Number N>
N TriangularSpring<Scalar>::energy(const Corners<N, 3>& x) const noexcept {
    const Vector3<N> d = detail::stretch(*this, x);
    return dot<N>(d, detail::times(stiffness, d)) / 2;
}

template <Number Scalar>
template <Number N>
EnergyChange<N> TriangularSpring<Scalar>::energy_change(const Corners<N, 3>& x, std::size_t i,
                                                        const Vector3<N>& displacement) const noexcept {
    const detail::OtherCorners other(i);
    const Vector3<N> before = detail::stretch(*this, x), tensions = detail::times(stiffness, before);
    Vector3<N> by = Vector3<N>::Zero();
    by[static_cast<Eigen::Index>(other.last)] = dot<N>(displacement, displacement + N(2) * (x[i] - x[other.next]));
    by[static_cast<Eigen::Index>(other.next)] = dot<N>(displacement, displacement + N(2) * (x[i] - x[other.last]));
    using std::abs;
    const Vector3<N> squares = detail::squares_of_edges(x);
    const N largest_coordinate = detail::largest_magnitude(x[i]),
            edge = root_of(larger(larger(squares[0], squares[1]), squares[2]));
    const N tension = abs(tensions[0]) + (abs(tensions[1]) + abs(tensions[2]));
    return {dot<N>(by, tensions + detail::times(stiffness, by) / N(2)),
            2 * tension * edge * (edge + largest_coordinate)};
}

template <Number Scalar>
Eigen::Matrix3d TriangularSpring<Scalar>::hessian_block(const Corners<double, 3>& x, std::size_t i,
                                                        std::size_t j) const noexcept {
    const Vector3<double> tensions = detail::times(stiffness, detail::stretch(*this, x));
    // Derivative of the square of edge k by corner c.
    const auto slope = [&](std::size_t k, std::size_t c) -> Vector3<double> {
        if (k == c) return Vector3<double>::Zero();
        return 2 * (x[c] - x[3 - k - c]);
    };
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
        const double tension = k == i || k == j ? 0 : tensions[static_cast<Eigen::Index>(k)];
        sum += (i == j ? 2 : -2) * tension * Eigen::Matrix3d::Identity();
        for (std::size_t l = 0; l < 3; ++l) {
            sum += static_cast<double>(detail::entry(stiffness, k, l)) * slope(k, i) * slope(l, j).transpose();
        }
    }
    return sum;
}

// Scaling by 1 + s adds the energy s times the area times the sum of the principal tensions, twice the mean, and
// changes d by 2 s l^2: the squared edges give the mean tension.
template <Number Scalar>
template <Number N>
N TriangularSpring<Scalar>::mean_tension(const Corners<N, 3>& x) const noexcept {
    const N twice_area = norm<N>(cross<N>(x[1] - x[0], x[2] - x[0]));
    const Vector3<N> tensions = detail::times(stiffness, detail::stretch(*this, x));
    return twice_area > 0 ? 2 * dot<N>(tensions, detail::squares_of_edges(x)) / twice_area : N(0);
}

template <Real Scalar>
Elements<Scalar, TriangularSpring<Scalar>> triangular_springs(const TriangleMesh<Scalar>& mesh,
                                                              const Material& material, double stretch) {
    material.validate();
    detail::check_option("triangular_springs", stretch, "stretch", "1", false);
    using All = Elements<Scalar, TriangularSpring<Scalar>>;
    std::vector<typename All::Instance> all;
    for (const auto& corners : mesh.triangles().colwise()) {
        const std::array<Index, 3> placed{corners[0], corners[1], corners[2]};
        Corners<double, 3> x;
        for (std::size_t i = 0; i < 3; ++i) x[i] = point(mesh.positions(), placed[i]).template cast<double>() / stretch;
        if (!(norm<double>(cross<double>(x[1] - x[0], x[2] - x[0])) > 0)) continue;
        const auto k = detail::stiffness_of(x, material);
        const auto cast = [](double number) { return static_cast<Scalar>(number); };
        all.push_back({placed,
                       {{cast(k.xx), cast(k.yy), cast(k.zz), cast(k.xy), cast(k.xz), cast(k.yz)},
                        detail::squares_of_edges(x).template cast<Scalar>()}});
    }
    return All(mesh, std::move(all));
}

}  // namespace membrane
