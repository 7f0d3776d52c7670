// SPDX-License-Identifier: MIT
#include <membrane/model/element.hpp>

#include <array>

#include <membrane/model/mass_spring_network.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

static_assert(Element<SpringElement<float, LinearSpring>> && Element<SpringElement<double, ExponentialSpring>>);
static_assert(!Element<int> && !Element<CornerForce<double>>);

TEST_CASE("elements at a vertex add up, and bound the energy by their Hessian", "[element]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto some = [&] {
            CornerForce<double> one{random.vector(), outer<double>(random.number(0.0, 9.0), random.unit_vector()), {}};
            one.remainder = {random.number(0.0, 2.0), random.number(0.0, 2.0), random.number(0.0, 2.0)};
            return one;
        };
        const auto a = some(), b = some();
        auto both = a;
        both += b;
        const Vector3<double> by = random.vector();
        CHECK(dot<double>(both.force, by) == Approx(dot<double>(a.force, by) + dot<double>(b.force, by)));
        const double quadratic = dot<double>(by, both.hessian * by);
        CHECK(quadratic == Approx(dot<double>(by, a.hessian * by) + dot<double>(by, b.hessian * by)));
        CHECK(both.remainder.per_range == std::max(a.remainder.per_range, b.remainder.per_range));
        EnergyMajoriser<double> sum;
        add(sum, both);
        CHECK(sum.stiffness * squared_norm(by) - dot<double>(by, sum.stiffness_reduction * by) == Approx(quadratic));
        CHECK(norm<double>(sum.force - both.force) == 0);
    }
}

TEST_CASE("an instance finds its corners in the order of its element", "[element]") {
    const LinearSpring law;
    const ElementInstance<SpringElement<double, LinearSpring>> spring{{2, 0}, {&law, 3.0, 1.0}};
    Points<double> x(3, 3);
    x << 0, 1, 2, 3, 4, 5, 6, 7, 8;
    const auto where = spring.where(x);
    CHECK(norm<double>(where[0] - point(x, 2)) == 0);
    CHECK(norm<double>(where[1] - point(x, 0)) == 0);
}
