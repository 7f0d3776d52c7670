// SPDX-License-Identifier: MIT
#include <membrane/core/field.hpp>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;

namespace {

template <class S>
std::vector<S> expand(const Field<S>& field, Index count, bool allow_zero = true) {
    return field.expand(count, "Part", "stiffness", "spring", "N/m", allow_zero);
}

template <class S>
std::string refusal(const Field<S>& field, Index count, bool allow_zero = true) {
    return test::refusal([&] { (void)expand(field, count, allow_zero); });
}

}  // namespace

TEMPLATE_TEST_CASE("a field is one number for all, or each its own", "[core]", double, float) {
    using S = TestType;
    CHECK(expand(Field<S>(S(8.5)), 3) == std::vector<S>(3, S(8.5)));
    CHECK(expand(Field<S>(S(8.5)), 0).empty());
    const std::vector<S> numbers{1, 0, S(2.5), std::numeric_limits<S>::max(), std::numeric_limits<S>::denorm_min()};
    CHECK(expand(Field<S>(numbers), 5) == numbers);
    CHECK(expand(Field<S>(std::span<const S>(numbers)), 5) == numbers);
    CHECK(expand(Field<S>(std::vector<S>{S(4)}), 1) == std::vector<S>{S(4)});
    CHECK(expand(Field<S>(std::vector<S>{}), 0).empty());
}

TEMPLATE_TEST_CASE("a field knows whether it was given", "[core]", double, float) {
    using S = TestType;
    CHECK_FALSE(Field<S>().given());
    CHECK(Field<S>(S(0)).given());
    CHECK(Field<S>(std::vector<S>{1, 2}).given());
    struct Options {
        Field<S> stiffness;
        Field<S> viscosity = 0;
    };
    const Options options{.stiffness = std::vector<S>{1, 2}};
    CHECK(options.stiffness.given());
    CHECK(expand(options.viscosity, 2) == std::vector<S>(2, 0));
    CHECK(expand(Options{.stiffness = 40}.stiffness, 1) == std::vector<S>{40});
}

TEMPLATE_TEST_CASE("a field of another length is refused", "[core][bad]", double, float) {
    using S = TestType;
    const std::string expected = "Part: stiffness must be one number or one for each spring (4), got ";
    for (const std::size_t length : {1U, 3U, 5U, 100U}) {
        CHECK(refusal(Field<S>(std::vector<S>(length, S(1))), 4) == expected + std::to_string(length));
    }
    CHECK(refusal(Field<S>(std::vector<S>{}), 4) == expected + "0");
    CHECK(refusal(Field<S>(), 4) == expected + "0");
}

TEMPLATE_TEST_CASE("numbers that no field may have are refused by name", "[core][bad]", double, float) {
    using S = TestType;
    const S infinity = std::numeric_limits<S>::infinity();
    for (const auto& [wrong, text] : {std::pair<S, std::string>{S(-3), "-3"},
                                      {infinity, "inf"},
                                      {-infinity, "-inf"},
                                      {std::numeric_limits<S>::quiet_NaN(), "nan"}}) {
        CHECK(refusal(Field<S>(wrong), 4) == "Part: stiffness must be finite and not negative [N/m], got " + text);
        CHECK(refusal(Field<S>(wrong), 4, false) == "Part: stiffness must be finite and positive [N/m], got " + text);
        for (int seed = 1; seed <= 20; ++seed) {
            CAPTURE(seed);
            test::Random random(static_cast<std::uint64_t>(seed));
            const Index count = 1 + random.index(30), bad = random.index(count);
            std::vector<S> numbers(static_cast<std::size_t>(count), S(1));
            numbers[static_cast<std::size_t>(bad)] = wrong;
            const std::string where = "Part: stiffness of spring " + std::to_string(bad);
            CHECK(refusal(Field<S>(numbers), count) == where + " must be finite and not negative [N/m], got " + text);
            CHECK(refusal(Field<S>(numbers), count, false) ==
                  where + " must be finite and positive [N/m], got " + text);
        }
    }
    CHECK(refusal(Field<S>(S(0)), 4).empty());
    CHECK(refusal(Field<S>(-S(0)), 4).empty());
    CHECK(refusal(Field<S>(S(0)), 4, false) == "Part: stiffness must be finite and positive [N/m], got 0");
    CHECK(refusal(Field<S>(std::vector<S>{1, 0}), 2, false) ==
          "Part: stiffness of spring 1 must be finite and positive [N/m], got 0");
}
