// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <membrane/meshing/distmesh.hpp>
#include <membrane/meshing/graded_edge_length.hpp>

#include "calculix.hpp"
#include "comparison.hpp"
#include "sheet.hpp"
#include "truth.hpp"

/// A flat disc, stretched by 2 %, its rim fixed: under pressure, pulled at a rigid patch, on a foundation.
namespace bench::truth {

inline constexpr double disc_radius = 5e-3, disc_stretch = 1.02, patch_radius = 0.5e-3;  // [m], 1, [m]
inline const membrane::Material soft{.young_modulus = 1e6, .poisson_ratio = 0.45, .thickness = 50e-6};

[[nodiscard]] inline ShellSection section_of(const membrane::Material& material) {
    return {material.young_modulus, material.poisson_ratio, material.thickness};
}

/// The other program's disc, by its stretched quarter; the first step stretches it in its plane. Sets: RIM, X0 and
/// Y0 (the planes of symmetry), MIDDLE, PATCH. `still` is prescribed in this step only.
class FlatShell {
  public:
    FlatShell(ShellMesh quarter, const ShellSection& section, const std::vector<Prescribed>& still = {})
        : scene(unstretched(std::move(quarter)), section) {
        const ShellMesh& mesh = scene.mesh();
        const double radius = disc_radius / disc_stretch, patch = patch_radius / disc_stretch, tiny = 1e-9 * radius;
        const auto rim = mesh.where([&](const Vector3& x) { return x.norm() > radius - tiny; });
        held_ = mesh.where([&](const Vector3& x) { return x.norm() < patch + tiny; });
        scene.name_nodes("RIM", rim);
        scene.name_nodes("PATCH", held_);
        scene.name_nodes("MIDDLE", mesh.where([&](const Vector3& x) { return x.norm() == 0; }));
        scene.name_nodes("X0", mesh.where([](const Vector3& x) { return x.x() == 0; }));
        scene.name_nodes("Y0", mesh.where([](const Vector3& x) { return x.y() == 0; }));
        const auto stretched = [&](const std::vector<Index>& nodes) {
            std::vector<std::pair<Index, Vector3>> all;
            for (const Index node : nodes) {
                all.emplace_back(node, (disc_stretch - 1) * mesh.nodes[static_cast<std::size_t>(node)]);
            }
            return all;
        };
        scene.name_displacements("RIMSTRETCH", stretched(rim));
        scene.name_displacements("PATCHSTRETCH", stretched(held_));
        auto flat = supports_;
        flat.push_back({"SHELLN", 3, 3, 0});
        flat.insert(flat.end(), still.begin(), still.end());
        scene.add_step({.held = flat});
    }

    /// One more step, with these prescribed besides the rim.
    void add_step(std::vector<Prescribed> prescribed, double pressure = 0) {
        auto held = supports_;
        held.push_back({"RIM", 3, 3, 0});
        held.insert(held.end(), prescribed.begin(), prescribed.end());
        scene.add_step({.held = held, .pressure = pressure, .first_increment = steps_ == 1 ? 0.1 : 1});
        ++steps_;
    }

    /// One more step that moves the patch along z.
    void add_patch_step(double displacement) { add_step({{"PATCHSTRETCH", 1, 2, 0}, {"PATCH", 3, 3, displacement}}); }

    /// The area of the patch's nodes in the stretched quarter [m^2].
    [[nodiscard]] double held_area() const {
        double sum = 0;
        const auto areas = stretched_areas();
        for (const Index node : held_) sum += areas[static_cast<std::size_t>(node)];
        return sum;
    }
    [[nodiscard]] std::vector<double> stretched_areas() const {
        auto areas = lumped_areas(scene.mesh());
        for (double& area : areas) area *= disc_stretch * disc_stretch;
        return areas;
    }

    CalculixScene scene;

  private:
    [[nodiscard]] static ShellMesh unstretched(ShellMesh mesh) {
        for (Vector3& node : mesh.nodes) node = node / disc_stretch;
        return mesh;
    }

    std::vector<Index> held_;
    std::vector<Prescribed> supports_{{"X0", 1, 1, 0}, {"Y0", 2, 2, 0}, {"RIMSTRETCH", 1, 2, 0}};
    int steps_ = 1;
};

/// Rings and core for scenes without a patch.
[[nodiscard]] inline QuarterDiscOptions even_disc(int across) {
    return {.across = across, .core = 0.5 * disc_radius, .zones = {{.radius = disc_radius, .rings = 3 * across / 2}}};
}

/// Rings that become finer towards the patch.
[[nodiscard]] inline QuarterDiscOptions patch_disc(int across) {
    return {.across = across,
            .core = 0.6 * patch_radius,
            .zones = {{.radius = patch_radius, .rings = across / 2},
                      {.radius = disc_radius, .rings = 4 * across, .growth = std::pow(30.0, 1.0 / (4 * across))}}};
}

[[nodiscard]] inline Sheet flat_sheet(Mesh mesh) {
    Sheet sheet{.mesh = std::move(mesh), .material = soft, .stretch = disc_stretch};
    sheet.pinned = membrane::border(sheet.mesh);
    return sheet;
}

/// Rings of about the same width, one of them on the rim of the patch.
[[nodiscard]] inline Mesh disc_with_patch(int rings, double grading = 1) {
    const int inner = static_cast<int>(std::ceil(patch_radius / disc_radius * rings));
    return ring_disc(ring_radii(patch_radius, inner, disc_radius, rings, grading));
}

/// A disc by DistMesh with about as many vertices as `rings` rings.
[[nodiscard]] inline Mesh irregular_disc(int rings) {
    const auto flat = membrane::trimmed(membrane::HalfSpace{}, membrane::Ball{.radius = disc_radius});
    const double r = 1.1 * disc_radius;
    return membrane::distmesh(
        flat, {.edge_length = disc_radius / rings, .bounds = membrane::Bounds{{-r, -r, -r / 8}, {r, r, r / 8}}});
}

/// A disc by DistMesh whose edges grow from these loads, a foundation of this stiffness [Pa/m] below; about as many
/// vertices as `rings` rings.
[[nodiscard]] inline Mesh disc_for_loads(int rings, const std::vector<membrane::GradedLoad>& loads,
                                         double foundation = 0) {
    const auto flat = membrane::trimmed(membrane::HalfSpace{}, membrane::Ball{.radius = disc_radius});
    const double r = 1.1 * disc_radius, edge = disc_radius / rings;
    const auto length = membrane::graded_edge_length({.longest = 1.3 * edge,
                                                      .loads = loads,
                                                      .tension = tension_of(soft, disc_stretch),
                                                      .foundation = foundation,
                                                      .resolution = 8 * rings / 28.0,
                                                      .growth = 0.15});
    return membrane::distmesh(
        flat,
        {.edge_length = length, .bounds = membrane::Bounds{{-r, -r, -r / 8}, {r, r, r / 8}}, .spacing = edge / 2});
}

/// The height of the middle under each pressure [mm].
[[nodiscard]] inline std::vector<double> heights(Sheet sheet, const std::vector<double>& pressures) {
    Points x = sheet.mesh.positions();
    std::vector<double> found;
    for (const double pressure : pressures) {
        sheet.pressure = pressure;
        x = sheet.equilibrium(x).x;
        found.push_back(1e3 * middle_displacement(sheet.mesh, x).z());
    }
    return found;
}

/// The force along `sign` z on the patch at each displacement along it [mm], with the vertices `held` [mN].
[[nodiscard]] inline std::vector<double> patch_forces(Sheet sheet, const std::vector<Index>& held, double sign,
                                                      const std::vector<double>& displacements) {
    sheet.pinned.insert(sheet.pinned.end(), held.begin(), held.end());
    Points x = sheet.mesh.positions();
    std::vector<double> found;
    for (const double displacement : displacements) {
        for (const Index v : held) x(2, v) = sheet.mesh.positions()(2, v) + sign * 1e-3 * displacement;
        x = sheet.equilibrium(x).x;
        found.push_back(-sign * 1e3 * sheet.force_on(held, x).z());
    }
    return found;
}

[[nodiscard]] inline std::vector<Index> within(const Mesh& mesh, double radius) {
    std::vector<Index> found;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        if (std::hypot(mesh.positions()(0, v), mesh.positions()(1, v)) < radius) found.push_back(v);
    }
    return found;
}

[[nodiscard]] inline Column calculix_pressure(const Effort& effort, const std::vector<double>& pressures) {
    return compared("CalculiX", effort.across, [&](int across) {
        FlatShell shell(quarter_disc(even_disc(across)), section_of(soft).thinned(0.02));
        for (const double pressure : pressures) shell.add_step({}, pressure);
        shell.scene.print("MIDDLE");
        const auto results = shell.scene.run(effort.folder, "pressure" + std::to_string(across));
        return collected(pressures, [&](int i) { return 1e3 * results.displacement("MIDDLE", i + 2).z(); });
    });
}

[[nodiscard]] inline Column calculix_patch(const Effort& effort, const std::string& name, double part, double sign,
                                           double foundation, const std::vector<double>& displacements) {
    const int fine = foundation > 0 ? 2 * effort.across : effort.across;  // springs at nodes converge slowly
    const auto solve = [&](int across) {
        FlatShell shell(quarter_disc(patch_disc(across)), section_of(soft).thinned(part));
        if (foundation > 0) shell.scene.add_foundation(foundation, shell.stretched_areas());
        for (const double displacement : displacements) shell.add_patch_step(sign * 1e-3 * displacement);
        shell.scene.print("PATCH");
        const auto results = shell.scene.run(effort.folder, "patch" + std::to_string(across));
        // Forces of springs on prescribed nodes are not in the sum.
        return collected(displacements, [&](int i) {
            const double springs = foundation * shell.held_area() * 1e-3 * displacements[static_cast<std::size_t>(i)];
            return 4 * 1e3 * (sign * results.force("PATCH", i + 2).z() + springs);
        });
    };
    return part < 1 ? compared(name, fine, solve) : single(name, [&] { return solve(fine); });
}

[[nodiscard]] inline Comparison pressure(const Effort& effort) {
    Comparison table{.key = "pressure",
                     .title = "1. Pressure on a disc with a fixed rim",
                     .load = "pressure [Pa]",
                     .quantity = "height [mm]",
                     .bound = 0.001,
                     .loads = effort.some({100, 300, 500, 1000, 3000})};
    table.reference = calculix_pressure(effort, table.loads);
    table.ours.push_back(compared(effort.rings_name(), effort.rings,
                                  [&](int rings) { return heights(flat_sheet(disc_with_patch(rings)), table.loads); }));
    return table;
}

/// The mesh with those vertices that are nearest to the circle of this radius around the z axis moved onto it, along
/// the surface if that is a plane z = 0 or a sphere around the origin: then a load within is as large as it is meant to
/// be.
[[nodiscard]] inline Mesh with_circle(const Mesh& mesh, double radius) {
    Points x = mesh.positions();
    const auto from_axis = [&](Index v) { return std::hypot(mesh.positions()(0, v), mesh.positions()(1, v)); };
    for (const auto& corners : mesh.triangles().colwise()) {
        for (Eigen::Index k = 0; k < 3; ++k) {
            const Index a = corners[k], b = corners[(k + 1) % 3];
            const double inside = from_axis(a) - radius, outside = from_axis(b) - radius;
            if (inside * outside > 0) continue;  // the edge does not cross the circle
            const Index nearest = std::abs(inside) < std::abs(outside) ? a : b;
            const auto& from = mesh.positions().col(nearest);
            const bool is_flat = std::abs(from.z()) < 1e-6 * from.norm();
            const double height = is_flat ? 0 : std::sqrt(from.squaredNorm() - radius * radius);
            x.col(nearest) = radius / from_axis(nearest) * from;
            x(2, nearest) = height;
        }
    }
    return {x, mesh.triangles()};
}

[[nodiscard]] inline Column patch_column(const std::string& name, int rings, double grading, double sign,
                                         double foundation, double rigidity, const std::vector<double>& loads) {
    return compared(name, rings, [&](int count) {
        Sheet sheet = flat_sheet(disc_with_patch(count, grading));
        sheet.foundation = foundation;
        sheet.rigidity = rigidity;
        return patch_forces(sheet, within(sheet.mesh, patch_radius * (1 + 1e-9)), sign, loads);
    });
}

[[nodiscard]] inline Comparison patch(const Effort& effort) {
    Comparison table{.key = "patch",
                     .title = "2. A glued rigid patch, pulled",
                     .load = "displacement [mm]",
                     .quantity = "force [mN]",
                     .bound = 0.003,
                     .loads = effort.some({0.1, 0.3, 0.5, 1, 1.5})};
    table.reference = calculix_patch(effort, "CalculiX", 0.01, 1, 0, table.loads);
    const double rigidity = membrane::flexural_rigidity(soft);
    table.ours.push_back(patch_column(effort.rings_name(), effort.rings, 1, 1, 0, 0, table.loads));
    table.ours.push_back(patch_column("with bending", effort.rings, 1, 1, 0, rigidity, table.loads));
    table.ours.push_back(calculix_patch(effort, "CalculiX, real thickness", 1, 1, 0, table.loads));
    return table;
}

[[nodiscard]] inline Comparison foundation(const Effort& effort) {
    constexpr double stiffness = 2e7;  // [Pa/m]
    Comparison table{.key = "foundation",
                     .title = "3. The patch pressed into a disc on a stiff foundation",
                     .load = "depth [mm]",
                     .quantity = "force [mN]",
                     .bound = 0.01,
                     .loads = effort.some({0.025, 0.05, 0.1, 0.15, 0.2})};
    table.reference = calculix_patch(effort, "CalculiX", 0.01, -1, stiffness, table.loads);
    const auto ours = [&](const std::string& name, int rings, double grading, double rigidity) {
        return patch_column(name, rings, grading, -1, stiffness, rigidity, table.loads);
    };
    const auto disc = [&](int rings) {
        return with_circle(disc_for_loads(rings, {{.radius = patch_radius}}, stiffness), patch_radius);
    };
    table.ours.push_back(
        compared("graded by DistMesh, " + vertices_of(disc(effort.rings)), effort.rings, [&](int rings) {
            Sheet sheet = flat_sheet(disc(rings));
            sheet.foundation = stiffness;
            return patch_forces(sheet, within(sheet.mesh, patch_radius * (1 + 1e-9)), -1, table.loads);
        }));
    table.ours.push_back(ours("even, " + effort.rings_name(), effort.rings, 1, 0));
    table.ours.push_back(ours("graded rings", effort.rings, 0.3, 0));
    table.ours.push_back(ours("graded rings, with bending", effort.rings, 0.3, membrane::flexural_rigidity(soft)));
    table.ours.push_back(calculix_patch(effort, "CalculiX, real thickness", 1, -1, stiffness, table.loads));
    return table;
}

[[nodiscard]] inline Comparison irregular_pressure(const Effort& effort) {
    Comparison table{.key = "irregular_pressure",
                     .title = "5a. Pressure on a disc by DistMesh, beside the disc of rings",
                     .load = "pressure [Pa]",
                     .quantity = "height [mm]",
                     .bound = 0.001,
                     .loads = effort.some({100, 300, 500, 1000, 3000})};
    table.reference = calculix_pressure(effort, table.loads);
    table.ours.push_back(compared(vertices_of(irregular_disc(effort.rings)), effort.rings,
                                  [&](int rings) { return heights(flat_sheet(irregular_disc(rings)), table.loads); }));
    table.ours.push_back(compared("rings, " + effort.rings_name(), effort.rings,
                                  [&](int rings) { return heights(flat_sheet(disc_with_patch(rings)), table.loads); }));
    return table;
}

[[nodiscard]] inline Comparison irregular_patch(const Effort& effort) {
    Comparison table{.key = "irregular_patch",
                     .title = "5b. A patch on a disc by DistMesh, beside the disc of rings",
                     .load = "displacement [mm]",
                     .quantity = "force [mN]",
                     .bound = 0.003,
                     .loads = effort.some({0.1, 0.3, 0.5, 1, 1.5})};
    table.reference = calculix_patch(effort, "CalculiX", 0.01, 1, 0, table.loads);
    const Mesh fine = irregular_disc(effort.rings);
    table.ours.push_back(compared(vertices_of(fine), effort.rings, [&](int rings) {
        const Mesh mesh = with_circle(irregular_disc(rings), patch_radius);
        return patch_forces(flat_sheet(mesh), within(mesh, patch_radius * (1 + 1e-9)), 1, table.loads);
    }));
    table.ours.push_back(single("vertices within, not moved", [&] {
        return patch_forces(flat_sheet(fine), within(fine, patch_radius), 1, table.loads);
    }));
    table.ours.push_back(patch_column("rings, " + effort.rings_name(), effort.rings, 1, 1, 0, 0, table.loads));
    return table;
}

}  // namespace bench::truth
