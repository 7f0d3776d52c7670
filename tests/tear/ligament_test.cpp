// SPDX-License-Identifier: MIT
#include <membrane/tear/ligament.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

TEST_CASE("a ligament takes the work that opens it, however often it closes", "[tear]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Ligament<double> ligament{0, 1, {1, 0, 0}, random.number(0.1, 3.0)};
        ligament.failure_opening = random.number(0.5, 2.0);
        ligament.plateau = random.index(2) == 0 ? 0 : random.number(0.0, 1.0) * ligament.failure_opening;
        const double energy = ligament.strength * (ligament.plateau + ligament.failure_opening) / 2;
        double opening = 0, work = 0, end = 0;
        for (int n = 0; n < 600; ++n) {
            const double step = random.number(-0.01, 0.015) * ligament.failure_opening;
            const double next = std::max(opening + step, 0.0);
            constexpr int parts = 40;  // its law has corners
            for (int i = 0; i < parts; ++i)
                work += ligament.tension(opening + (i + 0.5) / parts * (next - opening)) * (next - opening) / parts;
            opening = next;
            ligament.open(opening);
            end = std::max(end, opening);
            REQUIRE(ligament.reached == end);
            REQUIRE(ligament.dissipated + ligament.stored(opening) == Approx(work).epsilon(0.01).margin(1e-3 * energy));
        }
        CHECK(ligament.failed() == (ligament.largest_tension() <= ligament.strength / 10));
        if (end >= ligament.failure_opening) CHECK(ligament.dissipated == Approx(energy).epsilon(0.01));
    }
}
