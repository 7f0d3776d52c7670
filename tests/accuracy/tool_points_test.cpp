// SPDX-License-Identifier: MIT
#include <membrane/accuracy/tool_points.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/contact_newton.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

int corner_count(const ToolPoint& gap) { return static_cast<int>((gap.weights.eigen().array() > 0).count()); }

const ToolPoint* find(const std::vector<ToolPoint>& gaps, const ToolPoint& like) {
    for (const auto& gap : gaps) {
        if (!is_before(gap, like) && !is_before(like, gap)) return &gap;
    }
    return nullptr;
}

Tool<double> random_tool(test::Random& random, const Vector3<double>& position, bool is_capsule) {
    Tool<double> tool{.position = position, .radius = 0.05};
    if (is_capsule) tool.axis = random.vector();
    return tool;
}

}  // namespace

TEST_CASE("gradient and curvature of a gap are the slopes of gap and gradient", "[tool_points]") {
    const Triangles one = Eigen::Vector3i(0, 1, 2);
    std::set<std::pair<bool, int>> kinds;
    for (int seed = 1; seed <= 300; ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Points<double> x(3, 3);
        for (Index k = 0; k < 3; ++k) x.col(k) = random.vector();
        const std::array tools{
            random_tool(random, x * random.barycentric().eigen() + 0.4 * random.unit_vector(), seed % 2 == 0)};
        for (const auto& gap : tool_points(one, x, tools, 10)) {
            const auto curvature = gap_hessian(gap, x, tools[gap.tool]);
            for (Index i = 0; i < 9; ++i) {
                constexpr double h = 1e-6;
                Points<double> more = x, less = x;
                more.reshaped()[i] += h;
                less.reshaped()[i] -= h;
                const auto after = tool_points(one, more, tools, 10), before = tool_points(one, less, tools, 10);
                const auto *a = find(after, gap), *b = find(before, gap);
                if (a == nullptr || b == nullptr) continue;  // something else is nearest there
                const double size = 1 + curvature.norm();
                const auto own = static_cast<std::size_t>(i / 3);
                CHECK(std::abs((a->gap - b->gap) / (2 * h) - gap.gradient(own)[i % 3]) < 1e-8 * size);
                for (std::size_t k = 0; k < 3; ++k) {
                    const Vector3<double> slope = (a->gradient(k) - b->gradient(k)) / (2 * h);
                    const Vector3<double> column = curvature.block<3, 1>(3 * static_cast<Index>(k), i);
                    CHECK((slope - column).norm() < 1e-6 * size * size);
                }
                kinds.emplace(gap.part() == 2, corner_count(gap));
            }
        }
    }
    CHECK(kinds == std::set<std::pair<bool, int>>{{false, 1}, {false, 2}, {false, 3}, {true, 1}, {true, 2}});
}

TEST_CASE("what triangles share is one gap, and the least gap is the distance", "[tool_points]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 2});
    const auto& x = mesh.positions();
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        std::vector<Tool<double>> tools;
        for (int i = 0; i < 2; ++i) tools.push_back(random_tool(random, 1.2 * random.unit_vector(), seed % 2 == 0));
        tools[1].radius = 0.2;
        const auto gaps = tool_points(mesh.triangles(), x, tools, 0.3);
        CHECK(std::is_sorted(gaps.begin(), gaps.end(), is_before));
        CHECK(std::adjacent_find(gaps.begin(), gaps.end(),
                                 [](const auto& a, const auto& b) { return !is_before(a, b); }) == gaps.end());
        for (std::size_t i = 0; i < 2; ++i) {
            double expected = 10, found = 10;
            for (const auto& corners : mesh.triangles().colwise()) {
                const double distance = test::distance_from_axis(tools[i], x(Eigen::all, corners));
                CHECK(distance_from_axis(triangle_at(x, corners), tools[i]) == Approx(distance).margin(1e-12));
                expected = std::min(expected, distance - tools[i].radius);
            }
            for (const auto& gap : gaps) {
                if (gap.tool == i) found = std::min(found, gap.gap);
            }
            const bool is_through = expected < 1e-12 - tools[i].radius;  // then only ends and sides have gaps
            if (!is_through && expected < 0.3) CHECK(found == Approx(expected).margin(1e-12));
            if (!is_through && expected > 0.3) CHECK(found == 10);
        }
    }
}

TEST_CASE("a corner that six triangles share counts once for a sphere", "[tool_points]") {
    const auto mesh = disc({.radius = 1, .rings = 2});
    Points<double> x = mesh.positions();
    x(2, 0) = 0.5;  // a peak
    const std::array tools{Tool<double>{.position = {0, 0, 1}, .radius = 0.4}};
    const auto gaps = tool_points(mesh.triangles(), x, tools, 0.2);
    REQUIRE(gaps.size() == 1);
    CHECK(gaps[0].gap == Approx(0.1));
    CHECK((gaps[0].normal - Vector3<double>(0, 0, 1)).norm() < 1e-15);
    CHECK(corner_count(gaps[0]) == 1);
}

TEST_CASE("an edge that two triangles share counts once, in whichever order they name its ends", "[tool_points]") {
    Points<double> x(3, 4);
    x << -1, 1, 0, 0, 0, 0, -1, 1, 0, 0, -1, -1;  // a ridge along x
    Triangles triangles(3, 2);
    const std::array tools{Tool<double>{.position = {0.1, 0, 0.5}, .radius = 0.4},
                           Tool<double>{.position = {0.1, -1, 0.5}, .axis = {0, 2, 0}, .radius = 0.4}};
    for (const std::array<Index, 3>& other : {std::array<Index, 3>{1, 0, 3}, {0, 3, 1}, {3, 1, 0}}) {
        triangles << 0, other[0], 1, other[1], 2, other[2];
        for (const auto& tool : tools) {
            const auto gaps = tool_points(triangles, x, std::array{tool}, 0.2);
            REQUIRE(gaps.size() == 1);
            CHECK(gaps[0].gap == Approx(0.1));
            CHECK(corner_count(gaps[0]) == 2);
        }
    }
}

TEST_CASE("a surface on the axis has no normal, and no gap", "[tool_points]") {
    const auto mesh = disc({.radius = 1, .rings = 2});
    const std::array tools{Tool<double>{.position = Vector3<double>::Zero(), .radius = 0.1}};
    CHECK(tool_points(mesh.triangles(), mesh.positions(), tools, 0.01).empty());
}

TEST_CASE("an axis through a triangle's inside is noticed, unless that cannot move", "[tool_points]") {
    const auto mesh = disc({.radius = 1, .rings = 1});
    const std::vector<unsigned char> free(7, 0), fixed(7, 1);
    const Tool<double> across{.position = {0.3, 0.2, 1}, .axis = {0, 0, -2}, .radius = 0.01};
    const Tool<double> above{.position = {0.3, 0.2, 1}, .axis = {0, 0, -0.9}, .radius = 0.01};
    CHECK(is_pierced(mesh.triangles(), mesh.positions(), across, free));
    CHECK(!is_pierced(mesh.triangles(), mesh.positions(), across, fixed));
    CHECK(!is_pierced(mesh.triangles(), mesh.positions(), above, free));
}

TEST_CASE("in a safe part of a step no triangle reaches the axis", "[tool_points]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    int cut = 0;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const std::array tools{random_tool(random, 1.3 * random.unit_vector(), seed % 2 == 0)};
        const Points<double> step = test::jittered<double>(Points<double>::Zero(3, mesh.vertex_count()), 0.5, random);
        const double part = collision_free_step(mesh.triangles(), mesh.positions(), step, tools);
        REQUIRE(part >= 0);
        REQUIRE(part <= 1);
        cut += part < 1;
        const Points<double> x = mesh.positions() + part * step;
        for (const auto& corners : mesh.triangles().colwise()) {
            const double before = distance_from_axis(triangle_at(mesh.positions(), corners), tools[0]);
            CHECK(distance_from_axis(triangle_at(x, corners), tools[0]) >= 0.19 * before);
        }
    }
    CHECK(cut > 0);
    const Points<double> none = Points<double>::Zero(3, mesh.vertex_count());
    CHECK(collision_free_step(mesh.triangles(), mesh.positions(), none, std::array{Tool<double>{}}) == 1);
}

TEST_CASE("a step towards the axis is cut to four fifths of the distance", "[tool_points]") {
    Points<double> x(3, 3);
    x << 0, 1, 0,  //
        0, 0, 1,   //
        0, 0, 0;
    Triangles triangles(3, 1);
    triangles.col(0) << 0, 1, 2;
    Points<double> step = Points<double>::Zero(3, 3);
    step.row(2).setConstant(0.1);
    for (int i = 1; i <= 20; ++i) {
        const double distance = 0.01 * i;
        CAPTURE(distance);
        const std::array tools{Tool<double>{.position = {0.2, 0.2, distance}}};
        CHECK(collision_free_step(triangles, x, step, tools) == Approx(std::min(1.0, 0.8 * distance / 0.1)));
    }
}
