// SPDX-License-Identifier: MIT
#include <membrane/meshing/graded_edge_length.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include <membrane/mesh_check/quality.hpp>
#include <membrane/meshing/distmesh.hpp>
#include <membrane/surface/half_edges.hpp>

#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using membrane::decay_length;
using membrane::graded_edge_length;
using membrane::GradedLengthOptions;
using Point = membrane::Vector3<double>;

TEST_CASE("the decay length is that of the membrane's equation") {
    // T w'' = c w for w = exp(-x / length), by differences.
    test::Random random(1);
    for (int i = 0; i < 100; ++i) {
        const double tension = std::pow(10, random.number(-3.0, 3.0)),
                     foundation = std::pow(10, random.number(3.0, 9.0));
        const double length = decay_length(tension, foundation), h = 1e-3 * length;
        const auto w = [&](double x) { return std::exp(-x / length); };
        const double second = (w(1 + h) - 2 * w(1) + w(1 - h)) / (h * h);
        if (w(1) > 1e-6) CHECK(tension * second == Approx(foundation * w(1)).epsilon(1e-4));
    }
    CHECK(std::isinf(decay_length(1, 0)));
    CHECK(std::isinf(decay_length(0, 0)));
}

TEST_CASE("lengths at the loads, between them, and far away") {
    const GradedLengthOptions options{
        .longest = 0.5,
        .loads = {{.centre = {1, 0, 0}, .radius = 0.2}, {.centre = {-1, 0, 0}, .radius = 0.4}},
        .tension = 1,
        .foundation = 100,  // the dents decay over 0.1
        .resolution = 2,
        .growth = 0.25};
    const auto length = graded_edge_length(options);
    CHECK(length({1, 0, 0}) == Approx(0.05));
    CHECK(length({1, 0.2, 0}) == Approx(0.05));
    CHECK(length({1, 0, 0.6}) == Approx(0.05 + 0.25 * 0.4));
    CHECK(length({-1.8, 0, 0}) == Approx(0.05 + 0.25 * 0.4));
    CHECK(length({0, 100, 0}) == Approx(0.5));
    auto free = options;
    free.foundation = 0;
    CHECK(graded_edge_length(free)({1, 0, 0}) == Approx(0.1));
    CHECK(graded_edge_length(free)({-1, 0, 0}) == Approx(0.2));

    test::Random random(2);
    for (int i = 0; i < 1000; ++i) {
        const Point a = 2 * random.vector<double>(), b = a + random.number() * random.vector<double>();
        CHECK(std::abs(length(a) - length(b)) <= 0.25 * membrane::norm<double>(a - b) * (1 + 1e-12));
    }
}

TEST_CASE("DistMesh's edges follow the lengths, with good triangles") {
    const auto flat = membrane::trimmed(membrane::HalfSpace{}, membrane::Ball{.radius = 1});
    const double resolution = GENERATE(4.0, 8.0);
    const auto length = graded_edge_length({.longest = 0.15,
                                            .loads = {{.centre = {0.2, 0.1, 0}, .radius = 0.1}},
                                            .tension = 1,
                                            .foundation = 100,
                                            .resolution = resolution});
    const auto mesh = membrane::distmesh(
        flat, {.edge_length = length, .bounds = membrane::Bounds{{-1.1, -1.1, -0.15}, {1.1, 1.1, 0.15}}});
    const auto& x = mesh.positions();
    double count = 0, close = 0, sum = 0;
    membrane::for_each_edge(membrane::half_edges(mesh.triangles()), [&](const auto& sides) {
        const Point a = membrane::point(x, sides[0].first), b = membrane::point(x, sides[0].second);
        const double ratio = membrane::norm<double>(b - a) / length((a + b) / 2);
        ++count;
        sum += ratio;
        if (ratio > 0.7 && ratio < 1.4) ++close;
        CHECK(ratio > 0.45);
        CHECK(ratio < 1.8);
    });
    const auto quality = membrane::quality_of(mesh);
    CAPTURE(resolution, mesh.vertex_count(), sum / count, close / count, quality.smallest_angle);
    CHECK(sum / count == Approx(1).epsilon(0.15));
    CHECK(close / count > 0.95);
    CHECK(quality.smallest_angle > 28);
}

TEST_CASE("what graded lengths refuse") {
    GradedLengthOptions options{.longest = 0.1, .loads = {{.radius = 0.1}}};
    const auto refused = [&](auto change) {
        auto changed = options;
        change(changed);
        return test::refusal([&] { std::ignore = graded_edge_length(changed); });
    };
    CHECK(refused([](auto&) {}).empty());
    CHECK(refused([](auto& o) { o.longest = 0; }) ==
          "graded_edge_length: longest must be finite and positive [m], got 0");
    CHECK(refused([](auto& o) { o.resolution = -1; }) ==
          "graded_edge_length: resolution must be finite and positive [1], got -1");
    CHECK(refused([](auto& o) { o.growth = 1.5; }) ==
          "graded_edge_length: growth must be above 0 and at most 1, got 1.5");
    CHECK(refused([](auto& o) { o.loads.clear(); }) ==
          "graded_edge_length: loads must have at least one load, got none");
    CHECK(refused([](auto& o) { o.loads[0].radius = 0; }) ==
          "graded_edge_length: radius of load 0 must be finite and positive [m], got 0");
    CHECK(refused([](auto& o) { o.loads[0].centre[1] = std::numeric_limits<double>::quiet_NaN(); }) ==
          "graded_edge_length: centre of load 0 must be finite [m], got one that is not");
    CHECK(refused([](auto& o) { o.foundation = 1; }) ==
          "decay_length: tension must be finite and positive [N/m], got 0");
    CHECK(refused([](auto& o) { o.foundation = -1; }) ==
          "decay_length: foundation must be finite and not negative [Pa/m], got -1");
}
