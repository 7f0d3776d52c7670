// SPDX-License-Identifier: MIT
#include <membrane/replay/recording.hpp>

#include <cmath>
#include <limits>
#include <sstream>

#include <membrane/haptics/contact_friction.hpp>
#include <membrane/haptics/grasp_transition.hpp>
#include <membrane/membrane.hpp>
#include <membrane/replay/recording_file.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"
#include "support/whole_loop.hpp"
#include "support/wild_ticks.hpp"

using namespace membrane;
using test::Random;

static_assert(Device<ReplayDevice<double>, double> && Device<ReplayDevice<float>, float>);

namespace {

/// A device that now and then says what no device should.
template <Real S>
struct FaultyDevice : ScriptedDevice<S> {
    using ScriptedDevice<S>::ScriptedDevice;
    [[nodiscard]] Tool<S> read() noexcept {
        auto tool = ScriptedDevice<S>::read();
        if (++reads % 97 == 0) tool.position.y() = std::numeric_limits<S>::quiet_NaN();
        if (reads % 89 == 0) tool.radius = S(-1);
        if (reads % 83 == 0) tool.velocity = Vector3<S>::Constant(std::numeric_limits<S>::infinity());
        return tool;
    }
    int reads = 0;
};

/// A user's loop with forceps, whatever the device; small, so that many ticks take little time.
template <Real S>
struct Loop {
    /// One tick; returns what was written to the device.
    template <class Hand>
    RecordedTick<S> tick(Hand& device) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report =
            solver.step(x, S(1e-3), network, foundation, press(tool, contact, grasp), pull(tool, grasp));
        tree.refit(x, report.moved);
        const Vector3<S> force = feel({tool, contact, report, grasp});
        device.write(force);
        return {tool, force};
    }

    void reset() {
        x = mesh.positions();
        solver.reset();
        tracker.reset();
        grasper.reset();
        tree.refit(x);
        feel = Loop{}.feel;
    }

    TriangleMesh<S> mesh = icosphere<S>({.radius = 0.01, .subdivisions = 1});
    MassSpringNetwork<S, LinearSpring> network{mesh, {}, {.stiffness = S(40)}};
    VirtualVolumeSprings<S> foundation{mesh, {.stiffness = S(8), .damping = S(0.005)}};
    QuasiStaticSolver<S> solver{network, {.layers = 2, .sweeps = 1}};
    AabbTree<S> tree{mesh};
    ContactTracker<S> tracker{mesh};
    Grasper<S> grasper{mesh};
    using Friction = ContactFriction<ReactionForce, S>;
    GraspTransition<Friction, S> feel{Friction({.scale = 30}, {.coefficient = 0.2, .stiffness = 200})};
    Points<S> x = mesh.positions();
};

template <Real S>
Recording<S> recorded(Loop<S>& loop, std::uint64_t seed, int ticks) {
    FaultyDevice<S> device(test::busy_script<S>(seed, 40), {.tick = 1e-3, .radius = 1e-3});
    Recorder<S> recorder(static_cast<std::size_t>(ticks), loop.mesh.vertex_count());
    for (int i = 0; i < ticks; ++i) {
        if (!device.running()) device.reset();
        const auto [tool, force] = loop.tick(device);
        recorder.add(tool, force);
    }
    return recorder.recording();
}

/// How many forces are not the recorded ones.
template <Real S>
std::size_t differing(Loop<S>& loop, const Recording<S>& recording) {
    ReplayDevice<S> device(recording);
    while (device.running()) loop.tick(device);
    return device.differing();
}

}  // namespace

TEMPLATE_TEST_CASE("a replay from reset gives the same forces to the bit", "[recording]", TEST_SCALARS) {
    using S = TestType;
    const int ticks = cases(10'000, 100'000);
    Loop<S> loop;
    const auto recording = recorded(loop, 1, ticks);
    const Points<S> end = loop.x;
    int felt = 0;
    for (const auto& tick : recording.ticks) felt += tick.force.norm() > 0;
    REQUIRE(recording.ticks.size() == static_cast<std::size_t>(ticks));
    REQUIRE(felt > ticks / 20);

    loop.reset();
    CHECK(differing(loop, recording) == 0);
    CHECK(test::same_bits(loop.x, end));

    std::stringstream file;  // through a file, and with new parts
    write_recording(file, recording);
    Loop<S> other;
    CHECK(differing(other, read_recording<S>(file, other.mesh.vertex_count())) == 0);
    CHECK(test::same_bits(other.x, end));
}

TEST_CASE("a replay that is not the same run is reported", "[recording]") {
    Loop<double> loop, softer;
    auto recording = recorded(loop, 2, 2000);
    softer.network = MassSpringNetwork(softer.mesh, LinearSpring{}, {.stiffness = 40 * (1 + 1e-15)});
    CHECK(differing(softer, recording) > 0);
    Loop<double> same;
    auto& force = recording.ticks[1234].force.y();
    force = std::nextafter(force, 1.0);
    ReplayDevice<double> device(recording);
    while (device.running()) same.tick(device);
    CHECK(device.differing() == 1);
    CHECK(device.first_difference() == 1234);
}

TEMPLATE_TEST_CASE("a recorder keeps the first ticks and counts the others", "[recording]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto all = test::wild_recording<S>(random, random.index(20));
        const auto capacity = static_cast<std::size_t>(1 + random.index(20));
        Recorder<S> recorder(capacity, all.vertex_count);
        for (int round = 0; round < 2; ++round) {
            for (const auto& tick : all.ticks) recorder.add(tick.tool, tick.force);
            const std::size_t kept = (std::min)(capacity, all.ticks.size());
            REQUIRE(recorder.size() == kept);
            REQUIRE(recorder.missed() == all.ticks.size() - kept);
            auto first = all;
            first.ticks.resize(kept);
            REQUIRE(test::identical(recorder.recording(), first));
            recorder.clear();
            REQUIRE(recorder.size() == 0);
            REQUIRE(recorder.missed() == 0);
            REQUIRE(recorder.recording().ticks.empty());
        }
    }
}

TEMPLATE_TEST_CASE("a replay returns tools to the bit and compares forces", "[recording]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto recording = test::wild_recording<S>(random, 1 + random.index(20));
        ReplayDevice<S> device(recording);
        device.write(Vector3<S>::Zero());  // before the first tick: of no tick
        for (int round = 0; round < 2; ++round) {
            std::size_t changed = 0, first = 0;
            for (std::size_t i = 0; i < recording.ticks.size(); ++i) {
                REQUIRE(device.running());
                auto tick = recording.ticks[i];
                REQUIRE(identical(RecordedTick<S>{device.read(), tick.force}, tick));
                if (random.chance(0.2)) {
                    auto& number = tick.force[random.index(3)];
                    number = number == 0 ? -number : S(0.5);  // zeros of either sign differ, too
                    if (changed++ == 0) first = i;
                }
                device.write(tick.force);
                REQUIRE(device.differing() == changed);
            }
            REQUIRE_FALSE(device.running());
            REQUIRE((changed == 0 || device.first_difference() == first));
            const auto& last = recording.ticks.back();
            REQUIRE(identical(RecordedTick<S>{device.read(), last.force}, last));
            device.reset();
            REQUIRE(device.differing() == 0);
        }
    }
}

TEMPLATE_TEST_CASE("ticks are identical if all of their bits are", "[recording]", TEST_SCALARS) {
    using S = TestType;
    const RecordedTick<S> zero;
    CHECK(identical(zero, zero));
    RecordedTick<S> other;
    other.tool.grasping = true;
    CHECK_FALSE(identical(zero, other));
    for (std::size_t i = 0; i < detail::numbers_of_tick; ++i) {
        CAPTURE(i);
        auto numbers = detail::numbers_of(zero);
        for (const S number : {S(-0.0), std::numeric_limits<S>::denorm_min(), std::numeric_limits<S>::quiet_NaN()}) {
            numbers[i] = number;
            const auto changed = detail::tick_of(numbers, false);
            CHECK_FALSE(identical(zero, changed));
            CHECK(identical(changed, changed));
        }
    }
}

// With all parts of a loop: replay/snapshot_test.cpp.
TEST_CASE("a replay starts at the last snapshot at or before a tick, and a full recorder keeps no more",
          "[recording]") {
    Points<double> state = Points<double>::Zero(3, 1);
    Recorder<double> recorder(6, 1, {.count = 2, .bytes = snapshot_capacity(state)});
    for (int tick = 0; tick < 6; ++tick) {
        state.setConstant(tick);
        if (tick % 2 == 1) CHECK(recorder.add_snapshot(state) == (tick < 5));  // before ticks 1 and 3
        recorder.add(Tool<double>{}, Vector3<double>::Zero());
    }
    Recorder<double> full(1, 1, {.count = 2, .bytes = snapshot_capacity(state)});
    CHECK(full.add_snapshot(state));
    full.add(Tool<double>{}, Vector3<double>::Zero());
    CHECK_FALSE(full.add_snapshot(state));

    ReplayDevice<double> device(recorder.recording());
    CHECK_FALSE(device.start_from(0, state));
    for (std::size_t tick = 1; tick < 6; ++tick) {
        CAPTURE(tick);
        const std::size_t expected = tick < 3 ? 1 : 3;
        REQUIRE(device.start_from(tick, state));
        CHECK(device.next_tick() == expected);
        CHECK(state == Points<double>::Constant(3, 1, static_cast<double>(expected)));
    }
}

TEST_CASE("no capacity, no tick and no vertices are refused", "[recording][bad]") {
    CHECK(test::refusal([] { Recorder<double> recorder(0, 1); }) == "Recorder: max_ticks must be positive, got 0");
    CHECK(test::refusal([] { Recorder<float> recorder(1, -1); }) ==
          "Recorder: vertex_count must not be negative, got -1");
    CHECK(test::refusal([] { ReplayDevice<double> device(Recording<double>{}); }) ==
          "ReplayDevice: the recording must have a tick, got none");
}
