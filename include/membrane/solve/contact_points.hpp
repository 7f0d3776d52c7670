// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <type_traits>

#include <membrane/contact/contact.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/solve/contact_state.hpp>
#include <membrane/solve/vertex_rows.hpp>
#include <membrane/surface/triangle.hpp>

/// Contact points against a tool, several at a time: their positions, penetrations and contact forces.
///
///     membrane::push_out(rows, contacts, tool, packs);             // moves the surface out of the tool
///     membrane::solve_contacts(rows, contacts, tool, packs);       // projected Gauss-Seidel, one pass
///     membrane::apply_forces(rows, contacts, packs);
namespace membrane {

/// The tool in contact.
template <Real Scalar>
struct ToolShape {
    ///@{
    /// End of the tool's axis, and the vector to its other end [m].
    Vector3<Scalar> position, axis;
    ///@}

    Vector3<Scalar> axis_point;  ///< nearest to the contact [m]
    Scalar radius;               ///< [m]
};

/// Result of one pass over contact points.
template <Real Scalar>
struct ContactPass {
    Scalar largest = 0;     ///< largest change of a force [N]
    bool released = false;  ///< whether a point was released whose force far exceeded the internal force
    bool deep = false;      ///< whether a penetration was more than `deep_overlap` of an edge
};

/// The penetration allowed at the end of a tick, relative to the first edge of a triangle [1].
inline constexpr double deep_overlap = 0.005;

/// One pass: locates each point at the current positions, and moves the free corners of a penetrating point until it is
/// outside the tool. Returns whether a point moved. Online. Cost: linear in the points.
template <Real Scalar>
bool push_out(VertexRows<Scalar>& rows, ContactState<Scalar>& contacts, const ToolShape<Scalar>& tool,
              std::span<ContactPack<Scalar>> packs) noexcept;

/// One pass of projected Gauss-Seidel: locates each point at the current positions, changes its force by the gap over
/// the compliance of its corners, never below zero, and moves the corners by their response. If `again`, without vertex
/// updates since the last pass, skips packs whose points neither pressed nor penetrated. Online. Cost: linear in the
/// points.
template <Real Scalar>
ContactPass<Scalar> solve_contacts(VertexRows<Scalar>& rows, ContactState<Scalar>& contacts,
                                   const ToolShape<Scalar>& tool, std::span<ContactPack<Scalar>> packs,
                                   bool again = false) noexcept;

/// Adds the changes of the forces and of their stiffness since the last call to the rows of the vertices.
template <Real Scalar>
void apply_forces(VertexRows<Scalar>& rows, ContactState<Scalar>& contacts,
                  std::span<ContactPack<Scalar>> packs) noexcept;

/// The largest squared distance of a candidate from its kept position [m^2].
template <Real Scalar>
[[nodiscard]] Scalar largest_squared_move(const VertexRows<Scalar>& rows,
                                          const ContactState<Scalar>& contacts) noexcept;

namespace detail {

/// Calls `act` with the number of each of the corners, 1 or 3. Unrolled by hand: compilers do not unroll a long loop,
/// and keep its data in memory.
template <std::size_t corners, class Act>
MEMBRANE_INLINE void each_corner(const Act& act) noexcept {
    act(std::integral_constant<std::size_t, 0>());
    if constexpr (corners == 3) {
        act(std::integral_constant<std::size_t, 1>());
        act(std::integral_constant<std::size_t, 2>());
    }
}

/// The stiffness [N/m] of each corner by rocking: a triangle that rocks under a tool moves the contact point along
/// itself, and so shifts the force between the corners. `moment` is the force times the distance from the triangle to
/// the tool's axis [N m].
template <Number N>
[[nodiscard]] Vector3<N> rocking_stiffness(const Triangle<N>& triangle, const Vector3<N>& weights,
                                           const N& moment) noexcept {
    const Vector3<N> ab = triangle.b - triangle.a, ac = triangle.c - triangle.a, bc = triangle.c - triangle.b;
    const Vector3<N> squares(squared_norm(bc), squared_norm(ac),
                             squared_norm(ab));  // of the edge opposite of each corner
    const auto missing = [&](Eigen::Index k) { return !(weights[k] > 0); };
    const auto in_face = smaller(smaller(weights[0], weights[1]), weights[2]) > 0;
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

/// The normal with the sign that keeps the tool on its last side.
template <Real Scalar>
[[nodiscard]] MEMBRANE_INLINE Vector3<Lanes<Scalar>> on_same_side(const Vector3<Lanes<Scalar>>& normal,
                                                                  const ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    return select<Wide>(dot(normal, pack.load.normal) < 0, -1, 1) * normal;
}

/// Sets the normal of a pack along `along` in lanes where the point is `found`: the tool stays on its last side of the
/// triangle, or of the nearest edge or corner. `separation` is from the points to the tool's axis [m].
template <Real Scalar>
MEMBRANE_INLINE void set_normal(const typename Lanes<Scalar>::Mask& found, const Vector3<Lanes<Scalar>>& along,
                                const Vector3<Lanes<Scalar>>& separation, ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    const Wide length = norm(along);
    const auto exists = found & (length < too_large<Scalar>)&(squared_norm(separation) < too_large<Scalar>);
    pack.used = select<Wide>(exists, 1, 0);
    pack.load.force = select<Wide>(exists, pack.load.force, 0);
    const auto has_length = exists & (length > 0);
    const Wide per_length = 1 / select<Wide>(has_length, length, 1);
    Vector3<Wide> away;
    for (Eigen::Index k = 0; k < 3; ++k) away[k] = select<Wide>(has_length, per_length * along[k], pack.load.normal[k]);
    const Vector3<Wide> normal = on_same_side(away, pack);
    pack.load.normal = normal;
    pack.distance = select<Wide>(exists, dot(separation, normal), 0);
}

/// Inside of a triangle the tool is on the known side; elsewhere it stays on its last side.
template <Real Scalar>
MEMBRANE_INLINE void use_known_side(const typename Lanes<Scalar>::Mask& in_face, const Vector3<Lanes<Scalar>>& area,
                                    ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    if (!pack.has_sides) return;
    const auto known = in_face & (pack.side != Wide(0));
    Vector3<Wide>& normal = pack.load.normal;
    for (Eigen::Index k = 0; k < 3; ++k) normal[k] = select<Wide>(known, pack.side * area[k], normal[k]);
}

/// `locate` for the usual case that all points lie inside their triangles: one root and one division. If a point does
/// not, returns false and changes nothing.
template <Real Scalar>
MEMBRANE_INLINE bool locate_in_faces(const Triangle<Lanes<Scalar>>& triangle, const Vector3<Lanes<Scalar>>& axis_point,
                                     ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    using Limits = std::numeric_limits<Scalar>;
    const Vector3<Wide> ab = triangle.b - triangle.a, ac = triangle.c - triangle.a, aq = axis_point - triangle.a;
    const Vector3<Wide> area = cross(ab, ac);
    const Wide whole = squared_norm(area), listed = pack.listed;
    const Wide weight_b = dot(area, cross(aq, ac)), weight_c = dot(area, cross(ab, aq));
    const auto has_area = (whole > Limits::epsilon() * (squared_norm(ab) * squared_norm(ac))) &
                          (whole > 16 * (Limits::min)()) & (larger<Wide>(whole, squared_norm(aq)) < too_large<Scalar>);
    const Wide least = smaller<Wide>(smaller(weight_b, weight_c), whole - weight_b - weight_c);
    const auto in_face = has_area & (least > 0);
    if (any((listed > 0) & !in_face)) return false;
    const Wide per_length = 1 / root_of<Wide>(select<Wide>(in_face, whole, 1)), part = per_length * per_length;
    const Wide b = part * weight_b, c = part * weight_c;
    Vector3<Wide> normal = per_length * area;
    use_known_side(in_face, normal, pack);
    normal = on_same_side(normal, pack);
    pack.load.weights = {larger<Wide>(0, 1 - b - c), b, c};
    pack.load.normal = normal;
    pack.distance = dot(aq, normal);
    pack.used = listed;
    return true;
}

///@{
/// Updates weights, normal and distance of a pack to the current positions. Its forces stay, but for points that no
/// longer exist.
template <Real Scalar>
MEMBRANE_INLINE void locate(const ToolShape<Scalar>& tool, const std::array<PaddedLanes<Scalar>, 1>& vertex,
                            ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    const auto separation =
        to_segment<Wide>(vertex[0].point, tool.position.template cast<Wide>(), tool.axis.template cast<Wide>());
    set_normal(pack.listed > 0, separation, separation, pack);
}

template <Real Scalar>
MEMBRANE_INLINE void locate(const ToolShape<Scalar>& tool, const std::array<PaddedLanes<Scalar>, 3>& corner,
                            ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    const Triangle<Wide> triangle{corner[0].point, corner[1].point, corner[2].point};
    const auto listed = pack.listed > 0;
    if (pack.kind == ContactKind::fixed) {
        const Vector3<Wide> separation = tool.axis_point.template cast<Wide>() - point_at(triangle, pack.load.weights);
        pack.distance = dot(separation, pack.load.normal);
    } else if (pack.kind != ContactKind::edge) {
        const Vector3<Wide> axis_point =
            tool.position.template cast<Wide>() + pack.end * tool.axis.template cast<Wide>();
        if (locate_in_faces(triangle, axis_point, pack)) return;
        const auto nearest = closest_point_inline<false>(triangle, axis_point);
        const Vector3<Wide>& weights = nearest.barycentric;
        const Vector3<Wide> separation = axis_point - nearest.point, area = area_vector(triangle);
        const auto in_face = smaller(smaller(weights[0], weights[1]), weights[2]) > 0;
        use_known_side(in_face, area, pack);
        Vector3<Wide> along = area;
        if (pack.kind == ContactKind::end) {
            for (Eigen::Index k = 0; k < 3; ++k) along[k] = select<Wide>(in_face, area[k], separation[k]);
        }
        pack.load.weights = weights;
        set_normal(listed, along, separation, pack);
    } else {
        const Vector3<Wide> start = tool.position.template cast<Wide>(), axis = tool.axis.template cast<Wide>();
        const auto nearest = closest_on_edge<Wide>(axis, triangle.b - triangle.a, triangle.a - start);
        pack.load.weights = Vector3<Wide>(1 - nearest.foot, nearest.foot, 0);
        const Vector3<Wide> separation = (start + nearest.fraction * axis) - point_at(triangle, pack.load.weights);
        set_normal(listed & (nearest.fraction > 0) & (nearest.fraction < 1), separation, separation, pack);
    }
}
///@}

// The corners of a triangle are updated under the same contact force: rocking together, they are at most twice as stiff
// as each alone, if no angle is obtuse.
inline constexpr int corners_at_once = 2;

/// Adds the change of a pack's forces since they were last applied to the rows of forces, and that of its rocking
/// stiffness: along the total force on a corner; beside fixed or shared corners in all directions. There a point may
/// press hard with little weight on its free corners, and other points set the direction of the total force on them.
template <std::size_t corners, Real Scalar>
MEMBRANE_NOINLINE MEMBRANE_FLATTEN void add_forces(VertexRows<Scalar>& rows, ContactState<Scalar>& contacts,
                                                   ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    const auto &load = pack.load, &applied = pack.applied;
    each_corner<corners>([&](std::size_t k) {
        const auto i = static_cast<Eigen::Index>(k);
        auto row = gather_padded(rows.force.data(), pack.corner[k].data());
        const Wide now = load.force * load.weights[i], before = applied.force * applied.weights[i];
        const Vector3<Wide> change = before * applied.normal - now * load.normal;
        row.point += change;
        const Wide stiffer = load.stiffness[i] - applied.stiffness[i];
        if (!pack.on_fixed) row.extra += stiffer;  // the contact stiffness
        scatter_padded(row, rows.force.data(), pack.corner[k].data());
        if (!pack.on_fixed) return;
        for (std::size_t lane = 0; lane < Wide::count; ++lane) {
            const auto v = static_cast<std::size_t>(row_at(pack.corner[k][lane]));
            rows.added_stiffness[v] += corners_at_once * stiffer[lane];
        }
        auto support = gather_padded(contacts.support.data(), pack.corner[k].data());
        support.point += change;
        scatter_padded(support, contacts.support.data(), pack.corner[k].data());
    });
    pack.applied = load;
}

/// Compliance and displacement of fixed and shared corners under the tool, see `rigid_support.hpp`.
template <Real Scalar>
struct SupportOfPack {
    Lanes<Scalar> compliance = 0;            // of all points [m/N]
    Lanes<Scalar> displacement = 0;          // along the normal [m]
    Lanes<Scalar> force = 0, stiffness = 0;  // sums over these corners [N], [N/m]
};

template <std::size_t corners, Real Scalar>
[[nodiscard]] SupportOfPack<Scalar> support_of(const ContactState<Scalar>& contacts,
                                               const ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    SupportOfPack<Scalar> sum;
    for (std::size_t k = 0; k < corners; ++k) {
        const auto i = static_cast<Eigen::Index>(k);
        const auto support = gather_padded(contacts.support.data(), pack.corner[k].data());
        const auto others = gather_padded(contacts.opposing.data(), pack.corner[k].data());
        const Wide &weight = pack.load.weights[i], &stiffness = support.extra;
        const auto is_fixed = pack.free[i] < 1;
        const Wide pressed = -dot(support.point, pack.load.normal);
        const Wide own = larger<Wide>(pressed, select<Wide>(is_fixed, weight * pack.load.force, 0));
        const Wide opposing = larger<Wide>(dot(others.point, pack.load.normal), 0);
        const auto holds = is_fixed | (opposing > 0);
        const Wide part = select<Wide>(is_fixed, 1, opposing / select<Wide>(opposing > 0, own + opposing, 1));
        const auto yields = holds & (stiffness > 0);
        const Wide compliance = select<Wide>(yields, 1 / select<Wide>(yields, stiffness, 1), 0);
        sum.compliance += weight * weight * (part * part * compliance);
        sum.displacement -= weight * (compliance * (part * own));
        sum.force += select<Wide>(is_fixed, larger<Wide>(norm(support.point), own), opposing);  // forces may cancel
        sum.stiffness += select<Wide>(holds, stiffness, 0);
    }
    return sum;
}

template <std::size_t corners, Real Scalar>
[[nodiscard]] MEMBRANE_INLINE std::array<PaddedLanes<Scalar>, corners> corners_of(
    const VertexRows<Scalar>& rows, const ContactPack<Scalar>& pack) noexcept {
    std::array<PaddedLanes<Scalar>, corners> corner;
    each_corner<corners>(
        [&](std::size_t k) { corner[k] = gather_padded(rows.position.data(), pack.corner[k].data()); });
    return corner;
}

/// The points of a pack at the current positions.
template <std::size_t corners, Real Scalar>
struct LocatedPack {
    std::array<PaddedLanes<Scalar>, corners> corner;
    SupportOfPack<Scalar> support;
    Lanes<Scalar> gap;  // beyond the lift, along the normals, with the displacement of fixed corners [m]
};

/// Locates the points of a pack. Fixed corners respond to the forces so far, which are added to the rows.
template <std::size_t corners, Real Scalar>
[[nodiscard]] MEMBRANE_NOINLINE MEMBRANE_FLATTEN LocatedPack<corners, Scalar> located_pack(
    VertexRows<Scalar>& rows, ContactState<Scalar>& contacts, const ToolShape<Scalar>& tool,
    ContactPack<Scalar>& pack) noexcept {
    LocatedPack<corners, Scalar> now{corners_of<corners>(rows, pack), {}, 0};
    locate(tool, now.corner, pack);
    if (pack.on_fixed) {
        add_forces<corners>(rows, contacts, pack);
        now.support = support_of<corners>(contacts, pack);
    }
    now.gap = pack.distance - now.support.displacement - (tool.radius + pack.lift);
    if constexpr (corners == 1) pack.wall = dot(pack.load.normal, now.corner[0].point) + now.gap;
    return now;
}

/// A negligible gap: the response to a negligible force, or a few roundings [m].
template <std::size_t corners, Real Scalar>
[[nodiscard]] MEMBRANE_INLINE Lanes<Scalar> gap_tolerance(const VertexRows<Scalar>& rows,
                                                          const LocatedPack<corners, Scalar>& now,
                                                          const ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    Wide sum = 0;
    for (std::size_t k = 0; k < corners; ++k) {
        const Wide& weight = pack.load.weights[static_cast<Eigen::Index>(k)];
        const Wide& compliance = now.corner[k].extra;
        sum += weight * weight * compliance;
    }
    const Wide rounding = 2 * std::numeric_limits<Scalar>::epsilon() * largest_magnitude<Wide>(now.corner[0].point);
    const Wide tolerance = rows.force_tolerance;
    return larger<Wide>(tolerance * sum, rounding) + tolerance * now.support.compliance;
}

/// Response of the corners of a pack to a unit force along the normal, and the internal force and stiffness there.
template <std::size_t corners, Real Scalar>
struct PackResponse {
    std::array<Vector3<Lanes<Scalar>>, corners> of_corner;  // to its part of the force [m/N]
    Lanes<Scalar> compliance;                               // of the points [m/N]
    Lanes<Scalar> balanced_force;      // largest that internal and external forces there balance [N]
    Lanes<Scalar> internal_stiffness;  // sum over the corners [N/m]
};

template <std::size_t corners, Real Scalar>
[[nodiscard]] MEMBRANE_INLINE PackResponse<corners, Scalar> response_of(const VertexRows<Scalar>& rows,
                                                                        const SupportOfPack<Scalar>& support,
                                                                        const ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    PackResponse<corners, Scalar> response;
    response.compliance = support.compliance;
    response.balanced_force = support.force;
    response.internal_stiffness = support.stiffness;
    each_corner<corners>([&](std::size_t k) {
        const auto corner = rows.responses(pack.corner[k]);
        const Wide& weight = pack.load.weights[static_cast<Eigen::Index>(k)];
        response.of_corner[k] = weight * (corner.compliance * pack.load.normal);
        response.compliance += weight * dot(response.of_corner[k], pack.load.normal);
        response.balanced_force += corner.internal_force;
        if (rows.has_external_forces) {
            response.balanced_force += Wide::of([&](std::size_t i) {
                return rows.external_force[static_cast<std::size_t>(row_at(pack.corner[k][i]))];
            });
        }
        response.internal_stiffness += corner.internal_stiffness;
    });
    return response;
}

/// Changes the force of each acting point by its gap over its compliance, never below zero, and moves the corners by
/// their response. Returns the absolute change [N].
template <std::size_t corners, Real Scalar>
MEMBRANE_INLINE Lanes<Scalar> solve(VertexRows<Scalar>& rows, const typename Lanes<Scalar>::Mask& acts,
                                    const PackResponse<corners, Scalar>& response, LocatedPack<corners, Scalar>& now,
                                    ContactPack<Scalar>& pack, ContactPass<Scalar>& pass) noexcept {
    using Wide = Lanes<Scalar>;
    const auto moves = acts & (response.compliance > 0);
    const Wide divisor = select<Wide>(moves, response.compliance, 1);
    Wide change = larger<Wide>(-now.gap / divisor, -pack.load.force);
    // The response leaves out that a rocking triangle shifts the force between supports: it may be too small. If the
    // changes alternate, they are halved.
    if (pack.on_fixed) change = select<Wide>(change * pack.change < 0, change / 2, change);
    // At equilibrium the contact force balances the other forces at the corners, now or once the gap is closed. If it
    // is much larger, a tool has jumped to the wrong side of some points, and they press against one another.
    const Wide limit = 2 * (response.balanced_force + abs(now.gap) * response.internal_stiffness);
    const auto too_hard = moves & (pack.load.force + change > limit);
    change = select<Wide>(too_hard, -pack.load.force, change);
    pass.released = pass.released || any(too_hard);
    const auto counts = moves & (abs(change) * response.compliance > gap_tolerance(rows, now, pack));
    if (!any(counts)) return 0;
    change = select<Wide>(counts, change, 0);
    pack.change = change;
    pack.load.force += change;
    // So large a change has no linear response: the next updates of the corners follow a release.
    const Wide linear = select<Wide>(too_hard, 0, change);
    each_corner<corners>([&](std::size_t k) {
        now.corner[k].point -= linear * response.of_corner[k];
        scatter_padded(now.corner[k], rows.position.data(), pack.corner[k].data());
    });
    return abs(change);
}

/// `push_out` for one pack.
template <std::size_t corners, Real Scalar>
[[nodiscard]] bool push_out(VertexRows<Scalar>& rows, ContactState<Scalar>& contacts, const ToolShape<Scalar>& tool,
                            ContactPack<Scalar>& pack) noexcept {
    using Wide = Lanes<Scalar>;
    if (pack.has_walls) return false;  // their forces are applied along the normals so far
    auto now = located_pack<corners>(rows, contacts, tool, pack);
    const auto inside = (pack.used > 0) & (-now.gap > gap_tolerance(rows, now, pack));
    if (!any(inside) || (corners == 1 && !pack.on_fixed)) return false;  // the updates move vertices out
    const Wide part = select<Wide>(inside, now.gap / squared_norm(pack.load.weights), 0);
    each_corner<corners>([&](std::size_t k) {
        const auto i = static_cast<Eigen::Index>(k);
        now.corner[k].point += (part * pack.load.weights[i] * pack.free[i]) * pack.load.normal;
        scatter_padded(now.corner[k], rows.position.data(), pack.corner[k].data());
    });
    return true;
}

/// Takes the multipliers of the vertices with walls, and places the walls at the current positions; beside faces, which
/// move the same vertices, solves them, too. The absolute changes of their forces, those that close a gap included [N].
template <Real Scalar>
[[nodiscard]] MEMBRANE_NOINLINE MEMBRANE_FLATTEN Lanes<Scalar> follow_vertices(VertexRows<Scalar>& rows,
                                                                               ContactState<Scalar>& contacts,
                                                                               const ToolShape<Scalar>& tool,
                                                                               ContactPack<Scalar>& pack,
                                                                               ContactPass<Scalar>& pass) noexcept {
    using Wide = Lanes<Scalar>;
    const Wide now = Wide::of([&](std::size_t i) {
        return i < pack.size ? rows.multiplier[static_cast<std::size_t>(row_at(pack.corner[0][i]))] : Scalar(0);
    });
    const Wide change = abs(now - pack.load.force);
    pack.load.force = pack.applied.force = now;  // the updates have changed the rows of forces
    auto located = located_pack<1>(rows, contacts, tool, pack);
    const auto acts = (pack.used > 0) & ((now > 0) | (located.gap < 0));
    if (!rows.only_walls && any(acts)) {
        static_cast<void>(solve(rows, acts, response_of<1>(rows, located.support, pack), located, pack, pass));
    }
    add_forces<1>(rows, contacts, pack);
    place_wall(rows, pack);
    const Wide& compliance = located.corner[0].extra;
    const Wide error = larger<Wide>(change, -located.gap / select<Wide>(compliance > 0, compliance, 1));
    return select<Wide>((pack.used > 0) & (error * compliance > gap_tolerance(rows, located, pack)), error, 0);
}

/// `solve_contacts` for one pack: the absolute changes of its forces [N].
template <std::size_t corners, Real Scalar>
[[nodiscard]] MEMBRANE_INLINE Lanes<Scalar> solve_pack(VertexRows<Scalar>& rows, ContactState<Scalar>& contacts,
                                                       const ToolShape<Scalar>& tool, ContactPack<Scalar>& pack,
                                                       ContactPass<Scalar>& pass) noexcept {
    using Wide = Lanes<Scalar>;
    if constexpr (corners == 1) {
        if (pack.has_walls) {
            const Wide change = follow_vertices(rows, contacts, tool, pack, pass);
            if (pack.has_walls) return change;
        }
    }
    auto now = located_pack<corners>(rows, contacts, tool, pack);
    const auto acts = (pack.used > 0) & ((pack.load.force > 0) | (now.gap < 0));
    pack.acts = any(acts);
    if (!pack.acts) return 0;
    if constexpr (corners == 3) {
        const auto allowed = static_cast<Scalar>(deep_overlap * deep_overlap);
        const Wide edge_square = squared_norm<Wide>(now.corner[1].point - now.corner[0].point);
        pass.deep = pass.deep || any((pack.used > 0) & (now.gap < 0) & (now.gap * now.gap > allowed * edge_square));
    }
    const auto response = response_of<corners>(rows, now.support, pack);
    const Wide change = solve(rows, acts, response, now, pack, pass);
    if (pack.on_fixed) add_forces<corners>(rows, contacts, pack);
    return change;
}

template <Real Scalar>
[[nodiscard]] Scalar largest_of(const Lanes<Scalar>& numbers) noexcept {
    Scalar largest = numbers[0];
    for (std::size_t i = 1; i < Lanes<Scalar>::count; ++i) largest = (std::max)(largest, numbers[i]);
    return largest;
}

}  // namespace detail

template <Real Scalar>
bool push_out(VertexRows<Scalar>& rows, ContactState<Scalar>& contacts, const ToolShape<Scalar>& tool,
              std::span<ContactPack<Scalar>> packs) noexcept {
    bool moved = false;
    for (auto& pack : packs) {
        moved |= pack.kind == ContactKind::vertex ? detail::push_out<1>(rows, contacts, tool, pack)
                                                  : detail::push_out<3>(rows, contacts, tool, pack);
    }
    return moved;
}

template <Real Scalar>
MEMBRANE_FLATTEN ContactPass<Scalar> solve_contacts(VertexRows<Scalar>& rows, ContactState<Scalar>& contacts,
                                                    const ToolShape<Scalar>& tool, std::span<ContactPack<Scalar>> packs,
                                                    bool again) noexcept {
    ContactPass<Scalar> pass;
    Lanes<Scalar> largest = 0;
    for (auto& pack : packs) {
        if (again && !pack.acts) continue;
        largest = larger<Lanes<Scalar>>(largest, pack.kind == ContactKind::vertex
                                                     ? detail::solve_pack<1>(rows, contacts, tool, pack, pass)
                                                     : detail::solve_pack<3>(rows, contacts, tool, pack, pass));
    }
    pass.largest = detail::largest_of(largest);
    return pass;
}

template <Real Scalar>
MEMBRANE_FLATTEN void apply_forces(VertexRows<Scalar>& rows, ContactState<Scalar>& contacts,
                                   std::span<ContactPack<Scalar>> packs) noexcept {
    for (auto& pack : packs) {
        auto& load = pack.load;
        if (pack.has_walls || !any((load.force > 0) | (pack.applied.force > 0))) continue;  // walls: done with them
        if (pack.kind == ContactKind::vertex) {
            detail::add_forces<1>(rows, contacts, pack);
            continue;
        }
        const auto corner = detail::corners_of<3>(rows, pack);
        load.stiffness = detail::rocking_stiffness<Lanes<Scalar>>({corner[0].point, corner[1].point, corner[2].point},
                                                                  load.weights, load.force * abs(pack.distance));
        detail::add_forces<3>(rows, contacts, pack);
    }
}

template <Real Scalar>
Scalar largest_squared_move(const VertexRows<Scalar>& rows, const ContactState<Scalar>& contacts) noexcept {
    using Wide = Lanes<Scalar>;
    const auto vertices = contacts.candidates.items();
    Wide largest = 0;
    std::array<Index, Wide::count> begins;
    for (std::size_t first = 0; first < vertices.size(); first += Wide::count) {
        for (std::size_t i = 0; i < Wide::count; ++i) {
            begins[i] = begin_of_row(vertices[(std::min)(first + i, vertices.size() - 1)]);
        }
        const Vector3<Wide> by =
            gather(rows.position.data(), begins.data()) - gather(contacts.kept_position.data(), begins.data());
        largest = larger<Wide>(largest, squared_norm(by));
    }
    return detail::largest_of(largest);
}

}  // namespace membrane
