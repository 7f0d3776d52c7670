// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <istream>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>

#include <membrane/calibration/fit.hpp>

namespace examples {

/// A table from lines `depth,force` in metres and newtons; passed over are empty lines, lines that begin with #, and
/// column names above the first row.
/// @throws std::runtime_error naming the line that is none of these
[[nodiscard]] inline membrane::ForceTable read_force_table(std::istream& text) {
    membrane::ForceTable table;
    std::size_t number = 0;
    for (std::string line; std::getline(text, line);) {
        ++number;
        const bool names = table.depth.empty() && line.rfind("depth", 0) == 0;
        if (line.find_first_not_of(" \t\r") == std::string::npos || line.front() == '#' || names) continue;
        std::istringstream row(line);
        row.imbue(std::locale::classic());
        double depth = 0, force = 0;
        char comma = 0;
        if (!(row >> depth >> comma >> force) || comma != ',' || !(row >> std::ws).eof()) {
            throw std::runtime_error("line " + std::to_string(number) + " must be depth,force in m and N, got \"" +
                                     line.substr(0, 40) + '"');
        }
        table.depth.push_back(depth);
        table.force.push_back(force);
    }
    return table;
}

}  // namespace examples
