// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/haptics/device.hpp>
#include <membrane/replay/snapshot.hpp>

/// Recording of a run, tick by tick, and its replay. Files: `replay/recording_file.hpp`.
///
///     membrane::Recorder<double> recorder(60'000, mesh.vertex_count());            // a minute at 1 kHz
///     while (device.running()) { ...; device.write(force); recorder.add(tool, force); }
///     membrane::ReplayDevice<double> again(recorder.recording());                  // in place of the device
///     while (again.running()) { ...; again.write(force); }                         // then again.differing() == 0
///
/// A replay gives the same forces bit for bit if it is the same binary and starts in the state of the recorded run: the
/// same mesh, network, options and positions, parts and force policies new or `reset()`, the tree refitted, and a new
/// limiter (`reset` keeps its thermal load). Only the device's data is recorded, so every part that needs a time must
/// use the tool's: a `ForceLimiter` with `tool.time` limits a replay as it limited the run. A limiter on another clock,
/// or steps that end at a deadline of a real clock, are not reproducible.
namespace membrane {

/// One tick: the tool that the device returned, and the force written to it.
template <Real Scalar>
struct RecordedTick {
    Tool<Scalar> tool;                                ///< as the device returned it
    Vector3<Scalar> force = Vector3<Scalar>::Zero();  ///< [N]
};

/// Whether two ticks have the same bits. Unlike ==, +0 and -0 differ, and a NaN equals itself.
template <Real Scalar>
[[nodiscard]] bool identical(const RecordedTick<Scalar>& a, const RecordedTick<Scalar>& b) noexcept;

/// The state of a loop before a tick, see `replay/snapshot.hpp`.
struct RecordedSnapshot {
    std::size_t tick = 0;          ///< number of the tick
    std::vector<std::byte> state;  ///< as `save_snapshot` wrote it
};

/// Ticks of one run, in order.
template <Real Scalar>
struct Recording {
    Index vertex_count = 0;                        ///< of the membrane; guards against a replay with another mesh
    std::vector<RecordedTick<Scalar>> ticks = {};  ///< one a tick, from the first
    std::vector<RecordedSnapshot> snapshots = {};  ///< in the order of their ticks
};

/// Memory of a `Recorder` for snapshots.
struct SnapshotMemory {
    std::size_t count = 0;  ///< of snapshots
    std::size_t bytes = 0;  ///< of each: `snapshot_capacity` of the components
};

/// Records a run into memory allocated at construction. Values that are not finite are recorded unchanged.
template <Real Scalar>
class Recorder {
  public:
    /// Capacity for `max_ticks`, 120 bytes each in `double`, and for `snapshots`; every page is touched at
    /// construction.
    /// @throws InvalidInput if `max_ticks` is 0 or `vertex_count` is negative
    explicit Recorder(std::size_t max_ticks, Index vertex_count, const SnapshotMemory& snapshots = {})
        : ticks_(max_ticks), vertex_count_(vertex_count), snapshots_(snapshots.count) {
        for (auto& snapshot : snapshots_) snapshot.state.resize(snapshots.bytes);
        if (max_ticks == 0) refuse("Recorder", "max_ticks must be positive, got 0");
        if (vertex_count < 0) refuse("Recorder", "vertex_count must not be negative, got ", vertex_count);
    }

    /// Adds one tick. If the capacity is exhausted, only counts the tick: a replay needs the beginning. Online.
    void add(const Tool<Scalar>& tool, const Vector3<Scalar>& force) noexcept {
        if (size_ < ticks_.size()) {
            ticks_[size_++] = {tool, force};
        } else {
            ++missed_;
        }
    }

    /// Keeps the state of the components before the next tick. Returns false if the memory for snapshots or ticks is
    /// used up. Online. Cost: `save_snapshot`.
    template <class... Components>
    bool add_snapshot(const Components&... components) noexcept {
        if (snapshot_count_ == snapshots_.size() || size_ == ticks_.size()) return false;
        auto& snapshot = snapshots_[snapshot_count_];
        const std::size_t size = save_snapshot(snapshot.state, components...);
        if (size == 0) return false;
        snapshot.tick = size_;
        sizes_[snapshot_count_++] = size;
        return true;
    }

    /// Number of recorded ticks.
    [[nodiscard]] std::size_t size() const noexcept { return size_; }

    /// Number of ticks that exceeded the capacity.
    [[nodiscard]] std::size_t missed() const noexcept { return missed_; }

    /// A copy of the ticks so far; not while another thread adds ticks.
    [[nodiscard]] Recording<Scalar> recording() const {
        Recording<Scalar> copy{vertex_count_, {ticks_.begin(), ticks_.begin() + static_cast<std::ptrdiff_t>(size_)}};
        for (std::size_t i = 0; i < snapshot_count_; ++i) {
            copy.snapshots.push_back(snapshots_[i]);
            copy.snapshots.back().state.resize(sizes_[i]);
        }
        return copy;
    }

    /// Removes all ticks and snapshots, and keeps the capacity.
    void clear() noexcept { size_ = missed_ = snapshot_count_ = 0; }

  private:
    std::vector<RecordedTick<Scalar>> ticks_;
    Index vertex_count_;
    std::size_t size_ = 0, missed_ = 0;
    std::vector<RecordedSnapshot> snapshots_;
    std::vector<std::size_t> sizes_ = std::vector<std::size_t>(snapshots_.size());  // of snapshots in use [bytes]
    std::size_t snapshot_count_ = 0;
};

/// A device that returns the tools of a recording in order, and compares the forces with the recorded ones.
template <Real Scalar>
class ReplayDevice {
  public:
    /// @throws InvalidInput if the recording has no tick
    explicit ReplayDevice(Recording<Scalar> recording)
        : ticks_(std::move(recording.ticks)), snapshots_(std::move(recording.snapshots)) {
        if (ticks_.empty()) refuse("ReplayDevice", "the recording must have a tick, got none");
    }

    /// Whether a tick is left.
    [[nodiscard]] bool running() const noexcept { return next_ < ticks_.size(); }

    /// The tool of the next tick; after the end, that of the last tick.
    [[nodiscard]] Tool<Scalar> read() noexcept {
        if (running()) ++next_;
        return ticks_[(std::max)(next_, std::size_t{1}) - 1].tool;
    }

    /// Compares the force with that of the tick that was read last.
    void write(const Vector3<Scalar>& force) noexcept {
        if (next_ == 0) return;
        const auto& tick = ticks_[next_ - 1];
        if (identical(tick, {tick.tool, force})) return;
        if (differing_++ == 0) first_difference_ = next_ - 1;
    }

    ///@{
    /// Number of forces so far that differed from the recorded ones in any bit, and the tick of the first difference.
    [[nodiscard]] std::size_t differing() const noexcept { return differing_; }
    [[nodiscard]] std::size_t first_difference() const noexcept { return first_difference_; }
    ///@}

    /// Goes to the last snapshot at or before `tick`, with the components in the order in which they were saved. The
    /// tree is then to be refitted. Returns false, and changes nothing, if there is no such snapshot or it is of other
    /// components. Cost: `restore_snapshot`.
    template <class... Components>
    [[nodiscard]] bool start_from(std::size_t tick, Components&&... components) noexcept {
        const auto later = [](std::size_t number, const RecordedSnapshot& other) { return number < other.tick; };
        const auto end = std::upper_bound(snapshots_.begin(), snapshots_.end(), tick, later);
        if (end == snapshots_.begin() || !restore_snapshot(std::prev(end)->state, components...)) return false;
        next_ = std::prev(end)->tick;
        return true;
    }

    /// Number of the tick that is read next.
    [[nodiscard]] std::size_t next_tick() const noexcept { return next_; }

    /// Returns to the first tick.
    void reset() noexcept { next_ = differing_ = first_difference_ = 0; }

  private:
    std::vector<RecordedTick<Scalar>> ticks_;
    std::vector<RecordedSnapshot> snapshots_;
    std::size_t next_ = 0, differing_ = 0, first_difference_ = 0;
};

namespace detail {

/// The numbers of a tick in the order of the file: position, axis, radius, velocity, time, force.
inline constexpr std::size_t numbers_of_tick = 14;

template <Real Scalar>
using BitsOf = std::conditional_t<sizeof(Scalar) == 4, std::uint32_t, std::uint64_t>;

template <Real Scalar>
[[nodiscard]] std::array<Scalar, numbers_of_tick> numbers_of(const RecordedTick<Scalar>& tick) noexcept {
    const auto& [position, axis, radius, velocity, time, grasping] = tick.tool;
    const auto& force = tick.force;
    return {position.x(), position.y(), position.z(), axis.x(), axis.y(),  axis.z(),  radius,
            velocity.x(), velocity.y(), velocity.z(), time,     force.x(), force.y(), force.z()};
}

template <Real Scalar>
[[nodiscard]] RecordedTick<Scalar> tick_of(const std::array<Scalar, numbers_of_tick>& n, bool grasping) noexcept {
    return {.tool = {.position = {n[0], n[1], n[2]},
                     .axis = {n[3], n[4], n[5]},
                     .radius = n[6],
                     .velocity = {n[7], n[8], n[9]},
                     .time = n[10],
                     .grasping = grasping},
            .force = {n[11], n[12], n[13]}};
}

}  // namespace detail

template <Real Scalar>
bool identical(const RecordedTick<Scalar>& a, const RecordedTick<Scalar>& b) noexcept {
    const auto left = detail::numbers_of(a), right = detail::numbers_of(b);
    return std::memcmp(left.data(), right.data(), sizeof left) == 0 && a.tool.grasping == b.tool.grasping;
}

}  // namespace membrane
