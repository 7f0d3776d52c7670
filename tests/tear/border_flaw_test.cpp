// SPDX-License-Identifier: MIT
#include <membrane/tear/border_flaw.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <type_traits>
#include <vector>

#include <membrane/model/tearable_springs.hpp>
#include <membrane/model/tissue.hpp>
#include <membrane/model/triangular_springs.hpp>
#include <membrane/tear/tearing.hpp>

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

TEMPLATE_TEST_CASE("the state of a border in simple extension is that of the closed forms", "[tear]", double, float) {
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
                   double, float) {
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

TEMPLATE_TEST_CASE("a border starts to tear above the closed form's stretch, never below", "[tear]", double, float) {
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
            CHECK(length >= flaw * (1 - 1e-5));
            CHECK(length < flaw + 1.5 * edge);
            CHECK(std::abs(static_cast<double>(rest(1, path.back()) - rest(1, path.front()))) < 0.9 * edge);
            CHECK_FALSE(sheet.tear.cut_along(path, sheet.x).empty());
            CHECK(sheet.tear.tips().size() == 1);
            ++starts;
        }
    }
    CHECK(starts == cases(200));
}

TEMPLATE_TEST_CASE("a border that is slack, in compression, or stretched across only does not start to tear", "[tear]",
                   double, float) {
    for (const double turn : {0.0, 0.2, 0.5}) {
        CAPTURE(turn);
        Sheet<TestType> sheet(turn, 1e-3, 1e-3);
        const Index v = sheet.at_side();
        CHECK(sheet.start(v, 1e-3).empty());
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

TEMPLATE_TEST_CASE("a start from nonsense is none", "[tear]", double, float) {
    using Limits = std::numeric_limits<TestType>;
    Sheet<TestType> sheet(0.2, 1e-3, 100, 2);
    sheet.stretch(1.3);
    const Index v = sheet.at_side();
    REQUIRE_FALSE(sheet.start(v, 1e-3).empty());
    for (const Index other : {Index(-1), Index(sheet.mesh.vertex_count()), Limits::max() > 0 ? Index(1 << 30) : 0}) {
        CHECK(sheet.start(other, 1e-3).empty());
    }
    for (Index other = 0; other < sheet.mesh.vertex_count(); ++other) {
        if (!sheet.tear.surface().adjacency().on_border(other)) CHECK(sheet.start(other, 1e-3).empty());
    }
    for (const TestType flaw : {TestType(0), TestType(-1), Limits::infinity(), Limits::quiet_NaN()}) {
        CHECK(sheet.tear.start_at(v, flaw, sheet.x, sheet.tissue).empty());
    }
    const auto whole = sheet.x;
    for (const TestType bad : {Limits::infinity(), -Limits::infinity(), Limits::quiet_NaN(), Limits::max()}) {
        sheet.x(1, v) = bad;
        CHECK(sheet.start(v, 1e-3).empty());
        sheet.x = whole;
    }
    const auto path = sheet.start(v, 0.5e-3);
    const std::vector<Index> first(path.begin(), path.end());
    CHECK(sheet.start(v, 3.5e-3).empty());  // four vertices would double
    CHECK(sheet.tear.reserve_used_up());
    REQUIRE(sheet.tear.cut_along(first, sheet.x).size() == 1);
    const auto tip = sheet.tear.tips()[0];
    for (const Index beside : {tip.vertex, tip.behind[0], tip.behind[1]}) {
        CHECK(sheet.start(beside, 0.5e-3).empty());
        CHECK_FALSE(sheet.tear.reserve_used_up());
    }
}

TEST_CASE("a border does not start to tear where it is pinned, or if there can be no further tip", "[tear]") {
    test::TornStrip<double> strip({});
    strip.x.row(0) *= 1.4;  // along both clamps
    const Index v = strip.top[strip.top.size() / 2];
    CHECK(strip.tear.start_at(v, 1e-3, strip.x, strip.sheet).empty());
    Sheet<double> sheet(0.2, 1e-3, 100, 20, {.max_tips = 1});
    sheet.stretch(1.3);
    REQUIRE_FALSE(sheet.tear.cut_along(sheet.start(sheet.at_side(), 1e-3), sheet.x).empty());
    CHECK(sheet.start(sheet.at_side(true), 1e-3).empty());
}
