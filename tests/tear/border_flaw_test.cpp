// SPDX-License-Identifier: MIT
#include <membrane/tear/border_flaw.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <type_traits>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/torn_strip.hpp"
#include "support/turned_grid.hpp"

using namespace membrane;

namespace {

constexpr Material material{.young_modulus = 1e6, .poisson_ratio = 0.3, .thickness = 1e-5};

/// Closed forms of simple extension, for springs of triangles: stress in proportion to Green's strain.
struct SimpleExtension {
    double stretch;

    double strain() const { return (stretch * stretch - 1) / 2; }
    double contraction() const { return std::sqrt(1 - 2 * material.poisson_ratio * strain()); }
    double tension() const { return stretch * material.young_modulus * material.thickness * strain(); }
    double energy() const { return material.young_modulus * material.thickness * strain() * strain() / 2; }
    /// Of an edge cut of this length in a half plane [N].
    double driving_force(double length) const {
        return 2 * 1.1215 * 1.1215 * std::numbers::pi / std::sqrt(stretch) * energy() * length;
    }
    /// At which a flaw of this length starts to tear.
    static double critical(double toughness, double flaw) {
        double low = 1, high = 1.8;
        while (high - low > 1e-13) {
            const double middle = (low + high) / 2;
            (SimpleExtension{middle}.driving_force(flaw) < toughness * material.thickness ? low : high) = middle;
        }
        return low;
    }
};

/// A sheet without clamps, stretched along y.
template <class Scalar>
struct Sheet {
    using Springs = TearableSprings<Scalar, LinearSpring>;

    Sheet(double turn, double edge, double toughness, Index reserve = 20, const TearOptions& options = {})
        : surface(test::turned_grid<Scalar>(12, 16, edge, turn)),
          mesh(with_reserve(surface.mesh(), reserve)),
          tissue(Springs(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = Scalar(0)})),
                 triangular_springs(mesh, material)),
          tear(mesh, EnergyRelease{toughness, material.thickness}, options),
          x(mesh.positions()) {}

    void stretch(double to) {
        x = mesh.positions();
        x.row(0) *= static_cast<Scalar>(SimpleExtension{to}.contraction());
        x.row(1) *= static_cast<Scalar>(to);
    }
    /// The vertex on the left side, or on the right one, that is nearest to the middle.
    Index at_side(bool right = false) const {
        const auto& rest = mesh.positions();
        const Scalar middle = rest.row(1).maxCoeff() / 2, side = right ? rest.row(0).maxCoeff() : Scalar(0);
        Index nearest = no_index;
        for (Index v = 0; v < surface.vertex_count(); ++v) {
            if (rest(0, v) != side) continue;
            const auto off = [&](Index w) { return std::abs(rest(1, w) - middle); };
            if (nearest == no_index || off(v) < off(nearest)) nearest = v;
        }
        return nearest;
    }
    auto start(Index v, double flaw) { return tear.start_at(v, static_cast<Scalar>(flaw), x, tissue); }

    test::Surface<Scalar> surface;
    TriangleMesh<Scalar> mesh;
    Tissue<Springs, Elements<Scalar, TriangularSpring<Scalar>>> tissue;
    Tearing<Scalar> tear;
    Points<Scalar> x;
};

template <class Scalar>
constexpr double rounding = std::is_same_v<Scalar, double> ? 1e-9 : 2e-3;

}  // namespace

TEMPLATE_TEST_CASE("the state of a border in simple extension is that of the closed forms", "[tear]", TEST_SCALARS) {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Sheet<TestType> sheet(random.number(0.0, 1.0), 1e-3, 1);
        const SimpleExtension extension{random.number(0.8, 1.5)};
        sheet.stretch(extension.stretch);
        sheet.x = (random.rotation<TestType>() * sheet.x).eval();
        for (const bool right : {false, true}) {
            const auto border =
                border_state<TestType>(sheet.tear.surface(), sheet.at_side(right), sheet.x, sheet.tissue);
            const auto tolerance = rounding<TestType>;
            CHECK(border.stretch == Approx(extension.stretch).epsilon(tolerance));
            CHECK(border.tension == Approx(extension.tension()).epsilon(tolerance));
            CHECK(border.energy == Approx(extension.energy()).epsilon(tolerance));
            CHECK(border.along[1] == Approx(right ? 1 : -1));
            CHECK(border.inward[0] == Approx(right ? -1 : 1));
            const auto force = flaw_driving_force(border, TestType(2e-5));
            CHECK(force == Approx(extension.stretch > 1 ? extension.driving_force(2e-5) : 0).epsilon(tolerance));
        }
    }
}

TEMPLATE_TEST_CASE("a flaw of the border starts to tear at the stretch of the closed form, on any mesh", "[tear]",
                   TEST_SCALARS) {
    constexpr double toughness = 500, flaw = 0.8e-3;
    const double expected = SimpleExtension::critical(toughness, flaw);
    for (const double edge : {2e-3, 1e-3, 0.7e-3}) {
        for (const double turn : {0.0, 0.2, 0.5}) {
            CAPTURE(edge, turn);
            Sheet<TestType> sheet(turn, edge, toughness);
            const Index v = sheet.at_side();
            double low = 1, high = 1.6;
            while (high - low > 1e-4) {
                const double middle = (low + high) / 2;
                sheet.stretch(middle);
                (sheet.start(v, flaw).empty() ? low : high) = middle;
            }
            CHECK(low == Approx(expected).epsilon(1e-3));
        }
    }
}

TEMPLATE_TEST_CASE("a border starts to tear above the closed form's stretch, never below", "[tear]", TEST_SCALARS) {
    int starts = 0;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double edge = random.number(0.2e-3, 5e-3), flaw = edge * random.number(0.05, 4.0);
        const double wanted = random.number(1.02, 1.5);  // which toughness makes critical
        const double toughness = SimpleExtension{wanted}.driving_force(flaw) / material.thickness;
        CAPTURE(edge, flaw, wanted, toughness);
        Sheet<TestType> sheet(random.number(0.0, 1.0), edge, toughness);
        const Index v = sheet.at_side(random.chance(0.5));
        const auto rotation = random.rotation<TestType>();
        const double away = random.number(0.01, 0.5);
        for (const bool above : {false, true}) {
            sheet.stretch(1 + (wanted - 1) * (above ? 1 + away : 1 - away));
            sheet.x = (rotation * sheet.x).eval();
            const auto path = sheet.start(v, flaw);
            REQUIRE(path.empty() == !above);
            if (!above) continue;
            const auto& rest = sheet.tear.surface().rest_positions();
            const double length = std::abs(static_cast<double>(rest(0, path.back()) - rest(0, path.front())));
            CHECK(path.front() == v);
            CHECK(length >= 2 * flaw * (1 - 1e-5));
            CHECK(length < 2 * flaw + 1.5 * edge);
            CHECK(std::abs(static_cast<double>(rest(1, path.back()) - rest(1, path.front()))) < 0.9 * edge);
            CHECK_FALSE(sheet.tear.cut_along(path, sheet.x).empty());
            CHECK(sheet.tear.tips().size() == 1);
            ++starts;
        }
    }
    CHECK(starts == cases(200));
}

TEMPLATE_TEST_CASE("a border that is slack, in compression, or stretched across only does not start to tear", "[tear]",
                   TEST_SCALARS) {
    for (const double turn : {0.0, 0.2, 0.5}) {
        CAPTURE(turn);
        Sheet<TestType> sheet(turn, 1e-3, 1e-3);
        const Index v = sheet.at_side();
        CHECK(sheet.start(v, 1e-3).empty());
        const auto slack = border_state<TestType>(sheet.tear.surface(), v, sheet.x, sheet.tissue);
        CHECK(slack.energy == Approx(0).margin(1e-12));
        sheet.stretch(0.8);
        CHECK(sheet.start(v, 1e-3).empty());
        sheet.x = sheet.mesh.positions();
        sheet.x.row(0) *= TestType(1.4);
        sheet.x.row(1) *= static_cast<TestType>(std::sqrt(1 - 0.3 * (1.4 * 1.4 - 1)));
        CHECK(sheet.start(v, 1e-3).empty());
        sheet.stretch(1.2);
        CHECK_FALSE(sheet.start(v, 1e-3).empty());
    }
}

TEST_CASE("the border runs along the sides of a sheet, next to its corners too, and within it there is none",
          "[tear]") {
    Sheet<double> sheet(0.2, 1e-3, 1e-3);
    sheet.stretch(1.2);
    const auto& rest = sheet.mesh.positions();
    const Eigen::Vector3d ends = rest.rowwise().maxCoeff();
    int at_sides = 0, starts = 0;
    for (Index v = 0; v < sheet.surface.vertex_count(); ++v) {
        CAPTURE(v);
        const auto border = border_state<double>(sheet.tear.surface(), v, sheet.x, sheet.tissue);
        if (!sheet.tear.surface().adjacency().on_border(v)) {
            CHECK(border.along == Vector3<double>::Zero());
            CHECK(border.inward == Vector3<double>::Zero());
            CHECK((border.stretch == 1 && border.tension == 0 && border.energy == 0));
            continue;
        }
        const bool at_x = rest(0, v) == 0 || rest(0, v) == ends[0], at_y = rest(1, v) == 0 || rest(1, v) == ends[1];
        if (at_x && at_y) continue;
        ++at_sides;
        CHECK(std::abs(border.along[at_x ? 1 : 0]) == Approx(1));
        if (!at_x) continue;
        const bool starts_here = !sheet.start(v, 0.4e-3).empty();
        CHECK(starts_here);
        starts += starts_here;
    }
    CHECK(at_sides >= 2 * (11 + 15));
    CHECK(starts >= 2 * 15);
}

TEMPLATE_TEST_CASE("a start from nonsense is none", "[tear]", TEST_SCALARS) {
    using Limits = std::numeric_limits<TestType>;
    Sheet<TestType> sheet(0.2, 1e-3, 100, 2);
    sheet.stretch(1.3);
    const Index v = sheet.at_side();
    REQUIRE_FALSE(sheet.start(v, 0.4e-3).empty());
    for (const Index other : {Index(-1), Index(sheet.mesh.vertex_count()), Limits::max() > 0 ? Index(1 << 30) : 0}) {
        CHECK(sheet.start(other, 0.4e-3).empty());
    }
    for (Index other = 0; other < sheet.mesh.vertex_count(); ++other) {
        if (!sheet.tear.surface().adjacency().on_border(other)) CHECK(sheet.start(other, 0.4e-3).empty());
    }
    for (const TestType flaw : {TestType(0), TestType(-1), Limits::infinity(), Limits::quiet_NaN()}) {
        CHECK(sheet.tear.start_at(v, flaw, sheet.x, sheet.tissue).empty());
    }
    const auto whole = sheet.x;
    for (const TestType bad : {Limits::infinity(), -Limits::infinity(), Limits::quiet_NaN(), Limits::max()}) {
        sheet.x(1, v) = bad;
        CHECK(sheet.start(v, 0.4e-3).empty());
        sheet.x = whole;
    }
    const auto path = sheet.start(v, 0.4e-3);
    const std::vector<Index> first(path.begin(), path.end());
    CHECK(sheet.start(v, 3.5e-3).empty());  // seven vertices would double
    CHECK(sheet.tear.reserve_used_up());
    for (const auto& event : sheet.tear.cut_along(first, sheet.x)) follow(event, sheet.tissue);
    REQUIRE(sheet.tear.tips().size() == 1);
    const auto tip = sheet.tear.tips()[0];
    for (const Index beside : {tip.vertex, tip.behind[0], tip.behind[1]}) {
        CHECK(sheet.start(beside, 0.4e-3).empty());
        CHECK_FALSE(sheet.tear.reserve_used_up());
    }
}

TEST_CASE("a border that has just started to tear does not start again at the same vertex", "[tear]") {
    Sheet<double> sheet(0.2, 1e-3, 1);
    sheet.stretch(1.3);
    for (const auto& event : sheet.tear.cut_along(sheet.start(sheet.at_side(), 0.4e-3), sheet.x)) {
        follow(event, sheet.tissue);
    }
    REQUIRE(sheet.tear.tips().size() == 1);
    for (const Index beside : sheet.tear.tips()[0].behind) {
        const auto border = border_state<double>(sheet.tear.surface(), beside, sheet.x, sheet.tissue);
        REQUIRE(sheet.tear.surface().nearest_in_direction(beside, border.inward) != no_index);
        REQUIRE(flaw_driving_force(border, 0.4e-3) > 2 * 1 * material.thickness);
        CHECK(sheet.start(beside, 0.4e-3).empty());
    }
    CHECK_FALSE(sheet.start(sheet.at_side(true), 0.4e-3).empty());
}

TEST_CASE("a border does not start to tear beside the tip of a tear that is one edge long, on any grid", "[tear]") {
    int beside_tips = 0;
    for (int i = 0; i <= 10; ++i) {
        Sheet<double> sheet(0.05 * i, 1e-3, 1);
        CAPTURE(i);
        sheet.stretch(1.3);
        const auto path = sheet.start(sheet.at_side(), 0.2e-3);
        for (const auto& event : sheet.tear.cut_along(path, sheet.x)) follow(event, sheet.tissue);
        REQUIRE(sheet.tear.tips().size() == 1);
        for (const Index beside : sheet.tear.tips()[0].behind) {
            const auto border = border_state<double>(sheet.tear.surface(), beside, sheet.x, sheet.tissue);
            if (sheet.tear.surface().nearest_in_direction(beside, border.inward) == no_index) continue;
            ++beside_tips;
            REQUIRE(flaw_driving_force(border, 0.2e-3) > 2 * 1 * material.thickness);
            CHECK(sheet.start(beside, 0.2e-3).empty());
        }
        CHECK_FALSE(sheet.start(sheet.at_side(true), 0.2e-3).empty());
    }
    CHECK(beside_tips > 3);
}

TEST_CASE("a border does not start to tear where it is pinned, or if there can be no further tip", "[tear]") {
    test::TornStrip<double> strip({});
    strip.x.row(0) *= 1.4;  // along both clamps
    const Index v = strip.top()[strip.top().size() / 2];
    CHECK(strip.tear.start_at(v, 3e-3, strip.x, strip.tissue).empty());
    Sheet<double> sheet(0.2, 1e-3, 100, 20, {.max_tips = 1});
    sheet.stretch(1.3);
    REQUIRE_FALSE(sheet.tear.cut_along(sheet.start(sheet.at_side(), 1e-3), sheet.x).empty());
    CHECK(sheet.start(sheet.at_side(true), 1e-3).empty());
}

TEST_CASE("the side of a tear is no border that starts to tear", "[tear]") {
    Sheet<double> sheet(0.2, 1e-3, 1);
    sheet.x = 1.3 * sheet.mesh.positions();
    const auto found = sheet.start(sheet.at_side(), 1.5e-3);
    const std::vector<Index> path(found.begin(), found.end());
    REQUIRE(path.size() >= 4);
    for (const auto& event : sheet.tear.cut_along(path, sheet.x)) follow(event, sheet.tissue);
    const auto border = border_state<double>(sheet.tear.surface(), path[1], sheet.x, sheet.tissue);
    REQUIRE(flaw_driving_force(border, 0.5e-3) > 2 * 1 * material.thickness);
    REQUIRE(sheet.tear.surface().nearest_in_direction(path[1], border.inward) != no_index);
    CHECK(sheet.start(path[1], 0.5e-3).empty());
}

namespace {

/// A strip between clamps whose tear starts from a flaw in the middle of its left side.
struct FlawedStrip {
    FlawedStrip(double toughness, double turn, double stretch)
        : strip({.columns = 24, .rows = 16, .turn = turn, .toughness = toughness}) {
        strip.stretch(stretch);
        const auto off = [&](Index w) {
            const auto at = point(strip.mesh.positions(), w);
            return std::abs(at[0]) + 0.1 * std::abs(at[1] - strip.height() / 2);
        };
        for (Index w = 0; w < strip.vertices; ++w) {
            if (off(w) < off(v)) v = w;
        }
    }
    auto border() const { return border_state<double>(strip.tear.surface(), v, strip.x, strip.tissue); }
    auto start(double flaw) { return strip.tear.start_at(v, flaw, strip.x, strip.tissue); }
    void cut(std::span<const Index> path) {
        for (const auto& event : strip.tear.cut_along(path, strip.x)) follow(event, strip.tissue, strip.solver);
    }

    test::TornStrip<double> strip;
    Index v = 0;
};

}  // namespace

TEST_CASE("a tear that starts from a flaw runs on, and a tougher one does not", "[tear]") {
    constexpr double flaw = 0.4e-3;
    for (const double turn : {0.2, 0.0}) {
        if (cases_are_slow && turn == 0) return;
        CAPTURE(turn);
        const double force = flaw_driving_force(FlawedStrip(200, turn, 1.2).border(), flaw);
        const auto path_at = [&](double part, double& torn, double& driving_force) {
            const double toughness = part * force / test::torn_material.thickness;
            FlawedStrip flawed(toughness, turn, 1.2);
            const auto path = flawed.start(flaw);
            const bool starts = !path.empty();
            const Index next = flawed.strip.tear.surface().nearest_in_direction(flawed.v, {1, 0, 0});
            flawed.cut(starts ? path : std::span<const Index>(std::array{flawed.v, next}));
            REQUIRE(flawed.strip.tear.tips().size() == 1);
            for (int tick = 0; tick < 150 && flawed.strip.torn_edges() < 4; ++tick) {
                flawed.strip.tick(0);
                REQUIRE(flawed.strip.report.status == StepStatus::advanced);
                if (flawed.strip.torn_edges() == 0) driving_force = norm(flawed.strip.tear.tips()[0].driving_force);
            }
            driving_force /= part * force;
            torn = flawed.strip.torn_edges();
            return starts;
        };
        double torn = 0, driving_force = 0;
        CHECK(path_at(0.95, torn, driving_force));
        CHECK(torn >= 4);
        CHECK_FALSE(path_at(1.05, torn, driving_force));
        CHECK_FALSE(path_at(4, torn, driving_force));
        CHECK(torn == 0);
        CHECK(driving_force < 1);
        CHECK(driving_force > 0.2);
    }
}

// The factor of an edge crack, from the energy of a sheet that is solved for: wide and high beside the cut.
TEST_CASE("a cut from the border of a large sheet releases the energy of the closed form", "[tear]") {
    constexpr int columns = 36, rows = 72, cut = 4;
    const auto surface = test::turned_grid<double>(columns, rows, 1e-3, 0.2);
    const auto reserved = with_reserve(surface.mesh(), cut + 2);
    Tearing tear(reserved, EnergyRelease{1e9, material.thickness});
    const auto& rest = tear.surface().rest_positions();
    Points<double> x = reserved.positions();
    std::vector<Index> path{0}, pinned;
    const double middle = rows * 1e-3 / 2;
    for (Index v = 0; v < surface.vertex_count(); ++v) {
        const auto off = [&](Index w) { return rest(0, w) + 0.1 * std::abs(rest(1, w) - middle); };
        if (off(v) < off(path[0])) path[0] = v;
        if (rest(1, v) == 0 || rest(1, v) == 2 * middle) pinned.push_back(v);
    }
    while (static_cast<int>(path.size()) <= cut) {
        const double aside = (middle - rest(1, path.back())) / 2e-3;
        path.push_back(tear.surface().nearest_in_direction(path.back(), {1, aside, 0}));
    }
    REQUIRE(tear.cut_along(path, x).size() == cut);
    const TriangleMesh<double> torn(Points<double>(rest.leftCols(reserved.vertex_count() - tear.surface().reserve())),
                                    tear.surface().triangles());
    const Tissue tissue(
        TearableSprings(torn, MassSpringNetwork(torn, LinearSpring{}, {.stiffness = 0.0, .pinned = pinned})),
        triangular_springs(torn, material), bending_springs(torn, 1e-4));
    const SimpleExtension extension{1.002};
    Points<double> start = torn.positions();
    start.row(0) *= extension.contraction();
    start.row(1) *= extension.stretch;
    const auto found = equilibrium(start, torn, tissue, NoFoundation(), {});
    REQUIRE(found.converged);
    x.leftCols(torn.vertex_count()) = found.x;
    REQUIRE(tear.update(x, 1e-3, tissue, NoFoundation()).empty());
    const double length = rest(0, path.back());
    CHECK(norm(tear.tips()[0].driving_force) == Approx(extension.driving_force(length)).epsilon(0.12));
}
