// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <atomic>

namespace membrane {

/// Three slots through which one thread hands what it writes to another that reads, and neither ever waits: each owns a
/// slot, and one exchange of an atomic number swaps it for the slot in the middle.
///
///     TripleBuffer<Pose> poses;
///     poses.back() = pose;  poses.publish();          // one thread
///     if (poses.take()) draw(poses.front());          // another thread
///
/// Neither copied nor moved: two threads hold on to it.
template <class Slot>
class TripleBuffer {
  public:
    explicit TripleBuffer(const Slot& each = Slot()) : slots_{{{each}, {each}, {each}}} {}

    /// The writer's own slot: another one after each `publish`, with what was in it.
    [[nodiscard]] Slot& back() noexcept { return slots_[back_].slot; }

    /// Makes the writer's slot the newest one, in place of one that the reader has not taken. Returns whether there was
    /// none such: then the writer now has the slot that the reader has given back, and otherwise the one it published
    /// before this one.
    bool publish() noexcept {
        const unsigned old = middle_.exchange(back_ | fresh, std::memory_order_acq_rel);
        back_ = old & ~fresh;
        return (old & fresh) == 0;
    }

    /// Makes the newest slot the reader's, if it is newer than the one it has; returns whether it was. Never misses what
    /// was published before.
    bool take() noexcept {
        // A slot that is fresh stays so until it is taken here: what is exchanged below can only be newer.
        if ((middle_.load(std::memory_order_relaxed) & fresh) == 0) return false;
        front_ = middle_.exchange(front_, std::memory_order_acq_rel) & ~fresh;
        return true;
    }

    /// The reader's own slot: what it took last, or as it was made.
    [[nodiscard]] const Slot& front() const noexcept { return slots_[front_].slot; }

  private:
    static constexpr unsigned fresh = 4;  // beside the number of a slot: published and not taken
    static_assert(std::atomic<unsigned>::is_always_lock_free, "TripleBuffer needs an atomic number that takes no lock");

    struct alignas(64) OwnLine {  // so that writer and reader do not share a line of the cache
        Slot slot;
    };

    std::array<OwnLine, 3> slots_;
    alignas(64) std::atomic<unsigned> middle_{1};
    alignas(64) unsigned back_ = 0;   // the writer's
    alignas(64) unsigned front_ = 2;  // the reader's
};

}  // namespace membrane
