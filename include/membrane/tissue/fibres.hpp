// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/tissue/incompressible_triangle.hpp>

/// Families of fibres in a sheet: collagen.
///
///     const auto matrix = membrane::neo_hookean(mesh, material);
///     const auto along_x = membrane::fibre_directions(mesh, [](const auto&) { return Eigen::Vector3d::UnitX(); });
///     const auto collagen = membrane::fibres(mesh, fibre_material, {along_x});
///     const auto tissue = membrane::Tissue(springs, matrix, collagen);
namespace membrane {

/// Fibres of one kind. The defaults of `stiffening` and `stretch_limit` are placeholders, of no tissue: take the first
/// from a fit to your measurements. The limit keeps the exponential within the range of numbers; set it above the
/// stretches of your scene.
struct FibreMaterial {
    double stiffness = 0;        ///< k1, a quarter of Young's modulus of taut fibres at rest [Pa], positive
    double stiffening = 10;      ///< k2, positive
    double dispersion = 0;       ///< kappa: 0 if all fibres are parallel, 1/3 if they have all directions alike
    double thickness = 0;        ///< of the sheet [m], positive
    double stretch_limit = 1.3;  ///< above 1: from the strain of this stretch on, the energy is quadratic in the strain

    /// The fibres' strain at the limit, `stretch_limit`^2 - 1.
    [[nodiscard]] double strain_limit() const noexcept { return stretch_limit * stretch_limit - 1; }

    /// @throws InvalidInput for a number out of its range, or if stiffening times the square of `strain_limit()`
    /// exceeds 20
    void validate() const;
};

/// Fibres of one mean direction in a linear triangle of an incompressible sheet, under tension alone: they store
/// area thickness k1 / (2 k2) (exp(k2 max(e, 0)^2) - 1) [Gasser06]. The fibres' strain is
/// e = kappa (I1 - 3) + (1 - 3 kappa) (I4 - 1), I4 the square of the stretch in their mean direction. Beyond the limit
/// of `FibreMaterial` the energy continues as its second-order Taylor polynomial in e. Fibres that become slack lose
/// their stiffness at once: force and energy are continuous there, the Hessian is not. Calls exp: results may differ in
/// the last bits from one mathematics library to another.
///
/// Finite if no edge is longer than 1e5 times the lengths at rest in float, 1e60 times in double.
template <Number Scalar>
struct FibreTriangle {
    static constexpr std::size_t corner_count = 3;                          ///< the triangle's
    static constexpr auto orders = IncompressibleTriangle<Scalar>::orders;  ///< see `Element`

    IncompressibleTriangle<Scalar> rest;  ///< shape
    std::array<Scalar, 2> direction;      ///< unit vector at rest; the first axis is along the edge from corner 0 to 1
    Scalar stiffness;                     ///< area thickness k1 [J]
    Scalar stiffening;                    ///< k2 [1]
    Scalar dispersion;                    ///< kappa [1]
    Scalar limit;                         ///< strain from which the energy is quadratic [1]

    ///@{
    /// The strain of the fibres, also as a function of the position of corner `i`, and its change if that moves.
    template <Number N>
    [[nodiscard]] N strain(const Corners<N, 3>& x) const noexcept;
    template <Number N>
    [[nodiscard]] InvariantSlope<N> strain_slope(const Corners<N, 3>& x, std::size_t i) const noexcept;
    template <Number N>
    [[nodiscard]] InvariantChange<N> strain_change(const Corners<N, 3>& x, std::size_t i,
                                                   const Vector3<N>& displacement) const noexcept;
    ///@}

    /// Energy for a strain, and its derivatives.
    template <Number N>
    [[nodiscard]] StrainResponse<N> response(const N& strain) const noexcept;

    ///@{
    /// As `Element` requires.
    template <Number N>
    [[nodiscard]] CornerForce<N> force_on(const Corners<N, 3>& x, std::size_t i) const noexcept {
        return detail::corner_force<N>(response<N>(strain(x)), strain_slope(x, i));
    }
    template <Number N>
    [[nodiscard]] N energy(const Corners<N, 3>& x) const noexcept {
        return response<N>(strain(x)).energy;
    }
    template <Number N>
    [[nodiscard]] EnergyChange<N> energy_change(const Corners<N, 3>& x, std::size_t i,
                                                const Vector3<N>& displacement) const noexcept;
    [[nodiscard]] Eigen::Matrix3d hessian_block(const Corners<double, 3>& x, std::size_t i,
                                                std::size_t j) const noexcept;
    [[nodiscard]] FibreTriangle in_order(std::size_t i) const noexcept;
    ///@}

    /// Mean of the two principal tensions, force per current width [N/m].
    template <Number N>
    [[nodiscard]] N mean_tension(const Corners<N, 3>& x) const noexcept;

    /// (stretch in the mean direction)^2 [1].
    template <Number N>
    [[nodiscard]] N squared_stretch(const Corners<N, 3>& x) const noexcept;

    ///@{
    /// The two terms of the strain: kappa, and 1 - 3 kappa.
    template <Number N>
    [[nodiscard]] N all_round() const noexcept {
        return static_cast<N>(dispersion);
    }
    template <Number N>
    [[nodiscard]] N along() const noexcept {
        return static_cast<N>(1 - 3 * dispersion);
    }
    ///@}
};
static_assert(Element<FibreTriangle<float>> && Element<FibreTriangle<double>>);

/// Mean direction of the fibres of each triangle, 3 x F: `direction(p)` at its centroid p [m], an `Eigen::Vector3d`.
/// See `fibres` for what its length means.
template <Real Scalar, std::invocable<const Eigen::Vector3d&> Direction>
[[nodiscard]] Points<double> fibre_directions(const TriangleMesh<Scalar>& mesh, const Direction& direction);

/// Families of fibres, each by its mean directions, 3 x F: one element for each triangle of `mesh` and family. A
/// direction is projected into its triangle. Its length before is the fibres' share there, a factor of their stiffness:
/// 1 for all, 0 for none. The lengths of the mesh are `stretch` times those at rest. A triangle without area, and a
/// direction along the normal, are left out.
/// @throws InvalidInput for a material or a stretch out of its range, or for directions that are not finite or not one
/// for each triangle. O(F).
template <Real Scalar>
[[nodiscard]] Elements<Scalar, FibreTriangle<Scalar>> fibres(const TriangleMesh<Scalar>& mesh,
                                                             const FibreMaterial& material,
                                                             const std::vector<Points<double>>& families,
                                                             double stretch = 1);

/// Where a cornea is, for `cornea_fibres`.
struct CorneaPose {
    Eigen::Vector3d apex = Eigen::Vector3d::Zero();         ///< the middle [m]
    Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();        ///< of the eye, out of it
    Eigen::Vector3d horizontal = Eigen::Vector3d::UnitX();  ///< from nasal to temporal or back
    double limbus_radius = 5.8e-3;                          ///< distance of the limbus from the axis [m], positive
    double transition = 1e-3;                               ///< width of the ring in which directions change [m], >= 0
};

/// The three families of collagen of a human cornea, for `fibres`: a horizontal and a vertical one in the middle, and a
/// circumferential one at the limbus. Within 1 mm of the limbus the third replaces the first two
/// [Aghamohammadzadeh04]: here their shares fall from 1 to 0, linearly in the distance from the axis, while that of the
/// third rises from 0 to 1.
/// @throws InvalidInput for a number out of its range, or if the axis is zero or along `horizontal`
template <Real Scalar>
[[nodiscard]] std::vector<Points<double>> cornea_fibres(const TriangleMesh<Scalar>& mesh, const CorneaPose& pose = {});

inline void FibreMaterial::validate() const {
    constexpr std::string_view component = "FibreMaterial";
    detail::check_option(component, stiffness, "stiffness", "Pa", false);
    detail::check_option(component, stiffening, "stiffening", "1", false);
    detail::check_option(component, thickness, "thickness", "m", false);
    if (!is_finite(dispersion) || !(dispersion >= 0 && dispersion <= 1.0 / 3)) {
        refuse(component, "dispersion must be 0 to 1/3, got ", dispersion);
    }
    if (!is_finite(stretch_limit) || !(stretch_limit > 1)) {
        refuse(component, "stretch_limit must be finite and above 1, got ", stretch_limit);
    }
    const double exponent = stiffening * strain_limit() * strain_limit();
    if (!(exponent <= 20)) {
        refuse(component, "stiffening times the square of the strain at stretch_limit must be at most 20, got ",
               exponent);
    }
}

template <Number Scalar>
template <Number N>
N FibreTriangle<Scalar>::squared_stretch(const Corners<N, 3>& x) const noexcept {
    return squared_norm(detail::times<N>(rest.deformation(x), detail::converted<N>(direction)));
}

template <Number Scalar>
template <Number N>
N FibreTriangle<Scalar>::strain(const Corners<N, 3>& x) const noexcept {
    return all_round<N>() * rest.invariant(x) + along<N>() * (squared_stretch(x) - 1);
}

template <Number Scalar>
template <Number N>
InvariantSlope<N> FibreTriangle<Scalar>::strain_slope(const Corners<N, 3>& x, std::size_t i) const noexcept {
    const auto a = detail::converted<N>(direction);
    const auto n = rest.template gradient<N>(i);
    const N turn = n[0] * a[0] + n[1] * a[1], twice = 2 * along<N>() * turn;
    const auto of_all = rest.invariant_slope(x, i);
    const Vector3<N> stretched = detail::times<N>(rest.deformation(x), a);
    InvariantSlope<N> result{all_round<N>() * of_all.gradient + twice * stretched, all_round<N>() * of_all.hessian};
    result.hessian += diagonal3<N>(twice * turn);
    return result;
}

template <Number Scalar>
template <Number N>
InvariantChange<N> FibreTriangle<Scalar>::strain_change(const Corners<N, 3>& x, std::size_t i,
                                                        const Vector3<N>& displacement) const noexcept {
    const auto a = detail::converted<N>(direction);
    const auto n = rest.template gradient<N>(i);
    const auto of_all = rest.invariant_change(x, i, displacement);
    const Vector3<N> stretched = detail::times<N>(rest.deformation(x), a);
    const Vector3<N> by = (n[0] * a[0] + n[1] * a[1]) * displacement;
    const N change = 2 * dot(stretched, by) + squared_norm(by), size = norm(by) * (2 * norm(stretched) + norm(by));
    return {all_round<N>() * of_all.change + along<N>() * change, all_round<N>() * of_all.size + along<N>() * size};
}

template <Number Scalar>
template <Number N>
StrainResponse<N> FibreTriangle<Scalar>::response(const N& strain) const noexcept {
    const N b = static_cast<N>(stiffening), k = static_cast<N>(stiffness), most = static_cast<N>(limit);
    const N within = smaller<N>(larger<N>(strain, 0), most), beyond = larger<N>(strain - most, 0);
    const N growth = lane_by_lane<N>([](auto z) { return std::expm1(z); }, b * within * within);
    const N stiff = k * (1 + growth), slope = stiff * within, curvature = stiff * (1 + 2 * b * within * within);
    return {k * detail::quotient_or_zero<N>(growth, 2 * b) + beyond * (slope + curvature * beyond / 2),
            slope + curvature * beyond, select<N>(strain > 0, curvature, 0)};
}

// As for `FungTriangle`, over the part of the strain from 0 to the limit, and over what is beyond.
template <Number Scalar>
template <Number N>
EnergyChange<N> FibreTriangle<Scalar>::energy_change(const Corners<N, 3>& x, std::size_t i,
                                                     const Vector3<N>& displacement) const noexcept {
    const N b = static_cast<N>(stiffening), k = static_cast<N>(stiffness), most = static_cast<N>(limit);
    const N before = strain(x);
    const auto change = strain_change(x, i, displacement);
    const auto taut = detail::parts_of<N>(before);
    const auto parts = detail::parts_of<N>(taut.above - most);
    const auto by = detail::change_of(parts, detail::change_of(taut, change.change).above);
    const N within = smaller<N>(taut.above, most), by_within = larger<N>(by.below, -within);
    const N reached = within + by_within;
    const N stiff = k * lane_by_lane<N>([](auto z) { return std::exp(z); }, b * within * within);
    const N growth = lane_by_lane<N>([](auto z) { return std::expm1(z); }, b * by_within * (within + reached));
    const auto rate = [&](const N& inside, const N& outside) {  // of the polynomial, per stiffness
        return inside + (1 + 2 * b * inside * inside) * outside;
    };
    const N top = larger<N>(within, reached), middle = parts.above + by.above / 2;
    const N slopes = rate(within, parts.above) + (1 + growth) * rate(reached, parts.above + by.above);
    return {stiff * (detail::quotient_or_zero<N>(growth, 2 * b) +
                     (1 + larger<N>(growth, 0)) * by.above * rate(top, middle)),
            stiff * slopes * change.size};
}

template <Number Scalar>
Eigen::Matrix3d FibreTriangle<Scalar>::hessian_block(const Corners<double, 3>& x, std::size_t i,
                                                     std::size_t j) const noexcept {
    const auto a = detail::converted<double>(direction);
    const auto n = rest.template gradient<double>(i), m = rest.template gradient<double>(j);
    const double turns = (n[0] * a[0] + n[1] * a[1]) * (m[0] * a[0] + m[1] * a[1]);
    const auto energy = response<double>(strain(x));
    const Eigen::Matrix3d of_strain = all_round<double>() * rest.invariant_hessian(x, i, j) +
                                      2 * along<double>() * turns * Eigen::Matrix3d::Identity();
    return energy.slope * of_strain +
           energy.curvature * strain_slope(x, i).gradient * strain_slope(x, j).gradient.transpose();
}

template <Number Scalar>
FibreTriangle<Scalar> FibreTriangle<Scalar>::in_order(std::size_t i) const noexcept {
    if (i == 0) return *this;
    const auto x = rest.corners();
    const Vector3<double> axis = direction_or_zero<double>(x[orders[i][1]] - x[i]);
    const double u = direction[0], v = direction[1];
    auto ordered = *this;
    ordered.rest = rest.in_order(i);
    ordered.direction = {static_cast<Scalar>(axis[0] * u + axis[1] * v),
                         static_cast<Scalar>(axis[0] * v - axis[1] * u)};
    return ordered;
}

template <Number Scalar>
template <Number N>
N FibreTriangle<Scalar>::mean_tension(const Corners<N, 3>& x) const noexcept {
    const N dilation = all_round<N>() * rest.invariant_dilation(x) + along<N>() * squared_stretch(x);
    return rest.mean_tension(x, 2 * response<N>(strain(x)).slope * dilation);
}

template <Real Scalar, std::invocable<const Eigen::Vector3d&> Direction>
Points<double> fibre_directions(const TriangleMesh<Scalar>& mesh, const Direction& direction) {
    Points<double> result(3, mesh.triangle_count());
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (const Index v : mesh.triangles().col(f)) sum += mesh.positions().col(v).template cast<double>();
        result.col(f) = direction(Eigen::Vector3d(sum / 3));
    }
    return result;
}

template <Real Scalar>
Elements<Scalar, FibreTriangle<Scalar>> fibres(const TriangleMesh<Scalar>& mesh, const FibreMaterial& material,
                                               const std::vector<Points<double>>& families, double stretch) {
    material.validate();
    detail::check_option("fibres", stretch, "stretch", "1", false);
    for (const auto& directions : families) {
        if (directions.cols() == mesh.triangle_count() && is_finite(directions)) continue;
        refuse("fibres", "directions must be finite, one for each triangle (", mesh.triangle_count(), "), got ",
               directions.cols());
    }
    const auto cast = [](double number) { return static_cast<Scalar>(number); };
    std::vector<ElementInstance<FibreTriangle<Scalar>>> all;
    detail::for_each_rest_triangle(mesh, stretch, [&](Index f, const Corners<double, 3>& x) {
        const auto rest = incompressible_triangle(x);
        const auto corners = mesh.triangles().col(f);
        const Vector3<double> first = (x[1] - x[0]).normalized();
        const Vector3<double> second = cross<double>(cross<double>(x[1] - x[0], x[2] - x[0]).normalized(), first);
        for (const auto& directions : families) {
            const Vector3<double> direction = directions.col(f);
            const double share = norm(direction), a = dot(direction, first), b = dot(direction, second);
            const double inside = std::hypot(a, b);
            if (!(inside > 1e-9 * share)) continue;
            all.push_back({{corners[0], corners[1], corners[2]},
                           {detail::rounded<Scalar>(rest),
                            {cast(a / inside), cast(b / inside)},
                            cast(share * material.stiffness * material.thickness * rest.area()),
                            cast(material.stiffening),
                            cast(material.dispersion),
                            cast(material.strain_limit())}});
        }
    });
    return {mesh, std::move(all)};
}

template <Real Scalar>
std::vector<Points<double>> cornea_fibres(const TriangleMesh<Scalar>& mesh, const CorneaPose& pose) {
    constexpr std::string_view component = "CorneaPose";
    detail::check_option(component, pose.limbus_radius, "limbus_radius", "m", false);
    detail::check_option(component, pose.transition, "transition", "m");
    const Vector3<double> axis = direction_or_zero<double>(pose.axis),
                          given = direction_or_zero<double>(pose.horizontal);
    const Vector3<double> upward = cross(axis, given);
    if (!is_finite(upward) || !(norm(upward) > 1e-6))
        refuse(component, "axis and horizontal must not be parallel or zero");
    if (!is_finite(pose.apex)) refuse(component, "apex must be finite");
    const Vector3<double> vertical = upward.normalized(), horizontal = cross(vertical, axis);
    const auto family = [&](const auto& direction) {  // `direction(outward, share of the limbus)`
        return fibre_directions(mesh, [&](const Eigen::Vector3d& p) -> Eigen::Vector3d {
            const Vector3<double> from = Vector3<double>(p) - Vector3<double>(pose.apex);
            const Vector3<double> outward = from - dot(from, axis) * axis;
            const double beyond = norm(outward) - (pose.limbus_radius - pose.transition);
            const double part = beyond > 0 ? (pose.transition > 0 ? (std::min)(beyond / pose.transition, 1.0) : 1) : 0;
            return direction(outward, part);
        });
    };
    return {family([&](const auto&, double part) { return (1 - part) * horizontal; }),
            family([&](const auto&, double part) { return (1 - part) * vertical; }),
            family([&](const auto& outward, double part) {
                return part * direction_or_zero<double>(cross(axis, outward));
            })};
}

}  // namespace membrane
