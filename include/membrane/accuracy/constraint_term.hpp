// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>

#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>

/// The description of a constraint, independent of its type: for Newton's method, the error bound and trials.
///
///     for_each_term(constraint, [&](const membrane::ConstraintTerm& term) { ... });
///
///     template <class Terms>                                                        // of a constraint of one's own
///     void describe(const Clamp& clamp, Terms& terms) {
///         terms.add(membrane::ConstraintTerm::prescribe(clamp.vertex, clamp.target));
///     }
namespace membrane {

/// A point of the membrane with a target or a load, or a tool that the surface stays outside of. In double.
struct ConstraintTerm {
    /// Which of the members below have a meaning.
    enum class Kind : unsigned char {
        pin,               ///< the vertex does not move; no force enters there
        prescribe_vertex,  ///< the vertex is at `target`
        prescribe_point,   ///< the point of a triangle is at `target`
        load,              ///< `force` acts on the point
        press,             ///< the surface stays outside `tool`, in the contact `contact`
    };

    Kind kind = Kind::pin;                                       ///< what the term does
    std::array<Index, 3> corners{no_index, no_index, no_index};  ///< of the point's triangle; a vertex is all three
    Vector3<double> weights = {1, 0, 0};                         ///< of the corners
    Vector3<double> target = Vector3<double>::Zero();            ///< [m]
    Vector3<double> force = Vector3<double>::Zero();             ///< [N]
    Tool<double> tool = {};                                      ///< of `press`
    Contact<double> contact = {};                                ///< of `press`
    std::size_t constraint = 0;  ///< number of the constraint; a collector of terms sets it

    ///@{
    /// A term of the kind of this name; `target` in [m], `force` in [N].
    [[nodiscard]] static ConstraintTerm pin(Index v) noexcept;
    [[nodiscard]] static ConstraintTerm prescribe(Index v, const Vector3<double>& target) noexcept;
    [[nodiscard]] static ConstraintTerm prescribe(const std::array<Index, 3>& corners, const Vector3<double>& weights,
                                                  const Vector3<double>& target) noexcept;
    [[nodiscard]] static ConstraintTerm load(const std::array<Index, 3>& corners, const Vector3<double>& weights,
                                             const Vector3<double>& force) noexcept;
    [[nodiscard]] static ConstraintTerm press(const Tool<double>& tool, const Contact<double>& contact) noexcept;
    ///@}

    /// Whether the position of a point is prescribed.
    [[nodiscard]] bool prescribes() const noexcept { return kind != Kind::load && kind != Kind::press; }

    /// Weight of corner `k`.
    [[nodiscard]] double weight(std::size_t k) const noexcept { return weights[static_cast<Eigen::Index>(k)]; }

    /// The point's position if the vertices are at `x` (3 x V [m]); for another vertex field `x`, its value at the
    /// point.
    [[nodiscard]] Vector3<double> point_in(const Points<double>& x) const noexcept {
        return point_at(triangle_at(x, corners), weights);
    }

    /// Factor of the force on corner `k` in the force on the constraint. If the point is displaced by the least
    /// displacement of the corners, corner `k` is displaced by this factor of it.
    [[nodiscard]] double share(std::size_t k) const noexcept { return weight(k) / squared_norm(weights); }
};

///@{
/// Adds to `terms` what the constraint demands, see above.
template <Real Scalar, class Terms>
void describe(const VertexAttachment<Scalar>& attachment, Terms& terms) {
    terms.add(ConstraintTerm::prescribe(attachment.vertex, attachment.target.template cast<double>()));
}

template <Real Scalar, class Terms>
void describe(const PointAttachment<Scalar>& attachment, Terms& terms) {
    if (attachment.triangle == no_index) return;
    terms.add(ConstraintTerm::prescribe(attachment.corners, attachment.barycentric.template cast<double>(),
                                        attachment.target.template cast<double>()));
}

template <class Terms>
void describe(const PinnedVertices& pinned, Terms& terms) {
    for (const Index v : pinned.vertices) terms.add(ConstraintTerm::pin(v));
}

template <Real Scalar, class Terms>
void describe(const PointLoad<Scalar>& load, Terms& terms) {
    terms.add(ConstraintTerm::load(load.corners, load.barycentric.template cast<double>(),
                                   load.force.template cast<double>()));
}

template <Real Scalar, class Terms>
void describe(const ToolContact<Scalar>& press, Terms& terms) {
    Tool<double> tool;
    tool.position = press.tool.position.template cast<double>();
    tool.axis = press.tool.axis.template cast<double>();
    tool.radius = press.tool.radius;
    Contact<double> contact;
    contact.phase = press.contact.phase;
    contact.corners = press.contact.corners;
    contact.point = press.contact.point.template cast<double>();
    contact.normal = press.contact.normal.template cast<double>();
    contact.patch.axis_point = press.contact.patch.axis_point.template cast<double>();
    contact.gap = press.contact.gap;
    contact.patch.detection_distance = press.contact.patch.detection_distance;
    contact.patch.radius = press.contact.patch.radius;
    contact.patch.fine_triangles = press.contact.patch.fine_triangles;
    terms.add(ConstraintTerm::press(tool, contact));
}
///@}

namespace detail {

/// A receiver of terms: calls a function for each.
template <class Act>
struct EachTerm {
    void add(const ConstraintTerm& term) { act(term); }
    Act act;
};
struct IgnoreTerm {
    void operator()(const ConstraintTerm&) const noexcept {}
};

}  // namespace detail

/// A constraint that `describe(constraint, terms)` describes by calls of `terms.add(ConstraintTerm)`.
template <class C>
concept DescribedConstraint = requires(const C& constraint, detail::EachTerm<detail::IgnoreTerm>& terms) {
    describe(constraint, terms);
};
static_assert(DescribedConstraint<VertexAttachment<float>> && DescribedConstraint<PointAttachment<double>>);
static_assert(DescribedConstraint<PinnedVertices> && DescribedConstraint<PointLoad<float>> &&
              DescribedConstraint<ToolContact<double>>);

/// Calls `act(term)` for each term of the constraint; a constraint without `describe` has no known term.
template <class C, class Act>
void for_each_term(const C& constraint, Act act) {
    if constexpr (DescribedConstraint<C>) {
        detail::EachTerm<Act> terms{act};
        describe(constraint, terms);
    }
}

inline ConstraintTerm ConstraintTerm::pin(Index v) noexcept { return {.kind = Kind::pin, .corners = {v, v, v}}; }

inline ConstraintTerm ConstraintTerm::prescribe(Index v, const Vector3<double>& target) noexcept {
    return {.kind = Kind::prescribe_vertex, .corners = {v, v, v}, .target = target};
}

inline ConstraintTerm ConstraintTerm::prescribe(const std::array<Index, 3>& corners, const Vector3<double>& weights,
                                                const Vector3<double>& target) noexcept {
    return {.kind = Kind::prescribe_point, .corners = corners, .weights = weights, .target = target};
}

inline ConstraintTerm ConstraintTerm::load(const std::array<Index, 3>& corners, const Vector3<double>& weights,
                                           const Vector3<double>& force) noexcept {
    return {.kind = Kind::load, .corners = corners, .weights = weights, .force = force};
}

inline ConstraintTerm ConstraintTerm::press(const Tool<double>& tool, const Contact<double>& contact) noexcept {
    return {.kind = Kind::press, .tool = tool, .contact = contact};
}

}  // namespace membrane
