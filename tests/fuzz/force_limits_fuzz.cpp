// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <membrane/haptics/force_limits.hpp>

#include "bytes.hpp"

// Any forces at any times through a limiter with any options: each output is what the device bears, no faster than the
// slew allows, and never against what was asked for.

using namespace membrane;
using test::Bytes;
using test::require;

namespace {

DeviceProfile any_device(Bytes& bytes) {
    constexpr std::array<DeviceProfile, 5> stock{devices::touch, devices::phantom_desktop, devices::premium_1_5,
                                                 devices::premium_3_0, devices::omega};
    DeviceProfile device = stock[static_cast<std::size_t>(bytes.index(5))];
    if (bytes.index(4) == 0) {
        device.peak_force = bytes.number(0.01, 100);
        device.continuous_force = device.peak_force * bytes.number(0.01, 1);
        device.thermal_time = bytes.number(0.1, 100);
    }
    return device;
}

LimitOptions any_options(Bytes& bytes) {
    LimitOptions options;
    const test::Switches changed(bytes.next<std::uint8_t>());
    const auto time = [&] { return std::pow(10, bytes.number(-6, 2)); };
    if (changed.on(0)) options.rise_time = changed.on(6) ? 0 : time();
    if (changed.on(1)) options.soft_start = changed.on(6) ? 0 : time();
    if (changed.on(2)) options.max_state_age = changed.on(6) ? std::numeric_limits<double>::infinity() : time();
    if (changed.on(3)) options.fade_time = changed.on(6) ? 0 : time();
    if (changed.on(4)) options.max_tick = time();
    options.thermal_limit = !changed.on(5);
    return options;
}

/// Whether the change is no larger than `most`, or straight towards zero, within the rounding of the forces' scalar.
template <Real S>
bool within_slew(const Vector3<double>& before, const Vector3<double>& after, double most) {
    constexpr double negligible = 1e-30;  // [N]; squares of less may underflow
    const double rounding =
        32 * static_cast<double>(std::numeric_limits<S>::epsilon()) * (std::max)(norm(before), norm(after)) +
        negligible;
    if (norm<double>(after - before) <= most * (1 + 1e-12) + rounding) return true;
    const double square = squared_norm(before);
    const double kept = square > 0 ? std::clamp(dot(after, before) / square, 0.0, 1.0) : 0.0;
    return norm<double>(after - kept * before) <= rounding;
}

/// Whether `felt` is not against `asked` and not more: asked . felt >= |felt|^2.
template <Real S>
bool along(const Vector3<S>& asked, const Vector3<double>& felt) {
    const Vector3<double> wanted = asked.template cast<double>();
    const double size = (std::max)(wanted.cwiseAbs().maxCoeff(), std::numeric_limits<double>::min());
    const double length = norm(felt), rounding = 64 * static_cast<double>(std::numeric_limits<S>::epsilon());
    const double share = dot<double>(wanted / size, felt);  // in units in which no square overflows
    return share >= (length / size) * length - rounding * length;
}

template <Real S>
void examine(Bytes bytes) {
    const DeviceProfile device = any_device(bytes);
    const LimitOptions options = any_options(bytes);
    ForceLimiter limit(device, options);
    Vector3<double> before = Vector3<double>::Zero();
    double now = 0, last = 0;
    bool began = false;
    std::uint64_t state = 0;
    while (bytes.left() > 0) {
        const test::Switches tick(bytes.next<std::uint8_t>());
        Vector3<S> force = bytes.vector<S>(-4, 4);
        if (tick.on(0)) force[bytes.index(3)] = bytes.wild<S>();
        now = last + (tick.on(1) ? bytes.number(-0.1, 0.1) : 1e-3);
        if (tick.on(2)) now = bytes.wild<double>();
        state += tick.on(3) ? 0 : 1;
        if (tick.on(4) && tick.on(5)) {
            limit.reset();
            before.setZero();
            began = false;
        }
        const Vector3<S> felt = limit(force, now, state);
        const Vector3<double> exact = felt.template cast<double>();
        require(is_finite(felt) && norm(exact) <= device.peak_force);
        require(limit.active_limits().any() || felt == force);
        if (!is_finite(force) || !is_finite(now)) {
            require(limit.active_limits().fault && felt == Vector3<S>::Zero());
        } else {
            require(!limit.active_limits().fault && along(force, exact));
        }
        const double grows = began && is_finite(now) ? std::clamp(now - last, 0.0, options.max_tick) : 0;
        if (options.rise_time > 0) {
            require(within_slew<S>(before, exact, device.peak_force / options.rise_time * grows));
        }
        const double hottest = device.peak_force / device.continuous_force;
        require(limit.thermal_load() >= 0 && limit.thermal_load() <= hottest * hottest * (1 + 1e-12));
        require(limit.gain() >= 0 && limit.gain() <= 1);
        before = exact;
        if (is_finite(now)) {
            last = now;
            began = true;
        }
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Bytes bytes(data, size);
    if (bytes.index(2) == 0) {
        examine<float>(bytes);
    } else {
        examine<double>(bytes);
    }
    return 0;
}
