// SPDX-License-Identifier: MIT
#include "support/allocation_guard.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <sstream>
#include <tuple>

#include <membrane/replay/recording_file.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/torn_loop.hpp"

using namespace membrane;

namespace {

constexpr std::size_t ticks = 1500, snapshots = 6;

/// A run of a new loop, and the splits before each snapshot.
template <Real S>
struct Run {
    explicit Run(std::uint64_t seed) {
        test::TearingHand<S> hand(seed);
        auto add_snapshot = [&](const auto&... parts) { return recorder.add_snapshot(parts...); };
        for (std::size_t tick = 0; tick < ticks; ++tick) {
            const auto tool = hand.next();
            const test::AllocationCount count;
            if (tick % (ticks / snapshots) == 0) {
                kept = kept && std::apply(add_snapshot, loop.parts());
                splits_before[tick / (ticks / snapshots)] = loop.splits;
            }
            const auto force = loop.tick(tool);
            recorder.add(tool, force);
            allocated += count.so_far();
            felt += norm(force) > 0 ? 1U : 0U;
        }
    }

    test::TornLoop<S> loop;
    std::size_t bytes = std::apply([](auto&... parts) { return snapshot_capacity(parts...); }, loop.parts());
    Recorder<S> recorder{ticks, loop.mesh.vertex_count(), {.count = snapshots, .bytes = bytes}};
    std::array<int, snapshots> splits_before{};
    bool kept = true;
    long allocated = 0;
    std::size_t felt = 0;
};

template <Real S>
void check_same(const test::TornLoop<S>& a, const test::TornLoop<S>& b) {
    CHECK(test::same_bits(a.x, b.x));
    CHECK(a.tear.surface().triangles() == b.tear.surface().triangles());
    CHECK(test::same_bits(a.tear.surface().rest_positions(), b.tear.surface().rest_positions()));
    CHECK(a.tear.torn_length() == b.tear.torn_length());
    CHECK(a.tear.dissipated() == b.tear.dissipated());
    CHECK(a.foundation.dissipated() == b.foundation.dissipated());
    CHECK(test::same_bits(a.normals.values(), b.normals.values()));
    CHECK(a.splits == b.splits);
}

}  // namespace

TEMPLATE_TEST_CASE("a loop that tears is replayed to the bit, from its start and from any snapshot",
                   "[recording][snapshot][tear]", TEST_SCALARS) {
    using S = TestType;
    int torn_before = 0, torn_after = 0;
    for (int seed = 1; seed <= cases(3); ++seed) {
        CAPTURE(seed);
        Run<S> run(static_cast<std::uint64_t>(seed));
        CHECK(run.kept);
        CHECK(run.allocated == 0);
        CHECK(run.loop.drawn_right);
        CHECK(run.felt > ticks / 4);
        CHECK(run.loop.x.allFinite());
        std::stringstream file;
        write_recording(file, run.recorder.recording());
        ReplayDevice<S> device(read_recording<S>(file, run.loop.mesh.vertex_count()));
        const auto replay = [&](test::TornLoop<S>& loop) {
            while (device.running()) device.write(loop.tick(device.read()));
            CHECK(device.differing() == 0);
            CHECK(loop.drawn_right);
            check_same(loop, run.loop);
        };
        test::TornLoop<S> other;
        replay(other);
        for (std::size_t i = snapshots; i-- > 0;) {  // into the parts that the last replay has torn, and into new ones
            CAPTURE(i);
            test::TornLoop<S> whole;
            for (test::TornLoop<S>* loop : {&other, &whole}) {
                const auto start = [&](auto&... parts) { return device.start_from(i * (ticks / snapshots), parts...); };
                REQUIRE(std::apply(start, loop->parts()));
                loop->refresh();
                REQUIRE(loop->splits == run.splits_before[i]);
                replay(*loop);
            }
            torn_before += run.splits_before[i] > 0 ? 1 : 0;
            torn_after += run.splits_before[i] > 0 && run.splits_before[i] < run.loop.splits ? 1 : 0;
        }
    }
    CAPTURE(torn_before, torn_after);
    CHECK(torn_before > cases(3));
    CHECK(torn_after > 0);
}
