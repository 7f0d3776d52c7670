// SPDX-License-Identifier: MIT
#include <membrane/accuracy/constraint_term.hpp>

#include <array>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/certify/error_bound.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/catch.hpp"

using namespace membrane;

namespace {

using Kind = ConstraintTerm::Kind;

template <class C>
std::vector<ConstraintTerm> terms_of(const C& constraint) {
    std::vector<ConstraintTerm> terms;
    for_each_term(constraint, [&](const ConstraintTerm& term) { terms.push_back(term); });
    return terms;
}

/// A constraint of one's own, in the words of others.
struct Clamp {
    Index vertex, stays;
    Vector3<double> target;

    [[nodiscard]] bool valid() const noexcept { return true; }
    void begin(ConstraintContext<double>&) const noexcept {}
    [[nodiscard]] bool enforce(ConstraintContext<double>&) const noexcept { return false; }
    [[nodiscard]] Vector3<double> reaction(const ConstraintContext<double>&) const noexcept { return {0, 0, 0}; }
};
template <class Terms>
void describe(const Clamp& clamp, Terms& terms) {
    terms.add(ConstraintTerm::prescribe(clamp.vertex, clamp.target));
    terms.add(ConstraintTerm::pin(clamp.stays));
}
static_assert(DescribedConstraint<Clamp> && StaticConstraint<Clamp> && !DescribedConstraint<int>);

}  // namespace

TEST_CASE("constraints say what they hold, load and press", "[constraint_term]") {
    const Vector3<double> target(1, 2, 3), weights(0.5, 0.25, 0.25);
    const std::array<Index, 3> corners{4, 5, 6};
    const auto held = terms_of(pull(7, target));
    REQUIRE(held.size() == 1);
    CHECK((held[0].kind == Kind::prescribe_vertex && held[0].prescribes() && held[0].corners[0] == 7));
    CHECK(held[0].target == target);
    CHECK((held[0].share(0) == 1 && held[0].share(1) == 0 && held[0].share(2) == 0));

    const std::array<Index, 2> pins{3, 8};
    const auto pinned = terms_of(pin(pins));
    REQUIRE(pinned.size() == 2);
    CHECK((pinned[1].kind == Kind::pin && pinned[1].prescribes() && pinned[1].corners[0] == 8));

    const auto point = terms_of(PointAttachment<float>{0, corners, weights.cast<float>(), target.cast<float>()});
    REQUIRE(point.size() == 1);
    CHECK((point[0].kind == Kind::prescribe_point && point[0].prescribes() && point[0].corners == corners));
    CHECK((point[0].target == target && point[0].weights == weights));
    CHECK(point[0].share(1) == Approx(0.25 / 0.375));
    CHECK(terms_of(PointAttachment<double>{}).empty());

    const auto loaded = terms_of(load(corners, weights, target));
    REQUIRE(loaded.size() == 1);
    CHECK((loaded[0].kind == Kind::load && !loaded[0].prescribes() && loaded[0].force == target));

    Contact<float> contact;
    contact.phase = ContactPhase::began;
    contact.corners = corners;
    contact.gap = -0.5F;
    const auto pressed = terms_of(press(Tool<float>{.position = {1, 2, 3}, .radius = 0.25F}, contact));
    REQUIRE(pressed.size() == 1);
    CHECK((pressed[0].kind == Kind::press && !pressed[0].prescribes() && pressed[0].contact.touching()));
    CHECK((pressed[0].tool.position == target && pressed[0].tool.radius == 0.25 && pressed[0].contact.gap == -0.5));
}

TEST_CASE("Newton's method and the error bound take a constraint of one's own that describes itself",
          "[constraint_term]") {
    const auto mesh = icosphere({.radius = 0.01, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0});
    const Points<double>& x = mesh.positions();
    const Clamp clamp{7, 30, 1.001 * point(x, 7)};
    const std::array<Index, 1> stays{30};

    const auto own = equilibrium(x, mesh, network, foundation, {}, clamp);
    const auto known = equilibrium(x, mesh, network, foundation, {}, pull(7, clamp.target), pin(stays));
    REQUIRE((own.converged && known.converged));
    CHECK(own.x == known.x);
    CHECK(own.reactions[0] == known.reactions[0] + known.reactions[1]);

    ErrorBound bound(network);
    const auto error = bound.compute(own.x, network, foundation, clamp);
    REQUIRE(error.certified());
    CHECK(error.position < 1e-12);
    CHECK((error.reactions[0].centre - own.reactions[0]).norm() <= error.reactions[0].radius);
}
