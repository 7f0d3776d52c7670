// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/coarse/coarse_correction.hpp>
#include <membrane/membrane.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

// coarse FOLDER: where nothing but the rim holds a membrane, or next to nothing, how far the force of a step is off the
// equilibrium, how far by the estimate, and how long a tick takes: with the default layers, with all, and with the
// default ones and a coarse correction, which may wake vertices. Prints a Markdown table and writes it to coarse.csv in
// FOLDER.

namespace {

using membrane::Index;
using Mesh = membrane::TriangleMesh<double>;
using Points = membrane::Points<double>;
using Vector = membrane::Vector3<double>;
using Tool = membrane::Tool<double>;
using Forceps = membrane::PointAttachment<double>;
using Hand = std::variant<Tool, Forceps>;

constexpr double dt = 1e-3;  // [s]
constexpr int rounds = 3;

struct Setting {
    const char* name;
    membrane::SolverOptions<double> solver;
    bool corrected, wakes;
    Index period = 1;  // of corrections
};
const Setting settings[]{{"6 layers", {.layers = 6, .sweeps = 2}, false, false},
                         {"all layers", {.layers = membrane::unlimited, .sweeps = 2}, false, false},
                         {"6 layers and correction", {.layers = 6, .sweeps = 2}, true, false},
                         {"correction in one tick of three", {.layers = 6, .sweeps = 2}, true, false, 3},
                         {"correction, unbalanced woken", {.layers = 6, .sweeps = 2}, true, true}};

/// What a hand does.
struct Path {
    std::string name;
    int ticks;
    int interval;  ///< of the ticks that are compared with equilibria
    std::function<Hand(int)> hand_at;

    [[nodiscard]] bool is_compared(int tick) const { return (tick + 1) % interval == 0; }
};

/// The part of a motion that is done at a tick, 0 to 1.
double part_done(int tick, int begin, int duration) {
    return std::clamp(static_cast<double>(tick - begin) / duration, 0.0, 1.0);
}

/// A ball is pressed into the disc in 100 ticks, then slides along x by `distance` [m].
Path slide(const std::string& name, int ticks, int interval, int duration, double distance) {
    return {name, ticks, interval, [=](int t) {
                constexpr double radius = 1e-3, depth = 0.5e-3;
                const double x = -1.5e-3 + distance * part_done(t, 100, duration);
                return Tool{.position = {x, 0, radius - depth * part_done(t, 0, 100)}, .radius = radius};
            }};
}

/// Forceps at the triangle nearest to a point draw it up in 100 ticks, and after 50 more aside.
Path draw(const Mesh& mesh) {
    const auto centroid = [&](Index f) {
        return membrane::point_at(membrane::triangle_at(mesh.positions(), mesh.triangles().col(f)),
                                  Vector::Constant(1.0 / 3));
    };
    Index nearest = 0;
    const Vector place(-1.5e-3, 0, 0);
    for (Index f = 1; f < mesh.triangle_count(); ++f) {
        if ((centroid(f) - place).norm() < (centroid(nearest) - place).norm()) nearest = f;
    }
    const auto corners = mesh.triangles().col(nearest);
    const Forceps at_rest{.triangle = nearest,
                          .corners = {corners[0], corners[1], corners[2]},
                          .barycentric = Vector::Constant(1.0 / 3),
                          .target = centroid(nearest)};
    return {"forceps", 250, 10, [at_rest](int t) {
                constexpr double distance = 0.3e-3;
                Forceps forceps = at_rest;
                forceps.target += distance * Vector(part_done(t, 150, 100), 0, part_done(t, 0, 100));
                return forceps;
            }};
}

/// A ball is pressed into the sphere in 100 ticks, off the axes of symmetry of the mesh: on one, the equilibrium found
/// is symmetric, and steps leave it for another.
Path press_on_sphere() {
    return {"sphere on weak springs", 150, 10, [](int t) {
                constexpr double sphere = 10e-3, radius = 2e-3, depth = 1e-3;
                const Vector outward = Vector(0.3, 0.2, 1).normalized();
                return Tool{.position = (sphere + radius - depth * part_done(t, 0, 100)) * outward, .radius = radius};
            }};
}

template <class Network, class Foundation>
struct Membrane {
    Mesh mesh;
    Network network;
    Foundation foundation;
    Points start = mesh.positions();
};

/// Calls `act` with the constraint of a hand: forceps, or a tool where it touches the membrane.
template <class Act>
auto with_constraint(const Hand& hand, membrane::ContactTracker<double>& tracker,
                     const membrane::AabbTree<double>& tree, const Points& x, const Act& act) {
    if (const auto* forceps = std::get_if<Forceps>(&hand)) return act(*forceps);
    const Tool& tool = std::get<Tool>(hand);
    return act(membrane::press(tool, tracker.update(tree, x, tool)));
}

/// The forces at equilibrium at the compared ticks, each found from the one before [N].
template <class M>
std::vector<Vector> reference(const Path& path, const M& membrane) {
    membrane::ContactTracker<double> tracker(membrane.mesh);
    membrane::AabbTree<double> tree(membrane.mesh);
    Points x = membrane.start;
    std::vector<Vector> forces;
    for (int t = 0; t < path.ticks; ++t) {
        if (!path.is_compared(t)) continue;
        tree.refit(x);
        const auto found = with_constraint(path.hand_at(t), tracker, tree, x, [&](const auto& constraint) {
            return membrane::equilibrium(x, membrane.mesh, membrane.network, membrane.foundation, constraint);
        });
        if (!found.converged) throw std::runtime_error("no equilibrium at tick " + std::to_string(t));
        x = found.x;
        forces.push_back(found.reactions[0]);
    }
    return forces;
}

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

struct Result {
    double error, worst;  // rms and largest difference of the forces, over the rms and the largest of the reference [%]
    double estimate;      // rms of the estimates of these differences, over the rms of the reference [%]
    double seconds;       // of a tick, median
};

template <class M>
Result run(const Path& path, const M& membrane, const Setting& setting, const std::vector<Vector>& right) {
    membrane::QuasiStaticSolver<double> solver(membrane.network, setting.solver);
    membrane::ContactTracker<double> tracker(membrane.mesh);
    membrane::AabbTree<double> tree(membrane.mesh);
    tree.refit(membrane.start);
    membrane::CoarseCorrection coarse(membrane.mesh, membrane.network, membrane.foundation, {.period = setting.period});
    Points x = membrane.start;
    double seconds = 0, squares = 0, all = 0, estimated = 0, all_estimated = 0, worst = 0, largest = 0;
    auto expected = right.begin();
    for (int t = 0; t < path.ticks; ++t) {
        const Hand hand = path.hand_at(t);
        const auto start = std::chrono::steady_clock::now();
        const auto report = with_constraint(hand, tracker, tree, x, [&](const auto& constraint) {
            return solver.step(x, dt, membrane.network, membrane.foundation, constraint);
        });
        Vector estimate = Vector::Constant(std::nan(""));
        if (setting.corrected) {
            const auto corrected = coarse.correct(x, solver);
            estimate = corrected.reaction_error;
            if (setting.wakes) solver.wake(corrected.unbalanced);
            tree.refit(x);
        } else {
            tree.refit(x, report.moved);
        }
        seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        if (report.status != membrane::StepStatus::advanced) throw std::runtime_error("a step was refused");
        if (!path.is_compared(t)) continue;
        if (!setting.corrected) estimate = coarse.reaction_error(x, solver);
        const double apart = (report.reactions[0] - *expected).norm(), size = expected->norm();
        squares += apart * apart, all += size * size;
        if (membrane::is_finite(estimate)) estimated += estimate.squaredNorm(), all_estimated += size * size;
        worst = std::max(worst, apart), largest = std::max(largest, size);
        ++expected;
    }
    return {100 * std::sqrt(squares / all), 100 * worst / largest, 100 * std::sqrt(estimated / all_estimated),
            seconds / path.ticks};
}

// Settings take turns, so that a temporary load of the machine affects all.
template <class M>
void measure(std::ofstream& file, const Path& path, const M& membrane) {
    constexpr std::size_t count = std::size(settings);
    const std::vector<Vector> right = reference(path, membrane);
    std::array<std::vector<double>, count> seconds, ratios;
    std::array<Result, count> last{};
    for (int round = 0; round < rounds; ++round) {
        for (std::size_t i = 0; i < count; ++i) {
            last[i] = run(path, membrane, settings[i], right);
            seconds[i].push_back(last[i].seconds);
            ratios[i].push_back(last[i].seconds / seconds[0].back());
        }
    }
    for (std::size_t i = 0; i < count; ++i) {
        const Index vertices = membrane.mesh.vertex_count();
        const double time = 1e6 * median(seconds[i]), ratio = median(ratios[i]);
        std::printf("| %s | %d | %s | %.2f %% | %.2f %% | %.2f %% | %.0f us | %.2f |\n", path.name.c_str(), vertices,
                    settings[i].name, last[i].error, last[i].worst, last[i].estimate, time, ratio);
        file << path.name << ',' << vertices << ',' << settings[i].name << ',' << last[i].error << ',' << last[i].worst
             << ',' << last[i].estimate << ',' << time << ',' << ratio << std::endl;
    }
    std::fflush(stdout);
}

const membrane::Material capsule = membrane::materials::lens_capsule().typical;

/// Lens capsule, stretched, with pinned vertices and with further elements.
template <class... Elements>
auto stretched(const Mesh& mesh, const std::vector<Index>& pinned, double stretch, const Elements&... elements) {
    const membrane::MassSpringNetwork no_springs(mesh, membrane::LinearSpring{}, {.stiffness = 0.0, .pinned = pinned});
    const membrane::Tissue tissue(no_springs, membrane::triangular_springs(mesh, capsule, stretch), elements...);
    return Membrane<std::remove_const_t<decltype(tissue)>, membrane::NoFoundation>{mesh, tissue, {}};
}

/// A disc of 5 mm, pinned at its rim.
Mesh disc_of(Index rings) { return membrane::disc<double>({.radius = 5e-3, .rings = rings}); }
auto stretched_disc(Index rings, double stretch = 1.02) {
    const Mesh mesh = disc_of(rings);
    return stretched(mesh, membrane::border(mesh), stretch);
}

/// The same, 30 times as stiff in bending as the capsule.
auto disc_with_hinges(Index rings) {
    const Mesh mesh = disc_of(rings);
    return stretched(mesh, membrane::border(mesh), 1.02,
                     membrane::bending_springs(mesh, 30 * membrane::flexural_rigidity(capsule)));
}

/// A disc of springs without tension, pinned at its rim.
auto slack_disc(Index rings) {
    const Mesh mesh = disc_of(rings);
    const membrane::MassSpringNetwork springs(mesh, membrane::LinearSpring{},
                                              {.stiffness = 20.0, .pinned = membrane::border(mesh)});
    return Membrane<std::remove_const_t<decltype(springs)>, membrane::NoFoundation>{mesh, springs, {}};
}

/// A strip of 20 by 5 mm, pinned at its short sides: between them it folds. It starts in equilibrium.
auto strip() {
    const Mesh mesh = membrane::sheet<double>({.width = 20e-3, .height = 5e-3, .columns = 80, .rows = 20});
    std::vector<Index> ends;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        if (std::abs(mesh.positions()(0, v)) > 9.99e-3) ends.push_back(v);
    }
    auto result = stretched(mesh, ends, 1.02);
    const membrane::PointLoad<double> none = membrane::load({0, 1, 81}, Vector::Constant(1.0 / 3), Vector::Zero());
    const auto found = membrane::equilibrium(mesh.positions(), mesh, result.network, result.foundation, none);
    if (!found.converged) throw std::runtime_error("the strip has no equilibrium");
    result.start = found.x;
    return result;
}

/// A sphere on volume springs of a hundredth of its springs' stiffness.
auto sphere() {
    const auto mesh = membrane::icosphere<double>({.radius = 10e-3, .subdivisions = 3});
    const membrane::MassSpringNetwork springs(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    using Springs = std::remove_const_t<decltype(springs)>;
    return Membrane<Springs, membrane::VirtualVolumeSprings<double>>{mesh, springs, {mesh, {.stiffness = 0.4}}};
}

void run_all(const std::filesystem::path& folder) {
    std::ofstream file(folder / "coarse.csv");
    if (!file) throw std::runtime_error("cannot write to " + folder.string());
    file << "scene,vertices,setting,error_percent,worst_percent,estimate_percent,tick_us,ratio\n";
    std::printf("| scene | vertices | setting | error | worst | estimate | tick | over that of %s |\n",
                settings[0].name);
    std::printf("|---|---|---|---|---|---|---|---|\n");
    for (const Index rings : {14, 28, 56}) {
        const auto disc = stretched_disc(rings);
        const bool fine = rings == 56;  // its equilibria take long: few of them
        measure(file, slide("slide at 20 mm/s", 250, fine ? 25 : 10, 150, 3e-3), disc);
        if (fine) continue;
        measure(file, slide("slide at 100 mm/s then held", 160, 10, 30, 3e-3), disc);
        measure(file, draw(disc.mesh), disc);
    }
    constexpr Index rings = 24;
    measure(file, slide("tension of 0.5 %", 250, 10, 150, 3e-3), stretched_disc(rings, 1.005));
    measure(file, slide("tension of 5 %", 250, 10, 150, 3e-3), stretched_disc(rings, 1.05));
    measure(file, slide("with bending springs", 250, 10, 150, 3e-3), disc_with_hinges(rings));
    measure(file, slide("without tension", 250, 10, 150, 3e-3), slack_disc(rings));
    measure(file, slide("strip, then held", 400, 20, 100, 2e-3), strip());
    measure(file, press_on_sphere(), sphere());
}

}  // namespace

int main(int argc, char** argv) {
    try {
        if (argc != 2) throw std::runtime_error("coarse FOLDER");
        std::filesystem::create_directories(argv[1]);
        run_all(argv[1]);
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "coarse: %s\n", error.what());
        return 2;
    }
}
