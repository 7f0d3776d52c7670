// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include <membrane/core/index_set.hpp>
#include <membrane/core/triple_buffer.hpp>
#include <membrane/surface/vertex_split.hpp>

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
///     for (const auto f : news.triangles) indices.col(f) = news.corners.col(f);   // of a membrane that tears
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
    [[nodiscard]] const Snapshot<T>& read() & noexcept {
        slots_.acquire();
        return slots_.front();
    }

  private:
    TripleBuffer<Snapshot<T>> slots_;
    std::uint64_t published_ = 0;  // used by the writer only
};

/// The moved vertices and their positions; of a membrane that tears, the changed triangles and their corners.
template <Real Scalar>
struct MovedSnapshot : Stamp {
    /// All vertices moved since the reader's last snapshot, and possibly some moved between that and the previous one.
    /// Empty if there was no publish since.
    std::span<const Index> moved;
    const Points<Scalar>& x;           ///< 3 x V [m]; valid at the moved vertices only
    std::span<const Index> triangles;  ///< with other corners, as `moved`
    const Triangles& corners;          ///< 3 x F; valid at these triangles only
};

/// Vertices that one thread moves, for one other thread that reads less often: all vertices moved since its last read,
/// not the whole mesh. A reader that starts with the writer's first positions and copies the vertices of each snapshot
/// has the writer's positions of that snapshot, bit for bit. If the membrane tears, it is a part that follows the
/// events, and hands over the triangles that get other corners likewise.
///
/// Wait-free, no allocation: a publish copies each moved vertex twice, and those of the previous publish at most once
/// more; a read exchanges one atomic number. Memory per vertex: three slots of 3 numbers and 8 bytes, plus 16 bytes;
/// per triangle: 88 bytes.
///
/// Why no vertex is lost and no slot fills up: README.md in this folder.
template <Real Scalar>
class MovedPoints {
  public:
    /// For a membrane that tears, the mesh has `triangle_count` triangles.
    /// @throws InvalidInput if `vertex_count` is below 1, or `triangle_count` below 0
    explicit MovedPoints(Index vertex_count, Index triangle_count = 0)
        : slots_(Slot(checked(vertex_count, triangle_count), triangle_count)),
          now_(vertex_count, triangle_count),
          before_(now_),
          corners_(Triangles::Zero(3, triangle_count)) {}

    /// Called by the writer: `moved` are all vertices moved since the last publish, but for those that a tear has
    /// moved. Returns false, and publishes nothing, if `x` is not 3 x V [m]. Ignores an index that is no vertex.
    bool publish(std::span<const Index> moved, const ConstPointsRef<Scalar>& x, double time) noexcept;

    ///@{
    /// Called by the writer: publishes all vertices, as after a reset; of a membrane that tears, the corners of all
    /// triangles too. Returns false, and publishes nothing, if `x` is not 3 x V [m] or `triangles` not 3 x F. Cost:
    /// O(V + F).
    bool publish_all(const ConstPointsRef<Scalar>& x, double time) noexcept;
    bool publish_all(const ConstPointsRef<Scalar>& x, const Triangles& triangles, double time) noexcept;
    ///@}

    ///@{
    /// Called by the writer: the membrane has torn. The next publish hands over the position of the copy, or of the
    /// vertex that a tear has moved, and the corners. Ignores triangles that there are not.
    void split(const VertexSplit& split) noexcept;
    void reshape(const MovedVertex<Scalar>& moved) noexcept { now_.vertices.insert(moved.vertex); }
    ///@}

    /// Called by the reader; valid until its next `read`.
    [[nodiscard]] MovedSnapshot<Scalar> read() & noexcept {
        const bool newer = slots_.acquire();
        const Slot& slot = slots_.front();
        const auto none = std::span<const Index>();
        return {slot.stamp, newer ? slot.changed.vertices.items() : none, slot.x,
                newer ? slot.changed.triangles.items() : none, slot.corners};
    }

  private:
    struct Changed {
        Changed(Index vertex_count, Index triangle_count) : vertices(vertex_count), triangles(triangle_count) {}
        void clear() noexcept {
            vertices.clear();
            triangles.clear();
        }

        IndexSet vertices, triangles;
    };
    struct Slot {
        Slot(Index vertex_count, Index triangle_count)
            : changed(vertex_count, triangle_count),
              x(Points<Scalar>::Zero(3, vertex_count)),  // written, so that its pages exist
              corners(Triangles::Zero(3, triangle_count)) {}

        void add(const Changed& from, const ConstPointsRef<Scalar>& positions, const Triangles& triangles) noexcept {
            for (const Index v : from.vertices.items()) {
                changed.vertices.insert(v);
                x.col(v) = positions.col(v);
            }
            for (const Index f : from.triangles.items()) {
                changed.triangles.insert(f);
                corners.col(f) = triangles.col(f);
            }
        }

        Stamp stamp;
        Changed changed;
        Points<Scalar> x;
        Triangles corners;
    };

    static Index checked(Index vertex_count, Index triangle_count) {
        constexpr std::string_view component = "MovedPoints";
        if (vertex_count < 1) refuse(component, "there must be at least 1 vertex, got ", vertex_count);
        if (triangle_count < 0) refuse(component, "there must be 0 triangles or more, got ", triangle_count);
        return vertex_count;
    }

    TripleBuffer<Slot> slots_;
    // Used by the writer only:
    Changed now_;         // since the previous publish
    Changed before_;      // in the previous publish
    Triangles corners_;   // of the changed triangles
    bool taken_ = false;  // whether the previous publish found the slot before it taken by the reader
    std::uint64_t published_ = 0;
};

template <Real Scalar>
bool MovedPoints<Scalar>::publish(std::span<const Index> moved, const ConstPointsRef<Scalar>& x, double time) noexcept {
    if (x.cols() != slots_.back().x.cols()) return false;
    for (const Index v : moved) now_.vertices.insert(v);
    slots_.back().add(now_, x, corners_);
    slots_.back().stamp = {++published_, time};
    const bool taken = slots_.publish();
    Slot& next = slots_.back();
    if (taken || taken_) next.changed.clear();
    if (!taken && taken_) next.add(before_, x, corners_);
    next.add(now_, x, corners_);
    std::swap(before_, now_);
    now_.clear();
    taken_ = taken;
    return true;
}

template <Real Scalar>
bool MovedPoints<Scalar>::publish_all(const ConstPointsRef<Scalar>& x, double time) noexcept {
    if (x.cols() != slots_.back().x.cols()) return false;
    for (Index v = 0; v < slots_.back().x.cols(); ++v) now_.vertices.insert(v);
    return publish({}, x, time);
}

template <Real Scalar>
bool MovedPoints<Scalar>::publish_all(const ConstPointsRef<Scalar>& x, const Triangles& triangles,
                                      double time) noexcept {
    if (triangles.cols() != corners_.cols() || x.cols() != slots_.back().x.cols()) return false;
    corners_ = triangles;
    for (Index f = 0; f < triangles.cols(); ++f) now_.triangles.insert(f);
    return publish_all(x, time);
}

template <Real Scalar>
void MovedPoints<Scalar>::split(const VertexSplit& split) noexcept {
    now_.vertices.insert(split.copy);
    for (std::size_t i = 0; i < split.triangles.size(); ++i) {
        const Index f = split.triangles[i];
        if (!now_.triangles.has(f)) continue;
        auto corners = split.corners[i];
        split.replace_in(corners);
        now_.triangles.insert(f);
        for (std::size_t k = 0; k < 3; ++k) corners_(static_cast<Eigen::Index>(k), f) = corners[k];
    }
}

}  // namespace membrane
