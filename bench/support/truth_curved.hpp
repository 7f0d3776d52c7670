// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <membrane/meshing/distmesh.hpp>

#include "truth_flat.hpp"

/// Tissues of the eye, by their presets: a cornea and the front of a lens capsule under pressure from inside, both
/// meshed by DistMesh; and the cornea as a thick shell that bends.
namespace bench::truth {

/// The part of an ellipsoid around the z axis above a plane.
struct Dome {
    double across, along;  ///< radii [m]
    double rim;            ///< radius of the border [m]

    [[nodiscard]] double rim_angle() const { return std::asin(rim / across); }
    [[nodiscard]] double rim_height() const { return along * std::cos(rim_angle()); }
    [[nodiscard]] membrane::Ellipsoid body() const { return {.radii = {across, across, along}}; }

    /// The point for one of the plane, at the angle from the pole by its distance from the origin.
    [[nodiscard]] Vector3 point(const Vector3& flat) const {
        const double angle = flat.norm();
        const double sine = angle > 0 ? std::sin(angle) / angle : 1;
        return {across * sine * flat.x(), across * sine * flat.y(), along * std::cos(angle)};
    }
};

inline const Dome cornea{.across = 7.8e-3, .along = 7.8e-3, .rim = 5.8e-3};
/// Nearer to its equator, a pressure from inside would compress the capsule.
inline const Dome capsule_front{.across = 4.5e-3, .along = 2e-3, .rim = 3.4e-3};

/// The other program's dome, held at its rim. Sets: RIM, MIDDLE and, of a quarter, X0 and Y0.
[[nodiscard]] inline CalculixScene dome_shell(const Dome& dome, const QuarterDiscOptions& options,
                                              const ShellSection& section, bool quarter) {
    ShellMesh mesh = quarter_disc(options);
    if (!quarter) mesh = mirrored(mirrored(mesh, 0), 1);
    const double rim = dome.rim_angle() * (1 - 1e-9);
    const auto at_rim = mesh.where([&](const Vector3& x) { return x.norm() > rim; });
    const auto middle = mesh.where([](const Vector3& x) { return x.norm() == 0; });
    const auto x0 = mesh.where([](const Vector3& x) { return x.x() == 0; });
    const auto y0 = mesh.where([](const Vector3& x) { return x.y() == 0; });
    for (Vector3& node : mesh.nodes) node = dome.point(node);
    CalculixScene scene(mesh, section);
    scene.name_nodes("RIM", at_rim);
    scene.name_nodes("MIDDLE", middle);
    scene.name_nodes("X0", x0);
    scene.name_nodes("Y0", y0);
    scene.print("MIDDLE");
    return scene;
}

/// The rise of the middle under each pressure [mm], in the limit of a membrane unless `part` of the thickness is 1.
[[nodiscard]] inline Column calculix_dome(const Effort& effort, const std::string& name, const Dome& dome,
                                          const membrane::Material& material, double part,
                                          const std::vector<double>& pressures) {
    const bool quarter = part < 1;  // with bending, symmetry would need prescribed rotations
    const auto solve = [&](int across) {
        const double rim = dome.rim_angle();
        const QuarterDiscOptions options{
            .across = across, .core = 0.4 * rim, .zones = {{.radius = rim, .rings = 4 * across, .growth = 0.93}}};
        CalculixScene scene = dome_shell(dome, options, section_of(material).thinned(part), quarter);
        std::vector<Prescribed> held{{"RIM", 1, 3, 0}};
        if (quarter) held.insert(held.end(), {{"X0", 1, 1, 0}, {"Y0", 2, 2, 0}});
        for (const double pressure : pressures) {
            scene.add_step({.held = held, .pressure = pressure, .first_increment = 0.2});
        }
        const auto results = scene.run(effort.folder, "dome" + std::to_string(across));
        return collected(pressures, [&](int i) { return 1e3 * results.displacement("MIDDLE", i + 1).z(); });
    };
    return part < 1 ? compared(name, effort.across, solve) : single(name, [&] { return solve(effort.across / 2); });
}

/// The dome by DistMesh, with about as many vertices as a disc of `rings` rings.
[[nodiscard]] inline Sheet dome_sheet(const Dome& dome, const membrane::Material& material, int rings) {
    const membrane::HalfSpace above{.point = {0, 0, dome.rim_height()}, .normal = {0, 0, -1}};
    const double edge = std::hypot(dome.rim, dome.along - dome.rim_height()) / rings;
    Sheet sheet{.mesh = membrane::distmesh(membrane::trimmed(dome.body(), above), {.edge_length = edge}),
                .material = material};
    sheet.pinned = membrane::border(sheet.mesh);
    return sheet;
}

/// A dome under pressure, as a membrane and as a shell.
[[nodiscard]] inline Comparison dome_under_pressure(const Effort& effort, Comparison table, const Dome& dome,
                                                    const membrane::Material& material) {
    table.reference = calculix_dome(effort, "CalculiX", dome, material, 0.02, table.loads);
    const Sheet fine = dome_sheet(dome, material, effort.rings);
    table.ours.push_back(compared(vertices_of(fine.mesh), effort.rings,
                                  [&](int rings) { return heights(dome_sheet(dome, material, rings), table.loads); }));
    table.ours.push_back(single("with bending", [&] {
        Sheet sheet = fine;
        sheet.rigidity = membrane::flexural_rigidity(material);
        return heights(sheet, table.loads);
    }));
    table.ours.push_back(calculix_dome(effort, "CalculiX, real thickness", dome, material, 1, table.loads));
    return table;
}

[[nodiscard]] inline Comparison cap(const Effort& effort) {
    return dome_under_pressure(effort,
                               {.key = "cap",
                                .title = "4. A cornea by DistMesh under the pressure in the eye",
                                .load = "pressure [Pa]",
                                .quantity = "rise [mm]",
                                .bound = 0.01,
                                .loads = effort.some({250, 500, 1000, 2000, 4000})},
                               cornea, membrane::materials::cornea().typical);
}

[[nodiscard]] inline Comparison capsule(const Effort& effort) {
    return dome_under_pressure(effort,
                               {.key = "capsule",
                                .title = "7. The front of a lens capsule by DistMesh under pressure",
                                .load = "pressure [Pa]",
                                .quantity = "rise [mm]",
                                .bound = 0.01,
                                .loads = effort.some({100, 300, 1000, 2000, 4000})},
                               capsule_front, membrane::materials::lens_capsule().typical);
}

}  // namespace bench::truth
