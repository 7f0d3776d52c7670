// SPDX-License-Identifier: MIT
// What the hand feels of the triangles that a tool slides over, through the whole loop.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>

#include <membrane/haptics/force_limits.hpp>
#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/membrane.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

constexpr double ball = 0.01, tip = 1e-3, speed = 0.05;  // radii [m], of the tool [m/s]
constexpr double stiffness = 100, damping = 0.5;         // of what is felt [N/m], [N s/m]

/// A great circle from one vertex over another, at one height: faces, edges and vertices all lie on the path.
struct Path {
    Vector3<double> from, across;
    double height;         // of the tool's centre over the ball's [m]
    double seconds = 0.2;  // of the slide
    double before = 0.06;  // and of coming down, to where it begins [s]

    Path(const TriangleMesh<double>& mesh, double pressed, std::uint64_t seed) : height(ball + tip - pressed) {
        Random random(seed);
        const auto any = [&] {
            return Vector3<double>(point(mesh.positions(), random.index(mesh.vertex_count())) / ball);
        };
        from = any();
        do {
            across = any();
        } while (!(dot(from, across) > 0.65 && dot(from, across) < 0.95));  // the second vertex is within the slide
        across = direction<double>(across - dot(from, across) * from, across);
    }
    [[nodiscard]] double turn() const { return speed / height; }  // [rad/s]
    [[nodiscard]] Vector3<double> outward(double time) const {
        return std::cos(turn() * (time - before)) * from + std::sin(turn() * (time - before)) * across;
    }
    [[nodiscard]] Vector3<double> along(double time) const {
        return std::cos(turn() * (time - before)) * across - std::sin(turn() * (time - before)) * from;
    }
    [[nodiscard]] Tool<double> tool(double time) const {
        const double above = tip * std::max(0.0, 1 - 2 * time / before);
        return {
            .position = (height + above) * outward(time), .radius = tip, .velocity = speed * along(time), .time = time};
    }
};

/// What one way to the force does in a slide.
struct Felt {
    double largest = 0;             // change from one tick to the next [N]
    double outward = 0, along = 0;  // mean [N]
    void take(const Vector3<double>& force, const Path& path, double time, bool first) {
        if (!first) largest = std::max(largest, norm<double>(force - last));
        last = force;
        outward += dot(force, path.outward(time));
        along += dot(force, path.along(time));
    }
    void end(int ticks) {
        outward /= ticks;
        along /= ticks;
    }
    /// By how much the force lags behind the outward direction of the ball, which turns evenly [s].
    [[nodiscard]] double delay(const Path& path) const { return std::atan2(along, outward) / -path.turn(); }

  private:
    Vector3<double> last = Vector3<double>::Zero();
};

struct Slide {
    Felt flat, smooth;                               // with the normals of the triangles, and without
    double depth_change = 0;                         // largest from one tick to the next [m]
    double mean_depth = 0;                           // [m]
    std::size_t faces = 0, edges = 0, vertices = 0;  // gone over
    bool as_asked = true;                            // in contact, and no limit has acted
};

/// The edges and vertices on the path.
class Crossings {
  public:
    void take(const Contact<double>& contact, const TriangleMesh<double>& mesh,
              const Vector3<double>& exit_displacement, double near, Slide& out) {
        out.edges += face_ != no_index && contact.triangle != face_ ? 1U : 0U;
        face_ = contact.triangle;
        faces_.insert(face_);
        for (const Index v : contact.corners) {
            if (norm<double>(point(mesh.positions(), v) / ball - exit_displacement) < near) vertices_.insert(v);
        }
        out.faces = faces_.size();
        out.vertices = vertices_.size();
    }

  private:
    Index face_ = no_index;
    std::set<Index> faces_, vertices_;
};

Slide slide(const TriangleMesh<double>& mesh, const Path& path, double tick) {
    const auto network = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    const SpringDamperForce feel{.stiffness = stiffness, .damping = damping};
    auto solver = QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = AabbTree(mesh);
    auto tracker = ContactTracker(mesh);
    const auto smooth = SmoothContact(mesh);
    auto limit = ForceLimiter(devices::touch, {.soft_start = 0.05});
    auto x = mesh.positions();
    Slide out;
    Crossings crossings;
    double last_depth = 0;
    int ticks = 0;
    const int end = static_cast<int>(std::lround((path.before + path.seconds) / tick));
    for (int i = 0; i < end; ++i) {
        const double now = tick * i;
        const auto tool = path.tool(now);
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, tick, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        const auto force = feel({tool, smooth(contact), report});
        const auto written = limit(force, now, static_cast<std::uint64_t>(i));
        if (now < path.before) continue;
        out.as_asked = out.as_asked && written == force && contact.touching();
        out.smooth.take(written, path, now, ticks == 0);
        out.flat.take(feel({tool, contact, report}), path, now, ticks == 0);
        if (ticks > 0) out.depth_change = std::max(out.depth_change, std::abs(contact.depth - last_depth));
        last_depth = contact.depth;
        out.mean_depth += contact.depth;
        crossings.take(contact, mesh, path.outward(now), path.turn() * tick, out);
        ++ticks;
    }
    out.mean_depth /= ticks;
    out.smooth.end(ticks);
    out.flat.end(ticks);
    return out;
}

}  // namespace

TEST_CASE("a slide over faces, edges and vertices: half the tick, half the change of the force", "[slide]") {
    const Index subdivisions = GENERATE(2, 3);
    const double pressed = GENERATE(0.5e-3, 1.5e-3);  // with the tool's centre outside the ball, and inside
    const auto mesh = icosphere<double>({.radius = ball, .subdivisions = subdivisions});
    for (int seed = 1; seed <= cases(1, 20); ++seed) {
        const Path path(mesh, pressed, static_cast<std::uint64_t>(seed));
        double change = 0, depth_change = 0, flat_change = 0;
        for (const double tick : {1e-3, 5e-4, 2.5e-4}) {
            CAPTURE(subdivisions, pressed, seed, tick);
            const Slide slid = slide(mesh, path, tick);
            REQUIRE(slid.as_asked);
            CHECK(slid.faces >= 4);
            CHECK(slid.edges >= 3);  // few where the path lies along edges
            CHECK(slid.vertices >= 2);

            if (change > 0) {
                CHECK(slid.smooth.largest > 0.4 * change);
                CHECK(slid.smooth.largest < 0.6 * change);
                CHECK(slid.depth_change > 0.4 * depth_change);
                CHECK(slid.depth_change < 0.6 * depth_change);
                CHECK(slid.flat.largest > 0.7 * flat_change);  // the triangles themselves
            }
            CHECK(slid.smooth.largest < slid.flat.largest / 3);
            change = slid.smooth.largest;
            depth_change = slid.depth_change;
            flat_change = slid.flat.largest;

            CHECK(std::abs(slid.smooth.delay(path)) < 1e-3);
            CHECK(std::abs(slid.smooth.outward / (stiffness * slid.mean_depth) - 1) < 0.01);
            INFO("largest change " << slid.flat.largest << " N, smooth " << change << " N, delay "
                                   << slid.flat.delay(path) << " s, smooth " << slid.smooth.delay(path)
                                   << " s, outward " << slid.flat.outward << " N, smooth " << slid.smooth.outward);
            CHECK(slid.smooth.outward > 0);
        }
    }
}
