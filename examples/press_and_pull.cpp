// SPDX-License-Identifier: MIT
//
// The whole paper in one run: spheres of 162 and 642 vertices and a cornea are pressed, grasped, pulled and let go, with
// virtual volume springs and without. Prints how fast that is and how far off, and draws the paper's figures 3 to 5.
#include <filesystem>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include <membrane/membrane.hpp>

#include "support/command_line.hpp"
#include "support/output.hpp"
#include "support/record.hpp"
#include "support/scenes.hpp"

using namespace examples;

template <class Volume>
Record run(const Scene& scene, const Volume& backing, const Motion& motion,
           const membrane::SolverOptions<double>& options) {
    const double dt = 1e-3;  // [s]
    const auto network = membrane::MassSpringNetwork(scene.mesh, membrane::LinearSpring{},
                                                     {.stiffness = scene.stiffness, .pinned = scene.pinned});
    const auto feel = membrane::SpringDamperForce{.stiffness = 50, .damping = 0.2};  // [N/m], [N s/m]
    auto solver = membrane::QuasiStaticSolver(network, options);
    auto tree = membrane::AabbTree(scene.mesh);
    auto tracker = membrane::ContactTracker(scene.mesh);
    auto grasper = membrane::Grasper(scene.mesh);
    auto normals = membrane::VertexNormals(scene.mesh);
    membrane::NullDevice<double> device(motion.script, {.tick = dt, .radius = scene.tool_radius});
    auto x = scene.mesh.positions();  // 3 x V [m]
    Record record{.phases = motion.phases};
    while (device.running()) {
        const auto tool = device.read();
        Stopwatch watch;
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        watch.lap();
        const auto report = solver.step(x, dt, network, backing, press(tool, contact, grasp), pull(tool, grasp));
        watch.lap();
        tree.refit(x, report.moved);
        watch.lap();
        normals.update(x, report.moved);
        watch.lap();
        device.write(feel({tool, contact, report, grasp}));
        watch.lap();
        const Vector3d way = tool.position + grasp.offset - grasp.origin;  // of what is held
        record.add({.tool = tool,
                    .depth = contact.depth,
                    .pulled = grasp.holding() ? way.norm() : 0,
                    .felt = device.force(),
                    .reaction = report.reactions[0] + report.reactions[1],
                    .at_work = report.visits > 0,
                    .seconds = watch.seconds()},
                   x);
    }
    return record;
}

Outcome run_both(const Scene& scene, double pace, const membrane::SolverOptions<double>& options) {
    const auto press = press_moves(scene), pull = pull_moves(scene);
    std::cout << scene.name << ": with volume springs ..." << std::flush;
    const auto backing = membrane::VirtualVolumeSprings(
        scene.mesh, {.stiffness = scene.backing_stiffness, .damping = scene.backing_damping});
    auto with = run(scene, backing, motion(scene, joined(press, pull), pace), options);

    std::cout << " without ..." << std::flush;  // and the pull from rest: it does not come back from the press
    const membrane::NoVolumeSprings none;
    auto pressed = run(scene, none, motion(scene, press, pace), options);
    auto pulled = run(scene, none, motion(scene, pull, pace, pressed.phases.back().end), options);
    std::cout << " done" << std::endl;
    return {scene, std::move(with), std::move(pressed).then(std::move(pulled))};
}

int main(int argc, char** argv) {
    auto pictures = std::filesystem::path(argv[0]).parent_path() / "pictures";
    std::string json, csv;
    membrane::SolverOptions<double> options{.layers = 6, .sweeps = 2};
    bool quick = false;
    CLI::App app("Presses, grasps, pulls and lets go membranes, with virtual volume springs and without.");
    app.add_option("--out", pictures, "folder for the pictures and index.html")->capture_default_str();
    app.add_option("--json", json, "write every figure to this file");
    app.add_option("--csv", csv, "write time, tool, depth and force of every frame to this file");
    app.add_option("--layers", options.layers, "threshold of the propagation queue")->capture_default_str();
    app.add_option("--sweeps", options.sweeps, "passes over the queue in a step")->capture_default_str();
    app.add_flag("--quick", quick, "the tool moves ten times as fast");
    return run(app, argc, argv, [&] {
        Output output(pictures, json, csv);
        std::vector<Outcome> outcomes;
        for (const Scene& scene : {sphere_scene(2, "3", 84), sphere_scene(3, "4", 23), cornea_scene()}) {
            outcomes.push_back(run_both(scene, quick ? 10 : 1, options));
        }
        output.write(outcomes, options.layers);
    });
}
