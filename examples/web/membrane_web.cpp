// SPDX-License-Identifier: MIT
//
// README's loop as functions for a page: one membrane, one tool that presses and grasps. Numbers cross by pointers into
// the memory that module and page share. No exceptions: a mesh from a file is validated before it is built.
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/membrane.hpp>
#include <membrane/mesh_check/repair.hpp>
#include <membrane/mesh_check/validate.hpp>

namespace {

using Network = membrane::MassSpringNetwork<double, membrane::LinearSpring>;
using BlockSolver = decltype(membrane::QuasiStaticSolver(std::declval<Network>(), {}, membrane::BlockStep{}));
using SafeSolver = decltype(membrane::QuasiStaticSolver(std::declval<Network>(), {}, membrane::SafeStep{}));

constexpr double dt = 1e-3;  // [s]

/// What a tick gives, as the page reads it: 8 numbers of 8 bytes.
struct Tick {
    double force[3];  ///< of the membrane on the tool [N]
    double depth;     ///< [m]
    double touching, holding, advanced, vertex_updates;
};

/// The membrane and all that a loop has.
struct Scene {
    explicit Scene(membrane::TriangleMesh<double> surface)
        : mesh(std::move(surface)),
          network(mesh, {}, {.stiffness = 40.0, .pinned = membrane::border(mesh)}),
          foundation(mesh, {.stiffness = 8.0, .damping = 0.02}),
          solver(std::in_place_type<BlockSolver>, network),
          tree(mesh),
          tracker(mesh),
          grasper(mesh),
          normals(mesh),
          x(mesh.positions()) {}

    void set_options(int layers, int sweeps, bool safe_step, bool volume_springs) {
        const membrane::SolverOptions<double> options{.layers = layers, .sweeps = sweeps};
        if (safe_step) {
            solver.emplace<SafeSolver>(network, options, membrane::SafeStep{});
        } else {
            solver.emplace<BlockSolver>(network, options, membrane::BlockStep{});
        }
        foundation = {mesh, {.stiffness = volume_springs ? 8.0 : 0.0, .damping = volume_springs ? 0.02 : 0.0}};
    }

    Tick tick(const membrane::Tool<double>& tool) {
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report = std::visit(
            [&](auto& s) { return s.step(x, dt, network, foundation, press(tool, contact, grasp), pull(tool, grasp)); },
            solver);
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        const auto force = report.total_reaction();
        return {{force.x(), force.y(), force.z()},
                contact.depth,
                contact.touching() ? 1.0 : 0.0,
                grasp.holding() ? 1.0 : 0.0,
                report.status == membrane::StepStatus::advanced ? 1.0 : 0.0,
                static_cast<double>(report.vertex_updates)};
    }

    /// The force on the tool of the last tick if its step were solved to the end, without viscosity.
    Tick equilibrium(const membrane::Tool<double>& tool) {
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto rest = membrane::equilibrium(x, mesh, network, foundation, {}, press(tool, contact, grasp),
                                                membrane::pull(tool, grasp));
        const membrane::Vector3<double> force = rest.reactions[0] + rest.reactions[1];
        return {{force.x(), force.y(), force.z()}, contact.depth, 0, 0, rest.converged ? 1.0 : 0.0, 0};
    }

    membrane::TriangleMesh<double> mesh;
    Network network;
    membrane::VirtualVolumeSprings<double> foundation;
    std::variant<BlockSolver, SafeSolver> solver;
    membrane::AabbTree<double> tree;
    membrane::ContactTracker<double> tracker;
    membrane::Grasper<double> grasper;
    membrane::VertexNormals<double> normals;
    membrane::Points<double> x;
};

std::optional<Scene> scene;
Tick last{};
std::string text;
membrane::Points<double> points;  // a mesh from a file
membrane::Triangles triangles;

/// A lens capsule: the shape of an ellipsoid with half axes of 4.5, 4.5 and 2 mm.
membrane::TriangleMesh<double> lens() {
    const auto sphere = membrane::icosphere<double>({.radius = 1, .subdivisions = 3});
    membrane::Points<double> x = sphere.positions();
    x.row(0) *= 4.5e-3;
    x.row(1) *= 4.5e-3;
    x.row(2) *= 2e-3;
    return membrane::TriangleMesh(x, sphere.triangles());
}

membrane::Tool<double> tool_at(double x, double y, double z, double vx, double vy, double vz, double radius,
                               bool grasping) {
    return {.position = {x, y, z}, .radius = radius, .velocity = {vx, vy, vz}, .grasping = grasping};
}

}  // namespace

extern "C" {

/// Spheres of 162, 642, 2,562 and 10,242 vertices for 2 to 5; 0 a cornea with its rim pinned, 1 a lens capsule.
void build(int shape) {
    if (shape == 0) {
        scene.emplace(membrane::spherical_cap({.radius = 7.8e-3, .diameter = 11.7e-3, .rings = 14}));
    } else if (shape == 1) {
        scene.emplace(lens());
    } else {
        scene.emplace(membrane::icosphere<double>({.radius = 10e-3, .subdivisions = shape}));
    }
}

double* file_points(int count) { return (points.resize(3, count), points.data()); }
std::int32_t* file_triangles(int count) { return (triangles.resize(3, count), triangles.data()); }

/// Builds the mesh in `file_points` and `file_triangles`: corners at the same position joined, triangles turned outward, 20 mm
/// wide. Returns 0, or 1 if it is refused; `message` then says why.
int build_file() {
    if (!membrane::is_finite(points)) return (text = to_string(membrane::validate(points, triangles)), 1);
    const auto repaired =
        membrane::repair(points, triangles, {.weld = 0.0, .drop_repeated = true, .orient = true, .flip_inward = true});
    membrane::Points<double> x = repaired.positions;
    const auto report = membrane::validate(x, repaired.triangles);
    text = to_string(report);
    if (!report.valid()) return 1;
    const Eigen::Vector3d low = x.rowwise().minCoeff(), high = x.rowwise().maxCoeff();
    x = (0.02 / (high - low).maxCoeff()) * (x.colwise() - (low + high) / 2);
    scene.emplace(membrane::TriangleMesh(x, repaired.triangles));
    return 0;
}

const char* message() { return text.c_str(); }
int vertex_count() { return scene->mesh.vertex_count(); }
int triangle_count() { return scene->mesh.triangle_count(); }
const std::int32_t* triangle_data() { return scene->mesh.triangles().data(); }
const double* rest_data() { return scene->mesh.positions().data(); }
double* position_data() { return scene->x.data(); }
const double* normal_data() { return scene->normals.values().data(); }

void set_options(int layers, int sweeps, int safe_step, int volume_springs) {
    scene->set_options(layers, sweeps, safe_step != 0, volume_springs != 0);
}

const Tick* tick(double x, double y, double z, double vx, double vy, double vz, double radius, int grasping) {
    last = scene->tick(tool_at(x, y, z, vx, vy, vz, radius, grasping != 0));
    return &last;
}

/// In a module of its own, whose `position_data` the page has filled with those of the loop.
const Tick* equilibrium(double x, double y, double z, double radius, int grasping) {
    scene->tree.refit(scene->x);
    scene->tracker.reset();
    last = scene->equilibrium(tool_at(x, y, z, 0, 0, 0, radius, grasping != 0));
    return &last;
}
}
