// SPDX-License-Identifier: MIT
#include <membrane/accuracy/equilibrium_solver.hpp>

#include <cmath>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/catch.hpp"

using namespace membrane;

namespace {

/// A sphere whose vertex 0 is moved, and after how many iterations what is out of balance.
struct Search {
    TriangleMesh<double> mesh = icosphere({.radius = 1, .subdivisions = 2});
    MassSpringNetwork<double, LinearSpring> network{mesh, LinearSpring{}, {.stiffness = 1.0}};
    VirtualVolumeSprings<double> foundation{mesh, {.stiffness = 0.5}};

    Equilibrium run(const EquilibriumOptions& options, double displacement = 0.1) const {
        std::vector<unsigned char> fixed(static_cast<std::size_t>(mesh.vertex_count()), 0);
        EquilibriumScene scene(mesh.positions(), fixed);
        describe(pull(0, ((1 + displacement) * mesh.positions().col(0)).eval()), scene);
        fixed[0] = 1;
        return EquilibriumSolver(mesh.positions(), mesh.triangles(), Elasticity(network, foundation), scene, fixed,
                                 options)
            .run(1);
    }
};

}  // namespace

TEST_CASE("the mean side of an icosahedron is its edge", "[equilibrium_solver]") {
    const auto mesh = icosphere<double>({.radius = 1, .subdivisions = 0});
    CHECK(detail::mean_side(mesh.positions(), mesh.triangles()) == Approx(4 / std::sqrt(10 + 2 * std::sqrt(5.0))));
}

TEST_CASE("the search converges quadratically", "[equilibrium_solver]") {
    const Search search;
    std::vector<double> residuals;
    for (Index i = 1; i <= 20 && (residuals.empty() || residuals.back() > 1e-9); ++i) {
        const auto found = search.run({.max_iterations = i});
        CHECK(found.iterations <= i);
        residuals.push_back(found.residual);
    }
    REQUIRE(residuals.size() >= 3);
    REQUIRE(residuals.size() <= 8);
    const double last = residuals.back(), before = residuals[residuals.size() - 2];
    CHECK(before < 1e-3);
    CHECK(last < 10 * before * before);
}

TEST_CASE("increments lead to the same place, each in few iterations", "[equilibrium_solver]") {
    const Search search;
    const auto one = search.run({}), ten = search.run({.increments = 10});
    REQUIRE((one.converged && ten.converged));
    CHECK((one.x - ten.x).cwiseAbs().maxCoeff() < 1e-13);
    CHECK((one.reactions[0] - ten.reactions[0]).norm() < 1e-13);
    CHECK(ten.iterations <= 60);
    CHECK(one.penetration == 0);
}

TEST_CASE("a looser tolerance takes fewer iterations and keeps its word", "[equilibrium_solver]") {
    const Search search;
    const auto loose = search.run({.tolerance = 1e-2}), exact = search.run({});
    REQUIRE((loose.converged && exact.converged));
    CHECK(loose.iterations < exact.iterations);
    CHECK(loose.residual > exact.residual);
    CHECK(loose.residual < 1e-2);
}

TEST_CASE("a search that begins at rest ends there", "[equilibrium_solver]") {
    const Search search;
    const auto rest = search.run({}, 0);
    CHECK(rest.converged);
    CHECK(rest.iterations == 1);
    CHECK(test::same_bits(rest.x, search.mesh.positions()));
}
