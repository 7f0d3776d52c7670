// SPDX-License-Identifier: MIT
#include <membrane/core/exact_sign.hpp>

#include <array>
#include <cmath>
#include <cstdint>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

__extension__ typedef __int128 Wide;

int sign(Wide number) { return number > 0 ? 1 : number < 0 ? -1 : 0; }

/// Three numbers below 2^36, exact in a double and, in products of three differences, in 128 bits.
std::array<std::int64_t, 3> random_place(Random& random, std::int64_t size) {
    const auto number = [&] {
        return static_cast<std::int64_t>(random.engine()() % static_cast<std::uint64_t>(2 * size + 1)) - size;
    };
    return {number(), number(), number()};
}

Vector3<double> point_of(const std::array<std::int64_t, 3>& place) {
    return {static_cast<double>(place[0]), static_cast<double>(place[1]), static_cast<double>(place[2])};
}

}  // namespace

TEST_CASE("the sign of a volume is that of whole numbers", "[core]") {
    int zeros = 0, flat = 0;
    for (int seed = 1; seed <= cases(40000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::array<std::array<std::int64_t, 3>, 4> p;
        for (auto& place : p) place = random_place(random, std::int64_t{1} << (2 + random.index(34)));
        // Often on one plane, or next to it by a unit.
        const bool planar = random.chance(0.7);
        if (planar) {
            const std::int64_t i = random.index(5) - 2, j = random.index(5) - 2;
            for (std::size_t k = 0; k < 3; ++k) p[3][k] = p[0][k] + i * (p[1][k] - p[0][k]) + j * (p[2][k] - p[0][k]);
            if (random.chance(0.5)) p[3][static_cast<std::size_t>(random.index(3))] += random.index(3) - 1;
            flat += 1;
        }
        std::array<std::array<Wide, 3>, 3> d;
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t k = 0; k < 3; ++k) d[i][k] = p[i][k] - p[3][k];
        }
        Wide volume = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            const std::size_t i = (k + 1) % 3, j = (k + 2) % 3;
            volume += d[0][k] * (d[1][i] * d[2][j] - d[1][j] * d[2][i]);
        }
        const double scale = std::ldexp(1.0, random.index(60) - 60);
        const auto at = [&](std::size_t i) { return Vector3<double>(scale * point_of(p[i])); };
        REQUIRE(sign_of_volume(at(0), at(1), at(2), at(3)) == sign(volume));
        REQUIRE(sign_of_volume(at(1), at(0), at(2), at(3)) == -sign(volume));
        zeros += volume == 0 ? 1 : 0;

        for (const int k : {0, 1, 2}) {
            const auto i = static_cast<std::size_t>((k + 1) % 3), j = static_cast<std::size_t>((k + 2) % 3);
            const Wide area = d[0][i] * d[1][j] - d[0][j] * d[1][i];
            REQUIRE(sign_of_area(at(0), at(1), at(3), k) == sign(area));
        }
    }
    CHECK(zeros > cases(5000));
    CHECK(flat > zeros);
}

TEST_CASE("signs of points a rounding apart do not contradict each other", "[core]") {
    for (int seed = 1; seed <= cases(5000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<double> a = random.vector(), b = random.vector(), c = random.vector();
        const Vector3<double> weights = random.barycentric();
        const Vector3<double> d = weights[0] * a + weights[1] * b + weights[2] * c;  // in their plane but for rounding
        const int s = sign_of_volume(a, b, c, d);
        REQUIRE(sign_of_volume(b, c, a, d) == s);
        REQUIRE(sign_of_volume(c, a, b, d) == s);
        REQUIRE(sign_of_volume(a, c, b, d) == -s);
        REQUIRE(sign_of_volume(d, b, c, a) == -s);
        REQUIRE(sign_of_volume(c, d, a, b) == s);
        REQUIRE(sign_of_volume(a, b, a, d) == 0);
    }
}

TEST_CASE("points on one line are known as such", "[core]") {
    for (const int k : {0, 1, 2}) {  // on one line as seen from both other axes
        const auto unit = [](int i) { return Vector3<double>::Unit(i % 3); };
        CHECK_FALSE(on_one_line(Vector3<double>::Zero(), unit(k + 1), unit(k + 2)));
    }
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<double> a = point_of(random_place(random, 1 << 20)), b = point_of(random_place(random, 1 << 20));
        REQUIRE(on_one_line(a, b, (a + b) / 2));
        REQUIRE(on_one_line(a, a, b));
        Vector3<double> near = (a + b) / 2;
        const int k = random.index(3);
        near[k] = std::nextafter(near[k], 1e9);
        int others = 0;
        for (const int i : {0, 1, 2}) others += i != k && a[i] != b[i] ? 1 : 0;
        if (others > 0) REQUIRE(!on_one_line(a, b, near));
    }
}
