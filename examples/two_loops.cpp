// SPDX-License-Identifier: MIT
//
// A haptic loop of 1 kHz and a drawing loop of 60 Hz, each with its thread and positions, share one membrane. Moved
// positions go to the drawing loop; the target of the tool comes back, as from a mouse; a simulated hand follows it.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <thread>
#include <vector>

#include <membrane/haptics/handover.hpp>
#include <membrane/membrane.hpp>
#include <membrane/replay/simulated_hand.hpp>

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// Sleeps until the next round, `period` [s] after the one that was due, and returns when it is due. Rounds lost are
/// lost.
double next(double due, double period) {
    std::this_thread::sleep_for(std::chrono::duration<double>(due + period - now()));
    return std::max(due + period, now() - period);
}

void print(const char* what, std::vector<double>& seconds) {
    std::sort(seconds.begin(), seconds.end());
    const auto at = [&](std::size_t per_mille) { return 1e6 * seconds[(seconds.size() * per_mille + 999) / 1000 - 1]; };
    std::printf("%s p50 %.1f, p99 %.1f, p99.9 %.1f, worst %.1f us\n", what, at(500), at(990), at(999), at(1000));
}

/// The state that the loops share, and the statistics of the haptic loop.
struct Loops {
    membrane::MovedPoints<double> moved;
    membrane::Latest<membrane::Tool<double>> wanted{};
    std::atomic<bool> over{false};
    std::vector<double> ticks = {};  // time each took [s]
    std::size_t missed = 0;          // ticks that ended after the next was due
};

void touch(const membrane::TriangleMesh<double>& mesh, double dt, Loops& loops) {
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});  // [N/m]
    const auto foundation =
        membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});  // [N/m], [N s/m]
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto x = mesh.positions();
    auto hand = membrane::SimulatedHand<double>({.mass = 0.1, .damping = 2, .stiffness = 300});
    hand.reset_to(loops.wanted.read().value.position);
    for (double due = now(); !loops.over; due = next(due, dt)) {
        const double begin = now();
        const auto& wanted = loops.wanted.read();
        auto tool = wanted.value;
        hand.set_target(tool.position + wanted.age(begin) * tool.velocity, tool.velocity);
        tool.position = hand.position();
        tool.velocity = hand.velocity();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        hand.advance(report.total_reaction(), dt);
        loops.moved.publish(report.moved, x, now());
        loops.ticks.push_back(now() - begin);
        if (now() > due + dt) ++loops.missed;
    }
}

int main() {
    const double seconds = 1, rate = 1000, frame = 1 / 60.0;
    const auto mesh = membrane::icosphere({.radius = 10e-3, .subdivisions = 3});
    membrane::ScriptedDevice<double> mouse({{0, {0, 0, 13e-3}}, {seconds, {0, 0, 10e-3}}},
                                           {.tick = frame, .radius = 2e-3});
    Loops loops{membrane::MovedPoints<double>(mesh.vertex_count())};
    loops.wanted.publish(mouse.read(), now());
    loops.ticks.reserve(static_cast<std::size_t>(2 * seconds * rate));
    std::thread haptic_loop([&] { touch(mesh, 1 / rate, loops); });
    auto shown = mesh.positions();
    membrane::VertexNormals normals(mesh);
    std::vector<double> ages;
    for (double due = now(); mouse.running() || ages.empty(); due = next(due, frame)) {
        const auto news = loops.moved.read();
        for (const auto v : news.moved) shown.col(v) = news.x.col(v);
        normals.update(shown, news.moved);
        if (news.number > 0) ages.push_back(news.age(now()));  // drawing goes here
        loops.wanted.publish(mouse.read(), now());
    }
    loops.over = true;
    haptic_loop.join();
    print("a tick takes        ", loops.ticks);
    print("what is drawn is old", ages);
    std::printf("%zu of %zu ticks were over after the next was due\n", loops.missed, loops.ticks.size());
}
