// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <membrane/contact/contact.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/tear/border_flaw.hpp>
#include <membrane/tear/crack_driving_force.hpp>
#include <membrane/tear/ligament.hpp>
#include <membrane/tear/tear_criterion.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/torn_surface.hpp>

/// Tears in the membrane: cuts, and their advance under load.
///
///     auto tear = membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = 1.4e3, .thickness = 12e-6});
///     for (const auto& event : tear.cut_along(path, x)) follow(event, tissue, foundation, solver, tree, tracker);
///     ...
///     const auto report = solver.step(x, dt, tissue, foundation, pull(tool, grasp), tear.ligaments());
///     const auto events = tear.update(x, dt, tissue, foundation);
///     for (const auto& event : events) follow(event, tissue, foundation, solver, tree, tracker);
///     tree.refit(x, report.moved);
namespace membrane {

/// How a tear runs.
struct TearOptions {
    Index max_tips = 16;        ///< capacity
    double patch_radius = 3.5;  ///< where a tip's driving force is found [edges], at least 2; at most to the next tip
    double min_angle = 0.35;    ///< of a triangle that a moved vertex may leave [rad]
    bool move_vertices = true;  ///< onto the tear's direction; if not, it runs along the edges that there are

    /// @throws InvalidInput if a number is out of its range
    void validate() const;
};

/// An end of a tear within the membrane.
template <Real Scalar>
struct TearTip {
    Index vertex = no_index;                                  ///< where it is
    std::array<Index, 2> behind{no_index, no_index};          ///< the vertex behind it and its copy
    Vector3<Scalar> heading = Vector3<Scalar>::Zero();        ///< direction of its last advance at rest
    Scalar advanced = 0;                                      ///< by its last advance [m]
    Vector3<Scalar> driving_force = Vector3<Scalar>::Zero();  ///< by the last update [N]
};

/// Whether a path was cut, or why not.
enum class CutStatus {
    cut,                ///< all of it
    no_path,            ///< fewer than two vertices, one that is none of the mesh, or one twice
    not_joined,         ///< no edge with two triangles joins a vertex to the next one
    crosses_border,     ///< a vertex between the ends is on a border, as that of a tear
    one_edge_within,    ///< a single edge that does not begin at a border cannot open: take two
    reserve_too_small,  ///< the mesh has too few vertices left to double others
};

/// The name of the status, as above.
[[nodiscard]] constexpr std::string_view to_string(CutStatus status) noexcept {
    switch (status) {
        case CutStatus::cut: return "cut";
        case CutStatus::no_path: return "no_path";
        case CutStatus::not_joined: return "not_joined";
        case CutStatus::crosses_border: return "crosses_border";
        case CutStatus::one_edge_within: return "one_edge_within";
        case CutStatus::reserve_too_small: return "reserve_too_small";
    }
    return "";
}

/// Result of `Tearing::cut_along`: the events that parts are to follow, which converts to a span of them. Valid until
/// the tear's next call.
template <Real Scalar>
struct Cut {
    CutStatus status = CutStatus::cut;               ///< whether it was cut, or why there are no events
    std::span<const TearEvent<Scalar>> events = {};  ///< in order

    ///@{
    /// Of the events.
    [[nodiscard]] auto begin() const noexcept { return events.begin(); }
    [[nodiscard]] auto end() const noexcept { return events.end(); }
    [[nodiscard]] std::size_t size() const noexcept { return events.size(); }
    [[nodiscard]] bool empty() const noexcept { return events.empty(); }
    ///@}
};

/// Follows an event with all parts: those that have `reshape` or `split`.
template <Real Scalar, class... Parts>
void follow(const TearEvent<Scalar>& event, Parts&... parts) noexcept {
    const auto apply = [&](auto& part) {
        using Part = std::remove_reference_t<decltype(part)>;
        constexpr bool follows = FollowsSplit<Part> || FollowsMovedVertex<Part, Scalar>;
        constexpr bool has_springs = requires { part.springs_of(Index(0)); };
        static_assert(
            follows || !has_springs,
            "follow: this network (see Part) does not tear: make it a TearableSprings of a mesh with_reserve");
        static_assert(follows || has_springs,
                      "follow: this part (see Part) has neither split(const VertexSplit&) noexcept nor "
                      "reshape(const MovedVertex<Scalar>&) noexcept: leave it out, or give it one");
        if constexpr (FollowsMovedVertex<Part, Scalar>) {
            if (event.moved.vertex != no_index) part.reshape(event.moved);
        }
        if constexpr (FollowsSplit<Part>) {
            if (event.split.vertex != no_index) part.split(event.split);
        }
    };
    (apply(parts), ...);
}

/// Tears of one membrane, along the edges of its triangles.
///
/// A cut starts them; each of its ends within the membrane is a tip. In each tick the configurational force at a tip
/// [Miehe07] says what energy an advance would release, and in which direction most. If the `Criterion` says so, the
/// next vertex in that direction moves onto it, at rest and now, and the edge to it opens: the tip's vertex becomes
/// two, from a reserve (`with_reserve`). A `Ligament` holds the edge together, takes energy as it opens, and becomes
/// weaker while the driving force exceeds the criterion's resistance; the tip goes on when it has failed. A slow load
/// so opens edge after edge at a driving force near the resistance; the more a load exceeds that, the faster a tear
/// runs. Triangles keep their numbers; other parts `follow` the events.
///
/// A flap may pass through the membrane: there is no contact of the membrane with itself. Elements that are no
/// triangles do not count in the driving force; a foundation does, as if its stiffness per area were the same
/// everywhere.
///
/// Online but for the constructor; cost of a tick: that of the forces of some 60 triangles at each tip.
template <Real Scalar, TearCriterion<Scalar> Criterion = EnergyRelease>
class Tearing {
  public:
    using Events = std::span<const TearEvent<Scalar>>;  ///< in order; valid until the next call

    /// Vertices of `mesh` without triangles are the reserve. @throws InvalidInput for options out of their range
    explicit Tearing(const TriangleMesh<Scalar>& mesh, const Criterion& criterion, const TearOptions& options = {});

    /// Cuts along the edges between these vertices, each joined to the next by an edge with two triangles; those
    /// between the ends are not on a border. If `path` is not so, or the reserve too small, nothing is cut: the status
    /// says why. Ends that are not on a border become tips, up to the capacity.
    [[nodiscard]] Cut<Scalar> cut_along(std::span<const Index> path, PointsRef<Scalar> x) noexcept;

    /// The path of two edges through `v`, as nearly as possible along `direction` at rest: where a sharp tool
    /// perforates the membrane. All are `no_index` if there is none.
    [[nodiscard]] std::array<Index, 3> slit_at(Index v, const Vector3<Scalar>& direction) const noexcept;

    /// The path where a sharp tool perforates, for `cut_along`: the slit at the vertex of the contact triangle that is
    /// nearest to the contact point, along `direction`, if the membrane's force on the tool along the contact's normal
    /// is `force` [N] or more. All are `no_index` if the tool does not perforate there. `reaction`: of the step under
    /// this contact.
    [[nodiscard]] std::array<Index, 3> slit_under(const Contact<Scalar>& contact, const Vector3<Scalar>& reaction,
                                                  Scalar force, const Vector3<Scalar>& direction) const noexcept;

    /// The path of a tear that starts at vertex `v` of the membrane's border, for `cut_along`; empty if none starts. A
    /// border tears from a flaw, a cut that may be too small for the mesh, of length `flaw` [m]: if the criterion opens
    /// a tip with the flaw's driving force (see `border_flaw.hpp`). The path goes inward, at right angles to the
    /// border, and is twice as long as the flaw or longer by less than an edge, so that the tear goes on; it ends at a
    /// border, and has 32 edges at most. None starts at a pinned vertex, beside a tip, if a position is not finite or
    /// `flaw` not positive, or if the reserve or the capacity for tips is too small. As of any cut, the energy of its
    /// edges is not in `dissipated`. Valid until the next call. @pre the network has followed all events. Cost: the
    /// triangles around the path.
    template <class Network>
    [[nodiscard]] std::span<const Index> start_at(Index v, Scalar flaw, const ConstPointsRef<Scalar>& x,
                                                  const Network& network) & noexcept;

    /// The forces across opening edges: a constraint of the step.
    [[nodiscard]] LigamentForces<Scalar> ligaments() const noexcept { return {ligaments_.items(), surface_.splits()}; }

    /// After a step of `dt` [s]: edges open, tips advance. `held`: the few vertices on which tools act, as the corners
    /// of a triangle in forceps; they do not count in the driving force.
    template <class Network, class Volume>
    [[nodiscard]] Events update(PointsRef<Scalar> x, Scalar dt, const Network& network, const Volume& volume,
                                std::span<const Index> held = {}) noexcept;

    /// The tips within the membrane.
    [[nodiscard]] std::span<const TearTip<Scalar>> tips() const& noexcept { return tips_.items(); }
    void tips() && = delete;

    /// Triangles and rest positions by now.
    [[nodiscard]] const TornSurface<Scalar>& surface() const& noexcept { return surface_; }
    void surface() && = delete;

    /// Whether a tear did not advance in the last call because the reserve was too small.
    [[nodiscard]] bool reserve_used_up() const noexcept { return used_up_; }

    ///@{
    /// Length torn so far, without cuts [m]; the energy that this took, and what opening edges would give back [J].
    [[nodiscard]] double torn_length() const noexcept { return torn_length_; }
    [[nodiscard]] double dissipated() const noexcept;
    [[nodiscard]] double stored(const ConstPointsRef<Scalar>& x) const noexcept;
    ///@}

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.surface_, self.tips_, self.ligaments_, self.failed_, self.torn_length_, self.used_up_,
              self.is_outer_border_);
    }

  private:
    struct PatchValues {
        Scalar weight;   // in the driving force, 0 to 1
        Scalar density;  // of the foundation's energy [J/m^2]
    };
    [[nodiscard]] CutStatus check_path(std::span<const Index> path) const noexcept;
    void add_tip(Index v, Index behind, Index copy) noexcept;
    [[nodiscard]] bool is_beside_tip(Index v) const noexcept;
    [[nodiscard]] Scalar list_start(const BorderState<Scalar>& border, Index v, Scalar length) noexcept;
    void join_tears(const VertexSplit& split) noexcept;
    void drop_tips() noexcept;
    void set_outer_border(Index copy, Index v) noexcept {
        is_outer_border_[static_cast<std::size_t>(copy)] = is_outer_border_[static_cast<std::size_t>(v)];
    }
    void open_ligaments(const ConstPointsRef<Scalar>& x) noexcept;
    void weaken_ligaments() noexcept;
    [[nodiscard]] bool is_opening_behind(const TearTip<Scalar>& tip) const noexcept {
        const auto all = ligaments_.items();
        return std::any_of(all.begin(), all.end(), [&](const auto& one) { return one.copy == tip.behind[1]; });
    }
    [[nodiscard]] bool has_changed_around(Index v) const noexcept;
    [[nodiscard]] Scalar patch_radius_at(Index tip) const noexcept;
    void list_patch(Index v, Scalar radius) noexcept;
    void weigh_patch(Index tip, Scalar radius, std::span<const Index> held) noexcept;
    template <class Network, class Volume>
    [[nodiscard]] Vector3<Scalar> driving_force_at(Index tip, const ConstPointsRef<Scalar>& x, Scalar dt,
                                                   const Network& network, const Volume& volume,
                                                   std::span<const Index> held) noexcept;
    template <class Volume>
    void find_densities(const ConstPointsRef<Scalar>& x, const Volume& volume) noexcept;
    template <class Volume>
    [[nodiscard]] Vector3<Scalar> foundation_force(const ConstPointsRef<Scalar>& x, Scalar dt,
                                                   const Volume& volume) const noexcept;
    template <class Network>
    void find_tension(TipState<Scalar>& state, Index tip, const ConstPointsRef<Scalar>& x,
                      const Network& network) const noexcept;
    template <class Network>
    [[nodiscard]] bool advance(TearTip<Scalar>& tip, const Vector3<Scalar>& direction, PointsRef<Scalar>& x,
                               const Network& network) noexcept;
    template <class Network>
    void add_ligament(Index v, Index copy, Scalar length, const ConstPointsRef<Scalar>& x,
                      const Network& network) noexcept;

    Criterion criterion_;
    TearOptions options_;
    TornSurface<Scalar> surface_;
    FixedVector<TearTip<Scalar>> tips_;
    std::vector<Vector3<Scalar>> opens_;  // of each tip, where it advances to in this update; 0: nowhere
    FixedVector<Ligament<Scalar>> ligaments_;
    double failed_ = 0, torn_length_ = 0;
    bool used_up_ = false;
    std::vector<unsigned char> is_outer_border_;  // vertices on the border of the membrane before it tore
    IndexSet patch_vertices_, patch_;             // around a tip; triangles
    std::vector<PatchValues> patch_values_;       // of all vertices: those of the patch are valid
    FixedVector<Index> path_;                     // of a start
};

template <Real Scalar, class Criterion>
Tearing(const TriangleMesh<Scalar>&, const Criterion&) -> Tearing<Scalar, Criterion>;
template <Real Scalar, class Criterion>
Tearing(const TriangleMesh<Scalar>&, const Criterion&, const TearOptions&) -> Tearing<Scalar, Criterion>;

inline void TearOptions::validate() const {
    constexpr std::string_view component = "Tearing";
    if (max_tips < 1) refuse(component, "max_tips must be at least 1, got ", max_tips);
    if (!(patch_radius >= 2 && patch_radius <= 100)) {
        refuse(component, "patch_radius must be 2 to 100 [edges], got ", patch_radius);
    }
    if (!(min_angle >= 0 && min_angle < 1)) refuse(component, "min_angle must be 0 to 1 [rad], got ", min_angle);
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
Tearing<Scalar, Criterion>::Tearing(const TriangleMesh<Scalar>& mesh, const Criterion& criterion,
                                    const TearOptions& options)
    : criterion_(criterion),
      options_((options.validate(), options)),
      surface_(mesh),
      tips_(static_cast<std::size_t>(options.max_tips)),
      opens_(tips_.capacity()),
      ligaments_(2 * tips_.capacity()),
      is_outer_border_(static_cast<std::size_t>(mesh.vertex_count())),
      patch_vertices_(mesh.vertex_count()),
      patch_(mesh.triangle_count()),
      patch_values_(is_outer_border_.size()),
      path_(33) {
    if constexpr (requires { criterion.validate(); }) criterion.validate();
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        is_outer_border_[static_cast<std::size_t>(v)] = surface_.adjacency().on_border(v) ? 1 : 0;
    }
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
CutStatus Tearing<Scalar, Criterion>::check_path(std::span<const Index> path) const noexcept {
    const auto vertices = static_cast<Index>(surface_.rest_positions().cols());
    const auto on_border = [&](Index v) { return surface_.adjacency().on_border(v); };
    if (path.size() < 2) return CutStatus::no_path;
    for (auto v = path.begin(); v != path.end(); ++v) {
        if (*v < 0 || *v >= vertices || std::find(path.begin(), v, *v) != v) return CutStatus::no_path;
    }
    for (std::size_t i = 1; i < path.size(); ++i) {
        if (!surface_.has_inner_edge(path[i - 1], path[i])) return CutStatus::not_joined;
        if (i + 1 < path.size() && on_border(path[i])) return CutStatus::crosses_border;
    }
    const bool opens = path.size() > 2 || on_border(path[0]) || on_border(path[1]);
    return opens ? CutStatus::cut : CutStatus::one_edge_within;
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
Cut<Scalar> Tearing<Scalar, Criterion>::cut_along(std::span<const Index> path, PointsRef<Scalar> x) noexcept {
    surface_.begin();
    used_up_ = false;
    const CutStatus status = check_path(path);
    if (status != CutStatus::cut) return {status};
    const std::size_t last = path.size() - 1;
    const bool from_border = surface_.adjacency().on_border(path[0]),
               to_border = surface_.adjacency().on_border(path[last]);
    const std::size_t needed = last - 1 + (from_border ? 1 : 0) + (to_border ? 1 : 0);
    used_up_ = needed > static_cast<std::size_t>(surface_.reserve());
    if (used_up_) return {CutStatus::reserve_too_small};
    const auto split = [&](std::size_t i, Index out, Index back) {
        const Index copy = surface_.split(x, path[i], out, back);
        if (copy == no_index) return copy;
        set_outer_border(copy, path[i]);
        join_tears(surface_.events().back().split);
        return copy;
    };
    Index first = no_index, copy = no_index;
    if (from_border) first = copy = split(0, path[1], no_index);
    for (std::size_t i = 1; i < last; ++i) {
        copy = split(i, path[i + 1], path[i - 1]);
        if (first == no_index) first = copy;
    }
    const Index at_border = to_border ? split(last, path[last - 1], no_index) : no_index;
    drop_tips();
    if (!from_border) add_tip(path[0], path[1], first == no_index ? at_border : first);
    if (!to_border) add_tip(path[last], path[last - 1], copy);
    return {status, surface_.events()};
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
void Tearing<Scalar, Criterion>::add_tip(Index v, Index behind, Index copy) noexcept {
    const auto& rest = surface_.rest_positions();
    const Vector3<Scalar> edge = point(rest, v) - point(rest, behind);
    tips_.try_push_back({v, {behind, copy}, direction_or_zero(edge), norm(edge)});
}

// A tear runs into the border at a vertex. If that is the tip of another one, there is no tip any more; if it is beside
// a tip, the side of the tear is the vertex that its triangle has from now on.
template <Real Scalar, TearCriterion<Scalar> Criterion>
void Tearing<Scalar, Criterion>::join_tears(const VertexSplit& split) noexcept {
    for (auto& tip : tips_.items()) {
        if (tip.vertex == split.vertex) tip.vertex = no_index;
        const auto before = tip.behind;
        const bool takes_side = std::any_of(split.corners.begin(), split.corners.end(), [&](const auto& corners) {
            return std::find(corners.begin(), corners.end(), tip.vertex) != corners.end();
        });
        if (takes_side) split.replace_in(tip.behind);
        for (auto& ligament : ligaments_.items()) {
            if (ligament.vertex == before[0] && ligament.copy == before[1]) {
                ligament.vertex = tip.behind[0];
                ligament.copy = tip.behind[1];
            }
        }
    }
}

// Those that have reached a border.
template <Real Scalar, TearCriterion<Scalar> Criterion>
void Tearing<Scalar, Criterion>::drop_tips() noexcept {
    const auto all = tips_.items();
    const auto end = std::remove_if(all.begin(), all.end(), [](const auto& tip) { return tip.vertex == no_index; });
    tips_.truncate(static_cast<std::size_t>(end - all.begin()));
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
std::array<Index, 3> Tearing<Scalar, Criterion>::slit_at(Index v, const Vector3<Scalar>& direction) const noexcept {
    const std::array<Index, 3> none{no_index, no_index, no_index};
    if (v < 0 || v >= surface_.rest_positions().cols() || surface_.adjacency().on_border(v)) return none;
    const Index ahead = surface_.nearest_in_direction(v, direction);
    const Index behind = surface_.nearest_in_direction(v, -direction);
    return ahead == no_index || behind == no_index ? none : std::array<Index, 3>{behind, v, ahead};
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
std::array<Index, 3> Tearing<Scalar, Criterion>::slit_under(const Contact<Scalar>& contact,
                                                            const Vector3<Scalar>& reaction, Scalar force,
                                                            const Vector3<Scalar>& direction) const noexcept {
    const auto normal_force = dot(reaction, contact.normal);
    if (!contact.touching() || !is_finite(normal_force) || !is_finite(force) || !is_finite(contact.barycentric) ||
        !(normal_force >= force)) {
        return {no_index, no_index, no_index};
    }
    const std::array<Scalar, 3> weights{contact.barycentric[0], contact.barycentric[1], contact.barycentric[2]};
    const auto largest = std::max_element(weights.begin(), weights.end()) - weights.begin();
    return slit_at(contact.corners[static_cast<std::size_t>(largest)], direction);
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
bool Tearing<Scalar, Criterion>::is_beside_tip(Index v) const noexcept {
    const auto tips = tips_.items();
    return std::any_of(tips.begin(), tips.end(), [v](const auto& tip) {
        return tip.vertex == v || std::find(tip.behind.begin(), tip.behind.end(), v) != tip.behind.end();
    });
}

// Lists the vertices inward from `v` to a distance of `length` at least, or to the next border. Returns the distance.
template <Real Scalar, TearCriterion<Scalar> Criterion>
Scalar Tearing<Scalar, Criterion>::list_start(const BorderState<Scalar>& border, Index v, Scalar length) noexcept {
    const auto& rest = surface_.rest_positions();
    const Vector3<Scalar> from = point(rest, v);
    Scalar distance = 0;
    path_.clear();
    path_.try_push_back(v);
    while (distance < length) {
        const Vector3<Scalar> at = point(rest, path_.items().back()) - from;
        const Vector3<Scalar> ahead = distance * border.inward - at + surface_.mean_edge(v) * border.inward;
        const Index next = surface_.nearest_in_direction(path_.items().back(), ahead);
        if (next == no_index) break;
        const auto further = dot<Scalar>(point(rest, next) - from, border.inward);
        if (!(further > distance) || !path_.try_push_back(next)) break;
        distance = further;
        if (surface_.adjacency().on_border(next)) break;
    }
    return distance;
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
template <class Network>
std::span<const Index> Tearing<Scalar, Criterion>::start_at(Index v, Scalar flaw, const ConstPointsRef<Scalar>& x,
                                                            const Network& network) & noexcept {
    used_up_ = false;
    if (v < 0 || v >= surface_.rest_positions().cols() || !(is_finite(flaw) && flaw > 0)) return {};
    if (!surface_.adjacency().on_border(v) || is_outer_border_[static_cast<std::size_t>(v)] == 0) return {};
    if (network.pinned(v) || is_beside_tip(v) || tips_.size() == tips_.capacity()) return {};
    const auto border = border_state(surface_, v, x, network);
    const Scalar length = list_start(border, v, 2 * flaw);
    const Scalar force = flaw_driving_force(border, (std::min)(flaw, length));
    if (!is_finite(force) || !(force > 0)) return {};
    const TipState<Scalar> state{force * border.inward, border.tension, border.along, border.inward};
    if (!criterion_.opens(state)) return {};
    const auto path = std::as_const(path_).items();
    const std::size_t needed = path.size() - (surface_.adjacency().on_border(path.back()) ? 0 : 1);
    used_up_ = needed > static_cast<std::size_t>(surface_.reserve());
    return used_up_ ? std::span<const Index>() : path;
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
void Tearing<Scalar, Criterion>::open_ligaments(const ConstPointsRef<Scalar>& x) noexcept {
    for (auto& ligament : ligaments_.items()) {
        ligament.open(norm<Scalar>(point(x, ligament.vertex) - point(x, ligament.copy)));
    }
}

// By the driving force of the tip ahead of the edge, or slowly if that has met a border. Drops what has failed.
template <Real Scalar, TearCriterion<Scalar> Criterion>
void Tearing<Scalar, Criterion>::weaken_ligaments() noexcept {
    constexpr auto without_tip = Scalar(0.1);
    const auto resistance = static_cast<Scalar>(criterion_.resistance());
    const auto all = ligaments_.items();
    const auto tips = tips_.items();
    std::size_t left = 0;
    for (auto& ligament : all) {
        const auto tip =
            std::find_if(tips.begin(), tips.end(), [&](const auto& each) { return each.behind[1] == ligament.copy; });
        ligament.weaken(tip == tips.end() ? without_tip : norm(tip->driving_force) / resistance - 1);
        if (ligament.failed()) {
            failed_ += static_cast<double>(ligament.dissipated + ligament.stored(ligament.opening));
        } else {
            all[left++] = ligament;
        }
    }
    ligaments_.truncate(left);
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
double Tearing<Scalar, Criterion>::dissipated() const noexcept {
    double sum = failed_;
    for (const auto& ligament : ligaments_.items()) sum += static_cast<double>(ligament.dissipated);
    return sum;
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
double Tearing<Scalar, Criterion>::stored(const ConstPointsRef<Scalar>& x) const noexcept {
    double sum = 0;
    for (const auto& ligament : ligaments_.items()) {
        sum += static_cast<double>(ligament.stored(norm<Scalar>(point(x, ligament.vertex) - point(x, ligament.copy))));
    }
    return sum;
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
template <class Network, class Volume>
auto Tearing<Scalar, Criterion>::update(PointsRef<Scalar> x, Scalar dt, const Network& network, const Volume& volume,
                                        std::span<const Index> held) noexcept -> Events {
    surface_.begin();
    used_up_ = false;
    open_ligaments(x);
    const auto all = tips_.items();
    for (auto& tip : all) tip.driving_force = driving_force_at(tip.vertex, x, dt, network, volume, held);
    weaken_ligaments();
    // All before any advances: the network has not followed until the next step.
    for (std::size_t i = 0; i < all.size(); ++i) {
        const auto& tip = all[i];
        opens_[i] = Vector3<Scalar>::Zero();
        if (is_opening_behind(tip)) continue;
        TipState<Scalar> state{tip.driving_force, 0, Vector3<Scalar>::Zero(), tip.heading};
        find_tension(state, tip.vertex, x, network);
        const Vector3<Scalar> direction = criterion_.direction(state);
        if (is_finite(direction) && criterion_.opens(state)) opens_[i] = direction;
    }
    for (std::size_t i = 0; i < all.size(); ++i) {
        auto& tip = all[i];
        if (tip.vertex == no_index || opens_[i] == Vector3<Scalar>::Zero() || has_changed_around(tip.vertex)) continue;
        if (!advance(tip, opens_[i], x, network)) tip.vertex = no_index;
    }
    drop_tips();
    return surface_.events();
}

// Whether a corner of a triangle around `v` has doubled or moved since `begin`: the network does not know it. Whichever
// side of a tear the triangle is on: the copy could as well be on the other one.
template <Real Scalar, TearCriterion<Scalar> Criterion>
bool Tearing<Scalar, Criterion>::has_changed_around(Index v) const noexcept {
    const auto around = surface_.adjacency().triangles_of(v);
    const auto is_around = [&](Index w) {
        return w != no_index && std::any_of(around.begin(), around.end(), [&](Index f) {
                   const auto corners = surface_.corners(f);
                   return std::find(corners.begin(), corners.end(), w) != corners.end();
               });
    };
    const auto events = surface_.events();
    return std::any_of(events.begin(), events.end(), [&](const auto& event) {
        return is_around(event.split.vertex) || is_around(event.split.copy) || is_around(event.moved.vertex);
    });
}

// The triangles with a corner within `radius` of vertex `v` at rest [m], over triangles that share a corner. A vertex
// at the radius is not within it, however that is rounded: it may be the next tip, which joins both sides of its tear.
template <Real Scalar, TearCriterion<Scalar> Criterion>
void Tearing<Scalar, Criterion>::list_patch(Index v, Scalar radius) noexcept {
    patch_.clear();
    patch_vertices_.clear();
    patch_vertices_.insert(v);
    const auto& rest = surface_.rest_positions();
    const Scalar squared_limit = Scalar(0.999) * (radius * radius);
    for (std::size_t i = 0; i < patch_vertices_.items().size(); ++i) {
        const Index at = patch_vertices_.items()[i];
        if (!(squared_norm<Scalar>(point(rest, at) - point(rest, v)) < squared_limit)) continue;
        for (const Index f : surface_.adjacency().triangles_of(at)) {
            if (!patch_.insert(f)) continue;
            for (const Index corner : surface_.corners(f)) patch_vertices_.insert(corner);
        }
    }
}

// Not as far as to another tip, whose driving force would be added: that of the other end of a short slit is opposite.
template <Real Scalar, TearCriterion<Scalar> Criterion>
Scalar Tearing<Scalar, Criterion>::patch_radius_at(Index tip) const noexcept {
    const auto& rest = surface_.rest_positions();
    const Scalar edge = surface_.mean_edge(tip);
    Scalar radius = static_cast<Scalar>(options_.patch_radius) * edge;
    for (const auto& other : tips_.items()) {
        if (other.vertex == tip || other.vertex == no_index) continue;
        const auto distance = norm<Scalar>(point(rest, other.vertex) - point(rest, tip));
        radius = (std::min)(radius, (std::max)(distance, edge));
    }
    return radius;
}

// The configurational force of the patch: of all its vertices, those nearer to the tip in full, those farther away
// less. A foundation's anchors move with the rest positions, and its energy is in proportion to the area.
template <Real Scalar, TearCriterion<Scalar> Criterion>
template <class Network, class Volume>
Vector3<Scalar> Tearing<Scalar, Criterion>::driving_force_at(Index tip, const ConstPointsRef<Scalar>& x, Scalar dt,
                                                             const Network& network, const Volume& volume,
                                                             std::span<const Index> held) noexcept {
    const Scalar radius = patch_radius_at(tip);
    list_patch(tip, radius);
    weigh_patch(tip, radius, held);
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    if constexpr (!std::same_as<Volume, NoFoundation>) sum -= foundation_force(x, dt, volume);
    if constexpr (requires { volume.energy(tip, point(x, tip)); }) find_densities(x, volume);
    for (const Index f : patch_.items()) {
        const auto corners = surface_.corners(f);
        std::array<Scalar, 3> weights;
        Scalar density = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            const PatchValues& values = patch_values_[static_cast<std::size_t>(corners[k])];
            weights[k] = values.weight;
            density += values.density;
        }
        if (weights[0] == weights[1] && weights[1] == weights[2]) continue;  // the three forces add up to zero
        auto response = network.triangle_response(f, corners, x);
        if (density > 0) response.energy += surface_.rest_area(f) * density;
        const auto at_rest = surface_.corners_at(surface_.rest_positions(), f);
        sum += configurational_force(at_rest, surface_.corners_at(x, f), response, weights);
    }
    const Vector3<Scalar> normal = surface_.rest_normal(tip);
    return sum - dot(sum, normal) * normal;
}

// The weight of a vertex on the membrane's own border is zero: the tear does not move it.
template <Real Scalar, TearCriterion<Scalar> Criterion>
void Tearing<Scalar, Criterion>::weigh_patch(Index tip, Scalar radius, std::span<const Index> held) noexcept {
    const auto& rest = surface_.rest_positions();
    for (const Index v : patch_vertices_.items()) {
        const bool is_held = v != tip && std::find(held.begin(), held.end(), v) != held.end();
        const bool counts = is_outer_border_[static_cast<std::size_t>(v)] == 0 && !is_held;
        const auto distance = norm<Scalar>(point(rest, v) - point(rest, tip));
        patch_values_[static_cast<std::size_t>(v)] = {
            counts ? std::clamp(2 - 2 * distance / radius, Scalar(0), Scalar(1)) : Scalar(0), 0};
    }
}

template <Real Scalar, TearCriterion<Scalar> Criterion>
template <class Volume>
void Tearing<Scalar, Criterion>::find_densities(const ConstPointsRef<Scalar>& x, const Volume& volume) noexcept {
    for (const Index v : patch_vertices_.items()) {
        const auto energy = volume.energy(v, point(x, v));
        if (energy > 0) patch_values_[static_cast<std::size_t>(v)].density = energy / surface_.area_around(v);
    }
}

// The weighted forces of a foundation, turned as at rest.
template <Real Scalar, TearCriterion<Scalar> Criterion>
template <class Volume>
Vector3<Scalar> Tearing<Scalar, Criterion>::foundation_force(const ConstPointsRef<Scalar>& x, Scalar dt,
                                                             const Volume& volume) const noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const Index v : patch_vertices_.items()) {
        const Scalar weight = patch_values_[static_cast<std::size_t>(v)].weight;
        if (!(weight > 0)) continue;
        const Vector3<Scalar> at = point(x, v);
        Vector3<Scalar> force = volume.force_on(v, at, at, dt).force;
        if constexpr (requires { volume.body(); }) {
            force = RigidFrame<Scalar>{.rotation = volume.body().rotation_at(v)}.vector_to_body(force);
        }
        sum += weight * force;
    }
    return sum;
}

// The largest principal value of the mean of the squared tensions, in the plane of the triangles around the tip.
template <Real Scalar, TearCriterion<Scalar> Criterion>
template <class Network>
void Tearing<Scalar, Criterion>::find_tension(TipState<Scalar>& state, Index tip, const ConstPointsRef<Scalar>& x,
                                              const Network& network) const noexcept {
    Symmetric3<Scalar> squares;
    Scalar area = 0;
    for (const Index f : surface_.adjacency().triangles_of(tip)) {
        const auto at_rest = surface_.corners_at(surface_.rest_positions(), f);
        const RestTriangle<Scalar> shape(at_rest);
        area += shape.area;
        squares += shape.area * squared_tension(shape, at_rest, network.triangle_response(f, surface_.corners(f), x));
    }
    if (!(area > 0)) return;
    const Vector3<Scalar> normal = surface_.rest_normal(tip);
    const Vector3<Scalar> ahead = direction_or_zero<Scalar>(state.heading - dot(state.heading, normal) * normal);
    const Vector3<Scalar> aside = cross(normal, ahead);
    const auto along = dot<Scalar>(ahead, squares * ahead), across = dot<Scalar>(aside, squares * aside);
    const auto twice = 2 * dot<Scalar>(ahead, squares * aside), angle = std::atan2(twice, along - across) / 2;
    state.tension_direction = std::cos(angle) * ahead + std::sin(angle) * aside;
    state.tension = std::sqrt((along + across + std::hypot(twice, along - across)) / (2 * area));
}

// Opens the edge from the tip that is nearest to the direction. Returns whether the tip is still within the membrane.
template <Real Scalar, TearCriterion<Scalar> Criterion>
template <class Network>
bool Tearing<Scalar, Criterion>::advance(TearTip<Scalar>& tip, const Vector3<Scalar>& direction, PointsRef<Scalar>& x,
                                         const Network& network) noexcept {
    const auto& rest = surface_.rest_positions();
    const Index v = tip.vertex, next = surface_.nearest_in_direction(v, direction);
    if (next == no_index) return true;
    const bool reaches_border = surface_.adjacency().on_border(next);
    if (surface_.reserve() < (reaches_border ? 2 : 1)) {
        used_up_ = true;
        return true;
    }
    const Vector3<Scalar> before = point(x, next);
    if (options_.move_vertices && !reaches_border && !network.pinned(next)) {
        const Vector3<Scalar> ahead = direction_or_zero(direction), from = point(rest, v);
        const Vector3<Scalar> place = from + dot<Scalar>(point(rest, next) - from, ahead) * ahead;
        surface_.move_vertex(x, next, place, static_cast<Scalar>(options_.min_angle));
    }
    const Vector3<Scalar> edge = point(rest, next) - point(rest, v);
    const Index copy = surface_.split(x, v, next);
    if (copy == no_index) return false;
    set_outer_border(copy, v);
    const Scalar length = norm(edge);
    torn_length_ += static_cast<double>(length);
    const Vector3<Scalar> moved = point(x, next);
    set_point(x, next, before);  // the network does not know that it has moved
    add_ligament(v, copy, length, x, network);
    set_point(x, next, moved);
    if (reaches_border) {
        const Index other = surface_.split(x, next, v);
        if (other == no_index) return false;
        set_outer_border(other, next);
        join_tears(surface_.events().back().split);
        return false;
    }
    tip.vertex = next;
    tip.heading = direction_or_zero(edge);
    tip.behind = {v, copy};
    tip.advanced = length;
    return true;
}

// It begins with the force that the membrane has transmitted through the vertex.
template <Real Scalar, TearCriterion<Scalar> Criterion>
template <class Network>
void Tearing<Scalar, Criterion>::add_ligament(Index v, Index copy, Scalar length, const ConstPointsRef<Scalar>& x,
                                              const Network& network) noexcept {
    const auto energy = static_cast<Scalar>(criterion_.resistance()) * length;
    if (!(energy > 0)) return;
    const auto forces_on = [&](Index end, const VertexSplit& split) {
        Vector3<Scalar> sum = Vector3<Scalar>::Zero();
        for (const Index f : surface_.adjacency().triangles_of(end)) {
            const auto corners = split.takes(f) ? split.corners_of(f) : surface_.corners(f);
            const auto response = network.triangle_response(f, corners, x);
            for (std::size_t k = 0; k < 3; ++k) {
                if (corners[k] == split.vertex) sum += response.force[k];
            }
        }
        return sum;
    };
    const VertexSplit& split = surface_.events().back().split;
    const auto share = static_cast<Scalar>(split.area_share);
    const Vector3<Scalar> force = (1 - share) * forces_on(copy, split) - share * forces_on(v, split);
    const auto strength = norm(force);
    if (!(strength > 0) || !is_finite(force)) return;
    constexpr auto yields = Scalar(0.98);  // of the membrane's force: it opens at once
    ligaments_.try_push_back({v, copy, yields * force, energy, yields * strength});
}

}  // namespace membrane
