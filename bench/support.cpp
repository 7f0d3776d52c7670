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
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

// support FOLDER: membranes that their rim supports, a foundation, or both: how far the force of a step is off the
// equilibrium, how far by the estimate, and how long a tick takes: with the default layers, with all, and with the
// default ones and a coarse correction, which may wake vertices. Prints a Markdown table and writes it to support.csv
// in FOLDER.

namespace {

using membrane::Index;
using Mesh = membrane::TriangleMesh<double>;
using Points = membrane::Points<double>;
using Vector = membrane::Vector3<double>;
using Tool = membrane::Tool<double>;
using Forceps = membrane::PointAttachment<double>;
struct BallAndForceps {
    Tool ball;
    Forceps forceps;
};
using Hand = std::variant<Tool, Forceps, BallAndForceps>;

constexpr double dt = 1e-3;  // [s]

struct Setting {
    const char* name;
    membrane::SolverOptions<double> solver;
    bool corrected, wakes;
    double tolerance = membrane::CoarseOptions().tolerance;
};
const Setting settings[]{{"6 layers", {.layers = 6, .sweeps = 2}, false, false},
                         {"all layers", {.layers = membrane::unlimited, .sweeps = 2}, false, false},
                         {"6 layers corrected", {.layers = 6, .sweeps = 2}, true, false},
                         {"corrected in each tick", {.layers = 6, .sweeps = 2}, true, false, 0},
                         {"corrected and unbalanced woken", {.layers = 6, .sweeps = 2}, true, true}};

/// Ticks of a scene.
struct Timing {
    int ticks;
    int interval;             ///< of the ticks that are compared with equilibria
    int slide = 150;          ///< the duration of the slide that begins at tick 100
    int release = 1'000'000;  ///< the tick at which the tool begins to leave
    int rounds = 3;
};

/// What a hand does.
struct Path {
    std::vector<std::string> names;  ///< of the scene, one for each reaction
    Timing timing;
    std::function<Hand(int)> hand_at;

    [[nodiscard]] bool is_compared(int tick) const { return (tick + 1) % timing.interval == 0; }
};

/// The part of a motion that is done at a tick, 0 to 1.
double part_done(int tick, int begin, int duration) {
    return std::clamp(static_cast<double>(tick - begin) / duration, 0.0, 1.0);
}

/// A point of the surface at rest, and the direction out of it.
struct Place {
    Vector point, outward;
};

/// Places in the disc, along x by `distance` [m].
auto on_disc(double distance, double y = 0) {
    return [=](double part) { return Place{{-1.5e-3 + distance * part, y, 0}, Vector::UnitZ()}; };
}

/// Places on a sphere around the origin, from a direction on by `angle` around the y axis. Take none on an axis of
/// symmetry of the mesh: there the equilibrium found is symmetric, and steps leave it for another.
auto on_sphere(double radius, const Vector& from, double angle) {
    return [=](double part) {
        const double cosine = std::cos(angle * part), sine = std::sin(angle * part);
        const Vector outward(cosine * from[0] + sine * from[2], from[1], cosine * from[2] - sine * from[0]);
        return Place{radius * outward.normalized(), outward.normalized()};
    };
}

/// A ball is pressed in by half its radius in 100 ticks, slides, and may leave in 100.
Path press(const std::string& name, const Timing& timing, double radius, const std::function<Place(double)>& place_at) {
    return {{name}, timing, [=](int t) {
                const Place place = place_at(part_done(t, 100, timing.slide));
                const double depth = radius * (0.5 * part_done(t, 0, 100) - part_done(t, timing.release, 100));
                return Tool{.position = place.point + (radius - depth) * place.outward, .radius = radius};
            }};
}
Path slide(const std::string& name, const Timing& timing, double distance) {
    return press(name, timing, 1e-3, on_disc(distance));
}

/// Forceps at the triangle nearest to a point draw it by `first` in `duration` ticks, and by `second` from tick 150 on,
/// in 100 [m].
Path draw(const std::string& name, const Timing& timing, const Mesh& mesh, const Vector& place, int duration,
          const Vector& first, const Vector& second) {
    const auto centroid = [&](Index f) {
        return membrane::point_at(membrane::triangle_at(mesh.positions(), mesh.triangles().col(f)),
                                  Vector::Constant(1.0 / 3));
    };
    Index nearest = 0;
    for (Index f = 1; f < mesh.triangle_count(); ++f) {
        if ((centroid(f) - place).norm() < (centroid(nearest) - place).norm()) nearest = f;
    }
    const auto corners = mesh.triangles().col(nearest);
    const Forceps at_rest{.triangle = nearest,
                          .corners = {corners[0], corners[1], corners[2]},
                          .barycentric = Vector::Constant(1.0 / 3),
                          .target = centroid(nearest)};
    return {{name}, timing, [=](int t) {
                Forceps forceps = at_rest;
                forceps.target += part_done(t, 0, duration) * first + part_done(t, 150, 100) * second;
                return forceps;
            }};
}
Path draw_disc(const std::string& name, const Mesh& mesh, const Vector& place) {
    return draw(name, {.ticks = 250, .interval = 10}, mesh, place, 100, {0, 0, 0.3e-3}, {0.3e-3, 0, 0});
}

/// Both at once.
Path together(const Path& ball, const Path& forceps) {
    return {{ball.names[0], forceps.names[0]}, ball.timing, [=](int t) {
                return BallAndForceps{std::get<Tool>(ball.hand_at(t)), std::get<Forceps>(forceps.hand_at(t))};
            }};
}

template <class Network_, class Foundation>
struct Membrane {
    using Network = Network_;
    Mesh mesh;
    Network network;
    Foundation foundation;
    Points start = mesh.positions();
    std::vector<Index> path = {};  ///< along which it is cut before the first tick
};

/// Cuts a membrane that is one to cut; these parts follow. Returns its mesh.
template <class M, class... Parts>
Mesh cut(const M& membrane, Points& x, Parts&... parts) {
    if constexpr (membrane::FollowsSplit<typename M::Network>) {
        membrane::Tearing<double> tear(membrane.mesh, membrane::EnergyRelease{.toughness = 1e6, .thickness = 1e-5});
        const auto events = tear.cut_along(membrane.path, x);
        if (events.empty()) throw std::runtime_error("no cut");
        for (const auto& event : events) follow(event, parts...);
        return {tear.surface().rest_positions(), tear.surface().triangles()};
    } else {
        return membrane.mesh;
    }
}

/// Calls `act` with the constraints of a hand: forceps, a tool where it touches the membrane, or both.
template <class Act>
auto with_constraints(const Hand& hand, membrane::ContactTracker<double>& tracker,
                      const membrane::AabbTree<double>& tree, const Points& x, const Act& act) {
    const auto pressed = [&](const Tool& tool) { return membrane::press(tool, tracker.update(tree, x, tool)); };
    if (const auto* forceps = std::get_if<Forceps>(&hand)) return act(*forceps);
    if (const auto* both = std::get_if<BallAndForceps>(&hand)) return act(pressed(both->ball), both->forceps);
    return act(pressed(std::get<Tool>(hand)));
}

using Forces = std::vector<Vector>;  // one for each constraint [N]

/// The forces at equilibrium at the compared ticks, each found from the one before.
template <class M>
std::vector<Forces> reference(const Path& path, const M& membrane) {
    typename M::Network network = membrane.network;
    Points x = membrane.start;
    const Mesh mesh = cut(membrane, x, network);
    membrane::ContactTracker<double> tracker(mesh);
    membrane::AabbTree<double> tree(mesh);
    std::vector<Forces> forces;
    for (int t = 0; t < path.timing.ticks; ++t) {
        if (!path.is_compared(t)) continue;
        tree.refit(x);
        const auto found = with_constraints(path.hand_at(t), tracker, tree, x, [&](const auto&... constraints) {
            return membrane::equilibrium(x, mesh, network, membrane.foundation, constraints...);
        });
        if (!found.converged) throw std::runtime_error(path.names[0] + ": no equilibrium at tick " + std::to_string(t));
        x = found.x;
        forces.push_back(found.reactions);
    }
    return forces;
}

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

std::string two_digits(double number) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.2f", number);
    return text.data();
}

/// Of the force on one tool.
class Errors {
  public:
    void add(const Vector& force, const Vector& expected, const Vector& estimate) {
        const double apart = (force - expected).norm(), size = expected.norm();
        squares_ += apart * apart, all_ += size * size;
        worst_ = std::max(worst_, apart), largest_ = std::max(largest_, size);
        if (membrane::is_finite(estimate)) estimated_ += estimate.squaredNorm(), all_estimated_ += size * size;
    }
    ///@{
    /// The rms of the differences over that of the forces, the largest ones, and the rms of the estimates [%].
    [[nodiscard]] double rms() const { return 100 * std::sqrt(squares_ / all_); }
    [[nodiscard]] double worst() const { return 100 * worst_ / largest_; }
    [[nodiscard]] std::string estimate() const {
        if (all_estimated_ == 0) return "-";  // no compared tick was corrected
        return two_digits(100 * std::sqrt(estimated_ / all_estimated_));
    }
    ///@}

  private:
    double squares_ = 0, all_ = 0, worst_ = 0, largest_ = 0, estimated_ = 0, all_estimated_ = 0;
};

struct Result {
    std::vector<Errors> errors;  // of each reaction
    double seconds = 0;          // of a tick, mean
};

template <class M>
Result run(const Path& path, const M& membrane, const Setting& setting, const std::vector<Forces>& right) {
    typename M::Network network = membrane.network;
    membrane::QuasiStaticSolver<double> solver(network, setting.solver);
    membrane::ContactTracker<double> tracker(membrane.mesh);
    membrane::AabbTree<double> tree(membrane.mesh);
    tree.refit(membrane.start);
    membrane::CoarseCorrection coarse(membrane.mesh, network, membrane.foundation, {.tolerance = setting.tolerance});
    Points x = membrane.start;
    (void)cut(membrane, x, network, solver, coarse);
    Result result{std::vector<Errors>(path.names.size())};
    auto expected = right.begin();
    for (int t = 0; t < path.timing.ticks; ++t) {
        const Hand hand = path.hand_at(t);
        const auto start = std::chrono::steady_clock::now();
        const auto report = with_constraints(hand, tracker, tree, x, [&](const auto&... constraints) {
            return solver.step(x, dt, network, membrane.foundation, constraints...);
        });
        Vector estimate = Vector::Constant(std::nan(""));
        if (setting.corrected) {
            const auto corrected = coarse.correct(x, solver);
            estimate = corrected.reaction_error;
            if (setting.wakes) solver.wake(corrected.unbalanced);
            corrected.moved ? tree.refit(x) : tree.refit(x, report.moved);
        } else {
            tree.refit(x, report.moved);
        }
        const std::chrono::duration<double> duration = std::chrono::steady_clock::now() - start;
        result.seconds += duration.count() / path.timing.ticks;
        if (report.status != membrane::StepStatus::advanced) throw std::runtime_error("a step was refused");
        if (!path.is_compared(t)) continue;
        if (!setting.corrected) estimate = coarse.reaction_error(x, solver);
        for (std::size_t i = 0; i < result.errors.size(); ++i)
            result.errors[i].add(report.reactions[i], (*expected)[i], estimate);
        ++expected;
    }
    return result;
}

// Settings take turns, so that a temporary load of the machine affects all.
template <class M>
void measure(std::ofstream& file, const Path& path, const M& membrane) {
    constexpr std::size_t count = std::size(settings);
    const std::vector<Forces> right = reference(path, membrane);
    std::vector<std::vector<double>> seconds(count), ratios(count);
    std::vector<Result> last(count);
    for (int round = 0; round < path.timing.rounds; ++round) {
        for (std::size_t i = 0; i < count; ++i) {
            last[i] = run(path, membrane, settings[i], right);
            seconds[i].push_back(last[i].seconds);
            ratios[i].push_back(last[i].seconds / seconds[0].back());
        }
    }
    const Index vertices = membrane.mesh.vertex_count();
    for (std::size_t r = 0; r < path.names.size(); ++r) {
        for (std::size_t i = 0; i < count; ++i) {
            const Errors& errors = last[i].errors[r];
            const char *scene = path.names[r].c_str(), *setting = settings[i].name;
            const double time = 1e6 * median(seconds[i]), ratio = median(ratios[i]);
            std::printf("| %s | %d | %s | %.2f %% | %.2f %% | %s %% | %.0f us | %.2f |\n", scene, vertices, setting,
                        errors.rms(), errors.worst(), errors.estimate().c_str(), time, ratio);
            file << scene << ',' << vertices << ',' << setting << ',' << errors.rms() << ',' << errors.worst() << ','
                 << errors.estimate() << ',' << time << ',' << ratio << std::endl;
        }
    }
    std::fflush(stdout);
}

const membrane::Material capsule = membrane::materials::lens_capsule().typical;

/// No springs, with pinned vertices: all forces are those of further elements.
auto no_springs(const Mesh& mesh, const std::vector<Index>& pinned) {
    return membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 0.0, .pinned = pinned});
}

/// A membrane without foundation.
template <class Network>
auto alone(const Mesh& mesh, const Network& network) {
    return Membrane<Network, membrane::NoFoundation>{mesh, network, {}};
}

/// Lens capsule, stretched, with pinned vertices and with further elements.
template <class... Elements>
auto stretched(const Mesh& mesh, const std::vector<Index>& pinned, double stretch, const Elements&... elements) {
    return alone(mesh, membrane::Tissue(no_springs(mesh, pinned), membrane::triangular_springs(mesh, capsule, stretch),
                                        elements...));
}

/// Lets it start in equilibrium, without hands.
template <class M>
M at_rest(M membrane) {
    const auto none = membrane::load({0, 1, 2}, Vector::Constant(1.0 / 3), Vector::Zero());
    const auto found =
        membrane::equilibrium(membrane.start, membrane.mesh, membrane.network, membrane.foundation, none);
    if (!found.converged) throw std::runtime_error("no equilibrium without hands");
    membrane.start = found.x;
    return membrane;
}

/// A disc of 5 mm, pinned at its rim.
Mesh disc_of(Index rings) { return membrane::disc<double>({.radius = 5e-3, .rings = rings}); }
auto stretched_disc(Index rings, double stretch = 1.02) {
    const Mesh mesh = disc_of(rings);
    return stretched(mesh, membrane::border(mesh), stretch);
}

/// Hinges, 30 times as stiff in bending as the capsule.
auto hinges(const Mesh& mesh) { return membrane::bending_springs(mesh, 30 * membrane::flexural_rigidity(capsule)); }
auto disc_with_hinges(Index rings) {
    const Mesh mesh = disc_of(rings);
    return stretched(mesh, membrane::border(mesh), 1.02, hinges(mesh));
}

/// A disc with hinges in which half a ring is cut: a flap.
auto disc_with_flap(Index rings, Index ring) {
    const Mesh mesh = membrane::with_reserve(disc_of(rings), 3 * ring);
    const membrane::TearableSprings springs(mesh, no_springs(mesh, membrane::border(mesh)));
    auto result =
        alone(mesh, membrane::Tissue(springs, membrane::triangular_springs(mesh, capsule, 1.01), hinges(mesh)));
    for (Index i = 0; i <= 3 * ring; ++i) result.path.push_back(1 + 3 * ring * (ring - 1) + i);
    return result;
}

/// A disc of springs without tension, pinned at its rim.
auto slack_disc(Index rings) {
    const Mesh mesh = disc_of(rings);
    return alone(mesh, membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                   {.stiffness = 20.0, .pinned = membrane::border(mesh)}));
}

/// Vertices at which a condition holds.
template <class Condition>
std::vector<Index> vertices_where(const Mesh& mesh, const Condition& holds) {
    std::vector<Index> found;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        if (holds(Vector(mesh.positions().col(v)))) found.push_back(v);
    }
    return found;
}

/// A strip of 20 by 5 mm, pinned at its short sides: between them it folds.
auto strip() {
    const Mesh mesh = membrane::sheet<double>({.width = 20e-3, .height = 5e-3, .columns = 80, .rows = 20});
    const auto ends = vertices_where(mesh, [](const Vector& x) { return std::abs(x[0]) > 9.99e-3; });
    return at_rest(stretched(mesh, ends, 1.02));
}

/// A cornea that its rim holds, under the pressure of the eye, 15 mmHg.
auto cornea(Index rings) {
    const Mesh mesh = membrane::spherical_cap<double>({.radius = 7.8e-3, .diameter = 11.7e-3, .rings = rings});
    const membrane::Material material = membrane::materials::cornea().typical;
    const membrane::Tissue tissue(
        no_springs(mesh, membrane::border(mesh)), membrane::triangular_springs(mesh, material, 1.03),
        membrane::bending_springs(mesh, membrane::flexural_rigidity(material)), membrane::pressure(mesh, 2000.0));
    return at_rest(alone(mesh, tissue));
}

/// A sphere of springs of 40 N/m and hinges, pinned around its south pole, on volume springs of a part of the springs'
/// stiffness. Without hinges (`rigidity` 0) it snaps.
auto sphere(double foundation, double rigidity) {
    const auto mesh = membrane::icosphere<double>({.radius = 10e-3, .subdivisions = 3});
    const auto south = vertices_where(mesh, [](const Vector& x) { return x[2] < -9e-3; });
    const membrane::MassSpringNetwork springs(mesh, membrane::LinearSpring{}, {.stiffness = 40.0, .pinned = south});
    const membrane::Tissue tissue(springs, membrane::bending_springs(mesh, rigidity));
    return Membrane<std::remove_const_t<decltype(tissue)>, membrane::VirtualVolumeSprings<double>>{
        mesh, tissue, {mesh, {.stiffness = 40 * foundation}}};
}

void measure_discs(std::ofstream& file) {
    for (const Index rings : {14, 28}) {
        const auto disc = stretched_disc(rings);
        measure(file, slide("slide at 20 mm/s", {250, 10}, 3e-3), disc);
        measure(file, slide("slide at 100 mm/s then held", {160, 10, 30}, 3e-3), disc);
        measure(file, draw_disc("forceps", disc.mesh, {-1.5e-3, 0, 0}), disc);
        if (rings == 14) continue;
        measure(file, slide("held then released", {.ticks = 300, .interval = 10, .release = 150}, 0), disc);
        const auto ball = press("ball beside forceps", {250, 10}, 1e-3, on_disc(3e-3, -1.5e-3));
        measure(file, together(ball, draw_disc("forceps beside the ball", disc.mesh, {0, 1.5e-3, 0})), disc);
    }
    measure(file, slide("slide at 20 mm/s", {250, 25}, 3e-3), stretched_disc(56));
    measure(file, slide("slide at 20 mm/s", {.ticks = 140, .interval = 70, .rounds = 1}, 3e-3), stretched_disc(115));
}

void measure_others(std::ofstream& file) {
    constexpr Index rings = 24;
    measure(file, slide("tension of 0.5 %", {250, 10}, 3e-3), stretched_disc(rings, 1.005));
    measure(file, slide("tension of 5 %", {250, 10}, 3e-3), stretched_disc(rings, 1.05));
    measure(file, slide("with bending springs", {250, 10}, 3e-3), disc_with_hinges(rings));
    measure(file, slide("without tension", {250, 10}, 3e-3), slack_disc(rings));
    measure(file, slide("strip then held", {400, 20, 100}, 2e-3), strip());
    const auto eye = cornea(rings);
    const auto around = on_sphere(eye.start.col(0).norm(), {-0.2, 0.05, 1}, 0.4);
    measure(file, press("cornea under pressure", {.ticks = 250, .interval = 50, .rounds = 1}, 1e-3, around), eye);
    const auto torn = disc_with_flap(rings, 10);
    const Vector outward = 1e-3 * Vector(0, 0.6, 0.8);
    measure(file,
            draw("flap of a torn capsule", {.ticks = 250, .interval = 25, .rounds = 1}, torn.mesh, {0, 1.7e-3, 0}, 200,
                 outward, Vector::Zero()),
            torn);
    const Timing timing{250, 10};
    const auto along = on_sphere(10e-3, {0.3, 0.2, 1}, 0.3);
    for (const std::string part : {"0", "0.001", "0.01", "0.1", "1"})
        measure(file, press("sphere on a foundation of " + part, timing, 2e-3, along), sphere(std::stod(part), 1e-6));
    measure(file, press("without hinges on one of 0.01", timing, 2e-3, along), sphere(0.01, 0));
}

void run_all(const std::filesystem::path& folder) {
    std::ofstream file(folder / "support.csv");
    if (!file) throw std::runtime_error("cannot write to " + folder.string());
    file << "scene,vertices,setting,error_percent,worst_percent,estimate_percent,tick_us,ratio\n";
    std::printf("| scene | vertices | setting | error | worst | estimate | tick | over that of %s |\n",
                settings[0].name);
    std::printf("|---|---|---|---|---|---|---|---|\n");
    measure_discs(file);
    measure_others(file);
}

}  // namespace

int main(int argc, char** argv) {
    try {
        if (argc != 2) throw std::runtime_error("support FOLDER");
        std::filesystem::create_directories(argv[1]);
        run_all(argv[1]);
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "support: %s\n", error.what());
        return 2;
    }
}
