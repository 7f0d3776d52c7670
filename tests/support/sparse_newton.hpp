// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/SparseCholesky>

#include <membrane/network/mass_spring_network.hpp>

/// Where linear springs and a backing balance, found in another way than the library's: all free vertices at once, by
/// Newton's method with sparse factors. Forces and stiffness are summed here.
namespace test {

/// A membrane of linear springs as numbers, in double.
///
///     test::StillMembrane membrane(network, mesh.positions(), 0.1);
///     membrane.fixed[7] = 1;
///     const auto rest = membrane.equilibrium(x);               // vertex 7 where it is in x
class StillMembrane {
  public:
    template <class Network>
    StillMembrane(const Network& network, const membrane::Points<double>& anchors, double backing)
        : backing_(static_cast<std::size_t>(anchors.cols()), backing),
          anchors_(anchors),
          load_(membrane::Points<double>::Zero(3, anchors.cols())),
          fixed_(backing_.size(), 0) {
        for (const auto& s : network.springs()) {
            springs_.push_back(
                {s.first, s.second, static_cast<double>(s.stiffness), static_cast<double>(s.rest_length)});
        }
        for (membrane::Index v = 0; v < network.vertex_count(); ++v) {
            if (network.pinned(v)) fix(v);
        }
    }

    void fix(membrane::Index v) { fixed_[static_cast<std::size_t>(v)] = 1; }
    void release(membrane::Index v) { fixed_[static_cast<std::size_t>(v)] = 0; }
    void back(double backing) { std::fill(backing_.begin(), backing_.end(), backing); }
    void back(membrane::Index v, double backing) { backing_[static_cast<std::size_t>(v)] = backing; }
    void load(membrane::Index v, const Eigen::Vector3d& force) { load_.col(v) += force; }

    /// Springs, backing and loads on every vertex.
    membrane::Points<double> forces(const membrane::Points<double>& x) const {
        membrane::Points<double> sum = load_;
        for (Eigen::Index v = 0; v < x.cols(); ++v) {
            sum.col(v) += backing_[static_cast<std::size_t>(v)] * (anchors_.col(v) - x.col(v));
        }
        for (const auto& s : springs_) {
            const Eigen::Vector3d reach = x.col(s.second) - x.col(s.first);
            const Eigen::Vector3d pull = s.stiffness * (reach - s.rest_length * reach.normalized());
            sum.col(s.first) += pull;
            sum.col(s.second) -= pull;
        }
        return sum;
    }

    /// Second derivative of the energy by the free vertices; zero rows and ones on the diagonal for the others.
    Eigen::SparseMatrix<double> stiffness(const membrane::Points<double>& x) const {
        std::vector<Eigen::Triplet<double>> entries;
        const auto add = [&](Eigen::Index i, Eigen::Index j, const Eigen::Matrix3d& block) {
            const bool zero = is_fixed(i) || is_fixed(j);
            for (int row = 0; row < 3; ++row) {
                for (int column = 0; column < 3; ++column) {
                    entries.emplace_back(3 * i + row, 3 * j + column, zero ? 0 : block(row, column));
                }
            }
        };
        for (Eigen::Index v = 0; v < x.cols(); ++v) {
            for (int k = 0; k < 3; ++k) {
                const double own = backing_[static_cast<std::size_t>(v)];
                entries.emplace_back(3 * v + k, 3 * v + k, is_fixed(v) ? 1 : own);
            }
        }
        for (const auto& s : springs_) {
            const Eigen::Vector3d reach = x.col(s.second) - x.col(s.first), u = reach.normalized();
            const double q = s.rest_length / reach.norm();
            const Eigen::Matrix3d block = s.stiffness * ((1 - q) * Eigen::Matrix3d::Identity() + q * u * u.transpose());
            add(s.first, s.first, block);
            add(s.second, s.second, block);
            add(s.first, s.second, -block);
            add(s.second, s.first, -block);
        }
        Eigen::SparseMatrix<double> result(x.size(), x.size());
        result.setFromTriplets(entries.begin(), entries.end());
        return result;
    }

    struct Rest {
        membrane::Points<double> x;
        bool stable;  // a minimum, as far as the factors say
    };

    /// Where Newton's method leads from `x`; nothing is said if it does not converge. Fixed vertices stay.
    Rest equilibrium(membrane::Points<double> x) {
        double before = std::numeric_limits<double>::infinity();
        for (int iteration = 0; iteration < 50; ++iteration) {
            membrane::Points<double> force = forces(x);
            for (Eigen::Index v = 0; v < x.cols(); ++v) {
                if (is_fixed(v)) force.col(v).setZero();
            }
            const double now = force.norm();
            if (!(now < before / 2)) break;
            before = now;
            const auto H = stiffness(x);
            if (!analysed_) factors_.analyzePattern(H);
            analysed_ = true;
            factors_.factorize(H);
            x += factors_.solve(force.reshaped().eval()).reshaped(3, x.cols());
        }
        return {x, analysed_ && factors_.info() == Eigen::Success && factors_.vectorD().minCoeff() > 0};
    }

  private:
    bool is_fixed(Eigen::Index v) const { return fixed_[static_cast<std::size_t>(v)] != 0; }

    std::vector<membrane::Spring<double>> springs_;
    std::vector<double> backing_;
    membrane::Points<double> anchors_, load_;
    std::vector<unsigned char> fixed_;
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
    bool analysed_ = false;
};

}  // namespace test
