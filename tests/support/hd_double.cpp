// SPDX-License-Identifier: MIT
#include "support/hd_double.hpp"

namespace test {

namespace {

HdDouble* the_one = nullptr;
thread_local bool in_servo = false;

}  // namespace

HdDouble::HdDouble(const HdOptions& options) : hand(options.hand), options_(options) { the_one = this; }

HdDouble::~HdDouble() {
    if (thread_.joinable()) stop_thread();
    the_one = nullptr;
}

HdDouble& HdDouble::current() {
    if (the_one != nullptr) return *the_one;
    static HdDouble own({.real_clock = true, .hand = {.target = {0, -0.03, 0}}});
    return own;
}

bool HdDouble::enter(std::string_view call) {
    calls_.push_back({call, ticks_, in_servo});
    if (!in_servo && scheduling_ && call != "hdStopScheduler") wrong("called beside the device's own thread");
    const std::size_t before = errors_.size();
    const auto due = [&](Fault& fault) { return fault.call == call && ticks_ >= fault.tick && fault.after-- == 0; };
    for (auto fault = faults_.begin(); fault != faults_.end();) {
        if (due(*fault)) {
            errors_.push_back(fault->error);
            fault = faults_.erase(fault);
        } else {
            ++fault;
        }
    }
    if (ticks_ >= lost_) errors_.push_back(HD_COMM_ERROR);
    return errors_.size() > before;
}

// Open and close.

HHD HdDouble::init(HDstring device) {
    const Lock lock(mutex_);
    if (enter("hdInitDevice")) return HD_INVALID_HANDLE;
    if (device != nullptr && std::string_view(device) != name) {
        errors_.push_back(HD_DEVICE_FAULT);
        return HD_INVALID_HANDLE;
    }
    if (open_) wrong("opened twice");
    open_ = true;
    return handle;
}

void HdDouble::disable(HHD device) {
    const Lock lock(mutex_);
    const bool failed = enter("hdDisableDevice");
    check(device);
    if (scheduling_) wrong("closed while the scheduler runs");
    if (callback_ != nullptr) wrong("closed with a callback scheduled");
    if (!failed && !force_.isZero(0)) wrong("closed under force");
    force_.setZero();  // motors are off
    open_ = output_ = false;
}

void HdDouble::select(HHD device) {
    const Lock lock(mutex_);
    enter("hdMakeCurrentDevice");
    check(device);
}

void HdDouble::enable(HDenum what) {
    const Lock lock(mutex_);
    if (what != HD_FORCE_OUTPUT) wrong("enabled what is not known");
    if (!enter("hdEnable")) output_ = true;
}

HDenum HdDouble::check_calibration() {
    const Lock lock(mutex_);
    return !enter("hdCheckCalibration") && calibrated ? HD_CALIBRATION_OK : HD_CALIBRATION_NEEDS_UPDATE;
}

// A tick.

void HdDouble::begin(HHD device) {
    const Lock lock(mutex_);
    enter("hdBeginFrame");
    check(device);
    if (in_frame_) wrong("a frame begun in a frame");
    if (in_servo && ++frames_ > 1) wrong("two frames in a tick");
    in_frame_ = true;
    pending_ = force_;
}

void HdDouble::end(HHD device) {
    const Lock lock(mutex_);
    enter("hdEndFrame");
    check(device);
    if (!in_frame_) wrong("a frame ended that was not begun");
    in_frame_ = false;
    if (!output_) return;
    force_ = pending_;
    if (force_.norm() > options_.peak) errors_.push_back(HD_EXCEEDED_MAX_FORCE);
    if (warm_) errors_.push_back(HD_WARM_MOTORS);
}

void HdDouble::get(HDenum what, HDdouble* values) {
    const Lock lock(mutex_);
    if (enter("hdGetDoublev")) return;
    const auto give = [&](const auto& numbers) { std::copy_n(numbers.data(), numbers.size(), values); };
    if (what == HD_NOMINAL_MAX_FORCE || what == HD_NOMINAL_MAX_CONTINUOUS_FORCE) {
        *values = what == HD_NOMINAL_MAX_FORCE ? options_.peak : options_.bearable;
        return;
    }
    if (!in_frame_) wrong("asked outside of a frame");
    const HdHand& seen = past_.empty() ? hand : past_.front();
    Eigen::Matrix4d columns = Eigen::Matrix4d::Identity();
    columns.col(2).head<3>() = stylus;
    columns.col(3).head<3>() = 1e3 * seen.position;
    if (what == HD_CURRENT_POSITION) give(Eigen::Vector3d(1e3 * seen.position));
    if (what == HD_CURRENT_VELOCITY) give(Eigen::Vector3d(1e3 * seen.velocity));
    if (what == HD_MOTOR_TEMPERATURE) give(Eigen::Vector3d(temperature_, temperature_, temperature_));
    if (what == HD_CURRENT_TRANSFORM) give(columns);
}

void HdDouble::get(HDenum what, HDint* values) {
    const Lock lock(mutex_);
    if (!in_frame_ || what != HD_CURRENT_BUTTONS) wrong("asked for buttons outside of a frame");
    if (!enter("hdGetIntegerv")) *values = hand.button ? HD_DEVICE_BUTTON_1 : 0;
}

void HdDouble::set(HDenum what, const HDdouble* values) {
    const Lock lock(mutex_);
    if (!in_frame_ || what != HD_CURRENT_FORCE) wrong("a force outside of a frame");
    const Eigen::Vector3d force = Eigen::Map<const Eigen::Vector3d>(values);
    if (!force.allFinite()) wrong("a force that is not finite");
    if (!enter("hdSetDoublev")) pending_ = force;
}

// The scheduler.

HDSchedulerHandle HdDouble::schedule(HDSchedulerCallback callback, void* user) {
    const Lock lock(mutex_);
    if (enter("hdScheduleAsynchronous")) return HD_INVALID_HANDLE;
    if (callback_ != nullptr) wrong("scheduled twice");
    callback_ = callback;
    user_ = user;
    return handle;
}

void HdDouble::unschedule(HDSchedulerHandle schedule) {
    const Lock lock(mutex_);
    enter("hdUnschedule");
    check(static_cast<HHD>(schedule));
    if (scheduling_) wrong("unscheduled while the scheduler runs");
    callback_ = nullptr;
}

void HdDouble::start() {
    const Lock lock(mutex_);
    enter("hdStartScheduler");
    if (scheduling_) wrong("scheduler started twice");
    scheduling_ = true;
    if (options_.real_clock) thread_ = std::thread([this] { run_in_real_time(); });
}

void HdDouble::stop() {
    {
        const Lock lock(mutex_);
        enter("hdStopScheduler");
        if (!scheduling_) wrong("scheduler stopped that does not run");
    }
    if (options_.real_clock) stop_thread();
    scheduling_ = false;
}

HDErrorInfo HdDouble::take_error() {
    const Lock lock(mutex_);
    HDErrorInfo info{HD_SUCCESS, 0, handle};
    if (errors_.empty()) return info;
    info.errorCode = errors_.back();
    errors_.pop_back();
    return info;
}

void HdDouble::move_hand() {
    const double dt = options_.tick;
    const Eigen::Vector3d pull = hand.stiffness * (hand.target - hand.position) - hand.damping * hand.velocity;
    hand.velocity += dt / hand.mass * (force_ + pull);
    hand.position += dt * hand.velocity;
    past_.push_back(hand);
    if (past_.size() > options_.latency + 1) past_.pop_front();
    const double load = force_.norm() / options_.bearable;
    temperature_ += dt / options_.heating * (load * load - temperature_);
    warm_ = temperature_ >= (warm_ ? 0.9 : 1.0);
}

void HdDouble::tick() {
    HDSchedulerCallback callback = nullptr;
    {
        const Lock lock(mutex_);
        move_hand();
        ++ticks_;
        frames_ = 0;
        beat_ += options_.tick;
        const auto delay = delays_.extract(ticks_);
        time_ = std::max(time_, beat_ + (delay.empty() ? 0 : delay.mapped()));
        if (scheduling_ && missed_.erase(ticks_) == 0 && ticks_ < silent_) callback = callback_;
    }
    if (callback == nullptr) return;
    in_servo = true;
    const bool done = callback(user_) == HD_CALLBACK_DONE;
    in_servo = false;
    const Lock lock(mutex_);
    if (in_frame_) wrong("a frame left open");
    if (done) callback_ = nullptr;
}

void HdDouble::run_in_real_time() {
    auto next = std::chrono::steady_clock::now();
    const auto period =
        std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(options_.tick));
    while (!quit_) {
        next += period;
        std::this_thread::sleep_until(next);
        tick();
    }
}

void HdDouble::stop_thread() {
    quit_ = true;
    thread_.join();
    quit_ = false;
}

}  // namespace test

HHD hdInitDevice(HDstring name) { return test::HdDouble::current().init(name); }
void hdDisableDevice(HHD device) { test::HdDouble::current().disable(device); }
void hdMakeCurrentDevice(HHD device) { test::HdDouble::current().select(device); }
void hdEnable(HDenum what) { test::HdDouble::current().enable(what); }
HDenum hdCheckCalibration() { return test::HdDouble::current().check_calibration(); }
void hdBeginFrame(HHD device) { test::HdDouble::current().begin(device); }
void hdEndFrame(HHD device) { test::HdDouble::current().end(device); }
void hdGetDoublev(HDenum what, HDdouble* values) { test::HdDouble::current().get(what, values); }
void hdGetIntegerv(HDenum what, HDint* values) { test::HdDouble::current().get(what, values); }
void hdSetDoublev(HDenum what, const HDdouble* values) { test::HdDouble::current().set(what, values); }
void hdStartScheduler() { test::HdDouble::current().start(); }
void hdStopScheduler() { test::HdDouble::current().stop(); }
HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback, void* user, HDushort) {
    return test::HdDouble::current().schedule(callback, user);
}
void hdUnschedule(HDSchedulerHandle schedule) { test::HdDouble::current().unschedule(schedule); }
HDErrorInfo hdGetError() { return test::HdDouble::current().take_error(); }
HDstring hdGetErrorString(HDerror error) { return error == HD_WARM_MOTORS ? "warm motors" : "a fault"; }
