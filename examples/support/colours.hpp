// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include <Eigen/Core>

namespace examples {

/// Red, green, blue in linear light, 0 to 1.
using Colour = Eigen::Vector3d;

/// From the bytes of a screen colour.
[[nodiscard]] inline Colour screen(int red, int green, int blue) {
    return {std::pow(red / 255.0, 2.2), std::pow(green / 255.0, 2.2), std::pow(blue / 255.0, 2.2)};
}

/// As SVG and HTML take it, "#rrggbb".
[[nodiscard]] inline std::string hex(const Colour& colour) {
    const auto byte = [](double light) {
        return static_cast<unsigned>(std::lround(255 * std::pow(std::clamp(light, 0.0, 1.0), 1 / 2.2))) & 255U;
    };
    char text[8];
    std::snprintf(text, sizeof text, "#%02x%02x%02x", byte(colour.x()), byte(colour.y()), byte(colour.z()));
    return text;
}

/// From resting tissue (0) to the most displaced (1), ever darker.
[[nodiscard]] inline Colour tissue(double share) {
    static const std::array<Colour, 5> stops{screen(247, 222, 209), screen(243, 180, 148), screen(224, 117, 92),
                                             screen(190, 52, 72), screen(128, 16, 62)};
    const double place = std::clamp(share, 0.0, 1.0) * (stops.size() - 1);
    const std::size_t below = std::min(static_cast<std::size_t>(place), stops.size() - 2);
    const double rest = place - static_cast<double>(below);
    return (1 - rest) * stops[below] + rest * stops[below + 1];
}

}  // namespace examples
