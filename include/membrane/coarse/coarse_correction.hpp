// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <membrane/coarse/coarse_points.hpp>
#include <membrane/coarse/element_forces.hpp>
#include <membrane/core/check.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/core/symmetric3.hpp>
#include <membrane/surface/vertex_split.hpp>

/// The coarse level of a two-level method: the right force where it reaches beyond the layers of the queue.
///
///     membrane::CoarseCorrection coarse(mesh, network, foundation);                     // offline
///     const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
///     const auto corrected = coarse.correct(x, solver);
///     corrected.moved ? tree.refit(x) : tree.refit(x, report.moved);
namespace membrane {

/// Options of a `CoarseCorrection`.
struct CoarseOptions {
    /// Number of coarse points, roughly, and none for a few with a pinned rim; at most all free vertices. More are more
    /// accurate where the contact is small beside their distance, as of forceps.
    Index points = 128;
    /// `correct` corrects where the reaction may be off by this part of it [1], by the last estimate and by how the
    /// tools have moved since, and in every 64th call. Other calls repeat the last displacement, by as much as the
    /// contact moves on, or do nothing where that call found a smaller error. 0: each call corrects.
    double tolerance = 0.003;

    /// @throws InvalidInput for an option out of its range
    void validate() const;
};

namespace detail {

// A solver after a step: its queue, and the vertices that constraints prescribed.
template <class Solver>
concept HasQueue = requires(const Solver& solver) {
    { solver.queue().layer(0) } -> std::convertible_to<std::span<const Index>>;
    { solver.prescribed() } -> std::convertible_to<std::span<const Index>>;
    { solver.splits() } -> std::same_as<Index>;
};

// The inverse of a symmetric matrix; empty if it is not positive definite. Eliminates in a fixed order: factors by
// Eigen differ in their last bits from one instruction set to another.
[[nodiscard]] inline Eigen::MatrixXd inverse_of(Eigen::MatrixXd a) {
    for (Eigen::Index k = 0; k < a.cols(); ++k) {
        const double pivot = a(k, k);
        if (!(pivot > 0)) return {};
        for (Eigen::Index j = 0; j < a.cols(); ++j) {
            if (j == k) continue;
            const double factor = a(k, j) / pivot;
            a.col(j) -= factor * a.col(k);
            a(k, j) = factor;
        }
        a.col(k) /= -pivot;
        a(k, k) = 1 / pivot;
    }
    return a;
}

}  // namespace detail

/// What a correction did.
template <Real Scalar>
struct CoarseReport {
    bool corrected = false;  ///< false if it repeated the last one, at equilibrium, or if a number was not finite
    bool moved = false;      ///< it has moved vertices; if not, a refit needs `StepReport::moved` alone
    Scalar step_length = 0;  ///< by which the line search multiplied the displacement, 0 to 1
    /// An estimate of the error of the step: the sum of its reactions to tools and forceps, less that of the same step
    /// solved to the end [N]. 0 without a constraint, NaN if there is no estimate, as between two corrections. Only its
    /// size counts.
    Vector3<Scalar> reaction_error = Vector3<Scalar>::Zero();
    /// Vertices beyond the queue with a larger residual force than any in it, the largest 16: what is finer than the
    /// points. For `solver.wake`. Valid until the next correction.
    std::span<const Index> unbalanced = {};
};

/// After a step, moves all vertices but those of layer 0, pinned and prescribed ones by the displacements of a few
/// coarse points: those that balance the forces, by the stiffness at rest and a line search. A step solves for the
/// vertices near the tool, and leaves the others where they are: where nothing but a far rim holds the membrane, it
/// feels far too stiff. With the correction the layers may stay few.
///
/// While the contact moves, the displacement of a tick is repeated in advance, as far as it repeats the one before:
/// beyond layer 0 positions are a tick ahead of the tool. The solver need not be woken for these motions. What sleeps
/// keeps its shape between the points, unless `CoarseReport::unbalanced` is woken. The method and its error: README.md
/// in this folder.
///
/// One thread at a time for each instance. The membrane may tear, and its foundation move as a rigid body.
template <Real Scalar>
class CoarseCorrection : public SplitCount {
  public:
    /// Copies network and foundation; those of a membrane that tears must outlive it, at their place, as must a
    /// foundation that does not take `Lanes`. On a moving body the foundation is that of the body at rest. `mesh` is
    /// that of `TornSurface` if the membrane has torn before.
    /// @throws InvalidInput for a network or foundation of other vertices than the mesh's, an option out of its range,
    /// or a stiffness at rest that is not finite, or zero. Cost: O(V log V) for each point, the cube of their number.
    template <ElasticNetwork<Scalar> Network, CheckedFoundationModel<Scalar> Volume>
    CoarseCorrection(const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& foundation,
                     const CoarseOptions& options = {});

    ///@{
    /// Corrects `x` (3 x V [m]) after a step of `solver`, where `CoarseOptions::tolerance` demands it; or with layer 0
    /// of its queue, and the prescribed vertices. `pose` is that of the body, `body.pose()` of a `MovingBody`: network
    /// and foundation turn with it, a `DeadLoad` as well. Of elastic elements and a linear foundation the energy falls,
    /// but for what is repeated in advance. If `x` does not have V vertices, or the solver has followed other splits,
    /// nothing moves. Online. Cost of a correction: the forces and one or two changes of the energy of all elements,
    /// some 30 products for each vertex, nine for each pair of points; else up to one product for each vertex.
    template <detail::HasQueue Solver>
    CoarseReport<Scalar> correct(PointsRef<Scalar> x, const Solver& solver,
                                 const RigidFrame<Scalar>& pose = {}) noexcept {
        if (solver.splits() != splits_) return {.reaction_error = unknown()};
        auto report = correct(x, solver.queue().layer(0), solver.prescribed(), pose);
        if (is_finite(report.reaction_error)) report.unbalanced = find_unbalanced(solver.queue());
        return report;
    }
    CoarseReport<Scalar> correct(PointsRef<Scalar> x, std::span<const Index> layer_0, std::span<const Index> prescribed,
                                 const RigidFrame<Scalar>& pose = {}) noexcept;
    ///@}

    ///@{
    /// The `reaction_error` that a correction would report [N]; nothing moves. For a loop that does without: how far
    /// can its forces be trusted? Online. Cost: half that of a correction, most of it where there are few vertices.
    template <detail::HasQueue Solver>
    [[nodiscard]] Vector3<Scalar> reaction_error(const ConstPointsRef<Scalar>& x, const Solver& solver,
                                                 const RigidFrame<Scalar>& pose = {}) noexcept {
        if (solver.splits() != splits_) return unknown();
        return reaction_error(x, solver.queue().layer(0), solver.prescribed(), pose);
    }
    [[nodiscard]] Vector3<Scalar> reaction_error(const ConstPointsRef<Scalar>& x, std::span<const Index> layer_0,
                                                 std::span<const Index> prescribed,
                                                 const RigidFrame<Scalar>& pose = {}) noexcept;
    ///@}

    ///@{
    /// The membrane has torn: a copy has the displacements of its vertex, points and their stiffness stay as they are.
    /// The next call corrects, after an `update`. Online.
    void split(const VertexSplit& split) noexcept;
    void reshape(const MovedVertex<Scalar>&) noexcept {
        has_changed_ = true;
        ticks_ = max_ticks;
    }
    ///@}

    /// Reads network and foundation again, which have changed, as `CohesiveSprings` that fail. They must outlive this.
    /// The next call corrects. Online. Cost: about half that of a correction.
    void update() noexcept;

    /// The coarse points.
    [[nodiscard]] const CoarsePoints& points() const& noexcept { return points_; }
    void points() && = delete;

    /// Drops the displacement in advance: for a membrane that is put back to rest. Online.
    void reset() noexcept;

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        [[maybe_unused]] const bool changes = self.changes_;
        visit(self.x_, self.held_before_, self.last_, self.repeats_, self.length_, self.advanced_, self.motion_.largest,
              self.motion_.mean, self.motion_since_, self.error_, self.allowed_motion_, self.ticks_, self.rows_ahead_,
              self.points_, self.splits_, self.changes_);
        if constexpr (Visit::restores) self.has_changed_ = self.changes_ = self.changes_ || changes;
    }

  private:
    using Rows = std::vector<PaddedPoint<Scalar>>;  // of each vertex and one more, or of each point; the extra is 0
    using Four = PaddedVector<Scalar>;
    struct Motion {  // of the held vertices in a tick [m]
        Scalar largest = 0;
        Vector3<Scalar> mean = Vector3<Scalar>::Zero();
    };

    static constexpr std::size_t max_unbalanced = 16;
    static constexpr Index max_ticks = 64;  // of corrections [calls]
    [[nodiscard]] bool has_all(const ConstPointsRef<Scalar>& x) const noexcept {
        return x.cols() + 1 == static_cast<Eigen::Index>(x_.size());
    }
    [[nodiscard]] static Vector3<Scalar> unknown() noexcept {
        return Vector3<Scalar>::Constant(std::numeric_limits<Scalar>::quiet_NaN());
    }
    [[nodiscard]] static std::size_t at(Index i) noexcept { return static_cast<std::size_t>(i); }
    [[nodiscard]] static Four load(const PaddedPoint<Scalar>& row) noexcept { return Four::load(row.number.data()); }
    static void store(const Four& four, PaddedPoint<Scalar>& row) noexcept { four.store(row.number.data()); }
    static void clear(Rows& rows) noexcept { std::fill(rows.begin(), rows.end(), PaddedPoint<Scalar>()); }
    [[nodiscard]] static Scalar product(const Rows& a, const Rows& b) noexcept {
        Four sum;
        for (std::size_t i = 0; i < a.size(); ++i) sum = sum + load(a[i]) * load(b[i]);
        return sum.sum();
    }

    template <class Network, class Volume>
    void invert_stiffness(const Points<double>& stretched, const Network& network, const Volume& volume);

    void read_again() noexcept;

    // In the order of a correction.
    void hold(std::span<const Index> layer_0, std::span<const Index> prescribed) noexcept;
    [[nodiscard]] Motion held_motion(const ConstPointsRef<Scalar>& x, const RigidFrame<Scalar>& pose) noexcept;
    [[nodiscard]] bool may_be_off(const Motion& moved) const noexcept;
    static void find_positions(const ConstPointsRef<Scalar>& x, const RigidFrame<Scalar>& pose,
                               Rows& positions) noexcept;
    void find_residual(const Rows& x) noexcept;
    [[nodiscard]] Vector3<Scalar> solve() noexcept;
    [[nodiscard]] Vector3<Scalar> hold_contact() noexcept;
    void keep_error(const Vector3<Scalar>& reaction_error) noexcept;
    [[nodiscard]] bool is_balanced() const noexcept;
    void interpolate() noexcept;
    [[nodiscard]] Scalar search_line(Scalar work) noexcept;
    [[nodiscard]] Scalar energy_change(Scalar length) noexcept;
    [[nodiscard]] Scalar repetition(Scalar contact_moved) const noexcept;
    void stop_repeating() noexcept;
    void repeat(PointsRef<Scalar>& x, Scalar contact_moved, const RigidFrame<Scalar>& pose) noexcept;
    void advance(PointsRef<Scalar>& x, Scalar step_length, bool repeats, const RigidFrame<Scalar>& pose) noexcept;
    void displace(PointsRef<Scalar>& x, Index v, const Four& displacement, const RigidFrame<Scalar>& pose) noexcept;
    template <class Queue>
    [[nodiscard]] std::span<const Index> find_unbalanced(const Queue& queue) noexcept;

    [[nodiscard]] bool is_free(Index v) const noexcept { return !points_.weights(v).empty() && !held_.contains(v); }
    void add_response(std::size_t k, std::size_t i, Scalar force, Rows& displacements) noexcept;

    CoarsePoints points_;
    std::vector<std::unique_ptr<ElementForces<Scalar>>> kinds_;
    Rows compliance_;                             // of the points, by columns [m/N]
    std::vector<Scalar> force_tolerances_;        // of the force on each point [N]
    Rows x_, trial_, displacement_, forces_;      // of vertices, in the frame of the body
    Rows residual_, step_, last_;                 // of points: forces, displacements of this tick and the last one
    Rows rows_ahead_;                             // of vertices: displaced in advance
    Scalar repeats_ = 0;                          // the part of `last_` that was
    Scalar length_ = 1;                           // of the last step, or tried last
    Scalar advanced_ = 1;                         // how often `rows_ahead_` were added
    Motion motion_;                               // in the tick of the last correction
    Scalar motion_since_ = 0;                     // of the held vertices since then [m]
    double tolerance_;                            // of the reaction, in parts of it
    Scalar error_ = 0;                            // of it, in parts of it, at the last correction
    Scalar allowed_motion_ = 0;                   // with which it stays within the tolerance [m]
    Index ticks_ = max_ticks;                     // since the last correction; `max_ticks` if the next must be one
    std::vector<Scalar> weights_;                 // of points in the mean of layer 0
    std::array<Rows, 3> response_;                // of the points to a force on the held vertices
    IndexSet held_;                               // layer 0 but pinned vertices, then those prescribed
    std::size_t in_contact_ = 0;                  // number of the first
    IndexSet held_before_;                        // those of the last call
    Scalar force_tolerance_ = 0;                  // of one vertex [N]
    bool changes_ = false, has_changed_ = false;  // network and foundation: ever, and since the last `update`
    std::array<Index, max_unbalanced> unbalanced_{};
};

template <class Network, class Volume>
CoarseCorrection(const TriangleMesh<typename Network::Scalar>&, const Network&, const Volume&,
                 const CoarseOptions& = {}) -> CoarseCorrection<typename Network::Scalar>;

inline void CoarseOptions::validate() const {
    if (points < 1) refuse("CoarseCorrection", "points must be at least 1, got ", points);
    if (!(tolerance >= 0)) refuse("CoarseCorrection", "tolerance must be at least 0, got ", tolerance);
}

template <Real Scalar>
template <ElasticNetwork<Scalar> Network, CheckedFoundationModel<Scalar> Volume>
CoarseCorrection<Scalar>::CoarseCorrection(const TriangleMesh<Scalar>& mesh, const Network& network,
                                           const Volume& foundation, const CoarseOptions& options)
    : points_((options.validate(), mesh), network, options.points),
      tolerance_(options.tolerance),
      held_(mesh.vertex_count()),
      held_before_(mesh.vertex_count()) {
    if constexpr (FollowsSplit<Network>) changes_ = true, splits_ = network.splits();
    constexpr bool moves = requires { foundation.body(); };
    static_assert(!moves, "CoarseCorrection: pass the foundation of the body at rest, and its pose to `correct`");
    const Index count = mesh.vertex_count();
    if (!has_vertices(foundation, count))
        refuse("CoarseCorrection", "the foundation must be of the mesh's ", count, " vertices");
    kinds_ = element_forces(network, foundation);
    for (Rows* rows : {&x_, &trial_, &displacement_, &forces_, &rows_ahead_}) rows->resize(at(count) + 1);
    for (Rows* rows : {&residual_, &step_, &last_}) rows->resize(at(points_.count()));
    for (Rows& rows : response_) rows.resize(at(points_.count()));
    weights_.assign(at(points_.count()), 0);
    force_tolerances_ = weights_;
    force_tolerance_ = network.force_tolerance();
    for (Index v = 0; v < count; ++v) {
        x_[at(v)].set(point(mesh.positions(), v));
        for (const auto& [k, weight] : points_.weights(v)) {  // roundings add like random numbers
            auto& tolerance = force_tolerances_[at(k)];
            tolerance = std::hypot(tolerance, static_cast<Scalar>(weight) * force_tolerance_);
        }
    }
    invert_stiffness(1.001 * mesh.positions().template cast<double>(), network, foundation);
}

// The stiffness of the points by Galerkin's method, and its inverse, at positions that are those at rest stretched by a
// thousandth: flat at rest, a membrane without tension has none across it, and a step by that would be far too long.
template <Real Scalar>
template <class Network, class Volume>
void CoarseCorrection<Scalar>::invert_stiffness(const Points<double>& stretched, const Network& network,
                                                const Volume& volume) {
    constexpr Scalar for_ever = (std::numeric_limits<Scalar>::max)();  // damping vanishes
    const Eigen::Index three = 3, size = three * points_.count();
    Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(size, size);
    const auto add_block = [&](Index first, Index second, const Eigen::Matrix3d& block) {
        for (const auto& [i, a] : points_.weights(first)) {
            for (const auto& [j, b] : points_.weights(second))
                stiffness.block<3, 3>(three * i, three * j) += static_cast<double>(a) * static_cast<double>(b) * block;
        }
    };
    network.for_each_element([&](const auto& instance) {
        const auto corners = instance.where(stretched);
        for (std::size_t i = 0; i < corners.size(); ++i) {
            for (std::size_t j = 0; j < corners.size(); ++j)
                add_block(instance.corners[i], instance.corners[j], instance.element.hessian_block(corners, i, j));
        }
    });
    for (Index v = 0; v < network.vertex_count(); ++v) {
        const auto here = x_[at(v)].point();
        const auto foundation = static_cast<double>(volume.force_on(v, here, here, for_ever).stiffness);
        add_block(v, v, foundation * Eigen::Matrix3d::Identity());
    }
    if (size == 0) return;
    const double largest = stiffness.cwiseAbs().maxCoeff();
    if (!is_finite(stiffness) || !(largest > 0))  // the largest may hide a NaN
        refuse("CoarseCorrection", "the stiffness at rest must be finite, and above zero, got ", largest, " N/m");
    Eigen::MatrixXd inverse;
    for (double shift = 1e-8; inverse.size() == 0; shift *= 10)
        inverse = detail::inverse_of(stiffness + shift * largest * Eigen::MatrixXd::Identity(size, size));
    compliance_.reserve(static_cast<std::size_t>(size) * residual_.size());
    for (Eigen::Index j = 0; j < size; ++j) {
        for (Eigen::Index k = 0; k < size; k += 3) {
            compliance_.emplace_back();
            compliance_.back().set(Vector3<double>(inverse.block<3, 1>(k, j)).template cast<Scalar>());
        }
    }
}

template <Real Scalar>
CoarseReport<Scalar> CoarseCorrection<Scalar>::correct(PointsRef<Scalar> x, std::span<const Index> layer_0,
                                                       std::span<const Index> prescribed,
                                                       const RigidFrame<Scalar>& pose) noexcept {
    CoarseReport<Scalar> report{.reaction_error = unknown()};
    if (!has_all(x)) return report;
    hold(layer_0, prescribed);
    const Motion moved = held_motion(x, pose);
    motion_since_ += moved.largest;
    const bool is_needed = ticks_ == max_ticks || may_be_off(moved);
    if (++ticks_ < max_ticks && !is_needed) {
        report.moved = repeats_ > 0;
        if (report.moved) repeat(x, moved.largest, pose);
        return report;
    }
    if (has_changed_) read_again();
    ticks_ = 0;
    find_positions(x, pose, x_);
    find_residual(x_);
    report.reaction_error = pose.vector_to_world(solve());
    keep_error(report.reaction_error);
    motion_ = is_finite(moved.largest) ? moved : Motion();
    if (!is_balanced()) {
        interpolate();
        report.step_length = search_line(product(residual_, step_));
    }
    report.corrected = report.moved = report.step_length > 0;
    if (report.corrected) {
        advance(x, report.step_length, is_needed, pose);
    } else {
        stop_repeating();
    }
    return report;
}

template <Real Scalar>
Vector3<Scalar> CoarseCorrection<Scalar>::reaction_error(const ConstPointsRef<Scalar>& x,
                                                         std::span<const Index> layer_0,
                                                         std::span<const Index> prescribed,
                                                         const RigidFrame<Scalar>& pose) noexcept {
    if (!has_all(x)) return unknown();
    if (has_changed_) read_again();
    hold(layer_0, prescribed);
    find_positions(x, pose, trial_);
    find_residual(trial_);
    return pose.vector_to_world(solve());
}

template <Real Scalar>
void CoarseCorrection<Scalar>::hold(std::span<const Index> layer_0, std::span<const Index> prescribed) noexcept {
    held_.clear();
    for (const Index v : layer_0) {
        if (held_.has(v) && is_free(v)) held_.insert(v);
    }
    in_contact_ = held_.items().size();
    for (const Index v : prescribed) held_.insert(v);
}

// The positions in the frame of the body.
template <Real Scalar>
void CoarseCorrection<Scalar>::find_positions(const ConstPointsRef<Scalar>& x, const RigidFrame<Scalar>& pose,
                                              Rows& positions) noexcept {
    for (Index v = 0; v < x.cols(); ++v) positions[at(v)].set(pose.point_to_body(point(x, v)));
}

// The forces on the points: those on the vertices that are not held, times their weights.
template <Real Scalar>
void CoarseCorrection<Scalar>::find_residual(const Rows& x) noexcept {
    clear(forces_);
    for (const auto& kind : kinds_) kind->add_forces(x, forces_);
    clear(residual_);
    for (std::size_t v = 0; v + 1 < forces_.size(); ++v) {
        if (held_.contains(static_cast<Index>(v))) continue;
        const Four force = load(forces_[v]);
        for (const auto& [k, weight] : points_.weights(static_cast<Index>(v))) {
            auto& sum = residual_[at(k)];
            store(load(sum) + Four(static_cast<Scalar>(weight)) * force, sum);
        }
    }
}

// The displacements by the forces on the points. Returns the error of the reaction.
template <Real Scalar>
Vector3<Scalar> CoarseCorrection<Scalar>::solve() noexcept {
    clear(step_);
    for (std::size_t k = 0; k < residual_.size(); ++k) {
        for (std::size_t i = 0; i < 3; ++i) add_response(k, i, residual_[k].number[i], step_);
    }
    return in_contact_ > 0 ? hold_contact() : Vector3<Scalar>::Zero();
}

// Adds the displacements by a force on point `k` along axis `i`.
template <Real Scalar>
void CoarseCorrection<Scalar>::add_response(std::size_t k, std::size_t i, Scalar force, Rows& displacements) noexcept {
    if (force == 0) return;
    auto column = compliance_.begin() + static_cast<std::ptrdiff_t>((3 * k + i) * displacements.size());
    const Four by(force);
    for (auto& row : displacements) store(load(row) + by * load(*column++), row);
}

// The tool holds layer 0. So the mean displacement of its vertices is reduced to a third, as by a spring twice as stiff
// as the membrane is there. Without it the points would push a fine membrane off the tool; held wholly it would not
// follow forceps. Returns the error of the reaction: were the others in equilibrium, it would change by the force that
// holds layer 0 wholly.
template <Real Scalar>
Vector3<Scalar> CoarseCorrection<Scalar>::hold_contact() noexcept {
    constexpr Scalar softness = 0.5;
    std::fill(weights_.begin(), weights_.end(), Scalar(0));
    for (const Index v : held_.items().first(in_contact_)) {
        for (const auto& [k, weight] : points_.weights(v))
            weights_[at(k)] += static_cast<Scalar>(weight) / static_cast<Scalar>(in_contact_);
    }
    const auto mean_of = [&](const Rows& displacements) {
        Vector3<Scalar> mean = Vector3<Scalar>::Zero();
        for (std::size_t k = 0; k < weights_.size(); ++k) mean += weights_[k] * displacements[k].point();
        return mean;
    };
    std::array<Vector3<Scalar>, 3> columns;
    for (std::size_t i = 0; i < 3; ++i) {
        clear(response_[i]);
        for (std::size_t k = 0; k < weights_.size(); ++k) add_response(k, i, weights_[k], response_[i]);
        columns[i] = mean_of(response_[i]);
    }
    const auto& [x, y, z] = columns;
    const Symmetric3<Scalar> compliance{x.x(), y.y(), z.z(), x.y(), x.z(), y.z()};
    const Vector3<Scalar> whole = inverse(compliance) * mean_of(step_), force = whole / (1 + softness);
    if (!is_finite(whole)) return unknown();
    for (std::size_t k = 0; k < step_.size(); ++k) {
        Four sum = load(step_[k]);
        for (std::size_t i = 0; i < 3; ++i) sum = sum - Four(force[i]) * load(response_[i][k]);
        store(sum, step_[k]);
    }
    return -whole;
}

// The error of a reaction, in parts of it, is taken to grow as the held vertices move. Without contact each call
// corrects, until the points are balanced.
template <Real Scalar>
void CoarseCorrection<Scalar>::keep_error(const Vector3<Scalar>& reaction_error) noexcept {
    constexpr Scalar least = (std::numeric_limits<Scalar>::min)();
    Scalar reaction = least;
    for (const Index v : held_.items().first(in_contact_)) reaction += norm(forces_[at(v)].point());
    error_ = in_contact_ > 0 ? norm(reaction_error) / reaction : Scalar(is_balanced() ? 0 : 1);
    const auto longer = static_cast<Scalar>((std::min)(tolerance_ / static_cast<double>(error_ + least), 2.0));
    allowed_motion_ = is_finite(motion_since_) ? longer * motion_since_ : Scalar(0);
    motion_since_ = 0;
}

// Whether the error of the reaction may have reached the tolerance: by how far the held vertices have moved, or as they
// do not move on as they did.
template <Real Scalar>
bool CoarseCorrection<Scalar>::may_be_off(const Motion& moved) const noexcept {
    const Scalar turned = norm<Scalar>(moved.mean - motion_.mean), larger = (std::max)(moved.largest, motion_.largest);
    return !(static_cast<double>(error_) < tolerance_) || motion_since_ > allowed_motion_ || !(2 * turned <= larger);
}

// The displacements since the last call of the vertices that are held and were. Infinite if too many others are, or
// were: more than a quarter, or any while the rest stands still.
template <Real Scalar>
auto CoarseCorrection<Scalar>::held_motion(const ConstPointsRef<Scalar>& x, const RigidFrame<Scalar>& pose) noexcept
    -> Motion {
    Motion motion;
    std::size_t count = 0;
    for (const Index v : held_.items()) {
        const Vector3<Scalar> here = pose.point_to_body(point(x, v)), moved = here - x_[at(v)].point();
        x_[at(v)].set(here);
        if (!held_before_.contains(v)) continue;
        motion.largest = (std::max)(motion.largest, norm(moved));
        motion.mean += (moved - motion.mean) / static_cast<Scalar>(++count);
    }
    const std::size_t all = held_.items().size() + held_before_.items().size(), others = all - 2 * count;
    if (4 * others > all || (others > 0 && 8 * motion.largest <= motion_.largest))
        motion.largest = std::numeric_limits<Scalar>::infinity();
    held_before_.clear();
    for (const Index v : held_.items()) held_before_.insert(v);
    return motion;
}

template <Real Scalar>
bool CoarseCorrection<Scalar>::is_balanced() const noexcept {
    for (std::size_t k = 0; k < residual_.size(); ++k) {
        if (!(norm(residual_[k].point()) <= force_tolerances_[k])) return false;
    }
    return true;
}

// The displacements of all vertices.
template <Real Scalar>
void CoarseCorrection<Scalar>::interpolate() noexcept {
    for (std::size_t v = 0; v + 1 < x_.size(); ++v) {
        Four sum;
        if (!held_.contains(static_cast<Index>(v))) {
            for (const auto& [k, weight] : points_.weights(static_cast<Index>(v)))
                sum = sum + Four(static_cast<Scalar>(weight)) * load(step_[at(k)]);
        }
        store(sum, displacement_[v]);
    }
}

// The length of the step, at most 1, with which the energy falls; 0 if none is found. `work` is that of the forces for
// length 1 [J]. Tries the length of the last correction, and if it is not within a factor of 1.5 of where the parabola
// through the energy has its minimum, that one. If none is found the next correction goes on with shorter ones.
template <Real Scalar>
Scalar CoarseCorrection<Scalar>::search_line(Scalar work) noexcept {
    constexpr int max_trials = 4;
    constexpr Scalar factor = 1.5, shortest = Scalar(1e-6);
    if (!(length_ > shortest)) length_ = 1;
    for (int i = 0; i < max_trials && length_ > 0; ++i) {
        const Scalar tried = length_, change = energy_change(tried), curvature = 2 * (change + tried * work);
        length_ = curvature > 0 ? (std::min)(tried * tried * work / curvature, Scalar(1)) : Scalar(1);
        const bool is_near = factor * length_ > tried && length_ < factor * tried;
        if (change < 0 && (is_near || i > 0)) return length_ = tried;
    }
    return 0;
}

// The change of the energy by a step of this length [J].
template <Real Scalar>
Scalar CoarseCorrection<Scalar>::energy_change(Scalar length) noexcept {
    for (std::size_t v = 0; v + 1 < x_.size(); ++v)
        store(load(x_[v]) + Four(length) * load(displacement_[v]), trial_[v]);
    Scalar sum = 0;
    for (const auto& kind : kinds_) sum += kind->energy_change(x_, trial_);
    return sum;
}

// How far the displacement of this tick repeats the last one, 0 to 1. No farther than the contact has moved, or it
// would swing about a contact that stands still.
template <Real Scalar>
Scalar CoarseCorrection<Scalar>::repetition(Scalar contact_moved) const noexcept {
    const Scalar now = product(step_, step_), larger = (std::max)(now, product(last_, last_));
    if (!(larger > 0) || !(now > 0)) return 0;
    Scalar farthest = 0;
    for (const auto& displacement : step_) farthest = (std::max)(farthest, norm(displacement.point()));
    return (std::min)(contact_moved / farthest, Scalar(1)) * (std::max)(product(step_, last_), Scalar(0)) / larger;
}

template <Real Scalar>
void CoarseCorrection<Scalar>::stop_repeating() noexcept {
    clear(last_);
    clear(rows_ahead_);
    repeats_ = 0;
    advanced_ = 1;
    motion_ = {};
}

// The displacement of a tick is what was added in advance, and its part of the step.
template <Real Scalar>
void CoarseCorrection<Scalar>::advance(PointsRef<Scalar>& x, Scalar step_length, bool repeats,
                                       const RigidFrame<Scalar>& pose) noexcept {
    const Four length(step_length), part(1 / advanced_), before(repeats_);
    for (std::size_t k = 0; k < step_.size(); ++k)
        store(part * length * load(step_[k]) + before * load(last_[k]), step_[k]);
    repeats_ = repeats ? repetition(motion_.largest) : Scalar(0);
    advanced_ = 1;
    std::swap(last_, step_);
    for (std::size_t v = 0; v + 1 < x_.size(); ++v) {
        if (points_.weights(static_cast<Index>(v)).empty()) continue;
        const Four moved = length * load(displacement_[v]);
        const Four again = Four(repeats_) * (part * moved + load(rows_ahead_[v]));
        store(again, rows_ahead_[v]);
        if (!held_.contains(static_cast<Index>(v))) displace(x, static_cast<Index>(v), moved + again, pose);
    }
}

// Adds what is ahead once more, by the part that the contact has moved of what it moved before.
template <Real Scalar>
void CoarseCorrection<Scalar>::repeat(PointsRef<Scalar>& x, Scalar contact_moved,
                                      const RigidFrame<Scalar>& pose) noexcept {
    const Scalar part = contact_moved < motion_.largest ? contact_moved / motion_.largest : Scalar(1);
    advanced_ += part;
    for (Index v = 0; v < x.cols(); ++v) {
        if (is_free(v)) displace(x, v, Four(part) * load(rows_ahead_[at(v)]), pose);
    }
}

// Moves a vertex, by a displacement in the frame of the body.
template <Real Scalar>
void CoarseCorrection<Scalar>::displace(PointsRef<Scalar>& x, Index v, const Four& displacement,
                                        const RigidFrame<Scalar>& pose) noexcept {
    store(load(x_[at(v)]) + displacement, x_[at(v)]);
    PaddedPoint<Scalar> row;
    store(displacement, row);
    set_point(x, v, Vector3<Scalar>(point(x, v) + pose.vector_to_world(row.point())));
}

// Those with the largest forces, larger than any in the queue.
template <Real Scalar>
template <class Queue>
std::span<const Index> CoarseCorrection<Scalar>::find_unbalanced(const Queue& queue) noexcept {
    const auto square_of = [&](Index v) { return squared_norm(forces_[at(v)].point()); };
    Scalar least = force_tolerance_ * force_tolerance_;
    for (const Index v : queue.vertices()) {
        if (is_free(v)) least = (std::max)(least, square_of(v));
    }
    std::array<std::pair<Scalar, Index>, max_unbalanced> heap;  // the smallest in front
    std::size_t count = 0;
    for (Index v = 0; at(v) + 1 < forces_.size(); ++v) {
        if (!(square_of(v) > least) || !is_free(v) || queue.contains(v)) continue;
        if (count == heap.size()) std::pop_heap(heap.begin(), heap.end(), std::greater<>());
        count = (std::min)(count + 1, heap.size());
        heap[count - 1] = {square_of(v), v};
        std::push_heap(heap.begin(), heap.begin() + static_cast<std::ptrdiff_t>(count), std::greater<>());
        if (count == heap.size()) least = heap.front().first;
    }
    for (std::size_t i = 0; i < count; ++i) unbalanced_[i] = heap[i].second;
    return std::span<const Index>(unbalanced_).first(count);
}

template <Real Scalar>
void CoarseCorrection<Scalar>::split(const VertexSplit& split) noexcept {
    ++splits_;
    reshape({});
    points_.split(split);
    for (Rows* rows : {&x_, &rows_ahead_}) (*rows)[at(split.copy)] = (*rows)[at(split.vertex)];
}

template <Real Scalar>
void CoarseCorrection<Scalar>::update() noexcept {
    read_again();
    ticks_ = max_ticks;
}

template <Real Scalar>
void CoarseCorrection<Scalar>::read_again() noexcept {
    changes_ = true, has_changed_ = false;
    for (const auto& kind : kinds_) kind->update();
}

template <Real Scalar>
void CoarseCorrection<Scalar>::reset() noexcept {
    stop_repeating();
    length_ = 1;
    motion_since_ = allowed_motion_ = error_ = 0;
    ticks_ = max_ticks;
}

}  // namespace membrane
