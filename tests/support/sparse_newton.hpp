// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/SparseCholesky>

#include <membrane/model/mass_spring_network.hpp>

/// Where linear springs and a foundation balance, by another method than the library's: all free vertices at once, by
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
    StillMembrane(const Network& network, const membrane::Points<double>& anchors, double foundation)
        : foundation_(static_cast<std::size_t>(anchors.cols()), foundation),
          anchors_(anchors),
          load_(membrane::Points<double>::Zero(3, anchors.cols())),
          fixed_(foundation_.size(), 0) {
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
    void back(double foundation) { std::fill(foundation_.begin(), foundation_.end(), foundation); }
    void back(membrane::Index v, double foundation) { foundation_[static_cast<std::size_t>(v)] = foundation; }
    void load(membrane::Index v, const Eigen::Vector3d& force) { load_.col(v) += force; }

    /// Springs, foundation and loads on every vertex.
    membrane::Points<double> forces(const membrane::Points<double>& x) const;

    /// Second derivative of the energy by the free vertices; zero rows and ones on the diagonal for the others.
    Eigen::SparseMatrix<double> stiffness(const membrane::Points<double>& x) const;

    struct Rest {
        membrane::Points<double> x;
        bool stable;  // a minimum, as far as the factors say
    };

    /// Where Newton's method ends from `x`; nothing is said if it does not converge. Fixed vertices stay.
    Rest equilibrium(membrane::Points<double> x);

  private:
    bool is_fixed(Eigen::Index v) const { return fixed_[static_cast<std::size_t>(v)] != 0; }

    std::vector<membrane::Spring<double>> springs_;
    std::vector<double> foundation_;
    membrane::Points<double> anchors_, load_;
    std::vector<unsigned char> fixed_;
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
    bool analysed_ = false;
};

}  // namespace test
