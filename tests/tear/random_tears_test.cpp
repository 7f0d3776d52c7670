// SPDX-License-Identifier: MIT
#include <cstring>

#include <membrane/mesh_check/validate.hpp>
#include <membrane/model/triangular_springs.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/wild_tear.hpp"

using namespace membrane;

// Pulls of up to the numbers' range: a step is refused, or all that moves is finite.
TEMPLATE_TEST_CASE("random tears with nonsense keep positions finite, the surface a mesh, and repeat to the bit",
                   "[tear]", double, float) {
    int splits = 0, refused = 0, used_up = 0;
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        test::WildTear<TestType> loop(static_cast<std::uint64_t>(seed)), again(static_cast<std::uint64_t>(seed));
        for (int tick = 0; tick < 250; ++tick) {
            CAPTURE(tick);
            const int before = loop.splits;
            const Points<TestType> x = loop.x;
            const bool advanced = loop.tick();
            refused += advanced ? 0 : 1;
            static_cast<void>(again.tick());
            REQUIRE(std::memcmp(loop.x.data(), again.x.data(), sizeof(TestType) * static_cast<std::size_t>(x.size())) ==
                    0);
            REQUIRE(loop.x.allFinite());
            used_up += loop.tear.reserve_used_up() ? 1 : 0;
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
    CAPTURE(splits, refused, used_up);
    CHECK(splits > 10 * cases(20));
    CHECK(refused > cases(20));
    CHECK(used_up > 0);
}
