// SPDX-License-Identifier: MIT
#include "support/recordings.hpp"

#include <cmath>
#include <cstddef>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "mesh_texts.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

namespace {

std::string drawn(const std::vector<examples::Curve>& curves) {
    const test::Folder folder;
    const auto file = folder.path / "it's";  // a quote in the name
    REQUIRE(examples::plot(file, curves, "compare_traces") == "picture: " + file.string() + ".svg");
    std::ifstream svg(file.string() + ".svg");
    return {std::istreambuf_iterator<char>(svg), std::istreambuf_iterator<char>()};
}

}  // namespace

TEST_CASE("a minute of noise makes a small picture that shows each spike", "[plot]") {
    test::Random random(1);
    membrane::Recording<double> first;
    first.ticks.resize(60'000);
    for (auto& tick : first.ticks) {
        tick.tool.position = 1e-3 * random.vector();
        tick.force = random.vector();
    }
    auto second = first;
    second.ticks.resize(55'000);
    const std::size_t spike = 12'345;
    second.ticks[spike].force = {0, 0, 40};
    second.ticks[7].force.x() = std::numeric_limits<double>::quiet_NaN();
    second.ticks[8].tool.position.x() = std::numeric_limits<double>::infinity();
    second.ticks[9].force = membrane::Vector3<double>::Constant(std::numeric_limits<double>::max());

    const auto curves = examples::curves_of(first, second);
    const auto svg = drawn(curves);
    CHECK(svg.size() < 300'000);
    CHECK(svg.find("<svg") == 0);
    CHECK(svg.find("nan") == std::string::npos);
    CHECK(svg.find("inf") == std::string::npos);

    std::size_t high = 0;
    for (const auto& sample : examples::thinned(curves[3])) high += sample.y > 20;
    CHECK(high == 1);
    CHECK(examples::thinned(curves[3]).size() < 2500);
    CHECK(examples::thinned(curves[3]).back().x == 54'999);
}

TEST_CASE("recordings of no tick and of one are drawn", "[plot]") {
    const membrane::Recording<double> none;
    const membrane::Recording<double> one{.ticks = std::vector<membrane::RecordedTick<double>>(1)};
    for (const auto* other : {&none, &one}) CHECK(drawn(examples::curves_of(none, *other)).find("<svg") == 0);
}
