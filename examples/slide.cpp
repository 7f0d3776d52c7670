// SPDX-License-Identifier: MIT
//
// A sphere slides over a membrane, at 50 mm/s over the stock one: the force on the hand with the normals of the
// triangles and with smooth ones, over time and as a spectrum above 100 Hz.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/membrane.hpp>

#include "support/plot.hpp"
#include "support/specimen.hpp"
#include "support/spectrum.hpp"

using namespace examples;

constexpr double turn = 4.8, max_angle = 0.7;  // [rad/s]; on either side of the middle [rad]
constexpr double tick = 1e-3, press_for = 0.05, slide_for = 2 * max_angle / turn;  // [s]

struct Felt {
    std::vector<Eigen::Vector3d> flat, smooth;  // in each tick [N]
};

/// The tool at time `now` [s], on an arc of radius 1.05 sizes around a point one size below the surface.
membrane::Tool<double> tool_at(double now, const Specimen& body) {
    const double height = 1.05 * body.size, radius = 0.1 * body.size, angle = turn * (now - press_for) - max_angle;
    const Eigen::Vector3d up = body.outward;
    const auto aside = membrane::direction<double>(membrane::cross<double>(up, {1, 3, 2}), up);
    const Eigen::Vector3d out = std::cos(angle) * up + std::sin(angle) * aside;
    const double above = radius * std::max(0.0, 1 - now / press_for);
    return {.position = body.above(-1) + (height + above) * out,
            .radius = radius,
            .velocity = turn * height * (std::cos(angle) * aside - std::sin(angle) * up)};
}

Felt slide(const Specimen& body) {
    const auto mesh = membrane::TriangleMesh(body.surface.points, body.surface.triangles);
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    const auto feel = membrane::SpringDamperForce{.stiffness = 100, .damping = 0.5};
    const auto smooth = membrane::SmoothContact(mesh);
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto x = mesh.positions();
    Felt felt;
    for (double now = 0; now < press_for + slide_for; now += tick) {
        const auto tool = tool_at(now, body);
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, tick, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        if (now < press_for) continue;
        felt.flat.push_back(feel({tool, contact, report}));
        felt.smooth.push_back(feel({tool, smooth(contact), report}));
    }
    return felt;
}

/// Force over time [mN] and its spectrum, for both kinds of normals.
std::vector<Curve> curves(const Felt& felt) {
    std::vector<Curve> result(2);
    for (std::size_t k = 0; k < 2; ++k) {
        double now = 0;
        for (const auto& f : k == 0 ? felt.flat : felt.smooth) result[k].push_back({now += tick, 1e3 * f.norm()});
    }
    for (const auto* forces : {&felt.flat, &felt.smooth}) result.push_back(spectrum(*forces, tick, 100));
    return result;
}

double largest_change(const std::vector<Eigen::Vector3d>& forces) {
    double largest = 0;
    for (std::size_t i = 1; i < forces.size(); ++i) largest = std::max(largest, (forces[i] - forces[i - 1]).norm());
    return 1e3 * largest;
}

int main(int argc, char** argv) {
    auto folder = std::filesystem::path(argv[0]).parent_path() / "pictures";
    MeshOptions mesh;
    CommandLine command("Slides over a membrane, and draws the force of its triangles on the hand.");
    mesh.add_to(command);
    command.add("--out", folder, "folder for pictures");
    return command.run(argc, argv, [&] {
        const auto felt = slide(mesh.specimen(stock_sphere()));
        std::filesystem::create_directories(folder);
        std::printf("Largest change in a tick: %.2g mN with the normals of the triangles, %.2g mN with smooth ones.\n",
                    largest_change(felt.flat), largest_change(felt.smooth));
        std::puts(plot(folder / "slide", curves(felt), "slide").c_str());
    });
}
