// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/replay/snapshot.hpp>

#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"
#include "support/soft_disc.hpp"

using namespace membrane;

namespace {

/// Forceps on the middle of a disc.
template <Real S>
struct HeldDisc : test::SoftDisc<S> {
    using test::SoftDisc<S>::mesh, test::SoftDisc<S>::network, test::SoftDisc<S>::foundation;

    GraspOptions options;
    QuasiStaticSolver<S> solver{network, {.layers = unlimited, .sweeps = 20}};
    AabbTree<S> tree{mesh};
    ContactTracker<S> tracker{mesh};
    Grasper<S> grasper{mesh, options};
    Points<S> x = mesh.positions();
    Tool<S> tool{.radius = S(0.5e-3)};
    Grasp<S> grasp;
    bool slips = false;

    explicit HeldDisc(const GraspOptions& with) : test::SoftDisc<S>(8), options(with) {
        move_to({0.1e-3, 0, 0.4e-3});
        tool.grasping = true;
    }
    /// Returns the force on the jaws [N].
    Vector3<double> move_to(const Vector3<double>& at) {
        tool.position = at.cast<S>();
        const auto contact = tracker.update(tree, x, tool);
        grasp = grasper.update(contact, x, tool);
        const auto report =
            solver.step(x, S(1e-3), network, foundation, press(tool, contact, grasp), pull(tool, grasp));
        REQUIRE(report.status == StepStatus::advanced);
        slips = grasper.slip(x, tool, report.reactions[1]);
        tree.refit(x, report.moved);
        return report.reactions[1].template cast<double>();
    }
    [[nodiscard]] Vector3<double> height(double up) const { return {0.1e-3, 0, 0.4e-3 + up}; }
};

}  // namespace

TEMPLATE_TEST_CASE("jaws hold up to their force, then the tissue slips at that force", "[grasper][friction]",
                   TEST_SCALARS) {
    const double holds = 2e-3, step = 2e-6;  // [N], [m]
    HeldDisc<TestType> limited({.holding_force = holds}), firm({});
    const double rounding = 1000 * std::numeric_limits<TestType>::epsilon();
    int ticks = 0, slipping = 0;
    for (int i = 0; i < 400; ++i) {
        const auto force = limited.move_to(limited.height(step * i)), by_firm = firm.move_to(firm.height(step * i));
        REQUIRE(norm(force) <= (1 + rounding) * holds);
        if (norm(by_firm) < 0.99 * holds && slipping == 0) {
            // The same, to the bit.
            REQUIRE(force == by_firm);
            REQUIRE_FALSE(limited.slips);
            ++ticks;
        }
        if (norm(by_firm) > 1.05 * holds) {
            REQUIRE(limited.slips);
            REQUIRE(norm(force) == Approx(holds).epsilon(1e-4));
            ++slipping;
        }
        REQUIRE(limited.grasp.holding());
    }
    CHECK(ticks > 50);
    CHECK(slipping > 50);

    // Held still, it stays: no creep.
    for (int i = 0; i < 100; ++i) limited.move_to(limited.height(step * 399));
    const auto before = limited.x;
    for (int i = 0; i < 1000; ++i) limited.move_to(limited.height(step * 399));
    CHECK((limited.x - before).cwiseAbs().maxCoeff() < 1e-9);
    // Lowered by a little, it sticks where it has slipped to.
    const auto lower = limited.move_to(limited.height(step * 380));
    CHECK(norm(lower) < 0.95 * holds);
    CHECK_FALSE(limited.slips);
}

TEMPLATE_TEST_CASE("what the hand gives is stored in the tissue, or taken by slip in the jaws", "[grasper][friction]",
                   TEST_SCALARS) {
    HeldDisc<TestType> pull({.holding_force = 2e-3});
    const double before = pull.stored(pull.x);
    Vector3<double> last = pull.move_to(pull.height(0)), at = pull.height(0);
    double work = 0;
    for (int i = 1; i <= 600; ++i) {
        const Vector3<double> to = pull.height(2e-6 * i);
        const auto force = pull.move_to(to);
        work -= dot<double>(to - at, force + last) / 2;
        last = force;
        at = to;
    }
    CHECK(pull.grasper.dissipated() > work / 4);
    CHECK(pull.grasper.dissipated() + pull.stored(pull.x) - before == Approx(work).epsilon(0.01));
    pull.grasper.reset();
    CHECK(pull.grasper.dissipated() == 0);
}

TEST_CASE("tissue that has slipped by the jaws' length is free until they open and close", "[grasper][friction]") {
    HeldDisc<double> pull({.holding_force = 2e-3, .jaw_length = 0.2e-3});
    double up = 0;
    while (up < 2e-3 && (up == 0 || pull.grasp.holding())) pull.move_to(pull.height(up += 2e-6));
    REQUIRE(up < 1.5e-3);
    CHECK_FALSE(pull.grasp.holding());
    for (int i = 0; i < 500; ++i) pull.move_to(pull.height(up));
    CHECK((pull.x - pull.mesh.positions()).cwiseAbs().maxCoeff() < 1e-6);
    for (int i = 0; i < 50; ++i) pull.move_to(pull.height(0));
    CHECK_FALSE(pull.grasp.holding());
    pull.tool.grasping = false;
    pull.move_to(pull.height(0));
    pull.tool.grasping = true;
    pull.move_to(pull.height(0));
    CHECK(pull.grasp.holding());
}

TEST_CASE("an attachment that holds less from now on pulls with no more than that", "[grasper][friction]") {
    HeldDisc<double> disc({});
    for (int i = 0; i < 300; ++i) disc.move_to(disc.height(1e-6 * std::min(i, 100)));
    const double before = norm(disc.move_to(disc.height(1e-4)));
    auto held = pull(disc.tool, disc.grasp);
    for (const double part : {0.7, 0.2, 0.0}) {
        held.max_force = part * before;
        const auto report = disc.solver.step(disc.x, 1e-3, disc.network, disc.foundation, held);
        CHECK(norm(report.reactions[0]) <= (1 + 1e-12) * held.max_force);
    }
}

TEST_CASE("on a body that turns with the forceps nothing slips further", "[grasper][friction]") {
    HeldDisc<double> pull({.holding_force = 2e-3});
    for (int i = 0; i < 300; ++i) pull.move_to(pull.height(2e-6 * i));
    for (int i = 0; i < 300; ++i) pull.move_to(pull.height(2e-6 * 290));
    const auto here = pull.move_to(pull.height(2e-6 * 290));
    REQUIRE_FALSE(pull.slips);
    const Vector3<double> at_rest = pull.tool.position;
    MovingBody body(pull.mesh);
    for (int i = 1; i <= 100; ++i) {
        const double angle = 0.01 * i;
        Eigen::Matrix3d rotation;
        rotation << std::cos(angle), 0, std::sin(angle), 0, 1, 0, -std::sin(angle), 0, std::cos(angle);
        const RigidFrame<double> pose{.rotation = rotation, .origin = {1e-5 * i, 0, 0}};
        REQUIRE(body.move_to(pose, pull.x));
        pull.tree.refit(pull.x);
        pull.tool.position = pose.point_to_world(at_rest);
        const auto contact = pull.tracker.update(pull.tree, pull.x, pull.tool, body);
        const auto grasp = pull.grasper.update(contact, pull.x, pull.tool, body);
        const auto report = pull.solver.step(pull.x, 1e-3, pull.network, on(body, pull.foundation),
                                             press(pull.tool, contact, grasp), membrane::pull(pull.tool, grasp));
        REQUIRE(report.status == StepStatus::advanced);
        CHECK_FALSE(pull.grasper.slip(pull.x, pull.tool, report.reactions[1]));
        REQUIRE(norm<double>(report.reactions[1] - pose.vector_to_world(here)) < 1e-3 * norm(here));
    }
}

TEST_CASE("slipping forceps are restored from a snapshot to the same bits", "[grasper][friction]") {
    HeldDisc<double> pull({.holding_force = 2e-3, .jaw_length = 0.3e-3});
    int tick = 0;
    while (!pull.slips && tick < 400) pull.move_to(pull.height(2e-6 * ++tick));
    REQUIRE(pull.slips);
    REQUIRE(pull.grasp.holding());
    std::vector<std::byte> buffer(snapshot_capacity(pull.solver, pull.tracker, pull.grasper, pull.x));
    const auto size = save_snapshot(buffer, pull.solver, pull.tracker, pull.grasper, pull.x);
    const auto go_on = [&] {
        std::vector<Vector3<double>> forces;
        for (int i = 1; i <= 250; ++i) forces.push_back(pull.move_to(pull.height(2e-6 * (tick + i))));
        return forces;
    };
    const auto first = go_on();
    CHECK_FALSE(pull.grasp.holding());
    REQUIRE(restore_snapshot({buffer.data(), size}, pull.solver, pull.tracker, pull.grasper, pull.x));
    pull.tree.refit(pull.x);
    CHECK(go_on() == first);
}

TEST_CASE("a grasper refuses forces and lengths that are not positive", "[grasper]") {
    const auto mesh = disc<double>({.radius = 1, .rings = 2});
    const auto refused = [&](const GraspOptions& options) {
        return test::refusal([&] { Grasper<double>(mesh, options); });
    };
    CHECK(refused({.holding_force = 0}) == "Grasper: holding_force must be positive [N], got 0");
    CHECK(refused({.jaw_length = -1}) == "Grasper: jaw_length must be positive [m], got -1");
    CHECK(refused({.holding_force = std::numeric_limits<double>::quiet_NaN()}).substr(0, 32) ==
          "Grasper: holding_force must be p");
    CHECK(refused({}).empty());
}
