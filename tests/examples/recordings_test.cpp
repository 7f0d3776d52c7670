// SPDX-License-Identifier: MIT
#include "support/recordings.hpp"

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "support/catch.hpp"
#include "support/random.hpp"

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

    const auto plot = examples::plot_of(first, second);
    const auto svg = drawn(plot);
    CHECK(svg.size() < 300'000);
    CHECK(svg.find("nan") == std::string::npos);
    CHECK(svg.find("inf") == std::string::npos);

    const auto& forces = plot.panels[1].curves[1];
    const examples::detail::Axes axes{0, 0, 620, 100, 0, 59'999, 0, 50};
    std::size_t high = 0;
    for (const auto& pixel : examples::detail::pixels(axes, forces.samples)) high += pixel.y < 50;
    CHECK(high == 1);
    CHECK(examples::detail::path(axes, forces)
              .find(examples::number(axes.at({static_cast<double>(spike), 40}).x) + ' ' + examples::number(20)) !=
          std::string::npos);
}

TEST_CASE("recordings of no tick and of one are drawn", "[plot]") {
    const membrane::Recording<double> none;
    const membrane::Recording<double> one{.ticks = std::vector<membrane::RecordedTick<double>>(1)};
    for (const auto* other : {&none, &one}) {
        const auto svg = drawn(examples::plot_of(none, *other));
        CHECK(svg.find("nan") == std::string::npos);
    }
}
