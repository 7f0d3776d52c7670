// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <fstream>
#include <iomanip>
#include <numeric>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "support/page.hpp"
#include "support/record.hpp"
#include "support/rigid_fit.hpp"
#include "support/scenes.hpp"
#include "support/text.hpp"

/// The results of `press_and_pull`: tables for people, JSON and CSV for programs.
namespace examples {

/// A scene run with and without virtual volume springs.
struct Outcome {
    Scene scene;
    Record with, without;
};

/// Times of the frames with an active membrane.
struct Speed {
    std::size_t frames = 0;                      ///< With an active membrane.
    std::array<double, parts.size()> seconds{};  ///< Of each part, mean over the frames.

    [[nodiscard]] double frames_per_second() const { return 1 / std::accumulate(seconds.begin(), seconds.end(), 0.0); }
};

[[nodiscard]] inline Speed speed(const Record& record) {
    Speed result;
    for (const Frame& frame : record.frames) {
        if (!frame.active) continue;
        ++result.frames;
        for (std::size_t k = 0; k < parts.size(); ++k) result.seconds[k] += frame.seconds[k];
    }
    for (double& seconds : result.seconds) seconds /= static_cast<double>(result.frames);
    return result;
}

/// Largest force of a run [N]: `&Frame::felt` or `&Frame::reaction`.
[[nodiscard]] inline double peak(const Record& record, Vector3d Frame::*force) {
    double largest = 0;
    for (const Frame& frame : record.frames) largest = std::max(largest, (frame.*force).norm());
    return largest;
}

/// Largest distance of the membrane from its rest shape at the end of `step`, over its radius; rigid drift removed.
[[nodiscard]] inline double shape_error(const Scene& scene, const Record& record, Step step) {
    return distance_from_shape(record.snapshots[step].points, scene.mesh.positions()) / scene.radius;
}

/// The names of processor and compiler, as far as known.
[[nodiscard]] inline std::string machine() {
    std::string processor = "an unknown processor";
    std::ifstream cpuinfo("/proc/cpuinfo");
    for (std::string line; std::getline(cpuinfo, line);) {
        if (line.rfind("model name", 0) != 0) continue;
        processor = line.substr(line.find(':') + 2);
        break;
    }
#if defined(__clang__)
    return processor + ", clang " + std::to_string(__clang_major__);
#elif defined(__GNUC__)
    return processor + ", gcc " + std::to_string(__GNUC__);
#else
    return processor;
#endif
}

[[nodiscard]] inline Table speed_table(const std::vector<Outcome>& outcomes, membrane::Index layers) {
    Table table{{"scene", "vertices", "triangles", "layers", "frames", "frames/s", "in paper"}};
    for (const auto part : parts) table[0].push_back(std::string(part) + " [us]");
    for (const auto& [scene, with, without] : outcomes) {
        const Speed s = speed(with);
        table.push_back({scene.name, std::to_string(scene.mesh.vertex_count()),
                         std::to_string(scene.mesh.triangle_count()), std::to_string(layers),
                         std::to_string(with.frames.size()), number(s.frames_per_second(), 0),
                         scene.paper_frames > 0 ? number(scene.paper_frames, 0) : "-"});
        for (const double seconds : s.seconds) table.back().push_back(number(1e6 * seconds, 2));
    }
    return table;
}

[[nodiscard]] inline Table force_table(const std::vector<Outcome>& outcomes) {
    Table table{
        {"scene", "volume springs", "peak felt [N]", "peak reaction [N]", "shape error after press", "after pull"}};
    for (const auto& [scene, with, without] : outcomes) {
        for (const Record* record : {&with, &without}) {
            table.push_back({scene.name, record == &with ? "with" : "without", significant(peak(*record, &Frame::felt)),
                             significant(peak(*record, &Frame::reaction)),
                             exponential(shape_error(scene, *record, recover)),
                             exponential(shape_error(scene, *record, recover_again))});
        }
    }
    return table;
}

/// The notes above the tables.
[[nodiscard]] inline std::string speed_note() {
    return "Whole frames a second (contact, solve, refit, normals, force) while the membrane is active, on " +
           machine() + ". The paper's 84 and 23 include drawing, on hardware of 2007 (Xeon 3.2 GHz, Quadro FX 4400).";
}

[[nodiscard]] inline std::string force_note() {
    return "Felt: the paper's F = -k x - mu v. Reaction: of the membrane, from the solver. Shape error: the largest "
           "distance from the rest shape after it was let go, rigid drift removed, in radii.";
}

/// The table with aligned columns, the first to the left, under its note.
inline void print(std::ostream& out, const Table& table, const std::string& note) {
    out << '\n' << note << "\n\n";
    std::vector<std::size_t> widths(table[0].size());
    for (const auto& row : table) {
        for (std::size_t k = 0; k < row.size(); ++k) widths[k] = std::max(widths[k], row[k].size());
    }
    for (const auto& row : table) {
        for (std::size_t k = 0; k < row.size(); ++k) {
            out << (k == 0 ? std::left : std::right) << std::setw(static_cast<int>(widths[k])) << row[k]
                << (k + 1 < row.size() ? "  " : "\n");
        }
    }
}

/// Every figure of the tables, in SI units.
[[nodiscard]] inline nlohmann::ordered_json json(const std::vector<Outcome>& outcomes, membrane::Index layers) {
    nlohmann::ordered_json all{{"machine", machine()}, {"scenes", nlohmann::ordered_json::array()}};
    for (const auto& [scene, with, without] : outcomes) {
        const Speed s = speed(with);
        nlohmann::ordered_json one{{"name", scene.key},
                                   {"vertices", scene.mesh.vertex_count()},
                                   {"triangles", scene.mesh.triangle_count()},
                                   {"radius_m", scene.radius},
                                   {"spring_stiffness_N_per_m", scene.stiffness},
                                   {"volume_spring_stiffness_N_per_m", scene.foundation_stiffness},
                                   {"volume_spring_damping_N_s_per_m", scene.foundation_damping},
                                   {"layers", layers},
                                   {"frames", with.frames.size()},
                                   {"frames_active", s.frames},
                                   {"frames_per_second", s.frames_per_second()}};
        if (scene.paper_frames > 0) one["frames_per_second_in_paper_with_drawing"] = scene.paper_frames;
        for (std::size_t k = 0; k < parts.size(); ++k) one["seconds"][std::string(parts[k])] = s.seconds[k];
        for (const Record* record : {&with, &without}) {
            one[record == &with ? "with_volume_springs" : "without_volume_springs"] = {
                {"peak_force_felt_N", peak(*record, &Frame::felt)},
                {"peak_reaction_N", peak(*record, &Frame::reaction)},
                {"shape_error_after_press_radius", shape_error(scene, *record, recover)},
                {"shape_error_after_pull_radius", shape_error(scene, *record, recover_again)}};
        }
        all["scenes"].push_back(one);
    }
    return all;
}

/// Every frame of every run.
[[nodiscard]] inline std::string csv(const std::vector<Outcome>& outcomes) {
    std::ostringstream out;
    out << "scene,volume_springs,time_s,tool_x_m,tool_y_m,tool_z_m,grasping,depth_m,pulled_m,"
        << "felt_x_N,felt_y_N,felt_z_N,reaction_x_N,reaction_y_N,reaction_z_N\n"
        << std::setprecision(9);
    const auto comma = [&](const Vector3d& v) { out << ',' << v.x() << ',' << v.y() << ',' << v.z(); };
    for (const auto& [scene, with, without] : outcomes) {
        for (const Record* record : {&with, &without}) {
            for (const Frame& frame : record->frames) {
                out << scene.key << ',' << (record == &with) << ',' << frame.tool.time;
                comma(frame.tool.position);
                out << ',' << frame.tool.grasping << ',' << frame.depth << ',' << frame.pulled;
                comma(frame.felt);
                comma(frame.reaction);
                out << '\n';
            }
        }
    }
    return out.str();
}

}  // namespace examples
