// SPDX-License-Identifier: MIT
#include <membrane/model/volume_springs.hpp>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

static_assert(FoundationModel<NoFoundation, float> && FoundationModel<NoFoundation, double>);
static_assert(FoundationModel<VirtualVolumeSprings<double>, double>);

namespace {

/// (5) as it is printed: u the spring from its fixed to its moving end, v the velocity of the moving end.
template <class S>
Vector3<S> printed(S k, S d, const Vector3<S>& u, const Vector3<S>& v) {
    const S length = u.norm();
    return -(k * length + d * (v.dot(u) / length)) * u / length;
}

/// The velocity along `u` at which its length comes from that of `before` in a tick.
template <class S>
Vector3<S> velocity_along(const Vector3<S>& u, const Vector3<S>& before, S dt) {
    return (u.norm() - before.norm()) / dt * u.normalized();
}

}  // namespace

TEMPLATE_TEST_CASE("a volume spring pulls as (5) says", "[network]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 0});
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::vector<S> stiffness(12), damping(12);
        for (S& k : stiffness) k = random.number<S>(0, 10);
        for (S& d : damping) d = random.chance(0.3) ? S(0) : random.number<S>(0, 1);
        const VirtualVolumeSprings foundation(mesh, {.stiffness = stiffness, .damping = damping});
        const Index v = random.index(12);
        const S k = foundation.stiffness(v), d = foundation.damping(v), dt = random.number<S>(S(0.01), 1);
        REQUIRE(k == stiffness[static_cast<std::size_t>(v)]);
        REQUIRE(d == damping[static_cast<std::size_t>(v)]);
        const Vector3<S> anchor = point(mesh.positions(), v);
        const Vector3<S> start = anchor + random.vector<S>(), now = start + S(0.3) * random.vector<S>();
        const S tolerance = 30 * std::numeric_limits<S>::epsilon() * (1 + k + d / dt);

        const auto pull = foundation.force_on(v, now, start, dt);
        const Vector3<S> here = now - anchor, there = start - anchor;
        REQUIRE(norm<S>(pull.force - printed<S>(k, d, here, velocity_along<S>(here, there, dt))) <= tolerance);
        REQUIRE(pull.stiffness == Approx(k + d / dt));
        // At a standstill there is no damping.
        REQUIRE(norm<S>(foundation.force_on(v, now, now, dt).force + k * (now - anchor)) <= tolerance);
    }
}

TEST_CASE("over a short tick the damping is by the velocity along the spring, as it is printed", "[network]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 3.0, .damping = 0.5});
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<double> anchor = point(mesh.positions(), 0), velocity = random.vector();
        const Vector3<double> now = anchor + random.number(0.1, 1.0) * random.unit_vector();
        const double dt = 1e-5;
        const auto pull = foundation.force_on(0, now, now - dt * velocity, dt);
        REQUIRE(norm<double>(pull.force - printed<double>(3, 0.5, now - anchor, velocity)) < 1e-4);
    }
}

TEST_CASE("the damping force is the negative gradient of what damping takes", "[network]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const double dt = 0.1, damping = 0.5, h = 1e-5;
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.0, .damping = damping});
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<double> anchor = point(mesh.positions(), 0), start = anchor + random.vector();
        const Vector3<double> now = anchor + random.number(0.1, 1.0) * random.unit_vector();
        const auto taken = [&](const Vector3<double>& at) {
            const double change = (at - anchor).norm() - (start - anchor).norm();
            return damping / (2 * dt) * change * change;
        };
        for (int k = 0; k < 3; ++k) {
            const Vector3<double> by = h * Vector3<double>::Unit(k);
            const double slope = (taken(now + by) - taken(now - by)) / (2 * h);
            REQUIRE(std::abs(foundation.force_on(0, now, start, dt).force[k] + slope) < 1e-7);
        }
    }
}

TEST_CASE("without damping the force is the negative gradient of the energy", "[network]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    Random random(2);
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 3.0});
    const double h = 1e-4;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const Vector3<double> here = random.vector();
        Vector3<double> difference;
        for (int k = 0; k < 3; ++k) {
            const Vector3<double> by = h * Vector3<double>::Unit(k);
            difference[k] = -(foundation.energy(v, here + by) - foundation.energy(v, here - by)) / (2 * h);
        }
        REQUIRE(norm<double>(foundation.force_on(v, here, random.vector(), 0.1).force - difference) < 1e-10);
    }
}

TEMPLATE_TEST_CASE("a spring without length does not act", "[network]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = S(3), .damping = S(2)});
    const Vector3<S> anchor = point(mesh.positions(), 4);
    for (const Vector3<S>& start : {anchor, Vector3<S>(5, 5, 5)}) {
        const auto pull = foundation.force_on(4, anchor, start, S(0.1));
        CHECK(pull.force == Vector3<S>(0, 0, 0));
        CHECK(pull.stiffness == Approx(23));
    }
    CHECK(foundation.energy(4, anchor) == 0);
    // However short it is, the force is a number.
    for (S length = 1; length > 0; length /= 16) {
        const Vector3<S> place = anchor + Vector3<S>(length, 0, 0);
        CHECK(is_finite(foundation.force_on(4, place, Vector3<S>(0, 0, 0), S(1e-3)).force));
    }
}

TEST_CASE("a volume spring without constants does not act", "[network]") {
    const VolumeSpring<double> none;
    CHECK(none.force_on({1, 2, 3}).force == Vector3<double>::Zero());
    CHECK(none.force_on({1, 2, 3}).stiffness == 0);
}

TEMPLATE_TEST_CASE("no volume springs, no pull", "[network]", TEST_SCALARS) {
    using S = TestType;
    const auto pull = NoFoundation{}.force_on<S>(3, {1, 2, 3}, {4, 5, 6}, S(0.1));
    CHECK(pull.force == Vector3<S>(0, 0, 0));
    CHECK(pull.stiffness == 0);
    STATIC_REQUIRE(std::is_empty_v<NoFoundation>);
}

TEMPLATE_TEST_CASE("beside springs that damp, one that does not is as it is alone", "[network]", TEST_SCALARS) {
    using Wide = Lanes<TestType>;
    const auto lanes = [](auto number_of) { return Wide::of([&](std::size_t i) { return TestType(number_of(i)); }); };
    VolumeSpring<Wide> springs;
    springs.stiffness = lanes([](std::size_t) { return 3; });
    springs.rate = lanes([](std::size_t i) { return i; });  // none in the first
    const auto position = lanes([](std::size_t i) { return 1 + i; });
    const auto force = springs.force_on({position, position, position}).force;
    for (std::size_t i = 0; i < Wide::count; ++i) {
        const VolumeSpring<TestType> alone{.stiffness = 3, .rate = TestType(i)};
        const auto number = TestType(1 + i);
        CHECK(force[0][i] == alone.force_on({number, number, number}).force[0]);
    }
}

TEST_CASE("volume springs own what they know", "[network]") {
    auto mesh = std::make_unique<TriangleMesh<double>>(icosphere({.radius = 1, .subdivisions = 0}));
    auto first = std::make_unique<VirtualVolumeSprings<double>>(
        *mesh, VolumeSpringOptions<double>{.stiffness = 3, .damping = 1});
    const auto expected = first->force_on(7, {1, 2, 3}, {0, 0, 0}, 0.5).force;
    mesh.reset();
    const auto copy = *first;
    const auto moved = std::move(*first);
    first.reset();
    CHECK(copy.force_on(7, {1, 2, 3}, {0, 0, 0}, 0.5).force == expected);
    CHECK(moved.force_on(7, {1, 2, 3}, {0, 0, 0}, 0.5).force == expected);
}

TEMPLATE_TEST_CASE("volume springs that make no sense are refused by name", "[network][bad]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 0});
    const auto refused = [&](const VolumeSpringOptions<S>& options) {
        return test::refusal([&] { VirtualVolumeSprings(mesh, options); });
    };
    const std::string name = "VirtualVolumeSprings: ";
    CHECK(refused({}) == name + "stiffness [N/m] is required");
    CHECK(refused({.stiffness = S(0)}) == "");
    CHECK(refused({.stiffness = std::vector<S>(11, 1)}) ==
          name + "stiffness must be one number or one for each vertex (12), got 11");
    CHECK(refused({.stiffness = S(1), .damping = std::vector<S>(30, 1)}) ==
          name + "damping must be one number or one for each vertex (12), got 30");
    for (const auto& [wrong, text] : {std::pair<S, std::string>{S(-3), "-3"},
                                      {std::numeric_limits<S>::infinity(), "inf"},
                                      {std::numeric_limits<S>::quiet_NaN(), "nan"}}) {
        std::vector<S> each(12, 1);
        each[11] = wrong;
        CHECK(refused({.stiffness = wrong}) == name + "stiffness must be finite and not negative [N/m], got " + text);
        CHECK(refused({.stiffness = each}) ==
              name + "stiffness of vertex 11 must be finite and not negative [N/m], got " + text);
        CHECK(refused({.stiffness = S(1), .damping = wrong}) ==
              name + "damping must be finite and not negative [N s/m], got " + text);
        CHECK(refused({.stiffness = S(1), .damping = each}) ==
              name + "damping of vertex 11 must be finite and not negative [N s/m], got " + text);
    }
}
