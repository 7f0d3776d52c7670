// SPDX-License-Identifier: MIT
//
// Replays a recording of the page natively: `replay MESH < recording.csv`, MESH a sphere's subdivisions, `cornea` or
// `lens`. Prints the force of each tick [N], with all its digits.
#include <cstdio>
#include <iostream>
#include <string>

#include "recording.hpp"

using namespace web;

int main(int argc, char** argv) {
    const std::string name = argc > 1 ? argv[1] : "3";
    Session session(name == "cornea" ? cornea() : name == "lens" ? lens() : sphere(std::stoi(name)));
    std::string line;
    std::getline(std::cin, line);  // names of the columns
    while (std::getline(std::cin, line)) {
        Row row;
        auto* number = &row.time;
        const char* at = line.c_str();
        for (int i = 0; i < 16; ++i) {
            char* end = nullptr;
            number[i] = std::strtod(at, &end);
            at = end + (*end == ',');
        }
        session.configure(settings_of(row));
        if (row.placed != 0) session.lift_tool();
        session.step(tool_of(row, tool_radius(session.mesh())));
        const Vector3& force = session.force();
        std::printf("%.17g,%.17g,%.17g\n", force[0], force[1], force[2]);
    }
}
