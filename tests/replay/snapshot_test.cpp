// SPDX-License-Identifier: MIT
#include <membrane/replay/snapshot.hpp>

#include <array>
#include <cstddef>
#include <memory>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include <membrane/haptics/force_limits.hpp>
#include <membrane/membrane.hpp>
#include <membrane/replay/recording_file.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/haptic_loop.hpp"
#include "support/random.hpp"
#include "support/tears.hpp"
#include "support/whole_loop.hpp"

using namespace membrane;

namespace {

// What a snapshot of each loop holds. The device stands for the hand, which no snapshot brings back.
template <Real S>
auto parts_of(test::WholeLoop<S>& loop) {
    return std::tie(loop.solver, loop.tracker, loop.grasper, loop.x);
}
template <Real S>
auto parts_of(test::OddLoop<S>& loop) {
    return std::tie(loop.solver, loop.published, loop.trackers[0], loop.trackers[1], loop.grasper, loop.eye, loop.body,
                    loop.x, loop.velocity, loop.ticks);
}
template <Real S>
auto parts_of(test::HapticLoop<S>& loop) {
    return std::tie(loop.solver, loop.tracker, loop.grasper, loop.x, loop.reaction, loop.paper, loop.extrapolate,
                    loop.coupling, loop.limit, loop.observer, loop.solves, loop.now, loop.ticks, loop.policy);
}

std::vector<std::byte> saved(const auto& parts) {
    return std::apply(
        [](const auto&... each) {
            std::vector<std::byte> buffer(snapshot_capacity(each...));
            const std::size_t size = save_snapshot(buffer, each...);
            REQUIRE(size > 0);
            buffer.resize(size);
            return buffer;
        },
        parts);
}

bool restored(const std::vector<std::byte>& snapshot, const auto& parts) {
    return std::apply([&](auto&... each) { return restore_snapshot(snapshot, each...); }, parts);
}

template <class Loop>
void check_resumes(int case_number) {
    const auto seed = static_cast<std::uint64_t>(case_number);
    CAPTURE(seed);
    test::Random random(seed);
    const auto loop = std::make_unique<Loop>(seed), other = std::make_unique<Loop>(seed);
    for (int i = 1 + random.index(4000); i > 0; --i) loop->tick();
    for (int i = random.index(2000); i > 0; --i) other->tick();
    REQUIRE(restored(saved(parts_of(*loop)), parts_of(*other)));
    other->device = loop->device;
    other->tree.refit(other->x);
    other->normals.update(other->x);
    for (int i = 0; i < 400; ++i) {
        CAPTURE(i);
        loop->tick();
        other->tick();
        REQUIRE(test::same_bits(other->x, loop->x));
        REQUIRE(test::same_bits(other->device.force(), loop->device.force()));
    }
}

/// A loop of the step's options, drawn at random.
template <Real S, class Rule>
struct VariedLoop {
    explicit VariedLoop(std::uint64_t seed)
        : options(varied(seed)), device(test::busy_script<S>(seed, 10), {.tick = 1e-3, .radius = 2e-3}) {}

    static SolverOptions<S> varied(std::uint64_t seed) {
        test::Random random(seed);
        const std::array orders{UpdateOrder::breadth_first, UpdateOrder::colour_layers, UpdateOrder::colour_all};
        return {.layers = std::array<Index, 3>{1, 6, unlimited}[static_cast<std::size_t>(random.index(3))],
                .adaptive_layers = random.chance(0.3),
                .sweeps = 1 + random.index(3),
                .order = orders[static_cast<std::size_t>(random.index(3))],
                .predict = random.chance(0.5),
                .max_vertex_updates = random.chance(0.3) ? 200 : unlimited};
    }

    void tick() noexcept {
        if (!device.running()) device.reset();
        const auto tool = device.read();
        auto second = tool;
        second.position = -second.position;
        const auto contact = tracker.update(tree, x, tool);
        const auto other = second_tracker.update(tree, x, second);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report = solver.step(x, S(1e-3), network, foundation, press(tool, contact, grasp),
                                        press(second, other), pull(tool, grasp));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        device.write(report.total_reaction());
    }

    SolverOptions<S> options;
    TriangleMesh<S> mesh = icosphere<S>({.radius = S(0.01), .subdivisions = 2});
    MassSpringNetwork<S, LinearSpring> network{mesh, {}, {.stiffness = S(40), .pinned = {3, 4, 5}}};
    VirtualVolumeSprings<S> foundation{mesh, {.stiffness = S(8), .damping = S(0.01)}};
    QuasiStaticSolver<S, Rule> solver{network, options, Rule{}};
    AabbTree<S> tree{mesh};
    ContactTracker<S> tracker{mesh}, second_tracker{mesh};
    Grasper<S> grasper{mesh};
    VertexNormals<S> normals{mesh};
    ScriptedDevice<S> device;
    Points<S> x = mesh.positions();
};

template <Real S, class Rule>
auto parts_of(VariedLoop<S, Rule>& loop) {
    return std::tie(loop.solver, loop.tracker, loop.second_tracker, loop.grasper, loop.x);
}

}  // namespace

TEMPLATE_TEST_CASE("a loop restored from a snapshot goes on with the same bits", "[snapshot]", TEST_SCALARS) {
    for (int seed = 1; seed <= cases(20); ++seed) check_resumes<test::WholeLoop<TestType>>(seed);
    for (int seed = 1; seed <= cases(10); ++seed) check_resumes<test::OddLoop<TestType>>(seed);
    for (int seed = 1; seed <= cases(10); ++seed) check_resumes<test::HapticLoop<TestType>>(seed);
}

TEMPLATE_TEST_CASE("so does a loop with any options of the step", "[snapshot]", TEST_SCALARS) {
    for (int seed = 1; seed <= cases(40); ++seed) {
        check_resumes<VariedLoop<TestType, BlockStep>>(seed);
        if (seed % 4 == 0) check_resumes<VariedLoop<TestType, SafeStep>>(seed);
    }
}

TEST_CASE("a snapshot brings a loop back as often as wanted", "[snapshot]") {
    test::WholeLoop<double> loop(5);
    for (int i = 0; i < 700; ++i) loop.tick();
    const auto snapshot = saved(parts_of(loop));
    const auto device = loop.device;
    Points<double> first;
    for (int round = 0; round < 3; ++round) {
        REQUIRE(restored(snapshot, parts_of(loop)));
        CHECK((saved(parts_of(loop)) == snapshot));
        loop.device = device;
        loop.tree.refit(loop.x);
        for (int i = 0; i < 300; ++i) loop.tick();
        if (round == 0) first = loop.x;
        CHECK(test::same_bits(loop.x, first));
    }
}

TEST_CASE("a snapshot that is damaged, or of other components, is refused and changes nothing", "[snapshot]") {
    test::WholeLoop<double> loop(3);
    for (int i = 0; i < 500; ++i) loop.tick();
    const auto snapshot = saved(parts_of(loop));
    for (int i = 0; i < 10; ++i) loop.tick();
    const auto later = saved(parts_of(loop));
    REQUIRE(later != snapshot);
    const auto refused = [&](const std::vector<std::byte>& bytes) {
        return !restored(bytes, parts_of(loop)) && saved(parts_of(loop)) == later;
    };

    test::Random random(11);
    for (int i = 0; i < cases(300); ++i) {
        auto damaged = snapshot;
        const auto at = static_cast<std::size_t>(i < 24 ? i : random.index(static_cast<Index>(snapshot.size())));
        CAPTURE(at);
        damaged[at] ^= std::byte{1} << random.index(8);
        REQUIRE(refused(damaged));
    }
    for (const std::size_t size :
         {std::size_t{0}, std::size_t{1}, std::size_t{23}, std::size_t{24}, snapshot.size() / 2, snapshot.size() - 1}) {
        CAPTURE(size);
        CHECK(refused({snapshot.begin(), snapshot.begin() + static_cast<std::ptrdiff_t>(size)}));
    }
    auto longer = snapshot;
    longer.push_back(std::byte{0});
    CHECK(refused(longer));

    test::WholeLoop<float> in_float(3);
    CHECK_FALSE(restored(snapshot, parts_of(in_float)));
    const auto small = icosphere<double>({.radius = 0.01, .subdivisions = 1});
    const MassSpringNetwork small_network(small, LinearSpring{}, {.stiffness = 40.0});
    QuasiStaticSolver solver(small_network);
    ContactTracker tracker(small);
    Grasper grasper(small);
    auto x = small.positions();
    CHECK_FALSE(restore_snapshot(snapshot, solver, tracker, grasper, x));
    CHECK_FALSE(restore_snapshot(snapshot, loop.tracker, loop.solver, loop.grasper, loop.x));
    CHECK_FALSE(restore_snapshot(snapshot, loop.solver, loop.tracker, loop.x));
    CHECK(restored(snapshot, parts_of(loop)));
}

TEST_CASE("a buffer that is too small is refused", "[snapshot]") {
    test::WholeLoop<double> loop(3);
    for (int i = 0; i < 500; ++i) loop.tick();
    const std::size_t size = saved(parts_of(loop)).size();
    CHECK(size <= snapshot_capacity(loop.solver, loop.tracker, loop.grasper, loop.x));
    std::vector<std::byte> buffer(size);
    const auto save = [&](std::size_t bytes) {
        return save_snapshot(std::span(buffer).first(bytes), loop.solver, loop.tracker, loop.grasper, loop.x);
    };
    CHECK(save(size) == size);
    for (const std::size_t less : {size - 1, size / 2, std::size_t{24}, std::size_t{23}, std::size_t{0}}) {
        CAPTURE(less);
        CHECK(save(less) == 0);
    }
}

TEMPLATE_TEST_CASE("a recording with snapshots is replayed from any of its ticks, from a file too", "[snapshot]",
                   double, float) {
    using S = TestType;
    test::WholeLoop<S> loop(9);
    const std::size_t bytes = snapshot_capacity(loop.solver, loop.tracker, loop.grasper, loop.x);
    Recorder<S> recorder(1000, loop.mesh.vertex_count(), {.count = 12, .bytes = bytes});
    const auto play = [&](auto& device, bool records) {
        const auto tool = device.read();
        if (records && recorder.size() % 100 == 50)
            CHECK(recorder.add_snapshot(loop.solver, loop.tracker, loop.grasper, loop.x));
        const auto contact = loop.tracker.update(loop.tree, loop.x, tool);
        const auto grasp = loop.grasper.update(contact, loop.x, tool);
        const auto report = loop.solver.step(loop.x, S(1e-3), loop.network, loop.foundation,
                                             press(tool, contact, grasp), pull(tool, grasp));
        loop.tree.refit(loop.x, report.moved);
        const auto force = report.total_reaction();
        if (records) recorder.add(tool, force);
        device.write(force);
    };
    for (int i = 0; i < 1000; ++i) play(loop.device, true);
    CHECK_FALSE(recorder.add_snapshot(loop.solver, loop.tracker, loop.grasper, loop.x));  // no tick is left

    std::stringstream file;
    write_recording(file, recorder.recording());
    const std::string text = file.str();
    ReplayDevice<S> again(read_recording<S>(file, loop.mesh.vertex_count()));
    const auto start_from = [&](std::size_t tick) {
        return again.start_from(tick, loop.solver, loop.tracker, loop.grasper, loop.x);
    };
    CHECK_FALSE(start_from(49));
    CHECK_FALSE(again.start_from(70, loop.solver));
    for (const std::size_t tick : {std::size_t{999}, std::size_t{50}, std::size_t{449}, std::size_t{650}}) {
        CAPTURE(tick);
        REQUIRE(start_from(tick));
        CHECK(again.next_tick() == (tick - 50) / 100 * 100 + 50);
        loop.tree.refit(loop.x);
        while (again.running()) play(again, false);
        CHECK(again.differing() == 0);
    }

    test::Random random(4);
    for (int i = 0; i < cases(50); ++i) {  // from the end on, where the snapshots are
        auto damaged = text;
        damaged[text.size() - 1 - static_cast<std::size_t>(random.index(static_cast<Index>(text.size() / 2)))] ^= 4;
        std::stringstream input(damaged);
        CHECK_THROWS_AS(read_recording<S>(input), InvalidInput);
    }
    std::stringstream cut(text.substr(0, text.size() - 5));
    CHECK_THROWS_WITH(read_recording<S>(cut), Catch::Contains("snapshot 9 of 10"));
}

namespace {

/// A part of a user's own, with a member that need not be kept.
struct Own {
    int kept = 1, scratch = 2;
    std::vector<double> numbers{1, 2, 3};

    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.kept, self.numbers);
    }
};

}  // namespace

TEST_CASE("a snapshot takes plain data, matrices in place, and types with parts", "[snapshot]") {
    Own own{.kept = 5, .scratch = 6, .numbers = {7, 8, 9}};
    double number = 0.5;
    std::vector<float> memory(12, 2.0F);
    Eigen::Map<Points<float>> view(memory.data(), 3, 4);
    IndexSet set(10);
    for (const Index i : {7, 2, 9}) set.insert(i);
    std::vector<std::byte> buffer(snapshot_capacity(own, number, view, set));
    const std::size_t size = save_snapshot(buffer, own, number, view, set);
    own = {};
    number = 0;
    view.setZero();
    set.clear();
    set.insert(3);
    REQUIRE(restore_snapshot(std::span(buffer).first(size), own, number, view, set));
    CHECK(own.kept == 5);
    CHECK(own.scratch == 2);
    CHECK(own.numbers == std::vector<double>{7, 8, 9});
    CHECK(number == 0.5);
    CHECK(memory == std::vector<float>(12, 2.0F));
    CHECK(std::vector<Index>(set.items().begin(), set.items().end()) == std::vector<Index>{7, 2, 9});
}

TEST_CASE("a snapshot from before a tear brings back the surface", "[snapshot][tear]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        test::TearingSurface<double> surface(test::random_surface<double>(random), 60);
        const auto whole = surface.mesh();
        AabbTree<double> tree(whole);
        ContactTracker<double> tracker(whole);
        Grasper<double> grasper(whole);
        VertexNormals<double> normals(whole);
        MovingBody<double> body(whole);
        Points<double> x = whole.positions();
        const auto follow = [&](const VertexSplit& split) {
            x.col(split.copy) = x.col(split.vertex);
            membrane::VertexSplit of = split;
            tree.split(of), tracker.split(of), grasper.split(of), normals.split(of), body.split(of);
        };
        const auto parts = std::tie(tree, tracker, grasper, normals, body, x);
        (void)surface.tear(random, follow);
        const auto snapshot = saved(parts);
        const auto mesh = surface.mesh();
        const Points<double> then = x;
        while (surface.tear(random, follow)) continue;
        REQUIRE(restored(snapshot, parts));
        REQUIRE(x == then);
        x = test::jittered(x, 0.02 * x.cwiseAbs().maxCoeff(), random);
        AabbTree<double> fresh_tree(mesh);
        VertexNormals<double> fresh_normals(mesh);
        tree.refit(x), fresh_tree.refit(x);
        normals.update(x), fresh_normals.update(x);
        REQUIRE(normals.values() == fresh_normals.values());
        for (Index n = 0; n < tree.statistics().nodes; ++n) REQUIRE(tree.box(n).low == fresh_tree.box(n).low);
        for (int i = 0; i < 20; ++i) {
            const auto triangle = triangle_at(x, mesh.triangles().col(random.index(mesh.triangle_count())));
            const Tool<double> tool{.position = point_at(triangle, random.barycentric())};
            const auto contact = tracker.update(tree, x, tool);
            if (contact.triangle == no_index) continue;
            const auto corners = mesh.triangles().col(contact.triangle);
            REQUIRE(contact.corners == std::array<Index, 3>{corners[0], corners[1], corners[2]});
        }
    }
}
