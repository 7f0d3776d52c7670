// SPDX-License-Identifier: MIT
#include "support/newton.hpp"

#include "support/eigenvalues.hpp"

namespace test {

Eigen::VectorXd newton(const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& residual, Eigen::VectorXd x) {
    const Eigen::Index count = x.size();
    Eigen::VectorXd here = residual(x);
    const double size = x.cwiseAbs().maxCoeff();
    for (int iteration = 0; iteration < 100; ++iteration) {
        Eigen::MatrixXd jacobian(count, count);
        const double h = 1e-6 * (size > 0 ? size : 1.0);
        for (Eigen::Index i = 0; i < count; ++i) {
            Eigen::VectorXd after = x, before = x;
            after[i] += h;
            before[i] -= h;
            jacobian.col(i) = (residual(after) - residual(before)) / (2 * h);
        }
        const Eigen::VectorXd displacement = -solve(jacobian, here);
        double step = 1;
        Eigen::VectorXd there = residual(x + displacement);
        while (!(there.norm() < here.norm()) && step > 1e-10) {
            step /= 2;
            there = residual(x + step * displacement);
        }
        if (!(there.norm() < here.norm())) return x;  // no nearer than rounding lets it
        x += step * displacement;
        here = there;
    }
    return x;
}

}  // namespace test
