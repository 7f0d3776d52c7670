// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/openhaptics_on_double.hpp"
#include "support/random.hpp"

using namespace membrane;
using namespace test;
using examples::Answer;

namespace {

enum class Fault { none, force, huge, frozen, gap, teleport, no_place, passing, final, thrown, stop, destroy, count };

/// A hand that strokes about, a policy that pushes it, and whatever can go wrong with either, solver, device and user.
class Wild {
  public:
    explicit Wild(std::uint64_t seed) : random_(seed) { open(); }

    /// A tick of the device's, if one comes.
    void tick();
    /// By the user, or after a run that has ended; by the rules.
    void close();

    HdDouble hd;
    Fault fault = Fault::none;
    bool starts = false;          ///< Device closed and opened before this tick.
    bool failing = false;         ///< A call of this tick meets an error,
    bool too_late = false;        ///< after the force was written.
    Force asked = Force::Zero();  ///< By the policy.
    double fresh = 0;             ///< When the solver last had something new [s].

  private:
    void open();
    void choose();
    void fail_somewhere();
    Answer result(const Tool<double>& tool);

    std::optional<OpenHaptics> device_{std::in_place};
    Random random_;
    int left_ = 0;  // ticks of this fault, or without
    HdHand hand_;   // before it was nowhere
    std::uint64_t solves_ = 0;
};

void Wild::open() {
    if (!device_) device_.emplace();
    device_->start([this](const Tool<double>& tool) { return result(tool); });
    hd.forget_calls();
    starts = true;
    fresh = hd.seconds();
}

void Wild::close() {
    hd.forget_calls();
    if (fault == Fault::destroy) device_.reset();
    if (device_) device_->stop();
    Names closed = in_turn({{in_tick, 1}, {closing, 1}}), ended = closing;
    if (names(hd) != closed && names(hd) != ended) FAIL("closed in another order");
    if (hd.open() || !hd.force().isZero(0) || hd.errors_left() > 0) FAIL("not closed");
}

void Wild::choose() {
    if (fault == Fault::no_place) hd.hand = hand_;
    if (fault == Fault::none) {
        fault = static_cast<Fault>(1 + random_.index(static_cast<Index>(Fault::count) - 1));
        left_ = fault >= Fault::final || fault == Fault::teleport ? 1
                : fault == Fault::gap                             ? 51
                : fault == Fault::frozen                          ? 1 + random_.index(300)
                                                                  : 1 + random_.index(20);
    } else {
        fault = Fault::none;
        left_ = 1 + random_.index(500);
    }
    hand_ = hd.hand;
    const long next = hd.ticks() + 1;
    if (fault == Fault::gap) {
        for (int i = 0; i < 50; ++i) hd.miss(next + i);
    }
    if (fault == Fault::teleport) hd.hand.position += std::pow(10, random_.number(-3.0, 3.0)) * random_.unit_vector();
    if (fault == Fault::no_place) hd.hand.position[random_.index(3)] = std::numeric_limits<double>::quiet_NaN();
}

void Wild::fail_somewhere() {
    const auto any_of = [&](const auto& list) {
        return static_cast<std::size_t>(random_.index(static_cast<Index>(list.size())));
    };
    const auto call = any_of(in_tick);
    const HDerror error =
        fault == Fault::passing ? passing_errors[any_of(passing_errors)] : final_errors[any_of(final_errors)];
    hd.fail(in_tick[call], hd.ticks() + 1, error, calls_before(in_tick, call));
    too_late = in_tick[call] == "hdEndFrame";
}

Answer Wild::result(const Tool<double>& tool) {
    if (fault == Fault::thrown) throw std::runtime_error("thrown");
    if (fault != Fault::frozen && random_.chance(0.3)) {
        ++solves_;
        fresh = hd.seconds();
    }
    const Vector3<double> place = 30 * tool.position;
    asked = 0.5 * Force(std::sin(place.x()), std::cos(place.y()), std::sin(place.z()));
    if (fault == Fault::force) {
        constexpr double infinity = std::numeric_limits<double>::infinity();
        constexpr std::array<double, 3> no_numbers{infinity, -infinity, std::numeric_limits<double>::quiet_NaN()};
        asked[random_.index(3)] = no_numbers[static_cast<std::size_t>(random_.index(3))];
    }
    if (fault == Fault::huge) asked = std::pow(10, random_.chance(0.5) ? 6 : random_.number(0.0, 307.0)) * asked;
    return {asked, solves_};
}

void Wild::tick() {
    if (left_-- == 0) {
        choose();
        --left_;
    }
    starts = false;
    if (fault >= Fault::stop || !device_->running()) {
        close();
        open();
    }
    hd.forget_calls();
    const double now = hd.seconds();
    hd.hand.target = 0.05 * Vector3<double>(std::sin(now), std::cos(1.3 * now), std::sin(0.7 * now));
    hd.delay(hd.ticks() + 1, 9e-4 * random_.number());  // jitter, always
    failing = fault == Fault::passing || fault == Fault::final;
    too_late = false;
    if (failing) fail_somewhere();
    hd.run(1);
}

}  // namespace

TEST_CASE("whatever goes wrong in a device's loop, each tick keeps within profile and slew", "[openhaptics]") {
    const double peak = devices::touch.peak_force, slew = peak / LimitOptions{}.rise_time;
    Wild wild(11);
    const auto& hd = wild.hd;
    const int ticks = cases(200'000, 1'000'000);
    std::array<long, static_cast<std::size_t>(Fault::count)> seen{};
    long whole = 0, frozen = 0;
    double before = 0, last = 0, clean_since = 0;
    bool withdrawn = false;
    for (int i = 0; i < ticks; ++i) {
        CAPTURE(i);
        wild.tick();
        const auto fault = wild.fault;
        const double now = hd.seconds(), size = hd.force().norm();
        ++seen[static_cast<std::size_t>(fault)];
        const Names called = names(hd);
        if (called.empty() && fault == Fault::gap) continue;  // the force is held, as on a real device
        if (called != in_tick && !(wild.failing && called == in_tick_withdrawn)) FAIL("calls of another order");

        const double may_grow = wild.starts ? 0 : slew * std::clamp(now - last, 0.0, 2e-3);
        if (!(size <= peak && size <= (wild.starts ? 0 : before) + may_grow)) FAIL(size << " N after " << before);
        const bool without = fault == Fault::force || fault == Fault::no_place || fault == Fault::thrown ||
                             (wild.failing && !wild.too_late) || (withdrawn && !wild.starts);
        if (without && size != 0) FAIL(size << " N in spite of fault " << static_cast<int>(fault));
        if (now - wild.fresh > 0.1) {
            ++frozen;
            if (size != 0) FAIL("frozen, and " << size << " N");
        }
        const bool rushing = hd.hand.velocity.norm() > 1;  // back from where it was moved: the policy's force jumps
        const bool stale = now - wild.fresh > LimitOptions{}.max_state_age;
        if (fault != Fault::none || wild.starts || withdrawn || rushing || stale) clean_since = now;
        if (now - clean_since > 0.2) {
            ++whole;
            if (!same_bits(hd.force(), wild.asked.eigen())) FAIL("not the policy's force");
        }
        before = size;
        last = now;
        withdrawn = wild.too_late;
    }
    wild.close();
    CHECK(hd.violations() == std::vector<std::string>{});
    CHECK(whole > ticks / 20);  // the cases that the test is about did occur
    CHECK(frozen > 0);
    for (const long times : seen) CHECK((times > 0 || ticks < 100'000));
}
