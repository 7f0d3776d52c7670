// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <utility>
#include <variant>
#include <vector>

#include <membrane/coarse/coarse_correction.hpp>
#include <membrane/membrane.hpp>

/// The haptic loop of the page, in WebAssembly and in the native program that the page is compared with.
namespace web {

using membrane::Index;
using Vector3 = membrane::Vector3<double>;
using Mesh = membrane::TriangleMesh<double>;

constexpr double dt = 1e-3;  // [s]

struct Settings {
    Index layers = 6, sweeps = 2;
    bool safe_step = false, volume_springs = true, coarse_correction = false;

    friend bool operator==(const Settings&, const Settings&) = default;
};

/// A tick as the scene of an equilibrium.
struct Moment {
    Settings settings;
    membrane::Tool<double> tool;
    membrane::Contact<double> contact;
    membrane::Grasp<double> grasp;
    Vector3 reaction = Vector3::Zero();  // [N]
};

inline Mesh sphere(Index subdivisions) { return membrane::icosphere({.radius = 10e-3, .subdivisions = subdivisions}); }

/// The cap of a cornea. Its rim is pinned, as every border is.
inline Mesh cornea() { return membrane::spherical_cap({.radius = 7.8e-3, .diameter = 11.7e-3, .rings = 16}); }

/// The ellipsoid of a lens capsule.
inline Mesh lens() {
    const auto ball = membrane::icosphere({.radius = 1.0, .subdivisions = 4});
    const Eigen::Vector3d radii(4.5e-3, 4.5e-3, 2.0e-3);  // [m]
    return {radii.asDiagonal() * ball.positions(), ball.triangles()};
}

/// Half the largest extent [m].
inline double size_of(const Mesh& mesh) {
    const auto& x = mesh.positions();
    return (x.rowwise().maxCoeff() - x.rowwise().minCoeff()).maxCoeff() / 2;
}

/// The border. Without volume springs a closed surface would float away: then it is pinned below, where it stands.
inline std::vector<Index> pinned_vertices(const Mesh& mesh, bool volume_springs) {
    auto pinned = membrane::border(mesh);
    if (volume_springs || !pinned.empty()) return pinned;
    const auto height = mesh.positions().row(2);
    const double low = height.minCoeff() + 0.15 * (height.maxCoeff() - height.minCoeff());
    for (Index v = 0; v < mesh.vertex_count(); ++v)
        if (height[v] <= low) pinned.push_back(v);
    return pinned;
}

/// One membrane with the state of its loop.
class Session {
  public:
    explicit Session(Mesh mesh, const Settings& settings = {})
        : mesh_(std::move(mesh)),
          settings_(settings),
          network_(network()),
          foundation_(foundation()),
          solver_(solver()),
          coarse_(mesh_, network_, foundation_),
          tree_(mesh_),
          tracker_(mesh_),
          grasper_(mesh_),
          normals_(mesh_),
          x_(mesh_.positions()) {}

    /// Other settings, from the present positions.
    void configure(const Settings& settings) {
        const auto last = std::exchange(settings_, settings);
        if (last == settings) return;
        network_ = network();
        foundation_ = foundation();
        solver_ = solver();
        coarse_.reset();
        if (last.volume_springs != settings.volume_springs)
            coarse_ = membrane::CoarseCorrection(mesh_, network_, foundation_);
        std::visit([](auto& solver) { solver.wake_all(); }, solver_);
    }

    /// Forgets the tool: the next one may be on any side, without a path from the last one.
    void lift_tool() noexcept {
        tracker_.reset();
        grasper_.reset();
    }

    /// One tick.
    void step(const membrane::Tool<double>& tool) noexcept {
        const auto contact = tracker_.update(tree_, x_, tool);
        const auto grasp = grasper_.update(contact, x_, tool);
        const auto report = std::visit(
            [&](auto& solver) {
                return solver.step(x_, dt, network_, foundation_, press(tool, contact, grasp), pull(tool, grasp));
            },
            solver_);
        if (correct()) {
            tree_.refit(x_);
            normals_.update(x_);
        } else {
            tree_.refit(x_, report.moved);
            normals_.update(x_, report.moved);
        }
        force_ = feel_({tool, contact, report, grasp});
        moment_ = {settings_, tool, contact, grasp, report.total_reaction()};
    }

    [[nodiscard]] const Mesh& mesh() const noexcept { return mesh_; }
    [[nodiscard]] const Settings& settings() const noexcept { return settings_; }
    [[nodiscard]] const auto& network_now() const noexcept { return network_; }
    [[nodiscard]] const auto& foundation_now() const noexcept { return foundation_; }
    [[nodiscard]] const membrane::Points<double>& x() const noexcept { return x_; }
    [[nodiscard]] const membrane::Points<double>& normals() const noexcept { return normals_.values(); }
    [[nodiscard]] const Vector3& force() const noexcept { return force_; }
    [[nodiscard]] const Moment& moment() const noexcept { return moment_; }

    /// An estimate of how far the force of the last tick is off that of a step solved to the end [N]; NaN if there is
    /// none. With corrections it is that of the last one. Moves nothing. Cost without: half that of a correction.
    [[nodiscard]] double force_error() noexcept {
        if (settings_.coarse_correction) return norm(corrected_error_);
        return std::visit([&](const auto& solver) { return norm(coarse_.reaction_error(x_, solver)); }, solver_);
    }

    [[nodiscard]] const membrane::AabbTree<double>& tree() const noexcept { return tree_; }
    [[nodiscard]] const membrane::PropagationQueue& queue() const noexcept {
        return std::visit([](const auto& solver) -> const membrane::PropagationQueue& { return solver.queue(); },
                          solver_);
    }
    [[nodiscard]] std::span<const membrane::ContactPoint<double>> contact_points() const noexcept {
        return std::visit([](const auto& solver) { return solver.contact_points(0); }, solver_);
    }

  private:
    using Network = membrane::MassSpringNetwork<double, membrane::LinearSpring>;
    using Foundation = membrane::VirtualVolumeSprings<double>;
    using Solver = std::variant<membrane::QuasiStaticSolver<double, membrane::BlockStep>,
                                membrane::QuasiStaticSolver<double, membrane::SafeStep>>;

    /// Corrects a step where its force may be off. Returns whether that moved vertices.
    bool correct() noexcept {
        if (!settings_.coarse_correction) return false;
        const auto report = std::visit([&](const auto& solver) { return coarse_.correct(x_, solver); }, solver_);
        if (membrane::is_finite(report.reaction_error)) corrected_error_ = report.reaction_error;
        return report.moved;
    }

    [[nodiscard]] Network network() const {
        return {mesh_, {}, {.stiffness = 40.0, .pinned = pinned_vertices(mesh_, settings_.volume_springs)}};  // [N/m]
    }

    /// As stiff in all on any mesh as on the sphere of 642 vertices. Without damping: the error of a step is then the
    /// difference to the equilibrium, which has none.
    [[nodiscard]] Foundation foundation() const {
        const double stiffness = settings_.volume_springs ? 8.0 * 642 / mesh_.vertex_count() : 0;  // [N/m]
        return {mesh_, {.stiffness = stiffness}};
    }

    [[nodiscard]] Solver solver() const {
        const membrane::SolverOptions<double> options{.layers = settings_.layers, .sweeps = settings_.sweeps};
        if (settings_.safe_step) return membrane::QuasiStaticSolver(network_, options, membrane::SafeStep{});
        return membrane::QuasiStaticSolver(network_, options, membrane::BlockStep{});
    }

    Mesh mesh_;
    Settings settings_;
    Network network_;
    Foundation foundation_;
    Solver solver_;
    membrane::CoarseCorrection<double> coarse_;
    membrane::AabbTree<double> tree_;
    membrane::ContactTracker<double> tracker_;
    membrane::Grasper<double> grasper_;
    membrane::VertexNormals<double> normals_;
    membrane::ReactionForce feel_;
    membrane::Points<double> x_;  // 3 x V [m]
    Vector3 force_ = Vector3::Zero();
    Vector3 corrected_error_ = Vector3::Zero();  // of the force, found by the last correction [N]
    Moment moment_;                              // its spans end with the next tick
};

}  // namespace web
