// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <numbers>
#include <tuple>
#include <vector>

#include <Eigen/Dense>

#include <membrane/collision/tool.hpp>
#include <membrane/mesh/triangle_mesh.hpp>
#include <membrane/network/mass_spring_network.hpp>

/// Where a membrane of linear springs rests on tools, found in another way than the solver's: all vertices at once, by
/// Newton's method, each feature of the surface near a tool being an inequality with a curvature of its own (sequential
/// quadratic programming [Nocedal06] 18). Dense, and with its own geometry.
///
///     const test::PressedMembrane membrane{mesh.triangles(), springs, mesh.positions(), 0.3, {tool}};
///     const auto rest = test::at_rest(membrane, start, {.far = edge / 2, .longest_step = tool.radius / 2});
///     CHECK((rest.x - x).cwiseAbs().maxCoeff() < 1e-6);
namespace test {

using Tool = membrane::Tool<double>;

/// A corner, an edge or the inside of a triangle, and what of a tool is nearest to it.
struct Feature {
    std::size_t tool;
    int part;                            // of the tool: 0 one end, 1 the other, 2 the axis between them
    std::vector<Eigen::Index> vertices;  // one, two or three
    std::vector<double> weights;         // above zero, sum 1
    Eigen::Vector3d reach;               // from the surface to the tool's axis
    double radius;

    double gap() const { return reach.norm() - radius; }
    Eigen::Vector3d normal() const { return reach.normalized(); }

    using Name = std::tuple<std::size_t, int, std::vector<Eigen::Index>>;
    Name name() const { return {tool, part, vertices}; }
};

/// Weights of the point of a triangle (corners in columns) that is nearest to `q`.
inline Eigen::Vector3d nearest_weights(const Eigen::Matrix3d& corners, const Eigen::Vector3d& q) {
    const Eigen::Matrix<double, 3, 2> sides = corners.rightCols<2>().colwise() - corners.col(0);
    const Eigen::Vector2d inside = sides.colPivHouseholderQr().solve(q - corners.col(0));
    if (inside.minCoeff() > 0 && inside.sum() < 1) return {1 - inside.sum(), inside[0], inside[1]};
    Eigen::Vector3d best = Eigen::Vector3d::Zero();
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) {
        const int next = (k + 1) % 3;
        const Eigen::Vector3d edge = corners.col(next) - corners.col(k);
        const double along = std::clamp((q - corners.col(k)).dot(edge) / edge.squaredNorm(), 0.0, 1.0);
        const double distance = (corners.col(k) + along * edge - q).norm();
        if (!(distance < least)) continue;
        least = distance;
        best.setZero();
        best[k] = 1 - along;
        best[next] = along;
    }
    return best;
}

/// How far along, 0 to 1, the segments from `p` by `way` and from `q` by `other_way` are nearest to one another.
inline Eigen::Vector2d nearest_along(const Eigen::Vector3d& p, const Eigen::Vector3d& way, const Eigen::Vector3d& q,
                                     const Eigen::Vector3d& other_way) {
    const auto clamped = [](double along) { return std::clamp(along, 0.0, 1.0); };
    std::vector<Eigen::Vector2d> candidates;
    for (const double end : {0.0, 1.0}) {
        candidates.emplace_back(end, clamped((p + end * way - q).dot(other_way) / other_way.squaredNorm()));
        candidates.emplace_back(clamped((q + end * other_way - p).dot(way) / way.squaredNorm()), end);
    }
    Eigen::Matrix<double, 3, 2> ways;
    ways << way, -other_way;
    const Eigen::Vector2d inside = ways.colPivHouseholderQr().solve(q - p);
    if (inside.minCoeff() > 0 && inside.maxCoeff() < 1) candidates.push_back(inside);
    const auto distance = [&](const Eigen::Vector2d& at) { return (p + at[0] * way - q - at[1] * other_way).norm(); };
    return *std::min_element(candidates.begin(), candidates.end(),
                             [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
}

/// Distance of a triangle (corners in columns) from the tool's axis.
inline double distance_from_axis(const Tool& tool, const Eigen::Matrix3d& corners) {
    const Eigen::Vector3d end = tool.position, axis = tool.axis;
    const auto distance_to = [&](const Eigen::Vector3d& q) {
        return (corners * nearest_weights(corners, q) - q).norm();
    };
    double least = distance_to(end);
    if (axis.isZero(0)) return least;
    least = std::min(least, distance_to(end + axis));
    for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d corner = corners.col(k), edge = corners.col((k + 1) % 3) - corner;
        const Eigen::Vector2d along = nearest_along(end, axis, corner, edge);
        least = std::min(least, (end + along[0] * axis - corner - along[1] * edge).norm());
    }
    const Eigen::Vector3d normal = (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0));
    const double here = normal.dot(end - corners.col(0)), there = normal.dot(end + axis - corners.col(0));
    if (here * there < 0) least = std::min(least, distance_to(end + here / (here - there) * axis));
    return least;
}

/// How often a closed surface goes round `q`: 1 inside, 0 outside.
inline double winding_number(const membrane::Triangles& triangles, const Eigen::Matrix3Xd& x,
                             const Eigen::Vector3d& q) {
    double angle = 0;
    for (const auto& corner : triangles.colwise()) {
        const Eigen::Vector3d a = x.col(corner[0]) - q, b = x.col(corner[1]) - q, c = x.col(corner[2]) - q;
        const double A = a.norm(), B = b.norm(), C = c.norm();
        angle += 2 * std::atan2(a.dot(b.cross(c)), A * B * C + a.dot(b) * C + b.dot(c) * A + c.dot(a) * B);
    }
    return angle / (4 * std::numbers::pi);
}

/// Where x y z of these vertices stand in a list of all coordinates.
inline std::vector<Eigen::Index> coordinates_of(const std::vector<Eigen::Index>& vertices) {
    std::vector<Eigen::Index> rows;
    for (const Eigen::Index v : vertices) rows.insert(rows.end(), {3 * v, 3 * v + 1, 3 * v + 2});
    return rows;
}

/// Linear springs, all vertices backed alike, and the tools that press.
struct PressedMembrane {
    membrane::Triangles triangles;
    std::vector<membrane::Spring<double>> springs;
    Eigen::Matrix3Xd anchors;
    double backing;  // [N/m]
    std::vector<Tool> tools;
    std::vector<Eigen::Index> pinned = {};

    /// Springs and backing on each vertex, x y z each [N].
    Eigen::VectorXd forces(const Eigen::Matrix3Xd& x) const {
        Eigen::Matrix3Xd sum = backing * (anchors - x);
        for (const auto& spring : springs) {
            const Eigen::Vector3d reach = x.col(spring.second) - x.col(spring.first);
            const Eigen::Vector3d pull = spring.stiffness * (1 - spring.rest_length / reach.norm()) * reach;
            sum.col(spring.first) += pull;
            sum.col(spring.second) -= pull;
        }
        return sum.reshaped();
    }

    /// Second derivative of the energy of springs and backing [N/m].
    Eigen::MatrixXd stiffness(const Eigen::Matrix3Xd& x) const {
        Eigen::MatrixXd sum = backing * Eigen::MatrixXd::Identity(x.size(), x.size());
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
inline std::vector<Feature> features_near(const PressedMembrane& membrane, const Eigen::Matrix3Xd& x, double far) {
    std::map<Feature::Name, Feature> found;
    for (std::size_t i = 0; i < membrane.tools.size(); ++i) {
        const auto& tool = membrane.tools[i];
        const Eigen::Vector3d end = tool.position, axis = tool.axis;
        for (const auto& triangle : membrane.triangles.colwise()) {
            Eigen::Matrix3d corners;
            for (int k = 0; k < 3; ++k) corners.col(k) = x.col(triangle[k]);
            const auto add = [&](int part, const Eigen::Vector3d& weights, const Eigen::Vector3d& on_axis) {
                Feature feature{i, part, {}, {}, on_axis - corners * weights, tool.radius};
                std::map<Eigen::Index, double> weight_of;  // sorts
                for (int k = 0; k < 3; ++k) {
                    if (weights[k] > 0) weight_of[triangle[k]] = weights[k];
                }
                for (const auto& [v, weight] : weight_of) {
                    feature.vertices.push_back(v);
                    feature.weights.push_back(weight);
                }
                if (feature.gap() <= far) found.emplace(feature.name(), feature);
            };
            add(0, nearest_weights(corners, end), end);
            if (axis.isZero(0)) continue;
            add(1, nearest_weights(corners, end + axis), end + axis);
            for (int k = 0; k < 3; ++k) {
                const int next = (k + 1) % 3;
                const auto along = nearest_along(end, axis, corners.col(k), corners.col(next) - corners.col(k));
                if (!(along[0] > 0 && along[0] < 1)) continue;
                Eigen::Vector3d weights = Eigen::Vector3d::Zero();
                weights[k] = 1 - along[1];
                weights[next] = along[1];
                add(2, weights, end + along[0] * axis);
            }
        }
    }
    std::vector<Feature> features;
    for (const auto& [name, feature] : found) features.push_back(feature);
    return features;
}

/// How each gap changes with the positions, one row a feature.
inline Eigen::MatrixXd gap_gradients(const std::vector<Feature>& features, Eigen::Index coordinates) {
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(features.size()), coordinates);
    for (std::size_t i = 0; i < features.size(); ++i) {
        const auto& feature = features[i];
        for (std::size_t k = 0; k < feature.vertices.size(); ++k) {
            rows.row(static_cast<Eigen::Index>(i)).segment<3>(3 * feature.vertices[k]) =
                -feature.weights[k] * feature.normal().transpose();
        }
    }
    return rows;
}

/// Second derivative of the gap by the positions of the feature's vertices, x y z each. The nearest points slide along
/// feature and axis as these move: what they gain by that is taken off (a Schur complement).
inline Eigen::MatrixXd gap_curvature(const PressedMembrane& membrane, const Eigen::Matrix3Xd& x,
                                     const Feature& feature) {
    const auto count = static_cast<Eigen::Index>(feature.vertices.size());
    const Eigen::Index slides = count - 1 + (feature.part == 2 ? 1 : 0);
    const Eigen::Vector3d normal = feature.normal();
    const Eigen::Matrix3d across = (Eigen::Matrix3d::Identity() - normal * normal.transpose()) / feature.reach.norm();
    const auto weights = Eigen::Map<const Eigen::VectorXd>(feature.weights.data(), count);

    Eigen::MatrixXd ways(3, slides), shares = Eigen::MatrixXd::Zero(count, slides);  // of the point, of its weights
    for (Eigen::Index s = 0; s + 1 < count; ++s) {
        ways.col(s) = x.col(feature.vertices[static_cast<std::size_t>(s) + 1]) - x.col(feature.vertices[0]);
        shares(0, s) = -1;
        shares(s + 1, s) = 1;
    }
    if (feature.part == 2) ways.col(slides - 1) = -membrane.tools[feature.tool].axis;

    Eigen::MatrixXd held(3 * count, 3 * count), mixed(3 * count, slides);
    for (Eigen::Index i = 0; i < count; ++i) {
        for (Eigen::Index j = 0; j < count; ++j) held.block<3, 3>(3 * i, 3 * j) = weights[i] * weights[j] * across;
        mixed.middleRows<3>(3 * i) = weights[i] * across * ways - normal * shares.row(i);
    }
    if (slides == 0) return held;
    return held - mixed * (ways.transpose() * across * ways).ldlt().solve(mixed.transpose());
}

/// The y >= 0 of least y.W y / 2 + q.y, for W positive semidefinite [Lawson74].
inline Eigen::VectorXd least_not_negative(const Eigen::MatrixXd& W, const Eigen::VectorXd& q) {
    Eigen::VectorXd y = Eigen::VectorXd::Zero(q.size());
    const double slack = 1e-15 * q.lpNorm<Eigen::Infinity>();
    std::vector<Eigen::Index> free;
    for (Eigen::Index round = 0; round < 10 * q.size(); ++round) {
        Eigen::VectorXd slope = W * y + q;
        for (const Eigen::Index i : free) slope[i] = 0;
        Eigen::Index next;
        if (!(slope.minCoeff(&next) < -slack)) break;
        free.push_back(next);
        while (!free.empty()) {
            const Eigen::VectorXd best = W(free, free).eval().ldlt().solve(-q(free).eval());
            const Eigen::VectorXd now = y(free);
            double step = 1;
            for (Eigen::Index i = 0; i < best.size(); ++i) {
                if (best[i] <= 0) step = std::min(step, now[i] / (now[i] - best[i]));
            }
            y(free) = now + step * (best - now);
            if (step == 1) break;
            // At least one has come to zero on the way: it is bound from now on.
            const auto bound = [&](Eigen::Index i) { return y[i] <= 1e-14 * y.maxCoeff(); };
            for (const Eigen::Index i : free) y[i] = bound(i) ? 0 : y[i];
            std::erase_if(free, bound);
        }
    }
    return y;
}

struct NewtonOptions {
    double far;           // what is at most this far from a tool is looked at [m]
    double longest_step;  // of a vertex [m]
    int most_steps = 60;
};

/// A membrane at rest on its tools.
struct PressedState {
    Eigen::Matrix3Xd x;
    std::vector<Eigen::Vector3d> reactions;  // on each tool [N]
    bool converged = false;
};

/// The symmetric `H`, made positive definite where it is not, as far from rest.
inline Eigen::LLT<Eigen::MatrixXd> factors_of(Eigen::MatrixXd H, double shift) {
    Eigen::LLT<Eigen::MatrixXd> factors(H);
    for (; factors.info() != Eigen::Success; shift *= 4) {
        H.diagonal().array() += shift;
        factors.compute(H);
    }
    return factors;
}

/// Newton's method from the positions `start`.
inline PressedState at_rest(const PressedMembrane& membrane, const Eigen::Matrix3Xd& start,
                            const NewtonOptions& options) {
    PressedState state{start, {}, false};
    std::map<Feature::Name, double> pressure_of;  // [N]
    for (int i = 0; i < options.most_steps && !state.converged; ++i) {
        const auto features = features_near(membrane, state.x, options.far);
        Eigen::MatrixXd H = membrane.stiffness(state.x), J = gap_gradients(features, state.x.size());
        Eigen::VectorXd F = membrane.forces(state.x), gaps(J.rows());
        for (Eigen::Index g = 0; g < gaps.size(); ++g) {
            const auto& feature = features[static_cast<std::size_t>(g)];
            gaps[g] = feature.gap();
            const double pressure = pressure_of[feature.name()];
            if (pressure == 0) continue;
            const auto rows = coordinates_of(feature.vertices);
            H(rows, rows) -= pressure * gap_curvature(membrane, state.x, feature);
        }
        for (const Eigen::Index row : coordinates_of(membrane.pinned)) {
            H.row(row).setZero();
            H.col(row).setZero();
            H(row, row) = 1;
            J.col(row).setZero();
            F[row] = 0;
        }
        const auto factors = factors_of(H, membrane.backing);
        const Eigen::MatrixXd answers = factors.solve(J.transpose());
        const Eigen::VectorXd alone = factors.solve(F);
        const Eigen::VectorXd pressures = least_not_negative(J * answers, gaps + J * alone);
        const Eigen::Matrix3Xd way = (alone + answers * pressures).reshaped(3, state.x.cols());

        const double length = way.colwise().norm().maxCoeff();
        state.x += std::min(1.0, options.longest_step / length) * way;
        state.converged = length < 1e-12;
        pressure_of.clear();
        state.reactions.assign(membrane.tools.size(), Eigen::Vector3d::Zero());
        for (Eigen::Index g = 0; g < gaps.size(); ++g) {
            const auto& feature = features[static_cast<std::size_t>(g)];
            pressure_of[feature.name()] = pressures[g];
            state.reactions[feature.tool] += pressures[g] * feature.normal();
        }
    }
    return state;
}

}  // namespace test
