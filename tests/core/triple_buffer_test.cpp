// SPDX-License-Identifier: MIT
#include <membrane/core/triple_buffer.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

TEST_CASE("the reader takes the newest slot, and the writer gets back the slot without an owner", "[core]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        TripleBuffer<int> buffer(-1);
        int published = -1, taken = -1;
        for (int i = 0; i < 200; ++i) {
            if (random.chance(0.5)) {
                buffer.back() = i;
                REQUIRE(buffer.publish() == (taken == published));
                // What comes back is what was not taken, or what the reader has given back.
                if (taken != published) REQUIRE(buffer.back() == published);
                published = i;
            } else {
                REQUIRE(buffer.acquire() == (taken != published));
                taken = published;
            }
            REQUIRE(buffer.front() == taken);
            REQUIRE(&buffer.back() != &buffer.front());
        }
    }
}

TEST_CASE("a triple buffer takes any slot type, keeps threads apart, and throws nothing", "[core]") {
    TripleBuffer<std::optional<int>> buffer;
    CHECK_FALSE(buffer.front().has_value());
    CHECK_FALSE(buffer.acquire());
    STATIC_REQUIRE(noexcept(buffer.publish())&& noexcept(buffer.acquire())&& noexcept(buffer.back()));
    STATIC_REQUIRE_FALSE(std::is_copy_constructible_v<TripleBuffer<int>> ||
                         std::is_move_assignable_v<TripleBuffer<int>>);
    STATIC_REQUIRE(sizeof(TripleBuffer<int>) == std::size_t{6} * 64);
}
