// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "support/torn_sheet.hpp"

/// A square sheet that is stretched alike in both directions tears from a cut in its middle.
///
///     const auto found = test::tear_from_centre<double>({.rows = 24}, 2.5);
///     CHECK(found.angle < 3 * degree);
namespace test {

struct CentreCut {
    int rows = 30;             ///< edges along each side
    double turn = 0;           ///< of the grid, and of the cut along it [rad]
    double stretch = 1.3;      ///< in both directions
    double relative_drag = 0;  ///< of a fluid, as `drag_of_stiffness` takes it

    static constexpr double side = 30e-3;  ///< [m]

    [[nodiscard]] double edge() const { return side / rows; }
    [[nodiscard]] membrane::Vector3<double> direction() const { return {std::cos(turn), std::sin(turn), 0}; }

    /// At equilibrium, clamped along its border; it tears at this toughness [J/m^2].
    template <membrane::Real Scalar>
    [[nodiscard]] TornSheet<Scalar> cut(double toughness) const {
        const auto mesh = turned_grid<Scalar>(rows, rows, edge(), turn).mesh();
        const auto is_border = [&](const auto& at) {
            const double x = static_cast<double>(at[0]), y = static_cast<double>(at[1]);
            return std::min({x, y, side - x, side - y}) < edge() / 2;
        };
        TornSheet<Scalar> sheet(membrane::with_reserve(mesh, 2 * rows),
                                {.hands = {},
                                 .fixed = vertices_where(mesh, is_border),
                                 .tolerance = 1e-6,
                                 .drag = drag_of_stiffness(relative_drag)},
                                membrane::EnergyRelease{toughness, torn_material.thickness});
        const int edges = rows * 3 / 10;
        const membrane::Vector3<double> middle(side / 2, side / 2, 0);
        const membrane::Vector3<double> start = middle - edges / 2.0 * edge() * direction();
        sheet.cut(start.template cast<Scalar>(), direction().template cast<Scalar>(), edges);
        sheet.x.topRows(2) = static_cast<Scalar>(stretch) * sheet.tear.surface().rest_positions().topRows(2);
        sheet.start();
        return sheet;
    }
};

struct CentreRun {
    double angle = 0;                  ///< largest between a driving force and the line of the cut [rad]
    double unlike = 0;                 ///< difference of the driving forces of both ends, relative
    double off_line = 0;               ///< largest distance of a tip from that line while it tears [edges]
    std::array<double, 2> advances{};  ///< of both ends [edges]; 0 if one has come to the border
    double torn = 0, damped = 0;       ///< taken by tear and drag, over what the sheet has released
    double relaxed = 0, lost = 0;      ///< by the steps; by nothing
};

/// Each end tears on by about this number of edges, at nine tenths of the energy that it releases at first.
template <membrane::Real Scalar>
[[nodiscard]] CentreRun tear_from_centre(const CentreCut& scene, double edges) {
    using Vector = membrane::Vector3<double>;
    const Vector along = scene.direction(), aside(-along[1], along[0], 0);
    auto held = scene.cut<Scalar>(1e9);
    held.update();
    CentreRun result;
    std::array<double, 2> forces{};
    for (std::size_t i = 0; i < 2; ++i) {
        const auto& tip = held.tear.tips()[i];
        const Vector force = tip.driving_force.template cast<double>();
        const double ahead = dot<double>(tip.heading.template cast<double>(), along) > 0 ? 1 : -1;
        result.angle = std::max(result.angle, std::abs(std::atan2(dot(force, aside), ahead * dot(force, along))));
        forces[i] = norm(force);
    }
    result.unlike = std::abs(forces[1] / forces[0] - 1);

    auto torn = scene.cut<Scalar>(0.9 * forces[0] / torn_material.thickness);
    const auto& tear = torn.tear;
    const auto tip = [&](std::size_t i) -> Vector {
        return membrane::point(tear.surface().rest_positions(), tear.tips()[i].vertex).template cast<double>();
    };
    const std::array<Vector, 2> start{tip(0), tip(1)};
    while (tear.torn_length() < 2 * edges * scene.edge()) {
        torn.tick({membrane::Vector3<Scalar>::Zero(), membrane::Vector3<Scalar>::Zero()});
        if (tear.tips().size() < 2) break;
        for (std::size_t i = 0; i < 2; ++i) {
            const Vector off = (1 / scene.edge()) * (tip(i) - start[i]);
            result.off_line = std::max(result.off_line, std::abs(dot(off, aside)));
            result.advances[i] = norm(off);
        }
    }
    const double released = torn.work - torn.stored();
    result.torn = tear.dissipated() / released;
    result.damped = torn.damped() / released;
    result.relaxed = torn.relaxed / released;
    result.lost = torn.lost() / released;
    return result;
}

}  // namespace test
