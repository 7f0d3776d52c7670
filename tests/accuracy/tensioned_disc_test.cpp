// SPDX-License-Identifier: MIT A disc under tension on an elastic foundation, clamped at its rim, against the closed
// form: T w'' + T w' / r - c w + p = 0 is solved by Bessel functions of r / L, L = sqrt(T / c).
#include <cmath>
#include <numbers>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/spring_stiffness.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"
#include "support/run_to_equilibrium.hpp"

using namespace membrane;
using test::Random;

namespace {

constexpr double radius = 1, decay = 0.15;
constexpr Index rings = 32;
constexpr double edge = radius / rings;

double I0(double z) { return std::cyl_bessel_i(0, z); }
double K0(double z) { return std::cyl_bessel_k(0, z); }

struct Disc {
    explicit Disc(Random& random)
        : mesh(irregular(random)),
          springs(mesh, LinearSpring{}, {.stiffness = 0.0, .pinned = border(mesh)}),
          stretched(triangular_springs(mesh, material, 1.1)),
          tension(stretched.all()[0].element.mean_tension(stretched.where(stretched.all()[0], mesh.positions()))),
          pressure(tension / (decay * decay)),
          foundation(mesh, {.stiffness = scaled(vertex_areas(mesh), pressure)}) {}

    static TriangleMesh<double> irregular(Random& random) {
        auto surface = test::surface_of(disc({.radius = radius, .rings = rings}));
        for (Index v = 1; v < surface.vertex_count(); ++v) {  // the middle stays
            const bool inside = surface.x.col(v).norm() < radius - edge / 2;
            if (inside) surface.x.col(v).head<2>() += 0.2 * edge * random.vector(-1.0, 1.0).eigen().head<2>();
        }
        return surface.mesh();
    }
    static std::vector<double> scaled(std::vector<double> areas, double by) {
        for (double& area : areas) area *= by;
        return areas;
    }

    /// How far the disc goes down under these loads at its vertices, 3 x V [N].
    Eigen::VectorXd depth_under(const Points<double>& loads) const {
        using Loads = Elements<double, DeadLoad<double>>;
        std::vector<Loads::Instance> all;
        for (Index v = 0; v < mesh.vertex_count(); ++v) all.push_back({{v}, {loads.col(v)}});
        const auto tissue = Tissue(springs, stretched, Loads(mesh, all));
        const auto rest = equilibrium(mesh.positions(), mesh, tissue, foundation, {});
        REQUIRE(rest.converged);
        return -rest.x.row(2).transpose();
    }

    Material material{.young_modulus = 1e6, .poisson_ratio = 0.47, .thickness = 1e-4};
    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> springs;
    Elements<double, TriangularSpring<double>> stretched;
    double tension;   // [N/m]
    double pressure;  // of the foundation, for each metre of depth [Pa/m]
    VirtualVolumeSprings<double> foundation;
};

}  // namespace

TEST_CASE("a tensioned disc on a foundation under a patch goes as deep as Bessel functions say", "[tension]") {
    for (int seed = 1; seed <= 2; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Disc disc(random);
        const double patch = seed == 1 ? 4 * edge : 8 * edge, load = 1e-5 * disc.pressure;  // [Pa]
        // What the patch covers of each triangle, by samples.
        Points<double> loads = Points<double>::Zero(3, disc.mesh.vertex_count());
        for (Index f = 0; f < disc.mesh.triangle_count(); ++f) {
            const auto corners = disc.mesh.triangles().col(f);
            const auto x = triangle_at(disc.mesh.positions(), corners);
            const double area = norm(area_vector(x));
            constexpr int samples = 200;
            for (int i = 0; i < samples; ++i) {
                const auto weights = random.barycentric();
                if (norm(point_at(x, weights)) > patch) continue;
                for (Eigen::Index k = 0; k < 3; ++k) loads(2, corners[k]) -= load * area / samples * weights[k];
            }
        }
        const auto found = disc.depth_under(loads);
        const double a = patch / decay, deepest = load / disc.pressure;
        const double inner = a * std::cyl_bessel_k(1, a), outer = a * std::cyl_bessel_i(1, a);
        const double rim = -outer * K0(radius / decay) / I0(radius / decay);
        double worst = 0, middle = 0;
        for (Index v = 0; v < disc.mesh.vertex_count(); ++v) {
            const double r = disc.mesh.positions().col(v).norm(), z = (std::max)(r, 1e-9) / decay;
            const double free = r < patch ? 1 - inner * I0(z) : outer * K0(z);
            const double expected = deepest * (free + rim * I0(z));
            if (v == 0) middle = expected;
            worst = (std::max)(worst, std::abs(found[v] - expected) / (std::max)(expected, 0.02 * middle));
        }
        CAPTURE(worst);
        CHECK(worst < 0.02);
    }
}

TEST_CASE("a tensioned disc on a foundation under a point load, from four edges on", "[tension]") {
    Random random(3);
    const Disc disc(random);
    const double load = 1e-6 * disc.tension;  // [N]
    Points<double> loads = Points<double>::Zero(3, disc.mesh.vertex_count());
    loads(2, 0) = -load;
    const auto found = disc.depth_under(loads);
    const double scale = load / (2 * std::numbers::pi * disc.tension);
    double worst = 0;
    for (Index v = 0; v < disc.mesh.vertex_count(); ++v) {
        const double r = disc.mesh.positions().col(v).norm(), z = r / decay;
        if (r < 4 * edge) continue;
        const double expected = scale * (K0(z) - K0(radius / decay) / I0(radius / decay) * I0(z));
        worst = (std::max)(worst, std::abs(found[v] - expected) / (std::max)(expected, 0.02 * scale));
    }
    CAPTURE(worst);
    CHECK(worst < 0.02);
}
