// SPDX-License-Identifier: MIT
#include <membrane/contact/contact.hpp>

#include <limits>

#include "support/catch.hpp"

using namespace membrane;

TEMPLATE_TEST_CASE("no contact touches nothing", "[contact]", TEST_SCALARS) {
    using S = TestType;
    const auto contact = Contact<S>::none();
    CHECK(contact.phase == ContactPhase::none);
    CHECK_FALSE(contact.touching());
    CHECK(contact.triangle == no_index);
    CHECK(contact.corners == std::array<Index, 3>{no_index, no_index, no_index});
    CHECK(contact.patch.triangles.empty());
    CHECK(contact.patch.points.empty());
    CHECK(contact.depth == 0);
    CHECK(contact.normal == Vector3<S>(0, 0, 0));
    STATIC_REQUIRE(noexcept(Contact<S>::none()));
}

TEST_CASE("a contact touches from its beginning to before its end", "[contact]") {
    Contact<double> contact;
    for (const auto& [phase, touching] : {std::pair(ContactPhase::none, false),
                                          {ContactPhase::began, true},
                                          {ContactPhase::ongoing, true},
                                          {ContactPhase::ended, false}}) {
        contact.phase = phase;
        CHECK(contact.touching() == touching);
    }
}

TEMPLATE_TEST_CASE("a contact is valid if its numbers are, or if it touches nothing", "[contact]", TEST_SCALARS) {
    using S = TestType;
    const S bad = std::numeric_limits<S>::quiet_NaN();
    Contact<S> contact;
    contact.gap = bad;
    CHECK(is_valid(contact));
    contact.phase = ContactPhase::began;
    contact.patch.radius = 1;
    CHECK_FALSE(is_valid(contact));
    contact.gap = 0;
    CHECK(is_valid(contact));
    for (auto* numbers : {&contact.barycentric, &contact.point, &contact.normal, &contact.patch.axis_point,
                          &contact.patch.previous_axis_point}) {
        numbers->z() = bad;
        CHECK_FALSE(is_valid(contact));
        numbers->z() = 0;
    }
    for (S* number : {&contact.patch.detection_distance, &contact.patch.radius}) {
        *number = bad;
        CHECK_FALSE(is_valid(contact));
        *number = 1;
    }
    CHECK(is_valid(contact));
    contact.patch.radius = 0;
    CHECK_FALSE(is_valid(contact));
}
