// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <tuple>
#include <vector>

#include <Eigen/Core>

#include <membrane/contact/tool.hpp>
#include <membrane/model/mass_spring_network.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Where a membrane of linear springs is at equilibrium on tools, by another method than the solver's: all vertices at
/// once, by Newton's method, each feature of the surface near a tool being an inequality with a curvature of its own
/// (sequential quadratic programming [Nocedal06] 18). Dense, and with its own geometry.
///
///     const test::PressedMembrane membrane{mesh.triangles(), springs, mesh.positions(), 0.3, {tool}};
///     const auto rest = test::at_rest(membrane, start, {.far = edge / 2, .max_step = tool.radius / 2});
///     CHECK((rest.x - x).cwiseAbs().maxCoeff() < 1e-6);
namespace test {

using Tool = membrane::Tool<double>;

/// A corner, an edge or the inside of a triangle, and what of a tool is nearest to it.
struct Feature {
    std::size_t tool;
    int part;                            // of the tool: 0 one end, 1 the other, 2 the axis between them
    std::vector<Eigen::Index> vertices;  // one, two or three
    std::vector<double> weights;         // above zero, sum 1
    Eigen::Vector3d separation;          // from the surface to the tool's axis
    double radius;

    double gap() const { return separation.norm() - radius; }
    Eigen::Vector3d normal() const { return separation.normalized(); }

    using Name = std::tuple<std::size_t, int, std::vector<Eigen::Index>>;
    Name name() const { return {tool, part, vertices}; }
};

/// Weights of the point of a triangle (corners in columns) that is nearest to `q`.
Eigen::Vector3d nearest_weights(const Eigen::Matrix3d& corners, const Eigen::Vector3d& q);

/// How far along, 0 to 1, the segments from `p` by `displacement` and from `q` by `other_segment` are nearest to one
/// another.
Eigen::Vector2d nearest_along(const Eigen::Vector3d& p, const Eigen::Vector3d& displacement, const Eigen::Vector3d& q,
                              const Eigen::Vector3d& other_segment);

/// Distance of a triangle (corners in columns) from the tool's axis.
double distance_from_axis(const Tool& tool, const Eigen::Matrix3d& corners);

/// How often a closed surface goes round `q`: 1 inside, 0 outside.
double winding_number(const membrane::Triangles& triangles, const Eigen::Matrix3Xd& x, const Eigen::Vector3d& q);

/// Where x y z of these vertices stand in a list of all coordinates.
std::vector<Eigen::Index> coordinates_of(const std::vector<Eigen::Index>& vertices);

/// Linear springs, all vertices backed alike, and the tools that press.
struct PressedMembrane {
    membrane::Triangles triangles;
    std::vector<membrane::Spring<double>> springs;
    Eigen::Matrix3Xd anchors;
    double foundation;  // [N/m]
    std::vector<Tool> tools;
    std::vector<Eigen::Index> pinned = {};

    /// Springs and foundation on each vertex, x y z each [N].
    Eigen::VectorXd forces(const Eigen::Matrix3Xd& x) const;

    /// Second derivative of the energy of springs and foundation [N/m].
    Eigen::MatrixXd stiffness(const Eigen::Matrix3Xd& x) const {
        Eigen::MatrixXd sum = foundation * Eigen::MatrixXd::Identity(x.size(), x.size());
        for (const auto& spring : springs) {
            const Eigen::Vector3d along = (x.col(spring.second) - x.col(spring.first)).normalized();
            const double across = 1 - spring.rest_length / (x.col(spring.second) - x.col(spring.first)).norm();
            const Eigen::Matrix3d block =
                spring.stiffness * (across * Eigen::Matrix3d::Identity() + (1 - across) * along * along.transpose());
            const Eigen::Index i = 3 * spring.first, j = 3 * spring.second;
            sum.block<3, 3>(i, i) += block;
            sum.block<3, 3>(j, j) += block;
            sum.block<3, 3>(i, j) -= block;
            sum.block<3, 3>(j, i) -= block;
        }
        return sum;
    }
};

/// What of the surface is at most `far` away from a tool, each feature once.
std::vector<Feature> features_near(const PressedMembrane& membrane, const Eigen::Matrix3Xd& x, double far);

/// How each gap changes with the positions, one row a feature.
Eigen::MatrixXd gap_gradients(const std::vector<Feature>& features, Eigen::Index coordinates);

/// Second derivative of the gap by the positions of the feature's vertices, x y z each. The nearest points slide along
/// feature and axis as these move: what they gain by that is taken off (a Schur complement).
Eigen::MatrixXd gap_curvature(const PressedMembrane& membrane, const Eigen::Matrix3Xd& x, const Feature& feature);

/// The y >= 0 of least y.W y / 2 + q.y, for W positive semidefinite [Lawson74].
Eigen::VectorXd smallest_non_negative(const Eigen::MatrixXd& W, const Eigen::VectorXd& q);

struct NewtonOptions {
    double far;       // what is at most this far from a tool is evaluated [m]
    double max_step;  // of a vertex [m]
    int max_steps = 60;
};

/// A membrane at rest on its tools.
struct PressedState {
    Eigen::Matrix3Xd x;
    std::vector<Eigen::Vector3d> reactions;  // on each tool [N]
    bool converged = false;
};

/// Newton's method from the positions `start`.
PressedState at_rest(const PressedMembrane& membrane, const Eigen::Matrix3Xd& start, const NewtonOptions& options);

}  // namespace test
