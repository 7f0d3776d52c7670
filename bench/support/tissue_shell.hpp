// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <stdexcept>

#include <Eigen/Dense>

#include "tissue_eye.hpp"

/// A shell of revolution in one dimension, as an independent check of `Inflation`: none of the library's elements and
/// solvers, and the plate's own Poisson ratio in bending.
namespace bench::tissue {

inline constexpr int shell_elements = 160;

/// Kirchhoff-Love shell of Saint Venant-Kirchhoff material, by nodes along a meridian and Newton's method with finite
/// differences of the energy. Lengths are over the radius, energies over E t radius^2.
class RevolvedShell {
  public:
    /// The pressure is on the first `loaded` elements, all by default.
    RevolvedShell(const Eye& eye, int elements, int loaded = std::numeric_limits<int>::max())
        : eye_(eye), last_(elements), loaded_(std::min(loaded, elements)), rest_(2, elements + 2) {
        for (int i = 0; i <= last_ + 1; ++i) {
            const double angle = eye.rim_angle() * i / last_;
            rest_.col(i) << std::sin(angle), std::cos(angle);
        }
        x_ = rest_;
    }

    /// @throws std::runtime_error if Newton's method does not converge
    [[nodiscard]] Middle at(double pressure) {
        pressure_ = pressure * eye_.radius / (eye_.young_modulus * eye_.thickness);
        for (int turn = 0; turn < 50; ++turn) {
            edge_height_ = x_(1, loaded_);
            const Eigen::VectorXd step = newton_step();
            x_.leftCols(last_).reshaped() -= step;
            if (step.cwiseAbs().maxCoeff() < 1e-8) {
                return {(x_(1, 0) - 1) * eye_.radius, x_.col(1).x() / rest_.col(1).x()};
            }
        }
        throw std::runtime_error("the shell of revolution does not converge");
    }

  private:
    using Nodes = Eigen::Matrix2Xd;      // distance from the axis and height
    using Stencil = std::array<int, 3>;  // nodes; that before the first is its mirror image

    [[nodiscard]] Eigen::Vector2d node(const Nodes& x, int i) const {
        return i >= 0 ? Eigen::Vector2d(x.col(i)) : Eigen::Vector2d(-x(0, 1), x(1, 1));
    }
    [[nodiscard]] static double slope(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
        return std::atan2(a.y() - b.y(), b.x() - a.x());
    }
    [[nodiscard]] double of_strains(double along, double around) const {
        const double nu = eye_.poisson_ratio;
        return (along * along + around * around + 2 * nu * along * around) / (2 * (1 - nu * nu));
    }

    // Stretch of the element from node i to the next, and work of the pressure on it.
    [[nodiscard]] double stretching(const Nodes& x, int i) const {
        const Eigen::Vector2d a = node(x, i), b = node(x, i + 1), a0 = node(rest_, i), b0 = node(rest_, i + 1);
        const double length = (b0 - a0).norm(), middle = (a0.x() + b0.x()) / 2;
        const auto green = [](double stretch) { return (stretch * stretch - 1) / 2; };
        const double energy = of_strains(green((b - a).norm() / length), green((a.x() + b.x()) / 2 / middle));
        double volume = i < loaded_ ? (a.y() - b.y()) * (a.x() * a.x() + a.x() * b.x() + b.x() * b.x()) / 3 : 0;
        if (i + 1 == loaded_) volume += b.x() * b.x() * (b.y() - edge_height_);  // moved by the load with its edge
        return std::numbers::pi * (2 * middle * length * energy - pressure_ * volume);
    }

    // Bending at node i, over half of the elements beside it.
    [[nodiscard]] double bending(const Nodes& x, int i) const {
        const auto curvatures = [&](const Nodes& at, double length) {
            const double before = slope(node(at, i - 1), node(at, i)), after = slope(node(at, i), node(at, i + 1));
            const double along = (after - before) / length;
            return Eigen::Vector2d(along, i == 0 ? along : std::sin((before + after) / 2) / at(0, i));
        };
        const double before = (node(rest_, i) - node(rest_, i - 1)).norm();
        const double length = (before + (node(rest_, i + 1) - node(rest_, i)).norm()) / 2;
        const Eigen::Vector2d change = curvatures(x, length) - curvatures(rest_, length);
        const double area = i == 0 ? length * length / 4 : 2 * rest_(0, i) * length;
        const double ratio = eye_.thickness / eye_.radius;
        return std::numbers::pi * area * ratio * ratio / 12 * of_strains(change.x(), change.y());
    }

    // Adds the derivatives of an energy of these nodes.
    template <class Energy>
    void add(const Stencil& nodes, Energy energy, Eigen::VectorXd& gradient, Eigen::MatrixXd& hessian) const {
        Eigen::Array<int, 6, 1> at;
        for (int k = 0; k < 6; ++k) at[k] = 2 * nodes[static_cast<std::size_t>(k / 2)] + k % 2;
        Nodes moved = x_;
        constexpr double h = 2e-5;
        const auto moving = [&](int a, double by_a, int b, double by_b) {
            moved = x_;
            moved.reshaped()[a] += by_a;
            moved.reshaped()[b] += by_b;
            return energy(moved);
        };
        for (const int a : at) {
            if (a < 0 || a >= 2 * last_) continue;
            gradient[a] +=
                (8 * (moving(a, h, a, 0) - moving(a, -h, a, 0)) - (moving(a, h, a, h) - moving(a, -h, a, -h))) /
                (12 * h);  // exact to the fourth order
            for (const int b : at) {
                if (b < 0 || b >= 2 * last_) continue;
                hessian(a, b) +=
                    (moving(a, h, b, h) - moving(a, h, b, -h) - moving(a, -h, b, h) + moving(a, -h, b, -h)) /
                    (4 * h * h);
            }
        }
    }

    [[nodiscard]] Eigen::VectorXd newton_step() const {
        const int count = 2 * last_;  // the node at the border and that beyond it are fixed
        Eigen::VectorXd gradient = Eigen::VectorXd::Zero(count);
        Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(count, count);
        for (int i = 0; i < last_; ++i) {
            add(
                {-1, i, i + 1}, [&](const Nodes& x) { return stretching(x, i); }, gradient, hessian);
        }
        for (int i = 0; i < last_ + (eye_.clamped ? 1 : 0); ++i) {
            add(
                {i - 1, i, i + 1}, [&](const Nodes& x) { return bending(x, i); }, gradient, hessian);
        }
        gradient[0] = 0;  // the first node stays on the axis
        hessian.row(0).setZero();
        hessian.col(0).setZero();
        hessian(0, 0) = 1;
        return hessian.partialPivLu().solve(gradient);
    }

    Eye eye_;
    int last_, loaded_;  // numbers of the nodes at the border and at the edge of the load
    double edge_height_ = 0;
    Nodes rest_, x_;
    double pressure_ = 0;
};

}  // namespace bench::tissue
