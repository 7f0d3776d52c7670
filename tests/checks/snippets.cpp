// SPDX-License-Identifier: MIT
//
// What programs have where they use a snippet of the headers' comments, see snippets. Never linked.
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <span>
#include <tuple>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/accuracy/equilibrium_problem.hpp>
#include <membrane/certify/error_bound.hpp>
#include <membrane/haptics/force_limits.hpp>
#include <membrane/membrane.hpp>
#include <membrane/surface/moving_body.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/fung.hpp>
#include <membrane/tissue/material.hpp>

// A membrane, and its state.
extern const membrane::TriangleMesh<double> mesh;
extern const membrane::Triangles triangles;
extern const membrane::Material material;
extern const membrane::FoundationLayer layer;
extern const membrane::LinearSpring law;
extern membrane::MassSpringNetwork<double> network, springs;
extern const membrane::Elements<double, membrane::FungTriangle<double>> sheet;
extern membrane::Tissue<membrane::TearableSprings<double>> tissue;
extern membrane::VirtualVolumeSprings<double> foundation;
extern membrane::MovingBody<double> body;
extern membrane::Tearing<double> tear;
extern membrane::Points<double> positions, x, y;
extern const double dt;

// Indices; a point of a triangle, and where it is to be.
extern const membrane::Index v, w, f, g, s;
extern const std::size_t k, p;
extern const std::array<membrane::Index, 3> corners;
extern const membrane::Vector3<double> weights, target;
extern const std::vector<membrane::Index> vertices, seeds;

// The loop.
extern membrane::ScriptedDevice<double> device;
extern membrane::Tool<double> tool;
extern const std::vector<membrane::Tool<double>> tools;
extern membrane::AabbTree<double> tree;
extern membrane::ContactTracker<double> tracker;
extern const membrane::Contact<double> contact;
extern membrane::Grasper<double> grasper;
extern const membrane::Grasp<double> grasp;
extern const membrane::SolverOptions<double> options;
extern const membrane::BlockStep rule;
extern membrane::QuasiStaticSolver<double> solver;
extern const membrane::StepReport<double> report;
extern membrane::VertexNormals<double> normals;
extern membrane::ActiveVertices active;
extern membrane::VertexRows<double> rows;
extern const std::vector<membrane::Index> moved;
extern const membrane::SpringDamperForce feel;
extern membrane::ForceLimiter limit;
extern membrane::Vector3<double> force, reaction;

// Equilibria.
extern membrane::EquilibriumProblem problem;
extern membrane::EquilibriumScene scene;
extern const membrane::Equilibrium rest;
extern membrane::ErrorBound<> bound;
extern membrane::Points<double> displacement;
extern std::vector<double> magnitude;
extern const std::vector<unsigned char> fixed;
extern const Eigen::Matrix3d block;
extern double stiffness;
struct Clamp {
    membrane::Index vertex;
    membrane::Vector3<double> target;
};

// Checks of a mesh.
constexpr auto found = [](membrane::MeshDefect, const std::vector<membrane::Index>&,
                          const std::vector<membrane::Index>&, const auto&...) {};
extern std::int64_t effort;

// An engine's vertices.
extern float* const buffer;
extern const int V;

// [accuracy/elasticity]
extern membrane::NewtonSystem system;
// [/accuracy/elasticity]

// [accuracy/equilibrium_problem]
extern membrane::Points<double> force;
// [/accuracy/equilibrium_problem]

// [accuracy/equilibrium_solver]
extern const membrane::Elasticity<membrane::MassSpringNetwork<double>, membrane::VirtualVolumeSprings<double>>
    elasticity;
extern const membrane::EquilibriumOptions options;
extern const std::size_t constraint_count;
// [/accuracy/equilibrium_solver]

// [accuracy/mesh_error]
std::tuple<membrane::MassSpringNetwork<double>, membrane::VirtualVolumeSprings<double>, membrane::ToolContact<double>>
scene_on(const membrane::TriangleMesh<double>& mesh);
// [/accuracy/mesh_error]

// [accuracy/nested_dissection]
extern const membrane::CompressedRows<membrane::Index> neighbours;
// [/accuracy/nested_dissection]

// [accuracy/newton_system]
extern const membrane::Points<double> prescribed;
extern const std::array<membrane::Vector3<double>, 3> gradients;
extern const double gap;
// [/accuracy/newton_system]

// [accuracy/stiffness_operator]
extern membrane::Points<double> force;
// [/accuracy/stiffness_operator]

// [accuracy/tool_points]
extern const double far;
// [/accuracy/tool_points]

// [calibration/fit]
std::vector<double> model(std::span<const double> constants, std::span<const double> depths);
// [/calibration/fit]

// [calibration/indentation]
extern const membrane::ForceTable table;
// [/calibration/indentation]

// [calibration/student_t]
extern const double mean, deviation_of_mean;
// [/calibration/student_t]

// [coarse/coarse_points]
extern const std::vector<membrane::Vector3<double>> of_point;
extern membrane::Vector3<double> displacement;
// [/coarse/coarse_points]

// [coarse/element_forces]
extern std::vector<membrane::PaddedPoint<double>> forces;
extern const std::vector<membrane::PaddedPoint<double>> x;
// [/coarse/element_forces]

// [certify/contact_bounds]
extern const membrane::Points<double> force;
// [/certify/contact_bounds]

// [contact/contact_point]
extern membrane::Vector3<double> total;
// [/contact/contact_point]

// [contact/facet_correction]
extern membrane::Vector3<double> offset;
// [/contact/facet_correction]

// [contact/local_surface]
extern const membrane::Index start;
extern const membrane::Vector3<double> q;
// [/contact/local_surface]

// [contact/winding_number]
extern const membrane::LocalSurface<double> surface;
extern bool tunnelled;
// [/contact/winding_number]

// [core/arctangent]
extern const membrane::Lanes<double> sine, cosine;
// [/core/arctangent]

// [core/check]
extern const membrane::NetworkOptions<double> options;
// [/core/check]

// [core/exact_sign]
extern const membrane::Vector3<double> a, b, c, d;
extern bool coplanar;
// [/core/exact_sign]

// [core/executor]
struct Pool {
    void for_each(membrane::Index count, const auto& task) const;
};
extern const Pool pool;
// [/core/executor]

// [core/fixed_vector]
extern const membrane::ContactPoint<double> point;
// [/core/fixed_vector]

// [core/lane_points]
extern const membrane::Index* const begins;
// [/core/lane_points]

// [core/lanes]
extern const membrane::VolumeSpring<double> spring;
extern const membrane::Lanes<float> x, y;
// [/core/lanes]

// [core/rigid_frame]
extern const membrane::RigidFrame<double> eye;
// [/core/rigid_frame]

// [core/symmetric3]
extern const membrane::Vector3<double> u;
// [/core/symmetric3]

// [core/triple_buffer]
struct Pose {};
extern const Pose pose;
void draw(const Pose& now);
// [/core/triple_buffer]

// [core/vector3]
extern const Eigen::Matrix3d rotation;
// [/core/vector3]

// [haptics/extrapolated_reaction]
extern const membrane::TangentReport tangent;
// [/haptics/extrapolated_reaction]

// [haptics/force_limits]
extern const std::uint64_t solves;
// [/haptics/force_limits]

// [haptics/handover]
double now();
extern membrane::Points<double> shown;
extern membrane::Triangles indices;
// [/haptics/handover]

// [replay/recording_file]
extern membrane::Recorder<double> recorder;
extern std::ifstream stream;
// [/replay/recording_file]

// [replay/simulated_hand]
extern const membrane::Vector3<double> above, below;
// [/replay/simulated_hand]

// [mesh_check/box_pairs]
extern const std::vector<membrane::Aabb<double>> boxes;
// [/mesh_check/box_pairs]

// [mesh_check/nesting]
extern const membrane::SurfaceParts parts;
// [/mesh_check/nesting]

// [mesh_check/self_intersection]
extern const std::vector<membrane::Index> some, representative;
// [/mesh_check/self_intersection]

// [meshing/editable_mesh]
bool too_long(const membrane::EditableMesh& editable, membrane::Index side);
membrane::Vector3<double> middle(const membrane::EditableMesh& editable, membrane::Index side);
// [/meshing/editable_mesh]

// [meshing/graded_edge_length]
extern const membrane::Ball body;
// [/meshing/graded_edge_length]

// [meshing/level_surface]
extern const membrane::Vector3<double> p;
// [/meshing/level_surface]

// [meshing/remesh]
extern const membrane::TriangleMesh<double> raw;
extern const membrane::Ball body;
extern const membrane::Bounds bounds;
// [/meshing/remesh]

// [model/element]
using MyElement = membrane::FungTriangle<double>;
extern const MyElement element;
extern const membrane::Corners<double, 3> corners;
// [/model/element]

// [tear/tearable_springs]
extern const membrane::TriangleMesh<double> sheet;
extern const membrane::NetworkOptions<double> options;
// [/tear/tearable_springs]

// [solve/active_vertices]
bool is_balanced(membrane::Index v);
// [/solve/active_vertices]

// [solve/constraint_context]
extern const double pressure, area;
extern const membrane::Vector3<double> outward;
// [/solve/constraint_context]

// [accuracy/constraint_term]
extern const membrane::ToolContact<double> constraint;
// [/accuracy/constraint_term]

// [solve/contact_pack]
extern membrane::ContactState<double> state;
extern const std::vector<membrane::ContactPoint<double>> points;
extern membrane::ConstraintContext<double> context;
// [/solve/contact_pack]

// [solve/contact_points]
extern membrane::ContactState<double> contacts;
extern const membrane::ToolShape<double> tool;
extern const std::span<membrane::ContactPack<double>> packs;
// [/solve/contact_points]

// [solve/deadline]
using namespace std::chrono_literals;
// [/solve/deadline]

// [solve/packed_elements]
extern membrane::PackedElements<double> elements;
extern const membrane::PackedElements<double>::Begins own;
extern const membrane::Vector3<membrane::Lanes<double>> here;
extern const membrane::PaddedPoint<double>* const rows;
extern membrane::CornerForce<membrane::Lanes<double>> sum;
// [/solve/packed_elements]

// [solve/packed_vertices]
extern membrane::PackedVertices<double> packed;
extern const std::vector<membrane::Index> from_queue;
extern const membrane::PropagationQueue queue;
extern const membrane::StepInput<double, membrane::MassSpringNetwork<double>, membrane::VirtualVolumeSprings<double>>
    scene;
// [/solve/packed_vertices]

// [solve/predictor]
extern membrane::Predictor<double, 2> predictor;
extern const std::vector<membrane::DrivingInput<double>> inputs;
extern const membrane::Points<double> last_displacements;
// [/solve/predictor]

// [solve/propagation_queue]
extern membrane::IndexSet vertices;
// [/solve/propagation_queue]

// [solve/step_rule]
extern const membrane::VertexState<double> vertex;
extern membrane::Vector3<double> position;
// [/solve/step_rule]

// [surface/mesh_checks]
extern const std::vector<membrane::HalfEdge> sides;
// [/surface/mesh_checks]

// [surface/moving_body]
extern const membrane::RigidFrame<double> pose;
extern const membrane::Points<double> anchors;
extern const membrane::SmoothContact<double> smooth;
// [/surface/moving_body]

// [surface/normals]
void draw(const membrane::Points<double>& x, const membrane::Points<double>& normals);
// [/surface/normals]

// [surface/reordered]
extern std::vector<double> colour_now;
extern const std::vector<double> colour;
// [/surface/reordered]

// [surface/triangle]
extern const double radius;
extern membrane::Vector3<double> touched;
// [/surface/triangle]

// [surface/triangle_mesh]
extern const std::vector<double> xyz;
extern const std::vector<int> corners;
// [/surface/triangle_mesh]

// [tear/tearing]
extern const std::vector<membrane::Index> path;
// [/tear/tearing]

// [tissue/fibres]
extern const membrane::FibreMaterial fibre_material;
// [/tissue/fibres]

// [tissue/incompressible_triangle]
extern const membrane::IncompressibleTriangle<double> triangle;
extern const membrane::Corners<double, 3> x;
// [/tissue/incompressible_triangle]
