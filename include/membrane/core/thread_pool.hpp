// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <thread>
#include <vector>

#include <membrane/core/check.hpp>
#include <membrane/core/executor.hpp>

/// Threads for the independent tasks of the library. No other header starts threads.
///
///     const membrane::ThreadPool pool(4);
///     auto solver = membrane::QuasiStaticSolver(network, options, membrane::BlockStep{}, pool.executor());
namespace membrane {

/// Threads that wait for tasks; the calling thread runs tasks too. Threads wait some ten microseconds without sleeping,
/// so that closely spaced calls find them awake. Waking sleeping threads is a system call.
///
/// Only one thread at a time may call the pool, and never from within a task.
class ThreadPool {
  public:
    /// `threads` includes the calling thread.
    /// @throws InvalidInput if `threads` is below 1; std::system_error if the system cannot start a thread
    explicit ThreadPool(int threads = (std::max)(1, static_cast<int>(std::thread::hardware_concurrency())));
    ~ThreadPool();  ///< Joins the threads.
    ThreadPool(const ThreadPool&) = delete;
    ThreadPool& operator=(const ThreadPool&) = delete;

    /// Number of threads, the calling one included.
    [[nodiscard]] int threads() const noexcept { return static_cast<int>(workers_.size()) + 1; }

    /// Calls `task(i)` once for each `i` from 0 to `count` - 1. Online, except for waking sleeping threads.
    template <class Task>
    void operator()(Index count, const Task& task) const noexcept;

    /// An executor that runs its tasks on this pool. The pool must outlive it.
    [[nodiscard]] auto executor() const noexcept {
        return [this](Index count, const auto& task) noexcept { (*this)(count, task); };
    }

  private:
    struct NoWorkers {};
    explicit ThreadPool(NoWorkers) noexcept {}

    struct Job {
        const void* task = nullptr;
        void (*run)(const void* task, Index i) noexcept = nullptr;
        Index count = 0;
    };

    void work() const noexcept;
    void serve() const noexcept;
    template <class T>
    static void wait_for_change(const std::atomic<T>& value, T old) noexcept;

    mutable Job job_;
    mutable std::atomic<std::int64_t> next_{0};        // next task of the job
    mutable std::atomic<std::uint32_t> job_count_{0};  // jobs started
    mutable std::atomic<int> busy_{0};                 // workers that have not finished the job
    mutable std::atomic<bool> over_{false};
    std::vector<std::thread> workers_;
};

// Delegates, so that the destructor joins the threads already started if starting one fails.
inline ThreadPool::ThreadPool(int threads) : ThreadPool(NoWorkers{}) {
    if (threads < 1) refuse("ThreadPool", "there must be at least 1 thread, got ", threads);
    workers_.reserve(static_cast<std::size_t>(threads) - 1);
    for (int i = 1; i < threads; ++i) workers_.emplace_back([this] { serve(); });
}

inline ThreadPool::~ThreadPool() {
    over_ = true;
    ++job_count_;
    job_count_.notify_all();
    for (auto& worker : workers_) worker.join();
}

template <class Task>
void ThreadPool::operator()(Index count, const Task& task) const noexcept {
    if (workers_.empty() || count < 2) return OneThread{}(count, task);
    job_ = {&task, [](const void* that, Index i) noexcept { (*static_cast<const Task*>(that))(i); }, count};
    next_.store(0, std::memory_order_relaxed);
    busy_.store(static_cast<int>(workers_.size()), std::memory_order_relaxed);
    job_count_.fetch_add(1, std::memory_order_release);
    job_count_.notify_all();
    work();
    for (int busy; (busy = busy_.load(std::memory_order_acquire)) > 0;) wait_for_change(busy_, busy);
}

inline void ThreadPool::work() const noexcept {
    const Job job = job_;
    for (std::int64_t i; (i = next_.fetch_add(1, std::memory_order_relaxed)) < job.count;) {
        job.run(job.task, static_cast<Index>(i));
    }
}

inline void ThreadPool::serve() const noexcept {
    for (std::uint32_t seen = 0;;) {
        wait_for_change(job_count_, seen);
        if (over_) return;
        ++seen;  // the next job begins after all workers have finished this one
        work();
        if (busy_.fetch_sub(1, std::memory_order_acq_rel) == 1) busy_.notify_one();
    }
}

// Spins for some ten microseconds before it sleeps: closely spaced jobs find the thread awake.
template <class T>
void ThreadPool::wait_for_change(const std::atomic<T>& value, T old) noexcept {
    for (int i = 0; i < 10'000; ++i) {
        if (value.load(std::memory_order_acquire) != old) return;
    }
    value.wait(old, std::memory_order_acquire);
}

}  // namespace membrane
