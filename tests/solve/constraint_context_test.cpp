// SPDX-License-Identifier: MIT
#include <membrane/solve/constraint_context.hpp>

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "support/catch.hpp"

using namespace membrane;

namespace {

/// Six points of which number 5 is pinned, and a capacity of three contact points.
struct SixPoints {
    bool pinned(Index v) const { return v == pinned_vertex; }

    Index pinned_vertex = 5;
    Points<double> points = Points<double>::Random(3, 6);
    ConstPointsRef<double> x{points};
    VertexRows<double> work{6};
    ContactState<double> contacts{6, 3};
    ConstrainedStep<double> step{x, work, contacts, *this};

    SixPoints() { begin_step(); }
    SixPoints(const SixPoints&) = delete;
    SixPoints& operator=(const SixPoints&) = delete;
    void begin_step() {
        work.begin_step();
        contacts.begin_step();
    }
};

ContactPoint<double> point_of(Index triangle, int feature, double force = 1) {
    return {triangle, feature, {0, 1, 2}, {0.2, 0.3, 0.5}, {0, 0, 1}, {0, 0, -force}};
}

std::vector<Index> as_vector(std::span<const Index> items) { return {items.begin(), items.end()}; }

}  // namespace

TEST_CASE("a context knows its vertices", "[context]") {
    SixPoints scene;
    ConstraintContext<double> context(scene.step);
    for (Index v = 0; v < 6; ++v) {
        CHECK(context.validate(v));
        CHECK(context.position(v) == point(scene.points, v));
    }
    CHECK(scene.step.refusal() == StepStatus::advanced);
    for (const Index wrong : {-1, 6, 1000, unlimited}) {
        ConstrainedStep<double> step(scene.x, scene.work, scene.contacts, scene);
        CHECK_FALSE(ConstraintContext<double>(step, 3).validate(wrong));
        CHECK_FALSE(ConstraintContext<double>(step, 4).validate(wrong));
        CHECK(step.refusal() == StepStatus::invalid_input);
        CHECK(step.invalid_constraint() == 3);
        step.refuse_points();
        CHECK(step.refusal() == StepStatus::invalid_input);
        step.compare_splits(-1, StepStatus::network_missed_split);
        CHECK(step.refusal() == StepStatus::network_missed_split);
    }
}

TEST_CASE("what is moved is moved in the step, and the positions of the user stay", "[context]") {
    SixPoints scene;
    ConstraintContext<double> context(scene.step);
    const Points<double> before = scene.points;
    context.move(2, {1, 0, 0});
    context.move(2, {0, 1, 0});
    context.set_position(4, {7, 8, 9});
    CHECK(norm<double>(context.position(2) - point(before, 2) - Vector3<double>(1, 1, 0)) < 1e-15);
    CHECK(context.position(4) == Vector3<double>(7, 8, 9));
    CHECK(context.start(4) == point(before, 4));
    CHECK(as_vector(scene.work.loaded.items()) == std::vector<Index>{2, 4});
    CHECK(scene.points == before);

    scene.begin_step();  // the next step
    CHECK(scene.work.loaded.empty());
    CHECK(context.position(2) == point(before, 2));
}

TEST_CASE("prescribed and pinned vertices are fixed until the step ends, and a pinned one stays", "[context]") {
    SixPoints scene;
    ConstraintContext<double> context(scene.step);
    const Points<double> before = scene.points;
    for (const Index v : {0, 1, 5}) scene.work.set_response(v, {diagonal3(0.5)}, 0.5);
    CHECK(context.fixed(5));
    CHECK_FALSE(context.fixed(1));
    context.move(1, {1, 1, 1});
    context.prescribe(1);
    context.prescribe(2, {1, 2, 3});
    context.prescribe(5, {1, 2, 3});
    CHECK(context.fixed(1));
    CHECK(context.fixed(2));
    CHECK(context.prescribed(1));
    CHECK_FALSE(context.prescribed(0));
    CHECK(context.position(1) == point(before, 1));
    CHECK(context.position(2) == Vector3<double>(1, 2, 3));
    CHECK(context.position(5) == point(before, 5));
    context.prescribe(2);  // without a target it stays
    CHECK(context.position(2) == Vector3<double>(1, 2, 3));
    CHECK(context.compliance(0) == 0.5);
    CHECK(context.compliance(1) == 0);
    CHECK(context.compliance(5) == 0);
    CHECK(context.response(0, {2, 0, 0}) == Vector3<double>(1, 0, 0));
    CHECK(context.response(1, {2, 0, 0}) == Vector3<double>(0, 0, 0));
    scene.begin_step();
    CHECK_FALSE(context.fixed(1));
    CHECK_FALSE(context.prescribed(1));
    CHECK(context.fixed(5));
}

TEST_CASE("forces add up, and are taken back with the step", "[context]") {
    SixPoints scene;
    ConstraintContext<double> context(scene.step);
    context.add_force(3, {1, 2, 3});
    context.add_force(3, {1, 0, 0});
    context.add_force(0, {0, 0, 5});
    context.add_stiffness(0, 4);
    context.add_stiffness(0, -1);
    const auto force = [&](Index v) { return scene.work.row(scene.work.force, v); };
    CHECK(force(3).point() == Vector3<double>(2, 2, 3));
    CHECK(force(0).point() == Vector3<double>(0, 0, 5));
    CHECK(force(0).extra() == 0);
    CHECK(scene.work.added_stiffness[0] == 3);
    scene.begin_step();
    for (Index v = 0; v < 6; ++v) CHECK(force(v).number == std::array<double, 4>{});
    CHECK(scene.work.added_stiffness == std::vector<double>(7, 0.0));
}

TEST_CASE("forces and stiffnesses that are added, either alone too, last until the step ends", "[context]") {
    SixPoints scene;
    ConstraintContext<double> context(scene.step);
    context.add_force(1, {1, 2, 3});
    for (const Index v : {2, 2, 4}) context.add_stiffness(v, 0.5);
    CHECK(as_vector(scene.work.forced.items()) == std::vector<Index>{1, 2, 4});
    CHECK(scene.work.constraint_force(1) == Vector3<double>(1, 2, 3));
    CHECK(scene.work.added_stiffness == std::vector<double>{0, 0, 1, 0, 0.5, 0, 0});
    scene.begin_step();
    CHECK(scene.work.constraint_force(1) == Vector3<double>(0, 0, 0));
    CHECK(scene.work.added_stiffness == std::vector<double>(7, 0));
}

TEST_CASE("seeds keep their order, and each comes once", "[context]") {
    SixPoints scene;
    ConstraintContext<double> context(scene.step);
    for (const Index v : {4, 0, 4, 2, 0}) context.seed(v);
    CHECK(as_vector(scene.work.seeds.items()) == std::vector<Index>{4, 0, 2});
}

TEST_CASE("each constraint finds the points it had in the step before, and no others", "[context]") {
    SixPoints scene;
    ConstraintContext<double> context(scene.step, 0), second(scene.step, 1), third(scene.step, 2);
    scene.contacts.begin_points(0);
    CHECK(context.cached_point(7, 0, 0) == nullptr);
    context.add_point(point_of(7, 0, 1));
    context.add_point(point_of(8, 2, 2));
    scene.contacts.begin_points(1);
    second.add_point(point_of(7, 0, 3));
    CHECK(second.points().size() == 1);
    CHECK(second.points()[0].force.z() == -3);
    CHECK(context.points().size() == 2);
    CHECK(context.points()[1].triangle == 8);
    CHECK(context.cached_point(7, 0, 0) == nullptr);  // they are of this step
    CHECK(scene.step.refusal() == StepStatus::advanced);

    scene.contacts.end_step();
    scene.begin_step();
    scene.contacts.begin_points(0);
    CHECK(context.points().empty());
    for (const int round : {1, 2}) {  // in any order, and again
        CAPTURE(round);
        REQUIRE(context.cached_point(8, 2, 0) != nullptr);
        CHECK(context.cached_point(8, 2, 0)->force.z() == -2);
        REQUIRE(context.cached_point(7, 0, 0) != nullptr);
        CHECK(context.cached_point(7, 0, 0)->force.z() == -1);
        CHECK(context.cached_point(8, 0, 0) == nullptr);
        CHECK(context.cached_point(9, 2, 0) == nullptr);
    }
    REQUIRE(second.cached_point(7, 0, 0) != nullptr);
    CHECK(second.cached_point(7, 0, 0)->force.z() == -3);
    CHECK(second.cached_point(8, 2, 0) == nullptr);
    CHECK(third.cached_point(7, 0, 0) == nullptr);

    scene.contacts.end_step();  // a step without points
    scene.begin_step();
    scene.contacts.begin_points(0);
    CHECK(context.cached_point(7, 0, 0) == nullptr);
}

TEST_CASE("points can be forgotten, and are refused beyond the capacity", "[context]") {
    SixPoints scene;
    ConstraintContext<double> context(scene.step);
    scene.contacts.begin_points(0);
    for (Index f = 0; f < 3; ++f) context.add_point(point_of(f, 0));
    CHECK(scene.step.refusal() == StepStatus::advanced);
    context.add_point(point_of(3, 0));
    CHECK(scene.step.refusal() == StepStatus::too_many_contact_points);
    CHECK(context.points().size() == 3);
    scene.contacts.end_step();
    scene.begin_step();
    scene.contacts.begin_points(0);
    CHECK(context.cached_point(1, 0, 0) != nullptr);
    scene.contacts.reset_points();
    CHECK(context.cached_point(1, 0, 0) == nullptr);
}

TEST_CASE("whether a vertex that is not loaded is pinned is the network's word", "[context]") {
    SixPoints scene;
    scene.pinned_vertex = 2;
    const ConstraintContext<double> context(scene.step);
    CHECK(context.fixed(2));
    scene.pinned_vertex = 3;
    CHECK_FALSE(context.fixed(2));
    CHECK(context.fixed(3));
}

TEST_CASE("a state is copied with all it holds", "[context]") {
    auto scene = std::make_unique<SixPoints>();
    {
        scene->contacts.begin_points(0);
        ConstraintContext<double>(scene->step).add_point(point_of(7, 0, 4));
        scene->contacts.end_step();
    }
    VertexRows<double> copy = scene->work;
    ContactState<double> contacts = scene->contacts;
    Points<double> points = scene->points;
    scene.reset();
    const ConstPointsRef<double> x(points);
    const SixPoints pins;
    ConstrainedStep<double> step(x, copy, contacts, pins);
    ConstraintContext<double> context(step);
    copy.begin_step();
    contacts.begin_step();
    contacts.begin_points(0);
    REQUIRE(context.cached_point(7, 0, 0) != nullptr);
    CHECK(context.cached_point(7, 0, 0)->force.z() == -4);
    for (Index f = 0; f < 3; ++f) context.add_point(point_of(f, 0));
    CHECK(step.refusal() == StepStatus::advanced);  // the capacity is copied too
    CHECK(copy.vertex_count() == 6);
}
