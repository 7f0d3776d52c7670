// SPDX-License-Identifier: MIT
#include "support/wild_numbers.hpp"

#include "support/cases.hpp"
#include "support/catch.hpp"

TEMPLATE_TEST_CASE("under fast math, too, a wild number in the input comes to a safe outcome", "[fast_math][bad]",
                   TEST_SCALARS) {
    for (int seed = 1; seed <= cases(2000, 40'000); ++seed) {
        CAPTURE(seed);
        test::hand_in_wild_number<TestType>(seed);
    }
}
