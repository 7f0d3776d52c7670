// SPDX-License-Identifier: MIT
#include <membrane/contact/tool_side.hpp>

#include "support/catch.hpp"

using namespace membrane;

namespace {

ToolSide<double> side_of(double sign, bool slid_off) {
    ToolSide<double> side;
    if (sign != 0) side.touch(sign, true, false);
    if (slid_off) side.touch(1, false, true);
    return side;
}

}  // namespace

TEST_CASE("the side of a tool: every state, by every tick", "[tool_side]") {
    for (const double before : {-1.0, 0.0, 1.0}) {
        for (const bool slid : {false, true}) {
            CAPTURE(before, slid);
            const auto side = side_of(before, slid);
            REQUIRE(side.sign() == before);
            REQUIRE(side.known() == (before != 0));
            REQUIRE(side.slid_off() == slid);
            for (const bool first : {false, true}) {
                for (const bool second : {false, true}) {
                    CAPTURE(first, second);
                    for (const double contact : {-1.0, 1.0}) {
                        auto touched = side;
                        touched.touch(contact, first, second);
                        CHECK(touched.sign() == (before == 0 && first ? contact : before));
                        CHECK(touched.slid_off() == (slid || second));
                    }
                    auto left = side;
                    left.leave(first, second);
                    CHECK(left.sign() == (first || second ? 0 : before));
                    CHECK(left.slid_off() == (slid && !first));
                }
            }
        }
    }
}
