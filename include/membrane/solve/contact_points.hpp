// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include <membrane/collision/contact.hpp>
#include <membrane/collision/tool.hpp>
#include <membrane/mesh/triangle.hpp>
#include <membrane/solve/contact_pack.hpp>
#include <membrane/solve/step_state.hpp>

/// Contact points against a tool, several at a time: where they are now, how deep the tool is in, and the force that keeps
/// it out.
///
///     membrane::push_out(state, tool, packs);                      // the surface yields before any force is known
///     membrane::solve_contacts(state, tool, packs);                // projected Gauss-Seidel, one pass
///     membrane::apply_forces(state, packs);
namespace membrane {

/// The tool as contact points see it.
template <Real Scalar>
struct ContactTool {
    Vector3<Scalar> position, axis;
    Vector3<Scalar> axis_point;  ///< nearest to the contact [m]
    Scalar radius;               ///< [m]
};

/// What one pass over contact points has changed.
template <Real Scalar>
struct ContactPass {
    Scalar largest = 0;     ///< change of a force [N]
    bool released = false;  ///< whether a point was let go that pressed harder than what resists it
};

/// One pass: brings each point up to date with the positions, and moves the free corners of one that is inside the tool until
/// it is outside. Returns whether any had to move. Online. Cost: linear in the points.
template <Real Scalar>
bool push_out(StepState<Scalar>& state, const ContactTool<Scalar>& tool, std::span<ContactPack<Scalar>> packs) noexcept;

/// One pass of projected Gauss-Seidel: brings each point up to date with the positions, changes its force by what closes
/// the gap at the compliance of its corners, never below zero, and moves them along. Online. Cost: linear in the points.
template <Real Scalar>
ContactPass<Scalar> solve_contacts(StepState<Scalar>& state, const ContactTool<Scalar>& tool,
                                   std::span<ContactPack<Scalar>> packs) noexcept;

/// Lets the vertices feel the forces that these passes have found.
template <Real Scalar>
void apply_forces(StepState<Scalar>& state, std::span<ContactPack<Scalar>> packs) noexcept;

/// The points nearest to `q` of as many triangles as there are lanes; of fewer, the last one again.
template <Real Scalar>
[[nodiscard]] TrianglePoint<Lanes<Scalar>> closest_points(const StepState<Scalar>& state,
                                                          std::span<const TouchedTriangle> triangles,
                                                          const Vector3<Scalar>& q) noexcept;

/// Brings weights, normal and force of the contact points up to date with their packs. Online. Cost: linear in the points.
template <Real Scalar>
void unpack(std::span<const ContactPack<Scalar>> packs, std::span<ContactPoint<Scalar>> points) noexcept;

/// How far one of these vertices has moved from its `anchor` at most, squared [m^2]. @pre they are kept
template <Real Scalar>
[[nodiscard]] Scalar largest_squared_move(const StepState<Scalar>& state, std::span<const Index> vertices) noexcept;

namespace detail {

/// A point of an edge and the point of a segment nearest to it.
template <Number N>
struct EdgePoint {
    N along;  // the segment, 0 to 1
    N foot;   // along the edge, 0 to 1
};

/// The nearest points of two lines, each then clamped to its segment in turn [Ericson05] 5.1.9.
template <Number N>
[[nodiscard]] EdgePoint<N> nearest_on_edge(const Vector3<N>& start, const Vector3<N>& edge, const Vector3<N>& p,
                                           const Vector3<N>& segment) noexcept {
    const Vector3<N> offset = start - p, common = cross(segment, edge);
    N along = fraction<N>(dot(cross(offset, edge), common), squared_norm(common));
    const N foot = fraction<N>(dot<N>(along * segment - offset, edge), squared_norm(edge));
    along = fraction<N>(dot<N>(offset + foot * edge, segment), squared_norm(segment));
    return {along, foot};
}

template <Real Scalar>
[[nodiscard]] Vector3<Lanes<Scalar>> broadcast(const Vector3<Scalar>& a) noexcept {
    return {a.x(), a.y(), a.z()};
}

/// A face that rocks under a tool moves the contact point along itself, and with it the force from corner to corner: for
/// each corner the stiffness [N/m] that this amounts to. `moment` is the force times the distance from the face to the
/// tool's axis [N m].
template <Number N>
[[nodiscard]] Vector3<N> rocking_stiffness(const Triangle<N>& triangle, const Vector3<N>& weights,
                                           const N& moment) noexcept {
    const Vector3<N> ab = triangle.b - triangle.a, ac = triangle.c - triangle.a, bc = triangle.c - triangle.b;
    const Vector3<N> squares(squared_norm(bc), squared_norm(ac), squared_norm(ab));  // of the side across from each
    const auto missing = [&](Eigen::Index k) { return !(weights[k] > 0); };
    const auto in_face = !(missing(0) | missing(1) | missing(2));
    const auto at_corner = larger(larger(weights[0], weights[1]), weights[2]) >= 1;
    const N edge_square = select<N>(missing(0), squares[0], select<N>(missing(1), squares[1], squares[2]));
    const N divisor = select<N>(in_face, squared_norm(cross(ab, ac)), edge_square);
    const auto counts = (divisor > 0) & !(at_corner & !in_face);
    const N part = select<N>(counts, moment / select<N>(counts, divisor, 1), 0);
    Vector3<N> stiffness;
    for (Eigen::Index k = 0; k < 3; ++k) {
        const N of_corner = select<N>(in_face, part * squares[k], select<N>(missing(k), 0, part));
        stiffness[k] = select<N>(of_corner < std::numeric_limits<Each<N>>::infinity(), of_corner, 0);
    }
    return stiffness;
}

/// The normal of a pack along `along`, as far as there is a point: the tool stays on the side of the triangle, or of the edge
/// or corner it is nearest to, where it was found. `separation` is from the points to the tool's axis [m].
template <Real Scalar>
[[gnu::always_inline]] inline void set_normal(const typename Lanes<Scalar>::Mask& found,
                                              const Vector3<Lanes<Scalar>>& along,
                                              const Vector3<Lanes<Scalar>>& separation,
                                              ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    const Scalar too_far = std::sqrt((std::numeric_limits<Scalar>::max)()) / 16;  // there squares overflow
    const Wide length = norm(along);
    const auto exists = found & (length < too_far) & (squared_norm(separation) < too_far);
    pack.used = select<Wide>(exists, 1, 0);
    pack.force = select<Wide>(exists, pack.force, 0);
    const auto has_length = exists & (length > 0);
    const Wide divisor = select<Wide>(has_length, length, 1);
    Vector3<Wide> away;
    for (Eigen::Index k = 0; k < 3; ++k) {
        away[k] = select<Wide>(has_length, select<Wide>(has_length, along[k], 0) / divisor, pack.normal[k]);
    }
    pack.normal = select<Wide>(dot(away, pack.normal) < 0, -1, 1) * away;
}

/// Brings weights, normal, axis point and stiffness of a pack up to date with the positions, its forces unchanged but for
/// points that are no more.
template <Real Scalar>
[[gnu::always_inline]] inline void locate(const ContactTool<Scalar>& tool,
                                          const std::array<PaddedLanes<Scalar>, 3>& corner,
                                          ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    const Triangle<Wide> triangle{corner[0].point, corner[1].point, corner[2].point};
    if (pack.kind == ContactKind::fixed) {
        pack.axis_point = broadcast(tool.axis_point);
        return;
    }
    Vector3<Wide> separation, along;
    auto exists = pack.listed > 0;
    if (pack.kind != ContactKind::edge) {
        pack.axis_point = broadcast(tool.position) + pack.end * broadcast(tool.axis);
        const auto nearest = closest_point_inline<true>(triangle, pack.axis_point);
        pack.weights = nearest.barycentric;
        separation = pack.axis_point - nearest.point;
        along = area_vector(triangle);
        if (pack.kind == ContactKind::end) {
            const auto in_face = (pack.weights[0] > 0) & (pack.weights[1] > 0) & (pack.weights[2] > 0);
            const auto known = in_face & (pack.side != Wide(0));
            for (Eigen::Index k = 0; k < 3; ++k) {
                if (pack.has_sides) pack.normal[k] = select<Wide>(known, pack.side * along[k], pack.normal[k]);
                along[k] = select<Wide>(in_face, along[k], separation[k]);
            }
        }
    } else {
        const Vector3<Wide> start = broadcast(tool.position), axis = broadcast(tool.axis);
        const Vector3<Wide> edge = triangle.b - triangle.a;
        const auto nearest = nearest_on_edge(triangle.a, edge, start, axis);
        exists = exists & (nearest.along > 0) & (nearest.along < 1);
        pack.axis_point = start + nearest.along * axis;
        pack.weights = Vector3<Wide>(1 - nearest.foot, nearest.foot, 0);
        separation = along = pack.axis_point - point_at(triangle, pack.weights);
    }
    set_normal(exists, along, separation, pack);
    if (any(pack.force > 0)) {
        pack.stiffness = rocking_stiffness<Wide>(triangle, pack.weights, pack.force * norm(separation));
    } else {
        pack.stiffness = Vector3<Wide>(0, 0, 0);
    }
}

/// Adds to the rows of forces what a pack acts with now, less what they have of it.
template <Real Scalar>
[[gnu::always_inline]] inline void add_forces(StepState<Scalar>& state, ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    for (std::size_t k = 0; k < 3; ++k) {
        const auto i = static_cast<Eigen::Index>(k);
        auto row = gather_padded(state.force.data(), pack.corner[k].data());
        const Wide now = pack.force * pack.weights[i], before = pack.added_force * pack.added_weights[i];
        const Vector3<Wide> change = before * pack.added_normal - now * pack.normal;
        row.point += change;
        row.extra += pack.stiffness[i] - pack.added_stiffness[i];
        scatter_padded(row, state.force.data(), pack.corner[k].data());
        if (!pack.on_fixed) continue;
        auto support = gather_padded(state.support.data(), pack.corner[k].data());
        support.point += (1 - pack.free[i]) * change;
        scatter_padded(support, state.support.data(), pack.corner[k].data());
    }
    pack.added_weights = pack.weights;
    pack.added_normal = pack.normal;
    pack.added_force = pack.force;
    pack.added_stiffness = pack.stiffness;
}

/// By how much fixed corners yield to the tool.
template <Real Scalar>
struct SupportOfPack {
    Lanes<Scalar> compliance = 0;            // of all points [m/N]
    Lanes<Scalar> displacement = 0;          // along the normal [m]
    Lanes<Scalar> force = 0, stiffness = 0;  // sums over fixed corners [N], [N/m]
};

template <Real Scalar>
[[nodiscard]] SupportOfPack<Scalar> support_of(const StepState<Scalar>& state,
                                               const ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    SupportOfPack<Scalar> sum;
    if (!pack.on_fixed) return sum;
    for (std::size_t k = 0; k < 3; ++k) {
        const auto i = static_cast<Eigen::Index>(k);
        const auto support = gather_padded(state.support.data(), pack.corner[k].data());
        const auto yields = (support.extra > 0) & (pack.free[i] < 1);
        const Wide compliance = select<Wide>(yields, 1 / select<Wide>(yields, support.extra, 1), 0);
        sum.compliance += pack.weights[i] * pack.weights[i] * compliance;
        sum.displacement += pack.weights[i] * (compliance * dot(support.point, pack.normal));
        sum.force += (1 - pack.free[i]) * norm(support.point);
        sum.stiffness += (1 - pack.free[i]) * support.extra;
    }
    return sum;
}

/// How far the tool is from the points of a pack, along their normals; where fixed corners yield, from there [m].
template <Real Scalar>
[[gnu::always_inline, nodiscard]] inline Lanes<Scalar> gap_of(const ContactTool<Scalar>& tool,
                                                              const std::array<PaddedLanes<Scalar>, 3>& corner,
                                                              const ContactPack<Scalar>& pack,
                                                              const SupportOfPack<Scalar>& support) noexcept {
    const Triangle<Lanes<Scalar>> triangle{corner[0].point, corner[1].point, corner[2].point};
    const Vector3<Lanes<Scalar>> separation = pack.axis_point - point_at(triangle, pack.weights);
    return dot(separation, pack.normal) - support.displacement - tool.radius;
}

/// A gap that is not worth closing: what a negligible force makes of it, or a few roundings [m].
template <Real Scalar>
[[gnu::always_inline, nodiscard]] inline Lanes<Scalar> gap_tolerance(const StepState<Scalar>& state,
                                                                     const std::array<PaddedLanes<Scalar>, 3>& corner,
                                                                     const ContactPack<Scalar>& pack,
                                                                     const SupportOfPack<Scalar>& support) noexcept {
    using Wide = Lanes<Scalar>;
    Wide sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        const Wide& weight = pack.weights[static_cast<Eigen::Index>(k)];
        sum += weight * weight * corner[k].extra;
    }
    const Wide rounding = 16 * std::numeric_limits<Scalar>::epsilon() * largest_magnitude<Wide>(corner[0].point);
    const Wide tolerance = state.force_tolerance;
    return larger<Wide>(tolerance * sum, rounding) + tolerance * support.compliance;
}

template <Real Scalar>
[[gnu::always_inline, nodiscard]] inline std::array<PaddedLanes<Scalar>, 3> corners_of(
    const StepState<Scalar>& state, const ContactPack<Scalar>& pack) noexcept {
    return {gather_padded(state.position.data(), pack.corner[0].data()),
            gather_padded(state.position.data(), pack.corner[1].data()),
            gather_padded(state.position.data(), pack.corner[2].data())};
}

/// How the corners of a pack respond to a newton along the normal, and what resists at them.
template <Real Scalar>
struct PackResponse {
    std::array<Vector3<Lanes<Scalar>>, 3> of_corner;   // to its share [m/N]
    Lanes<Scalar> compliance;                          // of the points [m/N]
    Lanes<Scalar> internal_force, internal_stiffness;  // sums over the corners [N], [N/m]
};

template <Real Scalar>
[[gnu::always_inline, nodiscard]] inline PackResponse<Scalar> response_of(const StepState<Scalar>& state,
                                                                          const SupportOfPack<Scalar>& support,
                                                                          const ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    PackResponse<Scalar> response{{}, support.compliance, support.force, support.stiffness};
    for (std::size_t k = 0; k < 3; ++k) {
        std::array<Index, Wide::count> begins;
        for (std::size_t i = 0; i < Wide::count; ++i) begins[i] = 2 * pack.corner[k][i];
        const auto a = gather_padded(state.response.data(), begins.data());
        const auto b = gather_padded(state.response.data() + 1, begins.data());
        const Symmetric3<Wide> block{a.point[0], a.point[1], a.point[2], a.extra, b.point[0], b.point[1]};
        const Wide& weight = pack.weights[static_cast<Eigen::Index>(k)];
        response.of_corner[k] = weight * (block * pack.normal);
        response.compliance += weight * dot(response.of_corner[k], pack.normal);
        response.internal_force += b.point[2];
        response.internal_stiffness += b.extra;
    }
    return response;
}

/// Changes the force of each point that acts by what closes its gap, never below zero, and moves the corners along. Returns
/// the change.
template <Real Scalar>
[[gnu::always_inline]] inline Lanes<Scalar> solve(StepState<Scalar>& state, const typename Lanes<Scalar>::Mask& acts,
                                                  const Lanes<Scalar>& gap, const Lanes<Scalar>& tolerance,
                                                  const PackResponse<Scalar>& response,
                                                  std::array<PaddedLanes<Scalar>, 3>& corner, ContactPack<Scalar>& pack,
                                                  ContactPass<Scalar>& pass) noexcept {
    using Wide = Lanes<Scalar>;
    const auto moves = acts & (response.compliance > 0);
    const Wide divisor = select<Wide>(moves, response.compliance, 1);
    Wide change = larger<Wide>(-gap / divisor, -pack.force);
    // In balance the force is what springs and foundation at the corners resist with, or will once the gap is closed.
    // Points that press much harder, where a tool has jumped to the wrong side of some, press against one another.
    const Wide limit = 8 * (response.internal_force + abs(gap) * response.internal_stiffness);
    const auto too_hard = moves & (pack.force + change > limit);
    change = select<Wide>(too_hard, -pack.force, change);
    pass.released = pass.released || any(too_hard);
    const auto counts = moves & (abs(change) * response.compliance > tolerance);
    if (!any(counts)) return 0;
    change = select<Wide>(counts, change, 0);
    pack.force += change;
    for (std::size_t k = 0; k < 3; ++k) {
        corner[k].point -= change * response.of_corner[k];
        scatter_padded(corner[k], state.position.data(), pack.corner[k].data());
    }
    return abs(change);
}

template <Real Scalar>
[[nodiscard]] Scalar largest_of(const Lanes<Scalar>& numbers) noexcept {
    Scalar largest = numbers[0];
    for (std::size_t i = 1; i < Lanes<Scalar>::count; ++i) largest = (std::max)(largest, numbers[i]);
    return largest;
}

}  // namespace detail

template <Real Scalar>
[[gnu::flatten]] bool push_out(StepState<Scalar>& state, const ContactTool<Scalar>& tool,
                               std::span<ContactPack<Scalar>> packs) noexcept {
    using Wide = Lanes<Scalar>;
    bool moved = false;
    for (auto& pack : packs) {
        auto corner = detail::corners_of(state, pack);
        detail::locate(tool, corner, pack);
        detail::add_forces(state, pack);
        const auto support = detail::support_of(state, pack);
        const Wide gap = detail::gap_of(tool, corner, pack, support);
        const auto inside = (pack.used > 0) & (-gap > detail::gap_tolerance(state, corner, pack, support));
        if (!any(inside)) continue;
        moved = true;
        const Wide part = select<Wide>(inside, gap / squared_norm(pack.weights), 0);
        for (std::size_t k = 0; k < 3; ++k) {
            const auto i = static_cast<Eigen::Index>(k);
            corner[k].point += (part * pack.weights[i] * pack.free[i]) * pack.normal;
            scatter_padded(corner[k], state.position.data(), pack.corner[k].data());
        }
    }
    return moved;
}

template <Real Scalar>
[[gnu::flatten]] ContactPass<Scalar> solve_contacts(StepState<Scalar>& state, const ContactTool<Scalar>& tool,
                                                    std::span<ContactPack<Scalar>> packs) noexcept {
    using Wide = Lanes<Scalar>;
    ContactPass<Scalar> pass;
    Wide largest = 0;
    for (auto& pack : packs) {
        auto corner = detail::corners_of(state, pack);
        detail::locate(tool, corner, pack);
        if (pack.on_fixed) detail::add_forces(state, pack);  // fixed corners yield by the forces up to here
        const auto support = detail::support_of(state, pack);
        const Wide gap = detail::gap_of(tool, corner, pack, support);
        const auto acts = (pack.used > 0) & ((pack.force > 0) | (gap < 0));
        if (!any(acts)) continue;
        const auto response = detail::response_of(state, support, pack);
        const Wide tolerance = detail::gap_tolerance(state, corner, pack, support);
        largest = larger<Wide>(largest, detail::solve(state, acts, gap, tolerance, response, corner, pack, pass));
        if (pack.on_fixed) detail::add_forces(state, pack);
    }
    pass.largest = detail::largest_of(largest);
    return pass;
}

template <Real Scalar>
[[gnu::flatten]] void apply_forces(StepState<Scalar>& state, std::span<ContactPack<Scalar>> packs) noexcept {
    for (auto& pack : packs) {
        if (any((pack.force > 0) | (pack.added_force > 0))) detail::add_forces(state, pack);
    }
}

template <Real Scalar>
[[gnu::flatten]] TrianglePoint<Lanes<Scalar>> closest_points(const StepState<Scalar>& state,
                                                             std::span<const TouchedTriangle> triangles,
                                                             const Vector3<Scalar>& q) noexcept {
    std::array<std::array<Index, Lanes<Scalar>::count>, 3> begins;
    for (std::size_t i = 0; i < Lanes<Scalar>::count; ++i) {
        const auto& corners = triangles[(std::min)(i, triangles.size() - 1)].corners;
        for (std::size_t k = 0; k < 3; ++k) begins[k][i] = numbers_in_point * corners[k];
    }
    const auto* rows = state.position.data();
    return closest_point<Lanes<Scalar>>(
        {gather(rows, begins[0].data()), gather(rows, begins[1].data()), gather(rows, begins[2].data())},
        detail::broadcast(q));
}

template <Real Scalar>
void unpack(std::span<const ContactPack<Scalar>> packs, std::span<ContactPoint<Scalar>> points) noexcept {
    for (const auto& pack : packs) {
        for (std::size_t i = 0; i < pack.size; ++i) {
            auto& point = points[static_cast<std::size_t>(pack.point[i])];
            for (std::size_t k = 0; k < 3; ++k) {
                const auto row = static_cast<Eigen::Index>(k);
                point.weights[static_cast<Eigen::Index>((k + pack.turn[i]) % 3)] = pack.weights[row][i];
                point.normal[row] = pack.normal[row][i];
            }
            point.force = -pack.force[i] * point.normal;
        }
    }
}

template <Real Scalar>
Scalar largest_squared_move(const StepState<Scalar>& state, std::span<const Index> vertices) noexcept {
    using Wide = Lanes<Scalar>;
    Wide largest = 0;
    std::array<Index, Wide::count> begins;
    for (std::size_t first = 0; first < vertices.size(); first += Wide::count) {
        for (std::size_t i = 0; i < Wide::count; ++i) {
            begins[i] = numbers_in_point * vertices[(std::min)(first + i, vertices.size() - 1)];
        }
        const Vector3<Wide> by =
            gather(state.position.data(), begins.data()) - gather(state.anchor.data(), begins.data());
        largest = larger<Wide>(largest, squared_norm(by));
    }
    return detail::largest_of(largest);
}

}  // namespace membrane
