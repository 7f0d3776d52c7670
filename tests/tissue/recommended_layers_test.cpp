// SPDX-License-Identifier: MIT
#include <membrane/tissue/recommended_layers.hpp>

#include <array>
#include <cmath>
#include <tuple>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/foundation_layer.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

namespace {

/// A random material on a random layer, on a sphere of 642 vertices; a vertex is pulled off by up to 1.3 edges.
struct PulledSphere {
    TriangleMesh<double> mesh = icosphere({.radius = 0.01, .subdivisions = 3});
    Material material;
    FoundationLayer layer;
    MassSpringNetwork<double, LinearSpring> network;
    FoundationSprings<double> foundation;
    Index held;
    double displacement;  // [m]

    explicit PulledSphere(Random& random)
        : material{.young_modulus = std::pow(10, random.number(4.0, 7.0)),
                   .poisson_ratio = random.number(0.0, 0.5),
                   .thickness = std::pow(10, random.number(-5.0, -3.0))},
          layer(random_layer(random)),
          network(mesh, LinearSpring{}, {.stiffness = spring_stiffnesses(mesh, material)}),
          foundation(mesh,
                     {.normal = normal_stiffnesses(mesh, layer), .tangential = tangential_stiffnesses(mesh, layer)}),
          held(random.index(mesh.vertex_count())),
          displacement(random.number(0.02, 0.2) * 0.01) {}

    /// Its normal decay length is 0.3 to 5 edges.
    FoundationLayer random_layer(Random& random) const {
        FoundationLayer result{.young_modulus = 1, .poisson_ratio = random.number(0.0, 0.49), .thickness = 1e-3};
        const double length = mean_edge(mesh) * std::pow(10, random.number(-0.5, 0.7));
        result.young_modulus = material.biaxial_stiffness() / (length * length) / result.normal_stiffness();
        return result;
    }

    double force(const Vector3<double>& direction, Index layers) const {
        const Vector3<double> target = mesh.positions().col(held) + displacement * direction;
        const auto rest = equilibrium(mesh.positions(), mesh, network, foundation,
                                      {.layers = layers, .tolerance = 1e-9}, pull(held, target));
        REQUIRE(rest.converged);
        return norm(rest.reactions[0]);
    }

    Index count(Index layers) const {
        PropagationQueue queue(mesh.vertex_count());
        queue.build(network, std::array{held}, layers);
        return static_cast<Index>(queue.vertices().size());
    }
};

struct Tally {
    int accurate = 0, economical = 0;

    /// Whether that many layers keep the force, and whether those of less than two thirds of the vertices would not.
    void add(const PulledSphere& sphere, const Vector3<double>& direction, Index layers) {
        const double whole = sphere.force(direction, unlimited);
        const auto error = [&](Index n) { return std::abs(sphere.force(direction, n) / whole - 1); };
        accurate += error(layers) < 0.01 ? 1 : 0;
        Index fewer = layers - 1;
        while (fewer >= 0 && 1.5 * sphere.count(fewer) >= sphere.count(layers)) --fewer;
        economical += fewer < 0 || error(fewer) >= 0.01 ? 1 : 0;
    }
};

}  // namespace

TEST_CASE("recommended layers keep the force within 1 %, with few vertices more than that takes", "[layers]") {
    const int count = cases(6, 500);
    Tally lifted, dragged;
    for (int seed = 1; seed <= count; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(10'000 + seed));  // others than those of the fit
        const PulledSphere sphere(random);
        const auto layers = recommended_layers(sphere.mesh, sphere.material, sphere.layer);
        const Vector3<double> normal = sphere.foundation.normals().col(sphere.held), other = random.unit_vector();
        const Vector3<double> along = cross(normal, other).normalized();
        lifted.add(sphere, normal, layers.normal);
        dragged.add(sphere, along, layers.tangential);
    }
    WARN(count << " materials: the force is kept in " << lifted.accurate << " along the normal and " << dragged.accurate
               << " along the surface, with at most 1.5 times the vertices in " << lifted.economical << " and "
               << dragged.economical);
    // Of 500 that many; of a few, one more may miss.
    const auto enough = [&](int found, double part) { return found >= part * count - (count < 100 ? 1 : 0); };
    CHECK(enough(lifted.accurate, 0.95));
    CHECK(enough(dragged.accurate, 0.95));
    CHECK(enough(lifted.economical, 0.8));
    CHECK(enough(dragged.economical, 0.8));
}

TEST_CASE("decay lengths are those of membrane and foundation", "[layers]") {
    const Material material{.young_modulus = 3e4, .poisson_ratio = 0.25, .thickness = 1e-3};
    const FoundationLayer layer{.young_modulus = 1e3, .poisson_ratio = 0, .thickness = 2e-3};
    const auto lengths = decay_lengths(material, layer);
    CHECK(lengths.normal == Approx(std::sqrt(3e4 * 1e-3 / 0.75 / (1e3 / 2e-3))));
    CHECK(lengths.tangential == Approx(std::sqrt(2.0) * lengths.normal));
}

TEST_CASE("a chain of springs on a foundation falls as fast as is said", "[layers]") {
    // k (u_{i+1} - 2 u_i + u_{i-1}) = c u_i, with the decay length edge sqrt(k / c).
    for (const double length : {0.3, 1.0, 5.0}) {  // in edges
        const double per_spring = std::exp(-2 * std::asinh(1 / (2 * length)));
        CHECK(per_spring - 2 + 1 / per_spring == Approx(1 / (length * length)));
    }
}

TEMPLATE_TEST_CASE("a finer mesh needs as many more layers as it has shorter edges, and no mesh less than one",
                   "[layers]", TEST_SCALARS) {
    using S = TestType;
    const Material material{.young_modulus = 3e6, .poisson_ratio = 0.47, .thickness = 13e-6};
    const FoundationLayer soft{.young_modulus = 2e3, .poisson_ratio = 0.45, .thickness = 1e-3};
    const auto layers_of = [&](Index subdivisions, const FoundationLayer& layer) {
        return recommended_layers(icosphere<S>({.radius = 0.01, .subdivisions = subdivisions}), material, layer);
    };
    const auto coarse = layers_of(3, soft), fine = layers_of(5, soft);
    CHECK(fine.normal == Approx(4 * coarse.normal).margin(5));
    CHECK(fine.tangential == Approx(4 * coarse.tangential).margin(5));
    CHECK(coarse.tangential > coarse.normal);
    const auto least = layers_of(0, {.young_modulus = 1e12, .poisson_ratio = 0, .thickness = 1e-6});
    CHECK((least.normal == 1 && least.tangential == 1));
    const auto most = layers_of(0, {.young_modulus = 1e-100, .poisson_ratio = 0, .thickness = 1});
    CHECK((most.normal == 1'000'000'000 && most.tangential == 1'000'000'000));
}

TEST_CASE("layers are recommended for materials that make sense", "[layers][bad]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const Material material{.young_modulus = 1, .poisson_ratio = 0, .thickness = 1};
    CHECK(test::refusal([&] { std::ignore = recommended_layers(mesh, Material{}, FoundationLayer{}); }) ==
          "Material: young_modulus must be finite and positive [Pa], got 0");
    CHECK(test::refusal([&] { std::ignore = recommended_layers(mesh, material, FoundationLayer{}); }) ==
          "Foundation: young_modulus must be finite and positive [Pa], got 0");
}
