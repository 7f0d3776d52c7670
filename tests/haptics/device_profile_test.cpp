// SPDX-License-Identifier: MIT
#include <membrane/haptics/device_profile.hpp>

#include <limits>
#include <string>

#include "support/catch.hpp"
#include "support/refusal.hpp"

using namespace membrane;

TEST_CASE("the stock devices are valid, their numbers those of such devices", "[profile]") {
    for (const auto& device : {devices::touch, devices::phantom_desktop, devices::premium_1_5, devices::premium_3_0,
                               devices::omega, devices::delta, devices::sigma}) {
        CAPTURE(std::string(device.name));
        CHECK(test::refusal([&] { device.validate(); }) == "");
        CHECK(device.peak_force >= 3.3);
        CHECK(device.peak_force <= 22);
        CHECK(device.stiffness >= 500);
        CHECK(device.stiffness <= 5000);
        CHECK(device.damping < 0.01);  // thousandths, or nothing is known
        CHECK(device.friction < 0.3);
        CHECK((device.resolution > 0) == (device.friction > 0));
        CHECK(device.resolution < 1e-4);
    }
}

TEST_CASE("profiles that make no sense are refused by name", "[profile][bad]") {
    using Field = double DeviceProfile::*;
    const double infinity = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
    const auto refused = [](Field field, double value) {
        auto device = devices::touch;
        device.*field = value;
        return test::refusal([&] { device.validate(); });
    };
    struct Case {
        Field field;
        std::string name, unit;
        bool zero;
    };
    for (const auto& [field, name, unit, zero] :
         {Case{&DeviceProfile::peak_force, "peak_force", "N", false},
          Case{&DeviceProfile::continuous_force, "continuous_force", "N", false},
          Case{&DeviceProfile::stiffness, "stiffness", "N/m", false},
          Case{&DeviceProfile::damping, "damping", "N s/m", true},
          Case{&DeviceProfile::friction, "friction", "N", true},
          Case{&DeviceProfile::resolution, "resolution", "m", true},
          Case{&DeviceProfile::thermal_time, "thermal_time", "s", false}}) {
        const std::string must = "DeviceProfile: " + name + " must be finite and " +
                                 (zero ? "not negative [" : "positive [") + unit + "], got ";
        CHECK(refused(field, infinity) == must + "inf");
        CHECK(refused(field, nan).rfind(must, 0) == 0);
        CHECK(refused(field, -1) == must + "-1");
        CHECK(refused(field, 0) == (zero ? "" : must + "0"));
    }
    CHECK(refused(&DeviceProfile::continuous_force, 4) ==
          "DeviceProfile: continuous_force must not exceed the peak_force of 3.3 N, got 4 N");
}
