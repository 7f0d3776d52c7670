// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>
#include <cstdint>
#include <span>
#include <type_traits>

#include <membrane/core/index_set.hpp>
#include <membrane/core/triple_buffer.hpp>

/// How a haptic loop and a drawing loop share one membrane: each has its own positions and its own thread, and neither
/// ever waits for the other.
///
///     membrane::MovedPoints<double> moved(mesh.vertex_count());
///     membrane::Latest<membrane::Tool<double>> pose;
///
///     moved.publish(report.moved, x, now());                                      // haptic loop, each tick
///     const auto wanted = pose.read().value;
///
///     const auto news = moved.read();                                             // drawing loop, each frame
///     for (const auto v : news.moved) shown.col(v) = news.x.col(v);
///     normals.update(shown, news.moved);
///     pose.publish(tool, now());
///
/// Times are of any clock that both loops read [s].
namespace membrane {

/// Which one it is of all that were published, and when that was.
struct Stamp {
    std::uint64_t number = 0;  ///< from 1 on; 0 before the first
    double time = 0;           ///< [s]

    [[nodiscard]] double age(double now) const noexcept { return now - time; }
};

/// What was published, whole.
template <class T>
struct Snapshot : Stamp {
    T value{};
};

/// The latest of what one thread publishes, for one other thread: a pose, a force. What is in between is left out.
///
/// What is read is never older than the last publish that was complete before the read, and the numbers never go back.
/// Wait-free: a publish copies T and exchanges one atomic number; a read does the latter at most.
template <class T>
class Latest {
    static_assert(
        std::copyable<T> && std::is_trivially_destructible_v<T>,
        "Latest: T must own no memory, so that to copy it allocates nothing; MovedPoints hands over positions");

  public:
    /// Before the first publish, what is read is `first`, with number 0.
    explicit Latest(const T& first = T()) : slots_(Snapshot<T>{{}, first}) {}

    /// By the writer.
    void publish(const T& value, double time) noexcept {
        slots_.back() = {{++published_, time}, value};
        slots_.publish();
    }

    /// By the reader; valid until its next `read`.
    [[nodiscard]] const Snapshot<T>& read() noexcept {
        slots_.take();
        return slots_.front();
    }

  private:
    TripleBuffer<Snapshot<T>> slots_;
    std::uint64_t published_ = 0;  // the writer's
};

/// What has moved, and where it is now.
template <Real Scalar>
struct MovedSnapshot : Stamp {
    /// Each vertex that has moved since the reader's last snapshot, and perhaps some that moved between that and the
    /// one before. None where nothing was published since.
    std::span<const Index> moved;
    const Points<Scalar>& x;  ///< 3 x V [m]; of the vertices that moved, and no others
};

/// The vertices that one thread moves, for one other thread that looks less often: all that has moved since it looked
/// last, not the whole mesh. A reader that starts with the writer's first positions, and takes over what is in each
/// snapshot, has the writer's positions of that snapshot, bit for bit.
///
/// Wait-free and allocates nothing: a publish copies each moved vertex twice, and at most once more those of the publish
/// before; a read exchanges one atomic number. Takes three times 3 numbers and 8 bytes a vertex, and 8 bytes more.
///
/// Why nothing is lost: before publish k, the writer's slot has all that moved in the publishes s + 1 to k - 1, where
/// they were then, for a snapshot s that the reader has taken (0: it starts with that). Publish k adds what moves in it,
/// and swaps slots. If the reader had not taken k - 1, the slot that comes back is that of k - 1: it lacks only what
/// moved in k, which is added. If it had, the slot is empty but for what moved in k: now s = k - 1. The snapshots that
/// the reader has only grow, so that s is one of them whenever a slot is taken.
/// Why it does not pile up: when the reader has taken k - 1, the slot of k may still hold what moved long before.
/// If that comes back from publish k + 1, it is emptied as well, but for what moved in k and k + 1.
template <Real Scalar>
class MovedPoints {
  public:
    /// @throws InvalidInput if there is no vertex
    explicit MovedPoints(Index vertex_count) : slots_(Slot(vertex_count)), before_(checked(vertex_count)) {}

    /// By the writer: `moved` are all that have moved since the last publish. @pre `x` is 3 x V [m], `moved` in 0 .. V - 1
    /// (asserted)
    void publish(std::span<const Index> moved, const ConstPointsRef<Scalar>& x, double time) noexcept;

    /// By the reader; valid until its next `read`.
    [[nodiscard]] MovedSnapshot<Scalar> read() noexcept {
        const bool newer = slots_.take();
        const Slot& slot = slots_.front();
        return {slot.stamp, newer ? slot.moved.items() : std::span<const Index>(), slot.x};
    }

  private:
    struct Slot {
        explicit Slot(Index vertex_count)
            : moved(checked(vertex_count)), x(Points<Scalar>::Zero(3, vertex_count)) {}  // written to: memory is there

        void add(std::span<const Index> vertices, const ConstPointsRef<Scalar>& from) noexcept {
            for (const Index v : vertices) {
                moved.insert(v);
                x.col(v) = from.col(v);
            }
        }

        Stamp stamp;
        IndexSet moved;
        Points<Scalar> x;
    };

    static Index checked(Index vertex_count) {
        if (vertex_count < 1) refuse("MovedPoints", "there must be at least 1 vertex, got ", vertex_count);
        return vertex_count;
    }

    TripleBuffer<Slot> slots_;
    // The writer's:
    IndexSet before_;     // what moved in the publish before
    bool taken_ = false;  // whether the reader had then taken all that was published until then
    std::uint64_t published_ = 0;
};

template <Real Scalar>
void MovedPoints<Scalar>::publish(std::span<const Index> moved, const ConstPointsRef<Scalar>& x, double time) noexcept {
    MEMBRANE_ASSERT(x.cols() == slots_.back().x.cols());
    slots_.back().add(moved, x);
    slots_.back().stamp = {++published_, time};
    const bool taken = slots_.publish();
    Slot& next = slots_.back();
    if (taken || taken_) next.moved.clear();
    if (!taken && taken_) next.add(before_.items(), x);
    next.add(moved, x);
    before_.clear();
    for (const Index v : moved) before_.insert(v);
    taken_ = taken;
}

}  // namespace membrane
