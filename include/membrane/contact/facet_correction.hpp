// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <string_view>
#include <vector>

#include <membrane/contact/contact.hpp>
#include <membrane/core/check.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/vertex_split.hpp>

/// A ball on a mesh whose triangles are not smaller than its contact.
///
///     auto tracker = membrane::ContactTracker(mesh, {.fine_triangles = 0});               // by faces
///     const membrane::FacetCorrection<double> correction(mesh, {.tension = 1.8, .stiffness = 50});    // [N/m]
///     auto pressed = tool;
///     pressed.position += offset;                                             // Vector3, zero at the start
///     const auto contact = tracker.update(tree, x, pressed);
///     const auto report  = solver.step(x, dt, network, foundation, press(pressed, contact));
///     offset += (correction(x, contact, report.reactions[0]) - offset) / 2;   // the force policy gets `tool`
namespace membrane {

/// What the sheet under the ball is. One of the two must be above zero.
struct FacetCorrectionOptions {
    double tension = 0;    ///< Before the press [N/m]: E t (stretch - 1) / (1 - nu), or pressure times radius / 2.
    double stiffness = 0;  ///< E t [N/m]: the ball raises the tension. 0: it does not.
};

/// How far a ball on flat triangles must be moved back for the force that it has on a smooth membrane.
///
/// A membrane of tension T touches a ball of radius R within a = sqrt(F R / (2 pi T)) around its lowest point, at the
/// depth a^2 / R (ln(L / a) + 1 / 2), L the distance of the rim. Flat triangles can neither curve around the ball nor
/// show the logarithm below their size h: at the same force they are less deep by f a^2 / R. In a regular triangulation
/// f depends on a / h and on the place of the ball in the triangle alone. For a << h it is ln(0.267 h / a), and larger
/// by (2 pi / sqrt(3)) sum_{i<j} w_i w_j at the barycentric coordinates w: 0.9 over an edge, 1.2 over a face; for a >>
/// h it is 0.1 (h / a)^2. `facet_depth` has the values for any a / h, from the discrete membrane under a paraboloid.
/// Here h is the mean length of the edges around, weighted by their cotangents (the conductance of each), and T rises
/// with the slope s = a / R at the rim of the contact by 3/16 E t s^2 (a sheet of small slopes, Föppl's equations).
///
/// On 2,500 vertices of a disc, balls of 3 to 12 edges in radius and 0.1 to 0.5 radii deep have the force of CalculiX
/// within 1.1 % (without: 1 to 18 % too large), see bench/README.md; on irregular triangles within 4 %.
/// For spheres, on a sheet under tension whose decay length sqrt(T / c) on a foundation of stiffness c per area is more
/// than an edge, away from fixed vertices, with contact by faces alone: `ContactTracker(mesh, {.fine_triangles = 0})`.
///
/// The offset depends on the force and the force on the offset: half a step from tick to tick converges, for a ratio of
/// the depths with and without triangles of up to 4. One instance serves any number of tools and threads.
template <Real Scalar>
class FacetCorrection {
  public:
    /// @throws InvalidInput for options that are negative, not finite or both zero. Cost: O(F log F).
    FacetCorrection(const TriangleMesh<Scalar>& mesh, const FacetCorrectionOptions& options);

    /// The displacement of the tool from where it is to where it must press, along `reaction`, the force on it [N];
    /// zero without a contact or a force, where vertices carry it, or if a number is not finite or a vertex not
    /// there. `contact` is the one that the step had, `x` the positions [m].
    /// Online. Cost: linear in `contact.patch.triangles`.
    [[nodiscard]] Vector3<Scalar> operator()(const ConstPointsRef<Scalar>& x, const Contact<Scalar>& contact,
                                             const Vector3<Scalar>& reaction) const noexcept;

    /// A vertex becomes two, each with the edges at rest that it had. Online.
    void split(const VertexSplit& split) noexcept {
        edge_[static_cast<std::size_t>(split.copy)] = edge_[static_cast<std::size_t>(split.vertex)];
    }

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.edge_);
    }

    /// Radius of the contact of a ball of `radius` [m] under this force [N], at most that radius [m].
    [[nodiscard]] double contact_radius(double radius, double force) const noexcept;

  private:
    std::vector<Scalar> edge_;  // mean length at each vertex, weighted by cotangents [m]
    FacetCorrectionOptions options_;
};

/// The depth f that a regular triangulation lacks, in units of a^2 / R, at the barycentric coordinates `weights`;
/// `ratio` is a / h (see `FacetCorrection`).
[[nodiscard]] inline double facet_depth(double ratio, const Vector3<double>& weights) noexcept;

namespace detail {

inline constexpr std::string_view facet_correction_name = "FacetCorrection";

/// f at a / h: coefficients of 1, s, 27 w0 w1 w2 and s^2, s = 3 sum_{i<j} w_i w_j. By least squares over the triangle,
/// from the equilibria of a regular triangulation of 1,801 vertices under a paraboloid (projected Gauss-Seidel); the
/// tests compute it anew. Between the rows f changes with the logarithm of a / h.
struct FacetDepth {
    double ratio;
    std::array<double, 4> of;
};
inline constexpr std::array<FacetDepth, 22> facet_depths{{
    {0.03, {2.193, 1.203, 0.000, 0.000}},  {0.05, {1.692, 1.193, 0.000, 0.000}},  {0.07, {1.371, 1.177, 0.000, 0.001}},
    {0.1, {1.047, 1.143, -0.001, 0.003}},  {0.15, {0.716, 1.062, -0.004, 0.013}}, {0.2, {0.523, 0.951, -0.010, 0.035}},
    {0.3, {0.342, 0.658, -0.039, 0.132}},  {0.4, {0.285, 0.316, -0.086, 0.290}},  {0.5, {0.270, -0.021, -0.142, 0.476}},
    {0.6, {0.261, -0.150, -0.142, 0.431}}, {0.7, {0.246, -0.121, -0.100, 0.221}}, {0.8, {0.221, 0.029, -0.017, -0.112}},
    {0.9, {0.189, 0.021, 0.112, -0.205}},  {1, {0.151, -0.015, 0.066, -0.107}},   {1.1, {0.109, 0.008, 0.004, -0.059}},
    {1.2, {0.064, 0.034, -0.018, -0.019}}, {1.3, {0.035, 0.035, -0.013, 0.015}},  {1.4, {0.043, -0.023, 0.003, 0.048}},
    {1.7, {0.038, 0.024, -0.003, -0.034}}, {2, {0.034, -0.014, 0.001, 0.004}},    {2.5, {0.018, -0.008, -0.003, 0.009}},
    {3, {0.011, -0.003, -0.001, 0.006}},
}};

/// The triangle that the line through the ball's centre along `direction` meets, and where.
template <Real Scalar>
struct Foot {
    std::array<Index, 3> corners;
    Vector3<Scalar> weights;
};

/// Of all triangles at the contact the one that the line is deepest inside of, or misses by least.
template <Real Scalar>
[[nodiscard]] Foot<Scalar> foot_of(const ConstPointsRef<Scalar>& x, const Contact<Scalar>& contact,
                                   const Vector3<Scalar>& direction) noexcept {
    Foot<Scalar> foot{contact.corners, contact.barycentric};
    Scalar best = -1;
    for (const auto& listed : contact.patch.triangles) {
        const auto at = triangle_at(x, listed.corners);
        const Vector3<Scalar> a = at.a - contact.patch.axis_point, b = at.b - contact.patch.axis_point,
                              c = at.c - contact.patch.axis_point;
        Vector3<Scalar> weights(dot(direction, cross(b, c)), dot(direction, cross(c, a)), dot(direction, cross(a, b)));
        const Scalar sum = (weights[0] + weights[1]) + weights[2];
        if (sum == 0) continue;
        weights /= sum;
        const Scalar least = weights.minCoeff();
        if (!(least > best)) continue;
        best = least;
        foot = {listed.corners, weights};
    }
    for (Eigen::Index k = 0; k < 3; ++k) foot.weights[k] = (std::max)(foot.weights[k], Scalar(0));
    foot.weights /= (foot.weights[0] + foot.weights[1]) + foot.weights[2];
    return foot;
}

}  // namespace detail

inline double facet_depth(double ratio, const Vector3<double>& weights) noexcept {
    const auto& rows = detail::facet_depths;
    const double s = 3 * ((weights[0] * weights[1] + weights[1] * weights[2]) + weights[2] * weights[0]);
    const double product = 27 * (weights[0] * weights[1]) * weights[2];
    const auto value = [&](const detail::FacetDepth& row) {
        return ((row.of[0] + row.of[1] * s) + row.of[2] * product) + row.of[3] * (s * s);
    };
    const auto above = std::find_if(rows.begin(), rows.end(), [&](const auto& row) { return row.ratio > ratio; });
    if (above == rows.begin()) return value(rows.front()) + std::log(rows.front().ratio / ratio);
    if (above == rows.end()) return value(rows.back()) * (rows.back().ratio / ratio) * (rows.back().ratio / ratio);
    const auto& below = *(above - 1);
    const double part = std::log(ratio / below.ratio) / std::log(above->ratio / below.ratio);
    return (1 - part) * value(below) + part * value(*above);
}

template <Real Scalar>
FacetCorrection<Scalar>::FacetCorrection(const TriangleMesh<Scalar>& mesh, const FacetCorrectionOptions& options)
    : edge_(static_cast<std::size_t>(mesh.vertex_count()), 0), options_(options) {
    constexpr auto name = detail::facet_correction_name;
    detail::check_option(name, options.tension, "tension", "N/m", true);
    detail::check_option(name, options.stiffness, "stiffness", "N/m", true);
    if (!(options.tension + options.stiffness > 0)) {
        refuse(name, "tension or stiffness must be positive [N/m], got 0 for both");
    }
    const auto at = [&](Index v) { return point(mesh.positions(), v); };
    std::vector<Scalar> sum(edge_.size(), 0);
    for_each_edge(half_edges(mesh.triangles()), [&](std::span<const HalfEdge> sides) {
        Scalar weight = 0;
        for (const auto& side : sides) {
            const Vector3<Scalar> a = at(side.first) - at(side.apex), b = at(side.second) - at(side.apex);
            const Scalar area = norm(cross(a, b));
            if (area > 0) weight += dot(a, b) / area;
        }
        weight = (std::max)(weight, (std::numeric_limits<Scalar>::min)());
        const Scalar length = norm<Scalar>(at(sides[0].second) - at(sides[0].first));
        for (const auto v : {static_cast<std::size_t>(sides[0].first), static_cast<std::size_t>(sides[0].second)}) {
            edge_[v] += weight * length;
            sum[v] += weight;
        }
    });
    for (std::size_t v = 0; v < edge_.size(); ++v) {
        if (sum[v] > 0) edge_[v] /= sum[v];
    }
}

template <Real Scalar>
double FacetCorrection<Scalar>::contact_radius(double radius, double force) const noexcept {
    // a^2 (tension + 3/16 stiffness a^2 / radius^2) = force radius / (2 pi)
    const double moment = force * radius / (2 * std::numbers::pi);
    const double rise = 3.0 / 16 * options_.stiffness / (radius * radius);
    const double root = std::sqrt(options_.tension * options_.tension + 4 * rise * moment);
    return (std::min)(std::sqrt(2 * moment / (options_.tension + root)), radius);
}

template <Real Scalar>
Vector3<Scalar> FacetCorrection<Scalar>::operator()(const ConstPointsRef<Scalar>& x, const Contact<Scalar>& contact,
                                                    const Vector3<Scalar>& reaction) const noexcept {
    const Scalar force = norm(reaction);
    if (!contact.touching() || !is_finite(force) || !(force > 0)) return Vector3<Scalar>::Zero();
    const auto& points = contact.patch.points;
    const auto is_vertex = [](const auto& point) { return point.feature == vertex_feature; };
    if (std::any_of(points.begin(), points.end(), is_vertex)) return Vector3<Scalar>::Zero();
    const auto is_here = [&](const auto& at) { return are_vertices(at.corners, x.cols()); };
    const bool fits = static_cast<std::size_t>(x.cols()) == edge_.size() && is_here(contact) &&
                      std::all_of(contact.patch.triangles.begin(), contact.patch.triangles.end(), is_here);
    if (!fits) return Vector3<Scalar>::Zero();
    const Vector3<Scalar> direction = reaction / force;
    const auto foot = detail::foot_of(x, contact, direction);
    double edge = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        edge += static_cast<double>(foot.weights[static_cast<Eigen::Index>(k)] *
                                    edge_[static_cast<std::size_t>(foot.corners[k])]);
    }
    const double radius = contact.patch.radius, a = contact_radius(radius, force);
    const double depth = facet_depth(a / edge, foot.weights.template cast<double>()) * (a * a / radius);
    if (!is_finite(depth)) return Vector3<Scalar>::Zero();
    return static_cast<Scalar>(depth) * direction;
}

}  // namespace membrane
