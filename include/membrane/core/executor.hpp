// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>
#include <cstddef>
#include <memory>

#include <membrane/core/types.hpp>

/// Execution of independent tasks.
///
///     const auto in_my_pool = [&](membrane::Index count, const auto& task) { pool.for_each(count, task); };
///     const membrane::SolverOptions<double> options{.order = membrane::UpdateOrder::colour_all};
///     auto solver = membrane::QuasiStaticSolver(network, options, rule, in_my_pool);
namespace membrane {

namespace detail {

struct SomeTask {
    void operator()(Index i) const noexcept;
};

}  // namespace detail

/// `executor(count, task)` calls `task(i)` once for each `i` from 0 to `count` - 1, in any order and on any threads. It
/// returns after the last call and keeps no reference to `task`. Neither may throw. `count` may be 0.
template <class E>
concept Executor = std::copy_constructible<E> &&
    requires(const E& executor, Index count, const detail::SomeTask& task) {
    executor(count, task);
};

namespace detail {

template <class E>
consteval bool check_executor() noexcept {
    static_assert(std::copy_constructible<E>, "Executor: must have a copy constructor");
    static_assert(
        Executor<E>,
        "Executor: executor(Index count, const Task& task) const must take any task that is called with an Index");
    return Executor<E>;
}

}  // namespace detail

/// An `Executor`; if `E` is not one, the compile error names the missing property.
template <class E>
concept CheckedExecutor = detail::check_executor<E>();

/// Runs all tasks on the calling thread, in order.
struct OneThread {
    /// Calls `task(i)` for `i` from 0 to `count` - 1.
    template <class Task>
    void operator()(Index count, const Task& task) const noexcept {
        for (Index i = 0; i < count; ++i) task(i);
    }
};

static_assert(Executor<OneThread>);

class AnyExecutor;

namespace detail {

// Excludes `AnyExecutor`, whose own check must not depend on its converting constructor.
template <class E>
concept OtherExecutor = !std::same_as<E, AnyExecutor> && CheckedExecutor<E>;

}  // namespace detail

/// A type-erased executor. Copies share the wrapped executor, which lives as long as the last copy. Objects that the
/// wrapped executor refers to, as a thread pool, must outlive it.
class AnyExecutor {
  public:
    AnyExecutor() = default;  ///< Runs tasks on the calling thread.

    /// Allocates, except for `OneThread`.
    template <detail::OtherExecutor E>
    AnyExecutor([[maybe_unused]] const E& executor) {  // NOLINT(google-explicit-constructor)
        if constexpr (!std::same_as<E, OneThread>) {
            executor_ = std::make_shared<const E>(executor);
            run_ = [](const void* of, Index count, const TaskRef& task) noexcept {
                (*static_cast<const E*>(of))(count, task);
            };
        }
    }

    /// Whether all tasks are known to run on the calling thread, in order.
    [[nodiscard]] bool is_serial() const noexcept { return executor_ == nullptr; }

    /// Runs the tasks on the wrapped executor.
    template <class Task>
    void operator()(Index count, const Task& task) const noexcept {
        if (is_serial()) return OneThread{}(count, task);
        run_(executor_.get(), count,
             {&task, [](const void* of, Index i) noexcept { (*static_cast<const Task*>(of))(i); }});
    }

  private:
    struct TaskRef {
        const void* task;
        void (*call)(const void* task, Index i) noexcept;
        void operator()(Index i) const noexcept { call(task, i); }
    };

    std::shared_ptr<const void> executor_;  // null: the calling thread
    void (*run_)(const void* executor, Index count, const TaskRef& task) noexcept = nullptr;
};

/// Splits the range from 0 to `count` into parts of at most `grain_size`; calls `act(begin, end)` in one task a part.
template <Executor E, class Act>
void parallel_for(const E& executor, std::size_t count, std::size_t grain_size, const Act& act) noexcept {
    const std::size_t tasks = count / grain_size + (count % grain_size > 0 ? 1 : 0);
    executor(static_cast<Index>(tasks), [&](Index task) noexcept {
        const std::size_t begin = static_cast<std::size_t>(task) * grain_size, left = count - begin;
        act(begin, begin + (left < grain_size ? left : grain_size));
    });
}

}  // namespace membrane
