// SPDX-License-Identifier: MIT
#include <membrane/core/number.hpp>

#include <type_traits>

#include "support/catch.hpp"

using namespace membrane;

namespace {

template <class Scalar>
struct Pair {
    using Each = Scalar;
};

}  // namespace

TEST_CASE("float and double are scalars, nothing else is", "[core]") {
    STATIC_REQUIRE(Real<float>);
    STATIC_REQUIRE(Real<double>);
    STATIC_REQUIRE_FALSE(Real<long double>);
    STATIC_REQUIRE_FALSE(Real<int>);
    STATIC_REQUIRE_FALSE(Real<const double>);
}

TEST_CASE("a number is a scalar, or several side by side", "[core]") {
    STATIC_REQUIRE(Number<float>);
    STATIC_REQUIRE(Number<Pair<double>>);
    STATIC_REQUIRE_FALSE(Number<long double>);
    STATIC_REQUIRE_FALSE(Number<Pair<int>>);
    STATIC_REQUIRE(std::is_same_v<Each<float>, float>);
    STATIC_REQUIRE(std::is_same_v<Each<Pair<double>>, double>);
}
