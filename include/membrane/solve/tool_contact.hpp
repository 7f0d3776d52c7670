// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>

#include <membrane/contact/contact.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/solve/constraints.hpp>
#include <membrane/solve/contact_points.hpp>
#include <membrane/solve/surface_point.hpp>
#include <membrane/surface/time_of_impact.hpp>

/// The tool against the membrane.
///
///     const auto contact = tracker.update(tree, x, tool);
///     const auto report  = solver.step(x, dt, network, foundation, press(tool, contact));
///     report.reactions[0];                                                   // force of the membrane on the tool [N]
namespace membrane {

/// Keeps the vertices and faces that carry the contact outside the tool, see `ContactVertices`, without friction. Each
/// pair of such a face and a feature of the tool (its centre, an end of a shaft, a shaft against an edge) has one
/// contact point. There a force along the normal pushes and never pulls; barycentric weights distribute it to the
/// corners. A vertex has one contact point for all features, whose force its updates find.
///
/// Fixed corners (pinned or prescribed) do not move. They resist with a penalty force, the penetration times
/// `SolverOptions::rigid_stiffness`: at triangles with fixed corners a penetration of force over stiffness remains. If
/// a sphere's centre is behind such a triangle, the only contact point is the nearest one; a shaft keeps the side that
/// each of its points had in the last step. The force may jump where the nearest point crosses a border of the mesh, or
/// in a sharp fold at a pin. While a shaft touches fixed corners, the vertices in contact move in one step by at most
/// its motion and penetration: opposite forces on both sides of it would fling them away.
///
/// A sphere whose radius is less than a 70th of an edge, as that of a point tool is by default, stays in front of the
/// planes of the triangles that it touches: on a convex edge or corner it is too far out, by less than its radius.
template <Real Scalar>
struct ToolContact {
    Tool<Scalar> tool;        ///< that presses
    Contact<Scalar> contact;  ///< of this tool in this tick

    ///@{
    /// As `Constraint` requires.
    [[nodiscard]] bool valid() const noexcept { return is_valid(tool) && is_valid(contact); }
    [[nodiscard]] DrivingInput<Scalar> driving_input() const noexcept {
        if (!contact.touching() || contact.patch.tunnelled) return {};
        // A longer extrapolation might move the surface past the tool.
        return InputSample<Scalar>{contact.patch.axis_point, contact.patch.radius / 2};
    }
    void begin(ConstraintContext<Scalar>& context) const noexcept;
    bool enforce(ConstraintContext<Scalar>& context) const noexcept;
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& context) const noexcept {
        return reaction_at_points(context);
    }
    ///@}

  private:
    using Context = ConstraintContext<Scalar>;
    using Corners = std::array<Index, 3>;

    bool seed(Context& context) const noexcept;
    void list_candidates(Context& context) const noexcept;
    void carry_with_tool(Context& context) const noexcept;
    void clear_contact_point(Context& context) const noexcept;
    void find_points(Context& context) const noexcept;
    void add_point(Context& context, ContactPoint<Scalar> point) const noexcept;
    void stay_on_side(const Context& context, ContactPoint<Scalar>& point) const noexcept;
    void pack_points(Context& context) const noexcept;
    [[nodiscard]] std::optional<Vector3<Scalar>> direction_out_of_support(const Context& context) const noexcept;
    void touch_support(Context& context, const Vector3<Scalar>& out) const noexcept;
    [[nodiscard]] bool comes_out(const Triangle<Scalar>& before, const Triangle<Scalar>& now) const noexcept;
    void prevent_tunnelling(Context& context) const noexcept;
    [[nodiscard]] bool has_new_overlap(const Context& context) const noexcept;

    [[nodiscard]] static bool is_vertex(const ContactPoint<Scalar>& point) noexcept {
        return point.feature == vertex_feature;
    }
    [[nodiscard]] ToolShape<Scalar> shape() const noexcept {
        return {tool.position, tool.axis, contact.patch.axis_point, contact.patch.radius};
    }
    [[nodiscard]] static auto packs(Context& context) noexcept {
        return context.step().contacts.pack_ranges[context.constraint()].of(context.step().contacts.packs.items());
    }
    // The position to which `go_back` moves a vertex: that at the call of `keep`, or at the start of the step.
    static void keep(Context& context, Index v) noexcept {
        context.step().load(v);
        context.step().contacts.keep(v, context.position(v));
    }
    static void keep_start(Context& context, Index v) noexcept {
        context.step().load(v);
        if (!context.step().contacts.kept.contains(v)) context.step().contacts.keep(v, context.start(v));
    }
    [[nodiscard]] static Vector3<Scalar> kept(const Context& context, Index v) noexcept {
        return context.step().contacts.kept.contains(v) ? context.step().contacts.kept_at(v) : context.start(v);
    }
    static void go_back(Context& context, Scalar part) noexcept;
    [[nodiscard]] static bool on_support(const Context& context) noexcept {
        return !context.points().empty() && context.points().front().feature == fixed_feature;
    }
    // The triangle with support displacements, at the current positions and at the kept positions.
    [[nodiscard]] static Triangle<Scalar> surface_triangle(const Context& context, const Corners& corners) noexcept {
        const auto at = [&](Index v) {
            return Vector3<Scalar>(context.position(v) + support_displacement(context, v));
        };
        return {at(corners[0]), at(corners[1]), at(corners[2])};
    }
    [[nodiscard]] static Triangle<Scalar> kept_triangle(const Context& context, const Corners& corners) noexcept {
        const auto at = [&](Index v) { return Vector3<Scalar>(kept(context, v) + support_displacement(context, v)); };
        return {at(corners[0]), at(corners[1]), at(corners[2])};
    }
};

static_assert(Constraint<ToolContact<double>, double> && Constraint<ToolContact<float>, float>);

/// The tool presses at its contact. Forceps that hold a grasp do not press.
template <Real Scalar>
[[nodiscard]] ToolContact<Scalar> press(const Tool<Scalar>& tool, const Contact<Scalar>& contact,
                                        const Grasp<Scalar>& grasp = {}) noexcept {
    return {tool, grasp.holding() ? Contact<Scalar>::none() : contact};
}

namespace detail {

// Points share vertices: moving one point out of the tool may move another one in. So points are moved in several
// passes, at most this many.
inline constexpr int max_push_passes = 8;

// Largest number of contact passes before vertices are updated again: without, and with deep penetration.
inline constexpr int max_passes = 8, deep_contact_passes = 16;

/// Largest number of passes without deep penetration. With few points each carries a large part of the force, and more
/// passes reduce its error. Points that are `stiff` (beside fixed corners, or several of a shaft on one triangle)
/// converge slowly and get all passes. Vertices that carry the contact share no corner: one pass solves them.
[[nodiscard]] constexpr int max_contact_passes(std::size_t points, std::size_t vertices, bool stiff) noexcept {
    constexpr int least = 2, point_passes = 32;
    if (stiff || points == 0) return max_passes;
    if (vertices == points) return 1;
    return std::clamp(point_passes / static_cast<int>(points), least, max_passes);
}

}  // namespace detail

template <Real Scalar>
void ToolContact<Scalar>::begin(Context& context) const noexcept {
    auto& step = context.step();
    if (contact.patch.splits != no_index) step.compare_splits(contact.patch.splits, StepStatus::contact_missed_split);
    if (!contact.touching() || !seed(context)) return;
    if (!contact.patch.has_all_points) {
        step.refuse_points();
        return;
    }
    allow_motion(context,
                 contact.patch.detection_distance - contact.patch.radius + (std::max)(-contact.gap, Scalar(0)));
    // Until the new points are found, fixed and shared corners are displaced by the forces of the last step.
    sum_support_forces(context, context.constraint());
    const auto out = direction_out_of_support(context);
    if (contact.patch.tunnelled && !out) carry_with_tool(context);
    list_candidates(context);  // after that: `go_back` does not undo it
    if (!contact.patch.tunnelled && !out) clear_contact_point(context);
    out ? touch_support(context, *out) : find_points(context);
    if (step.refusal() != StepStatus::advanced) return;
    pack_points(context);
    for (int pass = 0; pass < detail::max_push_passes; ++pass) {
        if (!push_out(step.rows, step.contacts, shape(), packs(context))) break;
    }
    apply_forces(step.rows, step.contacts, packs(context));
    prevent_tunnelling(context);
}

// Checks the indices and seeds the queue with the corners of the triangles. False, and the step is refused, if a corner
// is no vertex.
template <Real Scalar>
bool ToolContact<Scalar>::seed(Context& context) const noexcept {
    Index least = 0, largest = 0;
    const auto check = [&](const auto& corners) {
        for (const Index v : corners) least = (std::min)(least, v), largest = (std::max)(largest, v);
    };
    check(contact.corners);
    for (const auto& listed : contact.patch.triangles) check(listed.corners);
    for (const auto& listed : contact.patch.candidates) check(listed.corners);
    for (const auto& listed : contact.patch.faces) check(listed.corners);
    for (const auto& found : contact.patch.points) check(found.corners);
    if (!context.validate(least) || !context.validate(largest)) return false;
    for (const auto& listed : contact.patch.triangles) {
        for (const Index v : listed.corners) context.seed(v);
    }
    return true;
}

// The corners of the candidate triangles, for `prevent_tunnelling`, and the positions to which it moves them back.
template <Real Scalar>
void ToolContact<Scalar>::list_candidates(Context& context) const noexcept {
    for (const auto& candidate : contact.patch.candidates) {
        for (const Index v : candidate.corners) {
            if (!context.step().contacts.candidates.insert(v)) continue;
            contact.patch.tunnelled ? keep(context, v) : keep_start(context, v);
        }
    }
}

// The tool does not pass the surface: triangles on its path since the last tick are carried with it, by the whole path
// or until they are one radius ahead.
//
// Relative to a tool that moves by d, a vertex that moves by w d, 0 <= w <= 1, moves by (w - 1) d. So the tool can hit
// only points of triangles that lie on its path, and does not hit a point a part s of the path ahead if the corners
// there move by w > 1 - s. It does not hit triangles off the path for any such w of their corners.
template <Real Scalar>
void ToolContact<Scalar>::carry_with_tool(Context& context) const noexcept {
    const Vector3<Scalar> path = contact.patch.axis_point - contact.patch.previous_axis_point;
    const Scalar length = norm(path);
    for (const auto& listed : contact.patch.triangles) {
        for (const Index v : listed.corners) keep(context, v);
    }
    for (const auto& listed : contact.patch.triangles) {
        const auto before = kept_triangle(context, listed.corners);
        const auto hit = first_hit(before, contact.patch.previous_axis_point, contact.patch.axis_point);
        if (!hit) continue;
        const Scalar part = 1 - detail::fraction(hit->fraction * length - contact.patch.radius, length);
        for (const Index corner : listed.corners) {
            if (context.fixed(corner)) continue;
            const Vector3<Scalar> so_far = context.position(corner) - kept(context, corner);
            if (dot(so_far, path) < part * squared_norm(path)) {
                context.set_position(corner, kept(context, corner) + part * path);
            }
        }
    }
}

// If the contact point penetrates, moves the surface there until it just touches the tool. Where its face does not
// carry the contact, or has fixed corners, it penetrates at equilibrium, too.
template <Real Scalar>
void ToolContact<Scalar>::clear_contact_point(Context& context) const noexcept {
    const auto faces = contact.patch.faces;
    const auto is_active = [&](const ContactTriangle& face) { return face.triangle == contact.triangle; };
    const auto active = std::find_if(faces.begin(), faces.end(), is_active);
    if (active == faces.end() || is_on_fixed(context, contact.corners)) return;
    const auto lift = static_cast<Scalar>(active->lift);
    if (!(contact.gap < lift - negligible_distance(context, contact.corners[0]))) return;
    const Vector3<Scalar> now = point_at(surface_triangle(context, contact.corners), contact.barycentric);
    const Vector3<Scalar> by = contact.patch.axis_point - (contact.patch.radius + lift) * contact.normal - now;
    if (dot(by, contact.normal) < 0) press_in<Scalar>(context, contact.corners, contact.barycentric, by);
}

// The tracker has found the points on the surface of the last step. The points of a shaft, or of a tool that has
// tunnelled, are found again on the extrapolated surface, where a normal may have the opposite sign.
template <Real Scalar>
void ToolContact<Scalar>::find_points(Context& context) const noexcept {
    const bool as_found = !is_shaft(tool) && !contact.patch.tunnelled;
    for (const auto& found : contact.patch.points) {
        if (as_found || is_vertex(found)) {
            add_point(context, found);
            continue;
        }
        auto point = contact_point(found.triangle, found.corners, triangle_of(context, found.corners), tool,
                                   found.feature, contact.patch.radius);
        if (!point) continue;
        point->lift = found.lift;
        add_point(context, *point);
    }
}

// A point of the last step keeps its force; another one is added if it is within the detection distance.
template <Real Scalar>
void ToolContact<Scalar>::add_point(Context& context, ContactPoint<Scalar> point) const noexcept {
    const auto* before = context.cached_point(point.triangle, point.feature, point.corners[0]);
    const Scalar distance = point.gap + contact.patch.radius;
    if (before == nullptr && !is_vertex(point) && distance > contact.patch.detection_distance) return;
    const bool apart = distance > contact.patch.radius / 1000;
    point.normal =
        direction(apart ? point.normal : Vector3<Scalar>(contact.patch.previous_axis_point - contact.patch.axis_point),
                  contact.normal);
    point.on_fixed = is_on_fixed(context, point.vertices());
    // Fixed corners do not follow the tool: when a shaft's axis passes them, it stays on the side of the last step. A
    // triangle that a tool has tunnelled through is between its last and its new position.
    const bool keeps_side = before != nullptr && is_shaft(tool);
    if (point.on_fixed && (keeps_side || contact.patch.tunnelled)) {
        const Vector3<Scalar> came = contact.patch.previous_axis_point - contact.patch.axis_point +
                                     distance * point.normal - support_displacement(context, point);
        if (dot(keeps_side ? before->normal : came, point.normal) < 0) point.normal = -point.normal;
    }
    stay_on_side(context, point);
    if (before != nullptr) point.force = -norm(before->force) * point.normal;
    context.add_point(point);
}

// Keeps the tool on its side of the surface. In one step a vertex may move by more than the radius of a tiny sphere;
// the normal at a nearest edge or corner may then flip. So a tiny sphere stays in front of the planes of its triangles
// during the step: at a convex edge this is too far out, by less than the radius. The same can happen at an end of a
// shaft thinner than an edge: on a closed surface, a point inside a triangle keeps the side that it had at the start of
// the step. A thicker shaft has no such rule: small triangles under it may turn over.
template <Real Scalar>
void ToolContact<Scalar>::stay_on_side(const Context& context, ContactPoint<Scalar>& point) const noexcept {
    constexpr Scalar tiny = Scalar(5e-4);  // squared radius over area: a radius of less than a 70th of an edge
    if (point.feature < 0 || point.feature > 1) return;
    const Vector3<Scalar> area = area_vector(triangle_of(context, point.corners));
    const Scalar size = norm(area), square = contact.patch.radius * contact.patch.radius;
    if (is_shaft(tool)) {
        if (contact.patch.closed && square < size) point.side = dot(point.normal, area) < 0 ? Scalar(-1) : Scalar(1);
        return;
    }
    if (!(square < tiny * size)) return;
    point.by_plane = contact.patch.side * dot(point.normal, area) > 0;
    if (point.by_plane) point.normal = direction<Scalar>(contact.patch.side * area, point.normal);
}

// Applies the points' forces of the last step, from which those of this one go on, and packs the points. First the
// forces: this marks the corners as forced, on which `add_forces` relies.
template <Real Scalar>
void ToolContact<Scalar>::pack_points(Context& context) const noexcept {
    auto& contacts = context.step().contacts;
    const auto points = context.points();
    for (const auto& point : points) {
        add_point_force(context, point.corners, point.weights, point.force);
    }
    sum_support_forces(context, context.constraint() + 1);
    auto& range = contacts.pack_ranges[context.constraint()];
    range.begin = contacts.packs.size();
    contacts.packs.append(std::span<const ContactPoint<Scalar>>(points),
                          contacts.point_ranges[context.constraint()].begin, [&](Index v) { return context.fixed(v); });
    range.end = contacts.packs.size();
}

// Fixed vertices do not yield to a tool: if it penetrates by more than its radius, its axis is behind them. Then the
// only contact point of a sphere is the nearest one, on the tool's side in the last step. Returns the direction out of
// the surface at this point; null for a shaft, if the centre is not behind, or if no corner that has a weight at this
// point is fixed.
template <Real Scalar>
std::optional<Vector3<Scalar>> ToolContact<Scalar>::direction_out_of_support(const Context& context) const noexcept {
    const Vector3<Scalar> fixed = contact.barycentric - free_weights(context, contact.corners, contact.barycentric);
    if (!(fixed.maxCoeff() > 0) || is_shaft(tool)) return std::nullopt;
    Vector3<Scalar> pressed = Vector3<Scalar>::Zero();
    for (const auto& point : context.previous_points()) pressed += point.force;
    const Vector3<Scalar> out = (dot(pressed, contact.normal) > 0 ? Scalar(-1) : Scalar(1)) * contact.normal;
    // A point tool has a contact radius: within half of it from the surface the axis counts as behind.
    const Scalar ahead = (contact.patch.radius - tool.radius) / 2;
    if (!(dot<Scalar>(contact.patch.axis_point - contact.point, out) < ahead)) return std::nullopt;
    return out;
}

template <Real Scalar>
void ToolContact<Scalar>::touch_support(Context& context, const Vector3<Scalar>& out) const noexcept {
    Scalar pressed = 0;
    for (const auto& point : context.previous_points()) pressed -= dot(point.force, out);
    const Vector3<Scalar> force = -(std::max)(pressed, Scalar(0)) * out;
    context.add_point({contact.triangle, fixed_feature, contact.corners, contact.barycentric, out, force, true});
}

// Whether a shaft's axis point is on a triangle or behind it, up to rounding, and in front of it after the triangle has
// moved.
template <Real Scalar>
bool ToolContact<Scalar>::comes_out(const Triangle<Scalar>& before, const Triangle<Scalar>& now) const noexcept {
    if (!is_shaft(tool)) return false;
    const Vector3<Scalar> front = contact.patch.side * area_vector(before),
                          front_now = contact.patch.side * area_vector(now);
    return dot<Scalar>(contact.patch.axis_point - before.a, front) < contact.patch.radius / 1000 * norm(front) &&
           dot<Scalar>(contact.patch.axis_point - now.a, front_now) > 0;
}

// Continuous collision detection of the candidate triangles against the tool's axis point. At an impact all free
// vertices go back to before the earliest time of impact, with some clearance. Not needed while no vertex has moved by
// half the radius.
template <Real Scalar>
void ToolContact<Scalar>::prevent_tunnelling(Context& context) const noexcept {
    if (on_support(context)) return;
    const Scalar farthest = largest_squared_move(context.step().rows, context.step().contacts);
    if (4 * farthest < contact.patch.radius * contact.patch.radius && contact.gap > -contact.patch.radius / 2) return;
    const Scalar rounding = detail::rounding_at(contact.patch.axis_point);
    Scalar first = 1;
    for (const auto& triangle : contact.patch.candidates) {
        const auto before = kept_triangle(context, triangle.corners);
        const auto now = surface_triangle(context, triangle.corners);
        const Scalar time = time_of_impact<Scalar>(before, now, contact.patch.axis_point);
        if (time == 1 || comes_out(before, now)) continue;
        const Scalar clearance = std::sqrt(closest_point(before, contact.patch.axis_point).squared_distance);
        if (clearance <= rounding) continue;  // on the tool's axis: its side is not known
        const Scalar part =
            clearance > contact.patch.radius / 2 ? 1 - contact.patch.radius / (4 * clearance) : Scalar(0.1);
        first = (std::min)(first, part * time);
    }
    if (first < 1) go_back(context, 1 - first);
}

// Moves all free vertices back towards their kept positions, by `part` of the distance, 0 to 1.
template <Real Scalar>
void ToolContact<Scalar>::go_back(Context& context, Scalar part) noexcept {
    for (const Index v : context.step().rows.loaded.items()) {
        const Vector3<Scalar> now = context.position(v), before = kept(context, v);
        if (now != before && !context.fixed(v)) context.set_position(v, (1 - part) * now + part * before);
    }
}

template <Real Scalar>
bool ToolContact<Scalar>::enforce(Context& context) const noexcept {
    if (!contact.touching()) return false;
    auto& step = context.step();
    const bool takes_turns = step.contacts.several_on_fixed;  // then another constraint's pass comes next
    if (takes_turns) sum_support_forces(context);
    Scalar first_change = 0;  // largest change of a force in the first pass [N]
    bool released = false, deep = false;
    const auto points = std::as_const(context).points();
    const bool on_fixed = std::any_of(points.begin(), points.end(), [](const auto& point) { return point.on_fixed; });
    const auto vertices = static_cast<std::size_t>(std::count_if(points.begin(), points.end(), is_vertex));
    const bool stiff = on_fixed || (is_shaft(tool) && vertices < points.size());
    const int most = detail::max_contact_passes(points.size(), vertices, stiff);
    for (int i = 0; i < (takes_turns ? 1 : detail::deep_contact_passes); ++i) {
        const auto pass = solve_contacts(step.rows, step.contacts, shape(), packs(context), i > 0);
        deep = pass.deep && !takes_turns;
        released = released || pass.released;
        if (i == 0) first_change = pass.largest;
        // While forces change by more than half of that; then only while a penetration is deep.
        const bool needs_more = i + 1 < most ? pass.largest > first_change / 2 : pass.deep;
        if (!needs_more) break;
    }
    for (int i = 0; deep && i < detail::max_push_passes; ++i)
        deep = push_out(step.rows, step.contacts, shape(), packs(context));
    if (on_fixed && is_shaft(tool)) {
        for (const auto& listed : contact.patch.triangles) limit_motion<Scalar>(context, listed.corners);
    }
    apply_forces(step.rows, step.contacts, packs(context));
    prevent_tunnelling(context);
    if (takes_turns) step.contacts.packs.unpack(step.contacts.points.items());
    return first_change > 0 || released || has_new_overlap(context);
}

// Whether a triangle that was out of range at the start of the step, and has no contact point, penetrates now: the step
// has not converged, and the tracker adds the point in the next tick.
template <Real Scalar>
bool ToolContact<Scalar>::has_new_overlap(const Context& context) const noexcept {
    if (on_support(context)) return false;  // contact is at this point only
    const int features = feature_pairs(tool);
    const auto points = context.points();
    auto next = points.begin();  // vertices first, then in the order of the triangles
    while (next != points.end() && is_vertex(*next)) ++next;
    for (const auto& listed : contact.patch.faces) {
        for (int feature = 0; feature < features; ++feature) {
            if (next != points.end() && next->triangle == listed.triangle && next->feature == feature) {
                ++next;
                continue;
            }
            const auto nearest = closest_points(surface_triangle(context, listed.corners), tool, feature);
            const Scalar lift = static_cast<Scalar>(listed.lift) - negligible_distance(context, listed.corners[0]);
            if (nearest && norm(nearest->separation) < contact.patch.radius + lift) return true;
        }
    }
    return false;
}

}  // namespace membrane
