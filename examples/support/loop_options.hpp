// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/core/types.hpp>

#include "support/command_line.hpp"

/// How the loop of an operation ticks.
namespace examples {

struct LoopOptions {
    membrane::Index sweeps = 8;  ///< of a step
    double tick = 1e-3;          ///< [s]
    double drag = 0;             ///< of a viscous fluid, on each vertex [N s/m]

    void add_to(CommandLine& command) {
        command.add("--sweeps", sweeps, "passes over the vertices in each step");
        command.add_within("--tick", tick, 5e-5, 1e-2, "time of a tick [s]");
        command.add_within("--drag", drag, 0, 1e-2, "of a viscous fluid on each vertex [N s/m]");
    }
};

}  // namespace examples
