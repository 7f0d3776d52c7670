// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include <membrane/accuracy/constraint_term.hpp>
#include <membrane/accuracy/point_attachments.hpp>
#include <membrane/core/fixed_vector.hpp>
#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/volume_springs.hpp>

/// The balance of forces on a membrane of linear springs.
///
///     membrane::EquilibriumProblem problem(network);                                            // offline
///     if (problem.assign(x, network, foundation, membrane::pull(7, target)) != membrane::ProblemStatus::valid) ...
///     problem.forces(problem.centre(), force, magnitude);                                // [N]
namespace membrane {

/// A foundation with a force proportional to the distance from an anchor, or without forces.
template <class Volume>
concept LinearFoundation = std::same_as<Volume, NoFoundation> || std::same_as<Volume, VirtualVolumeSprings<float>> ||
                           std::same_as<Volume, VirtualVolumeSprings<double>> || std::same_as < Volume,
        MovingFoundation < VirtualVolumeSprings<float>,
float >> || std::same_as<Volume, MovingFoundation<VirtualVolumeSprings<double>, double>>;

/// Whether a problem could be set up.
enum class ProblemStatus {
    valid,          ///< the problem is complete
    invalid_input,  ///< a number is not finite, an index is not a vertex, or counts do not match
    contact,        ///< a tool touches; all other input is in the problem
    unsupported,    ///< a constraint without `describe`, or an attached point that shares a corner with another one
};

/// Springs, foundation, loads and attachments, in double for any scalar of the network. There is no damping: it has no
/// force in equilibrium. Valid until the inputs of the step change; keeps no reference to them.
class EquilibriumProblem {
  public:
    /// Cost: O(V + springs) memory.
    template <Real Scalar, class Law>
    explicit EquilibriumProblem(const MassSpringNetwork<Scalar, Law>& network);

    /// Takes the membrane at `x` (3 x V [m]), which may have torn, and its constraints. A vertex on which nothing acts,
    /// as one in reserve, is fixed. Online. Cost: O(V + springs).
    template <Real Scalar, class Law, LinearFoundation Volume, class... Constraints>
    [[nodiscard]] ProblemStatus assign(const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                       const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                       const Constraints&... constraints) noexcept;

    /// Also fixes all vertices that are not in `free`. Online. Cost: O(V).
    [[nodiscard]] ProblemStatus fix_all_but(std::span<const Index> free) noexcept;

    /// Number of vertices V.
    [[nodiscard]] Index vertex_count() const noexcept { return static_cast<Index>(fixed_.size()); }

    ///@{
    /// The springs of the network, in double, and the most that there may be.
    [[nodiscard]] std::span<const Spring<double>> springs() const noexcept { return springs_.items(); }
    [[nodiscard]] std::size_t spring_capacity() const noexcept { return springs_.capacity(); }
    ///@}

    /// Stiffness of the foundation at vertex `v` [N/m].
    [[nodiscard]] double foundation(Index v) const noexcept { return foundation_[at(v)].stiffness; }

    /// The stiffness of the foundation minus the softening set since the last `assign` [N/m].
    [[nodiscard]] double support(Index v) const noexcept { return foundation(v) - softening_[at(v)]; }

    /// Sets the softening at vertex `v` to `by` [N/m].
    void soften(Index v, double by) noexcept { softening_[at(v)] = by; }

    /// Whether vertex `v` is pinned, prescribed, or excluded by `fix_all_but`.
    [[nodiscard]] bool fixed(Index v) const noexcept { return fixed_[at(v)] != 0; }

    /// Number of the spring's ends that are not fixed, 0 to 2.
    [[nodiscard]] int free_ends(const Spring<double>& spring) const noexcept {
        return (fixed(spring.first) ? 0 : 1) + (fixed(spring.second) ? 0 : 1);
    }

    ///@{
    /// The x of the last `assign`, and x with prescribed vertices at their targets [m].
    [[nodiscard]] const Points<double>& given() const noexcept { return given_; }
    [[nodiscard]] const Points<double>& centre() const noexcept { return centre_; }
    ///@}

    /// Force of springs, foundation and loads on every vertex at `y` [N], and the sum of the magnitudes of its terms:
    /// rounding changes the force by at most `rounding()` times that sum.
    void forces(const Points<double>& y, Points<double>& force, std::vector<double>& magnitude) const noexcept;

    /// Relative rounding error of a sum of forces.
    [[nodiscard]] double rounding() const noexcept { return rounding_; }

    /// Removes from `f` the components on fixed vertices and those that move an attached point: the orthogonal
    /// projection onto the admissible displacements.
    void project(Points<double>& f) const noexcept;

    /// The attached points and their targets.
    [[nodiscard]] const PointAttachments& attachments() const noexcept { return attachments_; }

    /// Adds to `weights` (V) the share of the force on each vertex in the reaction of `term`; nothing for a load or a
    /// tool.
    static void share(const ConstraintTerm& term, std::vector<double>& weights) noexcept;

  private:
    static constexpr unsigned char by_network = 1, by_constraint = 2, by_caller = 4;

    [[nodiscard]] static std::size_t at(Index v) noexcept { return static_cast<std::size_t>(v); }
    [[nodiscard]] bool is_vertex(Index v) const noexcept { return v >= 0 && v < vertex_count(); }
    template <class Network>
    [[nodiscard]] bool take_springs(const Network& network) noexcept;
    template <class Scalar, class Volume>
    bool take_foundation(const Volume& volume) noexcept;
    void fix(Index v, unsigned char by) noexcept { fixed_[at(v)] = static_cast<unsigned char>(fixed_[at(v)] | by); }
    template <class C>
    [[nodiscard]] ProblemStatus take_constraint(const C& constraint) noexcept;
    [[nodiscard]] ProblemStatus take_term(const ConstraintTerm& term) noexcept;
    [[nodiscard]] ProblemStatus check_places() const noexcept;

    FixedVector<Spring<double>> springs_;
    std::vector<VolumeSpring<double>> foundation_;
    std::vector<double> softening_;
    std::vector<unsigned char> fixed_;  // bits: by network, constraint, caller
    Points<double> load_, given_, centre_;
    PointAttachments attachments_;
    double rounding_ = 0;
    bool has_contact_ = false;  // by a tool
};

template <Real Scalar, class Law>
EquilibriumProblem::EquilibriumProblem(const MassSpringNetwork<Scalar, Law>& network)
    : springs_(network.spring_capacity()),
      foundation_(static_cast<std::size_t>(network.vertex_count())),
      softening_(foundation_.size()),
      fixed_(foundation_.size()),
      load_(Points<double>::Zero(3, network.vertex_count())),
      given_(load_),
      centre_(load_) {
    static_assert(std::same_as<Law, LinearSpring>,
                  "the springs must follow LinearSpring: nothing is proven for others");
    static_cast<void>(take_springs(network));
}

template <Real Scalar, class Law, LinearFoundation Volume, class... Constraints>
ProblemStatus EquilibriumProblem::assign(const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                         const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                         const Constraints&... constraints) noexcept {
    if (x.cols() != vertex_count() || network.vertex_count() != vertex_count()) return ProblemStatus::invalid_input;
    if (!take_springs(network)) return ProblemStatus::invalid_input;
    for (Index v = 0; v < vertex_count(); ++v) {
        fixed_[at(v)] = network.pinned(v) ? by_network : static_cast<unsigned char>(0);
        given_.col(v) = centre_.col(v) = point(x, v).template cast<double>();
    }
    load_.setZero();
    attachments_.clear();
    std::fill(softening_.begin(), softening_.end(), 0.0);
    has_contact_ = false;
    if (!take_foundation<Scalar>(volume) || !is_finite(given_)) return ProblemStatus::invalid_input;
    ProblemStatus status = ProblemStatus::valid;
    ((status = status == ProblemStatus::valid ? take_constraint(constraints) : status), ...);
    for (Index v = 0; v < vertex_count(); ++v) {
        const bool is_joined = !network.springs_of(v).empty() || foundation(v) > 0;
        if (!is_joined && squared_norm(point(load_, v)) == 0) fix(v, by_network);
    }
    if (status == ProblemStatus::valid) status = check_places();
    return status == ProblemStatus::valid && has_contact_ ? ProblemStatus::contact : status;
}

// A spring's force is off by at most 13 units of rounding, half an epsilon each, times k (l + r). A sum of n terms adds
// n units times all magnitudes. Loads and foundation are two more terms, and the magnitudes are rounded as well.
template <class Network>
bool EquilibriumProblem::take_springs(const Network& network) noexcept {
    springs_.clear();
    for (const auto& spring : network.springs()) {
        if (!springs_.try_push_back({spring.first, spring.second, static_cast<double>(spring.stiffness),
                                     static_cast<double>(spring.rest_length)})) {
            return false;
        }
    }
    std::size_t most = 0;
    for (Index v = 0; v < network.vertex_count(); ++v) most = (std::max)(most, network.springs_of(v).size());
    rounding_ = std::numeric_limits<double>::epsilon() * static_cast<double>(8 + most);
    return true;
}

template <class Scalar, class Volume>
bool EquilibriumProblem::take_foundation(const Volume& volume) noexcept {
    if constexpr (std::same_as<Volume, NoFoundation>) {
        std::fill(foundation_.begin(), foundation_.end(), VolumeSpring<double>());
        return true;
    } else {
        if (volume.anchors().cols() != vertex_count()) return false;
        for (Index v = 0; v < vertex_count(); ++v) {
            const Vector3<Scalar> anchor = point(volume.anchors(), v);
            const auto spring = volume.spring(v, anchor, std::numeric_limits<Scalar>::infinity());
            if (!is_finite(anchor)) return false;
            foundation_[at(v)] = {anchor.template cast<double>(), static_cast<double>(spring.stiffness)};
        }
        return true;
    }
}

template <class C>
ProblemStatus EquilibriumProblem::take_constraint(const C& constraint) noexcept {
    if (!constraint.valid()) return ProblemStatus::invalid_input;
    ProblemStatus status = DescribedConstraint<C> ? ProblemStatus::valid : ProblemStatus::unsupported;
    for_each_term(constraint, [&](const ConstraintTerm& term) {
        if (status == ProblemStatus::valid) status = take_term(term);
    });
    return status;
}

inline ProblemStatus EquilibriumProblem::take_term(const ConstraintTerm& term) noexcept {
    using Kind = ConstraintTerm::Kind;
    if (term.kind == Kind::press) {
        has_contact_ |= term.contact.touching();
        return ProblemStatus::valid;
    }
    for (const Index v : term.corners) {
        if (!is_vertex(v)) return ProblemStatus::invalid_input;
    }
    const Index v = term.corners[0];
    switch (term.kind) {
        case Kind::prescribe_vertex:
            if ((fixed_[at(v)] & by_network) == 0) centre_.col(v) = term.target;
            [[fallthrough]];
        case Kind::pin: fix(v, by_constraint); return ProblemStatus::valid;
        case Kind::load:
            for (std::size_t k = 0; k < 3; ++k) load_.col(term.corners[k]) += term.weight(k) * term.force;
            return ProblemStatus::valid;
        default: return attachments_.add(term) ? ProblemStatus::valid : ProblemStatus::unsupported;
    }
}

inline ProblemStatus EquilibriumProblem::fix_all_but(std::span<const Index> free) noexcept {
    for (Index v = 0; v < vertex_count(); ++v) fix(v, by_caller);
    for (const Index v : free) {
        if (!is_vertex(v)) return ProblemStatus::invalid_input;
        fixed_[at(v)] = static_cast<unsigned char>(fixed_[at(v)] & ~by_caller);
    }
    return check_places();
}

inline ProblemStatus EquilibriumProblem::check_places() const noexcept {
    const bool independent = attachments_.independent([&](Index v) { return fixed(v); });
    return independent ? ProblemStatus::valid : ProblemStatus::unsupported;
}

inline void EquilibriumProblem::forces(const Points<double>& y, Points<double>& force,
                                       std::vector<double>& magnitude) const noexcept {
    for (Index v = 0; v < vertex_count(); ++v) {
        const Vector3<double> pull = foundation_[at(v)].elastic_force(point(y, v)).force;
        force.col(v) = pull + load_.col(v);
        magnitude[at(v)] = norm(pull) + norm(point(load_, v));
    }
    for (const auto& spring : springs()) {
        const auto pull = spring_force(LinearSpring{}, edge_vector(spring, y), spring.stiffness, spring.rest_length);
        force.col(spring.first) += pull.force();
        force.col(spring.second) -= pull.force();
        const double most = spring.stiffness * (pull.length + spring.rest_length);
        magnitude[at(spring.first)] += most;
        magnitude[at(spring.second)] += most;
    }
}

inline void EquilibriumProblem::project(Points<double>& f) const noexcept {
    for (Index v = 0; v < vertex_count(); ++v) {
        if (fixed(v)) f.col(v).setZero();
    }
    attachments_.project(f);
}

inline void EquilibriumProblem::share(const ConstraintTerm& term, std::vector<double>& weights) noexcept {
    if (!term.prescribes()) return;
    for (std::size_t k = 0; k < 3; ++k) weights[at(term.corners[k])] += term.share(k);
}

}  // namespace membrane
