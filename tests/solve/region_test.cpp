// SPDX-License-Identifier: MIT
#include <membrane/solve/region.hpp>

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "support/catch.hpp"

using namespace membrane;

namespace {

const Vector3<double> none(0, 0, 0);

/// Six points of which number 5 is pinned, and room for three touches.
struct SixPoints {
    bool pinned(Index v) const { return v == pinned_vertex; }

    Index pinned_vertex = 5;
    Points<double> points = Points<double>::Random(3, 6);
    PointsRef<double> x{points};
    Workspace<double> work{6, 3};

    SixPoints() { work.open(); }
};

Touch<double> touch_of(Index triangle, int pair, double pressure = 1) {
    return {triangle, pair, {0, 1, 2}, {0.2, 0.3, 0.5}, {0, 0, 1}, {0, 0, -pressure}, none};
}

std::vector<Index> as_vector(std::span<const Index> items) { return {items.begin(), items.end()}; }

}  // namespace

TEST_CASE("a region knows its vertices", "[region]") {
    SixPoints scene;
    Region<double> region(scene.x, scene.work, scene);
    for (Index v = 0; v < 6; ++v) {
        CHECK(region.check(v));
        CHECK(region.position(v) == point(scene.points, v));
    }
    CHECK_FALSE(scene.work.invalid);
    for (const Index wrong : {-1, 6, 1000, unlimited}) {
        scene.work.open();
        CHECK_FALSE(region.check(wrong));
        CHECK(scene.work.invalid);  // the step will be refused
    }
}

TEST_CASE("what is moved is kept as it was when the step began", "[region]") {
    SixPoints scene;
    Region<double> region(scene.x, scene.work, scene);
    const Points<double> before = scene.points;
    region.shift(2, {1, 0, 0});
    region.shift(2, {0, 1, 0});
    region.place(4, {7, 8, 9});
    CHECK(norm<double>(point(scene.points, 2) - point(before, 2) - Vector3<double>(1, 1, 0)) < 1e-15);
    CHECK(point(scene.points, 4) == Vector3<double>(7, 8, 9));
    CHECK(as_vector(scene.work.saved.items()) == std::vector<Index>{2, 4});
    for (const Index v : scene.work.saved.items()) CHECK(point(scene.work.start, v) == point(before, v));

    const Points<double> now = scene.points;
    scene.work.open();  // the next step
    CHECK(scene.work.saved.empty());
    region.save(2);
    CHECK(point(scene.work.start, 2) == point(now, 2));
    CHECK(scene.points == now);
}

TEST_CASE("held and pinned vertices are fixed until the step ends, and a pinned one stays", "[region]") {
    SixPoints scene;
    Region<double> region(scene.x, scene.work, scene);
    const Points<double> before = scene.points;
    CHECK(region.fixed(5));
    CHECK_FALSE(region.fixed(1));
    region.hold(1);
    region.hold(2, {1, 2, 3});
    region.hold(5, {1, 2, 3});
    CHECK(region.fixed(1));
    CHECK(region.fixed(2));
    CHECK(region.position(1) == point(before, 1));
    CHECK(region.position(2) == Vector3<double>(1, 2, 3));
    CHECK(region.position(5) == point(before, 5));
    for (const Index v : {0, 1, 5}) region.set_compliance(v, 0.5);
    CHECK(region.compliance(0) == 0.5);
    CHECK(region.compliance(1) == 0);
    CHECK(region.compliance(5) == 0);
    scene.work.open();
    CHECK_FALSE(region.fixed(1));
    CHECK(region.compliance(1) == 0.5);
    CHECK(region.fixed(5));
}

TEST_CASE("pushes add up, and are taken back with the step", "[region]") {
    SixPoints scene;
    Region<double> region(scene.x, scene.work, scene);
    region.push(3, {1, 2, 3});
    region.push(3, {1, 0, 0});
    region.push(0, {0, 0, 5});
    region.stiffen(0, 4);
    region.stiffen(0, -1);
    CHECK(point(scene.work.external, 3) == Vector3<double>(2, 2, 3));
    CHECK(point(scene.work.external, 0) == Vector3<double>(0, 0, 5));
    CHECK(scene.work.stiffness[0] == 3);
    scene.work.drop_external();
    CHECK(scene.work.external.isZero(0));
    CHECK(scene.work.stiffness == std::vector<double>(6, 0.0));
    region.push(1, {1, 1, 1});
    scene.work.open();
    CHECK(scene.work.external.isZero(0));
}

TEST_CASE("seeds keep their order, and each comes once", "[region]") {
    SixPoints scene;
    Region<double> region(scene.x, scene.work, scene);
    for (const Index v : {4, 0, 4, 2, 0}) region.seed(v);
    CHECK(as_vector(scene.work.seeds.items()) == std::vector<Index>{4, 0, 2});
    const std::array<Touch<double>, 2> triangles{touch_of(0, 0), touch_of(1, 0)};
    const std::span<const Touch<double>> all(triangles);
    for (int again = 0; again < 2; ++again) {
        CHECK(as_vector(region.corners_of(all)) == std::vector<Index>{0, 1, 2});
        CHECK(region.corners_of(all.first(0)).empty());
    }
}

TEST_CASE("each constraint finds the touches it had in the step before, and no others", "[region]") {
    SixPoints scene;
    Region<double> region(scene.x, scene.work, scene);
    const auto begin = [&](std::size_t constraint) {
        region.turn_to(constraint);
        region.open();
    };
    begin(0);
    CHECK(region.recall(7, 0) == nullptr);
    region.remember(touch_of(7, 0, 1));
    region.remember(touch_of(8, 2, 2));
    begin(1);
    region.remember(touch_of(7, 0, 3));
    CHECK(region.touches().size() == 1);
    CHECK(region.touches()[0].force.z() == -3);
    region.turn_to(0);
    CHECK(region.touches().size() == 2);
    CHECK(region.touches()[1].triangle == 8);
    CHECK(region.recall(7, 0) == nullptr);  // they are of this step
    CHECK_FALSE(scene.work.full);

    scene.work.close();
    scene.work.open();
    begin(0);
    CHECK(region.touches().empty());
    for (const int round : {1, 2}) {  // in any order, and again
        CAPTURE(round);
        REQUIRE(region.recall(8, 2) != nullptr);
        CHECK(region.recall(8, 2)->force.z() == -2);
        REQUIRE(region.recall(7, 0) != nullptr);
        CHECK(region.recall(7, 0)->force.z() == -1);
        CHECK(region.recall(8, 0) == nullptr);
        CHECK(region.recall(9, 2) == nullptr);
    }
    begin(1);
    REQUIRE(region.recall(7, 0) != nullptr);
    CHECK(region.recall(7, 0)->force.z() == -3);
    CHECK(region.recall(8, 2) == nullptr);
    begin(2);
    CHECK(region.recall(7, 0) == nullptr);

    scene.work.close();  // a step that remembered none
    scene.work.open();
    begin(0);
    CHECK(region.recall(7, 0) == nullptr);
}

TEST_CASE("touches can be forgotten, and are refused where there is no room", "[region]") {
    SixPoints scene;
    Region<double> region(scene.x, scene.work, scene);
    region.turn_to(0);
    region.open();
    for (Index f = 0; f < 3; ++f) region.remember(touch_of(f, 0));
    CHECK_FALSE(scene.work.full);
    region.remember(touch_of(3, 0));
    CHECK(scene.work.full);
    CHECK(region.touches().size() == 3);
    scene.work.close();
    scene.work.open();
    CHECK_FALSE(scene.work.full);
    region.open();
    CHECK(region.recall(1, 0) != nullptr);
    scene.work.forget();
    CHECK(region.recall(1, 0) == nullptr);
}

TEST_CASE("the corners of nothing are none, whatever the last step had", "[region]") {
    SixPoints scene;
    struct Corners {
        std::array<Index, 3> corners;
    };
    const std::array<Corners, 1> some{{{{1, 2, 3}}}};
    CHECK(Region<double>(scene.x, scene.work, scene).corners_of(std::span<const Corners>(some)).size() == 3);
    CHECK(Region<double>(scene.x, scene.work, scene).corners_of(std::span<const Corners>()).empty());
}

TEST_CASE("who is pinned is asked whenever it matters", "[region]") {
    SixPoints scene;
    scene.pinned_vertex = 2;
    const Region<double> region(scene.x, scene.work, scene);
    CHECK(region.fixed(2));
    scene.pinned_vertex = 3;
    CHECK_FALSE(region.fixed(2));
    CHECK(region.fixed(3));
}

TEST_CASE("a workspace is copied with all it holds", "[region]") {
    auto scene = std::make_unique<SixPoints>();
    {
        Region<double> region(scene->x, scene->work, *scene);
        region.turn_to(0);
        region.open();
        region.remember(touch_of(7, 0, 4));
        scene->work.close();
    }
    Workspace<double> copy = scene->work;
    Points<double> points = scene->points;
    scene.reset();
    PointsRef<double> x(points);
    const SixPoints pins;
    Region<double> region(x, copy, pins);
    copy.open();
    region.turn_to(0);
    region.open();
    REQUIRE(region.recall(7, 0) != nullptr);
    CHECK(region.recall(7, 0)->force.z() == -4);
    for (Index f = 0; f < 3; ++f) region.remember(touch_of(f, 0));
    CHECK_FALSE(copy.full);  // the room has come along
    CHECK(copy.vertex_count() == 6);
}
