// SPDX-License-Identifier: MIT
#include <membrane/accuracy/equilibrium_scene.hpp>

#include <array>
#include <limits>
#include <vector>

#include "support/catch.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::refusal;

namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<Index, 3> corners{0, 1, 2};
const Vector3<double> middle = Vector3<double>::Constant(1.0 / 3), target(1, 2, 3);

/// Four vertices, the last one pinned; described by constraint 5.
EquilibriumScene scene() {
    EquilibriumScene scene(Points<double>::Zero(3, 4), {0, 0, 0, 1});
    scene.select_constraint(5);
    return scene;
}

template <class C>
EquilibriumScene scene_of(const C& constraint) {
    EquilibriumScene result = scene();
    describe(constraint, result);
    return result;
}

Contact<double> contact_above() {
    Contact<double> contact;
    contact.phase = ContactPhase::ongoing;
    contact.corners = corners;
    contact.normal = {0, 0, 1};
    contact.patch.axis_point = {0, 0, 0.1};
    contact.gap = -0.2;
    contact.patch.detection_distance = 0.01;
    contact.patch.radius = 0.3;
    return contact;
}

/// A constraint of one's own, with a term of each kind.
struct Clamp {
    Index first, second;
};
void describe(const Clamp& clamp, EquilibriumScene& scene) {
    scene.prescribe(clamp.first);
    scene.prescribe(clamp.second, target);
    scene.prescribe(corners, middle, target);
    scene.load(corners, middle, -target);
    scene.press({}, contact_above());
}
static_assert(StaticConstraint<Clamp> && !StaticConstraint<int>);

}  // namespace

TEST_CASE("held vertices have their targets, pinned ones stay", "[equilibrium_scene]") {
    const auto held = scene_of(pull(1, target));
    CHECK(held.fixed(1));
    CHECK(!held.fixed(0));
    CHECK(held.goals(1).targets.col(1) == target);
    CHECK(held.seeds() == std::vector<Index>{1});
    CHECK(held.prescribed_vertices() == std::vector<std::pair<std::size_t, Index>>{{5, 1}});

    const auto pinned = scene_of(pull(3, target));
    CHECK(pinned.fixed(3));
    CHECK(pinned.goals(1).targets.col(3).isZero(0));

    const std::array<Index, 2> vertices{0, 2};
    auto pins = scene_of(pin(vertices));
    CHECK((pins.fixed(0) && !pins.fixed(1) && pins.fixed(2)));
    CHECK(pins.seeds().empty());
    CHECK(pins.prescribed_vertices().size() == 2);

    describe(pull(2, target), pins);  // the last one decides, but a pin has no wish of its own
    describe(pin(vertices), pins);
    CHECK(pins.goals(1).targets.col(2) == target);
}

TEST_CASE("held and loaded points, and constraints of one's own", "[equilibrium_scene]") {
    const Grasp<float> grasp{.triangle = 0, .corners = corners, .barycentric = middle.cast<float>()};
    const auto held = scene_of(pull(Tool<float>{.position = target.cast<float>()}, grasp));
    REQUIRE(held.point_attachments().size() == 1);
    CHECK(held.point_attachments()[0].constraint == 5);
    CHECK(held.point_attachments()[0].target == target);
    CHECK(held.seeds().size() == 3);
    CHECK(scene_of(pull(Tool<double>{}, Grasp<double>{})).point_attachments().empty());

    const auto loaded = scene_of(load(corners, middle, target));
    REQUIRE(loaded.loads().size() == 1);
    CHECK(loaded.loads()[0].force == target);
    CHECK(loaded.seeds().size() == 3);

    const auto own = scene_of(Clamp{0, 1});
    CHECK((own.fixed(0) && own.fixed(1)));
    CHECK(own.goals(1).targets.col(1) == target);
    CHECK(own.goals(1).attached_points == std::vector{target});
    CHECK((own.goals(1).loads.rowwise().sum() + target).norm() < 1e-15);
    CHECK(own.goals(1).tools.size() == 1);
}

TEST_CASE("a tool that presses, and its exit displacement", "[equilibrium_scene]") {
    const Tool<double> tool{.position = {0, 0, 0.1}};
    CHECK(scene_of(press(tool, Contact<double>::none())).tools().empty());
    auto contact = contact_above();
    const auto deep = scene_of(press(tool, contact));
    REQUIRE(deep.tools().size() == 1);
    CHECK(deep.tools()[0].constraint == 5);
    CHECK(deep.tools()[0].tool.radius == 0.3);  // as the contact sees it
    CHECK((deep.tools()[0].exit_displacement - Vector3<double>(0, 0, 0.2)).norm() < 1e-15);
    CHECK(deep.seeds().size() == 3);
    contact.gap = 0;
    CHECK(scene_of(press(tool, contact)).tools()[0].exit_displacement.isZero(0));
}

TEST_CASE("targets, loads and tools come on in parts", "[equilibrium_scene]") {
    auto all = scene_of(pull(0, target));
    describe(load(corners, middle, target), all);
    describe(pull(Tool<double>{.position = target}, Grasp<double>{0, corners, middle, target, {}}), all);
    describe(press(Tool<double>{.position = {0, 0, 0.1}}, contact_above()), all);
    const auto half = all.goals(0.5), end = all.goals(1);
    CHECK((half.targets.col(0) - 0.5 * target).norm() == 0);
    CHECK(end.targets.col(0) == target);
    CHECK((half.loads.rowwise().sum() - 0.5 * target).norm() < 1e-15);
    CHECK((end.loads.rowwise().sum() - target).norm() < 1e-15);
    CHECK((half.attached_points[0] - target).norm() < 1e-15);
    CHECK(end.attached_points[0] == 2 * target);
    CHECK((half.tools[0].position - Vector3<double>(0, 0, 0.2)).norm() < 1e-15);
    CHECK(end.tools[0].position == Vector3<double>(0, 0, 0.1));
}

TEST_CASE("a scene refuses what is not valid", "[equilibrium_scene]") {
    const auto refused = [](const auto& constraint) { return refusal([&] { scene_of(constraint); }); };
    CHECK(refused(pull(4, target)) == "equilibrium: constraint 5 names vertex 4, expected 0 to 3");
    CHECK(refused(pull(-1, target)) == "equilibrium: constraint 5 names vertex -1, expected 0 to 3");
    CHECK(refused(pull(0, Vector3<double>(0, not_a_number, 0))) ==
          "equilibrium: y of the target of constraint 5 must be finite [m], got nan");
    CHECK(refused(load(corners, middle, Vector3<double>(0, 0, not_a_number))) ==
          "equilibrium: z of the force of constraint 5 must be finite [N], got nan");
    CHECK(refused(load({0, 1, 9}, middle, target)) == "equilibrium: constraint 5 names vertex 9, expected 0 to 3");
    CHECK(refused(load<double>(corners, {0.5, 0.5, 0.5}, target)) ==
          "equilibrium: barycentric weights of constraint 5 must not be negative and have the sum 1, got 0.5 0.5 0.5");
    const std::array<Index, 1> none{7};
    CHECK(refused(pin(none)) == "equilibrium: constraint 5 names vertex 7, expected 0 to 3");

    auto contact = contact_above();
    CHECK(refused(press(Tool<double>{.radius = -1}, contact)) ==
          "equilibrium: radius of the tool of constraint 5 must be finite and not negative [m], got -1");
    CHECK(refused(press(Tool<double>{.position = {not_a_number, 0, 0}}, Contact<double>::none())) ==
          "equilibrium: x of the tool's position of constraint 5 must be finite [m], got nan");
    CHECK(refused(press(Tool<double>{.axis = {not_a_number, 0, 0}}, contact)) ==
          "equilibrium: x of the tool's axis of constraint 5 must be finite [m], got nan");
    contact.patch.radius = 0;
    CHECK(refused(press(Tool<double>{}, contact)) ==
          "equilibrium: radius of the contact of constraint 5 must be finite and positive [m], got 0");
    contact = contact_above();
    contact.patch.fine_triangles = 2;
    CHECK(refused(press(Tool<double>{}, contact)) ==
          "equilibrium: fine_triangles of the contact of constraint 5 must be from 0 to 1 [tool radii], got 2");
    contact = contact_above();
    contact.normal[2] = not_a_number;
    CHECK(refused(press(Tool<double>{}, contact)) ==
          "equilibrium: z of the contact's normal of constraint 5 must be finite [1], got nan");
    contact = contact_above();
    contact.corners[0] = no_index;
    CHECK(refused(press(Tool<double>{}, contact)) == "equilibrium: constraint 5 names vertex -1, expected 0 to 3");
}

TEST_CASE("equilibrium refuses options out of their range", "[equilibrium_scene]") {
    const auto refused = [](const EquilibriumOptions& options) { return refusal([&] { options.validate(); }); };
    CHECK(refused({}) == "");
    CHECK(refused({.increments = 0}) == "equilibrium: increments must be at least 1, got 0");
    CHECK(refused({.layers = -1}) == "equilibrium: layers must be at least 0, got -1");
    CHECK(refused({.max_iterations = 0}) == "equilibrium: max_iterations must be at least 1, got 0");
    CHECK(refused({.tolerance = 0}) == "equilibrium: tolerance must be finite and positive, got 0");
    CHECK(refused({.tolerance = not_a_number}) == "equilibrium: tolerance must be finite and positive, got nan");
}
