// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include <membrane/solve/quasi_static.hpp>

#include "support/output.hpp"
#include "support/specimen.hpp"

namespace examples {

/// What `press_and_pull` can be told on the command line.
struct Settings {
    MeshOptions mesh = {};
    OutputOptions out = {};
    membrane::SolverOptions<double> solver{.layers = 6, .sweeps = 2};
    double pace = 1;          ///< Of the tool.
    std::string series = {};  ///< Folder, or empty.

    void add_to(CLI::App& app) {
        mesh.add_to(app);
        out.add_to(app);
        app.add_option("--series", series, "folder for a time series of every run, for ParaView");
        app.add_option("--layers", solver.layers, "threshold of the propagation queue")->capture_default_str();
        app.add_option("--sweeps", solver.sweeps, "passes over the queue in a step")->capture_default_str();
        app.add_flag_callback(
            "--quick", [this] { pace = 10; }, "the tool moves ten times as fast");
    }
};

}  // namespace examples
