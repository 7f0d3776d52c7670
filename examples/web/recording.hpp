// SPDX-License-Identifier: MIT
#pragma once

#include "session.hpp"

namespace web {

/// One tick of a recording: a row of 17 numbers, as in the page's CSV file.
struct Row {
    double time = 0;                  // [s]
    double x = 0, y = 0, z = 0;       // of the tool [m]
    double vx = 0, vy = 0, vz = 0;    // [m/s]
    double grasping = 0, placed = 0;  // whether the forceps are closed; whether the tool came without a path
    double fx = 0, fy = 0, fz = 0;    // on the hand [N]
    double layers = 0, sweeps = 0;    // settings of the tick
    double safe_step = 0, volume_springs = 0, coarse_correction = 0;
};
static_assert(sizeof(Row) == 17 * sizeof(double));

inline Row row_of(const Session& session, bool placed) {
    const auto& [settings, tool, contact, grasp, reaction] = session.moment();
    const Vector3 &p = tool.position, &v = tool.velocity, &f = session.force();
    return {tool.time,
            p[0],
            p[1],
            p[2],
            v[0],
            v[1],
            v[2],
            double(tool.grasping),
            double(placed),
            f[0],
            f[1],
            f[2],
            double(settings.layers),
            double(settings.sweeps),
            double(settings.safe_step),
            double(settings.volume_springs),
            double(settings.coarse_correction)};
}

inline membrane::Tool<double> tool_of(const Row& row, double radius) {
    return {.position = {row.x, row.y, row.z},
            .radius = radius,
            .velocity = {row.vx, row.vy, row.vz},
            .time = row.time,
            .grasping = row.grasping != 0};
}

inline Settings settings_of(const Row& row) {
    return {static_cast<Index>(row.layers), static_cast<Index>(row.sweeps), row.safe_step != 0, row.volume_springs != 0,
            row.coarse_correction != 0};
}

/// Of a tool for a membrane of this size [m].
inline double tool_radius(const Mesh& mesh) { return 0.2 * size_of(mesh); }

}  // namespace web
