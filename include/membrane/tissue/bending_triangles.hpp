// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/QR>

#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/tissue/elements.hpp>

/// Bending of a plate or shell, with its Poisson ratio, on any mesh.
///
///     const auto bending = membrane::bending_triangles(mesh, {.rigidity = membrane::flexural_rigidity(material),
///                                                             .poisson_ratio = material.poisson_ratio});
///     const auto tissue = membrane::Tissue(springs, sheet, bending);
namespace membrane {

/// What bends, and where its tangent is held.
struct BendingOptions {
    double rigidity = 0;             ///< D [N m], see `flexural_rigidity`
    double poisson_ratio = 0;        ///< of the bent sheet, 0 to 0.5
    std::vector<Index> supported{};  ///< vertices that are held in place, as pinned ones are; the sheet may turn there
    std::vector<Index> clamped{};    ///< vertices that are held in place, with the tangent plane
};

/// A triangle, its three neighbours and theirs, of which it stores D A / 2 ((tr k)^2 - 2 (1 - nu) det k), k the change
/// of its curvature. k is that of the constant-moment plate element [Morley68], as in the shape operators of
/// [Grinspun06]: the sum over the sides of (l / A) s m m^T, l the length, m the outward normal in the plane, s how much
/// steeper the sheet is at the middle of the side than the triangle. Instead of being an unknown, s is found from the
/// vertices of the side's two triangles and of their neighbours, exactly if heights are quadratic. Both triangles use
/// the same slope, so that constant moments are in equilibrium on any mesh.
///
/// The energy is |r|^2 / 2, r linear in the heights of the outer nine corners over the plane of the triangle, whose
/// normal is the only nonlinear term. The Hessian leaves out the term that vanishes at rest. Neighbours may be folded
/// by up to a quarter of a turn; beyond, the force decreases again.
template <Number Scalar>
struct BendingTriangle {
    /// Three of the triangle; number 3 + k is the apex beyond the side from corner k to the next, 6 + 2 k and 7 + 2 k
    /// are those beyond the apex' sides to corner k and to the next. Where there is none, any vertex with weight 0.
    static constexpr std::size_t corner_count = 12;
    static constexpr std::array<std::array<std::size_t, 2>, 21> edges{
        {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {1, 4}, {2, 4},  {2, 5},  {0, 5},  {0, 6}, {3, 6},
         {3, 7}, {1, 7}, {1, 8}, {4, 8}, {4, 9}, {2, 9}, {2, 10}, {5, 10}, {5, 11}, {0, 11}}};  ///< see `Element`
    static constexpr std::array<std::array<std::size_t, 12>, 12> orders = [] {
        std::array<std::array<std::size_t, 12>, 12> all{};
        for (std::size_t i = 0; i < 12; ++i) {
            const std::size_t by = i < 6 ? i % 3 : (i - 6) / 2;
            for (std::size_t k = 0; k < 3; ++k) {
                const std::size_t from = (k + by) % 3;
                all[i][k] = from, all[i][3 + k] = 3 + from;
                all[i][6 + 2 * k] = 6 + 2 * from, all[i][7 + 2 * k] = 7 + 2 * from;
            }
        }
        return all;
    }();  ///< see `Element`

    std::array<Vector3<Scalar>, 9> by_height;  ///< of r by the height of each outer corner [(N m)^(1/2) / m]
    Vector3<Scalar> rest;                      ///< r of the rest shape [(N m)^(1/2)]
    Vector3<Scalar> by_tilt;                   ///< of r by the slope towards `tangent`; 0 if no side is clamped
    Vector3<Scalar> tangent;                   ///< held, at right angles to the clamped side [1]

    ///@{
    /// As `Element` requires.
    template <Number N>
    [[nodiscard]] CornerForce<N> force_on(const Corners<N, 12>& x, std::size_t i) const noexcept;
    template <Number N>
    [[nodiscard]] N energy(const Corners<N, 12>& x) const noexcept;
    template <Number N>
    [[nodiscard]] EnergyChange<N> energy_change(const Corners<N, 12>& x, std::size_t i,
                                                const Vector3<N>& displacement) const noexcept;
    [[nodiscard]] Eigen::Matrix3d hessian_block(const Corners<double, 12>& x, std::size_t i,
                                                std::size_t j) const noexcept;
    [[nodiscard]] BendingTriangle in_order(std::size_t i) const noexcept;
    ///@}
};

/// One for each triangle of `mesh`, whose shape is the rest shape. A border bends freely. A border between clamped
/// vertices keeps its tangent in space. A triangle of three clamped vertices does not bend, and the sheet leaves it in
/// its plane: a rigid patch moves the tangent at its rim. A triangle of three held vertices that are not all clamped,
/// as along a pinned rim, would hold the tangent: it is left out, with a border around it; so is one without area.
/// Smooth deflections converge in second order on regular and irregular meshes.
/// @throws InvalidInput for a rigidity that is not finite, or negative, a Poisson ratio out of its range, or a held
/// vertex that is none. O(F log F).
template <Real Scalar>
[[nodiscard]] Elements<Scalar, BendingTriangle<Scalar>> bending_triangles(const TriangleMesh<Scalar>& mesh,
                                                                          const BendingOptions& options);

namespace detail {

/// The plane of a triangle.
template <Number N>
class TrianglePlane {
  public:
    MEMBRANE_INLINE explicit TrianglePlane(const Corners<N, 12>& x) noexcept {
        const Vector3<N> across = cross<N>(x[1] - x[0], x[2] - x[0]);
        const N square = squared_norm(across);
        valid = square > 0;
        per_area_ = select<N>(valid, 1 / root_of<N>(select<N>(valid, square, 1)), 0);
        normal = per_area_ * across;
    }

    /// Gradient of barycentric coordinate `i` [1/m]: its inverse length is the corner's distance from the opposite
    /// side.
    [[nodiscard]] MEMBRANE_INLINE Vector3<N> gradient(const Corners<N, 12>& x, std::size_t i) const noexcept {
        return per_area_ * cross<N>(normal, x[(i + 2) % 3] - x[(i + 1) % 3]);
    }

    Vector3<N> normal;  // zero without an area
    decltype(N() < N()) valid;

  private:
    N per_area_;  // over twice the area
};

/// The sum over the outer corners of their weights times their coordinate along `direction`, from `origin` on.
template <Number N, Number Scalar>
[[nodiscard]] MEMBRANE_INLINE Vector3<N> weighted(const BendingTriangle<Scalar>& element, const Corners<N, 12>& x,
                                                  const Vector3<N>& direction, const Vector3<N>& origin) noexcept {
    Vector3<N> sum = dot<N>(direction, element.tangent.template cast<N>()) * element.by_tilt.template cast<N>();
    for (std::size_t k = 0; k < 9; ++k) {
        sum += dot<N>(direction, x[3 + k] - origin) * element.by_height[k].template cast<N>();
    }
    return sum;
}

template <Number N, Number Scalar>
[[nodiscard]] MEMBRANE_INLINE Vector3<N> bent_by(const BendingTriangle<Scalar>& element, const Corners<N, 12>& x,
                                                 const TrianglePlane<N>& plane) noexcept {
    return weighted<N>(element, x, plane.normal, x[0]) - element.rest.template cast<N>();
}

/// The derivative of r by corner `i` along the normal; other displacements do not change r.
template <Number N, Number Scalar>
[[nodiscard]] MEMBRANE_INLINE Vector3<N> slope_of(const BendingTriangle<Scalar>& element, const Corners<N, 12>& x,
                                                  const Vector3<N>& gradient, std::size_t i) noexcept {
    if (i >= 3) return element.by_height[i - 3].template cast<N>();
    return -weighted<N>(element, x, gradient, x[(i + 1) % 3]);
}

}  // namespace detail

// A corner of the triangle turns the plane about the opposite side, at a distance h. A displacement of length d <= h /
// 4 at a right angle to the side, c of it along the normal, turns by an angle a, |sin a| <= d / h; then 1 - cos a =
// sin^2 a / (1 + cos a) <= 0.51 (d / h)^2, and with the new distance h', |sin a - c / h| =
// |c| |h - h'| / (h h') <= 0.8 (d / h)^2, for |h - h'| is at most the part in the plane and 2/3 c^2 / h. By the turn,
// r + rest becomes (r + rest) cos a + h r' sin a, r' its derivative by c.
template <Number Scalar>
template <Number N>
MEMBRANE_INLINE CornerForce<N> BendingTriangle<Scalar>::force_on(const Corners<N, 12>& x,
                                                                 std::size_t i) const noexcept {
    using std::abs;
    const detail::TrianglePlane<N> plane(x);
    const Vector3<N> bent = detail::bent_by<N>(*this, x, plane);
    const Vector3<N> gradient = i < 3 ? plane.gradient(x, i) : Vector3<N>::Zero();
    const Vector3<N> slope = detail::slope_of<N>(*this, x, gradient, i);
    const N pull = dot(slope, bent), square = squared_norm(slope);
    CornerForce<N> result{-pull * plane.normal, outer<N>(square, plane.normal), {0, 0, 0}};
    if (i >= 3) return result;  // linear
    const Vector3<N> whole = bent + rest.template cast<N>();
    const N curved = squared_norm(gradient);
    result.remainder.second =
        curved * (Each<N>(0.51) * larger<N>(-dot(bent, whole), 0)) + Each<N>(0.8) * root_of<N>(curved) * abs(pull);
    result.remainder.fourth = curved * (Each<N>(0.2601) * curved * squared_norm(whole) +
                                        Each<N>(0.64) * square);  // (a + b)^2 <= 2 (a^2 + b^2)
    const auto weight = static_cast<N>((squared_norm(by_height[0]) + squared_norm(by_height[1])) +
                                       (squared_norm(by_height[2]) + squared_norm(by_tilt)));
    constexpr auto unknown = std::numeric_limits<Each<N>>::infinity();
    result.remainder.per_range = select<N>(plane.valid, 16 * curved, select<N>(weight > 0, unknown, 0));
    return result;
}

template <Number Scalar>
template <Number N>
MEMBRANE_INLINE N BendingTriangle<Scalar>::energy(const Corners<N, 12>& x) const noexcept {
    return squared_norm(detail::bent_by<N>(*this, x, detail::TrianglePlane<N>(x))) / 2;
}

template <Number Scalar>
template <Number N>
MEMBRANE_INLINE EnergyChange<N> BendingTriangle<Scalar>::energy_change(const Corners<N, 12>& x, std::size_t i,
                                                                       const Vector3<N>& displacement) const noexcept {
    auto there = x;
    there[i] += displacement;
    const Vector3<N> before = detail::bent_by<N>(*this, x, detail::TrianglePlane<N>(x));
    const Vector3<N> after = detail::bent_by<N>(*this, there, detail::TrianglePlane<N>(there));
    const Vector3<N> by = after - before, both = after + before;
    N weights = 0, distances = 0;
    for (std::size_t k = 0; k < 9; ++k) {
        weights += static_cast<N>(squared_norm(by_height[k]));
        distances += squared_norm<N>(there[3 + k] - there[0]);
    }
    // By the inequality of Cauchy and Schwarz no less than the sum of all terms.
    const N constants = static_cast<N>(squared_norm(by_tilt) + squared_norm(rest));
    const N terms = root_of<N>(weights * distances) + root_of<N>(2 * constants);
    return {dot(by, both) / 2, root_of<N>(squared_norm(both)) * terms};
}

template <Number Scalar>
Eigen::Matrix3d BendingTriangle<Scalar>::hessian_block(const Corners<double, 12>& x, std::size_t i,
                                                       std::size_t j) const noexcept {
    const detail::TrianglePlane<double> plane(x);
    const auto slope = [&](std::size_t k) {
        const Vector3<double> gradient = k < 3 ? plane.gradient(x, k) : Vector3<double>::Zero();
        return detail::slope_of<double>(*this, x, gradient, k);
    };
    return dot<double>(slope(i), slope(j)) * plane.normal * plane.normal.transpose();
}

template <Number Scalar>
BendingTriangle<Scalar> BendingTriangle<Scalar>::in_order(std::size_t i) const noexcept {
    BendingTriangle ordered = *this;
    for (std::size_t k = 0; k < 9; ++k) ordered.by_height[k] = by_height[orders[i][3 + k] - 3];
    return ordered;
}

namespace detail {

/// Finds the elements of `bending_triangles`.
template <Real Scalar>
class BendingMesh {
  public:
    using Element = BendingTriangle<Scalar>;

    BendingMesh(const TriangleMesh<Scalar>& mesh, const BendingOptions& options)
        : mesh_(mesh),
          options_(options),
          neighbours_(Triangles::Constant(3, mesh.triangle_count(), -1)),
          holds_(static_cast<std::size_t>(mesh.vertex_count()), Hold::none) {
        mark(options.supported, Hold::supported);
        mark(options.clamped, Hold::clamped);
        const auto sides = half_edges(mesh.triangles());
        for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
            if (edge.size() != 2 || !is_part(edge[0].triangle) || !is_part(edge[1].triangle)) return;
            neighbours_(edge[0].side, edge[0].triangle) = edge[1].triangle;
            neighbours_(edge[1].side, edge[1].triangle) = edge[0].triangle;
        });
    }

    /// Whether triangle `f` bends.
    [[nodiscard]] bool bends(Index f) const noexcept { return is_part(f) && !is_held(f); }

    /// The element of triangle `f`.
    [[nodiscard]] ElementInstance<Element> element(Index f) const;

  private:
    enum class Hold : unsigned char { none, supported, clamped };

    void mark(std::span<const Index> vertices, Hold hold) {
        for (const Index v : vertices) {
            if (v < 0 || v >= mesh_.vertex_count()) {
                refuse("bending_triangles", "held vertex ", v, " is none, expected 0 to ", mesh_.vertex_count() - 1);
            }
            holds_[static_cast<std::size_t>(v)] = hold;
        }
    }

    /// How steep the surface is at the middle of a side, by the heights of the vertices around it [1/m].
    struct Slope {
        std::array<Index, 8> vertices{};
        std::array<double, 8> weights{};
        std::size_t count = 0;

        void add(Index v, double weight = 0) noexcept {
            const auto end = vertices.begin() + static_cast<std::ptrdiff_t>(count);
            if (std::find(vertices.begin(), end, v) != end) return;
            vertices[count] = v, weights[count] = weight, ++count;
        }
    };

    [[nodiscard]] Vector3<double> at(Index v) const noexcept {
        return point(mesh_.positions(), v).template cast<double>();
    }
    [[nodiscard]] Index corner(Index f, Index k) const noexcept { return mesh_.triangles()(k % 3, f); }
    [[nodiscard]] bool is_clamped(Index v) const noexcept {
        return holds_[static_cast<std::size_t>(v)] == Hold::clamped;
    }
    [[nodiscard]] bool is_held(Index f) const noexcept {
        return is_clamped(corner(f, 0)) && is_clamped(corner(f, 1)) && is_clamped(corner(f, 2));
    }
    [[nodiscard]] bool is_part(Index f) const noexcept {
        const auto is_free = [&](Index k) { return holds_[static_cast<std::size_t>(corner(f, k))] == Hold::none; };
        return has_area(f) && (is_held(f) || is_free(0) || is_free(1) || is_free(2));
    }
    [[nodiscard]] bool has_area(Index f) const noexcept {
        return squared_norm<double>(
                   cross<double>(at(corner(f, 1)) - at(corner(f, 0)), at(corner(f, 2)) - at(corner(f, 0)))) > 0;
    }
    /// The side of `f` between two vertices.
    [[nodiscard]] Index side_between(Index f, Index a, Index b) const noexcept {
        for (Index k = 0; k < 2; ++k) {
            const Index p = corner(f, k), q = corner(f, k + 1);
            if ((p == a && q == b) || (p == b && q == a)) return k;
        }
        return 2;
    }
    /// The vertex beyond the side of `f` between two vertices, or -1.
    [[nodiscard]] Index beyond(Index f, Index a, Index b) const noexcept {
        const Index g = neighbours_(side_between(f, a, b), f);
        return g < 0 ? g : corner(g, side_between(g, a, b) + 2);
    }
    /// The same without crossing into what is held.
    [[nodiscard]] Index free_beyond(Index f, Index a, Index b) const noexcept {
        const Index g = neighbours_(side_between(f, a, b), f);
        return g < 0 || is_held(g) ? -1 : beyond(f, a, b);
    }

    /// The plane between the two triangles of a side.
    struct SideFrame {
        Vector3<double> middle, out, along;  // a point [m], unit vectors
        double length;                       // of the side [m]
    };

    /// The three sides of a triangle: what their slopes add to r [(N m)^(1/2)], and the outward normals.
    struct Sides {
        Eigen::Matrix3d by_slope;
        std::array<Vector3<double>, 3> out;
    };

    [[nodiscard]] bool is_held_side(Index f, Index k) const noexcept {
        return is_clamped(corner(f, k)) && is_clamped(corner(f, k + 1));
    }

    [[nodiscard]] std::array<Index, 12> corners_of(Index f) const;
    void make_exact(Slope& slope, const SideFrame& side) const;
    [[nodiscard]] Sides sides_of(Index f) const;
    [[nodiscard]] Slope slope_at(Index f, Index side) const;

    const TriangleMesh<Scalar>& mesh_;
    const BendingOptions& options_;
    Triangles neighbours_;     // beyond each side, or -1
    std::vector<Hold> holds_;  // of each vertex
};

template <Real Scalar>
std::array<Index, 12> BendingMesh<Scalar>::corners_of(Index f) const {
    std::array<Index, 12> all;
    all.fill(-1);
    const auto put = [&](Index place, Index v) {
        if (std::find(all.begin(), all.end(), v) == all.end()) all[static_cast<std::size_t>(place)] = v;
    };
    for (Index k = 0; k < 3; ++k) put(k, corner(f, k));
    for (Index k = 0; k < 3; ++k) {
        const Index apex = beyond(f, corner(f, k), corner(f, k + 1));
        if (apex >= 0) put(3 + k, apex);
    }
    for (Index k = 0; k < 3; ++k) {
        const Index a = corner(f, k), b = corner(f, k + 1), g = neighbours_(k, f);
        if (g < 0 || is_held(g)) continue;
        const Index apex = beyond(f, a, b);
        put(6 + 2 * k, free_beyond(g, a, apex));
        put(7 + 2 * k, free_beyond(g, apex, b));
    }
    // Where there is none, a vertex of the triangle that edges join to the same corners.
    for (Index k = 0; k < 3; ++k) {
        for (const auto& [place, v] : {std::pair{3 + k, k + 2}, std::pair{6 + 2 * k, k + 1}, std::pair{7 + 2 * k, k}}) {
            Index& here = all[static_cast<std::size_t>(place)];
            if (here < 0) here = corner(f, v);
        }
    }
    return all;
}

/// Adds to the weights what they miss for heights that are quadratic, by the smallest changes in the sense of least
/// squares; if there are too few vertices, nearly so. Then the weights are in 1/m.
template <Real Scalar>
void BendingMesh<Scalar>::make_exact(Slope& slope, const SideFrame& side) const {
    constexpr double exact = 1e3;  // linear heights first
    Eigen::Matrix<double, 6, Eigen::Dynamic> terms(6, static_cast<Eigen::Index>(slope.count));
    Eigen::Matrix<double, 6, 1> missing{0, exact, 0, 0, 0, 0};
    for (std::size_t i = 0; i < slope.count; ++i) {
        const Vector3<double> by = (at(slope.vertices[i]) - side.middle) / side.length;
        const double x = dot(by, side.out), y = dot(by, side.along);
        const auto column = static_cast<Eigen::Index>(i);
        terms.col(column) << exact, exact * x, exact * y, x * x, x * y, y * y;
        missing -= slope.weights[i] * terms.col(column);
    }
    const Eigen::VectorXd added = terms.completeOrthogonalDecomposition().solve(missing);
    for (std::size_t i = 0; i < slope.count; ++i) {
        slope.weights[i] = (slope.weights[i] + added[static_cast<Eigen::Index>(i)]) / side.length;
    }
}

/// The mean slope of the two triangles, each by the other's extent, and what their neighbours add to make it exact.
template <Real Scalar>
auto BendingMesh<Scalar>::slope_at(Index f, Index side) const -> Slope {
    const Index a = corner(f, side), b = corner(f, side + 1), c = corner(f, side + 2), g = neighbours_(side, f);
    const Index d = beyond(f, a, b);
    const Vector3<double> middle = (at(a) + at(b)) / 2.0;
    const double length = norm<double>(at(b) - at(a));
    const Vector3<double> along = (at(b) - at(a)) / length;
    const auto away = [&](Index v) -> Vector3<double> {  // from the side
        const Vector3<double> by = at(v) - middle;
        return by - dot<double>(by, along) * along;
    };
    const double behind = norm<double>(away(c)), ahead = norm<double>(away(d));
    Slope slope;
    if (is_held(g)) {
        slope.add(d, 1 / ahead);
        return slope;
    }
    const Vector3<double> through = away(d) / ahead - away(c) / behind;
    if (!(squared_norm(through) > 0)) return slope;  // folded together
    const Vector3<double> out = through / norm(through);
    const double x_c = dot<double>(at(c) - middle, out) / length, x_d = dot<double>(at(d) - middle, out) / length;
    const double y_c = dot<double>(at(c) - middle, along) / length, y_d = dot<double>(at(d) - middle, along) / length;
    const double by_c = x_d / (x_c * (x_d - x_c)), by_d = -x_c / (x_d * (x_d - x_c));
    slope.add(a, -by_c * (0.5 - y_c) - by_d * (0.5 - y_d));
    slope.add(b, -by_c * (0.5 + y_c) - by_d * (0.5 + y_d));
    slope.add(c, by_c), slope.add(d, by_d);
    for (const auto& [triangle, apex] : {std::pair{f, c}, std::pair{g, d}}) {
        for (const Index end : {a, b}) {
            const Index v = free_beyond(triangle, apex, end);
            if (v >= 0) slope.add(v);
        }
    }
    make_exact(slope, {middle, out, along, length});
    return slope;
}

template <Real Scalar>
auto BendingMesh<Scalar>::sides_of(Index f) const -> Sides {
    const Vector3<double> first = at(corner(f, 1)) - at(corner(f, 0)), second = at(corner(f, 2)) - at(corner(f, 0));
    const Vector3<double> u = first / norm(first), normal = cross(first, second) / norm(cross(first, second));
    const Vector3<double> v = cross(normal, u);
    const double nu = options_.poisson_ratio, area = norm(cross(first, second)) / 2;
    // |r|^2 / 2 is the energy of the curvature (k_uu, k_vv, 2 k_uv) = sum of l / A s (m_u^2, m_v^2, 2 m_u m_v).
    Eigen::Matrix3d by_curvature;
    by_curvature << 1, nu, 0, 0, std::sqrt(1 - nu * nu), 0, 0, 0, std::sqrt((1 - nu) / 2);
    Sides sides;
    auto& [by_slope, out] = sides;
    for (Index k = 0; k < 3; ++k) {
        const Vector3<double> side = at(corner(f, k + 1)) - at(corner(f, k));
        const Vector3<double> m = cross<double>(side, normal) / norm(side);
        out[static_cast<std::size_t>(k)] = m;
        const double x = dot(m, u), y = dot(m, v);
        by_slope.col(k) =
            std::sqrt(options_.rigidity / area) * norm(side) * by_curvature * Eigen::Vector3d(x * x, y * y, 2 * x * y);
    }
    // The slope at a border that bends freely is the one of least energy.
    for (Index k = 0; k < 3; ++k) {
        if (neighbours_(k, f) >= 0 || is_held_side(f, k)) continue;
        const double square = by_slope.col(k).squaredNorm();
        if (!(square > 1e-20 * options_.rigidity)) continue;  // two such sides already
        const Eigen::Vector3d free = by_slope.col(k);
        by_slope -= free * (free.transpose() * by_slope) / square;
    }
    return sides;
}

template <Real Scalar>
auto BendingMesh<Scalar>::element(Index f) const -> ElementInstance<Element> {
    const std::array<Index, 12> corners = corners_of(f);
    const auto [by_slope, out] = sides_of(f);
    BendingTriangle<double> element{{}, Vector3<double>::Zero(), Vector3<double>::Zero(), Vector3<double>::Zero()};
    element.by_height.fill(Vector3<double>::Zero());
    for (Index k = 0; k < 3; ++k) {
        if (neighbours_(k, f) < 0) {
            if (!is_held_side(f, k)) continue;
            element.by_tilt = by_slope.col(k);
            element.tangent = out[static_cast<std::size_t>(k)];
            continue;
        }
        const Slope slope = slope_at(f, k);
        for (std::size_t i = 0; i < slope.count; ++i) {
            const auto place = std::find(corners.begin(), corners.end(), slope.vertices[i]) - corners.begin();
            if (place < 3 || place >= 12) continue;  // the triangle's own have no height
            element.by_height[static_cast<std::size_t>(place) - 3] += slope.weights[i] * by_slope.col(k);
        }
    }
    Corners<double, 12> x;
    for (std::size_t i = 0; i < 12; ++i) x[i] = at(corners[i]);
    element.rest = bent_by<double>(element, x, TrianglePlane<double>(x));
    ElementInstance<Element> rounded{corners,
                                     {{},
                                      element.rest.template cast<Scalar>(),
                                      element.by_tilt.template cast<Scalar>(),
                                      element.tangent.template cast<Scalar>()}};
    for (std::size_t k = 0; k < 9; ++k) rounded.element.by_height[k] = element.by_height[k].template cast<Scalar>();
    return rounded;
}

}  // namespace detail

template <Real Scalar>
Elements<Scalar, BendingTriangle<Scalar>> bending_triangles(const TriangleMesh<Scalar>& mesh,
                                                            const BendingOptions& options) {
    detail::check_option("bending_triangles", options.rigidity, "rigidity", "N m");
    if (!(options.poisson_ratio >= 0 && options.poisson_ratio <= 0.5)) {
        refuse("bending_triangles", "poisson_ratio must be 0 to 0.5, got ", options.poisson_ratio);
    }
    const detail::BendingMesh<Scalar> bending(mesh, options);
    using All = Elements<Scalar, BendingTriangle<Scalar>>;
    std::vector<typename All::Instance> all;
    for (Index f = 0; f < mesh.triangle_count() && options.rigidity > 0; ++f) {
        if (bending.bends(f)) all.push_back(bending.element(f));
    }
    return All(mesh, std::move(all));
}

}  // namespace membrane
