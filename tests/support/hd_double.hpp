// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <deque>
#include <limits>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <HD/hd.h>
#include <Eigen/Core>

/// A haptic device, its vendor's library and the hand that holds it, in place of all three: the functions of `HD/hd.h`
/// work on the `HdDouble` there is.
///
///     test::HdDouble hd({.latency = 2});
///     hd.fail("hdEndFrame", 100, HD_WARM_MOTORS);
///     device.start(tick);
///     hd.run(1000);                                  // a second of the virtual clock
///     CHECK(hd.violations().empty());
///
/// A call that fails does nothing but begin or end its frame: what was to be read is left as it was, what was to be
/// written is not.
namespace test {

/// A mass at the end of a spring and a damper, whose other end is where the hand wants to be.
struct HdHand {
    double mass = 0.1, damping = 4, stiffness = 50;  // [kg], [N s/m], [N/m]
    Eigen::Vector3d target = Eigen::Vector3d::Zero(), position = Eigen::Vector3d::Zero(),
                    velocity = Eigen::Vector3d::Zero();
    bool button = false;
};

struct HdOptions {
    bool real_clock = false;          // a thread of its own, in real time; else `run` is the device's thread
    double tick = 1e-3;               // [s]
    std::size_t latency = 0;          // ticks that positions are late
    double peak = 3.3, bearable = 1;  // forces: at most, and for ever [N]
    double heating = 10;              // time constant of the motors' temperature [s]
    HdHand hand = {};
};

/// A call of the interface, other than of the error stack.
struct HdCall {
    std::string_view name;
    long tick;   // 0 before the first
    bool servo;  // from the device's own thread
};

class HdDouble {
  public:
    static constexpr const char* name = "left";  // besides the default one

    explicit HdDouble(const HdOptions& options = {});
    ~HdDouble();
    HdDouble(const HdDouble&) = delete;
    HdDouble& operator=(const HdDouble&) = delete;

    /// The one there is. A program that is not a test of it has one all the same, with a real clock and a hand that
    /// presses down.
    static HdDouble& current();

    // What is to go wrong.

    /// `error` at a call of `call` in tick `tick` or later, after so many of these; of several there, the last is on
    /// top of the stack.
    void fail(std::string_view call, long tick, HDerror error, int after = 0) {
        faults_.push_back({call, tick, error, after});
    }
    /// From this tick on each call fails.
    void lose_connection(long tick) { lost_ = tick; }
    void connect() { lost_ = never; }
    /// A tick that comes late by `seconds`, one that does not come, and the first of those that never come again.
    void delay(long tick, double seconds) { delays_[tick] = seconds; }
    void miss(long tick) { missed_.insert(tick); }
    void fall_silent(long tick) { silent_ = tick; }
    bool calibrated = true;

    // The virtual clock: not while there is a real one.

    void run(int ticks) {
        for (int i = 0; i < ticks; ++i) tick();
    }
    double seconds() const { return time_; }
    long ticks() const { return ticks_; }
    bool real_clock() const { return options_.real_clock; }

    HdHand hand;
    Eigen::Vector3d stylus = Eigen::Vector3d::UnitZ();

    // What came of it; not while the device's own thread runs.

    /// What pushes the hand: stays on until another is written [N].
    const Eigen::Vector3d& force() const { return force_; }
    double temperature() const { return temperature_; }
    const std::vector<HdCall>& calls() const { return calls_; }
    void forget_calls() { calls_.clear(); }
    /// What the interface does not allow.
    const std::vector<std::string>& violations() const { return violations_; }
    std::size_t errors_left() const { return errors_.size(); }
    std::size_t faults_left() const { return faults_.size(); }
    bool open() const { return open_; }

    // The interface.

    HHD init(HDstring device);
    void disable(HHD device);
    void select(HHD device);
    void enable(HDenum what);
    HDenum check_calibration();
    void begin(HHD device);
    void end(HHD device);
    void get(HDenum what, HDdouble* values);
    void get(HDenum what, HDint* values);
    void set(HDenum what, const HDdouble* values);
    HDSchedulerHandle schedule(HDSchedulerCallback callback, void* user);
    void unschedule(HDSchedulerHandle schedule);
    void start();
    void stop();
    HDErrorInfo take_error();

  private:
    using Lock = std::lock_guard<std::mutex>;
    struct Fault {
        std::string_view call;
        long tick;
        HDerror error;
        int after;
    };
    static constexpr HHD handle = 7;
    static constexpr long never = std::numeric_limits<long>::max();

    void wrong(const std::string& what) { violations_.push_back(what + " in tick " + std::to_string(ticks_)); }
    void check(HHD device) {
        if (device != handle || !open_) wrong("a handle of nothing");
    }
    /// Whether the call fails.
    bool enter(std::string_view call);
    void tick();
    void move_hand();
    void run_in_real_time();
    void stop_thread();

    HdOptions options_;
    std::mutex mutex_;
    std::vector<Fault> faults_;
    std::map<long, double> delays_;
    std::set<long> missed_;
    long silent_ = never, lost_ = never;

    bool open_ = false, output_ = false, scheduling_ = false, in_frame_ = false, warm_ = false;
    HDSchedulerCallback callback_ = nullptr;
    void* user_ = nullptr;
    long ticks_ = 0;
    int frames_ = 0;  // of this tick
    double beat_ = 0, time_ = 0, temperature_ = 0;
    Eigen::Vector3d force_ = Eigen::Vector3d::Zero(), pending_ = force_;
    std::deque<HdHand> past_;  // the last is now
    std::vector<HDerror> errors_;
    std::vector<HdCall> calls_;
    std::vector<std::string> violations_;
    std::atomic<bool> quit_{false};
    std::thread thread_;
};

}  // namespace test
