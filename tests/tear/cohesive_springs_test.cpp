// SPDX-License-Identifier: MIT
#include <membrane/tear/cohesive_springs.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <membrane/replay/snapshot.hpp>
#include <membrane/surface/moving_body.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

namespace {

/// Constants of one vertex, and the law in closed form: stress by the displacement along a fixed direction.
struct Law {
    double stiffness, strength, energy, tangential_strength, tangential_energy, area;

    explicit Law(Random& random, double on_area)
        : stiffness(random.number(1e7, 1e9)),
          strength(random.number(0.1, 0.8)),
          energy(random.number(0.02, 0.2)),
          tangential_strength(random.number(0.5, 2.0)),
          tangential_energy(energy * random.number(0.5, 2.0)),
          area(on_area) {
        strength *= std::sqrt(2 * energy * stiffness);
        tangential_strength *= strength;
    }
    template <Real S>
    [[nodiscard]] CohesionOptions<S> options() const {
        return {.stiffness = S(stiffness),
                .strength = S(strength),
                .energy = S(energy),
                .tangential_strength = S(tangential_strength),
                .tangential_energy = S(tangential_energy)};
    }
    [[nodiscard]] double failure_opening() const { return 2 * energy / strength; }
    [[nodiscard]] double failure_sliding() const { return 2 * tangential_energy / tangential_strength; }
    [[nodiscard]] double onset() const { return strength / stiffness / failure_opening(); }
    /// Of the opening alone, or of the sliding alone [N].
    [[nodiscard]] double normal_force(double separation) const { return area * strength * part(separation); }
    [[nodiscard]] double tangential_force(double separation) const {
        return area * tangential_strength * part(separation);
    }
    /// Of the strength: increases linearly to 1, decreases linearly to 0.
    [[nodiscard]] double part(double separation) const {
        return std::max(0.0, std::min(separation / onset(), (1 - separation) / (1 - onset())));
    }
};

/// A sphere whose vertex 0 has the law; a direction along the surface there.
template <Real S>
struct Bonded {
    TriangleMesh<S> mesh = icosphere<S>({.radius = S(1e-3), .subdivisions = 0});
    Random random;
    Law law;
    CohesiveSprings<S> springs;
    Vector3<S> anchor, normal, along;

    explicit Bonded(int seed)
        : random(static_cast<std::uint64_t>(seed)),
          law(random, static_cast<double>(vertex_areas(mesh)[0])),
          springs(mesh, law.options<S>()),
          anchor(point(mesh.positions(), 0)),
          normal(point(springs.normals(), 0)),
          along(direction_or_zero<S>(cross<S>(normal, random.unit_vector<S>()))) {}

    /// The vertex with this part of the failure opening and of the failure sliding.
    [[nodiscard]] Vector3<S> at(double opening, double sliding) const {
        return anchor + S(opening * law.failure_opening()) * normal + S(sliding * law.failure_sliding()) * along;
    }
    /// The force that pulls the vertex back: along the normal and along the surface [N].
    [[nodiscard]] std::array<double, 2> force(const Vector3<S>& x) const {
        const auto pull = springs.force_on(0, x, x, S(1)).force;
        return {-static_cast<double>(dot(pull, normal)), -static_cast<double>(dot(pull, along))};
    }
    void move_to(const Vector3<S>& position) {
        Points<S> x = mesh.positions();
        x.col(0) = position;
        const Index v = 0;
        springs.update(x, {&v, 1});
    }
};

}  // namespace

TEMPLATE_TEST_CASE("drawn off, a cohesive spring follows the bilinear law in each direction", "[cohesion]",
                   TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Bonded<S> bonded(seed);
        const auto& law = bonded.law;
        const double angle = bonded.random.number(0.0, 1.57), separation = bonded.random.number(0.0, 1.2);
        const double opening = separation * std::cos(angle), sliding = separation * std::sin(angle);
        const auto [up, back] = bonded.force(bonded.at(opening, sliding));
        const double tolerance = 1e4 * std::numeric_limits<S>::epsilon() * law.area *
                                 std::max(law.strength, law.tangential_strength) / law.onset();
        // The directions share the separation.
        CHECK(std::abs(up - std::cos(angle) * law.normal_force(separation)) < tolerance);
        CHECK(std::abs(back - std::sin(angle) * law.tangential_force(separation)) < tolerance);

        // Drawn back it keeps the stiffness that it has left.
        bonded.move_to(bonded.at(opening, sliding));
        const double part = bonded.random.number();
        const auto [less_up, less_back] = bonded.force(bonded.at(part * opening, part * sliding));
        CHECK(std::abs(less_up - part * up) < tolerance);
        CHECK(std::abs(less_back - part * back) < tolerance);
        CHECK(bonded.springs.adheres(0) == (separation < 1));
        const double stiffness = law.stiffness * law.area;
        const double expected = separation <= law.onset() ? 0
                                : separation < 1 ? 1 - law.onset() * (1 - separation) / (separation * (1 - law.onset()))
                                                 : 1;
        CHECK(std::abs(bonded.springs.damage(0) - expected) < 1e4 * std::numeric_limits<S>::epsilon());

        // Pressed down it is supported by the whole stiffness.
        const double depth = bonded.random.number();
        CHECK(bonded.force(bonded.at(-depth, 0))[0] ==
              Approx(-stiffness * depth * law.failure_opening()).epsilon(1e-3));
    }
}

TEST_CASE("to separate an area takes its energy, in each direction and in proportion between them", "[cohesion]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Bonded<double> bonded(seed);
        const auto& law = bonded.law;
        const double angle = seed == 1 ? 0 : seed == 2 ? std::acos(0.0) : bonded.random.number(0.0, 1.57);
        const double normal = std::cos(angle), tangential = std::sin(angle);
        constexpr int steps = 20000;
        double work = 0;
        Vector3<double> before = bonded.anchor;
        for (int i = 1; i <= steps; ++i) {
            const double separation = 1.01 * i / steps;
            const Vector3<double> now = bonded.at(separation * normal, separation * tangential);
            const Vector3<double> middle = (before + now) / 2;
            work -= dot<double>(bonded.springs.force_on(0, middle, middle, 1.0).force, now - before);
            bonded.move_to(now);
            before = now;
            const double balance = work - bonded.springs.dissipated() - bonded.springs.energy(0, now);
            REQUIRE(std::abs(balance) < 1e-3 * law.energy * law.area);
        }
        const double expected =
            law.area * (law.energy * normal * normal + law.tangential_energy * tangential * tangential);
        CHECK(work == Approx(expected).epsilon(1e-3));
        CHECK(bonded.springs.dissipated() == Approx(expected).epsilon(1e-9));
        CHECK(bonded.springs.energy(0, before) == 0);
        CHECK_FALSE(bonded.springs.adheres(0));
    }
}

TEST_CASE("within the damage the force is the derivative of the energy", "[cohesion]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Bonded<double> bonded(seed);
        const double reached = bonded.random.number(0.3, 0.95);
        bonded.move_to(bonded.at(reached, 0));
        const double angle = bonded.random.number(-1.5, 1.5), part = reached * bonded.random.number(0.1, 0.95);
        const Vector3<double> x = bonded.at(part * std::cos(angle), part * std::sin(angle));
        const double step = 1e-6 * bonded.law.failure_opening();
        const auto pull = bonded.springs.force_on(0, x, x, 1.0).force;
        for (int k = 0; k < 3; ++k) {
            const Vector3<double> off = step * Vector3<double>::Unit(k);
            const double slope = (bonded.springs.energy(0, x + off) - bonded.springs.energy(0, x - off)) / (2 * step);
            CHECK(std::abs(pull[k] + slope) < 1e-6 * norm(pull));
        }
    }
}

TEST_CASE("the stiffness bounds the energy that is stored and taken", "[cohesion]") {
    int beyond = 0;
    for (int seed = 1; seed <= cases(5000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        CohesiveSpring<double> spring;
        spring.normal = random.unit_vector();
        spring.anchor = random.vector();
        // Equal energies: the product of stiffness and square of the failure displacement.
        spring.normal_stiffness = random.number(0.1, 10.0);
        spring.per_opening = random.number(0.5, 2.0);
        spring.per_sliding = random.number(0.5, 2.0);
        const double ratio = spring.per_sliding / spring.per_opening;
        spring.tangential_stiffness = spring.normal_stiffness * ratio * ratio;
        spring.softening = random.number(0.01, 5.0);
        const double onset = spring.softening / (1 + spring.softening);
        spring.reached = random.number(onset, 1.0);
        const auto potential = [&](const Vector3<double>& x) { return spring.energy(x) + spring.dissipation(x); };
        const Vector3<double> x = spring.anchor + random.vector(-1.5, 1.5), d = random.vector(-1.0, 1.0);
        const auto now = spring.force_on(x);
        const double bound = potential(x) - dot(now.force, d) + now.stiffness * squared_norm(d) / 2;
        // Without the part along the normal below the surface, where it is stiffer than above.
        const bool same_side =
            dot<double>(spring.normal, x - spring.anchor) < 0 || dot<double>(spring.normal, x + d - spring.anchor) >= 0;
        if (!same_side) continue;
        ++beyond;
        REQUIRE(potential(x + d) <= bound + 1e-12 * (1 + std::abs(bound)));
    }
    CHECK(beyond > cases(5000) / 3);
}

TEMPLATE_TEST_CASE("cohesive springs in lanes have the same bits as alone", "[cohesion]", TEST_SCALARS) {
    using S = TestType;
    using Wide = Lanes<S>;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Bonded<S> bonded(seed);
        InLanes<CohesiveSpring<S>> together;
        std::array<CohesiveSpring<S>, Wide::count> alone;
        Vector3<Wide> x;
        for (std::size_t i = 0; i < Wide::count; ++i) {
            if (bonded.random.chance(0.8)) {
                bonded.move_to(bonded.at(bonded.random.number(0.0, 1.2), 0));
                alone[i] = bonded.springs.spring(0, bonded.anchor, S(1));
            }
            set_lane(together, i, alone[i]);
            const auto position = bonded.at(bonded.random.number(-1.0, 1.0), bonded.random.number(-1.0, 1.0));
            for (int k = 0; k < 3; ++k) x[k].set(i, position[k]);
            bonded.springs.reset();
        }
        const auto all = together.force_on(x);
        for (std::size_t i = 0; i < Wide::count; ++i) {
            const auto one = alone[i].force_on({x[0][i], x[1][i], x[2][i]});
            for (int k = 0; k < 3; ++k) REQUIRE(all.force[k][i] == one.force[k]);
            REQUIRE(all.stiffness[i] == one.stiffness);
        }
    }
}

TEMPLATE_TEST_CASE("on a moving body springs are damaged by the displacement relative to it", "[cohesion]",
                   TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Bonded<S> bonded(seed), moving(seed);
        Points<S> x = bonded.mesh.positions();
        MovingBody body(bonded.mesh);
        const RigidFrame<S> pose{.rotation = random.rotation<S>(), .origin = S(1e-3) * random.vector<S>()};
        REQUIRE(body.move_to(pose, x));
        const Vector3<S> there = bonded.at(bonded.random.number(0.0, 1.2), bonded.random.number(-1.0, 1.0));
        bonded.move_to(there);
        x.col(0) = pose.point_to_world(there);
        const Index v = 0;
        moving.springs.update(body, x, {&v, 1});
        const double tolerance = 1e5 * std::numeric_limits<S>::epsilon();
        CHECK(std::abs(moving.springs.damage(0) - bonded.springs.damage(0)) < tolerance);
        CHECK(moving.springs.dissipated() ==
              Approx(bonded.springs.dissipated()).margin(tolerance * bonded.law.energy * bonded.law.area));
        const auto pull = on(body, moving.springs).force_on(0, pose.point_to_world(there), {}, S(1));
        const auto expected = bonded.springs.force_on(0, there, {}, S(1));
        const double scale = bonded.law.stiffness * bonded.law.area * bonded.law.failure_opening();
        CHECK(norm<S>(pull.force - pose.vector_to_world(expected.force)) < tolerance * scale);
    }
}

TEST_CASE("damage is permanent until a reset, kept by a snapshot, and not done by nonsense", "[cohesion]") {
    Bonded<double> bonded(1);
    auto& springs = bonded.springs;
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
    bonded.move_to({nan, 0, 0});
    CHECK(springs.damage(0) < 1e-15);
    CHECK(springs.dissipated() == 0);
    bonded.move_to(bonded.at(0.7, 0));
    const double damage = springs.damage(0), dissipated = springs.dissipated();
    CHECK(damage > 0.1);
    CHECK(dissipated > 0);
    bonded.move_to(bonded.at(0.2, 0.3));
    CHECK(springs.damage(0) == damage);
    CHECK(springs.dissipated() == dissipated);

    std::vector<std::byte> buffer(snapshot_capacity(springs));
    const auto size = save_snapshot(buffer, springs);
    bonded.move_to(bonded.at(3, 0));
    CHECK_FALSE(springs.adheres(0));
    CHECK(springs.damage(0) == 1);
    const auto after = springs.dissipated();
    bonded.move_to({infinity, 0, 0});
    CHECK(springs.dissipated() == after);
    REQUIRE(restore_snapshot({buffer.data(), size}, springs));
    CHECK(springs.damage(0) == damage);
    CHECK(springs.dissipated() == dissipated);
    springs.reset();
    CHECK(springs.damage(0) < 1e-15);
    CHECK(springs.dissipated() == 0);
    CHECK(springs.adheres(0));
}

TEST_CASE("a vertex that becomes several has the forces, the energy and the damage of one that does not",
          "[cohesion][tear]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Bonded<double> whole(seed), parted(seed);
        std::vector<Index> parts{0};
        for (int tick = 0; tick < 30; ++tick) {
            const auto x = parted.at(whole.random.number(-0.3, 0.7), whole.random.number(-0.7, 0.7));
            if (parts.size() < 4 && whole.random.chance(0.2)) {
                const Index v = parts[static_cast<std::size_t>(whole.random.index(static_cast<Index>(parts.size())))];
                const auto copy = static_cast<Index>(parts.size());  // of the sphere: it has no part in this
                parted.springs.split({.vertex = v, .copy = copy, .area_share = whole.random.number()});
                parts.push_back(copy);
            }
            double energy = 0;
            Vector3<double> force = Vector3<double>::Zero();
            for (const Index v : parts) {
                energy += parted.springs.energy(v, x);
                force += parted.springs.force_on(v, x, x, 1).force;
            }
            const auto expected = whole.springs.force_on(0, x, x, 1).force;
            REQUIRE(norm<double>(force - expected) <= 1e-12 * norm(expected));
            REQUIRE(energy == Approx(whole.springs.energy(0, x)).epsilon(1e-12));
            if (whole.random.chance(0.5)) continue;
            whole.move_to(x);
            Points<double> all = parted.mesh.positions();
            for (const Index v : parts) all.col(v) = x;
            parted.springs.update(all, parts);
            REQUIRE(parted.springs.dissipated() == Approx(whole.springs.dissipated()).epsilon(1e-12));
            for (const Index v : parts) REQUIRE(parted.springs.damage(v) == whole.springs.damage(0));
        }
    }
}

TEST_CASE("a vertex of strength zero does not adhere, and is supported", "[cohesion]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    std::vector<double> strength(12, 1.0);
    strength[3] = 0;
    CohesiveSprings<double> springs(mesh, {.stiffness = 10.0, .strength = strength, .energy = 1.0});
    CHECK_FALSE(springs.adheres(3));
    CHECK(springs.adheres(4));
    const Vector3<double> anchor = point(mesh.positions(), 3), normal = point(springs.normals(), 3);
    const Vector3<double> above = anchor + 0.1 * normal + 0.1 * cross<double>(normal, Vector3<double>::UnitX());
    CHECK(springs.force_on(3, above, above, 1).force == Vector3<double>::Zero());
    const Vector3<double> below = anchor - 0.1 * normal;
    CHECK(norm<double>(springs.force_on(3, below, below, 1).force - vertex_areas(mesh)[3] * normal) < 1e-14);
    springs.reset();
    CHECK_FALSE(springs.adheres(3));
}

TEST_CASE("cohesive springs refuse constants that make no law", "[cohesion]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const auto refused = [&](const CohesionOptions<double>& options) {
        return test::refusal([&] { CohesiveSprings<double>(mesh, options); });
    };
    CHECK(refused({}) == "CohesiveSprings: stiffness [Pa/m] is required");
    CHECK(refused({.stiffness = 1.0}) == "CohesiveSprings: strength [Pa] is required");
    CHECK(refused({.stiffness = 1.0, .strength = 1.0}) == "CohesiveSprings: energy [J/m^2] is required");
    CHECK(refused({.stiffness = 0.0, .strength = 1.0, .energy = 1.0}) ==
          "CohesiveSprings: stiffness must be finite and positive [Pa/m], got 0");
    CHECK(refused({.stiffness = 1.0, .strength = -1.0, .energy = 1.0}) ==
          "CohesiveSprings: strength must be finite and not negative [Pa], got -1");
    CHECK(refused({.stiffness = 1.0, .strength = 1.0, .energy = std::vector<double>(3, 1.0)}) ==
          "CohesiveSprings: energy must be one number or one for each vertex (12), got 3");
    CHECK(refused({.stiffness = 2.0, .strength = 2.0, .energy = 1.0}) ==
          "CohesiveSprings: strength of vertex 0 must be below sqrt(2 energy stiffness) = 2 [Pa], got 2");
    CHECK(refused({.stiffness = 2.0, .strength = 1.0, .energy = 1.0, .tangential_energy = 0.0}) ==
          "CohesiveSprings: tangential_energy must be finite and positive [J/m^2], got 0");
}

TEST_CASE("positions of another membrane damage nothing, and vertices that are not there are ignored",
          "[cohesion][bad]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    CohesiveSprings<double> springs(mesh, {.stiffness = 2.0, .strength = 1.0, .energy = 1.0});
    Points<double> x = 9 * mesh.positions();
    const Eigen::MatrixXd rows = x.transpose();
    const MovingBody<double> body(mesh), other(icosphere({.subdivisions = 1}));
    const std::array<Index, 4> moved{-1, 12, 1'000'000'000, 5};
    CHECK_FALSE(springs.update(rows, moved));
    CHECK_FALSE(springs.update(x.leftCols(11), moved));
    CHECK_FALSE(springs.update(body, rows, moved));
    CHECK_FALSE(springs.update(other, x, moved));
    CHECK(springs.dissipated() == 0);
    CHECK(springs.update(body, x, moved));
    CHECK_FALSE(springs.adheres(5));
    const double once = springs.dissipated();
    CHECK(springs.update(x, moved));
    CHECK(springs.dissipated() == once);
}
