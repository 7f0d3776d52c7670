// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <type_traits>
#include <utility>

#include <membrane/core/types.hpp>

/// The deadline of a step.
///
///     using Clock = std::chrono::steady_clock;
///     const auto deadline = membrane::Deadline([] { return Clock::now(); }, Clock::now() + 300us);
///     const auto report = solver.step_until(deadline, x, dt, network, foundation, press(tool, contact));
namespace membrane {

/// A time of the caller's clock. `now()` returns the time as a number [s] or as a time point of std::chrono. A step
/// calls it: the guarantee that a step makes no system call holds if it holds for `now`.
template <class Now>
class Deadline {
  public:
    using Time = std::remove_cvref_t<std::invoke_result_t<const Now&>>;  ///< a number or a time point

    /// The time `at` of the clock `now`.
    Deadline(Now now, Time at) : now_(std::move(now)), at_(at) {}

    /// Time left [s]; negative after the deadline.
    [[nodiscard]] double left() const {
        if constexpr (std::is_arithmetic_v<Time>) {
            return static_cast<double>(at_) - static_cast<double>(now_());  // below zero for unsigned times, too
        } else {
            const auto left = at_ - now_();
            using Period = typename decltype(left)::period;
            return static_cast<double>(left.count()) * Period::num / Period::den;
        }
    }

  private:
    Now now_;
    Time at_;
};

/// Number of vertex updates beyond layer 0 between readings of the clock.
inline constexpr std::size_t updates_in_batch = 32;

/// Costs of the parts of a step, measured in the last steps.
struct StepCosts {
    double update = 0;       ///< [s]
    double enforcement = 0;  ///< in updates
    double residual = 4;     ///< of one residual force at the end, in updates; the initial value is a guess
    bool known = false;      ///< whether `residual` was measured
};

/// The time budget of a step: no limit, or until a deadline less the recent cost of the residual forces at the end. The
/// clock is read at every contact iteration and every batch of updates beyond layer 0.
class TimeBudget {
  public:
    TimeBudget() = default;  ///< No limit.

    /// Both must outlive this.
    template <class Now>
    TimeBudget(const Deadline<Now>& deadline, StepCosts& costs)
        : deadline_(&deadline),
          left_of_([](const void* of) { return static_cast<const Deadline<Now>*>(of)->left(); }),
          costs_(&costs) {}

    /// Whether there is a deadline.
    [[nodiscard]] bool limited() const noexcept { return deadline_ != nullptr; }

    /// Begins the updates; see `set_residual_count`.
    void begin(std::size_t vertices, std::size_t beyond = 0) {
        set_residual_count(vertices, beyond);
        if (limited()) left_ = left_of_(deadline_);
    }

    /// At the end of the step the residual forces on `vertices` are evaluated, and the forces on those `beyond` them,
    /// each of which takes about as long as an update.
    void set_residual_count(std::size_t vertices, std::size_t beyond = 0) {
        residual_count_ = static_cast<double>(vertices);
        beyond_ = static_cast<double>(beyond);
    }

    ///@{
    /// Whether there is time for a contact iteration of so many updates, or for a batch beyond layer 0. The first of
    /// each is always made, so that the membrane reaches its equilibrium.
    [[nodiscard]] bool has_time_for_contact(std::size_t updates) {
        return !limited() || std::exchange(first_contact_, false) ||
               has_time_for(static_cast<double>(updates) + costs_->enforcement);
    }
    [[nodiscard]] bool has_time_for_batch() {
        return !limited() || std::exchange(first_batch_, false) || has_time_for(updates_in_batch);
    }
    ///@}

    /// Whether there is time to enforce the constraints once more.
    [[nodiscard]] bool has_time_to_enforce() const { return !limited() || has_time_for(costs_->enforcement); }

    /// Counts `count` vertex updates, which took the time since the last call.
    void updated(std::size_t count) {
        if (!limited() || count == 0) return;
        time_ += lap();
        updates_ += static_cast<double>(count);
        if (time_ > 0) costs_->update = time_ / updates_;
    }

    /// Counts one enforcement, which took the time since the last call.
    void enforced() {
        if (limited()) costs_->enforcement = in_updates(lap());
    }

    /// Ends the step.
    void end() {
        if (!limited() || residual_count_ == 0) return;
        const double found = (std::max)(in_updates(lap()) - beyond_, 0.0) / residual_count_;
        const double known = costs_->residual;
        const bool first = !std::exchange(costs_->known, true);
        costs_->residual = first ? found : known + (std::clamp(found, known / 2, 2 * known) - known) / 4;
    }

  private:
    [[nodiscard]] bool has_time_for(double updates) const {
        return left_ >= costs_->update * (updates + costs_->residual * residual_count_ + beyond_);
    }
    [[nodiscard]] double in_updates(double time) const { return costs_->update > 0 ? time / costs_->update : 0; }
    [[nodiscard]] double lap() {
        const double before = std::exchange(left_, left_of_(deadline_));
        return (std::max)(before - left_, 0.0);
    }

    const void* deadline_ = nullptr;  // its type is known to `left_of_`
    double (*left_of_)(const void* deadline) = nullptr;
    StepCosts* costs_ = nullptr;
    double left_ = 0, residual_count_ = 0, beyond_ = 0, time_ = 0, updates_ = 0;
    bool first_contact_ = true, first_batch_ = true;
};

}  // namespace membrane
