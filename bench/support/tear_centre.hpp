// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "support/tear_shear.hpp"

/// A clamped square sheet, stretched alike in both directions, with a cut in its middle.
namespace bench::tears {

struct Centre {
    int rows = 30;         ///< edges along each side
    double turn = 0;       ///< of the grid, and of the cut along it [rad]
    double stretch = 1.3;  ///< in both directions

    static constexpr double side = 30e-3;  ///< [m]

    [[nodiscard]] double edge() const { return side / rows; }
    [[nodiscard]] Vector direction() const { return {std::cos(turn), std::sin(turn), 0}; }

    template <class Criterion>
    [[nodiscard]] TornSheet<double, Criterion> cut(const Criterion& criterion) const {
        const auto mesh = test::turned_grid<double>(rows, rows, edge(), turn).mesh();
        const auto is_border = [&](const Vector& at) {
            const double gap = std::min({at[0], at[1], side - at[0], side - at[1]});
            return gap < edge() / 2;
        };
        TornSheetOptions options{.hands = {}, .fixed = vertices_where(mesh, is_border), .tolerance = 1e-4 * resistance};
        TornSheet<double, Criterion> sheet(membrane::with_reserve(mesh, 2 * rows), options, criterion);
        const int edges = rows * 3 / 10;
        sheet.cut(Vector(side / 2, side / 2, 0) - edges / 2.0 * edge() * direction(), direction(), edges);
        sheet.x.topRows(2) = stretch * sheet.tear.surface().rest_positions().topRows(2);
        sheet.start();
        return sheet;
    }
};

struct CentreRun {
    double angle = 0;     ///< largest between the driving force and the cut [rad]
    double unlike = 0;    ///< difference of the driving forces of both ends, relative
    double off_line = 0;  ///< largest distance of a tip from the line of the cut while it tears [edges]
    double longer = 0;    ///< difference of the advances of both ends then [edges]
};

/// Each end tears on by about this number of edges, with nine tenths of the energy that it releases at first.
[[nodiscard]] inline CentreRun run(const Centre& scene, double edges) {
    membrane::TipState<double> state;
    auto probe = scene.cut(Recorder{&state});
    probe.update();
    const auto tips = probe.tear.tips();
    const Vector along = scene.direction(), aside(-along[1], along[0], 0);
    CentreRun result;
    for (const auto& tip : tips) {
        const double angle = std::atan2(dot(tip.driving_force, aside), std::abs(dot(tip.driving_force, along)));
        result.angle = std::max(result.angle, std::abs(angle));
    }
    const double force = norm(tips[0].driving_force);
    result.unlike = std::abs(norm(tips[1].driving_force) / force - 1);

    auto sheet = scene.cut(membrane::EnergyRelease{0.9 * force / torn_material.thickness, torn_material.thickness});
    const auto tip = [&](std::size_t i) {
        return membrane::point(sheet.tear.surface().rest_positions(), sheet.tear.tips()[i].vertex);
    };
    const std::array<Vector, 2> start{tip(0), tip(1)};
    while (sheet.tear.torn_length() < 2 * edges * scene.edge() && sheet.tear.tips().size() == 2) {
        sheet.tick({Vector(0, 0, 0), Vector(0, 0, 0)});
        for (std::size_t i = 0; i < sheet.tear.tips().size(); ++i) {
            result.off_line = std::max(result.off_line, std::abs(dot<double>(tip(i) - start[i], aside)) / scene.edge());
        }
    }
    if (sheet.tear.tips().size() == 2) {
        const double left = norm<double>(tip(0) - start[0]), right = norm<double>(tip(1) - start[1]);
        result.longer = std::abs(left - right) / scene.edge();
    }
    return result;
}

}  // namespace bench::tears
