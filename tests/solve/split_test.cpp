// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/replay/snapshot.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/neo_hookean.hpp>
#include <membrane/tissue/tissue.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/orders.hpp"
#include "support/random_tear.hpp"

using namespace membrane;

namespace {

template <class Scalar>
struct SpringsAlone {
    static constexpr bool bends = false;
    static auto make(const TriangleMesh<Scalar>&, const auto& springs) { return springs; }
};

template <class Scalar>
struct WithTriangles {
    static constexpr bool bends = false;
    static auto make(const TriangleMesh<Scalar>& mesh, const auto& springs) {
        return Tissue(springs, neo_hookean(mesh, Material{.young_modulus = 1e4, .thickness = 1e-3}));
    }
};

template <class Scalar>
struct WithHinges {
    static constexpr bool bends = true;
    static auto make(const TriangleMesh<Scalar>& mesh, const auto& springs) {
        return Tissue(springs, bending_springs(mesh, 0.3));
    }
};

/// A stretched disc on springs, pressed and pulled by a tool that stands still, and torn.
template <class Scalar, class Kind>
struct TornDisc {
    using Springs = TearableSprings<Scalar, LinearSpring>;

    static Springs springs_of(const TriangleMesh<Scalar>& mesh, const std::vector<Index>& pinned) {
        return Springs(mesh, MassSpringNetwork(mesh, LinearSpring{},
                                               {.stiffness = spring_stiffnesses(mesh, material), .pinned = pinned}));
    }

    explicit TornDisc(int seed)
        : mesh(with_reserve(disc<Scalar>({.radius = 1, .rings = 7}), 24)),
          pinned(border(mesh)),
          tissue(Kind::make(mesh, springs_of(mesh, pinned))),
          foundation(mesh, {.stiffness = Scalar(0.5)}),
          surface(mesh),
          solver(tissue, {.layers = unlimited,
                          .adaptive_layers = seed % 5 == 4,
                          .sweeps = 10,
                          .order = test::order_of(seed),
                          .predict = seed % 2 == 0,
                          .max_vertex_updates = seed % 7 == 6 ? 1500 : unlimited,
                          .force_tolerance = Scalar(is_double ? 1e-10 : 0)}),
          tree(mesh),
          tracker(mesh),
          grasper(mesh),
          x(Scalar(1.3) * mesh.positions()) {
        tree.refit(x);
        tool.radius = Scalar(0.3);
        tool.position = {Scalar(0.05), Scalar(0.02), Scalar(0.35)};
    }

    StepReport<Scalar> tick() {
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report =
            solver.step(x, Scalar(1e-3), tissue, foundation, press(tool, contact, grasp), pull(tool, grasp));
        tree.refit(x, report.moved);
        return report;
    }

    /// Follows random splits, and moves if nothing bends. The tree is refitted.
    int tear(test::Random& random) {
        int splits = 0;
        for (int n = 0; n < 6; ++n) {
            test::change_at_random(random, surface, x, !Kind::bends);
            for (const auto& event : surface.events()) {
                follow(event, tissue, foundation, solver, tree, tracker, grasper);
                splits += event.split.vertex != no_index ? 1 : 0;
                if (event.split.vertex != no_index && tissue.pinned(event.split.vertex))
                    pinned.push_back(event.split.copy);
            }
        }
        tree.refit(x);
        return splits;
    }

    /// The largest distance from the equilibrium of parts that are built anew.
    double error() {
        const TriangleMesh<Scalar> torn(surface.rest_positions(), surface.triangles());
        std::vector<Scalar> stiffness;
        for (Index v = 0; v < mesh.vertex_count(); ++v) stiffness.push_back(foundation.stiffness(v));
        const VirtualVolumeSprings<Scalar> anew(torn, {.stiffness = stiffness});
        const auto sheet = Kind::make(torn, springs_of(torn, pinned));
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto found = equilibrium(x, torn, sheet, anew, {}, press(tool, contact, grasp), pull(tool, grasp));
        REQUIRE(found.converged);
        return (x.template cast<double>() - found.x).colwise().norm().maxCoeff();
    }

    /// By forces that are negligible on every vertex: no direction is softer than the softest spring of the foundation,
    /// as long as all springs are stretched.
    double allowed_error() const {
        const double force = is_double ? 1e-10 : static_cast<double>(tissue.force_tolerance());
        double softest = 1;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            softest = std::min(softest, static_cast<double>(foundation.stiffness(v)));
        }
        return std::sqrt(static_cast<double>(mesh.vertex_count())) * force / softest;
    }

    static constexpr bool is_double = std::is_same_v<Scalar, double>;
    static constexpr Material material{.young_modulus = 1e4, .poisson_ratio = 0.3, .thickness = 1e-3};
    TriangleMesh<Scalar> mesh;
    std::vector<Index> pinned;
    decltype(Kind::make(std::declval<const TriangleMesh<Scalar>&>(), std::declval<const Springs&>())) tissue;
    VirtualVolumeSprings<Scalar> foundation;
    TornSurface<Scalar> surface;
    QuasiStaticSolver<Scalar> solver;
    AabbTree<Scalar> tree;
    ContactTracker<Scalar> tracker;
    Grasper<Scalar> grasper;
    Points<Scalar> x;
    Tool<Scalar> tool;
};

template <class Scalar, class Kind>
void check_follows(int& splits) {
    for (int seed = 1; seed <= cases(30); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        TornDisc<Scalar, Kind> disc(seed);
        const auto relax = [&] {
            StepReport<Scalar> report;
            for (int n = 0; n < 20'000 && !report.converged; ++n) report = disc.tick();
            return report;
        };
        for (int n = 0; n < 4; ++n) disc.tool.position[2] -= Scalar(0.05), static_cast<void>(disc.tick());
        disc.tool.grasping = seed % 4 >= 2;
        for (int round = 0; round < 3; ++round) {
            CAPTURE(round);
            const auto report = relax();
            CAPTURE(report.residual, disc.tissue.force_tolerance());
            // The tolerance is that of the whole membrane: a vertex that has moved may make stiffer triangles, whose
            // rounding in float is larger.
            constexpr bool exact = TornDisc<Scalar, Kind>::is_double;
            REQUIRE((report.converged || (!exact && report.residual < 2 * disc.tissue.force_tolerance())));
            const double error = disc.error();
            CAPTURE(disc.allowed_error());
            CHECK(error <= disc.allowed_error());
            splits += disc.tear(random);
        }
    }
}

}  // namespace

// Newton's method on parts that are built of the torn triangles.
TEMPLATE_TEST_CASE("a solver that follows a tear finds the equilibrium of parts that are built anew", "[step][tear]",
                   TEST_SCALARS) {
    int splits = 0;
    SECTION("springs") { check_follows<TestType, SpringsAlone<TestType>>(splits); }
    SECTION("hinges") { check_follows<TestType, WithHinges<TestType>>(splits); }
    if constexpr (all_types) {
        SECTION("triangles") { check_follows<TestType, WithTriangles<TestType>>(splits); }
    }
    CHECK(splits > 2 * cases(30));
}

TEMPLATE_TEST_CASE("after a split the vertices around both wake, and come to balance", "[step][tear]",
                   SpringsAlone<double>, WithHinges<double>) {
    for (int seed = 1; seed <= cases(30); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        TornDisc<double, TestType> disc(seed);
        const auto relax = [&] {
            StepReport<double> report;
            for (int n = 0; n < 3000 && !report.converged; ++n) {
                report = disc.solver.step(disc.x, 1e-3, disc.tissue, disc.foundation);
            }
            REQUIRE(report.converged);
        };
        disc.solver.wake_all();
        relax();
        int splits = 0;
        while (splits == 0) splits = disc.tear(random);
        std::vector<Index> around;
        for (const auto& event : disc.surface.events()) {
            for (const Index v : {event.split.vertex, event.split.copy}) {
                if (v == no_index) continue;
                around.push_back(v);
                for (const auto& end : disc.tissue.neighbours(v)) around.push_back(end.other);
            }
        }
        relax();
        for (const Index v : around) {
            CAPTURE(v);
            if (disc.tissue.pinned(v)) continue;
            const auto at = point(disc.x, v);
            const Vector3<double> force =
                disc.tissue.force_on(v, disc.x).force + disc.foundation.force_on(v, at, at, 1).force;
            REQUIRE(norm(force) <= 2e-10);
        }
    }
}

namespace {

template <class Scalar, class Kind>
void check_restores(int seed) {
    using Disc = TornDisc<Scalar, Kind>;
    CAPTURE(seed);
    Disc disc(seed), other(seed);
    const auto save = [](const Disc& of) {
        std::vector<std::byte> bytes(
            snapshot_capacity(of.tissue, of.foundation, of.surface, of.solver, of.tree, of.tracker, of.grasper, of.x));
        bytes.resize(save_snapshot(bytes, of.tissue, of.foundation, of.surface, of.solver, of.tree, of.tracker,
                                   of.grasper, of.x));
        REQUIRE(!bytes.empty());
        return bytes;
    };
    const auto restore = [](const std::vector<std::byte>& from, Disc& to) {
        REQUIRE(restore_snapshot(from, to.tissue, to.foundation, to.surface, to.solver, to.tree, to.tracker, to.grasper,
                                 to.x));
        to.tree.refit(to.x);
    };
    // Presses, pulls and tears, from a tick on: the same for each loop.
    const auto run = [](Disc& with, int from, int to, std::vector<Points<Scalar>>& path) {
        int splits = 0;
        for (int n = from; n < to; ++n) {
            test::Random random(static_cast<std::uint64_t>(n));
            with.tool.position = {Scalar(0.05), Scalar(0.01 * n), Scalar(0.35 - 0.02 * (n % 12))};
            with.tool.grasping = n % 20 > 8;
            REQUIRE(with.tick().status == StepStatus::advanced);
            path.push_back(with.x);
            if (n % 3 == 2) splits += with.tear(random);
        }
        return splits;
    };
    std::vector<Points<Scalar>> first, again, sewn, scratch;
    const auto whole = save(disc);
    CHECK(run(disc, 0, 8, first) > 0);
    const auto torn = save(disc);
    CHECK(run(disc, 8, 16, first) > 0);
    static_cast<void>(run(other, 3, 12, scratch));  // torn elsewhere
    restore(torn, other);
    CHECK((save(other) == torn));
    static_cast<void>(run(other, 8, 16, again));
    for (std::size_t n = 0; n < again.size(); ++n) REQUIRE(test::same_bits(again[n], first[8 + n]));
    restore(whole, disc);
    CHECK(disc.surface.triangles() == disc.mesh.triangles());
    CHECK(disc.surface.rest_positions() == disc.mesh.positions());
    static_cast<void>(run(disc, 0, 16, sewn));
    for (std::size_t n = 0; n < sewn.size(); ++n) REQUIRE(test::same_bits(sewn[n], first[n]));
}

}  // namespace

TEMPLATE_TEST_CASE("parts restored from a snapshot go on with the same bits, torn or sewn up again", "[snapshot][tear]",
                   TEST_SCALARS) {
    for (int seed = 1; seed <= cases(30); ++seed) {
        check_restores<TestType, WithHinges<TestType>>(seed);
        if constexpr (all_types) {
            check_restores<TestType, SpringsAlone<TestType>>(seed);
            check_restores<TestType, WithTriangles<TestType>>(seed);
        }
    }
}
