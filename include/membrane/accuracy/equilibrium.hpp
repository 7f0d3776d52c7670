// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <limits>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/accuracy/elasticity.hpp>
#include <membrane/accuracy/equilibrium_scene.hpp>
#include <membrane/accuracy/equilibrium_solver.hpp>
#include <membrane/solve/propagation_queue.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// The static equilibrium of a membrane with its reactions: the reference solution of a scene.
///
///     #include <membrane/accuracy/equilibrium.hpp>
///     const auto rest = membrane::equilibrium(x, mesh, network, foundation, {}, press(tool, contact),
///                                             membrane::pull(7, target));
///     if (!rest.converged) std::cerr << to_string(rest.status);
///     (x - rest.x).colwise().norm().maxCoeff();                              // error of a step's positions [m]
///     rest.reactions[0];                                                     // force of the membrane on the tool [N]
namespace membrane {

/// The equilibrium near `x` (3 x V [m]) under the constraints of a step, to double precision for any scalar of network
/// and foundation. A user-defined foundation that is not linear (see `FoundationModel`) is evaluated in its own scalar.
/// Reactions are as in `StepReport`. If the method does not converge, `x` is the last iterate, and `status` the reason.
///
/// Newton's method on all vertices at once, with exact Hessians and sparse factorisation. Contact points near a tool
/// are inequalities with exact second derivatives: sequential quadratic programming [Nocedal06] 18. A line search on
/// the energy plus the largest penetration, weighted as an exact penalty, makes it converge from distant starts. Tools
/// press the whole surface, not only the triangles of the contact; of that they use position, normal and radius. A
/// tool that penetrates deeply enters from outside, in one increment for each half radius of depth. Where no vertex
/// can move, a tool may penetrate and a point attachment may be off its target. A fixed vertex does not yield to a
/// tool: next to one, the result is the limit of a step's forces for `SolverOptions::rigid_stiffness` to infinity; on
/// a triangle with three fixed corners, no tool presses here.
///
/// If there are several equilibria, the start and the increments select one.
///
/// @throws InvalidInput for positions that are not finite or not one for each vertex, mesh, network and foundation that
/// do not match, an option out of its range, or a constraint that is not valid. Offline. Cost: about 5 to 20 sparse
/// factorisations for each increment.
template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedStaticConstraint... Constraints>
[[nodiscard]] Equilibrium equilibrium(const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                      const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& volume,
                                      const EquilibriumOptions& options, const Constraints&... constraints);

/// With the default options.
template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume, StaticConstraint First,
          StaticConstraint... Others>
[[nodiscard]] Equilibrium equilibrium(const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                      const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& volume,
                                      const First& first, const Others&... others) {
    return equilibrium<Scalar>(x, mesh, network, volume, EquilibriumOptions{}, first, others...);
}

namespace detail {

inline void check_count(Eigen::Index found, Index vertices, std::string_view what) {
    if (found == vertices) return;
    refuse(equilibrium_name, what, " must have as many vertices as the mesh, ", vertices, ", got ", found);
}

template <Real Scalar, class Network, class Volume>
void check_fit(const ConstPointsRef<Scalar>& x, const TriangleMesh<Scalar>& mesh, const Network& network,
               const Volume& volume) {
    check_count(network.vertex_count(), mesh.vertex_count(), "the network");
    check_count(x.cols(), mesh.vertex_count(), "x");
    if constexpr (requires { volume.anchors().cols(); }) {
        check_count(volume.anchors().cols(), mesh.vertex_count(), "the foundation");
    }
    for (Index v = 0; v < x.cols(); ++v) {
        for (Index k = 0; k < 3; ++k) {
            if (is_finite(x(k, v))) continue;
            refuse(equilibrium_name, std::string_view("xyz").substr(static_cast<std::size_t>(k), 1), " of vertex ", v,
                   " must be finite [m], got ", x(k, v));
        }
        const auto here = point(x, v);
        if (is_finite(volume.force_on(v, here, here, std::numeric_limits<Scalar>::infinity()).force)) continue;
        refuse(equilibrium_name, "the foundation of vertex ", v,
               " must pull with a finite force [N], got one that is not");
    }
}

/// Vertices to which the constraints apply a force, and those that tools touch at the start.
[[nodiscard]] inline std::vector<Index> seeds_of(const EquilibriumScene& scene, const Triangles& triangles,
                                                 const Points<double>& x) {
    std::vector<Index> seeds = scene.seeds();
    for (const auto& pressing : scene.tools()) {
        const double max_distance = pressing.tool.radius + pressing.detection_distance;
        for (const auto& corners : triangles.colwise()) {
            if (distance_from_axis(triangle_at(x, corners), pressing.tool) > max_distance) continue;
            seeds.insert(seeds.end(), corners.begin(), corners.end());
        }
    }
    return seeds;
}

}  // namespace detail

template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedStaticConstraint... Constraints>
Equilibrium equilibrium(const std::type_identity_t<ConstPointsRef<Scalar>>& x, const TriangleMesh<Scalar>& mesh,
                        const Network& network, const Volume& volume, const EquilibriumOptions& options,
                        const Constraints&... constraints) {
    options.validate();
    detail::check_fit(x, mesh, network, volume);
    std::vector<unsigned char> fixed(static_cast<std::size_t>(network.vertex_count()));
    for (Index v = 0; v < network.vertex_count(); ++v) fixed[static_cast<std::size_t>(v)] = network.pinned(v) ? 1 : 0;
    const Points<double> start = x.template cast<double>();
    EquilibriumScene scene(start, fixed);
    std::size_t count = 0;
    ((scene.select_constraint(count++), describe(constraints, scene)), ...);

    PropagationQueue queue(network.vertex_count());
    queue.build(network, detail::seeds_of(scene, mesh.triangles(), start), options.layers);
    for (Index v = 0; v < network.vertex_count(); ++v) {
        const bool stays = options.layers != unlimited && !queue.contains(v);
        if (stays || scene.fixed(v)) fixed[static_cast<std::size_t>(v)] = 1;
    }
    const Elasticity elasticity(network, volume);
    auto carriers = detail::carriers_of(scene, mesh);
    return EquilibriumSolver(start, mesh.triangles(), elasticity, scene, fixed, options, std::move(carriers))
        .run(count);
}

}  // namespace membrane
