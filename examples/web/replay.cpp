// SPDX-License-Identifier: MIT
//
// The page's loop as a native program: replays the tool of a recording on a sphere of 642 vertices and prints the forces.
#include <array>
#include <cstdio>

#include "membrane_web.cpp"

int main() {
    build(3);
    set_options(6, 2, 0, 1);
    std::array<double, 3> before{0, 0, 1}, now{};
    int grasping = 0;
    while (std::scanf("%lf %lf %lf %d", &now[0], &now[1], &now[2], &grasping) == 4) {
        const auto velocity = [&](std::size_t k) { return (now[k] - before[k]) / dt; };
        const Tick* result = tick(now[0], now[1], now[2], velocity(0), velocity(1), velocity(2), 2e-3, grasping);
        std::printf("%.17g %.17g %.17g\n", result->force[0], result->force[1], result->force[2]);
        before = now;
    }
}
