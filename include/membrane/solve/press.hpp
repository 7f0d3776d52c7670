// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include <membrane/collision/contact.hpp>
#include <membrane/collision/grasper.hpp>
#include <membrane/collision/tool.hpp>
#include <membrane/mesh/passing.hpp>
#include <membrane/solve/constraints.hpp>
#include <membrane/solve/touch.hpp>

/// The tool against the membrane.
///
///     const auto contact = tracker.update(tree, x, tool);
///     const auto report  = solver.step(x, dt, network, backing, press(tool, contact));
///     report.reactions[0]                                                    // force of the membrane on the tool [N]
namespace membrane {

/// Keeps the surface outside the tool, without friction: every touched triangle in its point nearest to the tool, by a
/// force along the normal that pushes and never pulls, shared out to the corners by barycentric weights. Corners that are
/// pinned or held stay in their place, and push with their stiffness times how deep the tool is in, see
/// `SolverOptions::rigid_stiffness`: there, and beside them, the tool stays inside by force over stiffness. If its axis is
/// behind such a corner, it touches in its nearest point alone; where that passes a border, or another part of a surface
/// that is folded around a pin more sharply than its triangles, the force may jump.
template <Real Scalar>
struct Press {
    Tool<Scalar> tool;
    Contact<Scalar> contact;

    [[nodiscard]] bool sound() const noexcept { return is_sound(tool) && is_sound(contact); }
    [[nodiscard]] Lead<Scalar> lead() const noexcept {
        if (!contact.touching() || contact.crossed) return {};
        return LeadPoint<Scalar>{contact.on_axis, contact.radius / 2};  // farther, the surface might pass the tool
    }
    void begin(Region<Scalar>& region) const noexcept;
    bool enforce(Region<Scalar>& region) const noexcept;
    [[nodiscard]] Vector3<Scalar> reaction(const Region<Scalar>& region) const noexcept;

  private:
    void take_along(Region<Scalar>& region) const noexcept;
    void give_way(Region<Scalar>& region) const noexcept;
    void find_touches(Region<Scalar>& region) const noexcept;
    [[nodiscard]] std::optional<Vector3<Scalar>> way_out_of_support(const Region<Scalar>& region) const noexcept;
    void touch_support(Region<Scalar>& region, const Vector3<Scalar>& out) const noexcept;
    void keep_side(Region<Scalar>& region) const noexcept;
    [[nodiscard]] bool has_new_overlap(const Region<Scalar>& region) const noexcept;
    Scalar aim(Region<Scalar>& region, Touch<Scalar>& touch) const noexcept;
    [[nodiscard]] static Scalar most_pressure(const Region<Scalar>& region, const Touch<Scalar>& touch,
                                              Scalar gap) noexcept;
    [[nodiscard]] static Scalar negligible_gap(const Region<Scalar>& region, const Touch<Scalar>& touch) noexcept {
        return negligible_shift(region, touch) + region.negligible_force() * support_compliance_of(region, touch);
    }
    [[nodiscard]] static bool on_face(const Touch<Scalar>& touch) noexcept {
        return touch.pair < 2 && touch.barycentric.minCoeff() > 0;
    }
};

static_assert(Constraint<Press<double>, double> && Constraint<Press<float>, float>);

/// The tool presses where it touches. Forceps that hold something press nothing.
template <Real Scalar>
[[nodiscard]] Press<Scalar> press(const Tool<Scalar>& tool, const Contact<Scalar>& contact,
                                  const Grasp<Scalar>& grasp = {}) noexcept {
    return {tool, grasp.holding() ? Contact<Scalar>::none() : contact};
}

namespace detail {

// Touches share vertices: within one call they take turns this often at the most.
inline constexpr int most_turns = 8;

// The pair of a touch whose point and normal stay as they are through a step.
inline constexpr int on_support = -1;

/// A face that rocks under a tool moves the contact point along itself, and with it the pressure from corner to corner:
/// for each corner the stiffness [N/m] that this amounts to. `moment` is the pressure times the distance from the face
/// to the tool's axis [N m].
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> wandering_stiffness(const Triangle<Scalar>& triangle, const Vector3<Scalar>& barycentric,
                                                  Scalar moment) noexcept {
    Vector3<Scalar> squares;  // of the side across from each corner
    squares << squared_norm<Scalar>(triangle.c - triangle.b), squared_norm<Scalar>(triangle.a - triangle.c),
        squared_norm<Scalar>(triangle.b - triangle.a);
    Vector3<Scalar> stiffness = Vector3<Scalar>::Zero();
    if (barycentric.minCoeff() > 0) {
        stiffness = (moment / (4 * squared_norm(area_vector(triangle)))) * squares;
    } else if (barycentric.maxCoeff() < 1) {
        Eigen::Index apart;
        barycentric.minCoeff(&apart);
        stiffness.setConstant(moment / squares[apart]);
        stiffness[apart] = 0;
    }
    return is_finite(stiffness) ? stiffness : Vector3<Scalar>(Vector3<Scalar>::Zero());
}

}  // namespace detail

template <Real Scalar>
void Press<Scalar>::begin(Region<Scalar>& region) const noexcept {
    if (!contact.touching()) return;
    const auto are_vertices = [&](const auto& corners) {
        return std::all_of(corners.begin(), corners.end(), [&](Index v) { return region.check(v); });
    };
    if (!are_vertices(contact.corners)) return;
    for (const auto triangles : {contact.touched, contact.watched}) {
        for (const auto& triangle : triangles) {
            if (!are_vertices(triangle.corners)) return;
        }
    }
    for (const auto& touched : contact.touched) seed_corners(region, touched.corners);
    for (const auto& touch : region.touches_before()) bear(region, touch, touch.force);
    const auto out = way_out_of_support(region);
    if (contact.crossed && !out) take_along(region);
    for (const Index v : region.corners_of(contact.watched)) contact.crossed ? region.keep(v) : region.save(v);
    if (!contact.crossed && !out && contact.gap < -negligible_shift(region, contact.corners[0])) give_way(region);
    out ? touch_support(region, *out) : find_touches(region);
    for (const auto& touch : region.touches_before()) bear<Scalar>(region, touch, -touch.force);
    for (const auto& touch : region.touches()) {
        if (!touch.force.isZero(0)) attach(region, touch);
    }
    // The surface gives way before any force is known.
    for (int pass = 0; pass < detail::most_turns; ++pass) {
        bool moved = false;
        for (auto& touch : region.touches()) {
            const Scalar overlap = -aim(region, touch);
            if (!(overlap > negligible_gap(region, touch))) continue;
            press_in<Scalar>(region, touch.corners, touch.barycentric, -overlap * touch.normal);
            moved = true;
        }
        if (!moved) break;
    }
    keep_side(region);
}

// The tool does not pass the surface: what its way since the last tick leads through goes the same way, all of it, or
// until it is a radius ahead.
//
// Seen from a tool that moves by d, a vertex that moves by w d, 0 <= w <= 1, moves by (w - 1) d. So the tool can meet
// only points of triangles that lie on its way, and does not meet one a part s of the way ahead if the corners there
// move by w > 1 - s. Triangles off the way are safe however their corners move by such w.
template <Real Scalar>
void Press<Scalar>::take_along(Region<Scalar>& region) const noexcept {
    const Vector3<Scalar> way = contact.on_axis - contact.before;
    const Scalar length = norm(way);
    for (const Index v : region.corners_of(contact.touched)) region.keep(v);
    for (const auto& touched : contact.touched) {
        const auto& v = touched.corners;
        const auto before = kept_surface_triangle(region, v);
        const auto hit = first_hit(before, contact.before, contact.on_axis);
        if (!hit) continue;
        const Scalar part = 1 - detail::fraction(hit->along * length - contact.radius, length);
        for (const Index corner : v) {
            if (region.fixed(corner)) continue;
            const Vector3<Scalar> so_far = region.position(corner) - region.kept(corner);
            if (dot(so_far, way) < part * squared_norm(way)) region.place(corner, region.kept(corner) + part * way);
        }
    }
}

// The surface gives way at the contact point first, to where it just touches the tool, if it is not there already.
template <Real Scalar>
void Press<Scalar>::give_way(Region<Scalar>& region) const noexcept {
    const Vector3<Scalar> now = point_at(surface_triangle(region, contact.corners), contact.barycentric);
    const Vector3<Scalar> way = contact.on_axis - contact.radius * contact.normal - now;
    if (dot(way, contact.normal) < 0) press_in<Scalar>(region, contact.corners, contact.barycentric, way);
}

template <Real Scalar>
void Press<Scalar>::find_touches(Region<Scalar>& region) const noexcept {
    const int pairs = feature_pairs(tool);
    for (const auto& touched : contact.touched) {
        const auto triangle = triangle_of(region, touched.corners);
        const bool on_fixed =
            std::any_of(touched.corners.begin(), touched.corners.end(), [&](Index v) { return region.fixed(v); });
        for (int pair = 0; pair < pairs; ++pair) {
            const auto nearest = proximity(triangle, tool, pair);
            if (!nearest) continue;
            const bool apart = norm(nearest->reach) > contact.radius / 1000;
            const Vector3<Scalar> towards = apart ? nearest->reach : Vector3<Scalar>(contact.before - contact.on_axis);
            const Vector3<Scalar> normal = direction(towards, contact.normal), none = Vector3<Scalar>::Zero();
            Touch<Scalar> touch{touched.triangle, pair, touched.corners, nearest->barycentric, normal, none, none,
                                on_fixed};
            // Fixed corners have not been taken along: what the tool has crossed is between it and where it was.
            if (contact.crossed && on_fixed) {
                const Vector3<Scalar> came =
                    contact.before - contact.on_axis + nearest->reach - yielding_of(region, touch);
                if (dot(came, touch.normal) < 0) touch.normal = -touch.normal;
            }
            if (const auto* before = region.recall(touched.triangle, pair)) {
                touch.force = -norm(before->force) * touch.normal;
            } else if (norm(nearest->reach) > contact.reach) {
                continue;
            }
            region.remember(touch);
        }
    }
}

// Fixed vertices do not give way to a tool, and one that is deeper in than its radius has its axis behind them. It touches
// the surface in one point then, the nearest, as it did before: the way out is given, none else.
template <Real Scalar>
std::optional<Vector3<Scalar>> Press<Scalar>::way_out_of_support(const Region<Scalar>& region) const noexcept {
    const Vector3<Scalar> weights = contact.barycentric - free_weights(region, contact.corners, contact.barycentric);
    if (!(weights.maxCoeff() > 0)) return std::nullopt;
    Vector3<Scalar> pressed = Vector3<Scalar>::Zero();
    for (const auto& touch : region.touches_before()) pressed += touch.force;
    const bool turned = dot(pressed, contact.normal) > 0;
    const Vector3<Scalar> out = turned ? Vector3<Scalar>(-contact.normal) : contact.normal;
    // A point is given a radius: half of that far from the surface there is a direction still.
    const Scalar ahead = (contact.radius - tool.radius) / 2;
    if (!(dot<Scalar>(contact.on_axis - contact.point, out) < ahead)) return std::nullopt;
    return out;
}

template <Real Scalar>
void Press<Scalar>::touch_support(Region<Scalar>& region, const Vector3<Scalar>& out) const noexcept {
    Scalar pressure = 0;
    for (const auto& touch : region.touches_before()) pressure -= dot(touch.force, out);
    const Vector3<Scalar> force = -(std::max)(pressure, Scalar(0)) * out, none = Vector3<Scalar>::Zero();
    region.remember(
        {contact.triangle, detail::on_support, contact.corners, contact.barycentric, out, force, none, true});
}

// Brings the touch up to date with the positions, its pressure unchanged, and returns the gap. The tool stays on the
// side of the triangle, or of the edge or corner it is nearest to, where the touch was found.
template <Real Scalar>
Scalar Press<Scalar>::aim(Region<Scalar>& region, Touch<Scalar>& touch) const noexcept {
    if (touch.pair == detail::on_support) {
        const Vector3<Scalar> here = point_at(triangle_of(region, touch.corners), touch.barycentric);
        return dot<Scalar>(contact.on_axis - here - yielding_of(region, touch), touch.normal) - contact.radius;
    }
    const Scalar pressure = norm(touch.force);
    if (pressure > 0) detach(region, touch);
    const auto triangle = triangle_of(region, touch.corners);
    const auto nearest = proximity(triangle, tool, touch.pair);
    if (!nearest) {
        touch.force.setZero();
        touch.stiffness.setZero();
        return std::numeric_limits<Scalar>::infinity();
    }
    touch.barycentric = nearest->barycentric;
    const Vector3<Scalar> along = on_face(touch) ? area_vector(triangle) : nearest->reach;
    const Vector3<Scalar> away = direction(along, touch.normal);
    touch.normal = dot(away, touch.normal) < 0 ? Vector3<Scalar>(-away) : away;
    touch.force = -pressure * touch.normal;
    if (pressure > 0) {
        touch.stiffness = detail::wandering_stiffness(triangle, touch.barycentric, pressure * norm(nearest->reach));
        attach(region, touch);
    }
    return dot(nearest->reach, touch.normal) - dot(yielding_of(region, touch), touch.normal) - contact.radius;
}

// In balance the pressure is what springs and backing at the corners resist with, or will once the gap is mended. Touches
// that press much harder, where a tool has jumped to the wrong side of some, press against one another, and ever harder.
template <Real Scalar>
Scalar Press<Scalar>::most_pressure(const Region<Scalar>& region, const Touch<Scalar>& touch, Scalar gap) noexcept {
    Scalar sum = 0, firmness = 0;
    for (const Index v : touch.corners) {
        sum += region.resistance(v);
        firmness += region.firmness(v);
    }
    return 8 * (sum + std::abs(gap) * firmness);
}

// However far vertices have jumped, the surface has not passed the tool: if it would have, all go back to where on their
// way it had not, and leave the tool some room.
template <Real Scalar>
void Press<Scalar>::keep_side(Region<Scalar>& region) const noexcept {
    if (!region.touches().empty() && region.touches().front().pair == detail::on_support) return;
    Scalar farthest = 0;
    for (const Index v : region.corners_of(contact.watched)) {
        farthest = (std::max)(farthest, squared_norm<Scalar>(region.position(v) - region.kept(v)));
    }
    if (4 * farthest < contact.radius * contact.radius && contact.gap > -contact.radius / 2) return;
    const Scalar rounding = detail::rounding_at(contact.on_axis);
    Scalar first = 1;
    for (const auto& watched : contact.watched) {
        const auto& v = watched.corners;
        const auto before = kept_surface_triangle(region, v);
        const Scalar time = passing_time<Scalar>(before, surface_triangle(region, v), contact.on_axis);
        if (time == 1) continue;
        const Scalar room = std::sqrt(closest_point(before, contact.on_axis).squared_distance);
        if (room <= rounding) continue;  // on the tool's axis: there is no telling its side
        const Scalar part = room > contact.radius / 2 ? 1 - contact.radius / (4 * room) : Scalar(0.1);
        first = (std::min)(first, part * time);
    }
    if (first < 1) region.go_back(1 - first);
}

template <Real Scalar>
bool Press<Scalar>::enforce(Region<Scalar>& region) const noexcept {
    if (!contact.touching()) return false;
    Scalar first = 0;  // largest change of a force in the first turn [N]
    bool wedged = false;
    for (int turn = 0; turn < detail::most_turns; ++turn) {
        Scalar largest = 0;
        for (auto& touch : region.touches()) {
            const Scalar gap = aim(region, touch);
            const Scalar compliance = compliance_of(region, touch) + support_compliance_of(region, touch);
            const Scalar pressure = -dot(touch.force, touch.normal);
            if (!(compliance > 0) || (pressure == 0 && gap >= 0)) continue;
            Scalar more = (std::max)(-gap / compliance, -pressure);
            if (pressure + more > most_pressure(region, touch, gap)) {
                more = -pressure;  // let go
                wedged = true;
            }
            if (!(std::abs(more) * compliance > negligible_gap(region, touch))) continue;
            change_force<Scalar>(region, touch, -more * touch.normal);
            bear<Scalar>(region, touch, -more * touch.normal);
            largest = (std::max)(largest, std::abs(more));
        }
        if (turn == 0) first = largest;
        if (!(largest > first / 2)) break;  // the vertices have to find their balance anew
    }
    keep_side(region);
    return first > 0 || wedged || has_new_overlap(region);
}

// Whether a triangle that was out of reach when the step began, and is no contact point of it, has come into the tool.
template <Real Scalar>
bool Press<Scalar>::has_new_overlap(const Region<Scalar>& region) const noexcept {
    const int pairs = feature_pairs(tool);
    const auto touches = region.touches();
    if (!touches.empty() && touches.front().pair == detail::on_support) return false;  // none else counts
    auto next = touches.begin();                                                       // in the same order
    for (const auto& touched : contact.touched) {
        const auto triangle = surface_triangle(region, touched.corners);
        for (int pair = 0; pair < pairs; ++pair) {
            if (next != touches.end() && next->triangle == touched.triangle && next->pair == pair) {
                ++next;
                continue;
            }
            const auto nearest = proximity(triangle, tool, pair);
            const Scalar slack = negligible_shift(region, touched.corners[0]);
            if (nearest && norm(nearest->reach) < contact.radius - slack) return true;
        }
    }
    return false;
}

template <Real Scalar>
Vector3<Scalar> Press<Scalar>::reaction(const Region<Scalar>& region) const noexcept {
    return reaction_of_touches(region);
}

}  // namespace membrane
