// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include <membrane/haptics/force_limits.hpp>

namespace examples {

/// Statistics of the ticks of a device's own loop since its start, and the number of ticks in which each limit acted.
struct ServoReport {
    long ticks = 0;
    long late = 0;                    ///< That came more than 2 ms after the one before.
    double max_interval = 0;          ///< Between two ticks [s].
    double max_tick = 0;              ///< Duration of a tick [s].
    double hottest_motor = 0;         ///< As reported by the device: 0 is cold, 1 too hot.
    double max_force = 0;             ///< Largest written force [N].
    long errors = 0;                  ///< Ticks without force because of a temporary error of the device,
    const char* last_error = "none";  ///< the last of these.
    long refused = 0;                 ///< Ticks without force because tool or force was not finite.
    long faded = 0;  ///< The solver's state was old, or the force ramped up after that, after a fault or at the start.
    long peak = 0;   ///< Peak force of the device exceeded.
    long heat = 0;   ///< Thermal limit of the motors.
    long slew = 0;   ///< Slew limit.

    /// A tick, `interval` after the one before [s]; none for the first.
    void begin_tick(double interval) noexcept {
        ++ticks;
        max_interval = std::max(max_interval, interval);
        late += interval > 2e-3;
    }

    /// `held`: without force because of a temporary error.
    void count(const membrane::ActiveLimits& acted, bool held) noexcept {
        errors += held;
        refused += acted.fault && !held;
        faded += acted.faded;
        peak += acted.peak;
        heat += acted.heat;
        slew += acted.slew;
    }
};

}  // namespace examples
