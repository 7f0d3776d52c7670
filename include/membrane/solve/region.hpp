// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/index_set.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/core/symmetric3.hpp>
#include <membrane/core/types.hpp>

namespace membrane {

/// A point of the surface that a constraint acts on, and the force it acts with.
template <Real Scalar>
struct Touch {
    Index triangle;  ///< with `pair`, what the touch is found again by in the next step
    int pair;
    std::array<Index, 3> corners;
    Vector3<Scalar> barycentric;
    Vector3<Scalar> normal;     ///< from the surface to the tool
    Vector3<Scalar> force;      ///< on the membrane [N]
    Vector3<Scalar> stiffness;  ///< that the touch adds to each corner's [N/m]
    bool on_fixed = false;      ///< whether a corner is fixed, and bears part of the force
};

/// What the solver remembers from step to step for its constraints, and what it works with within one. `external`
/// is zero, like `stiffness`, wherever nothing has pushed since `open`.
template <Real Scalar>
struct Workspace {
    /// The largest number of constraints of one step.
    static constexpr std::size_t most_constraints = 16;

    Workspace(Index vertex_count, Index most_touches);

    [[nodiscard]] Index vertex_count() const noexcept { return static_cast<Index>(compliance.size()); }

    void open() noexcept;    ///< Begins a step.
    void close() noexcept;   ///< Keeps the touches of the step that ends for the next one.
    void forget() noexcept;  ///< Keeps no touches.
    void clear() noexcept;   ///< Nor what vertices answered at their last visit: as new.
    void turn(const Eigen::Matrix<Scalar, 3, 3>& rotation) noexcept;  ///< What is kept, with the membrane.
    void drop_external() noexcept;                                    ///< Takes all pushes back.

    struct Range {
        std::size_t begin = 0, end = 0;
    };
    IndexSet seeds, held, saved, pushed, patch;
    IndexSet pinned;                // of saved vertices
    IndexSet bearing;               // fixed vertices that a tool presses on
    Points<Scalar> start;           // of saved vertices, where they were when the step began
    Points<Scalar> external;        // of pushed vertices, the constraints' force on them
    Points<Scalar> unbalanced;      // of visited vertices, the force on them at the end of the step
    Points<Scalar> kept;            // of saved vertices, where they were when a constraint kept them, or at the start
    Points<Scalar> borne;           // of bearing vertices, the force of tools on them
    std::vector<Scalar> stiffness;  // of pushed vertices, what touches add to it
    std::vector<Scalar> support;    // of fixed vertices, how stiff they are to a tool; zero where none has come near
    std::vector<Scalar> compliance;
    std::vector<Scalar> resistance,
        firmness;  // of vertices in layer 0: what pulls on them, and how stiff, without touches
    std::vector<Symmetric3<Scalar>> block_compliance;  // for rules that give blocks, else empty
    BoundedList<Touch<Scalar>> touches, touches_before;
    std::array<Range, most_constraints> ranges{}, ranges_before{};
    Scalar negligible_force = 0;
    bool invalid = false, full = false;
};

/// The part of the membrane that a step works on, as the constraints see it: they name the vertices where a force
/// enters, hold some, push others.
template <Real Scalar>
class Region {
  public:
    /// `network.pinned(v)` says which vertices never move.
    template <class Network>
    Region(PointsRef<Scalar>& x, Workspace<Scalar>& work, const Network& network) noexcept
        : x_(x), work_(work), network_(&network), is_pinned_([](const void* asked, Index v) noexcept {
              return static_cast<const Network*>(asked)->pinned(v);
          }) {}

    /// Whether `v` is a vertex; if not, the step is refused.
    bool check(Index v) noexcept;

    /// Puts `v` into layer 0 of the queue.
    void seed(Index v) noexcept { work_.seeds.insert(v); }

    /// Holds `v` at `target`, or where the step began, until it ends. A pinned vertex stays where it is, a held one too
    /// if there is no target.
    void hold(Index v, const Vector3<Scalar>& target) noexcept;
    void hold(Index v) noexcept {
        if (work_.held.insert(v) && work_.saved.contains(v)) x_.col(v) = work_.start.col(v);
    }

    /// Whether nothing moves `v` in this step but `hold`.
    [[nodiscard]] bool fixed(Index v) const noexcept {
        const bool pinned = work_.saved.contains(v) ? work_.pinned.contains(v) : is_pinned_(network_, v);
        return pinned || held(v);
    }
    [[nodiscard]] bool held(Index v) const noexcept { return work_.held.contains(v); }

    [[nodiscard]] Vector3<Scalar> position(Index v) const noexcept { return point(x_, v); }
    [[nodiscard]] const PointsRef<Scalar>& positions() const noexcept { return x_; }

    /// Where a tool finds `v`: at its position; if `v` is fixed, as far from it as the force of the tools on `v` stretches
    /// a spring of its support stiffness.
    [[nodiscard]] Vector3<Scalar> surface_position(Index v) const noexcept {
        const Vector3<Scalar> here = position(v);
        return work_.bearing.contains(v) ? Vector3<Scalar>(here + yielding(v)) : here;
    }

    /// How far that is from its position [m].
    [[nodiscard]] Vector3<Scalar> yielding(Index v) const noexcept {
        const Scalar stiffness = work_.support[static_cast<std::size_t>(v)];
        if (!work_.bearing.contains(v) || !(stiffness > 0)) return Vector3<Scalar>::Zero();
        return point(work_.borne, v) / stiffness;
    }

    /// How far a fixed vertex yields to a tool for each newton [m/N]; zero for others.
    [[nodiscard]] Scalar support_compliance(Index v) const noexcept {
        const Scalar stiffness = work_.support[static_cast<std::size_t>(v)];
        return fixed(v) && stiffness > 0 ? 1 / stiffness : Scalar(0);
    }

    /// Adds to the force of the tools on `v` [N], if it is fixed.
    void bear(Index v, const Vector3<Scalar>& force) noexcept {
        if (!fixed(v)) return;
        work_.bearing.insert(v);
        work_.borne.col(v) += force;
    }

    /// The vertices of these triangles, each once; valid until the next call. Of the same span as last time, at no cost:
    /// what a step is handed does not change within it.
    template <class TouchedTriangle>
    [[nodiscard]] std::span<const Index> corners_of(std::span<const TouchedTriangle> triangles) noexcept {
        if (has_patch_ && triangles.data() == patch_of_ && triangles.size() == patch_size_) return work_.patch.items();
        has_patch_ = true;
        patch_of_ = triangles.data();
        patch_size_ = triangles.size();
        work_.patch.clear();
        for (const auto& triangle : triangles) {
            for (const Index v : triangle.corners) work_.patch.insert(v);
        }
        return work_.patch.items();
    }

    /// Keeps the position of `v`. What is not kept counts as kept where the step began.
    void keep(Index v) noexcept {
        save(v);
        work_.kept.col(v) = x_.col(v);
    }
    [[nodiscard]] Vector3<Scalar> kept(Index v) const noexcept { return point(work_.kept, v); }

    /// All that this step moves goes back to where it was kept, part of the way or all of it.
    void go_back(Scalar part) noexcept {
        for (const Index v : work_.saved.items()) {
            if (!fixed(v)) x_.col(v) = (1 - part) * position(v) + part * kept(v);
        }
    }

    void shift(Index v, const Vector3<Scalar>& by) noexcept { place(v, position(v) + by); }

    /// Adds to the external force on `v` for this step [N].
    void push(Index v, const Vector3<Scalar>& force) noexcept {
        work_.pushed.insert(v);
        work_.external.col(v) += force;
    }

    /// Adds to the stiffness of `v` for this step [N/m]: a force that turns as `v` moves.
    void stiffen(Index v, Scalar by) noexcept {
        work_.pushed.insert(v);
        work_.stiffness[static_cast<std::size_t>(v)] += by;
    }

    /// How far `v` moves for `force` by the rule of the last visit, not at all if it is fixed [m].
    [[nodiscard]] Vector3<Scalar> answer(Index v, const Vector3<Scalar>& force) const noexcept {
        if (fixed(v)) return Vector3<Scalar>::Zero();
        const auto at = static_cast<std::size_t>(v);
        return work_.block_compliance.empty() ? Vector3<Scalar>(work_.compliance[at] * force)
                                              : work_.block_compliance[at] * force;
    }

    /// How far at least [m/N].
    [[nodiscard]] Scalar compliance(Index v) const noexcept {
        return fixed(v) ? Scalar(0) : work_.compliance[static_cast<std::size_t>(v)];
    }

    /// What springs and backing of `v` pulled with at its last visit in layer 0, or what it bears if it is fixed [N].
    [[nodiscard]] Scalar resistance(Index v) const noexcept {
        if (fixed(v)) return work_.bearing.contains(v) ? norm<Scalar>(point(work_.borne, v)) : Scalar(0);
        return work_.resistance[static_cast<std::size_t>(v)];
    }

    /// And how stiff they were [N/m].
    [[nodiscard]] Scalar firmness(Index v) const noexcept {
        return fixed(v) ? work_.support[static_cast<std::size_t>(v)] : work_.firmness[static_cast<std::size_t>(v)];
    }

    /// At the end of the step: springs, backing and external forces on `v` [N].
    [[nodiscard]] Vector3<Scalar> unbalanced(Index v) const noexcept { return point(work_.unbalanced, v); }

    /// A change of force that is not worth making [N].
    [[nodiscard]] Scalar negligible_force() const noexcept { return work_.negligible_force; }

    /// The touch that this constraint had here in the step before, or null.
    [[nodiscard]] const Touch<Scalar>* recall(Index triangle, int pair) noexcept;

    /// The touches of this constraint in the step before.
    [[nodiscard]] std::span<const Touch<Scalar>> touches_before() const noexcept {
        const auto range = work_.ranges_before[constraint_];
        return std::span<const Touch<Scalar>>(work_.touches_before.items())
            .subspan(range.begin, range.end - range.begin);
    }

    /// Remembers a touch of this constraint; refuses the step where there is no room for more.
    void remember(const Touch<Scalar>& touch) noexcept;

    /// The touches of this constraint in this step.
    [[nodiscard]] std::span<Touch<Scalar>> touches() noexcept {
        const auto range = work_.ranges[constraint_];
        return work_.touches.items().subspan(range.begin, range.end - range.begin);
    }
    [[nodiscard]] std::span<const Touch<Scalar>> touches() const noexcept {
        return const_cast<Region&>(*this).touches();
    }

    // For the solver.

    /// Whose touches are meant: those of constraint number `constraint`.
    void turn_to(std::size_t constraint) noexcept { constraint_ = constraint; }

    /// The constraint turned to has no touches yet.
    void open() noexcept {
        work_.ranges[constraint_] = {work_.touches.size(), work_.touches.size()};
        last_recalled_ = 0;
    }

    void set_unbalanced(Index v, const Vector3<Scalar>& force) noexcept { work_.unbalanced.col(v) = force; }
    void set_resistance(Index v, Scalar force, Scalar stiffness) noexcept {
        work_.resistance[static_cast<std::size_t>(v)] = force;
        work_.firmness[static_cast<std::size_t>(v)] = stiffness;
    }
    void set_support(Index v, Scalar stiffness) noexcept { work_.support[static_cast<std::size_t>(v)] = stiffness; }
    void set_compliance(Index v, Scalar compliance) noexcept {
        work_.compliance[static_cast<std::size_t>(v)] = compliance;
    }
    /// @pre the workspace has room for blocks
    void set_compliance(Index v, const Symmetric3<Scalar>& compliance, Scalar least) noexcept {
        set_compliance(v, least);
        work_.block_compliance[static_cast<std::size_t>(v)] = compliance;
    }

    /// Moves `v`, keeping where it was when the step began.
    void place(Index v, const Vector3<Scalar>& target) noexcept {
        save(v);
        x_.col(v) = target;
    }
    void save(Index v) noexcept {
        if (!work_.saved.insert(v)) return;
        work_.start.col(v) = work_.kept.col(v) = x_.col(v);
        if (is_pinned_(network_, v)) work_.pinned.insert(v);
    }

    /// Puts the saved vertices for which `which(v)` back to where they were.
    template <class Which>
    void put_back(Which which) noexcept {
        for (const Index v : work_.saved.items()) {
            if (which(v)) x_.col(v) = work_.start.col(v);
        }
    }

  private:
    PointsRef<Scalar>& x_;
    Workspace<Scalar>& work_;
    const void* network_;  // of a type that only the next knows
    bool (*is_pinned_)(const void*, Index) noexcept;
    std::size_t constraint_ = 0;
    std::size_t last_recalled_ = 0;
    bool has_patch_ = false;
    const void* patch_of_ = nullptr;  // the triangles whose corners are the workspace's patch
    std::size_t patch_size_ = 0;
};

template <Real Scalar>
Workspace<Scalar>::Workspace(Index vertices, Index most_touches)
    : seeds(vertices),
      held(vertices),
      saved(vertices),
      pushed(vertices),
      patch(vertices),
      pinned(vertices),
      bearing(vertices),
      start(Points<Scalar>::Zero(3, vertices)),
      external(start),
      unbalanced(start),
      kept(start),
      borne(start),
      stiffness(static_cast<std::size_t>(vertices), Scalar(0)),
      support(stiffness),
      compliance(stiffness),
      resistance(compliance),
      firmness(compliance),
      touches(static_cast<std::size_t>(most_touches)),
      touches_before(touches) {}

template <Real Scalar>
void Workspace<Scalar>::open() noexcept {
    drop_external();
    seeds.clear();
    held.clear();
    saved.clear();
    pinned.clear();
    touches.clear();
    ranges = {};
    invalid = full = false;
}

template <Real Scalar>
void Workspace<Scalar>::close() noexcept {
    std::swap(touches, touches_before);
    std::swap(ranges, ranges_before);
}

template <Real Scalar>
void Workspace<Scalar>::forget() noexcept {
    touches_before.clear();
    ranges_before = {};
}

template <Real Scalar>
void Workspace<Scalar>::clear() noexcept {
    forget();
    for (auto* answers : {&compliance, &resistance, &firmness, &support})
        std::fill(answers->begin(), answers->end(), Scalar(0));
    std::fill(block_compliance.begin(), block_compliance.end(), Symmetric3<Scalar>{});
}

template <Real Scalar>
void Workspace<Scalar>::turn(const Eigen::Matrix<Scalar, 3, 3>& rotation) noexcept {
    const RigidFrame<Scalar> turned{.rotation = rotation};
    for (auto& touch : touches_before.items()) {
        touch.normal = turned.direction_out(touch.normal);
        touch.force = turned.direction_out(touch.force);
    }
    for (auto& compliance_of_vertex : block_compliance) {
        compliance_of_vertex = rotated(compliance_of_vertex, rotation);
    }
}

template <Real Scalar>
void Workspace<Scalar>::drop_external() noexcept {
    for (const Index v : pushed.items()) {
        external.col(v).setZero();
        stiffness[static_cast<std::size_t>(v)] = 0;
    }
    pushed.clear();
    for (const Index v : bearing.items()) borne.col(v).setZero();
    bearing.clear();
}

template <Real Scalar>
bool Region<Scalar>::check(Index v) noexcept {
    const bool valid = v >= 0 && v < work_.vertex_count();
    if (!valid) work_.invalid = true;
    return valid;
}

template <Real Scalar>
void Region<Scalar>::hold(Index v, const Vector3<Scalar>& target) noexcept {
    work_.held.insert(v);
    if (!is_pinned_(network_, v)) place(v, target);
}

template <Real Scalar>
const Touch<Scalar>* Region<Scalar>::recall(Index triangle, int pair) noexcept {
    // Touches come in nearly the same order every time: the search starts where the last one ended.
    const auto range = work_.ranges_before[constraint_];
    const std::size_t count = range.end - range.begin;
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t at = range.begin + (last_recalled_ + i) % count;
        const auto& touch = work_.touches_before[at];
        if (touch.triangle != triangle || touch.pair != pair) continue;
        last_recalled_ = at - range.begin + 1;
        return &touch;
    }
    return nullptr;
}

template <Real Scalar>
void Region<Scalar>::remember(const Touch<Scalar>& touch) noexcept {
    if (!work_.touches.push(touch)) work_.full = true;
    work_.ranges[constraint_].end = work_.touches.size();
}

}  // namespace membrane
