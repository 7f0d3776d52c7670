// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <optional>
#include <span>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_geometry.hpp>
#include <membrane/contact/contact_vertices.hpp>
#include <membrane/contact/local_surface.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/contact/tool_side.hpp>
#include <membrane/contact/winding_number.hpp>
#include <membrane/core/fixed_vector.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/surface/vertex_split.hpp>

/// Contact detection: position, depth and phase of the tool's contact with the surface.
///
///     auto tree    = membrane::AabbTree(mesh);
///     auto tracker = membrane::ContactTracker(mesh);
///     const auto contact = tracker.update(tree, x, tool);                    // once a tick, before the solver's step
///     tree.refit(x, report.moved);                                           // after the step
namespace membrane {

template <Real Scalar>
class MovingBody;  // of moving_body.hpp

/// Options of a `ContactTracker`.
struct TrackerOptions {
    /// Added to the tool's radius in the search for triangles, and the smallest radius of a tool: a thinner one, a
    /// point too, counts as this thick [mean edges].
    double margin = 0.01;
    Index full_query_interval = 128;   ///< ticks in contact between full tree queries, which find further folds
    Index max_contact_points = 16384;  ///< capacity for contact points; determines memory, not time
    /// The largest circumradius of triangles whose vertices carry the contact, see `ContactVertices`; the others carry
    /// it with their faces. 0: all do. More than 0.5 is for shallow contacts: deep ones stretch triangles [tool radii].
    double fine_triangles = 0.5;
};

/// Without contact, or if the tool has moved by more than a mean edge in the tick, queries the tree. Otherwise tests
/// the contact triangles of the last tick and their neighbours [Liu07] 2.3: that cost depends on the contact area, not
/// on the size of the mesh.
///
/// Beyond the paper: the search floods every triangle within the detection distance. Each tick also casts the
/// displacement of the tool's position (and of the other end of a capsule) against the tree. If it hits, the contact is
/// at the intersection, however long the displacement; where a contact begins at a small angle, at the end of the
/// displacement. A second fold of the surface that approaches a tool in contact is found within `full_query_interval`
/// ticks; beyond a tear, at once.
///
/// A contact begins if the gap is not positive; where vertices carry it, if one is no farther off than its lift. It
/// ends if the gap beyond the lift is positive and the tool has left the rest surface, or the gap exceeds depth plus
/// the tool's travel: a membrane that springs back stays in contact. After tunnelling, faces carry it.
///
/// The tool stays outside a closed surface: where the winding number is 0. At an open surface the tool stays on the
/// side of first contact. If that contact is on a border, the side is fixed when the contact has left the border, or
/// when its normal is within 60 degrees of the surface's. The tool keeps the side until it is clear of the surface (no
/// triangle within two mean edges) or has slid off a border that it displaced; closed forceps keep it in any case. A
/// capsule that has slid off a border may lie on both sides. Until it is clear, only the passage of its ends is
/// detected.
///
/// The rest surface is the mesh, or the anchors of a moving body, even where the membrane is torn. Depth is measured
/// against it, that of a shaft at its deepest point, on the side where the tool entered: it grows beyond the middle of
/// a body, too, and beyond its other wall by as much as the body is thick. If the tool is outside the rest surface and
/// the membrane lies farther out or is pierced, there is no contact: a contact must not pull.
template <Real Scalar>
class ContactTracker : public SplitCount {
  public:
    /// @throws InvalidInput for options out of range. Cost: O(V + F log F).
    explicit ContactTracker(const TriangleMesh<Scalar>& mesh, TrackerOptions options = {});

    /// The contact of `tool` with the surface at `x` (3 x V [m]). If the tool is not valid, or `x` has another number
    /// of vertices, returns no contact and leaves the state unchanged. Online. Cost: one or two segment casts, and a
    /// query of the tree or, in contact, the triangles within detection distance and their neighbours. A tool behind
    /// the surface adds ray casts if the surface is open, and winding numbers if it is closed.
    /// @pre `tree` was refitted to `x`
    [[nodiscard]] Contact<Scalar> update(const AabbTree<Scalar>& tree, const ConstPointsRef<Scalar>& x,
                                         const Tool<Scalar>& tool) noexcept {
        return track(tree, x, tool, origins_);
    }

    /// The contact on a moving body: the stored tool and contact move with the body.
    [[nodiscard]] Contact<Scalar> update(const AabbTree<Scalar>& tree, const ConstPointsRef<Scalar>& x,
                                         const Tool<Scalar>& tool, const MovingBody<Scalar>& body) noexcept;

    /// Number of full tree queries (for all triangles near the tool) during contact, since construction.
    [[nodiscard]] Index full_query_count() const noexcept { return full_query_count_; }

    ///@{
    /// A vertex becomes two; a vertex moves at rest. A contact goes on. Online. Cost: the triangles around the vertex.
    void split(const VertexSplit& split) noexcept;
    void reshape(const MovedVertex<Scalar>& moved) noexcept;
    ///@}

    /// Drops contact, tool and side. Later contacts equal those of a new tracker, bit for bit.
    void reset() noexcept;

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`; of a mesh with a reserve, the triangles, too.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.surface_);
        if (self.surface_.has_reserve()) visit(self.vertices_, self.origins_, self.torn_, self.splits_);
        visit(self.near_, self.nearest_, self.nearest_square_, self.last_, self.last_tool_, self.pose_, self.side_,
              self.origin_triangles_, self.entry_normal_, self.beyond_middle_, self.ticks_, self.full_query_count_,
              self.rebound_ticks_);
    }

  private:
    // The inputs of one update.
    struct Scene {
        const AabbTree<Scalar>& tree;
        const ConstPointsRef<Scalar>& x;
        const Tool<Scalar>& tool;
        const ConstPointsRef<Scalar>& anchors;
        Scalar radius;              // of the tool, at least the margin [m]
        Scalar travel;              // longest displacement of a point of the axis since the last tick [m]
        Scalar detection_distance;  // from the tool's axis to triangles that may touch it in this tick [m]
    };

    void move_with_body(const RigidFrame<Scalar>& pose) noexcept;
    [[nodiscard]] Contact<Scalar> track(const AabbTree<Scalar>& tree, const ConstPointsRef<Scalar>& x,
                                        const Tool<Scalar>& tool, const ConstPointsRef<Scalar>& anchors) noexcept;
    [[nodiscard]] Scene scene_of(const AabbTree<Scalar>& tree, const ConstPointsRef<Scalar>& x,
                                 const Tool<Scalar>& tool, const ConstPointsRef<Scalar>& anchors) const noexcept;
    [[nodiscard]] Scalar expected_side() const noexcept {
        return side_.known() ? side_.sign() : last_.touching() ? last_.patch.side : Scalar(1);
    }
    // Whether the tool may still approach an open surface from either side.
    [[nodiscard]] bool side_is_open() const noexcept {
        return !surface_.closed() && !last_.touching() && !side_.known();
    }
    [[nodiscard]] bool is_clear(const Scene& scene) const noexcept;
    bool follow(const Scene& scene, Contact<Scalar>& contact) noexcept;
    bool find(const Scene& scene, Contact<Scalar>& contact) noexcept;
    [[nodiscard]] bool contacts(const Scene& scene, Contact<Scalar>& contact) noexcept;
    [[nodiscard]] bool touches(const Scene& scene, const Contact<Scalar>& contact) const noexcept;
    bool sweep_test(const Scene& scene, Contact<Scalar>& contact) const noexcept;
    [[nodiscard]] std::optional<Contact<Scalar>> where_it_ends(const Scene& scene,
                                                               const Contact<Scalar>& passed) const noexcept;
    void describe(const Scene& scene, Index f, Contact<Scalar>& contact) const noexcept;
    void describe_shaft(const Scene& scene, Index f, Scalar side, Contact<Scalar>& contact) const noexcept;
    // Describes the contact as one from the other side.
    static void turn(const Scene& scene, Contact<Scalar>& contact) noexcept {
        contact.gap = -contact.gap - 2 * scene.radius;
        contact.normal = -contact.normal;
    }
    // Whether a shaft passes through triangle `f`.
    [[nodiscard]] bool pierces(const Scene& scene, Index f) const noexcept {
        return is_shaft(scene.tool) &&
               closest_to_axis(surface_.triangle(scene.x, f), scene.tool).on_triangle.squared_distance == 0;
    }
    [[nodiscard]] bool was_behind(const Scene& scene, Index f, Scalar side, const Vector3<Scalar>& q) const noexcept;
    [[nodiscard]] std::optional<Vector3<Scalar>> middle_inside(const Scene& scene, Index f, Scalar side) const noexcept;
    [[nodiscard]] bool has_passed(const Scene& scene, Index start, Scalar side,
                                  const Vector3<Scalar>& q) const noexcept;
    void gather_from_tree(const Scene& scene) noexcept;
    void flood(const Scene& scene) noexcept;
    [[nodiscard]] bool reaches_border() const noexcept {
        const auto nearby = near_.items();
        return std::any_of(nearby.begin(), nearby.end(), [&](Index f) { return surface_.has_border_vertex(f); });
    }
    void examine(const Scene& scene, std::span<const Index> some) noexcept;
    void collect_candidates(int rings) noexcept;
    void complete(const Scene& scene, Contact<Scalar>& contact) noexcept;
    void find_points(const Scene& scene, Contact<Scalar>& contact) noexcept;
    void find_vertices(const Scene& scene, Contact<Scalar>& contact) noexcept;
    template <class List>
    void find_points_of_sphere(const Scene& scene, std::span<const ContactTriangle> listed,
                               const List& list) const noexcept;
    Scalar measure_depth(const Scene& scene, Contact<Scalar>& contact) noexcept;
    [[nodiscard]] Scalar depth_of_shaft(const Scene& scene, const Contact<Scalar>& contact,
                                        bool below_border) const noexcept;
    [[nodiscard]] Vector3<Scalar> mean_touched_normal(const Scene& scene,
                                                      const Vector3<Scalar>& otherwise) const noexcept;
    [[nodiscard]] Vector3<Scalar> rest_normal(const Scene& scene, Index f) const noexcept {
        return direction<Scalar>(area_vector(at_rest().triangle(scene.anchors, f)), Vector3<Scalar>::Zero());
    }
    [[nodiscard]] bool is_below_border(const Scene& scene, const Contact<Scalar>& contact) const noexcept;
    // Whether the tool is below a border that is displaced.
    [[nodiscard]] bool leaves_border(const Scene& scene, const Contact<Scalar>& contact) const noexcept {
        return contact.triangle != no_index && is_below_border(scene, contact) && is_displaced(scene, contact);
    }
    // Whether the touched point is displaced by more than the margin.
    [[nodiscard]] bool is_displaced(const Scene& scene, const Contact<Scalar>& contact) const noexcept {
        const auto origin = surface_.triangle(scene.anchors, contact.triangle);
        return norm<Scalar>(contact.point - point_at(origin, contact.barycentric)) > margin_;
    }
    [[nodiscard]] bool is_side_certain(const Scene& scene, const Contact<Scalar>& contact) const noexcept;
    [[nodiscard]] bool is_hooked(const Scene& scene, const Contact<Scalar>& contact) const noexcept;

    // After tunnelling the membrane springs back and may fold over the tool: for some ticks candidates include more
    // rings.
    static constexpr int candidate_rings = 2, candidate_rings_after_tunnelling = 6, ticks_after_tunnelling = 16;
    static constexpr Scalar alike = Scalar(0.55);  // least cosine between normals of one wall of a body, 57 degrees
    static constexpr Scalar negligible_part = Scalar(1e-6);  // fraction of the tool's displacement in a tick

    // The surface at rest: a tear does not part it.
    [[nodiscard]] const LocalSurface<Scalar>& at_rest() const noexcept { return whole_ ? *whole_ : surface_; }

    Points<Scalar> origins_;
    LocalSurface<Scalar> surface_;
    std::optional<LocalSurface<Scalar>> whole_;  // before any tear, if the mesh has a reserve
    ContactVertices vertices_;
    Scalar margin_;  // [m]
    Index full_query_interval_;

    // Triangles within detection distance, those around the active one, and those on the path of a tunnelling tool;
    // now and in the last tick.
    IndexSet near_, near_before_;
    Index nearest_ = no_index;  // of `near_`
    Scalar nearest_square_ = 0;
    IndexSet queued_;                              // for `near_`, in the order of examination
    IndexSet candidates_;                          // `near_` and the rings around it
    IndexSet expanded_;                            // vertices with all their triangles in `candidates_`
    IndexSet touched_;                             // vertices with a contact point
    FixedVector<ContactTriangle> listed_, faces_;  // faces: of `near_`, that carry the contact
    FixedVector<ContactPoint<Scalar>> points_;
    Contact<Scalar> last_;
    std::optional<Tool<Scalar>> last_tool_;
    RigidFrame<Scalar> pose_;  // of the body at the last update
    ToolSide<Scalar> side_;
    bool torn_ = false;  // whether a vertex has become two
    // The triangles of the rest surface nearest to the tool's two ends and its axis point.
    std::array<Index, 3> origin_triangles_{no_index, no_index, no_index};
    Vector3<Scalar> entry_normal_ = Vector3<Scalar>::Zero();  // at rest, of the wall where the tool entered; 0: none
    bool beyond_middle_ = false;                              // whether the tool is nearer to another wall
    Index ticks_ = 0, full_query_count_ = 0;
    int rebound_ticks_ = 0;
};

template <Real Scalar>
ContactTracker<Scalar>::ContactTracker(const TriangleMesh<Scalar>& mesh, TrackerOptions options)
    : origins_(mesh.positions()),
      surface_(mesh),
      whole_(surface_.has_reserve() ? std::optional(surface_) : std::nullopt),
      vertices_(surface_, ConstPointsRef<Scalar>(origins_), options.fine_triangles),
      margin_(static_cast<Scalar>(options.margin) * surface_.mean_edge()),
      full_query_interval_(options.full_query_interval),
      near_(mesh.triangle_count()),
      near_before_(near_),
      queued_(near_),
      candidates_(near_),
      expanded_(mesh.vertex_count()),
      touched_(options.fine_triangles > 0 ? mesh.vertex_count() : 0),
      listed_(static_cast<std::size_t>(mesh.triangle_count())),
      faces_(vertices_.any() ? listed_.capacity() : 0),
      points_(static_cast<std::size_t>(std::clamp(options.max_contact_points, Index(0), 5 * mesh.triangle_count()))) {
    if (!is_finite(options.margin) || !(options.margin > 0 && options.margin <= 1)) {
        refuse("ContactTracker", "margin must be above 0 and at most 1 [mean edges], got ", options.margin);
    }
    if (options.full_query_interval < 1)
        refuse("ContactTracker", "full_query_interval must be at least 1, got ", options.full_query_interval);
    if (options.max_contact_points < 1)
        refuse("ContactTracker", "max_contact_points must be at least 1, got ", options.max_contact_points);
    if (!is_finite(options.fine_triangles) || !(options.fine_triangles >= 0 && options.fine_triangles <= 1)) {
        refuse("ContactTracker", "fine_triangles must be from 0 to 1 [tool radii], got ", options.fine_triangles);
    }
}

template <Real Scalar>
void ContactTracker<Scalar>::split(const VertexSplit& split) noexcept {
    torn_ = true;
    ++splits_;
    surface_.split(split);
    origins_.col(split.copy) = origins_.col(split.vertex);
    for (const Index v : {split.vertex, split.copy}) vertices_.measure<Scalar>(surface_, origins_, v);
    if (split.takes(last_.triangle)) split.replace_in(last_.corners);
}

template <Real Scalar>
void ContactTracker<Scalar>::reshape(const MovedVertex<Scalar>& moved) noexcept {
    origins_.col(moved.vertex) = moved.rest;
    for (const Index f : surface_.triangles_of(moved.vertex)) {
        for (const Index v : surface_.corners(f)) vertices_.measure<Scalar>(surface_, origins_, v);
    }
}

template <Real Scalar>
void ContactTracker<Scalar>::reset() noexcept {
    near_.clear();
    last_ = {};
    last_tool_.reset();
    pose_ = {};
    side_ = {};
    origin_triangles_.fill(no_index);
    entry_normal_.setZero();
    beyond_middle_ = false;
    ticks_ = 0;
    rebound_ticks_ = 0;
}

template <Real Scalar>
Contact<Scalar> ContactTracker<Scalar>::update(const AabbTree<Scalar>& tree, const ConstPointsRef<Scalar>& x,
                                               const Tool<Scalar>& tool, const MovingBody<Scalar>& body) noexcept {
    move_with_body(body.pose());
    auto contact = track(tree, x, tool, body.anchors());
    if (contact.touching()) {
        contact.body_velocity = body.velocity_at(tool.position, contact.corners, contact.barycentric);
    }
    return contact;
}

// Moves the stored tool and contact with the body to `pose`.
template <Real Scalar>
void ContactTracker<Scalar>::move_with_body(const RigidFrame<Scalar>& pose) noexcept {
    if (pose.same_pose(pose_)) return;
    const auto motion = motion_between(pose_, pose);
    pose_ = pose;
    if (last_tool_) {
        last_tool_->position = motion.point_to_world(last_tool_->position);
        last_tool_->axis = motion.vector_to_world(last_tool_->axis);
    }
    for (auto* stored : {&last_.point, &last_.patch.axis_point, &last_.patch.previous_axis_point})
        *stored = motion.point_to_world(*stored);
    last_.normal = motion.vector_to_world(last_.normal);
    entry_normal_ = motion.vector_to_world(entry_normal_);
}

template <Real Scalar>
Contact<Scalar> ContactTracker<Scalar>::track(const AabbTree<Scalar>& tree, const ConstPointsRef<Scalar>& x,
                                              const Tool<Scalar>& tool,
                                              const ConstPointsRef<Scalar>& anchors) noexcept {
    if (!is_valid(tool) || x.cols() != origins_.cols() || anchors.cols() != origins_.cols())
        return Contact<Scalar>::none();
    const Scene scene = scene_of(tree, x, tool, anchors);
    const bool before = last_.touching();
    Contact<Scalar> contact;
    const bool followed = before && scene.travel <= surface_.mean_edge() && follow(scene, contact);
    if (before && !followed) ++full_query_count_;
    if ((followed || find(scene, contact)) && contacts(scene, contact)) {
        complete(scene, contact);
        contact.phase = before ? ContactPhase::ongoing : ContactPhase::began;
        side_.touch(contact.patch.side, side_.known() || is_side_certain(scene, contact),
                    is_shaft(tool) && leaves_border(scene, contact));
    } else {
        if ((side_.known() || side_.slid_off()) && !tool.grasping) {
            side_.leave(is_clear(scene), leaves_border(scene, contact));
        }
        near_.clear();
        origin_triangles_.fill(no_index);
        entry_normal_.setZero();
        beyond_middle_ = false;
        contact = {};
        contact.phase = before ? ContactPhase::ended : ContactPhase::none;
    }
    contact.patch.splits = (std::min)(tree.splits(), splits_);
    last_tool_ = tool;
    last_ = contact;
    last_.patch.triangles = last_.patch.candidates = last_.patch.faces = {};  // valid until the next update only
    last_.patch.points = {};
    return contact;
}

template <Real Scalar>
auto ContactTracker<Scalar>::scene_of(const AabbTree<Scalar>& tree, const ConstPointsRef<Scalar>& x,
                                      const Tool<Scalar>& tool, const ConstPointsRef<Scalar>& anchors) const noexcept
    -> Scene {
    const Tool<Scalar>& last = last_tool_ ? *last_tool_ : tool;
    const Vector3<Scalar> displacement = tool.position - last.position;
    const Scalar travel = (std::max)(norm(displacement), norm<Scalar>(displacement + tool.axis - last.axis));
    // The membrane may follow a withdrawing tool by its last gap.
    const Scalar rebound = (std::max)(last_.gap, Scalar(0));
    const Scalar radius = (std::max)(tool.radius, margin_);
    const Scalar lifted = radius + static_cast<Scalar>(vertices_.largest_lift(radius));
    const Scalar motion = (std::min)(travel + rebound, surface_.mean_edge());
    return {tree, x, tool, anchors, radius, travel, lifted + margin_ + motion};
}

// Finds the contact among the triangles of the last tick and their neighbours; false if the tool has left all of them.
template <Real Scalar>
bool ContactTracker<Scalar>::follow(const Scene& scene, Contact<Scalar>& contact) noexcept {
    std::swap(near_, near_before_);
    near_.clear();
    queued_.clear();
    for (const Index f : near_before_.items()) queued_.insert(f);
    if (++ticks_ % full_query_interval_ == 0 || rebound_ticks_ > 0) {
        ++full_query_count_;
        gather_from_tree(scene);
    }
    flood(scene);
    if (torn_ && reaches_border()) {  // beyond a tear there may be triangles as near
        ++full_query_count_;
        gather_from_tree(scene);
        flood(scene);
    }
    if (near_.empty()) return false;

    contact.patch.side = expected_side();
    if (!sweep_test(scene, contact)) describe(scene, nearest_, contact);
    return true;
}

// Finds the contact with the tree if none could be followed; false if the tree finds no nearest triangle.
template <Real Scalar>
bool ContactTracker<Scalar>::find(const Scene& scene, Contact<Scalar>& contact) noexcept {
    contact = {};
    near_.clear();
    queued_.clear();
    gather_from_tree(scene);
    flood(scene);
    if (!sweep_test(scene, contact)) {
        const Index f = near_.empty() ? scene.tree.closest_point(scene.x, scene.tool.position).triangle : nearest_;
        if (f == no_index) return false;
        contact.patch.side = expected_side();
        describe(scene, f, contact);
    }
    return true;
}

// Whether the contact begins or goes on. Vertices that carry it stay lifted off the tool until it lets go of them: then
// the tool may be outside of the surface at rest, too.
template <Real Scalar>
bool ContactTracker<Scalar>::contacts(const Scene& scene, Contact<Scalar>& contact) noexcept {
    if (!last_.touching() && !touches(scene, contact)) return false;
    const auto lift = static_cast<Scalar>(vertices_.largest_lift(contact.corners, scene.radius));
    const Scalar gap = contact.gap - lift;
    if (gap > 0 && (side_.slid_off() || is_below_border(scene, contact))) return false;
    if (gap > surface_.mean_edge() && !is_displaced(scene, contact)) return false;  // nothing springs back
    const Scalar rebound = measure_depth(scene, contact);
    const bool is_pressed_in = contact.depth + lift > 0;
    contact.depth = (std::max)(Scalar(0), contact.depth);
    if (is_hooked(scene, contact)) return false;
    if (!last_.touching()) return true;
    return gap <= margin_ / 1000 || (is_pressed_in && gap <= rebound + scene.travel);
}

// Whether the tool touches the active triangle, or a corner that carries the contact is as near to it as it may be.
template <Real Scalar>
bool ContactTracker<Scalar>::touches(const Scene& scene, const Contact<Scalar>& contact) const noexcept {
    if (contact.patch.tunnelled || contact.gap <= 0) return true;
    return std::any_of(contact.corners.begin(), contact.corners.end(), [&](Index v) {
        const auto from_axis = to_segment(membrane::point(scene.x, v), scene.tool.position, scene.tool.axis);
        return vertices_.carries(v, scene.radius) && norm(from_axis) <= scene.radius + vertices_.lift(v, scene.radius);
    });
}

// Whether an end of the tool has passed through the surface since the last tick.
template <Real Scalar>
bool ContactTracker<Scalar>::sweep_test(const Scene& scene, Contact<Scalar>& contact) const noexcept {
    if (!last_tool_) return false;
    const Scalar side = expected_side();
    const auto through = [&](const Vector3<Scalar>& from, const Vector3<Scalar>& now) {
        const auto hit = scene.tree.first_hit(scene.x, from, now);
        if (hit.triangle == no_index) return false;
        auto passed = contact_where_passed(surface_, scene.x, hit.triangle, hit.barycentric, from, now, side);
        if (std::abs(passed.gap) <= detail::rounding_at(now)) return false;  // it ends on the surface
        if (passed.gap > 0) {
            if (hit.fraction < negligible_part) return false;  // it leaves the surface it was on
            if ((surface_.closed() || side_.known()) && has_passed(scene, hit.triangle, side, from))
                return false;  // it leaves the inside
            // From back to front: a penetration from the other side, in a concave fold or of an open surface.
            passed.normal = -passed.normal;
            passed.gap = -passed.gap;
            if (side_is_open() && was_behind(scene, hit.triangle, side, from)) passed.patch.side = -side;
        }
        const auto end = where_it_ends(scene, passed);
        if (end && end->gap >= 0) return false;  // it has grazed the surface
        contact = end ? *end : passed;
        contact.gap -= scene.radius;
        return true;
    };
    return through(last_tool_->position, scene.tool.position) ||
           (is_shaft(scene.tool) &&
            through(last_tool_->position + last_tool_->axis, scene.tool.position + scene.tool.axis));
}

// A tool that comes in at a small angle touches the surface where it ends, not where it passed: without friction it
// carries nothing along. The contact there; null if it comes in steeply, or ends at another side of a fold.
template <Real Scalar>
std::optional<Contact<Scalar>> ContactTracker<Scalar>::where_it_ends(const Scene& scene,
                                                                     const Contact<Scalar>& passed) const noexcept {
    const Vector3<Scalar>& q = passed.patch.axis_point;
    if (last_.touching() || squared_norm<Scalar>(q - passed.point) < 2 * passed.gap * passed.gap) return std::nullopt;
    const Index f = surface_.walk_to_closest(scene.x, passed.triangle, q);
    auto there = contact_in(surface_, scene.x, f, Tool<Scalar>{.position = q}, Scalar(0), passed.patch.side);
    if (surface_.on_border(f, there.barycentric) || !(dot(there.normal, passed.normal) > 0)) return std::nullopt;
    there.patch.previous_axis_point = there.point + margin_ * there.normal;
    there.patch.tunnelled = true;
    return there;
}

// The contact at triangle `f`. If the tool is behind `f`, it has tunnelled or is outside in a crease.
template <Real Scalar>
void ContactTracker<Scalar>::describe(const Scene& scene, Index f, Contact<Scalar>& contact) const noexcept {
    const auto seen_from = [&](Scalar side) {
        contact = contact_in(surface_, scene.x, f, scene.tool, scene.radius, side);
        // On the surface itself it is not behind.
        return contact.gap < -scene.radius - detail::rounding_at(contact.patch.axis_point);
    };
    const Scalar side = contact.patch.side;
    bool behind = seen_from(side);
    // A shaft beside a border may extend to both sides: its middle in the last tick determines the side.
    const Tool<Scalar>& before = last_tool_ ? *last_tool_ : scene.tool;
    const Vector3<Scalar> middle = before.position + before.axis / 2;
    if (behind && side_is_open() && was_behind(scene, f, side, middle)) behind = seen_from(-1);
    // At more than the radius from the surface the tool does not touch it: `sweep_test` has shown that no end passed.
    if (side_is_open() && contact.gap < -2 * scene.radius) return turn(scene, contact);
    if (side_.known() && contact.patch.side != side_.sign()) {  // beside a border
        contact.patch.side = side_.sign();
        behind = !leaves_border(scene, contact);
        if (behind) turn(scene, contact);
    }
    const bool first_seen_in_shaft = !last_tool_ && is_shaft(scene.tool) &&  // it may pierce the surface
                                     !surface_.closed() && !surface_.on_border(contact.triangle, contact.barycentric);
    // A shaft first seen across a closed surface has come in anywhere: `describe_shaft` finds where it is inside.
    const bool first_seen_across = !last_.touching() && surface_.closed() && pierces(scene, f);
    contact.patch.tunnelled =
        behind && !side_.slid_off() && !first_seen_across &&
        (first_seen_in_shaft || has_passed(scene, contact.triangle, contact.patch.side, contact.patch.axis_point));
    if (behind && !contact.patch.tunnelled) turn(scene, contact);
    if (!contact.patch.tunnelled && is_shaft(scene.tool) && !side_.slid_off() && !leaves_border(scene, contact)) {
        describe_shaft(scene, f, side, contact);
    }
    contact.patch.previous_axis_point =
        (contact.patch.tunnelled ? contact.point : contact.patch.axis_point) + margin_ * contact.normal;
}

// Whether `q` is behind the surface without the tool.
template <Real Scalar>
bool ContactTracker<Scalar>::was_behind(const Scene& scene, Index f, Scalar side,
                                        const Vector3<Scalar>& q) const noexcept {
    return side * at_rest().height(scene.anchors, at_rest().walk_to_closest(scene.anchors, f, q), q) < 0;
}

// If a point of a shaft is behind the surface, makes the contact that of this point. Tests the middle of the part of
// the axis inside and both ends.
template <Real Scalar>
void ContactTracker<Scalar>::describe_shaft(const Scene& scene, Index f, Scalar side,
                                            Contact<Scalar>& contact) const noexcept {
    const auto take_if_behind = [&](const Vector3<Scalar>& q) {
        if (contact.patch.tunnelled || !has_passed(scene, f, side, q)) return;
        const Index g = surface_.walk_to_closest(scene.x, f, q);
        auto there = contact_in(surface_, scene.x, g, Tool<Scalar>{.position = q}, scene.radius, side);
        const bool seen_behind = there.patch.side == side && there.gap < -scene.radius;
        there.patch.side = side;
        if (leaves_border(scene, there)) return;
        if (!seen_behind) turn(scene, there);
        there.patch.tunnelled = true;
        contact = there;
    };
    if (const auto middle = middle_inside(scene, f, side)) take_if_behind(*middle);
    // A shaft with one end behind passes through the surface or around its border.
    const Vector3<Scalar> end = scene.tool.position + scene.tool.axis;
    if (surface_.closed()) {
        if (!pierces(scene, f)) return;
    } else if (!side_.known() || scene.tree.first_hit(scene.x, scene.tool.position, end).triangle == no_index) {
        return;
    }
    take_if_behind(scene.tool.position);
    take_if_behind(end);
}

// If the shaft passes through `f` and out again farther along, returns the point halfway between. Both ends may be
// outside and then do not give the penetration.
template <Real Scalar>
std::optional<Vector3<Scalar>> ContactTracker<Scalar>::middle_inside(const Scene& scene, Index f,
                                                                     Scalar side) const noexcept {
    const Tool<Scalar>& tool = scene.tool;
    const auto hit_in = [&](const Triangle<Scalar>& triangle) {
        return first_hit<Scalar>(triangle, tool.position, tool.position + tool.axis);
    };
    const auto climb = [&](const Triangle<Scalar>& triangle) { return side * dot(area_vector(triangle), tool.axis); };
    const auto triangle = surface_.triangle(scene.x, f);
    const auto here = hit_in(triangle);
    if (!here) return std::nullopt;
    const Scalar inward = climb(triangle) < 0 ? Scalar(1) : Scalar(-1);  // along the axis
    Scalar inside = 2;                                                   // fraction of the axis
    for (const Index g : near_.items()) {
        const auto other = surface_.triangle(scene.x, g);
        if (!(inward * climb(other) > 0)) continue;
        const auto there = hit_in(other);
        const Scalar length = there ? inward * (there->fraction - here->fraction) : Scalar(0);
        if (length > 0) inside = (std::min)(inside, length);
    }
    if (inside > 1) return std::nullopt;
    return tool.position + (here->fraction + inward * inside / 2) * tool.axis;
}

// Whether `q` is behind the surface. The nearest triangle does not decide it: in a concave fold a point outside may be
// behind that triangle. Behind a closed surface the winding number is not 0. Behind an open surface the ray from `q`
// along the outward normal of the rest surface first meets the back of a triangle.
template <Real Scalar>
bool ContactTracker<Scalar>::has_passed(const Scene& scene, Index start, Scalar side,
                                        const Vector3<Scalar>& q) const noexcept {
    if (surface_.closed()) return winding_number(surface_, scene.tree, scene.x, q) != 0;
    const Index f = at_rest().walk_to_closest(scene.anchors, start, q);
    const auto nearest = closest_point(at_rest().triangle(scene.anchors, f), q);
    const Vector3<Scalar> outward = side * at_rest().outward(scene.anchors, f, nearest.barycentric);
    const auto hit = scene.tree.first_hit(scene.x, q, q + 2 * max_axis_distance(scene.tree.box(0), q) * outward);
    if (hit.triangle == no_index) return false;
    return side * dot<Scalar>(area_vector(surface_.triangle(scene.x, hit.triangle)), outward) > 0;
}

template <Real Scalar>
void ContactTracker<Scalar>::gather_from_tree(const Scene& scene) noexcept {
    const auto& tool = scene.tool;
    scene.tree.overlap_capsule(scene.x, tool.position, tool.position + tool.axis, scene.detection_distance,
                               [&](Index f) { queued_.insert(f); });
}

// Adds the queued triangles within detection distance to the local model, and recursively their neighbours.
template <Real Scalar>
void ContactTracker<Scalar>::flood(const Scene& scene) noexcept {
    constexpr auto at_a_time = static_cast<Index>(Lanes<Scalar>::count);
    for (Index examined = 0, spread = 0;;) {
        while (spread < near_.count() && queued_.count() - examined < at_a_time) {
            surface_.across_sides(near_.items()[static_cast<std::size_t>(spread++)],
                                  [&](Index f) { queued_.insert(f); });
        }
        const Index count = (std::min)(at_a_time, queued_.count() - examined);
        if (count == 0) return;
        examine(scene, queued_.items().subspan(static_cast<std::size_t>(examined), static_cast<std::size_t>(count)));
        examined += count;
    }
}

// Adds those of `some` within detection distance to the local model. `some` has at most one triangle a lane.
template <Real Scalar>
void ContactTracker<Scalar>::examine(const Scene& scene, std::span<const Index> some) noexcept {
    std::array<Index, Lanes<Scalar>::count> triangles;
    for (std::size_t i = 0; i < triangles.size(); ++i) triangles[i] = some[(std::min)(i, some.size() - 1)];
    const auto squares = surface_.squared_distances(scene.x, triangles, scene.tool);
    for (std::size_t i = 0; i < some.size(); ++i) {
        const Scalar square = squares[i];
        if (!(square <= scene.detection_distance * scene.detection_distance)) continue;
        if (near_.empty() || square < nearest_square_) {
            nearest_ = some[i];
            nearest_square_ = square;
        }
        near_.insert(some[i]);
    }
}

template <Real Scalar>
void ContactTracker<Scalar>::complete(const Scene& scene, Contact<Scalar>& contact) noexcept {
    // Triangles not yet within detection distance that may approach the tool as the membrane moves.
    near_.insert(contact.triangle);
    surface_.around_corners(contact.triangle, [&](Index f) { near_.insert(f); });
    if (contact.patch.tunnelled) {
        scene.tree.overlap_capsule(scene.x, contact.patch.previous_axis_point, contact.patch.axis_point, Scalar(0),
                                   [&](Index f) { near_.insert(f); });
    }
    rebound_ticks_ = contact.patch.tunnelled ? ticks_after_tunnelling : (std::max)(rebound_ticks_ - 1, 0);
    collect_candidates(rebound_ticks_ > 0 ? candidate_rings_after_tunnelling : candidate_rings);
    listed_.clear();
    for (const Index f : candidates_.items()) listed_.try_push_back({f, surface_.corners(f)});
    contact.patch.closed = surface_.closed();
    contact.patch.radius = scene.radius;
    contact.patch.detection_distance = scene.detection_distance;
    contact.patch.candidates = listed_.items();
    contact.patch.triangles = contact.patch.candidates.first(near_.items().size());
    find_points(scene, contact);
    contact.patch.points = points_.items();
}

// The contact points within detection distance; after tunnelling all points, as the next positions are unknown.
template <Real Scalar>
void ContactTracker<Scalar>::find_points(const Scene& scene, Contact<Scalar>& contact) noexcept {
    points_.clear();
    contact.patch.faces = contact.patch.triangles;
    if (!contact.patch.tunnelled && vertices_.any()) {
        contact.patch.fine_triangles = vertices_.fine();
        find_vertices(scene, contact);
        faces_.clear();
        const auto is_deep = [&, deep = 3 * scene.radius / 4](const std::array<Index, 3>& corners) {
            if (scene.radius + contact.gap >= deep) return false;  // the active triangle is nearest
            const auto nearest = closest_to_axis(triangle_at(scene.x, corners), scene.tool).on_triangle;
            return nearest.squared_distance < deep * deep;
        };
        for (const auto& [f, corners, none] : contact.patch.triangles) {
            if (vertices_.carry_alone(corners, scene.radius) && !is_deep(corners)) continue;
            faces_.try_push_back({f, corners, vertices_.face_lift(corners, scene.radius)});
        }
        contact.patch.faces = faces_.items();
    }
    const auto list = [&](ContactPoint<Scalar> point, double lift) {
        if (!contact.patch.tunnelled && point.gap + scene.radius > scene.detection_distance) return;
        point.lift = static_cast<Scalar>(lift);
        if (!points_.try_push_back(point)) contact.patch.has_all_points = false;
    };
    if (feature_pairs(scene.tool) == 1) return find_points_of_sphere(scene, contact.patch.faces, list);
    for (const auto& face : contact.patch.faces) {
        each_contact_point(face.triangle, face.corners, triangle_at(scene.x, face.corners), scene.tool, scene.radius,
                           [&](const auto& point) { list(point, face.lift); });
    }
}

// The vertices that carry the contact, of all near triangles: a step moves no other one into the tool. Each is a point
// of one of its triangles, with all of the weight.
template <Real Scalar>
void ContactTracker<Scalar>::find_vertices(const Scene& scene, Contact<Scalar>& contact) noexcept {
    touched_.clear();
    for (const auto& listed : contact.patch.triangles) {
        for (const Index v : listed.corners) {
            if (!vertices_.carries(v, scene.radius) || !touched_.insert(v)) continue;
            const Index f = surface_.triangles_of(v).front();
            const auto lift = static_cast<Scalar>(vertices_.lift(v, scene.radius));
            const auto point = vertex_point<Scalar>(v, membrane::point(scene.x, v), f, surface_.corners(f), scene.tool,
                                                    scene.radius, lift);
            if (!points_.try_push_back(point)) contact.patch.has_all_points = false;
        }
    }
}

// The contact points of a sphere, several triangles at a time.
template <Real Scalar>
template <class List>
void ContactTracker<Scalar>::find_points_of_sphere(const Scene& scene, std::span<const ContactTriangle> listed,
                                                   const List& list) const noexcept {
    using Wide = Lanes<Scalar>;
    const Vector3<Scalar>& centre = scene.tool.position;
    std::array<Index, Wide::count> triangles;
    for (std::size_t first = 0; first < listed.size(); first += triangles.size()) {
        for (std::size_t i = 0; i < triangles.size(); ++i) {
            triangles[i] = listed[(std::min)(first + i, listed.size() - 1)].triangle;
        }
        const auto nearest = surface_.closest_points(scene.x, triangles, centre);
        const Vector3<Wide> separation = centre.template cast<Wide>() - nearest.point;
        const Vector3<Wide> normal = direction_or_zero(separation);
        const Wide distance = norm(separation);
        for (std::size_t i = 0; i < (std::min)(triangles.size(), listed.size() - first); ++i) {
            const auto of_lane = [i](const Vector3<Wide>& a) { return Vector3<Scalar>(a[0][i], a[1][i], a[2][i]); };
            const auto& [f, corners, lift] = listed[first + i];
            ContactPoint<Scalar> point{f, 0, corners, of_lane(nearest.barycentric), of_lane(normal)};
            point.gap = distance[i] - scene.radius;
            list(point, lift);
        }
    }
}

// The candidates: the near triangles and `rings` rings around them. The triangles of a vertex form one fan: if not all
// are near, one that is near shares a side with one that is not. So the first ring expands only near triangles with a
// side neighbour that is not near.
template <Real Scalar>
void ContactTracker<Scalar>::collect_candidates(int rings) noexcept {
    candidates_.clear();
    expanded_.clear();
    const auto expand = [&](Index f) {
        for (const Index v : surface_.corners(f)) {
            if (!expanded_.insert(v)) continue;
            for (const Index g : surface_.triangles_of(v)) candidates_.insert(g);
        }
    };
    for (const Index f : near_.items()) candidates_.insert(f);
    for (const Index f : near_.items()) {
        bool inside = true;
        surface_.across_sides(f, [&](Index g) { inside &= near_.contains(g); });
        if (!inside) expand(f);
    }
    for (std::size_t next = near_.items().size(); rings > 1; --rings) {
        for (const std::size_t end = candidates_.items().size(); next < end; ++next) expand(candidates_.items()[next]);
    }
}

// Measures the depth to the nearest triangle of the rest surface, negative outside of it. Beyond the middle of a body
// that triangle is on the opposite wall; then to the nearest one that faces as the wall where the tool entered. Returns
// the largest gap of a membrane that springs back [m]: it does not go past the nearest triangle.
template <Real Scalar>
Scalar ContactTracker<Scalar>::measure_depth(const Scene& scene, Contact<Scalar>& contact) noexcept {
    const std::array<Vector3<Scalar>, 3> probes{scene.tool.position, scene.tool.position + scene.tool.axis,
                                                contact.patch.axis_point};
    const bool below_border = is_below_border(scene, contact);  // there the sign of the height means nothing
    const auto cosine = [&](Index f) { return dot(rest_normal(scene, f), entry_normal_); };
    const auto faces = [&](Index f) { return cosine(f) > alike; };
    const Vector3<Scalar> touched = rest_normal(scene, contact.triangle);
    if (entry_normal_.isZero(0) || (!beyond_middle_ && faces(contact.triangle))) {
        entry_normal_ = mean_touched_normal(scene, touched);
    }
    const auto nearby = near_.items();
    bool beyond = false;
    Scalar rebound = 0;
    contact.depth = std::numeric_limits<Scalar>::lowest();
    for (std::size_t i = 0; i < (is_shaft(scene.tool) ? 3U : 1U); ++i) {
        const Index start = origin_triangles_[i] == no_index ? contact.triangle : origin_triangles_[i];
        Index& f = origin_triangles_[i] = at_rest().walk_to_closest(scene.anchors, start, probes[i]);
        Scalar height = contact.patch.side * at_rest().height(scene.anchors, f, probes[i]);
        if (below_border) height = std::abs(height);
        if (!faces(f) && !(beyond_middle_ && std::any_of(nearby.begin(), nearby.end(), faces))) {
            entry_normal_ = mean_touched_normal(scene, touched);
        }
        const bool is_beside = height > 0 && cosine(f) > -alike;
        Scalar outward = -height;
        if (!below_border && !faces(f) && !is_beside) {
            const Index of_entry =
                at_rest().walk_to_closest(scene.anchors, faces(start) ? start : contact.triangle, probes[i], faces);
            const Scalar entered = contact.patch.side * at_rest().height(scene.anchors, of_entry, probes[i]);
            // A tool that jumps out of a body has gone through it, and one that is farther beyond it than it is thick.
            if ((beyond_middle_ || height <= 0) && height < -entered / 2)
                beyond = true, outward = std::abs(height), f = of_entry, height = entered;
        }
        rebound = (std::max)(rebound, scene.radius + outward);
        if (i < 2 || beyond) contact.depth = (std::max)(contact.depth, scene.radius - height);
    }
    if (is_shaft(scene.tool) && !beyond)
        contact.depth = (std::max)(contact.depth, scene.radius + depth_of_shaft(scene, contact, below_border));
    beyond_middle_ = beyond;
    return rebound;
}

// The depth of the deepest point of a shaft's axis below the rest surface [m], within a thousandth of the margin. In a
// convex body the depth is concave along the axis: between two points it is at most where their tangents meet. Negative
// below a border, where the sign means nothing.
template <Real Scalar>
Scalar ContactTracker<Scalar>::depth_of_shaft(const Scene& scene, const Contact<Scalar>& contact,
                                              bool below_border) const noexcept {
    struct Depth {
        Scalar fraction, depth, slope;
        Index nearest;
    };
    const auto& axis = scene.tool.axis;
    const auto at = [&](Scalar fraction, std::initializer_list<Index> starts) {
        const Vector3<Scalar> q = scene.tool.position + fraction * axis;
        const auto distance = [&](Index f) {
            return closest_point(at_rest().triangle(scene.anchors, f), q).squared_distance;
        };
        Index f = contact.triangle;
        for (const Index start : starts) {
            if (start != no_index && distance(start) < distance(f)) f = start;
        }
        f = at_rest().walk_to_closest(scene.anchors, f, q);
        const auto nearest = closest_point(at_rest().triangle(scene.anchors, f), q);
        const Vector3<Scalar> outward = contact.patch.side * at_rest().outward(scene.anchors, f, nearest.barycentric);
        const Vector3<Scalar> separation = q - nearest.point;
        const Scalar sign = dot(separation, outward) < 0 ? Scalar(-1) : Scalar(1);
        return Depth{fraction, -sign * norm(separation), -dot(axis, direction<Scalar>(sign * separation, outward)), f};
    };
    constexpr int most = 16;
    Depth first = at(0, {origin_triangles_[0]}), last = at(1, {origin_triangles_[1]});
    for (int i = 0; i < most && first.slope > 0 && last.slope < 0; ++i) {
        const Scalar across = first.depth - last.depth - last.slope * (first.fraction - last.fraction);
        const Scalar meet = first.fraction + across / (last.slope - first.slope);
        const Scalar bound = first.depth + first.slope * (meet - first.fraction);
        if (bound <= (std::max)(first.depth, last.depth) + margin_ / 1000) break;
        const bool between = meet > first.fraction && meet < last.fraction;
        const Depth middle = at(between ? meet : (first.fraction + last.fraction) / 2,
                                {first.nearest, last.nearest, origin_triangles_[2]});
        (middle.slope > 0 ? first : last) = middle;
    }
    const Scalar deepest = (std::max)(first.depth, last.depth);
    return below_border ? -std::abs(deepest) : deepest;
}

// The mean normal at rest of the triangles near the tool, without those of an opposite wall. `otherwise`: none is near.
template <Real Scalar>
Vector3<Scalar> ContactTracker<Scalar>::mean_touched_normal(const Scene& scene,
                                                            const Vector3<Scalar>& otherwise) const noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const Index f : near_.items()) {
        const Vector3<Scalar> normal = rest_normal(scene, f);
        if (dot(normal, entry_normal_) > Scalar(-0.5)) sum += normal;
    }
    return direction(sum, otherwise);
}

// Whether no triangle is within two mean edges of the tool.
template <Real Scalar>
bool ContactTracker<Scalar>::is_clear(const Scene& scene) const noexcept {
    bool clear = true;
    const auto& tool = scene.tool;
    const Scalar radius = scene.radius + 2 * surface_.mean_edge();
    scene.tree.overlap_capsule(scene.x, tool.position, tool.position + tool.axis, radius,
                               [&](Index) { clear = false; });
    return clear;
}

// Beside a border the tool may be on either side. The side is certain if the contact is not on a border, or its normal
// is within 60 degrees of the surface's. The tool cannot slide around a border that is not displaced.
template <Real Scalar>
bool ContactTracker<Scalar>::is_side_certain(const Scene& scene, const Contact<Scalar>& contact) const noexcept {
    const auto outward = surface_.outward(scene.x, contact.triangle, contact.barycentric);
    const bool above = contact.patch.side * dot<Scalar>(contact.normal, outward) > Scalar(0.5);
    return above || !surface_.on_border(contact.triangle, contact.barycentric);
}

// Whether the tool is beside a border and below it.
template <Real Scalar>
bool ContactTracker<Scalar>::is_below_border(const Scene& scene, const Contact<Scalar>& contact) const noexcept {
    if (contact.patch.tunnelled || !surface_.on_border(contact.triangle, contact.barycentric)) return false;
    const auto outward = surface_.outward(scene.x, contact.triangle, contact.barycentric);
    return contact.patch.side * dot<Scalar>(contact.normal, outward) < 0;
}

// Whether the contact would pull: the tool is outside the rest surface, and the membrane farther out or pierced.
template <Real Scalar>
bool ContactTracker<Scalar>::is_hooked(const Scene& scene, const Contact<Scalar>& contact) const noexcept {
    const auto overlapped = [&](Index f) {
        const auto before = closest_to_axis(surface_.triangle(scene.anchors, f), scene.tool).on_triangle;
        return before.squared_distance < scene.radius * scene.radius;
    };
    const auto nearby = near_.items();  // a shaft may be inside between the points where its depth is measured
    if (contact.depth > 0 || overlapped(contact.triangle)) return false;
    if (std::any_of(nearby.begin(), nearby.end(), overlapped)) return false;
    const Index f = origin_triangles_[is_shaft(scene.tool) ? 2 : 0];
    const auto nearest = closest_point(at_rest().triangle(scene.anchors, f), contact.patch.axis_point);
    return pierces(scene, contact.triangle) ||
           dot<Scalar>(contact.normal, contact.patch.axis_point - nearest.point) < 0;
}

}  // namespace membrane
