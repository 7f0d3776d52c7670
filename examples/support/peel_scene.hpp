// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include <membrane/haptics/device.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

/// A membrane that forceps peel off the body under it.
namespace examples {

using Eigen::Vector3d;

/// What is peeled, and how. The front is taken to be straight.
struct PeelScene {
    std::string name;
    membrane::TriangleMesh<double> mesh;
    Vector3d grip;                             ///< where the forceps take hold [m]
    Vector3d over = Vector3d::UnitX();         ///< unit vector: where the front goes
    Vector3d up = Vector3d::UnitZ();           ///< normal at `grip`
    double flap = 0, length = 0;               ///< from `grip` to the front, in the beginning and in the end [m]
    double angle = 0;                          ///< between what is drawn off and the bare surface [rad]
    std::function<double(double)> width = {};  ///< of the front at a distance from the border [m]; none: not known

    static constexpr double speed = 1e-3;                 ///< of the front [m/s]
    static constexpr double touched = 0.1, lifted = 1.1;  ///< times at which the flap is touched, and upright [s]

    /// Whether vertex `v` does not adhere.
    [[nodiscard]] bool in_flap(membrane::Index v) const {
        return over.dot(Vector3d(mesh.positions().col(v)) - grip) < flap;
    }
    /// From `grip` to the front [m].
    [[nodiscard]] double peeled(double time) const { return flap + speed * std::max(0.0, time - lifted); }
    [[nodiscard]] double end() const { return lifted + (length - flap) / speed; }

    /// The hand touches the flap and closes the forceps, turns the flap about the front, and follows the front.
    [[nodiscard]] std::vector<membrane::Waypoint<double>> script() const;
};

/// Mean length of the edges, were all triangles equilateral [m].
[[nodiscard]] inline double mean_edge(const membrane::TriangleMesh<double>& mesh) {
    double area = 0;
    for (const double each : membrane::vertex_areas(mesh)) area += each;
    return std::sqrt(4 / std::sqrt(3.0) * area / static_cast<double>(mesh.triangles().cols()));
}

inline std::vector<membrane::Waypoint<double>> PeelScene::script() const {
    constexpr int turns = 20;
    const double radius = mean_edge(mesh);
    const auto at = [&](double from_front, double turned) -> Vector3d {
        return grip + (0.98 * radius + from_front * std::sin(turned)) * up + from_front * (1 - std::cos(turned)) * over;
    };
    std::vector<membrane::Waypoint<double>> path{{0.0, grip + 2 * radius * up}};
    for (int i = 0; i <= turns; ++i) {
        const double share = double(i) / turns;
        path.push_back({touched + share * (lifted - touched), at(flap, share * angle), true});
    }
    path.push_back({end(), at(length, angle), true});
    return path;
}

/// A strip of 4 mm by 0.48 mm, peeled at 90 degrees.
[[nodiscard]] inline PeelScene strip_scene() {
    constexpr double width = 0.48e-3;
    constexpr membrane::Index columns = 50;
    return {.name = "strip",
            .mesh = membrane::sheet({.width = 4e-3, .height = width, .columns = columns, .rows = 6}),
            .grip = {-2e-3 + 4e-3 / columns, 0, 0},
            .flap = 0.6e-3,
            .length = 2.6e-3,
            .angle = std::numbers::pi / 2,
            .width = [](double) { return width; }};
}

/// A circle of 3 mm, peeled at 120 degrees.
[[nodiscard]] inline PeelScene circle_scene() {
    constexpr double radius = 1.5e-3;
    constexpr membrane::Index rings = 13;
    return {.name = "circle",
            .mesh = membrane::disc({.radius = radius, .rings = rings}),
            .grip = {-radius * (rings - 1) / rings, 0, 0},
            .flap = 0.4e-3,
            .length = 1.6e-3,
            .angle = 2 * std::numbers::pi / 3,
            .width = [](double from_border) { return 2 * std::sqrt(from_border * (2 * radius - from_border)); }};
}

}  // namespace examples
