// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <type_traits>
#include <utility>

#include <membrane/core/types.hpp>

/// When a step is to be over.
///
///     using Clock = std::chrono::steady_clock;
///     const auto deadline = membrane::Deadline([] { return Clock::now(); }, Clock::now() + 300us);
///     const auto report = solver.step_until(deadline, x, dt, network, backing, press(tool, contact));
namespace membrane {

/// A time of the caller's clock. `now()` gives the time as a number [s] or as a time point of std::chrono; it is called
/// within the step, so what the step promises, to call no system for one, it promises as far as the clock does.
template <class Now>
class Deadline {
  public:
    using Time = std::remove_cvref_t<std::invoke_result_t<const Now&>>;

    Deadline(Now now, Time at) : now_(std::move(now)), at_(at) {}

    /// Until then [s]; negative when it is past.
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

/// Beyond layer 0 the clock is read each time so many vertices have been visited.
inline constexpr std::size_t visits_in_batch = 32;

/// What the parts of a step cost, as the last steps have shown.
struct StepCosts {
    double visit = 0;        ///< [s]
    double enforcement = 0;  ///< in visits
    double closing = 4;      ///< for each vertex that the end of the step looks at, in visits; at first a guess
    bool known = false;
};

/// How a step without a deadline goes on: there is always time.
struct NoHurry {
    static constexpr void begin(std::size_t) noexcept {}
    static constexpr bool has_time_for_round(std::size_t) noexcept { return true; }
    static constexpr bool has_time_for_batch() noexcept { return true; }
    static constexpr bool has_time_to_enforce() noexcept { return true; }
    static constexpr void looks_at(std::size_t) noexcept {}
    static constexpr void visited(std::size_t) noexcept {}
    static constexpr void enforced() noexcept {}
    static constexpr void done() noexcept {}
};

/// How a step with a deadline does: it keeps as much time for its end as that took lately, a look at the forces on all
/// vertices at work. The clock is read with every round over layer 0 and every batch beyond.
class Hurry {
  public:
    template <class Now>
    Hurry(const Deadline<Now>& deadline, StepCosts& costs)
        : deadline_(&deadline),
          left_of_([](const void* of) { return static_cast<const Deadline<Now>*>(of)->left(); }),
          costs_(costs) {}

    /// The visits begin. The end of the step will look at so many vertices.
    void begin(std::size_t vertices) {
        looks_at(vertices);
        left_ = left_of_(deadline_);
    }
    void looks_at(std::size_t vertices) { closing_ = static_cast<double>(vertices); }

    /// Whether there is time for a round over so many vertices of layer 0, or for a batch beyond. The first of each is
    /// made in any case, or a membrane would never come to rest.
    [[nodiscard]] bool has_time_for_round(std::size_t visits) {
        return std::exchange(first_round_, false) || has_time_for(static_cast<double>(visits) + costs_.enforcement);
    }
    [[nodiscard]] bool has_time_for_batch() {
        return std::exchange(first_batch_, false) || has_time_for(visits_in_batch);
    }
    [[nodiscard]] bool has_time_to_enforce() const { return has_time_for(costs_.enforcement); }

    void visited(std::size_t count) {
        if (count == 0) return;
        time_ += lap();
        visits_ += static_cast<double>(count);
        if (time_ > 0) costs_.visit = time_ / visits_;
    }
    void enforced() { costs_.enforcement = in_visits(lap()); }

    /// The step is over.
    void done() {
        if (closing_ == 0) return;
        const double found = in_visits(lap()) / closing_, known = costs_.closing;
        const bool first = !std::exchange(costs_.known, true);
        costs_.closing = first ? found : known + (std::clamp(found, known / 2, 2 * known) - known) / 4;
    }

  private:
    [[nodiscard]] bool has_time_for(double visits) const {
        return left_ >= costs_.visit * (visits + costs_.closing * closing_);
    }
    [[nodiscard]] double in_visits(double time) const { return costs_.visit > 0 ? time / costs_.visit : 0; }
    [[nodiscard]] double lap() {
        const double before = std::exchange(left_, left_of_(deadline_));
        return (std::max)(before - left_, 0.0);
    }

    const void* deadline_;  // of whatever clock
    double (*left_of_)(const void* deadline);
    StepCosts& costs_;
    double left_ = 0, closing_ = 0, time_ = 0, visits_ = 0;
    bool first_round_ = true, first_batch_ = true;
};

}  // namespace membrane
