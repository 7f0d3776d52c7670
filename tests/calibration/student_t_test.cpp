// SPDX-License-Identifier: MIT
#include <membrane/calibration/student_t.hpp>

#include <cmath>
#include <numbers>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

TEST_CASE("Student's t is that of the printed tables") {
    struct Entry {
        Index degrees;
        double at_90, at_95, at_99;
    };
    for (const auto& entry :
         {Entry{1, 6.314, 12.706, 63.657}, Entry{2, 2.920, 4.303, 9.925}, Entry{3, 2.353, 3.182, 5.841},
          Entry{4, 2.132, 2.776, 4.604}, Entry{5, 2.015, 2.571, 4.032}, Entry{10, 1.812, 2.228, 3.169},
          Entry{17, 1.740, 2.110, 2.898}, Entry{30, 1.697, 2.042, 2.750}, Entry{60, 1.671, 2.000, 2.660},
          Entry{120, 1.658, 1.980, 2.617}}) {
        CAPTURE(entry.degrees);
        CHECK(std::abs(student_t(0.90, entry.degrees) - entry.at_90) <= 0.0005);
        CHECK(std::abs(student_t(0.95, entry.degrees) - entry.at_95) <= 0.0005);
        CHECK(std::abs(student_t(0.99, entry.degrees) - entry.at_99) <= 0.0005);
    }
    CHECK(std::abs(student_t(0.95, 100000) - 1.95996) < 1e-4);  // the normal distribution
}

TEST_CASE("Student's t leaves the probability asked for under its density") {
    test::Random random(1);
    for (int i = 0; i < cases(200); ++i) {
        const Index degrees = 1 + random.index(60);
        const double probability = random.number(0.01, 0.999), nu = degrees;
        CAPTURE(degrees, probability);
        const double end = std::atan(student_t(probability, degrees) / std::sqrt(nu));
        // With t = sqrt(nu) tan(angle), the density is cos(angle)^(nu - 1) over its integral; Simpson's rule.
        const auto integral = [nu](double to) {
            constexpr int parts = 2000;
            double sum = 0;
            for (int k = 0; k <= parts; ++k) {
                const double weight = k == 0 || k == parts ? 1 : k % 2 == 1 ? 4 : 2;
                sum += weight * std::pow(std::cos(to * k / parts), nu - 1);
            }
            return sum * to / (3 * parts);
        };
        CHECK(integral(end) / integral(std::numbers::pi / 2) == Approx(probability).epsilon(1e-9));
    }
}
