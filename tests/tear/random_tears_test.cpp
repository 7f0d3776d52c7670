// SPDX-License-Identifier: MIT
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <membrane/core/snapshot.hpp>
#include <membrane/mesh_check/validate.hpp>
#include <membrane/model/triangular_springs.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/wild_tear.hpp"

using namespace membrane;

// Pulls of up to the numbers' range: a step is refused, or all that moves is finite.
TEMPLATE_TEST_CASE("random tears with nonsense keep positions finite, the surface a mesh, and repeat to the bit",
                   "[tear]", double, float) {
    int splits = 0, refused = 0;
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        test::WildTear<TestType> loop(static_cast<std::uint64_t>(seed)), again(static_cast<std::uint64_t>(seed));
        for (int tick = 0; tick < 250; ++tick) {
            CAPTURE(tick);
            const int before = loop.splits;
            const Points<TestType> x = loop.x;
            if (tick == 200) loop.use_up_reserve(), again.use_up_reserve();
            const bool advanced = loop.tick();
            refused += advanced ? 0 : 1;
            static_cast<void>(again.tick());
            REQUIRE(std::memcmp(loop.x.data(), again.x.data(), sizeof(TestType) * static_cast<std::size_t>(x.size())) ==
                    0);
            REQUIRE(loop.x.allFinite());
            if (loop.splits == before) continue;
            const auto& surface = loop.tear.surface();
            const TriangleMesh<TestType> torn(surface.rest_positions(), surface.triangles());  // throws if it is none
            REQUIRE(torn.triangle_count() == loop.mesh.triangle_count());
            const auto report = validate(surface.rest_positions(), surface.triangles());
            for (const auto defect : {MeshDefect::non_manifold_vertex, MeshDefect::non_manifold_edge,
                                      MeshDefect::inconsistent_orientation, MeshDefect::zero_area}) {
                REQUIRE(report.count(defect) == 0);
            }
        }
        splits += loop.splits;
        REQUIRE(loop.tear.surface().reserve() >= 0);
    }
    CAPTURE(splits, refused);
    CHECK(splits > 10 * cases(20));
    CHECK(refused > cases(20));
}

namespace {

template <class Loop>
std::vector<std::byte> saved(const Loop& loop) {
    std::vector<std::byte> bytes(snapshot_capacity(loop.sheet, loop.foundation, loop.tear, loop.solver, loop.tree,
                                                   loop.tracker, loop.normals, loop.x));
    bytes.resize(save_snapshot(bytes, loop.sheet, loop.foundation, loop.tear, loop.solver, loop.tree, loop.tracker,
                               loop.normals, loop.x));
    REQUIRE(!bytes.empty());
    return bytes;
}

// `hand` is the loop at the time of the snapshot: what moves the tool is in no part.
template <class Loop>
void restore(const std::vector<std::byte>& snapshot, const Loop& hand, Loop& loop) {
    REQUIRE(restore_snapshot(snapshot, loop.sheet, loop.foundation, loop.tear, loop.solver, loop.tree, loop.tracker,
                             loop.normals, loop.x));
    loop.random = hand.random;
    loop.tool = hand.tool;
    loop.held = hand.held;
    loop.target = hand.target;
    loop.tree.refit(loop.x);
    loop.normals.update(loop.x);
}

}  // namespace

TEMPLATE_TEST_CASE(
    "a loop that tears goes on from a snapshot in other parts with the same bits, and whole again from one "
    "before the tear",
    "[snapshot][tear]", double, float) {
    int splits = 0;
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        using Loop = test::WildTear<TestType>;
        Loop loop(static_cast<std::uint64_t>(seed)), other(static_cast<std::uint64_t>(seed));
        const Loop at_first = loop;
        const auto whole = saved(loop);
        std::vector<Points<TestType>> path;
        const auto run = [&](Loop& of, int from, int to) {
            for (int tick = from; tick < to; ++tick) {
                CAPTURE(tick);
                static_cast<void>(of.tick());
                if (static_cast<int>(path.size()) == tick) path.push_back(of.x);
                REQUIRE(test::same_bits(of.x, path[static_cast<std::size_t>(tick)]));
            }
        };
        run(loop, 0, 120);
        const Loop later = loop;
        const auto torn = saved(loop);
        run(loop, 120, 200);
        splits += loop.splits;
        for (int tick = 0; tick < 60; ++tick) static_cast<void>(other.tick());
        restore(torn, later, other);
        CHECK((saved(other) == torn));
        run(other, 120, 200);
        CHECK(other.tear.surface().triangles() == loop.tear.surface().triangles());
        CHECK(other.tear.surface().rest_positions() == loop.tear.surface().rest_positions());
        CHECK(other.tear.torn_length() == loop.tear.torn_length());
        CHECK(other.tear.dissipated() == loop.tear.dissipated());
        restore(whole, at_first, loop);
        CHECK((saved(loop) == whole));
        CHECK(loop.tear.surface().triangles() == loop.mesh.triangles());
        run(loop, 0, 200);
        CHECK(other.tear.surface().triangles() == loop.tear.surface().triangles());
        CHECK(other.tear.dissipated() == loop.tear.dissipated());
    }
    CHECK(splits > 10 * cases(20));
}
