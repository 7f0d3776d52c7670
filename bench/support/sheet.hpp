// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/contact/facet_correction.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/bending_triangles.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/spring_stiffness.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

/// The library's membrane in a scene: triangular springs, bending if it is asked for, pressure, foundation, tools.
///
///     bench::Sheet sheet{.mesh = bench::ring_disc(radii), .material = tissue, .stretch = 1.02};
///     sheet.pinned = membrane::border(sheet.mesh);
///     sheet.pressure = 100;                                                        // [Pa]
///     const auto found = sheet.equilibrium(sheet.mesh.positions());                // Newton's method
namespace bench {

using membrane::Index;
using Vector3 = membrane::Vector3<double>;
using Points = membrane::Points<double>;
using Mesh = membrane::TriangleMesh<double>;
using Tool = membrane::Tool<double>;

/// The force per present length in a flat sheet stretched in all directions (St Venant-Kirchhoff) [N/m].
[[nodiscard]] inline double tension_of(const membrane::Material& material, double stretch) {
    return material.biaxial_stiffness() * (stretch * stretch - 1) / 2;
}

/// A membrane under constant loads.
struct Sheet {
    Mesh mesh;
    membrane::Material material;
    double stretch = 1;           ///< on the mesh
    double rigidity = 0;          ///< of bending [N m]
    bool hinges = true;           ///< whether hinges bend, or triangles
    double pressure = 0;          ///< [Pa]
    double loaded_radius = 1;     ///< the pressure is on triangles within this distance of the z axis [m]
    double foundation = 0;        ///< along the normal [Pa/m]
    std::vector<Index> pinned{};  ///< vertices that keep their positions
    double fine_triangles = membrane::TrackerOptions().fine_triangles;

    /// The equilibrium with pinned vertices where `x` has them. @throws std::runtime_error if none is found
    [[nodiscard]] membrane::Equilibrium equilibrium(const Points& x, const std::vector<Tool>& tools = {}) const;

    /// The same with balls moved back by what flat triangles lack (`FacetCorrection`), by Aitken's iteration. `x` must
    /// be less deep.
    [[nodiscard]] membrane::Equilibrium corrected_equilibrium(const Points& x, const std::vector<Tool>& balls) const;

    /// The force of the membrane on these vertices at `x` [N].
    [[nodiscard]] Vector3 force_on(const std::vector<Index>& vertices, const Points& x) const;

  private:
    template <class Act>
    auto with_model(Act act) const {
        const auto none =
            membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 0.0, .pinned = pinned});
        const auto triangles = membrane::triangular_springs(mesh, material, stretch);
        const auto bending = membrane::bending_triangles(
            mesh, {.rigidity = hinges ? 0 : rigidity, .poisson_ratio = material.poisson_ratio, .supported = pinned});
        const auto folding = membrane::bending_springs(mesh, hinges ? rigidity : 0);
        std::vector<double> stiffness = membrane::vertex_areas(mesh);
        for (double& area : stiffness) area *= foundation;
        const auto springs = membrane::FoundationSprings(mesh, {.normal = stiffness, .tangential = 0.0});
        return act(membrane::Tissue(none, triangles, bending, folding, pressure_loads()), springs);
    }

    using Loads = membrane::Elements<double, membrane::PressureLoad<double>>;

    [[nodiscard]] Loads pressure_loads() const {
        const Loads everywhere = membrane::pressure(mesh, pressure);
        std::vector<Loads::Instance> all(everywhere.all().begin(), everywhere.all().end());
        const auto is_outside = [&](const auto& load) {
            Vector3 middle = Vector3::Zero();
            for (const Index v : load.corners) middle += membrane::point(mesh.positions(), v) / 3;
            return std::hypot(middle.x(), middle.y()) > loaded_radius;
        };
        std::erase_if(all, is_outside);
        return Loads(mesh, std::move(all));
    }
};

/// A disc of rings of 6, 12, 18 ... vertices at these radii, around a vertex in the centre [m].
[[nodiscard]] inline Mesh ring_disc(const std::vector<double>& radii) {
    const auto rings = static_cast<Index>(radii.size());
    const Mesh regular = membrane::disc<double>({.radius = 1, .rings = rings});
    Points x = regular.positions();
    for (Index v = 1; v < x.cols(); ++v) {
        const double distance = std::hypot(x(0, v), x(1, v));
        x.col(v) *= radii[static_cast<std::size_t>(std::lround(distance * rings)) - 1] / distance;
    }
    return {x, regular.triangles()};
}

/// Radii of `rings` rings up to `radius`, of which `inner` are within `patch`. `grading` is the width of the first ring
/// outside over that of the mean one; 1 is uniform.
[[nodiscard]] inline std::vector<double> ring_radii(double patch, int inner, double radius, int rings,
                                                    double grading = 1) {
    std::vector<double> radii;
    for (int i = 1; i <= inner; ++i) radii.push_back(patch * i / inner);
    const int outer = rings - inner;
    for (int i = 1; i <= outer; ++i) {
        const double s = static_cast<double>(i) / outer;
        radii.push_back(patch + (radius - patch) * (grading * s + (1 - grading) * s * s));
    }
    return radii;
}

[[nodiscard]] inline std::string vertices_of(const Mesh& mesh) {
    return std::to_string(mesh.vertex_count()) + " vertices";
}

/// The contact of a tool with the membrane at `x`, as in the first tick.
[[nodiscard]] inline membrane::Contact<double> contact_of(const Mesh& mesh, const Points& x, const Tool& tool,
                                                          membrane::ContactTracker<double>& tracker) {
    membrane::AabbTree<double> tree(mesh);
    tree.refit(x);
    return tracker.update(tree, x, tool);
}

inline membrane::Equilibrium Sheet::equilibrium(const Points& x, const std::vector<Tool>& tools) const {
    return with_model([&](const auto& tissue, const auto& springs) {
        const membrane::ContactTracker<double> tracker(mesh, {.fine_triangles = fine_triangles});
        std::vector<membrane::ContactTracker<double>> trackers(tools.size(), tracker);
        const auto pressed = [&](std::size_t i) {
            return membrane::press(tools[i], contact_of(mesh, x, tools[i], trackers[i]));
        };
        const auto solve = [&](Index increments) {
            const auto run = [&](const auto&... constraints) {
                return membrane::equilibrium(x, mesh, tissue, springs, {.increments = increments}, constraints...);
            };
            if (tools.empty()) return run();
            return tools.size() == 1 ? run(pressed(0)) : run(pressed(0), pressed(1));
        };
        auto found = solve(1);
        if (!found.converged) found = solve(16);  // a distant start
        if (!found.converged) throw std::runtime_error("no equilibrium");
        return found;
    });
}

inline membrane::Equilibrium Sheet::corrected_equilibrium(const Points& x, const std::vector<Tool>& balls) const {
    const membrane::FacetCorrection<double> correction(
        mesh, {.tension = tension_of(material, stretch), .stiffness = material.young_modulus * material.thickness});
    std::vector<Tool> pressed = balls;
    std::vector<Vector3> before(balls.size(), Vector3::Zero());
    std::vector<double> part(balls.size(), 0.7);
    for (int turn = 0; turn < 30; ++turn) {
        const auto found = equilibrium(x, pressed);
        bool done = true;
        for (std::size_t i = 0; i < balls.size(); ++i) {
            membrane::ContactTracker<double> tracker(mesh, {.fine_triangles = 0});
            const auto contact = contact_of(mesh, x, pressed[i], tracker);
            const Vector3 offset = pressed[i].position - balls[i].position;
            const Vector3 change = correction(found.x, contact, found.reactions[i]) - offset;
            done = done && norm(change) < 1e-5 * balls[i].radius;
            const Vector3 difference = change - before[i];
            if (turn > 0) part[i] *= -dot(before[i], difference) / squared_norm(difference);
            part[i] = std::clamp(part[i], 0.2, 1.0);
            pressed[i].position += part[i] * change;
            before[i] = change;
        }
        if (done) return found;
    }
    throw std::runtime_error("the correction does not converge");
}

inline Vector3 Sheet::force_on(const std::vector<Index>& vertices, const Points& x) const {
    return with_model([&](const auto& tissue, const auto& springs) {
        Vector3 sum = Vector3::Zero();
        for (const Index v : vertices) {
            const Vector3 here = membrane::point(x, v);
            sum += tissue.force_on(v, x).force + springs.force_on(v, here, here, 1.0).force;
        }
        return sum;
    });
}

/// The displacement of the surface's point at x = y = 0, by the triangle that is there in the mesh [m].
[[nodiscard]] inline Vector3 middle_displacement(const Mesh& mesh, const Points& x) {
    const Points& from = mesh.positions();
    for (const auto& corners : mesh.triangles().colwise()) {
        const auto area = [&](Index a, Index b) { return from(0, a) * from(1, b) - from(0, b) * from(1, a); };
        const Index a = corners[0], b = corners[1], c = corners[2];
        const Vector3 weights = Vector3(area(b, c), area(c, a), area(a, b)) / (area(b, c) + area(c, a) + area(a, b));
        const Vector3 middle = weights[0] * from.col(a) + weights[1] * from.col(b) + weights[2] * from.col(c);
        if (!(weights.minCoeff() >= -1e-12) || middle.z() < 0) continue;
        return weights[0] * (x.col(a) - from.col(a)) + weights[1] * (x.col(b) - from.col(b)) +
               weights[2] * (x.col(c) - from.col(c));
    }
    throw std::runtime_error("no triangle in the middle");
}

}  // namespace bench
