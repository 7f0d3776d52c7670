// SPDX-License-Identifier: MIT
#include <membrane/core/lanes.hpp>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

template <class S>
using Numbers = std::array<S, Lanes<S>::count>;

template <class S>
auto bits(S x) {
    return std::bit_cast<std::conditional_t<sizeof(S) == 4, std::uint32_t, std::uint64_t>>(x);
}

/// Of any size, and now and then one of the odd ones.
template <class S>
S wild(Random& random) {
    constexpr auto range = std::numeric_limits<S>::max_exponent10;
    const std::array<S, 8> odd{0,
                               -S(0),
                               std::numeric_limits<S>::infinity(),
                               -std::numeric_limits<S>::infinity(),
                               std::numeric_limits<S>::quiet_NaN(),
                               std::numeric_limits<S>::denorm_min(),
                               (std::numeric_limits<S>::max)(),
                               1};
    if (random.chance(0.3)) return odd[static_cast<std::size_t>(random.index(8))];
    return static_cast<S>(random.number(-1.0, 1.0) * std::pow(10.0, random.number(-range + 2.0, range - 2.0)));
}

template <class S>
Numbers<S> wild_numbers(Random& random) {
    Numbers<S> numbers;
    for (S& number : numbers) number = wild<S>(random);
    return numbers;
}

template <class S>
MEMBRANE_NOINLINE void write(S& number, S value) {
    number = value;
}

template <class S>
MEMBRANE_NOINLINE Lanes<S> all_before_write(S& number) {
    const Lanes<S> lanes = number;
    write(number, S(-1));
    return lanes;
}

template <class S>
MEMBRANE_NOINLINE Lanes<S> each_before_write(S& number) {
    return Lanes<S>::of([&](std::size_t i) {
        write(number, static_cast<S>(i));
        return number;
    });
}

template <class S>
bool same(S a, S b) {
    return bits(a) == bits(b) || (std::isnan(a) && std::isnan(b));  // which NaN is for the processor to say
}

}  // namespace

TEMPLATE_TEST_CASE("every lane comes to what its number would by itself", "[lanes]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto x = wild_numbers<S>(random), y = wild_numbers<S>(random);
        const auto a = Lanes<S>::load(x.data()), b = Lanes<S>::load(y.data());
        bool below = false;
        for (std::size_t i = 0; i < x.size(); ++i) {
            CAPTURE(i, x[i], y[i]);
            REQUIRE(same((a + b)[i], x[i] + y[i]));
            REQUIRE(same((a - b)[i], x[i] - y[i]));
            REQUIRE(same((a * b)[i], x[i] * y[i]));
            REQUIRE(same((a / b)[i], x[i] / y[i]));
            REQUIRE(same((-a)[i], -x[i]));
            REQUIRE(same(sqrt(a)[i], std::sqrt(x[i])));
            REQUIRE(same(select(a < b, a, b)[i], select(x[i] < y[i], x[i], y[i])));
            REQUIRE(same(select(a > b, a, b)[i], select(x[i] > y[i], x[i], y[i])));
            REQUIRE(same(select(a >= b, a, b)[i], select(x[i] >= y[i], x[i], y[i])));
            REQUIRE(same(select(a <= b, a, b)[i], select(x[i] <= y[i], x[i], y[i])));
            REQUIRE(((bits(a < b) >> i) & 1) == (x[i] < y[i] ? 1 : 0));
            REQUIRE(same(abs(a)[i], std::abs(x[i])));
            REQUIRE(same(select(a != b, a, b)[i], select(x[i] != y[i], x[i], y[i])));
            REQUIRE(same(select((a > b) & (b != 0), a, b)[i], x[i] > y[i] && y[i] != 0 ? x[i] : y[i]));
            REQUIRE(same(larger(a, b)[i], (std::max)(x[i], y[i])));
            REQUIRE(same(smaller(a, b)[i], (std::min)(x[i], y[i])));
            below = below || x[i] < y[i];
        }
        REQUIRE(any(a < b) == below);
    }
}

TEMPLATE_TEST_CASE("a direction has length 1 or is zero, in every lane as its number has it", "[lanes]", float,
                   double) {
    using S = TestType;
    using Wide = Lanes<S>;
    Vector3<Wide> several(0, 0, 0);
    for (std::size_t i = 1; i < Wide::count; ++i) {
        for (Eigen::Index k = 0; k < 3; ++k) several[k].set(i, S(i) * S(1 + k) - 4);
    }
    const auto directions = direction_or_zero(several);
    for (std::size_t i = 0; i < Wide::count; ++i) {
        const Vector3<S> one(several[0][i], several[1][i], several[2][i]), expected = direction_or_zero(one);
        CHECK(Vector3<S>(directions[0][i], directions[1][i], directions[2][i]) == expected);
        CHECK(std::abs(norm(expected) - (i == 0 ? 0 : 1)) < 4 * std::numeric_limits<S>::epsilon());
    }
}

TEMPLATE_TEST_CASE("lanes are set one by one, all at once, and from numbers in a row", "[lanes]", float, double) {
    using S = TestType;
    Random random(1);
    const auto x = wild_numbers<S>(random);
    Lanes<S> one_by_one = 7;
    for (std::size_t i = 0; i < x.size(); ++i) {
        CHECK(one_by_one[i] == 7);
        one_by_one.set(i, x[i]);
    }
    Numbers<S> stored;
    one_by_one.store(stored.data());
    for (std::size_t i = 0; i < x.size(); ++i) CHECK(bits(stored[i]) == bits(x[i]));
    Lanes<S> sum = 1;
    sum += 2;
    sum *= 4;
    sum -= 2;
    sum /= 5;
    for (std::size_t i = 0; i < x.size(); ++i) CHECK(sum[i] == 2);
    for (const S all : {S(0), -S(0), wild<S>(random), std::numeric_limits<S>::infinity()}) {
        for (std::size_t i = 0; i < x.size(); ++i) CHECK(bits(Lanes<S>(all)[i]) == bits(all));
    }
    CHECK_FALSE(any(sum != 2));
    CHECK(any(sum >= 2));
    CHECK(any(true));
    CHECK_FALSE(any(false));
}

TEMPLATE_TEST_CASE("a lane keeps its number when the memory it came from changes", "[lanes]", float, double) {
    using S = TestType;
    S number = 7;
    const auto all = all_before_write(number), each = each_before_write(number);
    for (std::size_t i = 0; i < Lanes<S>::count; ++i) {
        CHECK(all[i] == 7);
        CHECK(each[i] == static_cast<S>(i));
    }
}

TEMPLATE_TEST_CASE("masks are joined lane by lane", "[lanes]", float, double) {
    using S = TestType;
    constexpr std::size_t lanes = Lanes<S>::count;
    for (unsigned a = 0; a < 1U << lanes; ++a) {
        for (unsigned b = 0; b < 1U << lanes; b += lanes == 8 ? 7 : 1) {
            Lanes<S> first = S(0), second = S(0);
            for (std::size_t i = 0; i < lanes; ++i) {
                first.set(i, (a >> i & 1) != 0 ? S(1) : S(0));
                second.set(i, (b >> i & 1) != 0 ? S(1) : S(0));
            }
            const auto x = first > 0, y = second > 0;
            const unsigned every = (1U << lanes) - 1;
            REQUIRE(bits(x) == a);
            REQUIRE(bits(x & y) == (a & b));
            REQUIRE(bits(x | y) == (a | b));
            REQUIRE(bits(!x) == (~a & every));
            REQUIRE(any(x) == (a != 0));
            REQUIRE(all(x) == (a == every));
        }
    }
}
