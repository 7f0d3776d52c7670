// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include <membrane/solve/quasi_static.hpp>

#include "support/output.hpp"
#include "support/specimen.hpp"

namespace examples {

/// The options of `press_and_pull` on the command line.
struct Settings {
    MeshOptions mesh = {};
    OutputOptions out = {};
    membrane::SolverOptions<double> solver{.layers = 6, .sweeps = 2};
    double speed_factor = 1;  ///< Of the tool.
    std::string series = {};  ///< Folder, or empty.

    void add_to(CommandLine& command) {
        mesh.add_to(command);
        out.add_to(command);
        command.add("--series", series, "folder for a time series of every run, for ParaView");
        command.add("--layers", solver.layers, "threshold of the propagation queue");
        command.add("--sweeps", solver.sweeps, "passes over the queue in a step");
        command.add_flag(
            "--quick", [this] { speed_factor = 10; }, "the tool moves ten times as fast");
    }
};

}  // namespace examples
