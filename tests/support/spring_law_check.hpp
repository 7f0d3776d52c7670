// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <cstdint>
#include <sstream>
#include <string>

#include <membrane/model/spring_law.hpp>

#include "support/random.hpp"

/// What the compiler cannot see of a spring law, for your own laws, too.
///
///     CHECK(test::check_spring_law(Cubic{}) == "");
namespace test {

/// A law with a linear and a cubic term, k (e + b e^3 / r^2) for the elongation e: one of a user's own.
struct CubicSpring {
    double b = 30;

    template <membrane::Real Scalar>
    membrane::SpringResponse<Scalar> operator()(const membrane::SpringState<Scalar>& s) const noexcept {
        const Scalar e = s.length - s.rest_length;
        const Scalar c = s.rest_length > 0 ? static_cast<Scalar>(b) / (s.rest_length * s.rest_length) : Scalar(0);
        return {s.stiffness * (e + c * e * e * e), s.stiffness * (1 + 3 * c * e * e),
                s.stiffness * e * e * (Scalar(1) / 2 + c * e * e / 4)};
    }
};

/// What is wrong with `law`, for lengths up to `max_strain` beyond rest and down to nothing; empty if it is valid:
/// nothing at rest, tension the derivative of energy and stiffness that of tension, all finite for every finite length.
template <membrane::SpringLaw<double> Law>
std::string check_spring_law(const Law& law, double max_strain = 1) {
    Random random(1);
    std::ostringstream wrong;
    for (int n = 0; n < 1000 && wrong.str().empty(); ++n) {
        const double k = std::pow(10, random.number(-3.0, 3.0)), rest = std::pow(10, random.number(-4.0, 1.0));
        const auto at = [&](double length) { return law(membrane::SpringState<double>{k, rest, length}); };
        const auto say = [&](const char* what, double length, double found, double expected) {
            wrong << what << " at stiffness " << k << ", rest length " << rest << ", length " << length << " is "
                  << found << ", expected " << expected;
        };
        const auto near = [](double a, double b, double size) { return std::abs(a - b) <= 1e-6 * size; };

        if (const auto r = at(rest); r.tension != 0 || r.energy != 0) say("tension or energy", rest, r.tension, 0);
        const double length = rest * random.number(0.01, 1 + max_strain), h = 1e-5 * rest;
        const auto here = at(length), before = at(length - h), after = at(length + h);
        const double slope = (after.energy - before.energy) / (2 * h);
        if (!near(here.tension, slope, std::abs(here.tension) + k * rest)) say("tension", length, here.tension, slope);
        const double bend = (after.tension - before.tension) / (2 * h);
        if (!near(here.stiffness, bend, std::abs(here.stiffness) + k)) say("stiffness", length, here.stiffness, bend);
        for (const double wild : {1e-300, 1e-9, 1e9, 1e30, 1e60}) {
            const auto far = at(wild * rest);
            if (std::isfinite(far.tension) && std::isfinite(far.stiffness) && std::isfinite(far.energy)) continue;
            say("response", wild * rest, far.tension, 0);
        }
    }
    return wrong.str();
}

}  // namespace test
