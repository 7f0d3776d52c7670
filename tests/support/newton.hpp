// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include <membrane/core/types.hpp>
#include <membrane/model/spring_law.hpp>

/// The equilibrium of a small membrane by another method than the solver's: all free vertices at once, by Newton's
/// method with a dense Jacobian from differences. Forces are summed here, from energies that the network does not see.
namespace test {

/// Where `residual` (as many numbers as unknowns) vanishes, from `x` on; steps are halved until they help.
Eigen::VectorXd newton(const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& residual, Eigen::VectorXd x);

/// A point of the membrane, as weights of its vertices, and where it is held or what pulls on it.
struct AttachedPoint {
    std::vector<membrane::Index> vertices;
    std::vector<double> weights;
    Eigen::Vector3d target;
};
struct AppliedLoad {
    std::vector<membrane::Index> vertices;
    std::vector<double> weights;
    Eigen::Vector3d force;
};

/// What is at rest on springs (any law), volume springs of one stiffness, held places and loads.
template <class Network>
struct SmallMembrane {
    const Network& network;
    membrane::Points<double> anchors;
    double volume_stiffness = 0;
    std::vector<membrane::Index> fixed = {};
    std::vector<AttachedPoint> held = {};
    std::vector<AppliedLoad> loads = {};

    struct Equilibrium {
        membrane::Points<double> x;
        std::vector<Eigen::Vector3d> holding;  // the force on each held place
    };

    /// The equilibrium near `start`, 3 x V.
    Equilibrium equilibrium(const membrane::Points<double>& start) const {
        std::vector<membrane::Index> free;
        for (membrane::Index v = 0; v < network.vertex_count(); ++v) {
            bool is_free = true;
            for (const membrane::Index w : fixed) is_free &= v != w;
            if (is_free) free.push_back(v);
        }
        const auto unknowns = static_cast<Eigen::Index>(3 * (free.size() + held.size()));
        const auto take_apart = [&](const Eigen::VectorXd& u) {
            Equilibrium state{start, {}};
            Eigen::Index at = 0;
            for (const membrane::Index v : free) state.x.col(v) = u.segment<3>(at), at += 3;
            for (std::size_t i = 0; i < held.size(); ++i) state.holding.push_back(u.segment<3>(at)), at += 3;
            return state;
        };
        const auto residual = [&](const Eigen::VectorXd& u) {
            const Equilibrium state = take_apart(u);
            const membrane::Points<double> forces = forces_at(state);
            Eigen::VectorXd result(unknowns);
            Eigen::Index at = 0;
            for (const membrane::Index v : free) result.segment<3>(at) = forces.col(v), at += 3;
            for (const auto& place : held) {
                Eigen::Vector3d here = Eigen::Vector3d::Zero();
                for (std::size_t k = 0; k < place.vertices.size(); ++k) {
                    here += place.weights[k] * state.x.col(place.vertices[k]);
                }
                result.segment<3>(at) = here - place.target, at += 3;
            }
            return result;
        };
        Eigen::VectorXd u = Eigen::VectorXd::Zero(unknowns);
        Eigen::Index at = 0;
        for (const membrane::Index v : free) u.segment<3>(at) = start.col(v), at += 3;
        return take_apart(newton(residual, u));
    }

  private:
    membrane::Points<double> forces_at(const Equilibrium& state) const {
        membrane::Points<double> forces = volume_stiffness * (anchors - state.x);
        for (const auto& s : network.springs()) {
            const Eigen::Vector3d edge = state.x.col(s.second) - state.x.col(s.first);
            const double length = edge.stableNorm();
            const auto response = network.law()(membrane::SpringState<double>{s.stiffness, s.rest_length, length});
            forces.col(s.first) += response.tension / length * edge;
            forces.col(s.second) -= response.tension / length * edge;
        }
        for (const auto& load : loads) {
            for (std::size_t k = 0; k < load.vertices.size(); ++k) {
                forces.col(load.vertices[k]) += load.weights[k] * load.force;
            }
        }
        for (std::size_t i = 0; i < held.size(); ++i) {
            for (std::size_t k = 0; k < held[i].vertices.size(); ++k) {
                forces.col(held[i].vertices[k]) += held[i].weights[k] * state.holding[i];
            }
        }
        return forces;
    }
};

}  // namespace test
