// SPDX-License-Identifier: MIT
//
// Replays a recording of the page natively: `replay MESH < recording.csv`, MESH a sphere's subdivisions, `cornea` or
// `lens`. Prints the force of each tick [N], with all its digits. `replay capsulorhexis` and `replay peel` demonstrate
// these, and print the ticks, the length torn [m] and the circularity of the opening, or the area peeled [m^2].
#include <cstdio>
#include <iostream>
#include <string>

#include "operation.hpp"
#include "recording.hpp"

using namespace web;

namespace {

int demonstrate(Operation&& operation, int max_ticks) {
    operation.demonstrate();
    int ticks = 0;
    for (; ticks < max_ticks && !operation.finished(); ++ticks) operation.step();
    const auto [length, area, circularity, finished] = operation.progress();
    std::printf("%d,%.17g,%.17g,%.17g\n", ticks, length, circularity, area);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    const std::string name = argc > 1 ? argv[1] : "3";
    if (name == "capsulorhexis") return demonstrate(RhexisOperation(), 30'000);
    if (name == "peel") return demonstrate(PeelOperation(), 2'400);
    Session session(name == "cornea" ? cornea() : name == "lens" ? lens() : sphere(std::stoi(name)));
    std::string line;
    std::getline(std::cin, line);  // names of the columns
    while (std::getline(std::cin, line)) {
        Row row;
        auto* number = &row.time;
        const char* at = line.c_str();
        for (std::size_t i = 0; i < sizeof(Row) / sizeof(double); ++i) {
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
