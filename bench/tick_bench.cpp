// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include <membrane/tissue/spring_stiffness.hpp>

#include "support/bullet_scene.hpp"
#include "support/slide.hpp"
#include "support/tick_scenes.hpp"

// Time of a whole tick, and error of its force: a tool of 2 mm is pressed 1 mm deep and slides at 50 mm/s, by scalar,
// mesh, layers and sweeps, beside the tick of Bullet's soft body with the same trajectory; and after 1,500 ticks. Then
// a tick with other tools, laws, rules and bodies.

namespace {

using namespace bench;

#define BENCH_TEXT(name) #name
#define BENCH_TEXT_OF(name) BENCH_TEXT(name)
constexpr const char* instruction_set = BENCH_TEXT_OF(MEMBRANE_INSTRUCTION_SET);

// Ours and Bullet's alternate after this number of ticks: other load of the machine affects both, and the median omits
// the first ticks of a turn, whose caches are cold.
constexpr Index ticks_in_turn = 20;
static_assert(Slide::ticks % ticks_in_turn == 0);

/// Times of the stages of each tick [s].
struct Times {
    std::vector<double> whole, contact, sweep, other;
};

/// Errors of the loop's forces and penetration of its tool.
struct Errors {
    double squares = 0;      // of the differences to the reference's forces [N^2]
    double largest = 0;      // force [N]
    double penetration = 0;  // of the tool into a triangle [m]
};

/// Largest penetration of the tool into a triangle in contact [m]. Its centre is on the outer side.
template <Real Scalar>
double penetration_of(const SlidingLoop<Scalar>& loop) {
    const Vector3 centre = loop.tool.position.template cast<double>();
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& touched : loop.contact.patch.triangles) {
        const auto [a, b, c] = membrane::triangle_at(loop.x, touched.corners);
        const membrane::Triangle<double> triangle{a.template cast<double>(), b.template cast<double>(),
                                                  c.template cast<double>()};
        nearest = std::min(nearest, std::sqrt(membrane::closest_point(triangle, centre).squared_distance));
    }
    return std::max(static_cast<double>(loop.tool.radius) - nearest, 0.0);
}

/// Times the stages of one tick. The contact iterations of a step are part of `sweep`: between the vertex updates they
/// cannot be timed.
template <Real Scalar>
void measure(SlidingLoop<Scalar>& loop, Times& times) {
    std::array<double, 3> taken{};
    loop.frame([&](Stage stage, auto work) {
        taken[stage == Stage::contact ? 0 : stage == Stage::solve ? 1 : 2] += seconds(work);
    });
    if (loop.now <= Slide::first_measured) return;
    times.contact.push_back(taken[0]);
    times.sweep.push_back(taken[1]);
    times.other.push_back(taken[2]);
    times.whole.push_back(taken[0] + taken[1] + taken[2]);
}

template <Real Scalar>
void compare(const SlidingLoop<Scalar>& loop, const Reference& reference, Errors& errors) {
    if (loop.now <= Slide::first_measured) return;
    const Vector3 force = loop.report.reactions[0].template cast<double>();
    const auto at = static_cast<std::size_t>(loop.now - Slide::first_measured - 1);
    errors.squares += membrane::squared_norm<double>(force - reference.forces[at]);
    errors.largest = std::max(errors.largest, membrane::norm(force));
    errors.penetration = std::max(errors.penetration, penetration_of(loop));
}

/// Bullet's body at rest; made once for each mesh.
BulletScene& bullet_of(std::int64_t vertices) {
    static std::map<std::int64_t, std::unique_ptr<BulletScene>> made;
    auto& scene = made[vertices];
    if (!scene) scene = std::make_unique<BulletScene>(vertices, Slide{}.tool_radius);
    scene->reset();
    return *scene;
}

template <Real Scalar>
void path(benchmark::State& state) {
    const std::int64_t vertices = state.range(2);
    const membrane::SolverOptions<Scalar> options{.layers = static_cast<Index>(state.range(0)),
                                                  .sweeps = static_cast<Index>(state.range(1))};
    const Reference& reference = reference_of(vertices);
    for (auto _ : state) {
        SlidingLoop<Scalar> loop(vertices, {}, options, 0);
        BulletScene& bullet = bullet_of(vertices);
        Times times;
        Errors errors;
        std::vector<double> bullets;
        int touched = 0;
        while (loop.now < Slide::ticks) {
            const Index turn = loop.now;
            for (Index t = turn; t < turn + ticks_in_turn; ++t) {
                measure(loop, times);
                compare(loop, reference, errors);
            }
            for (Index t = turn; t < turn + ticks_in_turn; ++t) {
                const Vector3 position = loop.path.position(t);
                const double time = seconds([&] { bullet.frame(position); });
                touched += bullet.touched();
                if (t >= Slide::first_measured) bullets.push_back(time);
            }
        }
        loop.validate();
        require(bullet.finite() && touched > 0, "the tool must press on Bullet's body");
        require(bullet.penetration() < depth / 2, "Bullet's nodes must not penetrate the tool");

        Times late;
        while (loop.now < Slide::late_ticks - 5 * ticks_in_turn) loop.frame();
        while (loop.now < Slide::late_ticks) measure(loop, late);
        loop.validate();

        const double time = median(times.whole), theirs = median(bullets);
        state.SetIterationTime(time);
        state.counters["contact"] = median(times.contact);
        state.counters["sweep"] = median(times.sweep);
        state.counters["other"] = median(times.other);
        state.counters["late"] = median(late.whole);
        state.counters["force_error"] =
            std::sqrt(errors.squares / static_cast<double>(reference.forces.size())) / reference.rms;
        state.counters["largest_force"] = errors.largest / reference.largest;
        state.counters["penetration"] = errors.penetration / static_cast<double>(membrane::mean_edge(loop.mesh));
        state.counters["bullet"] = theirs;
        state.counters["ratio"] = theirs / time;
    }
    state.SetLabel(instruction_set);
}
void settings(benchmark::internal::Benchmark* measured) {
    measured->ArgNames({"layers", "sweeps", "vertices"});
    for (const int vertices : {642, 2562, 10242, 40962}) {
        measured->Args({6, 2, vertices});
        measured->Args({3, 1, vertices});
    }
    measured->Iterations(1)->UseManualTime();
}
BENCHMARK(path<double>)->Name("path/scalar:double")->Apply(settings);
BENCHMARK(path<float>)->Name("path/scalar:float")->Apply(settings);

/// Measures a scene's whole tick.
template <class Scene>
void scene(benchmark::State& state) {
    for (auto _ : state) {
        Scene played(sphere(state.range(0)));
        std::vector<double> times;
        bool advanced = true, felt = true;
        for (Index t = 0; t < Slide::ticks; ++t) {
            played.aim(t);
            const double time = seconds([&] { played.frame(); });
            advanced = advanced && played.report.status == membrane::StepStatus::advanced;
            if (t < Slide::first_measured) continue;
            felt = felt && played.felt();
            times.push_back(time);
        }
        require(advanced, "every step must advance");
        require(felt, "every reaction must be felt");
        state.SetIterationTime(median(times));
    }
    state.SetLabel(instruction_set);
}
void sizes_of_scenes(benchmark::internal::Benchmark* measured) {
    measured->ArgName("vertices");
    for (const int vertices : {642, 2562, 10242}) measured->Arg(vertices);
    measured->Iterations(1)->UseManualTime();
}
BENCHMARK(scene<SphereScene>)->Name("scene/sphere")->Apply(sizes_of_scenes);
BENCHMARK(scene<ByFaces>)->Name("scene/by_faces")->Apply(sizes_of_scenes);
BENCHMARK(scene<TwoTools>)->Name("scene/two_tools")->Apply(sizes_of_scenes);
BENCHMARK(scene<CapsuleTool>)->Name("scene/capsule")->Apply(sizes_of_scenes);
BENCHMARK(scene<PointTool>)->Name("scene/point")->Apply(sizes_of_scenes);
BENCHMARK(scene<Forceps>)->Name("scene/forceps")->Apply(sizes_of_scenes);
BENCHMARK(scene<PinnedRim>)->Name("scene/pinned")->Apply(sizes_of_scenes);
BENCHMARK(scene<TurningBody>)->Name("scene/turning")->Apply(sizes_of_scenes);
BENCHMARK(scene<BeatingBody>)->Name("scene/beating")->Apply(sizes_of_scenes);
BENCHMARK(scene<StiffeningLaw>)->Name("scene/stiffening")->Apply(sizes_of_scenes);
BENCHMARK(scene<Published>)->Name("scene/published")->Apply(sizes_of_scenes);
BENCHMARK(scene<Cup>)->Name("scene/suction")->Apply(sizes_of_scenes);
BENCHMARK(scene<WithDeadline>)->Name("scene/deadline")->Apply(sizes_of_scenes);
BENCHMARK(scene<BentTissue>)->Name("scene/tissue")->Apply(sizes_of_scenes);

}  // namespace
