// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <vector>

#include <membrane/replay/recording_file.hpp>

#include "support/plot.hpp"

/// Recordings as files, and two of them in one picture.

namespace examples {

/// @throws std::runtime_error for a file that cannot be read or is no recording
[[nodiscard]] inline membrane::Recording<double> read(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw std::runtime_error("cannot read " + path.string());
    try {
        return membrane::read_recording<double>(file);
    } catch (const membrane::InvalidInput& error) {
        throw std::runtime_error(path.string() + ": " + error.what());
    }
}

/// The recording, and beside it a table, `path`.csv.
/// @throws std::runtime_error for a file that cannot be written
inline void save(const std::filesystem::path& path, const membrane::Recording<double>& recording) {
    std::ofstream file(path, std::ios::binary), table(path.string() + ".csv");
    write_recording(file, recording);
    write_csv(table, recording);
    if (!file.flush() || !table.flush()) throw std::runtime_error("cannot write " + path.string());
}

/// Two runs: displacement of the tool from its first position [mm] in each, force [N] in each, and difference of the
/// forces, over the ticks; without values that are not finite.
[[nodiscard]] inline std::vector<Curve> curves_of(const membrane::Recording<double>& first,
                                                  const membrane::Recording<double>& second) {
    std::vector<Curve> curves(5);
    const auto add = [&](std::size_t curve, std::size_t tick, double value) {
        if (std::isfinite(value)) curves[curve].push_back({static_cast<double>(tick), value});
    };
    for (std::size_t run = 0; run < 2; ++run) {
        const auto& ticks = (run == 0 ? first : second).ticks;
        for (std::size_t i = 0; i < ticks.size(); ++i) {
            add(run, i, 1e3 * (ticks[i].tool.position - ticks[0].tool.position).norm());
            add(2 + run, i, ticks[i].force.norm());
        }
    }
    for (std::size_t i = 0; i < std::min(first.ticks.size(), second.ticks.size()); ++i) {
        add(4, i, (second.ticks[i].force - first.ticks[i].force).norm());
    }
    return curves;
}

}  // namespace examples
