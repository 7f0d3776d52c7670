// SPDX-License-Identifier: MIT
#include "support/allocation_guard.hpp"

#include <cstdlib>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <membrane/accuracy/tangent_stiffness.hpp>
#include <membrane/certify/error_bound.hpp>
#include <membrane/certify/factored_convexity.hpp>
#include <membrane/coarse/coarse_correction.hpp>
#include <membrane/core/thread_pool.hpp>
#include <membrane/replay/recording.hpp>
#include <membrane/replay/snapshot.hpp>
#include <membrane/surface/mesh_checks.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/haptic_loop.hpp"
#include "support/whole_loop.hpp"
#include "support/wild_tear.hpp"

using namespace membrane;

namespace {

/// Keeps the compiler from leaving out unused results.
void used(const void* memory) {
    const void* volatile sink = memory;
    static_cast<void>(sink);
}

/// How much `act` allocates.
template <class Act>
long allocated_by(Act act) {
    const test::AllocationCount count;
    act();
    return count.so_far();
}

template <class Loop>
bool same_bits(const Loop& a, const Loop& b) {
    const auto bytes = static_cast<std::size_t>(a.x.size()) * sizeof(a.x(0, 0));
    return std::memcmp(a.x.data(), b.x.data(), bytes) == 0 && a.device.force() == b.device.force();
}

}  // namespace

TEST_CASE("the guard counts whatever allocates", "[allocation]") {
    CHECK(allocated_by([] {}) == 0);
    CHECK(allocated_by([] { used(std::make_unique<int>(1).get()); }) == 1);
    CHECK(allocated_by([] { used(std::make_unique<int[]>(100).get()); }) == 1);
    struct alignas(64) Wide {
        char bytes[64];
    };
    CHECK(allocated_by([] { used(std::make_unique<Wide>().get()); }) == 1);
    CHECK(allocated_by([] { used(std::string(100, 'a').data()); }) == 1);
    CHECK(allocated_by([] { used(std::vector<double>(3).data()); }) == 1);
    CHECK(allocated_by([] { used(Eigen::VectorXd(3).data()); }) == 1);
    CHECK(allocated_by([] {
              const Eigen::Matrix3Xd a = Eigen::Matrix3Xd::Ones(3, 2);
              const Eigen::Ref<const Eigen::Matrix3Xd> copied(2 * a);
              used(copied.data());
          }) == 2);
    const auto freed = [](void* memory) {
        used(memory);
        std::free(memory);
    };
    CHECK(allocated_by([&] { freed(std::malloc(10)); }) == 1);
    CHECK(allocated_by([&] { freed(std::calloc(10, 10)); }) == 1);
    CHECK(allocated_by([&] { freed(std::realloc(nullptr, 10)); }) == 1);
    CHECK(allocated_by([&] { freed(std::aligned_alloc(64, 64)); }) == 1);
    CHECK(allocated_by([&] {
              void* memory = nullptr;
              static_cast<void>(posix_memalign(&memory, 64, 64));
              freed(memory);
          }) == 1);
}

TEST_CASE("a snapshot is saved, recorded and restored without allocation", "[allocation]") {
    const auto loop = std::make_unique<test::HapticLoop<double>>(7);
    for (int i = 0; i < 500; ++i) loop->tick();
    const auto visit = [&](auto act) {
        return act(loop->solver, loop->tracker, loop->grasper, loop->paper, loop->limit, loop->x);
    };
    const std::size_t bytes = visit([](auto&... parts) { return snapshot_capacity(parts...); });
    std::vector<std::byte> buffer(bytes);
    Recorder<double> recorder(10, loop->mesh.vertex_count(), {.count = 2, .bytes = bytes});
    std::size_t size = 0;
    bool recorded = false, restored = false;
    CHECK(allocated_by([&] {
              size = visit([&](auto&... parts) { return save_snapshot(buffer, parts...); });
              recorded = visit([&](auto&... parts) { return recorder.add_snapshot(parts...); });
              restored =
                  visit([&](auto&... parts) { return restore_snapshot(std::span(buffer).first(size), parts...); });
          }) == 0);
    CHECK(size > 0);
    CHECK(recorded);
    CHECK(restored);
}

TEST_CASE("a million ticks allocate nothing", "[allocation]") {
    test::WholeLoop<double> loop(1);
    const long allocated = allocated_by([&] {
        for (int i = 0; i < cases(30'000, 1'000'000); ++i) loop.tick();
    });
    CHECK(allocated == 0);
    CHECK(loop.touching > cases(9'000, 300'000));
    CHECK(loop.holding > cases(3'000, 100'000));
    CHECK(loop.x.allFinite());
}

TEMPLATE_TEST_CASE("a million ticks of the complete loop of a hand allocate nothing, whatever goes wrong",
                   "[allocation]", TEST_SCALARS) {
    test::HapticLoop<TestType> loop(8);
    test::FaultInjector faults(9);
    const int ticks = cases(6'000, 500'000);  // of each scalar
    const long allocated = allocated_by([&] {
        for (int i = 0; i < ticks; ++i) loop.tick(i % 2'000 < 1'000 ? test::Fault() : faults.next());
    });
    CHECK(allocated == 0);
    CHECK(loop.x.allFinite());
    CHECK(loop.drawn_right);
    if (ticks < 6'000) return;
    CHECK(loop.touching > ticks / 10);
    CHECK(loop.holding > ticks / 20);
    for (const int pushed : loop.pushed) CHECK(pushed > ticks / 100);
}

TEST_CASE("nor does a coarse correction", "[allocation]") {
    const auto mesh = disc<double>({.radius = 0.005, .rings = 10});
    const MassSpringNetwork<double, LinearSpring> network(mesh, {}, {.stiffness = 20.0, .pinned = border(mesh)});
    const VirtualVolumeSprings<double> foundation(mesh, {.stiffness = 0.01});
    CoarseCorrection coarse(mesh, network, foundation);
    QuasiStaticSolver solver(network);
    Points<double> x = mesh.positions();
    const long allocated = allocated_by([&] {
        for (int i = 0; i < 100; ++i) {
            const auto target = Vector3<double>(0, 0, -1e-5 * i);
            (void)solver.step(x, 1e-3, network, foundation, pull(Index(0), target));
            (void)coarse.reaction_error(x, solver);
            (void)coarse.correct(x, solver);
        }
        coarse.reset();
    });
    CHECK(allocated == 0);
    CHECK(x.row(2).minCoeff() < -5e-4);
}

TEST_CASE("nor does one of a membrane that tears", "[allocation][tear]") {
    test::WildTear<double> loop(3);
    CoarseCorrection coarse(loop.mesh, loop.sheet, loop.foundation, {.points = 20});
    long allocated = 0;
    loop.follow_too = [&](const auto& event) { allocated += allocated_by([&] { follow(event, coarse); }); };
    for (int tick = 0; tick < 200; ++tick) {
        (void)loop.tick(
            [&](const auto&...) { allocated += allocated_by([&] { (void)coarse.correct(loop.x, loop.solver); }); });
        loop.tree.refit(loop.x);
    }
    CHECK(loop.splits > 0);
    CHECK(allocated == 0);
}

TEST_CASE("nor does a step that several threads share", "[allocation]") {
    const auto mesh = icosphere<float>({.radius = 1, .subdivisions = 4});
    const MassSpringNetwork<float, LinearSpring> network(mesh, {}, {.stiffness = 1});
    const VirtualVolumeSprings<float> foundation(mesh, {.stiffness = 0.1F});
    const ThreadPool pool(3);
    QuasiStaticSolver solver(network, SolverOptions<float>{.layers = unlimited, .order = UpdateOrder::colour_all},
                             BlockStep{}, pool.executor());
    Points<float> x = mesh.positions();
    std::size_t moved = 0;
    const long allocated = allocated_by([&] {
        for (int i = 0; i < cases(200); ++i) {
            const auto report = solver.step(x, 1e-3F, network, foundation, pull(i % 50, Vector3<float>(0, 0, 1.1F)));
            moved += report.moved.size();
        }
    });
    CHECK(allocated == 0);
    CHECK(moved > 0);
}

TEMPLATE_TEST_CASE("nor does whatever else a loop can hold", "[allocation]", TEST_SCALARS) {
    test::WholeLoop<TestType> usual(2);
    test::OddLoop<TestType> odd(3);
    const long allocated = allocated_by([&] {
        for (int i = 0; i < cases(5'000); ++i) {
            usual.tick();
            odd.tick();
        }
    });
    CHECK(allocated == 0);
    CHECK(odd.refused > 0);
    CHECK(usual.x.allFinite());
    CHECK(odd.x.allFinite());
}

TEMPLATE_TEST_CASE("nor do bounds of the error and slopes of the force", "[allocation]", TEST_SCALARS) {
    using S = TestType;
    test::WholeLoop<S> loop(7);
    ErrorBound quick(loop.network);
    ErrorBound<FactoredConvexity> sharp(loop.network);
    TangentStiffness tangent(loop.network);
    int certified = 0, found = 0;
    const long allocated = allocated_by([&] {
        for (int i = 0; i < cases(1000); ++i) {
            const Vector3<S> target = point(loop.mesh.positions(), 7) * (1 + S(1e-4) * static_cast<S>(i % 200));
            const auto held = pull(7, target);
            const auto report = loop.solver.step(loop.x, S(1e-3), loop.network, loop.foundation, held);
            certified += quick.compute(loop.x, loop.network, loop.foundation, held).certified();
            certified += sharp.compute(loop.x, loop.network, loop.foundation, held).certified();
            const auto feel =
                tangent.compute(loop.solver.queue().vertices(), loop.x, loop.network, loop.foundation, held);
            found += feel.status == TangentStatus::found;
            used(report.moved.data());
        }
    });
    CHECK(allocated == 0);
    CHECK(certified > 0);
    CHECK(found > 0);
}

TEMPLATE_PRODUCT_TEST_CASE("copied and moved parts run on to the same bits, and allocate nothing", "[allocation]",
                           (test::WholeLoop, test::OddLoop), (TEST_SCALARS)) {
    TestType original(4);
    bool same = true;
    for (const int before : {0, 1, 150, 2000}) {  // at rest, in the air, in contact
        for (int i = 0; i < before; ++i) original.tick();
        auto copied = std::make_unique<TestType>(original);
        auto moved = std::make_unique<TestType>(std::move(*copied));
        copied.reset();
        TestType assigned(5);
        for (int i = 0; i < 200; ++i) assigned.tick();
        assigned = std::as_const(*moved);
        TestType assigned_by_move(6);
        assigned_by_move = TestType(assigned);
        const long allocated = allocated_by([&] {
            for (int i = 0; i < cases(1000); ++i) {
                for (TestType* loop : {&original, moved.get(), &assigned, &assigned_by_move}) loop->tick();
                same = same && same_bits(original, *moved) && same_bits(original, assigned) &&
                       same_bits(original, assigned_by_move);
            }
        });
        CHECK(allocated == 0);
    }
    CHECK(same);
}

TEST_CASE("a recorder, full or not, allocates nothing, nor does a replay", "[allocation]") {
    Recorder<double> recorder(100, 12);
    const Tool<double> tool;
    const Vector3<double> force(1, 2, 3);
    CHECK(allocated_by([&] {
              for (int i = 0; i < 150; ++i) recorder.add(tool, force);
          }) == 0);
    CHECK(recorder.missed() == 50);
    ReplayDevice<double> replay(recorder.recording());
    CHECK(allocated_by([&] {
              while (replay.running()) {
                  used(replay.read().position.data());
                  replay.write(force);
              }
          }) == 0);
    CHECK(replay.differing() == 0);
}

TEST_CASE("a membrane that tears allocates nothing", "[allocation]") {
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
        CAPTURE(seed);
        test::WildTear<double> loop(seed);
        const long allocated = allocated_by([&] {
            for (int tick = 0; tick < 250; ++tick) static_cast<void>(loop.tick());
        });
        CHECK(allocated == 0);
        CHECK(loop.splits > 0);
    }
}

TEST_CASE("starts of a tear allocate nothing", "[allocation]") {
    const auto mesh = with_reserve(sheet<double>({.columns = 8, .rows = 8}), 20);
    auto tissue = Tissue(TearableSprings(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 10.0})));
    Tearing tear(mesh, EnergyRelease{.toughness = 1, .thickness = 1e-5});
    Points<double> x = 1.2 * mesh.positions();
    const double edge = norm<double>(point(mesh.positions(), 1) - point(mesh.positions(), 0));
    Contact<double> contact;
    contact.phase = ContactPhase::ongoing;
    contact.triangle = tear.surface().adjacency().triangles_of(40)[0];  // in the middle of 9 x 9 vertices
    contact.corners = tear.surface().corners(contact.triangle);
    contact.barycentric = {0.3, 0.4, 0.3};
    contact.normal = {0, 0, 1};
    CHECK(allocated_by([&] {
              for (const auto& event : tear.cut_along(tear.start_at(4, edge, x, tissue), x)) follow(event, tissue);
              const auto slit = tear.slit_under(contact, Vector3<double>(0, 0, 1), 0.5, {1, 0, 0});
              for (const auto& event : tear.cut_along(slit, x)) follow(event, tissue);
          }) == 0);
    CHECK(tear.tips().size() == 3);
}
