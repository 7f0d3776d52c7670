// SPDX-License-Identifier: MIT
#include <membrane/surface/time_of_impact.hpp>

#include <cmath>
#include <cstdint>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using membrane::Triangle;
using membrane::Vector3;

namespace {

Triangle<double> moved(const Triangle<double>& triangle, const Vector3<double>& displacement) {
    return {triangle.a + displacement, triangle.b + displacement, triangle.c + displacement};
}

/// A triangle whose corners move anywhere, and a point near its path.
struct RandomMotion {
    explicit RandomMotion(test::Random& random)
        : from{random.vector(), random.vector(), random.vector()},
          to{random.vector(), random.vector(), random.vector()},
          q(random.vector<double>(-0.3, 0.3)) {}

    [[nodiscard]] Triangle<double> at(double t) const {
        return {(1 - t) * from.a + t * to.a, (1 - t) * from.b + t * to.b, (1 - t) * from.c + t * to.c};
    }
    [[nodiscard]] double time_of_impact() const { return membrane::time_of_impact<double>(from, to, q); }

    Triangle<double> from, to;
    Vector3<double> q;
};

}  // namespace

TEST_CASE("a triangle that moves as a whole passes where and when a line says") {
    int passings = 0;
    for (int seed = 1; seed <= cases(20000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const Triangle<double> from{random.vector(), random.vector(), random.vector()};
        const Vector3<double> displacement = 2 * random.vector(), q = random.vector();
        // From the triangle's own view the point moves in the opposite direction, in a straight line.
        const auto hit = membrane::first_hit<double>(from, q, q - displacement);
        const double time = membrane::time_of_impact<double>(from, moved(from, displacement), q);
        const double margin = hit ? hit->barycentric.minCoeff() : 1;
        if (hit && margin < 1e-3) continue;  // by an edge: one may see it and the other not
        CAPTURE(seed, time);
        if (hit) {
            ++passings;
            REQUIRE(time < 1);
            REQUIRE(std::abs(time - hit->fraction) < 1e-6);
            REQUIRE(time <= hit->fraction + 1e-12);
        } else if (time < 1) {
            const auto at = moved(from, time * displacement);
            REQUIRE(membrane::closest_point<double>(at, q).barycentric.minCoeff() < 1e-3);
        }
    }
    REQUIRE(passings > cases(20000) / 50);
}

TEST_CASE("just before it passes, the point is still on the side it was on") {
    for (int seed = 1; seed <= cases(20000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const RandomMotion motion(random);
        const double time = motion.time_of_impact();
        const auto side = [&](double t) {
            const auto now = motion.at(t);
            const Vector3<double> a = now.a - motion.q, b = now.b - motion.q, c = now.c - motion.q;
            return a.x() * (b.y() * c.z() - b.z() * c.y()) + a.y() * (b.z() * c.x() - b.x() * c.z()) +
                   a.z() * (b.x() * c.y() - b.y() * c.x());
        };
        CAPTURE(seed, time);
        REQUIRE((time >= 0 && time <= 1));
        if (time < 1) REQUIRE(side(time) * side(time + 1e-7) < 1e-12);  // it changes here
    }
}

TEST_CASE("no passing is missed, and the unit of length does not matter") {
    int passings = 0;
    for (int seed = 1; seed <= cases(20000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const RandomMotion motion(random);
        const double time = motion.time_of_impact();
        CAPTURE(seed, time);
        for (const double unit : {0x1p-20, 0x1p20}) {
            const auto scaled = [&](const Triangle<double>& a) {
                return Triangle<double>{unit * a.a, unit * a.b, unit * a.c};
            };
            REQUIRE(membrane::time_of_impact<double>(scaled(motion.from), scaled(motion.to), unit * motion.q) == time);
        }
        const auto behind = [&](double t) {
            const auto now = motion.at(t);
            return membrane::dot<double>(motion.q - now.a, membrane::area_vector(now)) < 0;
        };
        for (int i = 0; i < 50; ++i) {
            double first = i / 50.0, last = (i + 1) / 50.0;
            if (behind(first) == behind(last)) continue;
            for (int k = 0; k < 40; ++k) {
                const double middle = (first + last) / 2;
                (behind(middle) == behind(first) ? first : last) = middle;
            }
            if (membrane::closest_point<double>(motion.at(first), motion.q).barycentric.minCoeff() < 1e-3) continue;
            ++passings;
            REQUIRE(time <= last);
            break;
        }
    }
    REQUIRE(passings > cases(20000) / 50);
}

TEST_CASE("a triangle that stays, or stays away, passes nothing") {
    const Triangle<float> triangle{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    CHECK(membrane::time_of_impact<float>(triangle, triangle, {0.2F, 0.2F, 0}) == 1);
    const Triangle<float> away{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
    CHECK(membrane::time_of_impact<float>(triangle, away, {0.2F, 0.2F, 2}) == 1);
    CHECK(membrane::time_of_impact<float>(triangle, away, {0.9F, 0.9F, 0.5F}) == 1);
    CHECK(std::abs(membrane::time_of_impact<float>(triangle, away, {0.2F, 0.2F, 0.3F}) - 0.3F) < 1e-5F);
}
