// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include <membrane/haptics/force_limits.hpp>

namespace examples {

/// What became of the ticks of a device's own loop since its start, and what made the force of how many smaller.
struct ServoReport {
    long ticks = 0;
    long late = 0;                    ///< That came more than 2 ms after the one before.
    double max_interval = 0;          ///< From one to the next [s].
    double max_tick = 0;              ///< That one took [s].
    double hottest_motor = 0;         ///< As the device says: 0 is cold, 1 too hot.
    double max_force = 0;             ///< That was written [N].
    long errors = 0;                  ///< No force, for the device told of an error that passes,
    const char* last_error = "none";  ///< the last of these.
    long refused = 0;                 ///< No force, for tool or force was not finite.
    long faded = 0;  ///< The solver's state was old, or the force came in after that, a fault, the start.
    long peak = 0;   ///< More than the device bears.
    long heat = 0;   ///< More than its motors bear by now.
    long slew = 0;   ///< Grew too fast.

    /// A tick, `interval` after the one before [s]; none for the first.
    void begin_tick(double interval) noexcept {
        ++ticks;
        max_interval = std::max(max_interval, interval);
        late += interval > 2e-3;
    }

    /// `held`: by an error that passes.
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
