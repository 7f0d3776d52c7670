// SPDX-License-Identifier: MIT
#include <membrane/calibration/singular_values.hpp>

#include <algorithm>
#include <cmath>
#include <functional>

#include <Eigen/SVD>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

Eigen::MatrixXd random_matrix(Random& random, Index rows, Index columns) {
    Eigen::MatrixXd matrix(rows, columns);
    for (auto& entry : matrix.reshaped()) entry = random.number(-1.0, 1.0);
    return matrix;
}

Eigen::VectorXd descending(Eigen::VectorXd values) {
    std::sort(values.begin(), values.end(), std::greater<>());
    return values;
}

/// Eigen's own.
using Reference = Eigen::JacobiSVD<Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>>;

}  // namespace

TEST_CASE("Singular values are those of Eigen's own decomposition, the directions orthogonal") {
    Random random(2);
    for (int i = 0; i < cases(500); ++i) {
        CAPTURE(i);
        const Index columns = 1 + random.index(8), rows = columns + random.index(20);
        Eigen::MatrixXd matrix = random_matrix(random, rows, columns);
        if (random.chance(0.3)) matrix.col(0) = matrix.col(columns - 1);  // of less than full rank
        if (random.chance(0.1)) matrix.col(random.index(columns)).setZero();
        const SingularValues found(matrix);
        const Eigen::VectorXd expected = Reference(matrix.cast<long double>()).singularValues().cast<double>();
        CHECK((descending(found.values) - expected).norm() <= 1e-13 * expected[0]);
        const auto identity = Eigen::MatrixXd::Identity(columns, columns);
        CHECK((found.directions.transpose() * found.directions - identity).norm() < 1e-13);
        CHECK((matrix * found.directions - found.rotated).norm() <= 1e-13 * matrix.norm());
        const Eigen::MatrixXd products = found.rotated.transpose() * found.rotated;
        CHECK((products - Eigen::MatrixXd(products.diagonal().asDiagonal())).norm() <= 1e-13 * products.norm());
    }
}

TEST_CASE("Singular values of columns of very unequal lengths have all their digits") {
    Random random(3);
    for (int i = 0; i < cases(200); ++i) {
        CAPTURE(i);
        const Eigen::MatrixXd matrix = random_matrix(random, 12, 3);
        const Eigen::Vector3d lengths(1, std::pow(10, random.number(-12.0, 0.0)),
                                      std::pow(10, random.number(-12.0, 0.0)));
        const Eigen::MatrixXd scaled = matrix * lengths.asDiagonal();
        const Reference expected(scaled.cast<long double>());
        const Eigen::VectorXd values = descending(SingularValues(scaled).values);
        for (int k = 0; k < 3; ++k) {
            CHECK(values[k] == Approx(static_cast<double>(expected.singularValues()[k])).epsilon(1e-10));
        }
    }
}
