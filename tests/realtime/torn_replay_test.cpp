// SPDX-License-Identifier: MIT
#include "support/allocation_guard.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <sstream>
#include <tuple>

#include <membrane/haptics/contact_friction.hpp>
#include <membrane/haptics/force_limits.hpp>
#include <membrane/haptics/recording_file.hpp>
#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/membrane.hpp>
#include <membrane/model/cohesive_springs.hpp>
#include <membrane/model/tissue.hpp>
#include <membrane/model/triangular_springs.hpp>
#include <membrane/solve/tool_friction.hpp>
#include <membrane/tear/tearing.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

/// A hand that presses a disc at one place after the other and drags it; now and then its forceps close and draw up.
/// One in a hundred ticks is nonsense.
template <Real S>
class Hand {
  public:
    explicit Hand(std::uint64_t seed) : random_(seed) {}

    Tool<S> next() {
        const int t = tick_++ % stroke;
        if (t == 0) choose();
        const double down = std::min({t / 40.0, 1.0, (stroke - t) / 40.0}), drawn = std::max(0.0, t / 40.0 - 1);
        const double height = 1.2e-3 - down * (1.2e-3 + depth_) + (grasps_ ? 0.8e-3 * drawn * down : 0);
        const Vector3<double> place = from_ + 1.5e-3 * drawn * along_, position(place[0], place[1], height);
        Tool<S> tool{.position = position.template cast<S>(), .radius = S(1e-3)};
        tool.velocity = (1e3 * (position - last_)).template cast<S>();
        tool.time = static_cast<S>(tick_) * S(1e-3);
        tool.grasping = grasps_ && t >= 50 && t < stroke - 40;
        last_ = position;
        if (random_.chance(0.01)) tool.position[random_.index(3)] = std::numeric_limits<S>::quiet_NaN();
        return tool;
    }

  private:
    static constexpr int stroke = 200;

    void choose() {
        from_ = Vector3<double>(random_.number(-5e-3, 5e-3), random_.number(-5e-3, 5e-3), 0);
        along_ = Vector3<double>(random_.number(-1.0, 1.0), random_.number(-1.0, 1.0), 0);
        depth_ = random_.number(0.2e-3, 1e-3);
        grasps_ = random_.chance(0.9);
    }

    Random random_;
    Vector3<double> from_ = Vector3<double>::Zero(), along_ = from_, last_ = from_;
    double depth_ = 0;
    bool grasps_ = false;
    int tick_ = 0;
};

/// A stretched disc that adheres to its body, in a user's loop: forceps slit it where they close. All that happens is a
/// result of the tool.
template <Real S>
struct Loop {
    using Springs = TearableSprings<S, LinearSpring>;
    using Sheet = Tissue<Springs, Elements<S, TriangularSpring<S>>>;
    static constexpr Material material{.young_modulus = 1e5, .poisson_ratio = 0.4, .thickness = 1e-4};

    /// One tick; returns the force on the hand.
    Vector3<S> tick(const Tool<S>& tool) {
        const auto contact = tracker.update(tree, x, tool);
        if (tool.grasping && !closed && contact.touching()) {
            follow(tear.cut_along(tear.slit_at(contact.corners[0], {tool.velocity[0], tool.velocity[1], 0}), x));
        }
        closed = tool.grasping;
        const auto grasp = grasper.update(contact, x, tool);
        const auto report = solver.step(x, S(1e-3), sheet, foundation, friction.press(tool, contact, grasp),
                                        pull(tool, grasp), tear.ligaments());
        foundation.update(x, report.moved);
        if (report.status == StepStatus::advanced) follow(tear.update(x, S(1e-3), sheet, foundation));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        const auto force = feel({tool, smooth(contact), report, grasp});
        return limit(force.template cast<double>(), static_cast<double>(tool.time), ++steps).template cast<S>();
    }

    void follow(std::span<const TearEvent<S>> events) {
        for (const auto& event : events) {
            membrane::follow(event, sheet, foundation, solver, tree, tracker, grasper, normals, smooth);
            ++splits;
        }
    }

    /// What a snapshot holds: the tool is in the recording.
    auto parts() {
        return std::tie(sheet, foundation, tear, solver, tree, tracker, grasper, friction, normals, smooth, feel, limit,
                        x, closed, steps, splits);
    }

    TriangleMesh<S> mesh = with_reserve(disc<S>({.radius = S(0.01), .rings = 8}), 80);
    Sheet sheet{Springs(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = S(1), .pinned = border(mesh)})),
                triangular_springs(mesh, material)};
    CohesiveSprings<S> foundation{mesh, {.stiffness = S(1e5), .strength = S(20), .energy = S(0.02)}};
    Tearing<S> tear{mesh, EnergyRelease{.toughness = 30, .thickness = material.thickness}};
    QuasiStaticSolver<S> solver{sheet, {.layers = 8, .sweeps = 2}};
    AabbTree<S> tree{mesh};
    ContactTracker<S> tracker{mesh};
    Grasper<S> grasper{mesh};
    ToolFriction<S> friction{{.coefficient = 0.3}};
    VertexNormals<S> normals{mesh};
    SmoothContact<S> smooth{mesh};
    ContactFriction<ReactionForce, S> feel{{.scale = 2}, {.coefficient = 0.2, .stiffness = 200}};
    ForceLimiter limit{devices::touch};
    Points<S> x = S(1.1) * mesh.positions();
    bool closed = false;
    std::uint64_t steps = 0;
    int splits = 0;
};

constexpr std::size_t ticks = 1500, snapshots = 6;

/// A run of a new loop, and the splits before each snapshot.
template <Real S>
struct Run {
    explicit Run(std::uint64_t seed) {
        Hand<S> hand(seed);
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
            felt += norm(force) > 0 ? 1 : 0;
        }
    }

    Loop<S> loop;
    std::size_t bytes = std::apply([](auto&... parts) { return snapshot_capacity(parts...); }, loop.parts());
    Recorder<S> recorder{ticks, loop.mesh.vertex_count(), {.count = snapshots, .bytes = bytes}};
    std::array<int, snapshots> splits_before{};
    bool kept = true;
    long allocated = 0;
    std::size_t felt = 0;
};

template <Real S>
void check_same(const Loop<S>& a, const Loop<S>& b) {
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
                   "[recording][snapshot][tear]", double, float) {
    using S = TestType;
    int torn_before = 0, torn_after = 0;
    for (int seed = 1; seed <= cases(3); ++seed) {
        CAPTURE(seed);
        Run<S> run(static_cast<std::uint64_t>(seed));
        CHECK(run.kept);
        CHECK(run.allocated == 0);
        CHECK(run.felt > ticks / 4);
        CHECK(run.loop.x.allFinite());
        std::stringstream file;
        write_recording(file, run.recorder.recording());
        ReplayDevice<S> device(read_recording<S>(file, run.loop.mesh.vertex_count()));
        const auto replay = [&](Loop<S>& loop) {
            while (device.running()) device.write(loop.tick(device.read()));
            CHECK(device.differing() == 0);
            check_same(loop, run.loop);
        };
        Loop<S> other;
        replay(other);
        for (std::size_t i = snapshots; i-- > 0;) {  // into the parts that the last replay has torn, and into new ones
            CAPTURE(i);
            Loop<S> whole;
            for (Loop<S>* loop : {&other, &whole}) {
                const auto start = [&](auto&... parts) { return device.start_from(i * (ticks / snapshots), parts...); };
                REQUIRE(std::apply(start, loop->parts()));
                loop->tree.refit(loop->x);
                loop->normals.update(loop->x);
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
