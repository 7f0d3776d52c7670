// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/surface/triangle.hpp>

/// The state of a membrane at one time.
namespace examples {

struct SurfaceState {
    membrane::Points<double> points;        ///< 3 x V [m]
    membrane::Points<double> displacement;  ///< From the rest position [m].
    membrane::Points<double> force;         ///< External force on the vertex, of a tool or a pin [N].
    Eigen::VectorXd tension;                ///< Of the surface at the vertex, as of a film of liquid [N/m].
};

/// The membrane at `x`. The force on a vertex balances its springs and volume springs, without their damping.
///
/// The tension is that of a film with equal energy: a surface of area A that grows by a small part e in all
/// directions takes 2 A e times its tension, and springs of tension T and length l take e times the sum of T l. Each
/// spring counts half at either end, and a vertex has a third of its triangles: its tension is the sum of T l over 4 of
/// its areas. Where the vertex has no area, it is 0.
template <class Network, class Volume>
[[nodiscard]] SurfaceState surface_state(const membrane::TriangleMesh<double>& mesh, const membrane::Points<double>& x,
                                         const Network& network, const Volume& volume) {
    SurfaceState state{x, x - mesh.positions(), membrane::Points<double>(3, x.cols()), Eigen::VectorXd(x.cols())};
    Eigen::VectorXd area = Eigen::VectorXd::Zero(x.cols());
    for (const auto& corners : mesh.triangles().colwise()) {
        const Eigen::Vector3d a = x.col(corners[0]), b = x.col(corners[1]), c = x.col(corners[2]);
        for (const membrane::Index v : corners) area[v] += (b - a).cross(c - a).norm() / 6;
    }
    for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
        const membrane::Vector3<double> here = x.col(v);
        state.force.col(v) = -network.force_on(v, x).force - volume.force_on(v, here, here, 1.0).force;
        double sum = 0;
        network.for_each_force(v, x, [&](const auto& spring) { sum += spring.tension * spring.length; });
        state.tension[v] = area[v] > 0 ? sum / (4 * area[v]) : 0;
    }
    return state;
}

/// The mean tension of a sheet of elements at each vertex [N/m], averaged over its triangles; 0 without triangles.
template <class Sheet>
[[nodiscard]] Eigen::VectorXd vertex_tensions(const Sheet& sheet, const membrane::Points<double>& x) {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(x.cols()), count = sum;
    for (const auto& placed : sheet.all()) {
        const double tension = placed.element.mean_tension(sheet.where(placed, x));
        for (const membrane::Index v : placed.corners) {
            sum[v] += tension;
            ++count[v];
        }
    }
    return sum.cwiseQuotient(count.cwiseMax(1));
}

}  // namespace examples
