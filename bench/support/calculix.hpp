// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "shell_mesh.hpp"

/// A scene in the input language of CalculiX, its run, and its results. Here all is in SI units; CalculiX gets
/// mm, N and MPa.
///
///     bench::CalculixScene scene(mesh, {.young_modulus = 1e6, .poisson_ratio = 0.45, .thickness = 50e-6});
///     scene.name_nodes("RIM", rim);
///     scene.add_step({.held = {{"RIM", 1, 3, 0}}, .pressure = 100});
///     scene.print("RIM");
///     const auto results = scene.run("build/bench/truth", "disc");
///     results.force("RIM", 1);                                                                   // after step 1 [N]
namespace bench {

/// An isotropic shell, but for shear through its thickness.
struct ShellSection {
    double young_modulus, poisson_ratio, thickness;  ///< [Pa], 1, [m]
    double shear = 1;  ///< stiffness in shear through the thickness, over that of an isotropic shell

    /// The same stiffness E t in the surface, and `part` of the thickness: `part` squared of the bending stiffness.
    [[nodiscard]] ShellSection thinned(double part) const {
        return {young_modulus / part, poisson_ratio, part * thickness, shear};
    }
};

/// Displacement components `first` to `last` (1 to 3) of a set of nodes, prescribed [m].
struct Prescribed {
    std::string nodes;
    int first, last;
    double displacement;
};

/// One load step, to be reached from the one before.
struct CalculixStep {
    std::vector<Prescribed> held;
    double pressure = 0;           ///< along the normal, +z on a flat mesh, half of it on each face [Pa]
    std::string loaded = "SHELL";  ///< quads under pressure, all by default
    double first_increment = 1;    ///< part of the step that is tried first
};

/// Displacements and forces at the end of each step.
class CalculixResults {
  public:
    explicit CalculixResults(const std::filesystem::path& dat);

    /// Of the only node of `set` [m].
    [[nodiscard]] Vector3 displacement(const std::string& set, int step) const {
        return 1e-3 * at("displacements " + set, step);
    }
    /// The sum of the external forces on the nodes of `set` [N].
    [[nodiscard]] Vector3 force(const std::string& set, int step) const { return at("force " + set, step); }

  private:
    [[nodiscard]] Vector3 at(const std::string& quantity, int step) const {
        const auto found = values_.find({quantity, step});
        if (found == values_.end())
            throw std::runtime_error("CalculiX: no " + quantity + ", step " + std::to_string(step));
        return found->second;
    }
    std::map<std::pair<std::string, int>, Vector3> values_;
};

/// A shell with supports, loads and contact. Steps count from 1.
class CalculixScene {
  public:
    CalculixScene(ShellMesh mesh, const ShellSection& section);

    [[nodiscard]] const ShellMesh& mesh() const noexcept { return mesh_; }

    void name_nodes(const std::string& name, const std::vector<Index>& nodes);

    /// Prescribes displacements of each node on its own [m], as a `Prescribed` cannot.
    void name_displacements(const std::string& name, const std::vector<std::pair<Index, Vector3>>& nodes);

    /// The quads whose nodes are all where `is_in(position)` holds.
    template <class Predicate>
    void name_quads(const std::string& name, Predicate is_in) {
        model_ << "*ELSET,ELSET=" << name << '\n';
        for (std::size_t q = 0; q < mesh_.quads.size(); ++q) {
            const auto& quad = mesh_.quads[q];
            const auto inside = [&](Index node) { return is_in(mesh_.nodes[static_cast<std::size_t>(node)]); };
            if (std::all_of(quad.begin(), quad.end(), inside)) model_ << q + 1 << ",\n";
        }
        add_faces(name);
    }

    /// A spring along z on each node, `stiffness` times its area [N/m^3].
    void add_foundation(double stiffness, const std::vector<double>& areas);

    /// A rigid ball above the shell, without friction, `gap` over the plane z = 0. Its nodes are named `name`.
    void add_ball(const std::string& name, const Vector3& bottom, double radius, const ShellMesh& directions);

    /// Prints displacements of the set if it is one node, and the sum of its forces.
    void print(const std::string& set) { printed_.push_back(set); }

    void add_step(const CalculixStep& step) { steps_.push_back(step); }

    /// Writes `name`.inp to `folder`, and runs `ccx` there. Throws std::runtime_error if it does not converge.
    [[nodiscard]] CalculixResults run(const std::filesystem::path& folder, const std::string& name) const;

  private:
    static constexpr double mm = 1e3, mpa = 1e-6;

    void add_section(const ShellSection& section);
    /// Axes of each quad in its surface.
    void add_orientation();
    /// The two faces of these quads, to be loaded.
    void add_faces(const std::string& quads) {
        for (const char* const face : {"SPOS", "SNEG"}) {
            model_ << "*SURFACE,NAME=" << quads << face << ",TYPE=ELEMENT\n" << quads << ',' << face << '\n';
        }
    }
    void write(std::ostream& out) const;
    void write(std::ostream& out, const CalculixStep& step) const;
    Index add_node(const Vector3& position);

    ShellMesh mesh_;
    ShellSection section_;
    std::ostringstream model_;
    Index node_count_ = 0, element_count_ = 0;
    std::map<std::string, std::vector<std::pair<Index, Vector3>>> displacements_;
    std::vector<std::string> printed_;
    std::vector<CalculixStep> steps_;
};

/// Whether `ccx` can be run.
[[nodiscard]] inline bool has_calculix() { return std::system("command -v ccx > /dev/null") == 0; }

inline CalculixResults::CalculixResults(const std::filesystem::path& dat) {
    std::ifstream file(dat);
    std::string quantity;
    int step = 0;
    for (std::string line; std::getline(file, line);) {
        std::istringstream words(line);
        if (const auto name = line.find("for set "); name != std::string::npos) {
            std::string set, ignored;
            double time = 0;
            std::istringstream(line.substr(name + 8)) >> set >> ignored >> ignored >> time;
            quantity = (line.find("force") != std::string::npos ? "force " : "displacements ") + set;
            step = static_cast<int>(std::lround(time));
            continue;
        }
        Vector3 value;
        double node = 0;
        if (quantity.rfind("displ", 0) == 0) words >> node;
        if (words >> value.x() >> value.y() >> value.z()) values_[{quantity, step}] = value;
    }
}

inline CalculixScene::CalculixScene(ShellMesh mesh, const ShellSection& section)
    : mesh_(std::move(mesh)), section_(section) {
    model_.precision(12);
    model_ << "*NODE,NSET=SHELLN\n";
    for (const Vector3& position : mesh_.nodes) add_node(position);
    model_ << "*ELEMENT,TYPE=S8R,ELSET=SHELL\n";
    for (const Quad& quad : mesh_.quads) {
        model_ << ++element_count_;
        for (const Index node : quad) model_ << ',' << node + 1;
        model_ << '\n';
    }
    add_section(section);
    add_faces("SHELL");
}

inline void CalculixScene::add_section(const ShellSection& section) {
    const double young = mpa * section.young_modulus, nu = section.poisson_ratio, shear = young / (2 * (1 + nu));
    const bool is_isotropic = section.shear == 1;
    model_ << "*MATERIAL,NAME=SHEET\n*ELASTIC";
    if (is_isotropic) {
        model_ << '\n' << young << ',' << nu << '\n';
    } else {
        model_ << ",TYPE=ENGINEERING CONSTANTS\n";
        for (const double constant : {young, young, young, nu, nu, nu, shear}) model_ << constant << ',';
        model_ << section.shear * shear << ",\n" << section.shear * shear << '\n';
        add_orientation();
    }
    model_ << "*SHELL SECTION,ELSET=SHELL,MATERIAL=SHEET" << (is_isotropic ? "" : ",ORIENTATION=AXES") << '\n'
           << mm * section.thickness << '\n';
}

inline void CalculixScene::add_orientation() {
    model_ << "*DISTRIBUTION,NAME=INPLANE\n,1,0,0,0,1,0\n";
    for (std::size_t q = 0; q < mesh_.quads.size(); ++q) {
        const auto corner = [&](std::size_t i) { return mesh_.nodes[static_cast<std::size_t>(mesh_.quads[q][i])]; };
        const Vector3 first = corner(2) - corner(0), normal = membrane::cross<double>(first, corner(3) - corner(1));
        const Vector3 second = membrane::cross<double>(normal, first);
        model_ << q + 1;
        for (const Vector3& axis : {Vector3(first / norm(first)), Vector3(second / norm(second))}) {
            for (Eigen::Index k = 0; k < 3; ++k) model_ << ',' << axis[k];
        }
        model_ << '\n';
    }
    model_ << "*ORIENTATION,NAME=AXES,SYSTEM=RECTANGULAR\nINPLANE\n";
}

inline Index CalculixScene::add_node(const Vector3& position) {
    model_ << ++node_count_;
    for (Eigen::Index k = 0; k < 3; ++k) model_ << ',' << mm * position[k];
    model_ << '\n';
    return node_count_;
}

inline void CalculixScene::name_nodes(const std::string& name, const std::vector<Index>& nodes) {
    model_ << "*NSET,NSET=" << name << '\n';
    for (const Index node : nodes) model_ << node + 1 << ",\n";
}

inline void CalculixScene::name_displacements(const std::string& name,
                                              const std::vector<std::pair<Index, Vector3>>& nodes) {
    displacements_[name] = nodes;
}

inline void CalculixScene::add_foundation(double stiffness, const std::vector<double>& areas) {
    for (std::size_t node = 0; node < areas.size(); ++node) {
        model_ << "*ELEMENT,TYPE=SPRING1,ELSET=K" << node << '\n'
               << ++element_count_ << ',' << node + 1 << "\n*SPRING,ELSET=K" << node << "\n3\n"
               << stiffness * areas[node] / mm << '\n';
    }
}

inline void CalculixScene::add_ball(const std::string& name, const Vector3& bottom, double radius,
                                    const ShellMesh& directions) {
    std::map<Index, std::array<Index, 2>> nodes;  // outside, inside
    model_ << "*NODE,NSET=" << name << '\n';
    for (const Quad& quad : directions.quads) {
        for (std::size_t i = 0; i < 4; ++i) {
            if (nodes.count(quad[i]) != 0) continue;
            const Vector3& flat = directions.nodes[static_cast<std::size_t>(quad[i])];
            const double angle = flat.norm();
            const Vector3 across = angle > 0 ? Vector3(std::sin(angle) / angle * flat) : Vector3(Vector3::Zero());
            const Vector3 direction = across - std::cos(angle) * Vector3::UnitZ();
            const Vector3 centre = bottom + radius * Vector3::UnitZ();
            nodes[quad[i]] = {add_node(centre + radius * direction), add_node(centre + 0.8 * radius * direction)};
        }
    }
    model_ << "*ELEMENT,TYPE=C3D8,ELSET=" << name << '\n';
    for (const Quad& quad : directions.quads) {
        model_ << ++element_count_;
        for (const std::size_t side : {0U, 1U}) {
            for (std::size_t i = 0; i < 4; ++i) model_ << ',' << nodes[quad[i]][side];
        }
        model_ << '\n';
    }
    // Rigid: all nodes are prescribed. The numbers do not matter.
    model_ << "*SOLID SECTION,ELSET=" << name << ",MATERIAL=SHEET\n*SURFACE,NAME=S" << name << ",TYPE=ELEMENT\n"
           << name << ",S1\n*SURFACE,NAME=T" << name << ",TYPE=ELEMENT\n";
    for (std::size_t q = 0; q < mesh_.quads.size(); ++q) {
        const Vector3 offset = mesh_.nodes[static_cast<std::size_t>(mesh_.quads[q][0])] - bottom;
        if (std::hypot(offset.x(), offset.y()) < 1.5 * radius) model_ << q + 1 << ",SPOS\n";
    }
    model_ << "*SURFACE INTERACTION,NAME=I" << name << "\n*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR\n500\n"
           << "*CONTACT PAIR,INTERACTION=I" << name << ",TYPE=SURFACE TO SURFACE\nT" << name << ",S" << name << '\n';
}

inline void CalculixScene::write(std::ostream& out, const CalculixStep& step) const {
    out << "*STEP,NLGEOM,INC=1000\n*STATIC\n" << step.first_increment << ",1\n*BOUNDARY,OP=NEW\n";
    for (const Prescribed& held : step.held) {
        const auto each = displacements_.find(held.nodes);
        if (each == displacements_.end()) {
            out << held.nodes << ',' << held.first << ',' << held.last << ',' << mm * held.displacement << '\n';
            continue;
        }
        for (const auto& [node, displacement] : each->second) {
            for (int k = held.first; k <= held.last; ++k) {
                out << node + 1 << ',' << k << ',' << k << ',' << mm * displacement[k - 1] << '\n';
            }
        }
    }
    // The area of one face would be that of the middle surface times (1 + t / 2R)^2 or (1 - t / 2R)^2.
    if (step.pressure != 0) {
        const double half = mpa * step.pressure / 2;
        out << "*DSLOAD,OP=NEW\n"
            << step.loaded << "SPOS,P," << -half << '\n'
            << step.loaded << "SNEG,P," << half << '\n';
    }
    for (const std::string& set : printed_) {
        out << "*NODE PRINT,NSET=" << set << ",FREQUENCY=1000\nU\n*NODE PRINT,NSET=" << set
            << ",FREQUENCY=1000,TOTALS=ONLY\nRF\n";
    }
    out << "*END STEP\n";
}

inline void CalculixScene::write(std::ostream& out) const {
    out.precision(12);
    out << model_.str();
    for (const CalculixStep& step : steps_) write(out, step);
}

inline CalculixResults CalculixScene::run(const std::filesystem::path& folder, const std::string& name) const {
    std::filesystem::create_directories(folder);
    std::filesystem::remove(folder / (name + ".dat"));
    std::ofstream file(folder / (name + ".inp"));
    write(file);
    file.close();
    const std::string command = "cd '" + folder.string() + "' && ccx " + name + " > " + name + ".log 2>&1";
    const int status = std::system(command.c_str());
    if (status != 0) throw std::runtime_error("CalculiX did not converge: " + (folder / (name + ".log")).string());
    return CalculixResults(folder / (name + ".dat"));
}

}  // namespace bench
