// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>
#include <cstdint>
#include <span>
#include <type_traits>

#include <membrane/core/index_set.hpp>
#include <membrane/core/triple_buffer.hpp>

/// Two loops that share one membrane, a haptic loop and a drawing loop: each has its own positions and its own thread,
/// and neither waits for the other.
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
/// Times may come from any clock that both loops read [s].
namespace membrane {

/// Number and time of a publish.
struct Stamp {
    std::uint64_t number = 0;  ///< from 1 on; 0 before the first
    double time = 0;           ///< [s]

    /// Time since the publish [s], by the same clock.
    [[nodiscard]] double age(double now) const noexcept { return now - time; }
};

/// A published value with its stamp.
template <class T>
struct Snapshot : Stamp {
    T value{};  ///< the default before the first publish
};

/// The latest value that one thread publishes for one other thread: a pose, a force. The reader skips older values.
///
/// The value read is never older than the last publish completed before the read, and numbers never decrease.
/// Wait-free: a publish copies T and exchanges one atomic number; a read exchanges at most one atomic number.
template <class T>
class Latest {
    static_assert(
        std::copyable<T> && std::is_trivially_destructible_v<T>,
        "Latest: T must own no memory, so that to copy it allocates nothing; MovedPoints hands over positions");

  public:
    /// Before the first publish `read` returns `first` with number 0.
    explicit Latest(const T& first = T()) : slots_(Snapshot<T>{{}, first}) {}

    /// Called by the writer.
    void publish(const T& value, double time) noexcept {
        slots_.back() = {{++published_, time}, value};
        slots_.publish();
    }

    /// Called by the reader; valid until its next `read`.
    [[nodiscard]] const Snapshot<T>& read() noexcept {
        slots_.acquire();
        return slots_.front();
    }

  private:
    TripleBuffer<Snapshot<T>> slots_;
    std::uint64_t published_ = 0;  // used by the writer only
};

/// The moved vertices and their positions.
template <Real Scalar>
struct MovedSnapshot : Stamp {
    /// All vertices moved since the reader's last snapshot, and possibly some moved between that and the previous one.
    /// Empty if there was no publish since.
    std::span<const Index> moved;
    const Points<Scalar>& x;  ///< 3 x V [m]; valid at the moved vertices only
};

/// Vertices that one thread moves, for one other thread that reads less often: all vertices moved since its last read,
/// not the whole mesh. A reader that starts with the writer's first positions and copies the vertices of each snapshot
/// has the writer's positions of that snapshot, bit for bit.
///
/// Wait-free, no allocation: a publish copies each moved vertex twice, and those of the previous publish at most once
/// more; a read exchanges one atomic number. Memory per vertex: three slots of 3 numbers and 8 bytes, plus 8 bytes.
///
/// Why no vertex is lost and no slot fills up: README.md in this folder.
template <Real Scalar>
class MovedPoints {
  public:
    /// @throws InvalidInput if `vertex_count` is below 1
    explicit MovedPoints(Index vertex_count) : slots_(Slot(vertex_count)), before_(checked(vertex_count)) {}

    /// Called by the writer: `moved` are all vertices moved since the last publish. @pre `x` is 3 x V [m], `moved` in 0
    /// .. V - 1 (asserted)
    void publish(std::span<const Index> moved, const ConstPointsRef<Scalar>& x, double time) noexcept;

    /// Called by the reader; valid until its next `read`.
    [[nodiscard]] MovedSnapshot<Scalar> read() noexcept {
        const bool newer = slots_.acquire();
        const Slot& slot = slots_.front();
        return {slot.stamp, newer ? slot.moved.items() : std::span<const Index>(), slot.x};
    }

  private:
    struct Slot {
        explicit Slot(Index vertex_count)
            : moved(checked(vertex_count)),
              x(Points<Scalar>::Zero(3, vertex_count)) {}  // written, so that its pages exist

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
    // Used by the writer only:
    IndexSet before_;     // moved in the previous publish
    bool taken_ = false;  // whether the previous publish found the slot before it taken by the reader
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
