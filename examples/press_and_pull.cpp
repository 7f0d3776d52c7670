// SPDX-License-Identifier: MIT
//
// The whole paper in one run: spheres of 162 and 642 vertices and a cornea are pressed, grasped, pulled and let go,
// with virtual volume springs and without, or a membrane from a file. Prints speed and shape errors, draws the paper's
// figures 3 to 5, and writes a time series for ParaView.
#include <filesystem>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include <membrane/membrane.hpp>

#include "support/mesh_output.hpp"
#include "support/output.hpp"
#include "support/record.hpp"
#include "support/scenes.hpp"
#include "support/settings.hpp"

using namespace examples;

template <class Volume>
Record run(const Scene& scene, const Volume& foundation, const Motion& motion, const Settings& settings,
           Series series) {
    const double dt = 1e-3;  // [s]
    const auto network = membrane::MassSpringNetwork(scene.mesh, membrane::LinearSpring{},
                                                     {.stiffness = scene.stiffness, .pinned = scene.pinned});
    const auto feel = membrane::SpringDamperForce{.stiffness = 50, .damping = 0.2};  // [N/m], [N s/m]
    auto solver = membrane::QuasiStaticSolver(network, settings.solver);
    auto tree = membrane::AabbTree(scene.mesh);
    auto tracker = membrane::ContactTracker(scene.mesh);
    auto grasper = membrane::Grasper(scene.mesh);
    auto normals = membrane::VertexNormals(scene.mesh);
    membrane::ScriptedDevice<double> device(motion.script, {.tick = dt, .radius = scene.tool_radius});
    auto x = scene.mesh.positions();  // 3 x V [m]
    Record record{.phases = motion.phases, .film_interval = scene.film_interval};
    while (device.running()) {
        const auto tool = device.read();
        Stopwatch watch;
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        watch.lap();
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact, grasp), pull(tool, grasp));
        watch.lap();
        tree.refit(x, report.moved);
        watch.lap();
        normals.update(x, report.moved);
        watch.lap();
        device.write(feel({tool, contact, report, grasp}));
        watch.lap();
        const Vector3d displacement = tool.position + grasp.offset - grasp.origin;  // of the held point
        auto drawn = tool;
        drawn.radius = drawn_radius(tool, contact, x);
        record.add({.tool = drawn,
                    .depth = contact.depth,
                    .pulled = grasp.holding() ? displacement.norm() : 0,
                    .felt = device.force(),
                    .reaction = report.reactions[0] + report.reactions[1],
                    .active = report.vertex_updates > 0,
                    .seconds = watch.seconds()},
                   x);
        if (series.due(tool.time))
            series.add(tool.time, surface_state(scene.mesh, x, network, foundation), scene.origin);
    }
    return record;
}

Outcome run_both(const Scene& scene, const Settings& settings) {
    const auto press = press_moves(scene), pull = pull_moves(scene);
    const auto series = [&](const std::string& name) {
        return Series(settings.series, scene.key + name, scene.mesh.triangles(), 0.02);
    };
    std::cout << scene.name << ": with volume springs ..." << std::flush;
    const auto foundation = membrane::VirtualVolumeSprings(
        scene.mesh, {.stiffness = scene.foundation_stiffness, .damping = scene.foundation_damping});
    auto with = run(scene, foundation, motion(scene, joined(press, pull), settings.speed_factor), settings, series(""));

    std::cout << " without ..." << std::flush;  // the pull starts from the rest shape: the press leaves a dent
    const membrane::NoFoundation none;
    auto pressed = run(scene, none, motion(scene, press, settings.speed_factor), settings, series("_without_pressed"));
    auto pulled = run(scene, none, motion(scene, pull, settings.speed_factor, pressed.phases.back().end), settings,
                      series("_without_pulled"));
    std::cout << " done" << std::endl;
    return {scene, std::move(with), std::move(pressed).then(std::move(pulled))};
}

int main(int argc, char** argv) {
    Settings settings;
    settings.out.pictures = std::filesystem::path(argv[0]).parent_path() / "pictures";
    CommandLine command("Presses, grasps, pulls and lets go membranes, with virtual volume springs and without.");
    settings.add_to(command);
    return command.run(argc, argv, [&] {
        Output output(settings.out);
        std::vector<Outcome> outcomes;
        for (const Scene& scene : scenes(settings.mesh)) outcomes.push_back(run_both(scene, settings));
        output.write(outcomes, settings.solver.layers);
    });
}
