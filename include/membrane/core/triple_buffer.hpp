// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <atomic>

namespace membrane {

/// Passes values from one writer thread to one reader thread; neither ever waits. Each thread owns one of three slots,
/// and one atomic exchange swaps it with the middle slot.
///
///     membrane::TripleBuffer<Pose> poses;
///     poses.back() = pose;  poses.publish();             // one thread
///     if (poses.acquire()) draw(poses.front());          // another thread
///
/// Neither copyable nor movable: two threads refer to it.
template <class Slot>
class TripleBuffer {
  public:
    /// Copies `each` to the three slots. None is published.
    explicit TripleBuffer(const Slot& each = Slot()) : slots_{{{each}, {each}, {each}}} {}

    /// The writer's slot: after each `publish` a different one, with its old contents.
    [[nodiscard]] Slot& back() noexcept { return slots_[back_].slot; }

    /// Publishes the writer's slot; it replaces a published slot that the reader has not taken. If there was no such
    /// slot, returns true, and the writer gets the slot that the reader gave back. Otherwise returns false, and the
    /// writer gets back the replaced slot.
    bool publish() noexcept {
        const unsigned old = middle_.exchange(back_ | fresh, std::memory_order_acq_rel);
        back_ = old & ~fresh;
        return (old & fresh) == 0;
    }

    /// If a slot was published since the last `acquire`, makes the newest one the reader's and returns true. Never
    /// misses a slot published before the call.
    bool acquire() noexcept {
        // A fresh slot stays fresh until it is acquired here: the exchange below can only get a newer one.
        if ((middle_.load(std::memory_order_relaxed) & fresh) == 0) return false;
        front_ = middle_.exchange(front_, std::memory_order_acq_rel) & ~fresh;
        return true;
    }

    /// The reader's slot: the last one taken, or the initial one.
    [[nodiscard]] const Slot& front() const noexcept { return slots_[front_].slot; }

  private:
    static constexpr unsigned fresh = 4;  // flag beside the slot's number: published, not yet taken
    static_assert(std::atomic<unsigned>::is_always_lock_free, "TripleBuffer needs an atomic number that takes no lock");

    struct alignas(64) OwnLine {  // writer and reader must not share a cache line
        Slot slot;
    };

    std::array<OwnLine, 3> slots_;
    alignas(64) std::atomic<unsigned> middle_{1};
    alignas(64) unsigned back_ = 0;   // the writer's
    alignas(64) unsigned front_ = 2;  // the reader's
};

}  // namespace membrane
