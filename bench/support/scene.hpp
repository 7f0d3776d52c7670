// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>

#include <membrane/membrane.hpp>

/// The scene of all benchmarks: a sphere of springs on its volume springs, and a tool that presses and slides.
///
///     Loop loop = pressed(642);
///     for (auto _ : state) loop.frame();
///     loop.validate();
namespace bench {

using membrane::Index;
using Vector3 = membrane::Vector3<double>;
using Points = membrane::Points<double>;

inline constexpr double radius = 0.01;      // of the sphere [m]
inline constexpr double stiffness = 40;     // of its springs [N/m]
inline constexpr double foundation = 8;     // stiffness of the volume springs [N/m]
inline constexpr double depth = 1e-3;       // of the tool's press [m]
inline constexpr double tick = 1e-3;        // [s]
inline constexpr Index ticks_around = 600;  // of one turn of the tool

/// If `right` is false, ends the program: a wrong result would be measured.
inline void require(bool right, const char* what) {
    if (right) return;
    std::fprintf(stderr, "error: wrong result: %s\n", what);
    std::abort();
}

/// The icosphere with this number of vertices.
[[nodiscard]] inline membrane::TriangleMesh<double> sphere(std::int64_t vertices) {
    Index subdivisions = 0;
    while (10 * (std::int64_t{1} << 2 * subdivisions) + 2 < vertices) ++subdivisions;
    return membrane::icosphere<double>({.radius = radius, .subdivisions = subdivisions});
}

/// The icosphere with points of this scalar.
template <membrane::Real Scalar>
[[nodiscard]] membrane::TriangleMesh<Scalar> sphere_of(std::int64_t vertices) {
    const auto mesh = sphere(vertices);
    return {mesh.positions().cast<Scalar>(), mesh.triangles()};
}

/// The sizes to measure.
inline void sizes(benchmark::internal::Benchmark* measured) {
    measured->ArgName("vertices");
    for (const int vertices : {162, 642, 2562, 10242}) measured->Arg(vertices);
}

/// The sizes for a measurement frame by frame: a third of a turn.
inline void sizes_around(benchmark::internal::Benchmark* measured) {
    sizes(measured);
    measured->Iterations(ticks_around / 3)->UseManualTime();
}

/// A tool by its shape, and its trajectory: `ticks_in` straight in, then around the pole.
struct Path {
    static constexpr Index ticks_in = 100;

    double tool_radius = 2e-3;  ///< [m]
    double shaft = 0;           ///< its length, zero for a sphere [m]
    double scale = 1;           ///< of tool, depth and trajectory: 1/2 suits a mesh of half the edge length

    friend auto operator<=>(const Path&, const Path&) = default;

    template <membrane::Real Scalar>
    [[nodiscard]] membrane::Tool<Scalar> at(Index t) const {
        return {.position = position(t).cast<Scalar>(),
                .axis = (scale * shaft * pole()).cast<Scalar>(),
                .radius = static_cast<Scalar>(scale * tool_radius),
                .velocity = ((position(t) - position(t - 1)) / tick).cast<Scalar>(),
                .time = static_cast<Scalar>(tick * t)};
    }

  private:
    [[nodiscard]] static Vector3 pole() { return Vector3(0.3, 0.2, 0.93).normalized(); }

    [[nodiscard]] Vector3 position(Index t) const {
        const double tilt = 0.5, turn = scale * 2 * std::numbers::pi * std::max(t - ticks_in, 0) / ticks_around;
        const Vector3 u = membrane::cross<double>(pole(), Vector3::UnitX()).normalized();
        const Vector3 outward = std::cos(turn) * u + std::sin(turn) * membrane::cross(pole(), u);
        const double above = 1.2 * depth * std::max(ticks_in - t, 0) / ticks_in;
        return (radius + scale * (tool_radius - depth + above)) * (std::cos(tilt) * pole() + std::sin(tilt) * outward);
    }
};

enum class Stage { contact, solve, refit, normals, force };

/// The loop of the README, its stages one by one, with a tool on a trajectory like `Path`.
template <membrane::Real Scalar, class Rule = membrane::BlockStep, class Trajectory = Path>
struct LoopOf {
    explicit LoopOf(std::int64_t vertices, const Trajectory& trajectory = {},
                    const membrane::SolverOptions<Scalar>& options = usual(),
                    Index ticks = Trajectory::ticks_in + ticks_around)
        : path(trajectory), mesh(sphere_of<Scalar>(vertices)), solver(network, options) {
        while (now < ticks) frame();
    }

    static membrane::SolverOptions<Scalar> usual() { return {.layers = 6, .sweeps = 2}; }

    /// One frame.
    void frame() {
        frame([](Stage, auto work) { work(); });
    }

    /// One frame; `run(stage, work)` executes each stage.
    template <class Run>
    void frame(Run run) {
        tool = path.template at<Scalar>(now++);
        run(Stage::contact, [&] { contact = tracker.update(tree, x, tool); });
        run(Stage::solve, [&] { report = solver.step(x, Scalar(tick), network, volume, press(tool, contact)); });
        run(Stage::refit, [&] { tree.refit(x, report.moved); });
        run(Stage::normals, [&] { normals.update(x, report.moved); });
        run(Stage::force, [&] { force = feel({tool, contact, report}); });
        pressing = pressing && report.status == membrane::StepStatus::advanced &&
                   (now < Trajectory::ticks_in || contact.touching());
    }

    /// Requires that the tool was in contact since `ticks_in`, that normals and tree match the positions, and that the
    /// reaction is outward.
    void validate() const;

    Trajectory path;
    Index now = 0;  // ticks
    membrane::TriangleMesh<Scalar> mesh;
    membrane::MassSpringNetwork<Scalar, membrane::LinearSpring> network{mesh, {}, {.stiffness = Scalar(stiffness)}};
    membrane::VirtualVolumeSprings<Scalar> volume{mesh, {.stiffness = Scalar(foundation), .damping = Scalar(0.02)}};
    membrane::QuasiStaticSolver<Scalar, Rule> solver;
    membrane::AabbTree<Scalar> tree{mesh};
    membrane::ContactTracker<Scalar> tracker{mesh};
    membrane::VertexNormals<Scalar> normals{mesh};
    membrane::SpringDamperForce feel{.stiffness = 100, .damping = 0.5};
    membrane::Points<Scalar> x = mesh.positions();

    membrane::Tool<Scalar> tool;
    membrane::Contact<Scalar> contact;
    membrane::StepReport<Scalar> report;
    membrane::Vector3<Scalar> force = membrane::Vector3<Scalar>::Zero();
    bool pressing = true;
};

using Loop = LoopOf<double>;

/// The loop with the tool pressed in after its first turn; made once.
[[nodiscard]] inline const Loop& pressed(std::int64_t vertices, const Path& path = {}) {
    static std::map<std::pair<std::int64_t, Path>, Loop> made;
    return made.try_emplace({vertices, path}, vertices, path).first->second;
}

/// Time that `work` takes, less the time to read the clocks [s]: the smaller of wall clock and processor time, so that
/// other processes do not count.
template <class Work>
[[nodiscard]] double seconds(Work work) {
    const auto read = [](clockid_t clock) {
        std::timespec time;
        clock_gettime(clock, &time);
        return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
    };
    const auto both = [&](const auto& body) {
        const double cpu = read(CLOCK_THREAD_CPUTIME_ID), wall = read(CLOCK_MONOTONIC);
        body();
        benchmark::ClobberMemory();
        const double wall_end = read(CLOCK_MONOTONIC);
        return std::pair(wall_end - wall, read(CLOCK_THREAD_CPUTIME_ID) - cpu);
    };
    static const auto reading = [&] {
        std::pair shortest(1.0, 1.0);
        for (int i = 0; i < 1000; ++i) {
            const auto [wall, cpu] = both([] {});
            shortest = {std::min(shortest.first, wall), std::min(shortest.second, cpu)};
        }
        return shortest;
    }();
    const auto [wall, cpu] = both(work);
    return std::max(std::min(wall - reading.first, cpu - reading.second), 0.0);
}

/// The processor time of this thread [s], without that of other processes.
struct ProcessorSeconds {
    double operator()() const noexcept {
        std::timespec time;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
        return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
    }
};

/// Measures one stage of the loop, frame by frame.
inline void measure_stage(benchmark::State& state, Loop loop, Stage part) {
    for (auto _ : state) {
        loop.frame([&](Stage stage, auto work) {
            if (stage == part) {
                state.SetIterationTime(seconds(work));
            } else {
                work();
            }
        });
    }
    loop.validate();
}

/// Points within 0.87 to 1.13 radii of the centre, equal in every run.
[[nodiscard]] inline std::vector<Vector3> points_near(std::size_t count) {
    std::mt19937_64 engine(20071101);
    const auto number = [&](double low, double high) {
        return low + (high - low) * static_cast<double>(engine() >> 11) * 0x1p-53;
    };
    std::vector<Vector3> points;
    while (points.size() < count) {
        const double x = number(-1, 1), y = number(-1, 1), z = number(-1, 1);
        const Vector3 direction(x, y, z);
        const double length = membrane::norm(direction);
        if (length > 0.1 && length < 1) points.push_back(radius * number(0.87, 1.13) / length * direction);
    }
    return points;
}

/// The nearest point by brute force over all triangles.
template <membrane::Real Scalar>
[[nodiscard]] membrane::TrianglePoint<Scalar> closest_of_all(const membrane::TriangleMesh<Scalar>& mesh,
                                                             const membrane::Points<Scalar>& x,
                                                             const membrane::Vector3<Scalar>& q) {
    membrane::TrianglePoint<Scalar> best{{0, 0, 0}, {0, 0, 0}, std::numeric_limits<Scalar>::infinity()};
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        const auto found = membrane::closest_point(membrane::triangle_at(x, mesh.triangles().col(f)), q);
        if (found.squared_distance < best.squared_distance) best = found;
    }
    return best;
}

template <membrane::Real Scalar, class Rule, class Trajectory>
void LoopOf<Scalar, Rule, Trajectory>::validate() const {
    const membrane::Vector3<Scalar>& reaction = report.reactions[0];
    require(pressing, "the tool has lost contact, or a step was refused");
    require(report.residual < membrane::norm(reaction) / 2, "the residual must be below half the reaction");
    require(reaction.dot(tool.position) > 0 && force.dot(tool.position) > 0, "the reaction must be outward");
    membrane::VertexNormals<Scalar> anew(mesh);
    anew.update(x);
    require(normals.values() == anew.values(), "normals of the moved vertices");
    for (const auto& point : points_near(16)) {
        const membrane::Vector3<Scalar> q = point.cast<Scalar>();
        const Scalar squared = closest_of_all(mesh, x, q).squared_distance;
        const Scalar error = tree.closest_point(x, q).squared_distance - squared;
        require(std::abs(error) <= 4096 * std::numeric_limits<Scalar>::epsilon() * squared,
                "distance by the refitted tree");
    }
}

}  // namespace bench
