// SPDX-License-Identifier: MIT
#include <membrane/solve/surface_point.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using membrane::ConstPointsRef;
using membrane::ConstraintContext;
using membrane::ContactPoint;
using membrane::ContactState;
using membrane::Index;
using membrane::Points;
using membrane::Vector3;
using membrane::VertexRows;

namespace {

constexpr std::array<Index, 3> corners{0, 1, 2};

/// Three vertices, the last of them pinned if asked for.
struct Membrane {
    explicit Membrane(test::Random& random, bool last_pinned = false)
        : network{last_pinned},
          x(3, 3),
          work(3),
          contacts(3, 8),
          ref(x),
          step(ref, work, contacts, network),
          context(step) {
        for (Index v = 0; v < 3; ++v) x.col(v) = random.vector();
        work.begin_step();
        contacts.begin_points(0);
        for (Index v = 0; v < 3; ++v) {
            membrane::Symmetric3<double> compliance = membrane::diagonal3(random.number(0.1, 2.0));
            compliance += membrane::outer(random.number(0.0, 5.0), random.vector());
            work.set_response(v, {compliance}, 0.1);
            step.load(v);
        }
    }
    [[nodiscard]] Vector3<double> at(const Vector3<double>& weights) const {
        return membrane::point_at(membrane::triangle_of(context, corners), weights);
    }
    [[nodiscard]] Vector3<double> force(Index v) const { return work.constraint_force(v); }

    struct Network {
        bool last_pinned;
        bool pinned(Index v) const { return last_pinned && v == 2; }
    } network;
    Points<double> x;
    VertexRows<double> work;
    ContactState<double> contacts;
    ConstPointsRef<double> ref;
    membrane::ConstrainedStep<double> step;
    ConstraintContext<double> context;
};

}  // namespace

TEST_CASE("a force on a point is distributed, and moves it by its compliance") {
    for (int seed = 1; seed <= cases(2000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        Membrane m(random);
        const Vector3<double> force = random.vector();
        ContactPoint<double> touch{0, 0, corners, random.barycentric(), random.unit_vector(), Vector3<double>::Zero()};
        const Vector3<double> before = m.at(touch.weights);
        membrane::change_force(m.context, touch, force);
        const Vector3<double> by = m.at(touch.weights) - before;
        CAPTURE(seed);
        CHECK((by - membrane::response_of(m.context, touch, force)).norm() < 1e-12);
        CHECK((membrane::force_for(m.context, touch, by) - force).norm() < 1e-10);
        for (Index v = 0; v < 3; ++v) CHECK((m.force(v) - touch.weights[v] * force).norm() < 1e-12);
        m.context.add_point(touch);
        CHECK((membrane::reaction_at_points(m.context) + force).norm() < 1e-12);
        membrane::add_point_force<double>(m.context, corners, touch.weights, -force);
        for (Index v = 0; v < 3; ++v) CHECK(m.force(v).norm() < 1e-15);
    }
}

TEST_CASE("corners become seeds unless one is no vertex") {
    test::Random random(1);
    Membrane m(random);
    CHECK(membrane::seed_corners(m.context, corners));
    CHECK(m.work.seeds.count() == 3);
    CHECK(m.step.refusal() == membrane::StepStatus::advanced);
    CHECK_FALSE(membrane::seed_corners<double>(m.context, {0, 3, 1}));
    CHECK(m.step.refusal() == membrane::StepStatus::invalid_input);
}

TEST_CASE("a fixed corner yields by its share of the force, and stays where it is") {
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Membrane m(random, seed % 2 == 0);
        const double stiffness = random.number(1.0, 1000.0);
        m.contacts.set_support_stiffness(2, stiffness);
        const Vector3<double> force = random.vector();
        const ContactPoint<double> touch{0, 0, corners, random.barycentric(), random.unit_vector(), force, true};
        const auto press_with = [&](const Vector3<double>& part) {
            auto point = touch;
            point.force = part;
            m.context.add_point(point);
            sum_support_forces(m.context);
        };
        press_with(force);
        const double weight = seed % 2 == 0 ? touch.weights[2] : 0;  // on what is fixed
        const Vector3<double> yields = (weight / stiffness) * force;
        CHECK((membrane::support_displacement(m.context, Index(2)) - yields).norm() < 1e-12);
        CHECK((membrane::support_displacement(m.context, touch) - weight * yields).norm() < 1e-12);
        for (Index v = 0; v < 3; ++v) CHECK(m.context.position(v) == m.x.col(v));
        press_with(-force);
        CHECK(membrane::support_displacement(m.context, Index(2)).norm() < 1e-14);
        // And as much as a free corner would where a tool presses the surface in.
        const Vector3<double> by = random.vector(), before = m.at(touch.weights);
        membrane::press_in<double>(m.context, corners, touch.weights, by);
        const double part = 1 - weight * weight / touch.weights.squaredNorm();
        CHECK((m.at(touch.weights) - before - part * by).norm() < 1e-12);
        if (seed % 2 == 0) CHECK(m.context.position(2) == m.x.col(2));
    }
}

TEST_CASE("a distance that rounding makes nothing of is negligible") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        Membrane m(random);
        const double far = std::pow(10, random.number(0.0, 6.0));
        const Vector3<double> by = far * random.unit_vector(), none = Vector3<double>::Zero();
        for (Index v = 0; v < 3; ++v) m.context.move(v, by);
        const ContactPoint<double> touch{0, 0, corners, random.barycentric(), none, none};
        const Vector3<double> where = m.at(touch.weights);
        const double spacing = std::numeric_limits<double>::epsilon() * where.cwiseAbs().maxCoeff();
        CAPTURE(seed, far);
        m.work.force_tolerance = 0;
        // Above the rounding of a position, half a spacing, and not far above: a force jumps by what is ignored.
        CHECK(membrane::negligible_distance(m.context, touch) >= spacing);
        CHECK(membrane::negligible_distance(m.context, touch) <= 4 * spacing);
        m.work.force_tolerance = 1e9;
        CHECK(membrane::negligible_distance(m.context, 1) == 1e9 * m.context.compliance(1));
    }
}

TEST_CASE("a vertex that has moved farther than it may in a step goes back to there") {
    test::Random random(1);
    Membrane m(random, true);
    const Vector3<double> start = m.x.col(0), by(0, 3, 4);
    m.context.move(0, by);
    m.context.move(1, {0, 0, 1});
    allow_motion(m.context, 2.0);
    allow_motion(m.context, 1.0);
    membrane::limit_motion<double>(m.context, corners);
    CHECK((m.context.position(0) - start - 0.4 * by).norm() < 1e-14);
    CHECK((m.context.position(1) - m.x.col(1) - Vector3<double>(0, 0, 1)).norm() < 1e-14);
    CHECK(m.context.position(2) == m.x.col(2));
}
