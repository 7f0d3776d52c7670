// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>

#include <membrane/core/types.hpp>

/// Who does what may be done at the same time.
///
///     const auto in_my_pool = [&pool](membrane::Index count, const auto& task) { pool.for_each(count, task); };
///     auto solver = membrane::QuasiStaticSolver(network, {.order = membrane::VisitOrder::colours}, rule, in_my_pool);
namespace membrane {

namespace detail {

struct SomeTask {
    void operator()(Index i) const noexcept;
};

}  // namespace detail

/// `executor(count, task)` calls `task(i)` once for each `i` from 0 to `count` - 1, in any order and on any threads, and
/// returns when all are done. Neither throws.
template <class E>
concept Executor = std::copy_constructible<E> &&
    requires(const E& executor, Index count, const detail::SomeTask& task) {
    executor(count, task);
};

/// The thread that asks.
struct OneThread {
    template <class Task>
    void operator()(Index count, const Task& task) const noexcept {
        for (Index i = 0; i < count; ++i) task(i);
    }
};

static_assert(Executor<OneThread>);

/// Calls `act(i)` for `i` from 0 to `count` - 1, `at_once` of them in each task.
template <Executor Threads, class Act>
void share_out(const Threads& executor, Index count, Index at_once, const Act& act) noexcept {
    const Index tasks = count / at_once + (count % at_once > 0 ? 1 : 0);
    executor(tasks, [&](Index task) noexcept {
        const Index begin = task * at_once, left = count - begin;
        for (Index i = begin; i < begin + (left < at_once ? left : at_once); ++i) act(i);
    });
}

}  // namespace membrane
