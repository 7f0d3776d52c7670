// SPDX-License-Identifier: MIT
#include "support/contact_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/QR>

namespace test {

Eigen::Vector3d nearest_weights(const Eigen::Matrix3d& corners, const Eigen::Vector3d& q) {
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

Eigen::Vector2d nearest_along(const Eigen::Vector3d& p, const Eigen::Vector3d& displacement, const Eigen::Vector3d& q,
                              const Eigen::Vector3d& other_segment) {
    const auto clamped = [](double along) { return std::clamp(along, 0.0, 1.0); };
    std::vector<Eigen::Vector2d> candidates;
    for (const double end : {0.0, 1.0}) {
        candidates.emplace_back(end,
                                clamped((p + end * displacement - q).dot(other_segment) / other_segment.squaredNorm()));
        candidates.emplace_back(clamped((q + end * other_segment - p).dot(displacement) / displacement.squaredNorm()),
                                end);
    }
    Eigen::Matrix<double, 3, 2> displacements;
    displacements << displacement, -other_segment;
    const Eigen::Vector2d inside = displacements.colPivHouseholderQr().solve(q - p);
    if (inside.minCoeff() > 0 && inside.maxCoeff() < 1) candidates.push_back(inside);
    const auto distance = [&](const Eigen::Vector2d& at) {
        return (p + at[0] * displacement - q - at[1] * other_segment).norm();
    };
    return *std::min_element(candidates.begin(), candidates.end(),
                             [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
}

double distance_from_axis(const Tool& tool, const Eigen::Matrix3d& corners) {
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

double winding_number(const membrane::Triangles& triangles, const Eigen::Matrix3Xd& x, const Eigen::Vector3d& q) {
    double angle = 0;
    for (const auto& corner : triangles.colwise()) {
        const Eigen::Vector3d a = x.col(corner[0]) - q, b = x.col(corner[1]) - q, c = x.col(corner[2]) - q;
        const double A = a.norm(), B = b.norm(), C = c.norm();
        angle += 2 * std::atan2(a.dot(b.cross(c)), A * B * C + a.dot(b) * C + b.dot(c) * A + c.dot(a) * B);
    }
    return angle / (4 * std::numbers::pi);
}

std::vector<Eigen::Index> coordinates_of(const std::vector<Eigen::Index>& vertices) {
    std::vector<Eigen::Index> rows;
    for (const Eigen::Index v : vertices) rows.insert(rows.end(), {3 * v, 3 * v + 1, 3 * v + 2});
    return rows;
}

Eigen::VectorXd PressedMembrane::forces(const Eigen::Matrix3Xd& x) const {
    Eigen::Matrix3Xd sum = foundation * (anchors - x);
    for (const auto& spring : springs) {
        const Eigen::Vector3d edge = x.col(spring.second) - x.col(spring.first);
        const Eigen::Vector3d pull = spring.stiffness * (1 - spring.rest_length / edge.norm()) * edge;
        sum.col(spring.first) += pull;
        sum.col(spring.second) -= pull;
    }
    return sum.reshaped();
}

std::vector<Feature> features_near(const PressedMembrane& membrane, const Eigen::Matrix3Xd& x, double far) {
    std::map<Feature::Name, Feature> found;
    for (std::size_t i = 0; i < membrane.tools.size(); ++i) {
        const auto& tool = membrane.tools[i];
        const Eigen::Vector3d end = tool.position, axis = tool.axis;
        for (const auto& triangle : membrane.triangles.colwise()) {
            Eigen::Matrix3d corners;
            for (int k = 0; k < 3; ++k) corners.col(k) = x.col(triangle[k]);
            const auto add = [&](int part, const Eigen::Vector3d& weights, const Eigen::Vector3d& axis_point) {
                Feature feature{i, part, {}, {}, axis_point - corners * weights, tool.radius};
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

Eigen::MatrixXd gap_gradients(const std::vector<Feature>& features, Eigen::Index coordinates) {
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

Eigen::MatrixXd gap_curvature(const PressedMembrane& membrane, const Eigen::Matrix3Xd& x, const Feature& feature) {
    const auto count = static_cast<Eigen::Index>(feature.vertices.size());
    const Eigen::Index slides = count - 1 + (feature.part == 2 ? 1 : 0);
    const Eigen::Vector3d normal = feature.normal();
    const Eigen::Matrix3d across =
        (Eigen::Matrix3d::Identity() - normal * normal.transpose()) / feature.separation.norm();
    const auto weights = Eigen::Map<const Eigen::VectorXd>(feature.weights.data(), count);

    Eigen::MatrixXd displacements(3, slides),
        shares = Eigen::MatrixXd::Zero(count, slides);  // of the point, of its weights
    for (Eigen::Index s = 0; s + 1 < count; ++s) {
        displacements.col(s) = x.col(feature.vertices[static_cast<std::size_t>(s) + 1]) - x.col(feature.vertices[0]);
        shares(0, s) = -1;
        shares(s + 1, s) = 1;
    }
    if (feature.part == 2) displacements.col(slides - 1) = -membrane.tools[feature.tool].axis;

    Eigen::MatrixXd held(3 * count, 3 * count), mixed(3 * count, slides);
    for (Eigen::Index i = 0; i < count; ++i) {
        for (Eigen::Index j = 0; j < count; ++j) held.block<3, 3>(3 * i, 3 * j) = weights[i] * weights[j] * across;
        mixed.middleRows<3>(3 * i) = weights[i] * across * displacements - normal * shares.row(i);
    }
    if (slides == 0) return held;
    return held - mixed * (displacements.transpose() * across * displacements).ldlt().solve(mixed.transpose());
}

Eigen::VectorXd smallest_non_negative(const Eigen::MatrixXd& W, const Eigen::VectorXd& q) {
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
            // At least one has come to zero before the end: it is bound from now on.
            const auto bound = [&](Eigen::Index i) { return y[i] <= 1e-14 * y.maxCoeff(); };
            for (const Eigen::Index i : free) y[i] = bound(i) ? 0 : y[i];
            std::erase_if(free, bound);
        }
    }
    return y;
}

namespace {

/// The symmetric `H`, made positive definite where it is not, as far from rest.
Eigen::LLT<Eigen::MatrixXd> factors_of(Eigen::MatrixXd H, double shift) {
    Eigen::LLT<Eigen::MatrixXd> factors(H);
    for (; factors.info() != Eigen::Success; shift *= 4) {
        H.diagonal().array() += shift;
        factors.compute(H);
    }
    return factors;
}

}  // namespace

PressedState at_rest(const PressedMembrane& membrane, const Eigen::Matrix3Xd& start, const NewtonOptions& options) {
    PressedState state{start, {}, false};
    std::map<Feature::Name, double> pressure_of;  // [N]
    for (int i = 0; i < options.max_steps && !state.converged; ++i) {
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
        const auto factors = factors_of(H, membrane.foundation);
        const Eigen::MatrixXd responses = factors.solve(J.transpose());
        const Eigen::VectorXd alone = factors.solve(F);
        const Eigen::VectorXd pressures = smallest_non_negative(J * responses, gaps + J * alone);
        const Eigen::Matrix3Xd displacement = (alone + responses * pressures).reshaped(3, state.x.cols());

        const double length = displacement.colwise().norm().maxCoeff();
        state.x += std::min(1.0, options.max_step / length) * displacement;
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
