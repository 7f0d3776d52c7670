// SPDX-License-Identifier: MIT
#include "support/peel_strip.hpp"

#include <type_traits>

#include "support/cases.hpp"
#include "support/catch.hpp"

TEMPLATE_TEST_CASE("a 90 degree peel takes the adhesion energy per area, on three meshes", "[cohesion][peel]", double,
                   float) {
    for (const double edge : {12e-6, 8e-6, 6e-6}) {
        if (cases_are_slow && edge < 12e-6) continue;
        CAPTURE(edge);
        test::PeelStrip<TestType> strip(edge);
        CHECK(strip.peel() == Approx(strip.energy).epsilon(0.02));
        const double balance = (strip.stored() + strip.adhesion.dissipated()) / strip.work;
        CHECK(balance == Approx(1).epsilon(std::is_same_v<TestType, float> ? 0.02 : 0.01));
    }
}
