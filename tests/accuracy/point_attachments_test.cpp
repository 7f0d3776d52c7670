// SPDX-License-Identifier: MIT
#include <membrane/accuracy/point_attachments.hpp>

#include <cmath>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

ConstraintTerm hold(const std::array<Index, 3>& corners, const Vector3<double>& weights,
                    const Vector3<double>& target) {
    return ConstraintTerm::prescribe(corners, weights, target);
}

double off(const ConstraintTerm& place, const Points<double>& y) {
    Vector3<double> sum = -place.target;
    for (int k = 0; k < 3; ++k) sum += place.weights[k] * y.col(place.corners[static_cast<std::size_t>(k)]);
    return norm(sum);
}

}  // namespace

TEST_CASE("held points are put in their places, and what is projected leaves them there", "[point_attachments]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto one = hold({0, 3, 4}, random.barycentric(), random.vector<double>());
        const auto two = hold({5, 6, 7}, random.barycentric(), random.vector<double>());
        PointAttachments places;
        CHECK(places.add(one));
        CHECK(places.add(two));
        Points<double> y = test::jittered<double>(Points<double>::Zero(3, 9), 1, random);
        const double before = std::hypot(off(one, y) / one.weights.norm(), off(two, y) / two.weights.norm());
        CHECK(places.violation(y) >= before);
        CHECK(places.violation(y) <= before * (1 + 1e-6));
        const Points<double> start = y;
        places.project_positions(y);
        CHECK((y - start).norm() == Approx(before));  // by the shortest displacement
        CHECK(off(one, y) + off(two, y) < 1e-14);
        CHECK(places.violation(y) < 1e-13);
        Points<double> f = test::jittered<double>(Points<double>::Zero(3, 9), 1, random);
        const Points<double> whole = f;
        places.project(f);
        CHECK(std::abs(f.cwiseProduct(whole - f).sum()) < 1e-13);  // orthogonal
        CHECK(f.col(8) == whole.col(8));
        y += f;
        CHECK(off(one, y) + off(two, y) < 1e-14);
    }
}

TEST_CASE("places are independent where no corner that counts is held twice", "[point_attachments]") {
    const Vector3<double> inside(0.5, 0.3, 0.2), side(0.5, 0.5, 0), target(1, 2, 3);
    const auto independent = [](const std::vector<ConstraintTerm>& all, Index fixed) {
        PointAttachments places;
        for (const auto& place : all) places.add(place);
        return places.independent([&](Index v) { return v == fixed; });
    };
    CHECK(independent({}, 0));
    CHECK(independent({hold({0, 1, 2}, inside, target)}, 3));
    CHECK_FALSE(independent({hold({0, 1, 2}, inside, target)}, 2));
    CHECK(independent({hold({0, 1, 2}, side, target)}, 2));
    CHECK(independent({hold({0, 1, 2}, inside, target), hold({3, 4, 5}, inside, target)}, 6));
    CHECK_FALSE(independent({hold({0, 1, 2}, inside, target), hold({3, 4, 0}, inside, target)}, 6));
    CHECK(independent({hold({0, 1, 2}, inside, target), hold({3, 4, 0}, side, target)}, 6));
    CHECK_FALSE(independent({hold({0, 1, 1}, inside, target)}, 6));
}

TEST_CASE("there is capacity for as many points as a step has constraints", "[point_attachments]") {
    PointAttachments places;
    for (Index i = 0; i < 16; ++i) CHECK(places.add(hold({3 * i, 3 * i + 1, 3 * i + 2}, {1, 0, 0}, {0, 0, 0})));
    CHECK_FALSE(places.add(hold({90, 91, 92}, {1, 0, 0}, {0, 0, 0})));
    places.clear();
    CHECK(places.add(hold({0, 1, 2}, {1, 0, 0}, {0, 0, 0})));
}
