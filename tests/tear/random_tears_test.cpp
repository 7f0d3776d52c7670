// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/mesh_check/validate.hpp>
#include <membrane/replay/initial_state.hpp>
#include <membrane/replay/snapshot.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/wild_tear.hpp"

using namespace membrane;

namespace {

template <class Loop>
std::vector<std::byte> saved(const Loop& loop) {
    std::vector<std::byte> bytes(
        Loop::with_state(loop, [](const auto&... parts) { return snapshot_capacity(parts...); }));
    bytes.resize(Loop::with_state(loop, [&](const auto&... parts) { return save_snapshot(bytes, parts...); }));
    REQUIRE(!bytes.empty());
    return bytes;
}

// `hand` is the loop at the time of the snapshot: what moves the tool is in no part.
template <class Loop>
void restore(const std::vector<std::byte>& snapshot, const Loop& hand, Loop& loop) {
    REQUIRE(Loop::with_state(loop, [&](auto&... parts) { return restore_snapshot(snapshot, parts...); }));
    loop.random = hand.random;
    loop.tool = hand.tool;
    loop.held = hand.held;
    loop.target = hand.target;
    loop.splits = hand.splits;
    loop.tree.refit(loop.x);
    loop.normals.update(loop.x);
}

template <class S>
void check_surface(const test::WildTear<S>& loop) {
    const auto& surface = loop.tear.surface();
    REQUIRE(surface.reserve() == test::WildTear<S>::reserve - loop.splits);
    const TriangleMesh<S> torn(surface.rest_positions(), surface.triangles());  // throws if it is none
    REQUIRE(torn.triangle_count() == loop.mesh.triangle_count());
    const auto report = validate(surface.rest_positions(), surface.triangles());
    for (const auto defect : {MeshDefect::non_manifold_vertex, MeshDefect::non_manifold_edge,
                              MeshDefect::inconsistent_orientation, MeshDefect::zero_area}) {
        REQUIRE(report.count(defect) == 0);
    }
}

// Forces within their cones, on vertices of the torn surface.
template <class S>
void check_friction(const test::WildTear<S>& loop) {
    const S rounding = 1000 * std::numeric_limits<S>::epsilon();
    for (const auto& v : loop.friction.vertices()) {
        REQUIRE(!loop.tear.surface().adjacency().triangles_of(v.vertex).empty());
        REQUIRE(norm(v.force) <= (1 + rounding) * S(loop.coefficient) * norm(v.normal_force));
        REQUIRE((is_finite(v.force) && is_finite(v.normal_force)));
    }
}

// A normal is that of an update of all.
template <class S>
void check_normals(const test::WildTear<S>& loop) {
    auto all = loop.normals;
    all.update(loop.x);
    REQUIRE(test::same_bits(all.values(), loop.normals.values()));
}

/// The forces after a step, evaluated anew: those of tool and forceps are opposite to the reactions, and
/// on no vertex do they, springs and foundation add up to more than the residual.
template <class S, class Foundation>
void check_balance(const test::WildTear<S>& loop, const Foundation& foundation, const StepReport<S>& report, S dt) {
    std::vector<Vector3<S>> applied(static_cast<std::size_t>(loop.mesh.vertex_count()), Vector3<S>::Zero());
    S largest = 0;  // force [N]
    for (std::size_t i = 0; i < 2; ++i) {
        Vector3<S> sum = report.reactions[i];
        largest = std::max(largest, norm(sum));
        for (const auto& point : loop.solver.contact_points(i)) {
            sum += point.force;
            largest = std::max(largest, norm(point.force));
            for (std::size_t k = 0; k < 3; ++k) {
                applied[static_cast<std::size_t>(point.corners[k])] +=
                    point.weights[static_cast<Eigen::Index>(k)] * point.force;
            }
        }
        for (const auto& v : loop.friction.vertices()) {
            if (i != 0) continue;
            sum += v.force;
            applied[static_cast<std::size_t>(v.vertex)] += v.force;
        }
        // Of a vertex that is held the reaction is all that the springs leave.
        const bool has_points = i == 0 || !loop.solver.contact_points(i).empty();
        if (has_points) REQUIRE(norm(sum) <= 1000 * std::numeric_limits<S>::epsilon() * largest);
    }
    if (!loop.updates_all) return;  // the queue has others as well
    const auto joined = loop.tear.ligaments().ligaments;
    S residual = 0;
    for (const Index v : loop.solver.queue().vertices()) {
        const bool opens = std::any_of(joined.begin(), joined.end(),
                                       [&](const auto& one) { return one.vertex == v || one.copy == v; });
        if (loop.sheet.pinned(v) || v == loop.held || opens) continue;
        const Vector3<S> springs = loop.sheet.force_on(v, loop.x).force;
        const Vector3<S> support = foundation.force_on(v, point(loop.x, v), point(loop.start, v), dt).force;
        largest = std::max({largest, norm(springs), norm(support)});
        residual = std::max(residual, norm<S>(springs + support + applied[static_cast<std::size_t>(v)]));
    }
    // Large forces of the springs cancel at a vertex.
    REQUIRE(residual <= report.residual + std::sqrt(std::numeric_limits<S>::epsilon()) * largest);
}

/// The number of ticks, vertices and tears in which something has occurred.
struct Counts {
    int splits = 0, advances = 0, refused = 0, grasped = 0, slipped = 0, dragged = 0, let_go = 0, late = 0;
};

// A tick, and what must hold after it.
template <class S>
void checked_tick(test::WildTear<S>& loop, Counts& counts) {
    const Points<S> before = loop.x;
    const int splits = loop.splits;
    const double torn = loop.tear.torn_length(), taken = loop.tear.dissipated(), peeled = loop.adhesion.dissipated();
    const auto report = loop.tick([&](const auto& foundation, const auto& step, S dt) {
        if (step.status == StepStatus::advanced) check_balance(loop, foundation, step, dt);
    });
    const bool cut = loop.splits != splits;  // which moves a copy from the reserve
    REQUIRE(loop.x.allFinite());
    REQUIRE((report.status == StepStatus::advanced || cut || test::same_bits(loop.x, before)));
    for (const auto& reaction : report.reactions) REQUIRE(is_finite(reaction));
    REQUIRE(loop.grasps_surface);
    check_friction(loop);
    check_normals(loop);
    REQUIRE(loop.tear.dissipated() >= taken * (1 - 1e-12));
    REQUIRE(loop.adhesion.dissipated() >= peeled);
    REQUIRE(std::isfinite(loop.tear.dissipated() + loop.adhesion.dissipated()));
    if (cut) check_surface(loop);
    counts.advances += loop.tear.torn_length() > torn;
    counts.refused += report.status != StepStatus::advanced;
    counts.grasped += loop.grasps;
    counts.dragged += loop.friction.slips();
    counts.late += report.out_of_time;
}

// Stiffness of both foundations: the shares of all vertices.
template <class S>
std::array<double, 2> foundation_of(const test::WildTear<S>& loop) {
    std::array<double, 2> sum{};
    for (Index v = 0; v < loop.mesh.vertex_count() - loop.tear.surface().reserve(); ++v) {
        sum[0] += static_cast<double>(loop.foundation.normal_stiffness(v));
        sum[1] += static_cast<double>(loop.adhesion.spring(v, {}, 0).normal_stiffness);
    }
    return sum;
}

}  // namespace

// Pulls of up to the numbers' range: a step is refused, or all that moves is finite.
TEMPLATE_TEST_CASE(
    "random tears, peels and drags with nonsense keep positions finite, forces in balance, the surface a mesh, "
    "and repeat",
    "[tear]", TEST_SCALARS) {
    using Loop = test::WildTear<TestType>;
    constexpr int ticks = cases_are_slow ? 100 : 500;
    const double rounding = std::is_same_v<TestType, float> ? 1e-4 : 1e-10;
    Counts counts;
    for (int seed = 1; seed <= cases(5, 500); ++seed) {
        CAPTURE(seed);
        Loop loop(static_cast<std::uint64_t>(seed));
        if (seed % 3 == 0) loop.deadline = seed % 40;
        const auto whole = foundation_of(loop);
        const auto run = [&](int from) {
            for (int tick = from; tick < (from == 0 ? ticks / 2 : ticks); ++tick) {
                CAPTURE(tick);
                if (tick == ticks * 4 / 5) {
                    loop.use_up_reserve();
                    check_surface(loop);
                }
                checked_tick(loop, counts);
            }
        };
        run(0);
        const Loop middle = loop;
        const auto snapshot = saved(loop);
        run(ticks / 2);
        const Points<TestType> end = loop.x;
        for (const std::size_t i : {0U, 1U}) CHECK(foundation_of(loop)[i] == Approx(whole[i]).epsilon(rounding));
        counts.splits += loop.splits;
        counts.slipped += loop.slips;
        for (Index v = 0; v < loop.mesh.vertex_count(); ++v) counts.let_go += !loop.adhesion.adheres(v);
        restore(snapshot, middle, loop);
        run(ticks / 2);
        REQUIRE(test::same_bits(loop.x, end));
    }
    CAPTURE(counts.splits, counts.advances, counts.refused, counts.grasped, counts.slipped, counts.dragged,
            counts.let_go, counts.late);
    CHECK(counts.splits > 20 * cases(5, 500));
    if (cases_are_slow) return;  // of one run not everything can be expected
    CHECK(std::min({counts.advances, counts.refused, counts.grasped, counts.slipped, counts.dragged, counts.let_go,
                    counts.late}) > 0);
}

// Forces at points on opposite sides of a tool balance: nothing but their limit and the release of a point bounds them.
TEMPLATE_TEST_CASE("random tears, drags and jumps throw no vertex far beyond membrane, target and tool", "[tear]",
                   TEST_SCALARS) {
    constexpr int first = 30;
    for (int seed = first; seed < first + cases(8, 240); ++seed) {
        CAPTURE(seed);
        test::WildTear<TestType> loop(static_cast<std::uint64_t>(seed));
        loop.nonsense_chance = 0;
        TestType extent = loop.x.colwise().norm().maxCoeff();  // of all so far, from the middle [m]
        for (int tick = 0; tick < (cases_are_slow ? 100 : 500); ++tick) {
            CAPTURE(tick);
            static_cast<void>(loop.tick());
            const auto& tool = loop.tool;
            const Vector3<TestType> other_end = tool.position + tool.axis;
            extent =
                std::max({extent, norm(loop.target), norm(tool.position) + tool.radius, norm(other_end) + tool.radius});
            REQUIRE(loop.x.colwise().norm().maxCoeff() <= TestType(1.5) * extent);
        }
    }
}

TEMPLATE_TEST_CASE(
    "a loop that tears goes on from a snapshot in other parts with the same bits, and is reset to the whole membrane",
    "[snapshot][tear]", TEST_SCALARS) {
    int splits = 0;
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        using Loop = test::WildTear<TestType>;
        Loop loop(static_cast<std::uint64_t>(seed)), other(static_cast<std::uint64_t>(seed));
        const Loop at_first = loop;
        const auto whole = saved(loop);
        const auto initial =
            Loop::with_state(std::as_const(loop), [](const auto&... parts) { return InitialState(parts...); });
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
        restore(torn, at_first, loop);
        REQUIRE(Loop::with_state(loop, [&](auto&... parts) { return initial.reset(parts...); }));
        loop.tree.refit(loop.x);
        loop.normals.update(loop.x);
        CHECK((saved(loop) == whole));
        CHECK(loop.tear.surface().triangles() == loop.mesh.triangles());
        run(loop, 0, 200);
        CHECK(other.tear.surface().triangles() == loop.tear.surface().triangles());
        CHECK(other.tear.dissipated() == loop.tear.dissipated());
    }
    CHECK(splits > 10 * cases(20));
}
