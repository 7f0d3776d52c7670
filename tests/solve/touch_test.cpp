// SPDX-License-Identifier: MIT
#include <membrane/solve/touch.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using membrane::Index;
using membrane::Points;
using membrane::PointsRef;
using membrane::Region;
using membrane::Touch;
using membrane::Vector3;
using membrane::Workspace;

namespace {

constexpr std::array<Index, 3> corners{0, 1, 2};

/// Three vertices, the last of them pinned if asked for.
struct Membrane {
    explicit Membrane(test::Random& random, bool last_pinned = false, bool blocks = false)
        : network{last_pinned}, x(3, 3), work(3, 8), ref(x), region(ref, work, network) {
        for (Index v = 0; v < 3; ++v) x.col(v) = random.vector();
        work.open();
        region.open();
        if (blocks) work.block_compliance.resize(3);
        for (Index v = 0; v < 3; ++v) {
            if (blocks) {
                membrane::Symmetric3<double> compliance = membrane::diagonal3(random.number(0.1, 2.0));
                compliance += membrane::outer(random.number(0.0, 5.0), random.vector());
                region.set_compliance(v, compliance, 0.1);
            } else {
                region.set_compliance(v, random.number(0.1, 2.0));
            }
        }
    }
    struct Network {
        bool last_pinned;
        bool pinned(Index v) const { return last_pinned && v == 2; }
    } network;
    Points<double> x;
    Workspace<double> work;
    PointsRef<double> ref;
    Region<double> region;
};

Vector3<double> at(const Points<double>& x, const Vector3<double>& barycentric) { return x * barycentric; }

}  // namespace

TEST_CASE("a point that is shifted goes where it should, and pinned corners stay") {
    for (int seed = 1; seed <= cases(2000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        Membrane m(random, seed % 2 == 0);
        const Vector3<double> barycentric = random.barycentric(), way = random.vector();
        const Points<double> before = m.x;
        membrane::shift_point<double>(m.region, corners, barycentric, way);
        const bool rigid = membrane::is_rigid(m.region, corners, barycentric);
        CAPTURE(seed, barycentric.transpose());
        CHECK((at(m.x, barycentric) - at(before, barycentric) - (rigid ? 0 : 1) * way).norm() < 1e-12);
        if (seed % 2 == 0) CHECK(m.x.col(2) == before.col(2));
        if (seed % 2 == 1) CHECK_FALSE(rigid);
    }
}

TEST_CASE("a point on a pinned corner is rigid") {
    test::Random random(1);
    Membrane m(random, true);
    CHECK(membrane::is_rigid<double>(m.region, corners, {0, 0, 1}));
    CHECK(membrane::is_rigid<double>(m.region, corners, {0.05, 0, 0.95}));
    CHECK_FALSE(membrane::is_rigid<double>(m.region, corners, {0.2, 0, 0.8}));
}

TEST_CASE("a force on a point is shared out, moves it by its compliance, and can be taken back") {
    for (int seed = 1; seed <= cases(2000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        Membrane m(random, false, seed % 2 == 0);
        const Vector3<double> none = Vector3<double>::Zero(), force = random.vector();
        Touch<double> touch{
            0, 0, corners, random.barycentric(), random.unit_vector(), none, random.vector<double>(0, 1)};
        membrane::attach(m.region, touch);
        const Points<double> before = m.x;
        membrane::change_force(m.region, touch, force);
        const Vector3<double> way = at(m.x, touch.barycentric) - at(before, touch.barycentric);
        CAPTURE(seed);
        CHECK((way - membrane::answer_of(m.region, touch, force)).norm() < 1e-12);
        CHECK((membrane::force_for(m.region, touch, way) - force).norm() < 1e-10);
        const auto along = membrane::answer_of(m.region, touch, touch.normal);
        CHECK(std::abs(membrane::compliance_of(m.region, touch) - along.dot(touch.normal)) < 1e-12);
        CHECK((m.work.external.rowwise().sum() - force).norm() < 1e-12);
        for (Index v = 0; v < 3; ++v) {
            CHECK((m.work.external.col(v) - touch.barycentric[v] * force).norm() < 1e-12);
            CHECK(m.work.stiffness[static_cast<std::size_t>(v)] == touch.stiffness[v]);
        }
        m.region.remember(touch);
        CHECK((membrane::reaction_of_touches(m.region) + force).norm() < 1e-12);
        membrane::detach(m.region, touch);
        CHECK(m.work.external.cwiseAbs().maxCoeff() < 1e-15);
    }
}

TEST_CASE("corners become seeds unless one is no vertex") {
    test::Random random(1);
    Membrane m(random);
    CHECK(membrane::seed_corners(m.region, corners));
    CHECK(m.work.seeds.count() == 3);
    CHECK_FALSE(m.work.invalid);
    CHECK_FALSE(membrane::seed_corners<double>(m.region, {0, 3, 1}));
    CHECK(m.work.invalid);
}

TEST_CASE("what a tool presses on yields where it is fixed by its share of the force, and stays in its place") {
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Membrane m(random, seed % 2 == 0);
        const double stiffness = random.number(1.0, 1000.0);
        m.region.set_support(2, stiffness);
        const Vector3<double> none = Vector3<double>::Zero(), force = random.vector();
        const Touch<double> touch{0, 0, corners, random.barycentric(), random.unit_vector(), force, none, true};
        const Points<double> before = m.x;
        membrane::attach(m.region, touch);
        const double weight = seed % 2 == 0 ? touch.barycentric[2] : 0;  // on what is fixed
        const Vector3<double> yields = (weight / stiffness) * force;
        CHECK((m.region.yielding(2) - yields).norm() < 1e-12);
        CHECK((membrane::yielding_of(m.region, touch) - weight * yields).norm() < 1e-12);
        CHECK(std::abs(membrane::support_compliance_of(m.region, touch) - weight * weight / stiffness) < 1e-12);
        CHECK((membrane::surface_triangle(m.region, corners).c - before.col(2) - yields).norm() < 1e-12);
        CHECK(m.x == before);
        membrane::detach(m.region, touch);
        CHECK(m.region.yielding(2).norm() < 1e-14);
        // And as much as a free corner would where a tool presses the surface in.
        const Vector3<double> way = random.vector();
        membrane::press_in<double>(m.region, corners, touch.barycentric, way);
        const double part = 1 - weight * weight / touch.barycentric.squaredNorm();
        CHECK((at(m.x, touch.barycentric) - at(before, touch.barycentric) - part * way).norm() < 1e-12);
        if (seed % 2 == 0) CHECK(m.x.col(2) == before.col(2));
    }
}

TEST_CASE("nothing is worth a shift that rounding makes nothing of") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        Membrane m(random);
        const double far = std::pow(10, random.number(0.0, 6.0));
        m.x.colwise() += far * random.unit_vector();
        const Touch<double> touch{0, 0, corners, random.barycentric(), {}, {}, {}, {}};
        const Vector3<double> where = at(m.x, touch.barycentric);
        const double spacing = std::numeric_limits<double>::epsilon() * where.cwiseAbs().maxCoeff();
        CAPTURE(seed, far);
        m.work.negligible_force = 0;
        CHECK(membrane::negligible_shift(m.region, touch) >= 4 * spacing);
        CHECK(membrane::negligible_shift(m.region, touch) <= 100 * spacing);
        m.work.negligible_force = 1;
        CHECK(membrane::negligible_shift(m.region, 1) == m.region.compliance(1));
    }
}
