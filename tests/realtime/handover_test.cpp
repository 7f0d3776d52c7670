// SPDX-License-Identifier: MIT
#include "support/allocation_guard.hpp"

#include <array>
#include <cstdlib>
#include <memory>

#include <membrane/contact/tool.hpp>
#include <membrane/haptics/device.hpp>
#include <membrane/haptics/handover.hpp>
#include <membrane/replay/simulated_hand.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/child_process.hpp"
#include "support/system_call_guard.hpp"

using namespace membrane;

namespace {

/// Both sides of a hand-over, and a device with a hand.
template <Real S>
struct BothLoops {
    void tick(int i) {
        const auto tool = device.read();
        device.write({0, 0, S(0.1)});
        pose.publish(tool, 1e-3 * i);
        const std::array<Index, 3> vertices{Index(i % 100), Index(i % 7), 99};
        for (const Index v : vertices) x.col(v) = tool.position;
        moved.publish(vertices, x, 1e-3 * i);
        if (i % 17 > 1) return;
        const auto news = moved.read();
        for (const Index v : news.moved) shown.col(v) = news.x.col(v);
        right = right && pose.read().value.position == tool.position && shown == x;
    }

    ScriptedDevice<S, SimulatedHand<S>> device{{{.time = 0}, {.time = 1, .position = {0, 0, 1}}},
                                               {},
                                               SimulatedHand<S>({.mass = 0.1, .damping = 2, .stiffness = 300})};
    Latest<Tool<S>> pose;
    MovedPoints<S> moved{100};
    Points<S> x = Points<S>::Zero(3, 100), shown = x;
    bool right = true;
};

}  // namespace

TEMPLATE_TEST_CASE("a hand-over allocates nothing and calls no system, and a hand neither", "[handover]",
                   TEST_SCALARS) {
    const auto loops = std::make_unique<BothLoops<TestType>>();
    const int ticks = cases(100'000);
    const test::AllocationCount count;
    for (int i = 0; i < ticks; ++i) loops->tick(i);
    CHECK(count.so_far() == 0);
    const auto child = test::in_child([&] {
        test::forbid_system_calls();
        for (int i = 0; i < ticks; ++i) loops->tick(i);
        if (!loops->right) std::abort();
    });
    CHECK(child.signal == 0);
    CHECK(child.code == 0);
    CHECK(loops->right);
}
