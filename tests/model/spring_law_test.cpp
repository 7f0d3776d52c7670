// SPDX-License-Identifier: MIT
#include <membrane/model/spring_law.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"
#include "support/spring_law_check.hpp"

using namespace membrane;

static_assert(SpringLaw<LinearSpring, float> && SpringLaw<LinearSpring, double>);
static_assert(SpringLaw<TensionSpring, float> && SpringLaw<TensionSpring, double>);
static_assert(!never_stiffens<TensionSpring>());  // a slack one is stiffer once it is stretched
static_assert(SpringLaw<ExponentialSpring, float> && SpringLaw<ExponentialSpring, double>);

namespace {

template <class S>
SpringState<S> random_spring(test::Random& random, S max_strain) {
    const auto k = static_cast<S>(std::pow(10, random.number(-3.0, 3.0)));
    const auto rest = static_cast<S>(std::pow(10, random.number(-4.0, 1.0)));
    return {k, rest, rest * random.number(S(0.05), 1 + max_strain)};
}

}  // namespace

TEST_CASE("the stock laws, and one of one's own, are valid", "[network]") {
    CHECK(test::check_spring_law(LinearSpring{}) == "");
    CHECK(test::check_spring_law(TensionSpring{}) == "");
    CHECK(test::check_spring_law(ExponentialSpring{}) == "");
    CHECK(test::check_spring_law(ExponentialSpring{.stiffening = 3, .strain_limit = 2}, 4) == "");
    CHECK(test::check_spring_law(ExponentialSpring{.stiffening = 1e-3}) == "");
    CHECK(test::check_spring_law(test::CubicSpring{}) == "");
}

namespace {

struct PullsAtRest {
    template <Real Scalar>
    SpringResponse<Scalar> operator()(const SpringState<Scalar>& s) const noexcept {
        return {s.stiffness * s.length, s.stiffness, s.stiffness * s.length * s.length / 2};
    }
};
struct EnergyOfAnother {
    template <Real Scalar>
    SpringResponse<Scalar> operator()(const SpringState<Scalar>& s) const noexcept {
        auto response = LinearSpring{}(s);
        response.energy *= 2;
        return response;
    }
};
struct StiffnessOfAnother {
    template <Real Scalar>
    SpringResponse<Scalar> operator()(const SpringState<Scalar>& s) const noexcept {
        auto response = LinearSpring{}(s);
        response.stiffness *= 2;
        return response;
    }
};
struct Overflows {
    double a = 10;
    template <Real Scalar>
    SpringResponse<Scalar> operator()(const SpringState<Scalar>& s) const noexcept {
        const auto b = static_cast<Scalar>(a);
        const Scalar z = b * (s.length - s.rest_length) / s.rest_length, k = s.stiffness, r = s.rest_length;
        return {k * r * std::expm1(z) / b, k * std::exp(z), k * r * r * (std::expm1(z) - z) / (b * b)};
    }
};

}  // namespace

TEST_CASE("the check of spring laws finds what is wrong", "[network]") {
    CHECK_THAT(test::check_spring_law(PullsAtRest{}), ContainsSubstring("tension or energy at"));
    CHECK_THAT(test::check_spring_law(EnergyOfAnother{}), ContainsSubstring("tension at"));
    CHECK_THAT(test::check_spring_law(StiffnessOfAnother{}), ContainsSubstring("stiffness at"));
    CHECK_THAT(test::check_spring_law(Overflows{}), ContainsSubstring("response at"));
}

TEMPLATE_TEST_CASE("a linear spring is k (l - r)", "[network]", TEST_SCALARS) {
    using S = TestType;
    const auto stretched = LinearSpring{}(SpringState<S>{40, 2, 3});
    CHECK(stretched.tension == 40);
    CHECK(stretched.stiffness == 40);
    CHECK(stretched.energy == 20);
    const auto pressed = LinearSpring{}(SpringState<S>{40, 2, 1});
    CHECK(pressed.tension == -40);
    CHECK(pressed.energy == 20);
    const auto point_like = LinearSpring{}(SpringState<S>{40, 0, S(0.5)});
    CHECK(point_like.tension == 20);
    CHECK(point_like.energy == 5);
}

TEMPLATE_TEST_CASE("a spring of tension only is linear while it is stretched, and else not there", "[network]",
                   TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto spring = random_spring<S>(random, 1);
        const auto response = TensionSpring{}(spring), linear = LinearSpring{}(spring);
        const bool is_slack = spring.length < spring.rest_length;
        REQUIRE(response.tension == (is_slack ? 0 : linear.tension));
        REQUIRE(response.stiffness == (is_slack ? 0 : linear.stiffness));
        REQUIRE(response.energy == (is_slack ? 0 : linear.energy));
    }
    CHECK(TensionSpring{}(SpringState<S>{40, 2, 2}).stiffness == 40);
    const auto in_lanes = [](S length) {
        return TensionSpring{}(SpringState<Lanes<S>>{Lanes<S>(40), Lanes<S>(2), Lanes<S>(length)});
    };
    CHECK((in_lanes(3).tension[0] == 40 && in_lanes(3).stiffness[0] == 40));
    CHECK((in_lanes(1).tension[0] == 0 && in_lanes(1).stiffness[0] == 0));
}

TEMPLATE_TEST_CASE("an exponential spring is the exponential, whatever the strain", "[network]", TEST_SCALARS) {
    using S = TestType;
    const long double tolerance = 40 * static_cast<long double>(std::numeric_limits<S>::epsilon());
    for (int seed = 1; seed <= cases(3000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const ExponentialSpring law{.stiffening = random.number(0.1, 40.0), .strain_limit = 1};
        const auto a = static_cast<long double>(static_cast<S>(law.stiffening));
        // From 1e-12 of the rest length up to all of it; the length as it is stored counts.
        const S strain = static_cast<S>(std::pow(10, random.number(-12.0, -0.01)) * (random.chance(0.5) ? 1 : -1));
        const S k = random.number<S>(1, 100), rest = random.number<S>(S(0.1), 10), length = rest * (1 + strain);
        const long double e = (static_cast<long double>(length) - rest) / rest, z = a * e;
        const auto found = law(SpringState<S>{k, rest, length});
        // Differences of nearly equal numbers cost digits in the tension (strain) but no more than that.
        const long double tension = k * static_cast<long double>(rest) * std::expm1(z) / a;
        REQUIRE(std::abs(found.tension - tension) <= (1 + std::abs(z)) * tolerance * std::abs(tension));
        const long double stiffness = k * std::exp(z);
        REQUIRE(std::abs(found.stiffness - stiffness) <= (1 + std::abs(z)) * tolerance * std::max(stiffness, 1.0L * k));
        long double bend = std::expm1(z) - z;
        if (std::abs(z) < 1) {  // the series of this, which loses no digits
            bend = 0;
            long double term = z;
            for (int n = 2; n < 30; ++n) bend += term *= z / n;
        }
        const long double energy = k * static_cast<long double>(rest) * rest * bend / (a * a);
        // The law goes from its own series to the difference at |z| = 0.01: there two digits are lost.
        const long double lost = std::abs(z) + 1 / std::max(std::abs(z), 0.01L);
        REQUIRE(std::abs(found.energy - energy) <= (1 + lost) * tolerance * energy);
    }
}

TEMPLATE_TEST_CASE("beyond its strain limit an exponential spring goes on along its tangent", "[network]",
                   TEST_SCALARS) {
    using S = TestType;
    const S epsilon = std::numeric_limits<S>::epsilon();
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const ExponentialSpring law{.stiffening = random.number(1.0, 20.0), .strain_limit = random.number(0.1, 1.0)};
        const S k = random.number<S>(1, 100), rest = random.number<S>(S(0.1), 10);
        const S limit = rest * (1 + static_cast<S>(law.strain_limit));
        const auto at = [&](S length) { return law(SpringState<S>{k, rest, length}); };
        // Once continuously differentiable: tension, stiffness and energy pass over the limit without a jump.
        const auto before = at(limit * (1 - 4 * epsilon)), after = at(limit * (1 + 4 * epsilon));
        const S rounding = 100 * static_cast<S>(law.stiffening) * epsilon;
        REQUIRE(std::abs(after.tension - before.tension) <= rounding * before.stiffness * limit);
        REQUIRE(std::abs(after.stiffness - before.stiffness) <= 2 * rounding * before.stiffness);
        REQUIRE(std::abs(after.energy - before.energy) <= rounding * before.tension * limit);

        const S further = random.number<S>(0, 10) * rest;
        const auto far = at(limit + further);
        REQUIRE(far.stiffness == after.stiffness);
        const S tension = after.tension + after.stiffness * further;
        REQUIRE(std::abs(far.tension - tension) <= rounding * tension);
        const S energy = after.energy + after.tension * further + after.stiffness * further * further / 2;
        REQUIRE(std::abs(far.energy - energy) <= rounding * energy);
    }
}

TEMPLATE_TEST_CASE("a spring that hardly stiffens is linear", "[network]", TEST_SCALARS) {
    using S = TestType;
    const ExponentialSpring law{.stiffening = 1e-9, .strain_limit = 1};
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto spring = random_spring<S>(random, S(0.9));
        const auto found = law(spring), expected = LinearSpring{}(spring);
        const S tolerance = std::max(S(1e-8), 20 * std::numeric_limits<S>::epsilon());
        REQUIRE(found.tension == Approx(expected.tension).epsilon(tolerance));
        REQUIRE(found.stiffness == Approx(expected.stiffness).epsilon(tolerance));
        REQUIRE(found.energy == Approx(expected.energy).epsilon(tolerance));
    }
}

TEMPLATE_TEST_CASE("an exponential spring of rest length zero has no strain and is linear", "[network]", TEST_SCALARS) {
    using S = TestType;
    const auto found = ExponentialSpring{}(SpringState<S>{40, 0, S(0.5)});
    CHECK(found.tension == 20);
    CHECK(found.stiffness == 40);
    CHECK(found.energy == 5);
}

TEMPLATE_TEST_CASE("wild lengths give finite results", "[network]", TEST_SCALARS) {
    using S = TestType;
    const S largest = std::sqrt(std::numeric_limits<S>::max()) / S(1e6);
    const ExponentialSpring hardest{.stiffening = 50, .strain_limit = sizeof(S) == 4 ? 0.6 : 1.0};
    for (const S rest : {S(0), S(1e-6), S(1), S(1e6)}) {
        for (const S length : {std::numeric_limits<S>::denorm_min(), S(1e-12), S(1), S(1e6), largest / S(1e13)}) {
            CAPTURE(rest, length);
            for (const auto& response :
                 {LinearSpring{}(SpringState<S>{1, rest, length}), ExponentialSpring{}(SpringState<S>{1, rest, length}),
                  hardest(SpringState<S>{1, rest, length})}) {
                CHECK(is_finite(response.tension));
                CHECK(is_finite(response.stiffness));
                CHECK(is_finite(response.energy));
                CHECK(response.stiffness >= 0);
                CHECK(response.energy >= 0);
            }
        }
    }
}

TEST_CASE("options of the exponential law that make no sense are refused by name", "[network][bad]") {
    const auto refused = [](double stiffening, double limit) {
        return test::refusal([&] { ExponentialSpring{stiffening, limit}.validate(); });
    };
    CHECK(refused(10, 0.5) == "");
    CHECK(refused(50, 1) == "");
    CHECK(refused(1e-9, 1e9) == "");
    const std::string stiffening = "ExponentialSpring: stiffening must be finite and positive, got ";
    const std::string limit = "ExponentialSpring: strain_limit must be finite and positive, got ";
    const double infinity = std::numeric_limits<double>::infinity();
    CHECK(refused(0, 0.5) == stiffening + "0");
    CHECK(refused(-10, 0.5) == stiffening + "-10");
    CHECK(refused(infinity, 0.5) == stiffening + "inf");
    CHECK(refused(std::nan(""), 0.5) == stiffening + "nan");
    CHECK(refused(10, 0) == limit + "0");
    CHECK(refused(10, -1) == limit + "-1");
    CHECK(refused(10, infinity) == limit + "inf");
    CHECK(refused(10, std::nan("")) == limit + "nan");
    CHECK(refused(10, 5.5) == "ExponentialSpring: stiffening times strain_limit must be at most 50, got 55");
    CHECK(refused(1e300, 1e300) == "ExponentialSpring: stiffening times strain_limit must be at most 50, got inf");
}

TEST_CASE("laws work with either scalar and throw nothing", "[network]") {
    STATIC_REQUIRE(SpringLaw<test::CubicSpring, float>);
    STATIC_REQUIRE(SpringLaw<test::CubicSpring, double>);
    STATIC_REQUIRE_FALSE(SpringLaw<LinearSpring, long double>);
    STATIC_REQUIRE_FALSE(SpringLaw<int, double>);
}
