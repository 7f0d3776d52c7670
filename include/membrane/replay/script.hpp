// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <istream>
#include <locale>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <membrane/haptics/device.hpp>

/// Scripts of a `ScriptedDevice` from text. Offline; include it separately.
///
///     std::ifstream file("press.csv");
///     membrane::ScriptedDevice<double> device(membrane::read_script<double>(file), {.radius = 1e-3});
namespace membrane {

/// Waypoints from lines `time,x,y,z,grasping` in s, m and 0 or 1; the last column is optional. Skips empty lines, lines
/// that begin with #, and column names above the first waypoint.
/// @throws InvalidInput naming the line and its error
template <Real Scalar>
[[nodiscard]] std::vector<Waypoint<Scalar>> read_script(std::istream& text);

namespace detail {

inline constexpr std::string_view script_name = "read_script";

[[nodiscard]] inline std::vector<std::string> split_at_commas(const std::string& line) {
    std::vector<std::string> fields;
    std::istringstream rest(line + ',');  // the text after the last comma is a field, too
    for (std::string field; std::getline(rest, field, ',');) fields.push_back(field);
    return fields;
}

// The number that fills the whole field, in the classic locale.
template <Real Scalar>
[[nodiscard]] Scalar number_in(const std::string& field, std::size_t line) {
    std::istringstream text(field);
    text.imbue(std::locale::classic());
    Scalar number = 0;
    if (text >> number && is_finite(number) && (text >> std::ws).eof()) return number;
    refuse(script_name, "line ", line, " must hold finite numbers, got \"", std::string_view(field).substr(0, 40),
           "\"");
}

template <Real Scalar>
[[nodiscard]] Waypoint<Scalar> waypoint_in(const std::string& text, std::size_t line) {
    const auto fields = split_at_commas(text);
    if (fields.size() != 4 && fields.size() != 5) {
        refuse(script_name, "line ", line, " must be time,x,y,z or time,x,y,z,grasping, got ", fields.size(),
               " columns");
    }
    Waypoint<Scalar> waypoint;
    waypoint.time = number_in<Scalar>(fields[0], line);
    for (int k = 0; k < 3; ++k) waypoint.position[k] = number_in<Scalar>(fields[static_cast<std::size_t>(k) + 1], line);
    if (fields.size() == 4) return waypoint;
    const Scalar grasping = number_in<Scalar>(fields[4], line);
    if (grasping != 0 && grasping != 1) refuse(script_name, "line ", line, ": grasping must be 0 or 1, got ", grasping);
    waypoint.grasping = grasping == 1;
    return waypoint;
}

}  // namespace detail

template <Real Scalar>
std::vector<Waypoint<Scalar>> read_script(std::istream& text) {
    std::vector<Waypoint<Scalar>> script;
    std::size_t number = 0;
    for (std::string line; std::getline(text, line);) {
        ++number;
        if (!line.empty() && line.back() == '\r') line.pop_back();
        const bool names = script.empty() && line.rfind("time", 0) == 0;
        if (line.find_first_not_of(" \t") == std::string::npos || line.front() == '#' || names) continue;
        script.push_back(detail::waypoint_in<Scalar>(line, number));
    }
    if (script.empty()) refuse(detail::script_name, "the script must have a line with a waypoint, got none");
    return script;
}

}  // namespace membrane
