// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "tissue_shell.hpp"
#include "truth_curved.hpp"

/// Thick shells, with bending: a cornea pressed in by a load on its middle, and plates under pressure.
namespace bench::truth {

/// The load's radius is that of every seventh ring of the rim's.
[[nodiscard]] inline double loaded_angle() { return cornea.rim_angle() / 7; }
[[nodiscard]] inline double loaded_radius() { return cornea.point({loaded_angle(), 0, 0}).x(); }

[[nodiscard]] inline Mesh ring_cornea(int rings) {
    return membrane::spherical_cap<double>(
        {.radius = cornea.across, .diameter = 2 * cornea.rim, .rings = static_cast<Index>(rings)});
}

/// `shear` is the stiffness in shear through the thickness, over that of an isotropic shell.
[[nodiscard]] inline Column calculix_dent(const Effort& effort, const std::string& name, double shear,
                                          const std::vector<double>& pressures) {
    return compared(name, effort.across, [&](int across) {
        const double rim = cornea.rim_angle(), loaded = loaded_angle();
        const Zone under{.radius = loaded, .rings = across / 2},
            outside{.radius = rim, .rings = 2 * across, .growth = 1.1};
        const QuarterDiscOptions options{.across = across, .core = 0.6 * loaded, .zones = {under, outside}};
        ShellSection section = section_of(membrane::materials::cornea().typical);
        section.shear = shear;
        CalculixScene scene = dome_shell(cornea, options, section, false);
        const double limit = loaded_radius() * (1 + 1e-9);
        scene.name_quads("LOADED", [&](const Vector3& x) { return std::hypot(x.x(), x.y()) < limit; });
        for (const double pressure : pressures) {
            scene.add_step(
                {.held = {{"RIM", 1, 3, 0}}, .pressure = -pressure, .loaded = "LOADED", .first_increment = 0.5});
        }
        const auto results = scene.run(effort.folder, "dent" + std::to_string(across));
        return collected(pressures, [&](int i) { return -1e3 * results.displacement("MIDDLE", i + 1).z(); });
    });
}

/// How deep the middle of a cornea goes [mm]; NaN from where there is no equilibrium nearby.
[[nodiscard]] inline std::vector<double> dent_depths(Mesh mesh, const std::vector<double>& pressures, bool hinges) {
    Sheet sheet{.mesh = std::move(mesh),
                .material = membrane::materials::cornea().typical,
                .rigidity = membrane::flexural_rigidity(membrane::materials::cornea().typical),
                .hinges = hinges,
                .loaded_radius = loaded_radius()};
    sheet.pinned = membrane::border(sheet.mesh);
    Points x = sheet.mesh.positions();
    std::vector<double> found(pressures.size(), std::numeric_limits<double>::quiet_NaN());
    try {
        for (std::size_t i = 0; i < pressures.size(); ++i) {
            sheet.pressure = -pressures[i];
            x = sheet.equilibrium(x).x;
            found[i] = -1e3 * middle_displacement(sheet.mesh, x).z();
        }
    } catch (const std::runtime_error&) {  // the dome snaps through
    }
    return found;
}

/// The depth by a shell of revolution in one dimension [mm], which shares no element and no solver with the library.
[[nodiscard]] inline std::vector<double> revolved_depths(int elements, const std::vector<double>& pressures) {
    const auto material = membrane::materials::cornea().typical;
    tissue::RevolvedShell shell({.radius = cornea.across,
                                 .rim = cornea.rim,
                                 .thickness = material.thickness,
                                 .young_modulus = material.young_modulus,
                                 .poisson_ratio = material.poisson_ratio,
                                 .clamped = false},
                                elements, elements / 7);
    return collected(pressures, [&](int i) { return -1e3 * shell.at(-pressures[static_cast<std::size_t>(i)]).rise; });
}

[[nodiscard]] inline Comparison dent(const Effort& effort) {
    Comparison table{.key = "shell",
                     .title = "8a. A cornea that bends, pressed in by a pressure on its middle",
                     .load = "pressure [Pa]",
                     .quantity = "depth [mm]",
                     .bound = 0.03,
                     .bounded = 2,
                     .loads = effort.some({200, 500, 1000, 2000})};
    table.reference = calculix_dent(effort, "CalculiX", 1, table.loads);
    const auto irregular = [&](int rings) {
        return with_circle(dome_sheet(cornea, membrane::materials::cornea().typical, rings).mesh, loaded_radius());
    };
    table.switched = calculix_dent(effort, "CalculiX, 100 times as stiff in shear", 100, table.loads);
    for (const bool hinges : {false, true}) {
        const std::string by = hinges ? ", hinges" : "";
        table.ours.push_back(compared("DistMesh" + by, effort.rings,
                                      [&](int rings) { return dent_depths(irregular(rings), table.loads, hinges); }));
        table.ours.push_back(compared("rings" + by, effort.rings,
                                      [&](int rings) { return dent_depths(ring_cornea(rings), table.loads, hinges); }));
    }
    table.ours.push_back(
        compared("shell of revolution", 140, [&](int elements) { return revolved_depths(elements, table.loads); }));
    return table;
}

inline const membrane::Material thick{.young_modulus = 1e6, .poisson_ratio = 0.45, .thickness = 0.5e-3};

/// The height of the middle of a plate [mm] whose rim may turn.
[[nodiscard]] inline Column calculix_plate(const Effort& effort, const std::vector<double>& pressures) {
    return compared("CalculiX", effort.across, [&](int across) {
        QuarterDiscOptions options = even_disc(across);
        options.zones[0].growth = 0.9;
        const ShellMesh mesh = mirrored(mirrored(quarter_disc(options), 0), 1);
        CalculixScene scene(mesh, section_of(thick));
        const double rim = disc_radius * (1 - 1e-9);
        scene.name_nodes("RIM", mesh.where([&](const Vector3& x) { return x.norm() > rim; }));
        scene.name_nodes("MIDDLE", mesh.where([](const Vector3& x) { return x.norm() == 0; }));
        scene.print("MIDDLE");
        for (const double pressure : pressures) {
            scene.add_step({.held = {{"RIM", 1, 3, 0}}, .pressure = pressure, .first_increment = 0.5});
        }
        const auto results = scene.run(effort.folder, "plate" + std::to_string(across));
        return collected(pressures, [&](int i) { return 1e3 * results.displacement("MIDDLE", i + 1).z(); });
    });
}

[[nodiscard]] inline std::vector<double> plate_heights(Mesh mesh, const std::vector<double>& pressures, bool hinges) {
    Sheet sheet{.mesh = std::move(mesh), .material = thick, .hinges = hinges};
    sheet.rigidity = membrane::flexural_rigidity(thick);
    sheet.pinned = membrane::border(sheet.mesh);
    return heights(sheet, pressures);
}

[[nodiscard]] inline Comparison plate(const Effort& effort) {
    Comparison table{.key = "plate",
                     .title = "8b. A plate of 0.5 mm, its rim free to turn, under pressure",
                     .load = "pressure [Pa]",
                     .quantity = "height [mm]",
                     .bound = 0.03,
                     .bounded = 2,
                     .loads = effort.some({10, 30, 100, 300, 1000})};
    table.reference = calculix_plate(effort, table.loads);
    for (const bool hinges : {false, true}) {
        const std::string by = hinges ? ", hinges" : "";
        table.ours.push_back(compared("DistMesh" + by, effort.rings, [&](int rings) {
            return plate_heights(irregular_disc(rings), table.loads, hinges);
        }));
        table.ours.push_back(compared("rings" + by, effort.rings, [&](int rings) {
            return plate_heights(disc_with_patch(rings), table.loads, hinges);
        }));
    }
    return table;
}

}  // namespace bench::truth
