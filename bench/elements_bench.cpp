// SPDX-License-Identifier: MIT
#include <string>
#include <vector>

#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/bending_triangles.hpp>
#include <membrane/tissue/fibres.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/fung.hpp>
#include <membrane/tissue/neo_hookean.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/spring_stiffness.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/scene.hpp"
#include "support/slide.hpp"

// A step of springs and of tissues with more and more kinds of elements: a ball slides, 0.5 mm deep, over a clamped
// disc of 469 vertices on a soft layer.

namespace {

using namespace bench;

/// The disc's parts that no kind of element changes.
template <membrane::Real Scalar>
struct Disc {
    membrane::TriangleMesh<Scalar> mesh = membrane::disc<Scalar>({.radius = 5e-3, .rings = 12});
    membrane::Material material{.young_modulus = 1e6, .poisson_ratio = 0.45, .thickness = 50e-6};
    membrane::FoundationLayer layer{.young_modulus = 2e3, .poisson_ratio = 0.45, .thickness = 1e-3};
    membrane::FoundationSprings<Scalar> foundation{mesh,
                                                   {.normal = membrane::normal_stiffnesses(mesh, layer),
                                                    .tangential = membrane::tangential_stiffnesses(mesh, layer),
                                                    .recovery_time = Scalar(0.05)}};

    [[nodiscard]] auto springs() const {
        return membrane::MassSpringNetwork(
            mesh, membrane::LinearSpring{},
            {.stiffness = membrane::spring_stiffnesses(mesh, material), .pinned = membrane::border(mesh)});
    }
    [[nodiscard]] auto none() const {
        return membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                           {.stiffness = Scalar(0), .pinned = membrane::border(mesh)});
    }
    [[nodiscard]] auto triangles() const { return membrane::triangular_springs(mesh, material, 1.02); }
    [[nodiscard]] auto hinges() const { return membrane::bending_springs(mesh, membrane::flexural_rigidity(material)); }
    [[nodiscard]] auto plates() const {
        return membrane::bending_triangles(mesh, {.rigidity = membrane::flexural_rigidity(material),
                                                  .poisson_ratio = material.poisson_ratio,
                                                  .clamped = membrane::border(mesh)});
    }
    [[nodiscard]] auto pressure() const { return membrane::pressure(mesh, 100.0); }
    [[nodiscard]] auto neo_hookean() const { return membrane::neo_hookean(mesh, material, 1.02); }
    [[nodiscard]] auto fung() const { return membrane::fung(mesh, material, {}, 1.02); }
    [[nodiscard]] auto fibres() const {
        const auto along_x = membrane::fibre_directions(mesh, [](const auto&) { return Eigen::Vector3d::UnitX(); });
        return membrane::fibres(mesh, {.stiffness = material.young_modulus / 4, .thickness = material.thickness},
                                {along_x}, 1.02);
    }
};

/// Median of the time of a step [s].
template <membrane::Real Scalar, class Network>
double step_time(const Disc<Scalar>& disc, const Network& network) {
    constexpr Index ticks = 300;
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(disc.mesh);
    auto tracker = membrane::ContactTracker(disc.mesh);
    auto x = disc.mesh.positions();
    std::vector<double> times;
    for (Index t = 0; t < ticks; ++t) {
        const membrane::Tool<Scalar> tool{.position = {Scalar(1e-5 * t - 1.5e-3), 0, Scalar(0.5e-3)},
                                          .radius = Scalar(1e-3)};
        const auto contact = tracker.update(tree, x, tool);
        membrane::StepReport<Scalar> report;
        times.push_back(seconds(
            [&] { report = solver.step(x, Scalar(1e-3), network, disc.foundation, membrane::press(tool, contact)); }));
        require(report.status == membrane::StepStatus::advanced, "every step must advance");
        tree.refit(x, report.moved);
    }
    return median(times);
}

/// The time of a step, and its ratio to that of springs in the same run.
template <membrane::Real Scalar, class MakeNetwork>
void elements(benchmark::State& state, MakeNetwork make) {
    const Disc<Scalar> disc;
    for (auto _ : state) {
        const double springs = step_time(disc, disc.springs()), time = step_time(disc, make(disc));
        state.SetIterationTime(time);
        state.counters["ratio"] = time / springs;
    }
}
void in_both(const char* name, auto make) {
    const auto add = [&](const std::string& scalar, auto run) {
        benchmark::RegisterBenchmark((name + ("/" + scalar)).c_str(), run)
            ->ArgName("vertices")
            ->Arg(469)
            ->Iterations(1)
            ->UseManualTime();
    };
    add("double", [=](benchmark::State& state) { elements<double>(state, make); });
    add("float", [=](benchmark::State& state) { elements<float>(state, make); });
}

const bool registered = [] {
    in_both("springs", [](const auto& disc) { return disc.springs(); });
    in_both("triangles", [](const auto& disc) { return membrane::Tissue(disc.none(), disc.triangles()); });
    in_both("triangles_pressure",
            [](const auto& disc) { return membrane::Tissue(disc.none(), disc.triangles(), disc.pressure()); });
    in_both("triangles_pressure_bending", [](const auto& disc) {
        return membrane::Tissue(disc.none(), disc.triangles(), disc.pressure(), disc.hinges());
    });
    in_both("neo_hookean", [](const auto& disc) { return membrane::Tissue(disc.none(), disc.neo_hookean()); });
    in_both("neo_hookean_fibres",
            [](const auto& disc) { return membrane::Tissue(disc.none(), disc.neo_hookean(), disc.fibres()); });
    in_both("fung", [](const auto& disc) { return membrane::Tissue(disc.none(), disc.fung()); });
    in_both("triangles_pressure_bending_triangles", [](const auto& disc) {
        return membrane::Tissue(disc.none(), disc.triangles(), disc.pressure(), disc.plates());
    });
    return true;
}();

}  // namespace
