// SPDX-License-Identifier: MIT
#include <membrane/certify/error_report.hpp>

#include <limits>

#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

TEST_CASE("nothing is known until something is", "[error_bound]") {
    const ErrorReport report;
    CHECK_FALSE(report.certified());
    CHECK(report.status == BoundStatus::invalid_input);
    CHECK(report.position == std::numeric_limits<double>::infinity());
    CHECK(report.estimate == std::numeric_limits<double>::infinity());
    CHECK(report.reactions.empty());
    CHECK(ForceEnclosure{}.max_distance_to(Vector3<double>(1, 2, 3)) == std::numeric_limits<double>::infinity());
}

TEMPLATE_TEST_CASE("no force that is enclosed is farther off than said", "[error_bound]", TEST_SCALARS) {
    test::Random random(1);
    for (int i = 0; i < 1000; ++i) {
        CAPTURE(i);
        const ForceEnclosure force{random.vector<double>(), random.number(0.0, 0.1)};
        const Vector3<TestType> given = random.vector<TestType>();
        const double farthest = force.max_distance_to(given);
        for (int k = 0; k < 10; ++k) {
            const Vector3<double> within = force.centre + force.radius * random.unit_vector();
            CHECK(norm<double>(given.template cast<double>() - within) <= farthest + 1e-15);
        }
        CHECK(farthest <= norm<double>(given.template cast<double>() - force.centre) * (1 + 1e-14) + force.radius);
    }
}

TEST_CASE("a status of a bound has the name that it has in a program", "[bound]") {
    CHECK(to_string(membrane::BoundStatus::certified) == "certified");
    CHECK(to_string(membrane::BoundStatus::not_convex) == "not_convex");
    CHECK(to_string(membrane::BoundStatus::not_converged) == "not_converged");
    CHECK(to_string(membrane::BoundStatus::contact) == "contact");
    CHECK(to_string(membrane::BoundStatus::unsupported) == "unsupported");
    CHECK(to_string(membrane::BoundStatus::invalid_input) == "invalid_input");
}
