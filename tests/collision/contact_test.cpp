// SPDX-License-Identifier: MIT
#include <membrane/collision/contact.hpp>

#include "support/catch.hpp"

using namespace membrane;

TEMPLATE_TEST_CASE("no contact touches nothing", "[contact]", double, float) {
    using S = TestType;
    const auto contact = Contact<S>::none();
    CHECK(contact.phase == ContactPhase::none);
    CHECK_FALSE(contact.touching());
    CHECK(contact.triangle == no_index);
    CHECK(contact.corners == std::array<Index, 3>{no_index, no_index, no_index});
    CHECK(contact.touched.empty());
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
