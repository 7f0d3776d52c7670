// SPDX-License-Identifier: MIT
#include <Eigen/Core>

#undef NDEBUG  // the asserts are to be tested in a release build, too
#include <membrane/core/check.hpp>

#include <clocale>
#include <cmath>
#include <limits>
#include <string>

#include "support/catch.hpp"
#include "support/child_process.hpp"
#include "support/refusal.hpp"

using namespace membrane;

TEST_CASE("a refusal puts its parts together", "[core]") {
    CHECK(test::refusal([] { refuse("Part", "stiffness of spring ", 17, " must be positive [N/m], got ", -3.0); }) ==
          "Part: stiffness of spring 17 must be positive [N/m], got -3");
    CHECK(test::refusal([] { refuse("Part"); }) == "Part: ");
    CHECK(test::refusal([] { refuse(std::string("Part"), std::string("a"), std::string_view("b"), "c"); }) ==
          "Part: abc");
    CHECK(test::refusal([] { refuse("Part", 0.1, " ", 0.1F, " ", 1e300, " ", -0.0, " ", 1e-30F); }) ==
          "Part: 0.1 0.100000001 1e+300 -0 1e-30");
    const double infinity = std::numeric_limits<double>::infinity();
    CHECK(test::refusal([&] { refuse("Part", infinity, " ", -infinity, " ", std::nan("")); }) == "Part: inf -inf nan");
    CHECK(test::refusal([] {
              refuse("Part", std::numeric_limits<std::uint64_t>::max(), " ", std::numeric_limits<std::int64_t>::min(),
                     " ", std::int8_t{-5}, " ", std::size_t{7});
          }) == "Part: 18446744073709551615 -9223372036854775808 -5 7");
}

TEST_CASE("a message has its numbers with a point in any locale", "[core]") {
    const bool german = std::setlocale(LC_ALL, "de_DE.UTF-8") != nullptr;  // where there is one
    const std::string message = test::refusal([] { refuse("Part", "got ", -0.5, " and ", 12345.5F); });
    if (german) std::setlocale(LC_ALL, "C");
    CHECK(message == "Part: got -0.5 and 12345.5");
}

TEST_CASE("a refusal is an invalid argument", "[core]") {
    CHECK_THROWS_AS(refuse("Part", "x"), InvalidInput);
    CHECK_THROWS_AS(refuse("Part", "x"), std::invalid_argument);
    CHECK_THROWS_AS(refuse("Part", "x"), std::logic_error);
}

TEMPLATE_TEST_CASE("finite numbers are finite", "[core]", double, float) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    for (const S number :
         {S(0), -S(0), S(1), S(-1), Limits::min(), Limits::denorm_min(), Limits::max(), Limits::lowest()}) {
        CHECK(is_finite(number));
    }
    for (const S number : {Limits::infinity(), -Limits::infinity(), Limits::quiet_NaN(), -Limits::quiet_NaN(),
                           Limits::signaling_NaN()}) {
        CHECK_FALSE(is_finite(number));
    }
    using Any = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>;
    CHECK(is_finite(Any(0, 0)));
    Any matrix = Any::Ones(3, 5);
    CHECK(is_finite(matrix));
    for (Eigen::Index i = 0; i < matrix.size(); ++i) {
        for (const S bad : {Limits::infinity(), -Limits::infinity(), Limits::quiet_NaN()}) {
            Any changed = matrix;
            changed(i) = bad;
            REQUIRE_FALSE(is_finite(changed));
            REQUIRE_FALSE(is_finite(changed.transpose()));
            REQUIRE_FALSE(is_finite(changed.array()));
        }
    }
    matrix(2, 4) = Limits::infinity();
    CHECK(is_finite(matrix.leftCols(4)));
    CHECK_FALSE(is_finite(matrix.row(2)));
}

TEST_CASE("a broken precondition is reported and aborts", "[core]") {
    const auto reported = test::in_child([] { MEMBRANE_ASSERT(1 + 1 == 3); });
    CHECK(reported.signal == SIGABRT);
    CHECK_THAT(reported.error_output, ContainsSubstring("check_test.cpp:"));
    CHECK_THAT(reported.error_output, ContainsSubstring(": membrane: broken precondition: 1 + 1 == 3\n"));
    const auto kept = test::in_child([] { MEMBRANE_ASSERT(1 + 1 == 2); });
    CHECK(kept.signal == 0);
    CHECK(kept.code == 0);
    CHECK(kept.error_output.empty());
}

TEST_CASE("the assert handler is called with condition and place, and cannot return", "[core]") {
    const auto install = [] {
        set_assert_handler([](const char* condition, const char* file, int line) noexcept {
            std::fprintf(stderr, "handled <%s> in %s:%d", condition, file, line);
        });
    };
    const auto returned = test::in_child([&] {
        install();
        const int count = 4;
        MEMBRANE_ASSERT(count > 5);
    });
    CHECK(returned.signal == SIGABRT);
    CHECK_THAT(returned.error_output, Catch::Matchers::Matches("handled <count > 5> in .*check_test.cpp:\\d+"));

    const auto left = test::in_child([] {
        set_assert_handler([](const char*, const char*, int) noexcept { _exit(7); });
        MEMBRANE_ASSERT(false);
    });
    CHECK(left.signal == 0);
    CHECK(left.code == 7);

    const auto online = test::in_child([&] {  // aborts from code that must not throw, too
        install();
        [](int count) noexcept { MEMBRANE_ASSERT(count == 0); }(1);
    });
    CHECK(online.signal == SIGABRT);
    CHECK_THAT(online.error_output, ContainsSubstring("handled <count == 0>"));

    const auto restored = test::in_child([&] {
        install();
        set_assert_handler(nullptr);
        MEMBRANE_ASSERT(false);
    });
    CHECK_THAT(restored.error_output, ContainsSubstring("membrane: broken precondition: false"));
}

TEST_CASE("setting a handler gives back the one before", "[core]") {
    const AssertHandler on_assert = [](const char*, const char*, int) noexcept {};
    CHECK(set_assert_handler(on_assert) == nullptr);
    CHECK(set_assert_handler(nullptr) == on_assert);
    CHECK(set_assert_handler(nullptr) == nullptr);
    const InvalidInputHandler on_input = [](const char*) {};
    CHECK(set_invalid_input_handler(on_input) == nullptr);
    CHECK_THROWS_AS(refuse("Part", "x"), InvalidInput);  // exceptions come first where there are any
    CHECK(set_invalid_input_handler(nullptr) == on_input);
}

TEST_CASE("an assert evaluates its condition once", "[core]") {
    int evaluations = 0;
    MEMBRANE_ASSERT(++evaluations > 0);
    CHECK(evaluations == 1);
}
