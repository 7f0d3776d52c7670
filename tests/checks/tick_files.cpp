// SPDX-License-Identifier: MIT
//
// Prints the calls between functions of the headers in ticks of README's sphere under a ball in contact: part of the
// tick, addresses of caller and callee, and how many calls the callee is below the first one of its part, at most.
// Compiled with -finstrument-functions, see tick_files.
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include <membrane/membrane.hpp>

#define PLAIN [[gnu::no_instrument_function]]

namespace {

const char* part = nullptr;
std::vector<void*> stack;
std::map<std::tuple<const char*, void*, void*>, std::size_t> calls;

}  // namespace

extern "C" {
PLAIN void __cyg_profile_func_enter(void* function, void*) {
    const char* of = std::exchange(part, nullptr);  // not those of this function
    if (of == nullptr) return;
    auto& depth = calls[{of, stack.empty() ? nullptr : stack.back(), function}];
    depth = std::max(depth, stack.size());
    stack.push_back(function);
    part = of;
}

PLAIN void __cyg_profile_func_exit(void*, void*) {
    if (part != nullptr) stack.pop_back();
}
}

PLAIN int main() {
    const auto mesh = membrane::icosphere({.radius = 10e-3, .subdivisions = 3});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto normals = membrane::VertexNormals(mesh);
    auto x = mesh.positions();
    for (int tick = 0; tick < 10; ++tick) {
        const membrane::Tool<double> tool{.position = {0, 0, 12e-3 - tick * 1e-4}, .radius = 2e-3};
        part = "contact";
        const auto contact = tracker.update(tree, x, tool);
        part = "step";
        const auto report = solver.step(x, 1e-3, network, foundation, press(tool, contact));
        part = "display";
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        part = nullptr;
    }
    for (const auto& [call, depth] : calls) {
        const auto& [of, caller, callee] = call;
        std::printf("%s %p %p %zu\n", of, caller, callee, depth);
    }
}
