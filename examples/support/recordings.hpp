// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include <membrane/haptics/recording_file.hpp>

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

namespace detail {

/// `value(i)` of each of the first ticks; omits values that are not finite.
template <class Value>
[[nodiscard]] Curve traced(Curve curve, std::size_t ticks, Value value) {
    for (std::size_t i = 0; i < ticks; ++i) {
        const double now = value(i);
        if (std::isfinite(now)) curve.samples.push_back({static_cast<double>(i), now});
    }
    return curve;
}

}  // namespace detail

/// Two runs: displacement of the tool from its first position, force, and difference of the forces.
[[nodiscard]] inline Plot plot_of(const membrane::Recording<double>& first, const membrane::Recording<double>& second) {
    PlotPanel displacement{"displacement [mm]", {}}, force{"force [N]", {}};
    const auto add = [&](const auto& ticks, const Curve& curve) {
        const auto millimetres = [&](std::size_t i) {
            return 1e3 * (ticks[i].tool.position - ticks[0].tool.position).norm();
        };
        displacement.curves.push_back(detail::traced(curve, ticks.size(), millimetres));
        force.curves.push_back(detail::traced(curve, ticks.size(), [&](auto i) { return ticks[i].force.norm(); }));
    };
    add(first.ticks, {.name = "first", .colour = "#7fb3d5"});
    add(second.ticks, {.name = "second", .colour = "#7a2e0e", .dashed = true});
    const auto [both, most] = std::minmax({first.ticks.size(), second.ticks.size()});
    const auto apart = detail::traced({.name = "second less first", .colour = "#555"}, both, [&](std::size_t i) {
        return (second.ticks[i].force - first.ticks[i].force).norm();
    });
    return {.title = "Two traces",
            .phases = {{"", 0, static_cast<double>((std::max)(most, std::size_t{2}) - 1)}},
            .panels = {std::move(displacement), std::move(force), {"apart [N]", {apart}}},
            .axis = "tick"};
}

}  // namespace examples
