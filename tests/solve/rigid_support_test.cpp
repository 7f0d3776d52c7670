// SPDX-License-Identifier: MIT
#include <membrane/solve/rigid_support.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

// A tool on what is pinned or held, through tracker, tree and solver, with the constants of the README: lengths in
// metres.

using namespace membrane;

namespace {

constexpr double spring = 40, foundation_stiffness = 8;  // [N/m]

/// A sheet of 20 mm and a tool above it. Who is fixed may be pinned in the network, held by `pin` or by `pull`.
template <class S>
class Scene {
  public:
    Scene(Index squares, std::vector<Index> pinned, const SolverOptions<S>& options = {})
        : mesh_(sheet<S>({.width = S(0.02), .height = S(0.02), .columns = squares, .rows = squares})),
          pulled_(border(mesh_).front()),
          network_(mesh_, LinearSpring{}, {.stiffness = S(spring), .pinned = with_border(std::move(pinned))}),
          foundation_(mesh_, {.stiffness = S(foundation_stiffness), .damping = S(0.02)}),
          solver_(network_, options),
          tree_(mesh_),
          tracker_(mesh_),
          x_(mesh_.positions()) {}

    const TriangleMesh<S>& mesh() const { return mesh_; }
    const Points<S>& x() const { return x_; }
    const MassSpringNetwork<S, LinearSpring>& network() const { return network_; }
    const Contact<S>& contact() const { return contact_; }

    void hold(const std::vector<Index>& held) { held_ = held; }
    void pull_at(Index v) { pulled_ = v; }
    void hold_first() { hold_first_ = true; }

    /// The force of the membrane on the tool [N].
    Vector3<double> tick(const Tool<double>& tool) {
        Tool<S> cast;
        cast.position = tool.position.cast<S>();
        cast.axis = tool.axis.cast<S>();
        cast.radius = static_cast<S>(tool.radius);
        contact_ = tracker_.update(tree_, x_, cast);
        const Vector3<S> target = point(mesh_.positions(), pulled_);
        const auto pressing = press(cast, contact_);
        StepReport<S> report;
        if constexpr (sizeof(S) == 8) {
            if (hold_first_) {
                report = solver_.step(x_, S(1e-3), network_, foundation_, pull(pulled_, target), pin(held_), pressing);
                tree_.refit(x_, report.moved);
                REQUIRE(report.status == StepStatus::advanced);
                return report.reactions[2];
            }
        }
        report = solver_.step(x_, S(1e-3), network_, foundation_, pressing, pin(held_), pull(pulled_, target));
        tree_.refit(x_, report.moved);
        REQUIRE(report.status == StepStatus::advanced);
        return report.reactions[0].template cast<double>();
    }

  private:
    std::vector<Index> with_border(std::vector<Index> pinned) const {
        const auto rim = border(mesh_);
        pinned.insert(pinned.end(), rim.begin(), rim.end());
        return pinned;
    }

    TriangleMesh<S> mesh_;
    Index pulled_;
    MassSpringNetwork<S, LinearSpring> network_;
    VirtualVolumeSprings<S> foundation_;
    QuasiStaticSolver<S> solver_;
    AabbTree<S> tree_;
    ContactTracker<S> tracker_;
    Points<S> x_;
    Contact<S> contact_;
    std::vector<Index> held_;
    bool hold_first_ = false;
};

std::vector<Index> all_vertices(Index squares) {
    std::vector<Index> all;
    for (Index v = 0; v < (squares + 1) * (squares + 1); ++v) all.push_back(v);
    return all;
}

/// The vertex in the middle of a sheet with an even number of squares.
Index middle(Index squares) { return ((squares + 1) * (squares + 1) - 1) / 2; }

struct Slide {
    Index squares;
    double radius, depth;                      // [m]
    Vector3<double> axis, from, displacement;  // of the tool's foot [m]
};

struct Felt {
    double largest = 0, jump = 0, at_rest = 0, merit = 0;  // [N]
    double speed = 0;                                      // of the tool [m]
};

/// Straight in, along, and then still.
template <class S>
Felt feel(Scene<S>& scene, const Slide& slide) {
    constexpr int in = 100, along = 300, still = 200, candidates = 100;
    const double edge = 0.02 * (2 + std::sqrt(2.0)) / (3 * slide.squares), point_radius = 0.01 * edge;
    const double height = std::max(slide.radius, point_radius);
    Felt felt;
    double low = std::numeric_limits<double>::max();
    Vector3<double> last = Vector3<double>::Zero(), last_position = last;
    for (int i = 0; i < in + along + still; ++i) {
        const double down = slide.depth * std::min(1.0, i / double(in));
        const double part = std::clamp((i - in) / double(along), 0.0, 1.0);
        Tool<double> tool{
            .position = slide.from + part * slide.displacement, .axis = slide.axis, .radius = slide.radius};
        tool.position.z() += height - down;
        const Vector3<double> force = scene.tick(tool);
        if (i > 0) {
            felt.jump = std::max(felt.jump, (force - last).norm());
            felt.speed = std::max(felt.speed, (tool.position - last_position).norm());
        }
        felt.largest = std::max(felt.largest, force.norm());
        if (i >= in + along + still - candidates) {
            low = std::min(low, force.norm());
            felt.at_rest = std::max(felt.at_rest, force.norm());
        }
        last = force, last_position = tool.position;
    }
    felt.merit = felt.at_rest - low;
    return felt;
}

/// The default stiffness of a fixed vertex inside a sheet, whose vertices have six springs.
constexpr double default_stiffness = detail::support_factor * (6 * spring + foundation_stiffness);

/// No more than what a tick of motion does to a stiff contact, which bears on several vertices.
void check(const Felt& felt) {
    CHECK(felt.jump < 6 * default_stiffness * felt.speed);
    CHECK(felt.merit <= 1e-3 * felt.at_rest);
    CHECK(felt.at_rest > 0);
}

}  // namespace

TEST_CASE("a tool on fixed corners is pushed out by their stiffness times how deep it is") {
    constexpr Index squares = 8;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double stiffness = 100 * std::pow(100, random.number()), radius = 1e-4 * std::pow(10, random.number());
        const double depth = std::min(radius / 2, 1e-5) * random.number(0.1, 1.0);
        Scene<double> scene(squares, all_vertices(squares), {.rigid_stiffness = stiffness});
        // In a corner, in the middle of an edge, or in a face and so far from its edges that no other is touched.
        const auto corners = scene.mesh().triangles().col(2 * squares + 5);
        Vector3<double> weights = random.barycentric();
        if (seed % 3 == 0) weights = Vector3<double>::UnitX();
        if (seed % 3 == 1) weights = Vector3<double>(0.5, 0.5, 0);
        if (seed % 3 == 2) weights = 0.7 * weights + Vector3<double>::Constant(0.1);
        const Vector3<double> foot = point_at(triangle_at(scene.mesh().positions(), corners), weights);
        const double side = seed % 2 == 0 ? 1 : -1;
        Vector3<double> force = Vector3<double>::Zero();
        for (int i = 0; i < 30; ++i) {
            const double down = depth * std::min(1.0, i / 10.0);
            Tool<double> tool{.position = foot, .radius = radius};
            tool.position.z() += side * (radius + 1e-9 - down);
            force = scene.tick(tool);
        }
        const double expected = stiffness * (depth - 1e-9) / weights.squaredNorm();
        CHECK(std::abs(side * force.z() - expected) < 1e-6 * expected);
        CHECK(std::abs(force.x()) + std::abs(force.y()) < 1e-6 * expected);
        CHECK(scene.x() == scene.mesh().positions());
    }
}

TEST_CASE("by default that is four times the stiffness of the stiffest vertex beside it") {
    Scene<double> scene(8, {middle(8)});
    const Tool<double> tool{.position = {0, 0, 1e-3 - 1e-6}, .radius = 1e-3};
    Vector3<double> force = Vector3<double>::Zero();
    for (int i = 0; i < 20; ++i) force = scene.tick(tool);
    CHECK(std::abs(force.z() - default_stiffness * 1e-6) < 1e-9);
}

TEST_CASE("a point tool is held by what is fixed, however small the sphere that stands for it") {
    constexpr Index squares = 8;
    Scene<double> scene(squares, all_vertices(squares), {.rigid_stiffness = 1000});
    const auto corners = scene.mesh().triangles().col(2 * squares + 5);
    const auto triangle = triangle_at(scene.mesh().positions(), corners);
    const Vector3<double> weights(0.3, 0.3, 0.4), foot = point_at(triangle, weights);
    for (int i = 0; i < 500; ++i) {
        const double down = 1e-3 * std::min(i, 400) / 400;
        const Tool<double> tool{.position = foot - down * Vector3<double>::UnitZ()};
        const double force = scene.tick(tool).z();
        if (i == 0 || i == 400) continue;
        const double expected = 1000 * (down + scene.contact().radius) / weights.squaredNorm();
        REQUIRE(std::abs(force - expected) < 1e-6 * expected);
    }
}

TEMPLATE_TEST_CASE("the force is continuous where a tool slides over a pinned rim, and still when it is", "",
                   TEST_SCALARS) {
    for (const Index squares : {10, 20}) {
        for (const double radius : {0.0, 0.0005, 0.002}) {
            for (const double depth : {0.00005, 0.0003}) {
                if (radius == 0 && depth > 0.0001) continue;  // beside a pin a deep dent is narrower than its triangles
                for (const Vector3<double>& axis : {Vector3<double>(0, 0, 0), Vector3<double>(0, 0.004, 0.003)}) {
                    if (radius == 0 && !axis.isZero(0)) continue;
                    CAPTURE(squares, radius, depth, axis.transpose());
                    Scene<TestType> scene(squares, {});
                    check(feel(scene, {squares, radius, depth, axis, {0.0045, 0.0003, 0}, {0.0053, 0, 0}}));
                }
            }
        }
    }
}

TEST_CASE("nor does it jump over a pin, or a vertex that is held, in whatever order the constraints are given") {
    for (const Index squares : {10, 20}) {
        for (const double radius : {0.0, 0.0005, 0.002}) {
            for (const double depth : {0.00005, 0.0003}) {
                if (radius == 0 ? depth > 0.0001 : squares == 20) continue;
                const Slide slide{squares, radius, depth, {0, 0, 0}, {-0.0006, 0.0003, 0}, {0.0008, -0.0003, 0}};
                const Index v = middle(squares);
                CAPTURE(squares, radius, depth);
                Scene<double> pinned(squares, {v}), held(squares, {}), pulled(squares, {}), held_first(squares, {});
                held.hold({v});
                pulled.pull_at(v);
                held_first.hold({v});
                held_first.hold_first();
                const Felt first = feel(pinned, slide);
                check(first);
                for (Scene<double>* scene : {&held, &pulled, &held_first}) {
                    const Felt felt = feel(*scene, slide);
                    check(felt);
                    CHECK(std::abs(felt.at_rest - first.at_rest) < 1e-3 * first.at_rest);
                }
            }
        }
    }
}

TEST_CASE("beside a rim a tool that stands still feels a force that does, however the solver predicts") {
    // At some places beside a rim there are two states of rest, and the path decides between them.
    int places = 0, with_two_states = 0;
    for (double y = 0.0085; y < 0.0104; y += 5e-5) {
        double forces[2];
        for (const bool predict : {false, true}) {
            CAPTURE(y, predict);
            Scene<double> scene(20, {}, {.sweeps = 4, .predict = predict});
            double low = std::numeric_limits<double>::max(), high = 0;
            for (int i = 0; i <= 500; ++i) {
                const double down = 0.6e-3 * std::min(i, 300) / 300;
                const double force = scene.tick({.position = {0, y, 2.1e-3 - down}, .radius = 2e-3}).norm();
                if (i > 400) low = std::min(low, force), high = std::max(high, force);
            }
            CHECK(high - low <= 1e-3 * high);
            CHECK(high > 0.02);
            forces[predict ? 1 : 0] = high;
        }
        ++places;
        if (!(std::abs(forces[0] - forces[1]) < 1e-3 * forces[0])) ++with_two_states;
        CHECK(std::abs(forces[0] - forces[1]) < 1e-2 * forces[0]);
    }
    CHECK(with_two_states <= 2);
    CHECK(places >= 35);
}

TEST_CASE("far from what is fixed its stiffness changes nothing, to the bit") {
    Scene<double> soft(20, {}, {.rigid_stiffness = 1}), stiff(20, {}, {.rigid_stiffness = 1e9});
    for (int i = 0; i < 300; ++i) {
        const Tool<double> tool{.position = {1e-5 * i, 0, 2e-3 - 1e-6 * i}, .radius = 2e-3};
        REQUIRE(soft.tick(tool) == stiff.tick(tool));
    }
    CHECK(soft.x() == stiff.x());
}
