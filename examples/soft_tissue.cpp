// SPDX-License-Identifier: MIT
//
// An engine presses a membrane (soft_tissue.hpp), pauses, saves, loads, teleports and resets it, and is refused a
// position; a thread of the membrane's own makes its ticks at 1 kHz. The engine's sphere has a seam: two vertices at
// each of its positions.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "soft_tissue.hpp"

struct EngineMesh {
    std::vector<EngineVertex> vertices;
    std::vector<std::uint32_t> indices;
};

/// A sphere [m] with a texture: the meridian where it ends has two vertices for each point, a pole one for each slice.
EngineMesh textured_sphere(float radius, int stacks, int slices) {
    EngineMesh mesh;
    for (int i = 0; i <= stacks; ++i) {
        for (int j = 0; j <= slices; ++j) {
            const float u = static_cast<float>(j) / static_cast<float>(slices);
            const float v = static_cast<float>(i) / static_cast<float>(stacks);
            const float around = 2 * std::numbers::pi_v<float> * u, down = std::numbers::pi_v<float> * v;
            const float n[3] = {std::sin(down) * std::cos(around), std::sin(down) * std::sin(around), std::cos(down)};
            mesh.vertices.push_back({{radius * n[0], radius * n[1], radius * n[2]}, {n[0], n[1], n[2]}, {u, v}});
        }
    }
    const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * (slices + 1) + j); };
    for (int i = 0; i < stacks; ++i) {
        for (int j = 0; j < slices; ++j) {
            if (i > 0) mesh.indices.insert(mesh.indices.end(), {at(i, j), at(i + 1, j), at(i, j + 1)});
            if (i + 1 < stacks) mesh.indices.insert(mesh.indices.end(), {at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)});
        }
    }
    return mesh;
}

double distance(const float (&a)[3], const float (&b)[3]) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

int main() {
    const int stacks = 20, slices = 32;
    EngineMesh mesh = textured_sphere(10e-3F, stacks, slices);
    const auto rest = mesh.vertices;
    SoftTissue::Tool tool{.position = {13e-3F, 0, 0}, .radius = 2e-3F};
    SoftTissue tissue(mesh.vertices, mesh.indices, tool);

    // Frames of the engine until the haptic thread has made so many ticks.
    const auto draw_for = [&](std::uint64_t ticks) {
        for (const auto start = tissue.feedback().number; tissue.feedback().number < start + ticks;
             tissue.draw(mesh.vertices))
            std::this_thread::sleep_for(std::chrono::milliseconds(16));
    };
    const auto print = [&](const char* what) {
        double displacement = 0, seam = 0;
        for (std::size_t i = 0; i < rest.size(); ++i)
            displacement = std::max(displacement, distance(mesh.vertices[i].position, rest[i].position));
        for (std::size_t i = 0; i < rest.size(); i += slices + 1)
            seam = std::max(seam, distance(mesh.vertices[i].position, mesh.vertices[i + slices].position));
        const auto& felt = tissue.feedback().value;
        std::printf("%-10s %5.1f mN, %.3f mm displaced, seam open by %.3f mm, %s\n", what,
                    1e3 * static_cast<double>(felt.force.norm()), 1e3 * displacement, 1e3 * seam,
                    std::string(to_string(felt.status)).c_str());
    };

    const auto outside = tool;
    while (tool.position.x() > 11.2e-3F) {
        tool.position.x() -= 0.1e-3F;
        tissue.move(tool);
        draw_for(10);
    }
    draw_for(300);
    print("pressed");
    const auto state = tissue.save();

    tissue.teleport(outside);
    draw_for(300);
    print("teleported");

    tissue.pause(true);
    if (!tissue.load(state)) return 1;
    tissue.draw(mesh.vertices);
    print("paused");
    tissue.pause(false);
    draw_for(10);
    print("loaded");

    tool.position.x() = std::numeric_limits<float>::quiet_NaN();
    tissue.move(tool);
    draw_for(10);
    print("refused");

    tissue.reset();
    tissue.teleport(outside);
    draw_for(1);
    print("reset");
}
