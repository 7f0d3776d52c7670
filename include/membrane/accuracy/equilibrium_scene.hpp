// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include <membrane/accuracy/constraint_term.hpp>
#include <membrane/accuracy/tool_points.hpp>
#include <membrane/contact/contact_vertices.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// The constraints of a membrane in equilibrium, described by those of a step or by user-defined ones: see
/// `ConstraintTerm`, or
///
///     void describe(const Clamp& clamp, membrane::EquilibriumScene& scene) {
///         scene.prescribe(clamp.vertex, clamp.target);
///     }
namespace membrane {

/// Options of `equilibrium`.
struct EquilibriumOptions {
    Index increments = 1;       ///< steps in which targets, loads and tools are applied; more for a distant start
    Index layers = unlimited;   ///< vertices beyond this number of layers from the applied forces are fixed
    Index max_iterations = 60;  ///< of Newton's method, in each increment
    /// Of forces, relative to the largest force of a spring, foundation or load, and of lengths, relative to the mean
    /// edge; never below rounding.
    double tolerance = 1e-12;

    /// @throws InvalidInput for an option out of its range
    void validate() const;
};

/// Whether an equilibrium was found, or what is missing after the last iteration.
enum class EquilibriumStatus {
    found,          ///< forces balance, targets are reached, no tool penetrates
    unbalanced,     ///< a free vertex has a residual force
    target_missed,  ///< an attached point or a prescribed vertex is not at its target
    penetrated,     ///< a tool penetrates
    contact_open,   ///< a contact force acts across a gap
    not_finite,     ///< a step of Newton's method is not finite: stiffnesses are too large, or too far apart
};

/// What the status means, for a message.
[[nodiscard]] constexpr std::string_view to_string(EquilibriumStatus status) noexcept {
    switch (status) {
        case EquilibriumStatus::found: return "equilibrium found";
        case EquilibriumStatus::unbalanced: return "a free vertex has a residual force";
        case EquilibriumStatus::target_missed: return "an attached point or a prescribed vertex is not at its target";
        case EquilibriumStatus::penetrated: return "a tool penetrates";
        case EquilibriumStatus::contact_open: return "a contact force acts across a gap";
        case EquilibriumStatus::not_finite: break;
    }
    return "a step of Newton's method is not finite";
}

/// The equilibrium of a membrane under the constraints of a scene.
struct Equilibrium {
    Points<double> x;                        ///< 3 x V [m]
    std::vector<Vector3<double>> reactions;  ///< for each constraint in order, the membrane's force on it [N]
    std::vector<ToolPoint> contacts;         ///< points with a contact force; numbers only the tools in contact, from 0
    double residual = 0;                     ///< largest unbalanced force on a free vertex [N]
    double penetration = 0;                  ///< largest penetration of a tool [m]
    Index iterations = 0;                    ///< of Newton's method, in all increments
    bool converged = false;                  ///< `status` is `found`
    EquilibriumStatus status = EquilibriumStatus::unbalanced;  ///< the reason, if it has not converged
};

/// A tool that the surface must stay outside of.
struct ScenePress {
    std::size_t constraint;             ///< number of the constraint
    Tool<double> tool;                  ///< at the end of the increments
    Vector3<double> exit_displacement;  ///< after it the tool just touches the surface from outside [m]
    double detection_distance;          ///< triangles within this distance of the tool are in contact [m]
    double fine_triangles;              ///< of `TrackerOptions`
};

/// Targets, loads and tools of one increment.
struct LoadStep {
    Points<double> targets;  ///< of fixed vertices; for the others, the start positions, 3 x V [m]
    Points<double> loads;    ///< on each vertex, 3 x V [N]
    std::vector<Vector3<double>> attached_points;  ///< targets of the attached points [m]
    std::vector<Tool<double>> tools;               ///< that are in contact
};

/// The constraints of one membrane, in double. All input is checked.
/// @throws InvalidInput for an index that is not a vertex, weights that are not barycentric, a number that is not
/// finite
class EquilibriumScene {
  public:
    /// The membrane is at `start` (3 x V [m]); `pinned[v]` is not 0 if vertex `v` never moves.
    EquilibriumScene(Points<double> start, std::vector<unsigned char> pinned)
        : start_(std::move(start)), targets_(start_), pinned_(std::move(pinned)), prescribed_(pinned_.size(), 0) {}

    // For `describe`.

    /// A pinned vertex stays at its start, regardless of its target. If several terms prescribe a vertex, the target of
    /// the last one counts. A tool without contact is ignored.
    void add(const ConstraintTerm& term);

    ///@{
    /// Adds the term of this name: `target` in [m], `force` in [N]. Without a target the vertex stays at its start.
    void prescribe(Index v, const Vector3<double>& target) { add(ConstraintTerm::prescribe(v, target)); }
    void prescribe(Index v) { add(ConstraintTerm::pin(v)); }
    void prescribe(const std::array<Index, 3>& corners, const Vector3<double>& barycentric,
                   const Vector3<double>& target) {
        add(ConstraintTerm::prescribe(corners, barycentric, target));
    }
    void load(const std::array<Index, 3>& corners, const Vector3<double>& barycentric, const Vector3<double>& force) {
        add(ConstraintTerm::load(corners, barycentric, force));
    }
    void press(const Tool<double>& tool, const Contact<double>& contact) { add(ConstraintTerm::press(tool, contact)); }
    ///@}

    // For `equilibrium`.

    /// The terms added from now on belong to constraint number `constraint`.
    void select_constraint(std::size_t constraint) noexcept { constraint_ = constraint; }

    /// Whether vertex `v` is pinned or prescribed.
    [[nodiscard]] bool fixed(Index v) const noexcept {
        return pinned_[static_cast<std::size_t>(v)] != 0 || prescribed_[static_cast<std::size_t>(v)] != 0;
    }

    /// Targets and loads at `part` (0 to 1) of the change from the start, and tools at this part of their entry from
    /// outside.
    [[nodiscard]] LoadStep goals(double part) const;

    /// Constraint and vertex of each term that fixes a vertex.
    [[nodiscard]] const std::vector<std::pair<std::size_t, Index>>& prescribed_vertices() const noexcept {
        return prescribed_vertices_;
    }

    ///@{
    /// The other terms by their kind, in the order in which they were added.
    [[nodiscard]] const std::vector<ConstraintTerm>& point_attachments() const noexcept { return attachments_; }
    [[nodiscard]] const std::vector<ConstraintTerm>& loads() const noexcept { return loads_; }
    [[nodiscard]] const std::vector<ScenePress>& tools() const noexcept { return tools_; }
    ///@}

    /// Vertices to which a force is applied.
    [[nodiscard]] const std::vector<Index>& seeds() const noexcept { return seeds_; }

  private:
    void prescribe_vertex(const ConstraintTerm& term);
    void act_on_point(const ConstraintTerm& term);
    void press(const ConstraintTerm& term);
    void validate(Index v) const;
    void validate(const std::array<Index, 3>& corners, const Vector3<double>& barycentric) const;
    void validate(const Vector3<double>& vector, std::string_view what, std::string_view unit) const;

    Points<double> start_, targets_;
    std::vector<unsigned char> pinned_, prescribed_;
    std::vector<std::pair<std::size_t, Index>> prescribed_vertices_;
    std::vector<ConstraintTerm> attachments_, loads_;
    std::vector<ScenePress> tools_;
    std::vector<Index> seeds_;
    std::size_t constraint_ = 0;
};

/// A constraint that `describe(constraint, scene)` adds to a scene.
template <class C>
concept StaticConstraint = requires(const C& constraint, EquilibriumScene& scene) {
    describe(constraint, scene);
};

namespace detail {

template <class C>
consteval bool check_static_constraint() noexcept {
    static_assert(
        StaticConstraint<C>,
        "StaticConstraint: there must be describe(const C&, EquilibriumScene&) in the namespace of the constraint");
    return StaticConstraint<C>;
}

}  // namespace detail

/// A `StaticConstraint`; if a type is not one, the compile error names the missing requirement.
template <class C>
concept CheckedStaticConstraint = detail::check_static_constraint<C>();
static_assert(StaticConstraint<VertexAttachment<float>> && StaticConstraint<PointAttachment<double>> &&
              StaticConstraint<PinnedVertices>);
static_assert(StaticConstraint<PointLoad<float>> && StaticConstraint<ToolContact<double>>);

namespace detail {

/// The vertices that carry the contact, for each tool; none if all contacts are by faces.
template <Real Scalar>
[[nodiscard]] std::vector<ContactVertices> carriers_of(const EquilibriumScene& scene,
                                                       const TriangleMesh<Scalar>& mesh) {
    const auto& tools = scene.tools();
    const auto by_vertices = [](const ScenePress& pressing) { return pressing.fine_triangles > 0; };
    if (std::none_of(tools.begin(), tools.end(), by_vertices)) return {};
    const LocalSurface<Scalar> surface(mesh);
    std::vector<ContactVertices> carriers;
    const ConstPointsRef<Scalar> rest(mesh.positions());
    for (const auto& pressing : tools) carriers.emplace_back(surface, rest, pressing.fine_triangles);
    return carriers;
}

inline constexpr std::string_view equilibrium_name = "equilibrium";

}  // namespace detail

inline void EquilibriumOptions::validate() const {
    const auto at_least = [](Index number, Index least, std::string_view name) {
        if (number < least) refuse(detail::equilibrium_name, name, " must be at least ", least, ", got ", number);
    };
    at_least(increments, 1, "increments");
    at_least(layers, 0, "layers");
    at_least(max_iterations, 1, "max_iterations");
    if (!is_finite(tolerance) || !(tolerance > 0)) {
        refuse(detail::equilibrium_name, "tolerance must be finite and positive, got ", tolerance);
    }
}

inline void EquilibriumScene::validate(Index v) const {
    if (v >= 0 && v < targets_.cols()) return;
    refuse(detail::equilibrium_name, "constraint ", constraint_, " names vertex ", v, ", expected 0 to ",
           targets_.cols() - 1);
}

inline void EquilibriumScene::validate(const std::array<Index, 3>& corners, const Vector3<double>& barycentric) const {
    for (const Index v : corners) validate(v);
    // Weights that were floats have the rounding of floats.
    const bool is_float = barycentric.cast<float>().cast<double>() == barycentric;
    if (is_float ? detail::is_barycentric<float>(barycentric.cast<float>()) : detail::is_barycentric(barycentric))
        return;
    refuse(detail::equilibrium_name, "barycentric weights of constraint ", constraint_,
           " must not be negative and have the sum 1, got ", barycentric[0], " ", barycentric[1], " ", barycentric[2]);
}

inline void EquilibriumScene::validate(const Vector3<double>& vector, std::string_view what,
                                       std::string_view unit) const {
    for (Eigen::Index k = 0; k < 3; ++k) {
        if (is_finite(vector[k])) continue;
        refuse(detail::equilibrium_name, std::string_view("xyz").substr(static_cast<std::size_t>(k), 1), " of the ",
               what, " of constraint ", constraint_, " must be finite [", unit, "], got ", vector[k]);
    }
}

inline void EquilibriumScene::add(const ConstraintTerm& term) {
    switch (term.kind) {
        case ConstraintTerm::Kind::pin:
        case ConstraintTerm::Kind::prescribe_vertex: return prescribe_vertex(term);
        case ConstraintTerm::Kind::prescribe_point:
        case ConstraintTerm::Kind::load: return act_on_point(term);
        case ConstraintTerm::Kind::press: return press(term);
    }
}

inline void EquilibriumScene::prescribe_vertex(const ConstraintTerm& term) {
    const Index v = term.corners[0];
    validate(v);
    validate(term.target, "target", "m");
    prescribed_[static_cast<std::size_t>(v)] = 1;
    prescribed_vertices_.emplace_back(constraint_, v);
    if (term.kind == ConstraintTerm::Kind::pin) return;
    seeds_.push_back(v);
    if (pinned_[static_cast<std::size_t>(v)] == 0) targets_.col(v) = term.target;
}

inline void EquilibriumScene::act_on_point(const ConstraintTerm& term) {
    validate(term.corners, term.weights);
    validate(term.target, "target", "m");
    validate(term.force, "force", "N");
    auto& terms = term.kind == ConstraintTerm::Kind::load ? loads_ : attachments_;
    terms.push_back(term);
    terms.back().constraint = constraint_;
    seeds_.insert(seeds_.end(), term.corners.begin(), term.corners.end());
}

inline void EquilibriumScene::press(const ConstraintTerm& term) {
    const auto& tool = term.tool;
    const auto& contact = term.contact;
    validate(tool.position, "tool's position", "m");
    validate(tool.axis, "tool's axis", "m");
    if (!is_finite(tool.radius) || tool.radius < 0) {
        refuse(detail::equilibrium_name, "radius of the tool of constraint ", constraint_,
               " must be finite and not negative [m], got ", tool.radius);
    }
    if (!contact.touching()) return;
    for (const Index v : contact.corners) validate(v);
    validate(contact.point, "contact's point", "m");
    validate(contact.normal, "contact's normal", "1");
    validate(contact.patch.axis_point, "contact's point of the axis", "m");
    if (!is_finite(contact.patch.radius) || !(contact.patch.radius > 0)) {
        refuse(detail::equilibrium_name, "radius of the contact of constraint ", constraint_,
               " must be finite and positive [m], got ", contact.patch.radius);
    }
    if (!(contact.patch.fine_triangles >= 0 && contact.patch.fine_triangles <= 1)) {
        refuse(detail::equilibrium_name, "fine_triangles of the contact of constraint ", constraint_,
               " must be from 0 to 1 [tool radii], got ", contact.patch.fine_triangles);
    }
    ScenePress pressing{constraint_, tool, Vector3<double>::Zero(), contact.patch.detection_distance,
                        contact.patch.fine_triangles};
    pressing.tool.radius = contact.patch.radius;
    if (contact.gap < 0)
        pressing.exit_displacement = contact.point + contact.patch.radius * contact.normal - contact.patch.axis_point;
    tools_.push_back(pressing);
    seeds_.insert(seeds_.end(), contact.corners.begin(), contact.corners.end());
}

inline LoadStep EquilibriumScene::goals(double part) const {
    const auto interpolated = [&](const auto& from, const auto& to) {  // exact for unchanged values, and at the end
        auto value = to;
        if (part != 1) value = from + part * (to - from);
        return value;
    };
    LoadStep goals{interpolated(start_, targets_), Points<double>::Zero(3, start_.cols()), {}, {}};
    for (const auto& term : loads_) {
        for (std::size_t k = 0; k < 3; ++k) {
            goals.loads.col(term.corners[k]) += part * term.weight(k) * term.force;
        }
    }
    for (const auto& term : attachments_) {
        goals.attached_points.push_back(interpolated(term.point_in(start_), term.target));
    }
    for (const auto& pressing : tools_) {
        goals.tools.push_back(pressing.tool);
        goals.tools.back().position += (1 - part) * pressing.exit_displacement;
    }
    return goals;
}

}  // namespace membrane
