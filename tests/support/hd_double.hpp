// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <map>
#include <mutex>
#include <set>
#include <string>
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
    double heating = 5;               // time constant of the motors' temperature [s]
    HdHand hand = {};
};

/// A call of the interface, other than of the error stack.
struct HdCall {
    std::string name;
    long tick;   // 0 before the first
    bool servo;  // from the device's own thread
};

class HdDouble {
  public:
    explicit HdDouble(const HdOptions& options = {}) : hand(options.hand), options_(options) { current() = this; }
    ~HdDouble() {
        if (thread_.joinable()) stop_thread();
        current() = nullptr;
    }
    HdDouble(const HdDouble&) = delete;
    HdDouble& operator=(const HdDouble&) = delete;

    static HdDouble*& current() {
        static HdDouble* the_one = nullptr;
        return the_one;
    }

    // What is to go wrong.

    /// `error` at the first call of `name` in tick `tick` or later; of several there, the last is on top of the stack.
    void fail(const std::string& name, long tick, HDerror error) { faults_.push_back({name, tick, error}); }
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
    bool real_clock() const { return options_.real_clock; }

    HdHand hand;
    Eigen::Vector3d stylus = Eigen::Vector3d::UnitZ();

    // What came of it; not while the device's own thread runs.

    /// What pushes the hand: stays on until another is written [N].
    const Eigen::Vector3d& force() const { return force_; }
    double temperature() const { return temperature_; }
    const std::vector<HdCall>& calls() const { return calls_; }
    /// What the interface does not allow.
    const std::vector<std::string>& violations() const { return violations_; }
    std::size_t errors_left() const { return errors_.size(); }
    bool open() const { return open_; }

    // The interface.

    HHD init() {
        const Lock lock(mutex_);
        if (enter("hdInitDevice")) return HD_INVALID_HANDLE;
        if (open_) wrong("opened twice");
        open_ = true;
        return handle;
    }
    void disable(HHD device) {
        const Lock lock(mutex_);
        enter("hdDisableDevice");
        check(device);
        if (scheduling_) wrong("closed while the scheduler runs");
        if (callback_ != nullptr) wrong("closed with a callback scheduled");
        open_ = output_ = false;
    }
    void select(HHD device) {
        const Lock lock(mutex_);
        enter("hdMakeCurrentDevice");
        check(device);
    }
    void enable(HDenum what) {
        const Lock lock(mutex_);
        enter("hdEnable");
        if (what != HD_FORCE_OUTPUT) wrong("enabled what is not known");
        output_ = true;
    }
    HDenum check_calibration() {
        const Lock lock(mutex_);
        enter("hdCheckCalibration");
        return calibrated ? HD_CALIBRATION_OK : HD_CALIBRATION_NEEDS_UPDATE;
    }
    void begin(HHD device) {
        const Lock lock(mutex_);
        enter("hdBeginFrame");
        check(device);
        if (in_frame_) wrong("a frame begun in a frame");
        if (servo() && ++frames_ > 1) wrong("two frames in a tick");
        if (!servo() && scheduling_) wrong("a frame beside the device's own thread");
        in_frame_ = true;
        pending_ = force_;
    }
    void end(HHD device) {
        const Lock lock(mutex_);
        enter("hdEndFrame");
        check(device);
        if (!in_frame_) wrong("a frame ended that was not begun");
        in_frame_ = false;
        if (!output_) return;
        force_ = pending_;
        if (force_.norm() > options_.peak * (1 + 1e-12)) errors_.push_back(HD_EXCEEDED_MAX_FORCE);
        if (temperature_ >= 1) errors_.push_back(HD_WARM_MOTORS);
    }
    void get(HDenum what, HDdouble* values) {
        const Lock lock(mutex_);
        enter("hdGetDoublev");
        const bool limit = what == HD_NOMINAL_MAX_FORCE;
        if (!limit && !in_frame_) wrong("asked outside of a frame");
        const HdHand& seen =
            past_.empty() ? hand : past_[past_.size() > options_.latency ? past_.size() - 1 - options_.latency : 0];
        const auto give = [&](const auto& numbers) { std::copy_n(numbers.data(), numbers.size(), values); };
        Eigen::Matrix4d columns = Eigen::Matrix4d::Identity();
        columns.col(2).head<3>() = stylus;
        columns.col(3).head<3>() = 1e3 * seen.position;
        if (limit) *values = options_.peak;
        if (what == HD_CURRENT_POSITION) give(Eigen::Vector3d(1e3 * seen.position));
        if (what == HD_CURRENT_VELOCITY) give(Eigen::Vector3d(1e3 * seen.velocity));
        if (what == HD_MOTOR_TEMPERATURE) give(Eigen::Vector3d(temperature_, temperature_, temperature_));
        if (what == HD_CURRENT_TRANSFORM) give(columns);
    }
    void get(HDenum what, HDint* values) {
        const Lock lock(mutex_);
        enter("hdGetIntegerv");
        if (!in_frame_ || what != HD_CURRENT_BUTTONS) wrong("asked for buttons outside of a frame");
        *values = hand.button ? HD_DEVICE_BUTTON_1 : 0;
    }
    void set(HDenum what, const HDdouble* values) {
        const Lock lock(mutex_);
        enter("hdSetDoublev");
        if (!in_frame_ || what != HD_CURRENT_FORCE) wrong("a force outside of a frame");
        pending_ = Eigen::Map<const Eigen::Vector3d>(values);
        if (!pending_.allFinite()) wrong("a force that is not finite");
    }
    HDSchedulerHandle schedule(HDSchedulerCallback callback, void* user) {
        const Lock lock(mutex_);
        if (enter("hdScheduleAsynchronous")) return HD_INVALID_HANDLE;
        if (callback_ != nullptr) wrong("scheduled twice");
        callback_ = callback;
        user_ = user;
        return handle;
    }
    void unschedule(HDSchedulerHandle schedule) {
        const Lock lock(mutex_);
        enter("hdUnschedule");
        check(static_cast<HHD>(schedule));
        if (scheduling_) wrong("unscheduled while the scheduler runs");
        callback_ = nullptr;
    }
    void start() {
        const Lock lock(mutex_);
        enter("hdStartScheduler");
        if (scheduling_) wrong("scheduler started twice");
        scheduling_ = true;
        if (options_.real_clock) thread_ = std::thread([this] { run_in_real_time(); });
    }
    void stop() {
        {
            const Lock lock(mutex_);
            enter("hdStopScheduler");
            if (!scheduling_) wrong("scheduler stopped that does not run");
        }
        if (options_.real_clock) stop_thread();
        scheduling_ = false;
    }
    HDErrorInfo take_error() {
        const Lock lock(mutex_);
        HDErrorInfo info{HD_SUCCESS, 0, handle};
        if (errors_.empty()) return info;
        info.errorCode = errors_.back();
        errors_.pop_back();
        return info;
    }

  private:
    using Lock = std::lock_guard<std::mutex>;
    struct Fault {
        std::string name;
        long tick;
        HDerror error;
    };
    static constexpr HHD handle = 7;

    static bool& servo() {
        thread_local bool in_callback = false;
        return in_callback;
    }
    void wrong(const std::string& what) { violations_.push_back(what + " in tick " + std::to_string(ticks_)); }
    void check(HHD device) {
        if (device != handle || !open_) wrong("a handle of nothing");
    }

    /// Whether the call fails.
    bool enter(const char* name) {
        calls_.push_back({name, ticks_, servo()});
        const auto due = [&](const Fault& fault) { return fault.name == name && ticks_ >= fault.tick; };
        const std::size_t before = errors_.size();
        for (const Fault& fault : faults_) {
            if (due(fault)) errors_.push_back(fault.error);
        }
        faults_.erase(std::remove_if(faults_.begin(), faults_.end(), due), faults_.end());
        return errors_.size() > before;
    }

    void tick() {
        HDSchedulerCallback callback = nullptr;
        {
            const Lock lock(mutex_);
            const double dt = options_.tick;
            hand.velocity += dt / hand.mass *
                             (force_ + hand.stiffness * (hand.target - hand.position) - hand.damping * hand.velocity);
            hand.position += dt * hand.velocity;
            past_.push_back(hand);
            const double load = force_.norm() / options_.bearable;
            temperature_ += dt / options_.heating * (load * load - temperature_);
            ++ticks_;
            frames_ = 0;
            beat_ += dt;
            time_ = std::max(time_, beat_ + (delays_.count(ticks_) != 0 ? delays_[ticks_] : 0));
            if (scheduling_ && missed_.count(ticks_) == 0 && ticks_ < silent_) callback = callback_;
        }
        if (callback == nullptr) return;
        servo() = true;
        const bool done = callback(user_) == HD_CALLBACK_DONE;
        servo() = false;
        const Lock lock(mutex_);
        if (in_frame_) wrong("a frame left open");
        if (done) callback_ = nullptr;
    }

    void run_in_real_time() {
        auto next = std::chrono::steady_clock::now();
        while (!quit_) {
            next += std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                std::chrono::duration<double>(options_.tick));
            std::this_thread::sleep_until(next);
            tick();
        }
    }
    void stop_thread() {
        quit_ = true;
        thread_.join();
        quit_ = false;
    }

    HdOptions options_;
    std::mutex mutex_;
    std::vector<Fault> faults_;
    std::map<long, double> delays_;
    std::set<long> missed_;
    long silent_ = 1'000'000'000;

    bool open_ = false, output_ = false, scheduling_ = false, in_frame_ = false;
    HDSchedulerCallback callback_ = nullptr;
    void* user_ = nullptr;
    long ticks_ = 0;
    int frames_ = 0;  // of this tick
    double beat_ = 0, time_ = 0, temperature_ = 0;
    Eigen::Vector3d force_ = Eigen::Vector3d::Zero(), pending_ = force_;
    std::vector<HdHand> past_;
    std::vector<HDerror> errors_;
    std::vector<HdCall> calls_;
    std::vector<std::string> violations_;
    std::atomic<bool> quit_{false};
    std::thread thread_;
};

}  // namespace test

// The functions of the header. A program that is not a test of the double has one all the same, with a real clock.
inline test::HdDouble& hd_double() {
    if (test::HdDouble::current() != nullptr) return *test::HdDouble::current();
    static test::HdDouble own({.real_clock = true});
    return own;
}
inline HHD hdInitDevice(HDstring) { return hd_double().init(); }
inline void hdDisableDevice(HHD device) { hd_double().disable(device); }
inline void hdMakeCurrentDevice(HHD device) { hd_double().select(device); }
inline void hdEnable(HDenum what) { hd_double().enable(what); }
inline HDenum hdCheckCalibration() { return hd_double().check_calibration(); }
inline void hdBeginFrame(HHD device) { hd_double().begin(device); }
inline void hdEndFrame(HHD device) { hd_double().end(device); }
inline void hdGetDoublev(HDenum what, HDdouble* values) { hd_double().get(what, values); }
inline void hdGetIntegerv(HDenum what, HDint* values) { hd_double().get(what, values); }
inline void hdSetDoublev(HDenum what, const HDdouble* values) { hd_double().set(what, values); }
inline void hdStartScheduler() { hd_double().start(); }
inline void hdStopScheduler() { hd_double().stop(); }
inline HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback, void* user, HDushort) {
    return hd_double().schedule(callback, user);
}
inline void hdUnschedule(HDSchedulerHandle schedule) { hd_double().unschedule(schedule); }
inline HDErrorInfo hdGetError() { return hd_double().take_error(); }
inline HDstring hdGetErrorString(HDerror error) { return error == HD_WARM_MOTORS ? "warm motors" : "a fault"; }
