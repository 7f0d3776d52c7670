// SPDX-License-Identifier: MIT
#include <membrane/tear/tearing.hpp>

#include <numbers>
#include <span>
#include <vector>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/core/snapshot.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"
#include "support/torn_strip.hpp"

using namespace membrane;
using test::TornStrip;

namespace {

constexpr double degree = std::numbers::pi / 180;

// Tears a strip whose grid is turned; returns the stretch at which it begins.
template <class Scalar>
double tear(TornStrip<Scalar>& strip, double edges, double& off_line) {
    strip.cut();
    strip.stretch(0.98 * strip.critical_stretch());
    double begins = 0;
    for (int tick = 0; tick < 3000 && strip.torn_edges() < edges && !strip.tear.tips().empty(); ++tick) {
        strip.tick(strip.at_rest() ? 2e-4 * strip.critical_stretch() : 0.0);
        REQUIRE(strip.report.status == StepStatus::advanced);
        if (begins == 0 && strip.tear.torn_length() > 0) begins = strip.stretched;
        if (!strip.tear.tips().empty()) off_line = std::max(off_line, strip.off_line());
    }
    return begins;
}

}  // namespace

// Closed form: a strip in pure shear releases its energy density times its height.
TEST_CASE("a tear in pure shear begins at the right stretch, on any grid, and runs straight", "[tear]") {
    for (const double turn : {0.0, 10.0, 20.0, 30.0, 45.0}) {
        CAPTURE(turn);
        TornStrip<double> strip({.turn = turn * degree});
        double off_line = 0;
        const double begins = tear(strip, 12, off_line);
        CAPTURE(begins, strip.critical_stretch(), off_line, strip.balance());
        REQUIRE(strip.torn_edges() >= 12);
        CHECK(begins == Approx(strip.critical_stretch()).epsilon(0.03));
        CHECK(off_line <= 0.7);
        CHECK(strip.balance() == Approx(1).epsilon(0.025));  // with what the relaxation of quick ticks takes
    }
}

TEST_CASE("a tear in pure shear begins at the right stretch in single precision", "[tear]") {
    TornStrip<float> strip({.turn = 10 * degree});
    double off_line = 0;
    const double begins = tear(strip, 6, off_line);
    CHECK(begins == Approx(strip.critical_stretch()).epsilon(0.03));
    CHECK(off_line <= 0.7);
}

TEST_CASE("the driving force is the energy that is released, whatever the length of the tear", "[tear]") {
    for (const int notch : {12, 16, 20}) {
        TornStrip<double> strip({.notch = notch});
        strip.cut();
        const double stretch = 1.2;
        strip.stretch(stretch);
        strip.tick(0);
        const auto& force = strip.tear.tips()[0].driving_force;
        CAPTURE(notch, force[0], force[1]);
        CHECK(force[0] == Approx(strip.energy_density(stretch) * strip.height()).epsilon(0.05));
        CHECK(std::abs(force[1]) < 0.02 * force[0]);
    }
}

// Without moved vertices a tear keeps to the edges of a turned grid.
TEST_CASE("without moved vertices the grid steers the tear", "[tear]") {
    TornStrip<double> strip({.turn = 20 * degree, .tear = {.move_vertices = false}});
    double off_line = 0;
    static_cast<void>(tear(strip, 12, off_line));
    CHECK(off_line > 0.7);
}

TEST_CASE("both ends of a cut within a stretched sheet go on alike, along it", "[tear]") {
    TornStrip<double> strip({.columns = 30, .rows = 30, .turn = 0});
    const auto& rest = strip.tear.surface().rest_positions();
    Index at = 0;
    for (Index v = 0; v < strip.surface.vertex_count(); ++v) {
        const auto off = [&](Index w) { return (rest.col(w) - Eigen::Vector3d(11e-3, 15e-3, 0)).norm(); };
        if (off(v) < off(at)) at = v;
    }
    std::vector<Index> path{at};
    while (path.size() < 9) path.push_back(strip.tear.surface().nearest_in_direction(path.back(), {1, 0, 0}));
    for (const auto& event : strip.tear.cut_along(path, strip.x)) follow(event, strip.sheet, strip.solver);
    REQUIRE(strip.tear.tips().size() == 2);
    strip.stretch(1.3);
    strip.tick(0);
    const auto tips = strip.tear.tips();
    for (const auto& tip : tips) {
        CHECK(std::abs(std::atan2(tip.driving_force[1], std::abs(tip.driving_force[0]))) < 3 * degree);
    }
    CHECK(tips[0].driving_force[0] < 0);
    CHECK(tips[1].driving_force[0] > 0);
    CHECK(norm(tips[0].driving_force) == Approx(norm(tips[1].driving_force)).epsilon(0.05));
}

TEST_CASE("a path that cannot be cut changes nothing", "[tear]") {
    const auto mesh = with_reserve(sheet<double>({.columns = 6, .rows = 6}), 3);
    Tearing tear(mesh, EnergyRelease{1, 1});
    Points<double> x = mesh.positions();
    const Triangles before = tear.surface().triangles();
    // Vertex 24 is in the middle of 7 x 7.
    for (const auto& path : std::vector<std::vector<Index>>{
             {}, {24}, {24, 25}, {24, 24, 25}, {24, 40, 41}, {-1, 24, 25}, {24, 25, 999}, {0, 1, 2}, {23, 24, 23}}) {
        CHECK(tear.cut_along(path, x).empty());
        CHECK_FALSE(tear.reserve_used_up());
    }
    CHECK(tear.cut_along(std::vector<Index>{22, 23, 24, 25, 26, 27}, x).empty());  // needs 5
    CHECK(tear.reserve_used_up());
    CHECK(tear.surface().triangles() == before);
    CHECK(x == mesh.positions());
    CHECK(tear.tips().empty());
    CHECK(tear.cut_along(std::vector<Index>{22, 23, 24, 25}, x).size() == 2);
    CHECK_FALSE(tear.reserve_used_up());
    CHECK(tear.tips().size() == 2);
}

TEST_CASE("a slit is a path of two edges along a direction", "[tear]") {
    const auto mesh = with_reserve(disc<double>({.rings = 6}), 10);
    Tearing tear(mesh, EnergyRelease{1, 1});
    const auto path = tear.slit_at(0, {1, 0, 0});
    REQUIRE(path[1] == 0);
    CHECK(mesh.positions()(0, path[0]) < 0);
    CHECK(mesh.positions()(0, path[2]) > 0);
    Points<double> x = mesh.positions();
    CHECK(tear.cut_along(path, x).size() == 1);
    CHECK(tear.tips().size() == 2);
    CHECK(tear.slit_at(border(mesh)[0], {1, 0, 0})[1] == no_index);
    CHECK(tear.slit_at(-1, {1, 0, 0})[1] == no_index);
}

TEST_CASE("a snapshot holds the tear: ticks go on with the same bits, and before the tear it is whole", "[tear]") {
    TornStrip<double> strip({.columns = 24, .rows = 12, .notch = 8});
    std::vector<std::byte> whole(snapshot_capacity(strip.sheet, strip.tear, strip.solver, strip.x)), torn(whole.size());
    const auto save = [&](std::vector<std::byte>& to) {
        return save_snapshot(to, strip.sheet, strip.tear, strip.solver, strip.x);
    };
    const auto restore = [&](std::span<const std::byte> from) {
        return restore_snapshot(from, strip.sheet, strip.tear, strip.solver, strip.x);
    };
    const Triangles triangles = strip.tear.surface().triangles();
    const std::size_t size = save(whole);
    REQUIRE(size > 0);
    strip.cut();
    strip.stretch(strip.critical_stretch());
    for (int tick = 0; tick < 10; ++tick) strip.tick(1e-3);
    const std::size_t torn_size = save(torn);
    const auto run = [&] {
        for (int tick = 0; tick < 30; ++tick) strip.tick(1e-3);
        return strip.x;
    };
    const Points<double> once = run();
    CHECK(strip.tear.torn_length() > 0);
    REQUIRE(restore(std::span(torn).first(torn_size)));
    CHECK(run() == once);
    REQUIRE(restore(std::span(whole).first(size)));
    CHECK(strip.tear.surface().triangles() == triangles);
    CHECK(strip.tear.tips().empty());
    CHECK(strip.x == strip.mesh.positions());
}

TEST_CASE("options of a tear are checked", "[tear]") {
    const auto mesh = sheet<double>({.columns = 2, .rows = 2});
    const auto with = [&](TearOptions options) {
        return test::refusal([&] { Tearing(mesh, EnergyRelease{1, 1}, options); });
    };
    CHECK(with({.max_tips = 0}) == "Tearing: max_tips must be at least 1, got 0");
    CHECK(with({.patch_radius = 1}) == "Tearing: patch_radius must be 2 to 100 [edges], got 1");
    CHECK(with({.min_angle = -1}) == "Tearing: min_angle must be 0 to 1 [rad], got -1");
    CHECK(test::refusal([&] { static_cast<void>(with_reserve(mesh, -1)); }) ==
          "with_reserve: count must not be negative, got -1");
}
