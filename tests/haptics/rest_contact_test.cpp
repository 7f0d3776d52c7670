// SPDX-License-Identifier: MIT
#include <membrane/haptics/rest_contact.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <membrane/certify/passivity.hpp>
#include <membrane/haptics/force_policy.hpp>
#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/membrane.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

constexpr double radius = 1e-3;  // of the tool [m]

/// A ball with hills and valleys.
template <Real S>
TriangleMesh<S> uneven_ball(Random& random, Index subdivisions, double unevenness) {
    const auto ball = icosphere<S>({.radius = S(0.01), .subdivisions = subdivisions});
    Points<S> x = ball.positions();
    for (Index v = 0; v < x.cols(); ++v) x.col(v) *= 1 + static_cast<S>(unevenness * random.number(-1.0, 1.0));
    return TriangleMesh<S>(x, ball.triangles());
}

template <Real S>
Tool<S> ball_at(const Vector3<S>& position) {
    return {.position = position, .radius = S(radius)};
}

/// A smooth closed path near the surface of a ball of 10 mm, with the tool's centre above it and below.
class ClosedPath {
  public:
    explicit ClosedPath(Random& random) : middle_(random.unit_vector()) {
        for (auto& wave : waves_) wave = random.vector(-1.5e-3, 1.5e-3);
    }

    [[nodiscard]] Vector3<double> at(double turn) const {
        Vector3<double> p = 0.01 * middle_;
        for (std::size_t k = 0; k < waves_.size(); ++k) {
            const double angle = 2 * std::numbers::pi * turn * static_cast<double>(1 + k / 2);
            p += (k % 2 == 0 ? std::sin(angle) : 1 - std::cos(angle)) * waves_[k];
        }
        return p;
    }

  private:
    Vector3<double> middle_;
    std::array<Vector3<double>, 4> waves_;
};

/// What a hand puts in along a turn, of which it should have back all: as a part of all that moves in and out.
template <class Feel>
double lost_on_a_turn(const ClosedPath& path, Feel feel) {
    constexpr int parts = 4'000;
    double sum = 0, all = 0;
    Vector3<double> p = path.at(0), force = feel(ball_at(p));
    for (int i = 1; i <= parts; ++i) {
        const Vector3<double> next = path.at(static_cast<double>(i) / parts), then = feel(ball_at(next));
        const double work = -dot<double>(force + then, next - p) / 2;
        sum += work;
        all += std::abs(work);
        p = next;
        force = then;
    }
    return all > 0 ? sum / all : 0;
}

}  // namespace

TEMPLATE_TEST_CASE("depth and normal are distance to the surface at rest and its gradient", "[rest]", TEST_SCALARS) {
    using S = TestType;
    const S rounding = S(4e-2) * std::numeric_limits<S>::epsilon();  // [m]
    for (int seed = 1; seed <= cases(20); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = uneven_ball<S>(random, 2, 0.03);
        const auto rest = RestContact(mesh);
        int felt = 0;
        for (int i = 0; i < 50; ++i) {
            CAPTURE(seed, i);
            const Vector3<S> p = static_cast<S>(random.number(0.007, 0.0115)) * random.unit_vector<S>();
            const auto contact = rest({}, ball_at(p));
            S nearest = std::numeric_limits<S>::max();
            for (Index f = 0; f < mesh.triangle_count(); ++f) {
                const auto triangle = triangle_at(mesh.positions(), mesh.triangles().col(f));
                nearest = std::min(nearest, norm<S>(closest_point(triangle, p).point - p));
            }
            REQUIRE(std::abs(std::abs(contact.gap + S(radius)) - nearest) <= rounding);
            REQUIRE(contact.touching() == (contact.gap < 0));
            if (!contact.touching()) continue;
            ++felt;
            REQUIRE(contact.depth == -contact.gap);
            REQUIRE(norm(contact.normal) == Approx(1).margin(1e-5));
            // Straight to the nearest point and away from it the distance changes by the path length.
            const S height = S(radius) - contact.depth, displacement = S(-0.5) * height;
            const auto there = rest({}, ball_at<S>(p + displacement * contact.normal));
            REQUIRE(std::abs(there.depth - (contact.depth - displacement)) <= S(3) * rounding);
            // Nowhere by more.
            const Vector3<S> aside = S(1e-3) * random.vector<S>();
            REQUIRE(std::abs(rest({}, ball_at<S>(p + aside)).gap - contact.gap) <= norm(aside) + rounding);
            // Whatever the contact with the deformed surface is like.
            Contact<S> other;
            other.phase = ContactPhase::ongoing;
            other.normal = random.unit_vector<S>();
            other.depth = S(1);
            other.patch.side = S(-1);
            REQUIRE(rest(other, ball_at(p)).normal == contact.normal);
            REQUIRE(rest(other, ball_at(p)).depth == contact.depth);
        }
        CHECK(felt > 20);
    }
}

TEST_CASE("what a spring on it takes on a closed path it gives back", "[rest]") {
    const SpringDamperForce feel{.stiffness = 100};
    int smooth_gives = 0;
    const int paths = cases(30);
    for (int seed = 1; seed <= paths; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = uneven_ball<double>(random, 2, 0.02);
        const auto rest = RestContact(mesh);
        const auto smooth = SmoothContact(mesh);
        const ClosedPath path(random);
        const StepReport<double> report{};
        CHECK(std::abs(lost_on_a_turn(path, [&](const Tool<double>& tool) {
                  return feel({tool, rest({}, tool), report});
              })) < 2e-3);
        const double other = lost_on_a_turn(path, [&](const Tool<double>& tool) {
            return feel({tool, smooth(rest({}, tool)), report});
        });
        smooth_gives += std::abs(other) > 5e-3;
    }
    CHECK(smooth_gives > paths / 4);  // another normal under the same depth is no potential
}

TEST_CASE("a shaft is felt where it is deepest, an open surface from its side and while it is touched", "[rest]") {
    const auto ball = icosphere<double>({.radius = 0.01, .subdivisions = 3});
    const auto rest = RestContact(ball);
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<double> up = random.unit_vector();
        const Vector3<double> along = direction<double>(cross<double>(up, random.unit_vector()), {1, 0, 0});
        const double height = random.number(0.0097, 0.0107);
        const Tool<double> shaft{.position = height * up - 0.008 * along, .axis = 0.016 * along, .radius = radius};
        const auto contact = rest({}, shaft);
        CHECK(contact.depth == Approx(0.011 - height).margin(1.5e-4));  // flat triangles
        CHECK(dot(contact.normal, up) > 0.98);
        CHECK(norm<double>(contact.patch.axis_point - height * up) < 3e-3);
    }

    const auto flat = RestContact(sheet<double>({.width = 0.02, .height = 0.02, .columns = 10, .rows = 10}));
    const auto at = [](double x, double z) { return ball_at<double>({x, 1e-4, z}); };
    Contact<double> above, below;
    above.phase = below.phase = ContactPhase::ongoing;
    below.patch.side = -1;
    CHECK_FALSE(flat({}, at(0, 5e-4)).touching());  // not touched
    CHECK(flat(above, at(0, 5e-4)).depth == Approx(5e-4));
    CHECK(flat(above, at(0, 5e-4)).normal.z() == Approx(1));
    CHECK(flat(above, at(0, -5e-4)).depth == Approx(1.5e-3));
    CHECK(flat(below, at(0, -5e-4)).depth == Approx(5e-4));
    CHECK(flat(below, at(0, -5e-4)).normal.z() == Approx(-1));
    CHECK(flat(above, at(0.0105, 0)).depth == Approx(5e-4));  // beyond the border, from it
    CHECK(flat(above, at(0.0105, 0)).normal.x() == Approx(1));
    CHECK_FALSE(flat(above, at(0, 2e-3)).touching());
}

TEMPLATE_TEST_CASE("what is no tool is not felt", "[rest][bad]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = S(0.01), .subdivisions = 1});
    const auto rest = RestContact(mesh);
    for (const S wild : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity()}) {
        CHECK_FALSE(rest({}, ball_at<S>({wild, 0, 0})).touching());
    }
    CHECK_FALSE(rest({}, ball_at<S>({std::numeric_limits<S>::max(), 0, 0})).touching());
    // On the surface itself, on a face, an edge and a corner, the normal is the surface's.
    const auto triangle = triangle_at(mesh.positions(), mesh.triangles().col(3));
    for (const Vector3<S>& p : {triangle.a, Vector3<S>((triangle.a + triangle.b) / 2),
                                Vector3<S>((triangle.a + triangle.b + triangle.c) / 3)}) {
        const auto contact = rest({}, ball_at<S>(p));
        CHECK(static_cast<double>(contact.depth) == Approx(radius).epsilon(1e-3));
        CHECK(norm(contact.normal) == Approx(1));
    }
    STATIC_REQUIRE(noexcept(rest(std::declval<const Contact<S>&>(), std::declval<const Tool<S>&>())));
}

TEST_CASE("in slow turns over a membrane some forces give energy, and those with a potential do not",
          "[rest][energy]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0, .damping = 0.02});
    const RestContact rest(mesh);
    const SmoothContact smooth(mesh);
    const SpringDamperForce feel{.stiffness = 100};
    const ReactionForce react;
    constexpr int ticks = 4000, turns = 2;
    constexpr double tick = 1e-3;
    // From the middle of a triangle to that of a side, up, back and down.
    const auto t = triangle_at(mesh.positions(), mesh.triangles().col(0));
    const Vector3<double> middle = (t.a + t.b + t.c) / 3, aside = (t.a + t.b) / 2 - middle, up = middle / norm(middle);
    for (const double deepest : {1e-3, 1.8e-3}) {
        QuasiStaticSolver solver(network, {.layers = 6, .sweeps = 2});
        AabbTree tree(mesh);
        ContactTracker tracker(mesh);
        auto x = mesh.positions();
        // With a damper of 0.1 N s/m, four times what the sampling of a spring of 100 N/m takes at this tick. [N s/m]
        PassivityObserver plain(0.1), smoothed(0.1), at_rest(0.1), reaction(0.1);
        for (int i = 0; i <= turns * ticks; ++i) {
            const double u = 4.0 * (i % ticks) / ticks;
            const double along = u < 1 ? u : u < 2 ? 1 : u < 3 ? 3 - u : 0;
            const double deep = deepest * (u < 1 ? 1 : u < 2 ? 1 - 0.9 * (u - 1) : u < 3 ? 0.1 : 0.1 + 0.9 * (u - 3));
            const auto tool = ball_at<double>(middle + along * aside + (radius - deep) * up);
            const auto contact = tracker.update(tree, x, tool);
            const auto report = solver.step(x, tick, network, foundation, press(tool, contact));
            tree.refit(x, report.moved);
            plain.update(tool.position, feel({tool, contact, report}), tick);
            smoothed.update(tool.position, feel({tool, smooth(contact), report}), tick);
            at_rest.update(tool.position, feel({tool, rest(contact, tool), report}), tick);
            reaction.update(tool.position, react({tool, contact, report}), tick);
        }
        INFO("energy of the hand a turn: " << plain.energy() / turns << " J, smooth " << smoothed.energy() / turns
                                           << " J, at rest " << at_rest.energy() / turns << " J, reaction "
                                           << reaction.energy() / turns << " J");
        CHECK(at_rest.energy() >= 0);
        CHECK(reaction.energy() >= 0);
        CHECK(std::abs(at_rest.energy()) / turns < 1e-6);
        CHECK(std::abs(reaction.energy()) / turns < 2e-6);
        CHECK(smoothed.energy() / turns < -3e-6);
        if (deepest == 1e-3) CHECK(plain.energy() / turns == Approx(-13.4e-6).epsilon(0.1));
    }
}

TEST_CASE("on a body that moves the contact with the surface at rest goes along", "[rest]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 2});
    const auto rest = RestContact(mesh);
    MovingBody<double> body(mesh);
    auto tree = AabbTree(mesh);
    Points<double> x = mesh.positions();
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        RigidFrame<double> pose;
        pose.rotation = random.rotation();
        pose.origin = 0.1 * random.vector();
        pose.velocity = 0.1 * random.vector();
        pose.angular_velocity = random.vector();
        REQUIRE(body.move_to(pose, x));
        tree.refit(body.anchors());
        const Vector3<double> p = random.number(0.009, 0.0112) * random.unit_vector();
        const auto still = rest({}, ball_at(p));
        const auto moved = rest({}, ball_at(pose.point_to_world(p)), tree, body);
        CHECK(moved.touching() == still.touching());
        CHECK(std::abs(moved.depth - still.depth) <= 1e-15);
        if (!still.touching()) continue;
        CHECK(norm<double>(moved.normal - pose.vector_to_world(still.normal)) <= 1e-9);
        const Vector3<double> arm = pose.vector_to_world(p);
        const Vector3<double> velocity = pose.velocity + cross<double>(pose.angular_velocity, arm);
        CHECK(norm<double>(moved.body_velocity - velocity) < 1e-12);
    }
}

TEST_CASE("on a body of another membrane there is no contact at rest", "[rest][bad]") {
    const auto rest = RestContact(icosphere<double>({.radius = 0.01, .subdivisions = 2}));
    const auto other = icosphere<double>({.radius = 0.01, .subdivisions = 1});
    const auto tool = ball_at<double>({0, 0, 0.0105});
    REQUIRE(rest({}, tool).touching());
    CHECK_FALSE(rest({}, tool, AabbTree(other), MovingBody(other)).touching());
}
