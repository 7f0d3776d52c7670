// SPDX-License-Identifier: MIT
#include <membrane/solve/constraints.hpp>

#include <array>
#include <limits>

#include "support/catch.hpp"

using namespace membrane;

namespace {

/// Returns what its fields say, and counts its calls.
struct Told {
    bool is_valid = true;
    bool violated = false;
    double force = 0;
    Index* begun;

    bool valid() const noexcept { return is_valid; }
    void begin(ConstraintContext<double>&) const noexcept { ++*begun; }
    bool enforce(ConstraintContext<double>&) const noexcept { return violated; }
    Vector3<double> reaction(const ConstraintContext<double>&) const noexcept { return {force, 0, 0}; }
};

}  // namespace

TEST_CASE("a set of constraints is valid if all are, violated if any is, finite if all forces are") {
    VertexRows<double> work(1);
    ContactState<double> contacts(1, 8);
    const Points<double> positions = Points<double>::Zero(3, 1);
    const ConstPointsRef<double> x = positions;
    work.begin_step();
    contacts.begin_step();
    const struct {
        bool pinned(Index) const { return false; }
    } none_pinned;
    ConstrainedStep<double> step(x, work, contacts, none_pinned);
    Index begun = 0;
    std::array<Vector3<double>, 2> reactions{};
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const bool first : {false, true}) {
        for (const bool second : {false, true}) {
            const Told a{first, first, first ? 1 : nan, &begun}, b{second, second, second ? 2 : nan, &begun};
            const std::array refs{ConstraintRef<double>(a), ConstraintRef<double>(b)};
            const ConstraintList<double> both(step, refs);
            CHECK(both.first_invalid() == (!first ? 0 : !second ? 1 : no_index));
            CHECK(both.enforce() == (first || second));
            CHECK(both.react(reactions) == (first && second));
            both.begin();
        }
    }
    CHECK(begun == 8);
    CHECK(reactions[0].x() == 1);
    CHECK(reactions[1].x() == 2);

    const ConstraintList<double> none(step, {});
    CHECK(none.first_invalid() == no_index);
    CHECK_FALSE(none.enforce());
    CHECK(none.react({}));
}
