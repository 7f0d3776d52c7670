// SPDX-License-Identifier: MIT
#include <membrane/tear/ligament.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include <membrane/model/volume_springs.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/tearing.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/orders.hpp"
#include "support/random.hpp"

using namespace membrane;

TEST_CASE("a ligament takes the work that opens it, however often it closes and becomes weaker", "[tear]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double strength = random.number(0.1, 3.0), size = random.number(0.5, 2.0);
        Ligament<double> ligament{0, 1, {1, 0, 0}, strength * size, strength};
        REQUIRE(ligament.tension == strength);
        double opening = 0, work = 0, end = 0;
        for (int n = 0; n < 600; ++n) {
            const double last = ligament.tension, kept = ligament.dissipated + ligament.stored(opening);
            const double excess = random.number(-0.05, 0.03);
            ligament.weaken(excess);
            REQUIRE(ligament.least >= last - 2 * std::max(excess, 0.0) * strength - 1e-15);
            REQUIRE(ligament.dissipated + ligament.stored(opening) == Approx(kept).margin(1e-12));
            const double next = std::max(opening + random.number(-0.01, 0.015) * size, 0.0);
            constexpr int parts = 40;  // its law has corners
            for (int i = 0; i < parts; ++i)
                work += ligament.force_at(opening + (i + 0.5) / parts * (next - opening)) * (next - opening) / parts;
            opening = next;
            ligament.open(opening);
            end = std::max(end, opening);
            REQUIRE(ligament.reached == end);
            REQUIRE(ligament.opening == opening);
            REQUIRE(ligament.tension <= last);
            REQUIRE(ligament.tension >= ligament.least);
            REQUIRE(ligament.dissipated + ligament.stored(opening) ==
                    Approx(work).epsilon(1e-3).margin(1e-4 * strength * size));
        }
        REQUIRE(ligament.failed() == (ligament.tension <= strength / 10));
        // What it takes in a tick is estimated by that in the last one.
        if (ligament.failed()) CHECK(ligament.dissipated + ligament.stored(end) >= 0.85 * ligament.energy);
    }
}

TEST_CASE("a tick weakens a ligament by twice the excess, but no sooner than it has taken energy", "[tear]") {
    Ligament<double> ligament{0, 1, {1, 0, 0}, 3, 2};
    ligament.open(0.9);  // it has taken 0.6 of its energy
    ligament.open(0.9);  // it no longer opens
    const auto weakened = [&ligament](double excess) {
        auto other = ligament;
        other.weaken(excess);
        CHECK(other.slope == 0);
        return other.tension;
    };
    CHECK(weakened(0.1) == Approx(2 - 2 * 0.1 * 2));
    CHECK(weakened(0.3) == Approx(2 - 2 * 0.3 * 2));    // as it has left to take
    CHECK(weakened(0.35) == Approx(0.4 * 2));           // not less
    CHECK(weakened(0.42) == Approx(2 - 2 * 0.42 * 2));  // an advance pays for the next edge and for that
    ligament.open(1.35);                                // 0.9 of its energy: a quarter is more than it has left
    ligament.open(1.35);
    ligament.weaken(0.2);
    ligament.weaken(0.2);
    CHECK(weakened(0.2) == Approx(0.1 * 2));
    CHECK(weakened(0.26) == 0);
}

TEST_CASE("a ligament is weakened over the opening that a tick has by now", "[tear]") {
    Ligament<double> ligament{0, 1, {1, 0, 0}, 3, 2};
    ligament.open(0.6);
    CHECK(ligament.increment == 0.6);
    ligament.open(0.9);
    CHECK(ligament.increment == Approx(0.3));
    ligament.open(0.91);
    CHECK(ligament.increment == Approx(0.15));  // half of the last one, if it opens by less
    ligament.weaken(0.1);
    CHECK(ligament.tension == 2);
    CHECK(ligament.least == Approx(1.6));
    CHECK(ligament.slope == Approx(0.4 / 0.15));
    CHECK(ligament.force_at(0.91 + 0.075) == Approx(1.8));
    CHECK(ligament.force_at(0.91 + 0.2) == Approx(1.6));
    ligament.open(0.91 + 0.075);
    CHECK(ligament.tension == Approx(1.8));
    ligament.open(0.9);
    CHECK(ligament.increment == 0);
}

TEST_CASE("a ligament fails at once if an advance pays for two edges, and never by what is no number", "[tear]") {
    const Ligament<double> whole{0, 1, {1, 0, 0}, 3, 2};
    for (const double excess : {1.0, 2.0, 1e300, std::numeric_limits<double>::infinity()}) {
        CAPTURE(excess);
        auto ligament = whole;
        ligament.weaken(excess);
        CHECK(ligament.tension == 0);
        CHECK(ligament.failed());
    }
    for (const double excess : {0.0, -1.0, 0.99, std::numeric_limits<double>::quiet_NaN()}) {
        CAPTURE(excess);
        auto ligament = whole;
        ligament.weaken(excess);
        CHECK(ligament.tension == 2);
        CHECK_FALSE(ligament.failed());
    }
}

namespace {

/// A stretched disc with a slit of two edges in its middle, held together by a ligament.
template <class Scalar>
struct SlitDisc {
    explicit SlitDisc(int seed)
        : mesh(with_reserve(disc<Scalar>({.radius = 1, .rings = 5}), 1)),
          springs(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = Scalar(10), .pinned = border(mesh)})),
          foundation(mesh, {.stiffness = Scalar(0.1)}),
          surface(mesh),
          solver(springs, {.layers = unlimited, .sweeps = 20, .order = test::order_of(seed)}),
          x(Scalar(1.5) * mesh.positions()) {
        PointsRef<Scalar> ref = x;
        const Index copy = surface.split(ref, 0, 1, 4);
        REQUIRE(copy != no_index);
        follow(surface.events()[0], springs, foundation, solver);
        ligament.vertex = 0;
        ligament.copy = copy;
    }

    StepReport<Scalar> relax() {
        const LigamentForces<Scalar> forces{{&ligament, 1}};
        StepReport<Scalar> report;
        solver.wake_all();
        for (int n = 0; n < 20'000 && !report.converged; ++n) {
            report = solver.step(x, Scalar(1e-3), springs, foundation, forces);
        }
        return report;
    }
    Vector3<double> separation() const {
        return Vector3<Scalar>(point(x, 0) - point(x, ligament.copy)).template cast<double>();
    }
    /// The membrane's and the foundation's force on a vertex.
    Vector3<double> force_on(Index v) const {
        const auto at = point(x, v);
        return Vector3<Scalar>(springs.force_on(v, x).force + foundation.force_on(v, at, at, 1).force)
            .template cast<double>();
    }

    TriangleMesh<Scalar> mesh;
    TearableSprings<Scalar, LinearSpring> springs;
    VirtualVolumeSprings<Scalar> foundation;
    TornSurface<Scalar> surface;
    QuasiStaticSolver<Scalar> solver;
    Ligament<Scalar> ligament;
    Points<Scalar> x;
};

}  // namespace

// The forces of springs and foundation, which the constraint does not know.
TEMPLATE_TEST_CASE("a step in equilibrium has the force of a ligament's law across the edge", "[tear]", TEST_SCALARS) {
    int closed = 0, open = 0, failed = 0, unloaded = 0;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        SlitDisc<TestType> disc(seed);
        auto& ligament = disc.ligament;
        ligament.strength = random.number(TestType(0.5), TestType(20));
        ligament.force = ligament.strength * random.unit_vector<TestType>();
        ligament.tension = random.chance(0.1) ? 0 : random.number(TestType(0), ligament.strength);
        if (random.chance(0.5)) ligament.reached = static_cast<TestType>(std::pow(10, random.number(-2.0, 0.8)));
        const auto report = disc.relax();
        REQUIRE(report.converged);
        CHECK(norm(report.reactions[0]) == 0);
        const Vector3<double> apart = disc.separation(), force = disc.force_on(0);
        const double opening = norm(apart), tolerance = 4 * static_cast<double>(disc.springs.force_tolerance());
        CAPTURE(opening, ligament.strength, ligament.tension, ligament.reached);
        REQUIRE(norm<double>(force + disc.force_on(ligament.copy)) <= tolerance);
        const auto at = static_cast<TestType>(opening);
        const double tension = static_cast<double>(ligament.force_at(at));
        const double size = norm(force);
        if (10 * opening <= tolerance) {  // of springs that stiff
            ++closed;
            REQUIRE(size <= static_cast<double>(ligament.tension) + tolerance);
            continue;
        }
        // A negligible force on the springs moves the vertices, and that changes the force of a stiff ligament.
        const double allowed = tolerance * (1 + tension / opening / 10);
        REQUIRE(size == Approx(tension).margin(allowed));
        if (tension > 0) REQUIRE(norm<double>(force - (tension / opening) * apart) <= allowed);
        open += at > ligament.reached && tension > 0 ? 1 : 0;
        failed += tension == 0 ? 1 : 0;
        unloaded += at < ligament.reached ? 1 : 0;
    }
    CAPTURE(closed, open, failed, unloaded);
    if (cases(100) < 20) return;  // too few for each kind
    CHECK(closed > 0);
    CHECK(open > 0);
    CHECK(failed > 0);
    CHECK(unloaded > 0);
}

TEST_CASE("a ligament with nonsense in it refuses the step or leaves it finite", "[tear][bad]") {
    constexpr double wild = std::numeric_limits<double>::infinity();
    for (const double number : {wild, -wild, std::numeric_limits<double>::quiet_NaN(), -1.0, 0.0, 1e300, 1e-300}) {
        CAPTURE(number);
        for (int which = 0; which < 5; ++which) {
            CAPTURE(which);
            SlitDisc<double> disc(1);
            auto& ligament = disc.ligament;
            ligament.strength = ligament.tension = 5, ligament.force = {0, 5, 0};
            (which == 0   ? ligament.strength
             : which == 1 ? ligament.tension
             : which == 2 ? ligament.opening
             : which == 3 ? ligament.reached
                          : ligament.force[1]) = number;
            const Points<double> before = disc.x;
            for (int n = 0; n < 5; ++n) {
                const auto report = disc.solver.step(disc.x, 1e-3, disc.springs, disc.foundation,
                                                     LigamentForces<double>{{&ligament, 1}});
                if (report.status != StepStatus::advanced) REQUIRE((n > 0 || disc.x == before));
                REQUIRE(disc.x.allFinite());
            }
        }
    }
}
