// SPDX-License-Identifier: MIT
#include "openhaptics/units.hpp"

#include <cmath>
#include <concepts>
#include <limits>
#include <string>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace examples;
using membrane::InvalidInput;
using test::Random;

namespace {

template <class A, class B>
concept Adds = requires(const A& a, const B& b) {
    a + b;
};
template <class A, class B>
concept Compares = requires(const A& a, const B& b) {
    a == b;
};

template <class Place>
concept OfDevice = requires(const DeviceScale& scale, const Place& place) {
    scale.to_scene(place);
};
template <class Force>
concept OfTissue = requires(const DeviceScale& scale, const Force& force) {
    scale.to_device(force);
};

}  // namespace

TEST_CASE("units do not mix", "[units]") {
    STATIC_REQUIRE(Adds<Metres, Metres>);
    STATIC_REQUIRE(Adds<Millimetres, Millimetres>);
    STATIC_REQUIRE_FALSE(Adds<Metres, Millimetres>);
    STATIC_REQUIRE_FALSE(Adds<Metres, Newtons>);
    STATIC_REQUIRE_FALSE(Adds<Metres, MetresPerSecond>);
    STATIC_REQUIRE_FALSE(Adds<Metres, membrane::Vector3<double>>);
    STATIC_REQUIRE_FALSE(Compares<Metres, Millimetres>);
    STATIC_REQUIRE_FALSE(std::convertible_to<membrane::Vector3<double>, Metres>);
    STATIC_REQUIRE_FALSE(std::convertible_to<Metres, membrane::Vector3<double>>);
    STATIC_REQUIRE_FALSE(std::constructible_from<Metres, Millimetres>);
    STATIC_REQUIRE_FALSE(std::assignable_from<Metres&, Millimetres>);
    STATIC_REQUIRE_FALSE(std::convertible_to<double, NewtonsPerMetre>);
    STATIC_REQUIRE_FALSE(std::constructible_from<NewtonsPerMetre, NewtonsPerMillimetre>);
    STATIC_REQUIRE(OfDevice<Millimetres> && OfTissue<Newtons>);
    STATIC_REQUIRE_FALSE(OfDevice<Metres>);
    STATIC_REQUIRE_FALSE(OfDevice<membrane::Vector3<double>>);
    STATIC_REQUIRE_FALSE(OfTissue<Millimetres>);
    static_cast<void>([](const DeviceScale& scale, const Millimetres& place, const MillimetresPerSecond& speed) {
        static_assert(noexcept(scale.to_scene(place))&& noexcept(scale.to_scene(place, speed)));
        static_assert(noexcept(scale.to_device(Newtons({0, 0, 1})))&& noexcept(in_metres(speed)));
        static_assert(noexcept(scale.at_device(NewtonsPerMetre(1))));
    });
    CHECK((Metres({1, 2, 3}) + Metres({0.5, 0, 0})) - Metres({1, 2, 3}) == 0.5 * Metres({1, 0, 0}));
}

TEST_CASE("a device in millimetres, a scene in metres, a force in newtons", "[units]") {
    // The device stands on its side: its x is the scene's y, its y is the scene's z, its z is the scene's x.
    DeviceScale scale{.force = 40, .motion = 0.25};
    scale.device.rotation << 0, 0, 1, 1, 0, 0, 0, 1, 0;
    scale.device.origin = {0.5, 0, -0.25};
    const auto tool = scale.to_scene(Millimetres({12, -8, 100}), MillimetresPerSecond({250, 0, -40}));
    CHECK((tool.position - membrane::Vector3<double>(0.525, 0.003, -0.252)).cwiseAbs().maxCoeff() <= 1e-12);
    CHECK((tool.velocity - membrane::Vector3<double>(-0.01, 0.0625, 0)).cwiseAbs().maxCoeff() <= 1e-12);
    const auto felt = scale.to_device(Newtons({0.012, -0.025, 0}));  // a sclera, a lens capsule
    CHECK((felt.device_force.value() - membrane::Vector3<double>(-1, 0, 0.48)).cwiseAbs().maxCoeff() <= 1e-12);
    CHECK(felt.scene_force == Newtons({0.012, -0.025, 0}));
    CHECK(felt.scale == 40);
    CHECK(scale.at_device(NewtonsPerMetre(12)).value() == Approx(120).epsilon(1e-12));
    CHECK(in_metres(NewtonsPerMillimetre(0.5)).value() == 500);
    CHECK(in_millimetres(NewtonsPerMetre(500)).value() == 0.5);
    CHECK(in_metres(Millimetres({1, 10, 0.1})) == Metres({0.001, 0.01, 0.0001}));
    CHECK(in_millimetres(Metres({0.001, 0.25, 2})) == Millimetres({1, 250, 2000}));
    CHECK(in_metres(MillimetresPerSecond({1, 10, 0.1})) == MetresPerSecond({0.001, 0.01, 0.0001}));
    CHECK(in_millimetres(MetresPerSecond({0.25, 1, 2})) == MillimetresPerSecond({250, 1000, 2000}));
}

TEST_CASE("work by the hand is force times motion times the work on the tissue", "[units]") {
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        DeviceScale scale{.force = random.number(1.0, 100.0), .motion = random.number(0.05, 2.0)};
        scale.device.rotation = random.rotation();
        scale.device.origin = random.vector();
        const Millimetres from(random.vector(-100.0, 100.0)), to(random.vector(-100.0, 100.0));
        const Newtons force(random.vector());
        const double by_hand = dot<double>(in_metres(to - from).value(), scale.to_device(force).device_force.value());
        const double in_scene = dot<double>((scale.to_scene(to) - scale.to_scene(from)).value(), force.value());
        REQUIRE(std::abs(by_hand * scale.motion - scale.force * in_scene) <= 1e-12 * scale.force);
        REQUIRE(norm(scale.to_device(force).device_force.value()) == Approx(scale.force * norm(force.value())));
    }
}

TEST_CASE("scales that make no sense are refused by name", "[units][bad]") {
    const auto refused = [](const DeviceScale& scale) { return test::refusal([&] { scale.validate(); }); };
    CHECK(refused({}) == "");
    CHECK(refused({.force = 0}) == "DeviceScale: force must be finite and positive, got 0");
    CHECK(refused({.motion = -1}) == "DeviceScale: motion must be finite and positive, got -1");
    CHECK(refused({.force = std::numeric_limits<double>::infinity()}) ==
          "DeviceScale: force must be finite and positive, got inf");
    DeviceScale scale;
    scale.device.origin.x() = std::numeric_limits<double>::quiet_NaN();
    CHECK(refused(scale) == "DeviceScale: device must be finite");
}
