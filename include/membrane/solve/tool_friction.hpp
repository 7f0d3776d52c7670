// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <utility>

#include <membrane/core/check.hpp>
#include <membrane/core/fixed_vector.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/vertex_split.hpp>

/// Coulomb friction between a tool and the membrane: the tool drags the tissue along.
///
///     auto friction = membrane::ToolFriction<double>({.coefficient = 0.3});
///     const auto contact = tracker.update(tree, x, tool);
///     const auto report  = solver.step(x, dt, network, foundation, friction.press(tool, contact));
namespace membrane {

/// Options of `ToolFriction`.
struct ToolFrictionOptions {
    double coefficient;         ///< of Coulomb friction: largest ratio of tangential to normal force, at most 10
    Index max_vertices = 4096;  ///< capacity: corners of contact points; of more, those last in order have no friction

    /// @throws InvalidInput if a number is out of its range
    void validate() const;
};

/// A vertex of the membrane that the tool holds, and the friction force on it.
template <Real Scalar>
struct StickingVertex {
    Index vertex = no_index;                                   ///< a corner of a contact point
    Scalar along = 0;                                          ///< of its place on the tool: fraction of the axis
    Vector3<Scalar> offset = Vector3<Scalar>::Zero();          ///< from there to the vertex [m], see `reshape`
    Vector3<Scalar> force = Vector3<Scalar>::Zero();           ///< of friction on the vertex [N]
    Vector3<Scalar> sticking_force = Vector3<Scalar>::Zero();  ///< that would hold it, by the last pass [N]
    Vector3<Scalar> normal_force = Vector3<Scalar>::Zero();    ///< of the contact points on it, by their weights [N]
};

template <Real Scalar>
class ToolFriction;

/// `ToolContact` with friction: made by `ToolFriction::press`.
template <Real Scalar>
struct FrictionalContact {
    ToolContact<Scalar> normal;      ///< without friction
    ToolFriction<Scalar>* friction;  ///< of this tool; must outlive the step

    ///@{
    /// As `Constraint` requires. The reaction is the sum of normal and friction forces.
    [[nodiscard]] bool valid() const noexcept { return normal.valid(); }
    [[nodiscard]] DrivingInput<Scalar> driving_input() const noexcept { return normal.driving_input(); }
    void begin(ConstraintContext<Scalar>& context) const noexcept {
        normal.begin(context);
        friction->begin(context, normal.tool);
    }
    bool enforce(ConstraintContext<Scalar>& context) const noexcept {
        if (!normal.contact.touching()) return false;
        const bool slipped = friction->solve(context, normal.tool);
        const bool pressed = normal.enforce(context);
        friction->limit(context);
        return slipped || pressed;
    }
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& context) const noexcept {
        return normal.reaction(context) + friction->reaction();
    }
    void end(const ConstraintContext<Scalar>& context) const noexcept { friction->end(context, normal.tool); }
    ///@}
};

/// Friction of one tool, and what it keeps from tick to tick. The tool holds the corners of its contact points: a force
/// along the surface keeps each vertex where it is on the tool, as long as that takes at most `coefficient` times the
/// normal force on the vertex; else it slips, against that force: the exact cone. The forces are found within the step,
/// with all others, by projected Gauss-Seidel. Friction acts on vertices and not at contact points, since triangles in
/// contact share vertices: the normal force on a vertex is unique, its division among the contact points is not.
///
/// Under a tool at rest the membrane does not creep: places are kept, and not displacements. It may where friction
/// compresses the membrane beyond its buckling load: wrinkles under the tool have no equilibrium that a step converges
/// to. Coefficients of 1 do that, unless the membrane is stretched or resists bending.
///
/// The tool does not rotate: a shaft that turns drags as if it were shifted. A vertex that comes into contact is held
/// from then on. Fixed vertices take no friction. `ContactFriction` adds friction to the hand's force alone; with this
/// part the reaction has it. `equilibrium` and error bounds do not know it.
///
/// A step that is refused leaves it unchanged, to the bit.
///
/// Online, but for the constructor. Cost: n log n in each sweep, for n contact points.
template <Real Scalar>
class ToolFriction {
  public:
    /// Allocates. @throws InvalidInput if an option is out of its range
    explicit ToolFriction(const ToolFrictionOptions& options)
        : coefficient_((options.validate(), static_cast<Scalar>(options.coefficient))),
          vertices_(static_cast<std::size_t>(options.max_vertices)),
          kept_(vertices_),
          corners_(3 * vertices_.capacity()) {}

    /// The tool presses at its contact, as by `membrane::press`, with friction. Forceps that hold a grasp do not press,
    /// and forget all places. In one step at most once; must outlive the step.
    [[nodiscard]] FrictionalContact<Scalar> press(const Tool<Scalar>& tool, const Contact<Scalar>& contact,
                                                  const Grasp<Scalar>& grasp = {}) noexcept {
        return {membrane::press(tool, contact, grasp), this};
    }

    /// The vertices in contact in the last step that are not fixed, with their friction, in increasing order.
    [[nodiscard]] std::span<const StickingVertex<Scalar>> vertices() const& noexcept { return kept_.items(); }
    void vertices() && = delete;

    /// Whether a vertex with a normal force slips in the last step.
    [[nodiscard]] bool slips() const noexcept {
        return std::any_of(vertices().begin(), vertices().end(),
                           [this](const Vertex& v) { return squared_norm(v.normal_force) > 0 && is_at_limit(v); });
    }

    ///@{
    /// A vertex becomes two, which are held at the same place and share the forces; beyond the capacity the copy is not
    /// held. A vertex moves at rest, and is held where it is at the next step, by the same force; until then its offset
    /// is not finite. Online. Cost: linear in the vertices in contact.
    void split(const VertexSplit& split) noexcept;
    void reshape(const MovedVertex<Scalar>& moved) noexcept {
        constexpr Scalar anew = std::numeric_limits<Scalar>::quiet_NaN();
        if (auto* const v = find(kept_.items(), moved.vertex); v != nullptr) v->offset = {anew, anew, anew};
    }
    ///@}

    /// Energy that slip has taken so far: friction times the distance that each vertex has slipped on the tool [J].
    [[nodiscard]] double dissipated() const noexcept { return dissipated_; }

    /// As new. Cost: O(1).
    void reset() noexcept {
        kept_.clear();
        dissipated_ = 0;
    }

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.kept_, self.dissipated_);
    }

  private:
    friend FrictionalContact<Scalar>;
    using Context = ConstraintContext<Scalar>;
    using Vertex = StickingVertex<Scalar>;

    void begin(Context& context, const Tool<Scalar>& tool) noexcept;
    bool solve(Context& context, const Tool<Scalar>& tool) noexcept;
    void limit(Context& context) noexcept;
    [[nodiscard]] Vector3<Scalar> reaction() const noexcept;
    void end(const Context& context, const Tool<Scalar>& tool) noexcept;

    void list_corners(const Context& context) noexcept;
    void read_normal_forces(const Context& context) noexcept;
    [[nodiscard]] static auto not_less(std::span<Vertex> vertices, Index v) noexcept {
        return std::lower_bound(vertices.begin(), vertices.end(), v,
                                [](const Vertex& one, Index other) { return one.vertex < other; });
    }
    [[nodiscard]] static Vertex* find(std::span<Vertex> vertices, Index v) noexcept {
        const auto found = not_less(vertices, v);
        return found != vertices.end() && found->vertex == v ? &*found : nullptr;
    }
    [[nodiscard]] Scalar stick(Context& context, const Tool<Scalar>& tool, Vertex& v) const noexcept;
    [[nodiscard]] static Vector3<Scalar> tangential(const Vector3<Scalar>& vector, const Vertex& v) noexcept {
        const Vector3<Scalar> normal = direction_or_zero(v.normal_force);
        return vector - dot(vector, normal) * normal;
    }
    [[nodiscard]] Vector3<Scalar> limited(const Vector3<Scalar>& force, const Vertex& v) const noexcept;
    [[nodiscard]] bool is_at_limit(const Vertex& v) const noexcept {
        constexpr Scalar rounding = Scalar(64) * std::numeric_limits<Scalar>::epsilon();
        return norm(v.force) >= coefficient_ * norm(v.normal_force) * (1 - rounding);
    }
    [[nodiscard]] static Vector3<Scalar> on_tool(const Tool<Scalar>& tool, const Vertex& v) noexcept {
        return tool.position + v.along * tool.axis;
    }
    // Lets `tool` hold the vertex at `position`.
    static void hold(Vertex& v, const Vector3<Scalar>& position, const Tool<Scalar>& tool) noexcept;

    Scalar coefficient_;
    FixedVector<Vertex> vertices_, kept_;  // of this step; of the last one
    FixedVector<Index> corners_;           // of the contact points, each once
    double dissipated_ = 0;
};

inline void ToolFrictionOptions::validate() const {
    constexpr std::string_view component = "ToolFriction";
    detail::check_option(component, coefficient, "coefficient", "1");
    if (coefficient > 10) refuse(component, "coefficient must be at most 10, got ", coefficient);
    if (max_vertices < 1) refuse(component, "max_vertices must be at least 1, got ", max_vertices);
}

template <Real Scalar>
void ToolFriction<Scalar>::split(const VertexSplit& split) noexcept {
    auto* const v = find(kept_.items(), split.vertex);
    if (v == nullptr) return;
    Vertex copy = *v;
    copy.vertex = split.copy;
    const auto share = static_cast<Scalar>(split.area_share);
    for (auto force : {&Vertex::force, &Vertex::sticking_force, &Vertex::normal_force}) {
        copy.*force = share * (v->*force);
        v->*force -= copy.*force;
    }
    if (!kept_.try_push_back(copy)) return;
    const auto all = kept_.items();
    std::rotate(not_less(all.first(all.size() - 1), copy.vertex), all.end() - 1, all.end());
}

template <Real Scalar>
void ToolFriction<Scalar>::list_corners(const Context& context) noexcept {
    corners_.clear();
    for (const auto& point : context.points()) {
        for (const Index v : point.vertices()) {
            if (!corners_.try_push_back(v)) break;
        }
    }
    const auto all = corners_.items();
    std::sort(all.begin(), all.end());
    corners_.truncate(static_cast<std::size_t>(std::unique(all.begin(), all.end()) - all.begin()));
}

// Holds the vertices of this step, and applies their forces of the last step.
template <Real Scalar>
void ToolFriction<Scalar>::begin(Context& context, const Tool<Scalar>& tool) noexcept {
    list_corners(context);
    vertices_.clear();
    for (const Index corner : corners_.items()) {
        if (context.fixed(corner)) continue;
        const auto* const before = find(kept_.items(), corner);
        const bool is_kept = before != nullptr && is_finite(before->force);
        Vertex v = is_kept ? *before : Vertex{.vertex = corner};
        if (!is_kept || !is_finite(v.offset)) hold(v, context.start(corner), tool);
        if (!vertices_.try_push_back(v)) break;
    }
    read_normal_forces(context);
    for (Vertex& v : vertices_.items()) {
        v.force = v.sticking_force = limited(v.force, v);
        context.step().add_force(v.vertex, v.force);
    }
}

template <Real Scalar>
void ToolFriction<Scalar>::hold(Vertex& v, const Vector3<Scalar>& position, const Tool<Scalar>& tool) noexcept {
    v.along = detail::fraction<Scalar>(dot<Scalar>(position - tool.position, tool.axis), squared_norm(tool.axis));
    v.offset = position - on_tool(tool, v);
}

// By the last pass over the contact points: they change in `begin` and `enforce` of the contact only.
template <Real Scalar>
void ToolFriction<Scalar>::read_normal_forces(const Context& context) noexcept {
    for (Vertex& v : vertices_.items()) v.normal_force = Vector3<Scalar>::Zero();
    const auto& contacts = context.step().contacts;
    for (const auto& pack : contacts.pack_ranges[context.constraint()].of(contacts.packs.items())) {
        for (std::size_t i = 0; i < pack.size; ++i) {
            const auto& normal = pack.load.normal;
            const Vector3<Scalar> force =
                -pack.load.force[i] * Vector3<Scalar>(normal[0][i], normal[1][i], normal[2][i]);
            for (std::size_t k = 0; k < corner_count(pack.kind); ++k) {
                auto* const v = find(vertices_.items(), row_at(pack.corner[k][i]));
                if (v == nullptr) continue;
                v->normal_force += pack.load.weights[static_cast<Eigen::Index>(k)][i] * force;
            }
        }
    }
}

// The tangential part, within the cone.
template <Real Scalar>
Vector3<Scalar> ToolFriction<Scalar>::limited(const Vector3<Scalar>& force, const Vertex& v) const noexcept {
    const Vector3<Scalar> along = tangential(force, v);
    const Scalar size = norm(along), largest = coefficient_ * norm(v.normal_force);
    return size > largest ? (largest / size) * along : along;
}

// Changes the force on a vertex by its slip over the compliance in that direction, and moves it by its response.
// Returns the change [N], zero if the response is negligible.
template <Real Scalar>
Scalar ToolFriction<Scalar>::stick(Context& context, const Tool<Scalar>& tool, Vertex& v) const noexcept {
    const Vector3<Scalar> now = context.position(v.vertex);
    const Vector3<Scalar> slip = tangential(now - on_tool(tool, v) - v.offset, v);
    const Vector3<Scalar> along = direction_or_zero(slip);
    const Scalar compliance = dot(along, context.response(v.vertex, along));
    v.sticking_force = compliance > 0 ? v.force - (1 / compliance) * slip : v.force;
    const Vector3<Scalar> change = limited(v.sticking_force, v) - v.force;
    const Scalar size = norm(change);
    if (!(size > context.force_tolerance()) || !(size * compliance > detail::rounding_at(now))) return 0;
    v.force += change;
    context.step().add_force(v.vertex, change);
    context.move(v.vertex, context.response(v.vertex, change));
    return size;
}

// Some passes of projected Gauss-Seidel. Returns whether a force changed.
template <Real Scalar>
bool ToolFriction<Scalar>::solve(Context& context, const Tool<Scalar>& tool) noexcept {
    constexpr int max_passes = 4;
    Scalar first = 0;
    for (int pass = 0; pass < max_passes; ++pass) {
        Scalar largest = 0;
        for (Vertex& v : vertices_.items()) largest = (std::max)(largest, stick(context, tool, v));
        if (pass == 0) first = largest;
        if (!(largest > first / 2)) break;
    }
    return first > 0;
}

// Limits the forces by the normal forces of now, which the contact has changed since the last pass.
template <Real Scalar>
void ToolFriction<Scalar>::limit(Context& context) noexcept {
    read_normal_forces(context);
    for (Vertex& v : vertices_.items()) {
        const Vector3<Scalar> now = limited(v.sticking_force, v);
        if (now == v.force) continue;
        context.step().add_force(v.vertex, now - v.force);
        v.force = now;
    }
}

// The sum of the forces on the tool.
template <Real Scalar>
Vector3<Scalar> ToolFriction<Scalar>::reaction() const noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const Vertex& v : vertices_.items()) sum -= v.force;
    return sum;
}

// Keeps the vertices of a step that has advanced. Those that slip, or are not pressed, are held where they are now. As
// long as holding a vertex would take hardly more than its limit, its slip is reversible: if not, each small change of
// the normal forces of a tool at rest would let go of some friction.
template <Real Scalar>
void ToolFriction<Scalar>::end(const Context& context, const Tool<Scalar>& tool) noexcept {
    constexpr auto reversible = Scalar(1.01);
    for (Vertex& v : vertices_.items()) {
        const Scalar largest = reversible * coefficient_ * norm(v.normal_force);
        const bool holds = largest > 0 && norm(tangential(v.sticking_force, v)) <= largest;
        const Vector3<Scalar> now = context.position(v.vertex), off = now - on_tool(tool, v) - v.offset;
        if (holds) {
            v.offset += off - tangential(off, v);  // it holds along the surface only
        } else {
            dissipated_ += (std::max)(0.0, -static_cast<double>(dot<Scalar>(v.force, off)));
            hold(v, now, tool);
        }
    }
    std::swap(vertices_, kept_);
}

static_assert(Constraint<FrictionalContact<double>, double> && Constraint<FrictionalContact<float>, float>);

}  // namespace membrane
