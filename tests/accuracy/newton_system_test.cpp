// SPDX-License-Identifier: MIT
#include <membrane/accuracy/newton_system.hpp>

#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Core>

#include <membrane/core/check.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

Eigen::VectorXd random_vector(Eigen::Index size, test::Random& random) {
    Eigen::VectorXd v(size);
    for (double& number : v) number = random.number(-1.0, 1.0);
    return v;
}

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns, test::Random& random) {
    Eigen::MatrixXd m(rows, columns);
    for (Eigen::Index c = 0; c < columns; ++c) m.col(c) = random_vector(rows, random);
    return m;
}

/// Six vertices, some of them fixed and with a step of their own, each joined to every other, under some rows.
struct Problem {
    std::vector<unsigned char> fixed;
    Points<double> prescribed = Points<double>::Zero(3, 6);
    Eigen::MatrixXd H;
    Eigen::VectorXd F;
    std::vector<ConstraintRow> rows;

    explicit Problem(test::Random& random, double shift = 1) {
        for (Index v = 0; v < 6; ++v) {
            fixed.push_back(random.chance(0.3) ? 1 : 0);
            if (fixed.back() != 0) prescribed.col(v) = 0.1 * random.vector();
        }
        const Eigen::MatrixXd root = random_matrix(18, 18, random);
        H = root * root.transpose() + shift * Eigen::MatrixXd::Identity(18, 18);
        F = 3 * random_vector(18, random);
        for (Index i = 0; i < 4; ++i) {
            const auto gradient = [&] { return random.vector(); };
            rows.push_back({{i, i + 1, i + 2}, {gradient(), gradient(), gradient()}, random.number(-1.0, 1.0), i == 0});
            if (random.chance(0.3)) rows.back().stiffening = 2;
        }
    }

    /// With forces in another unit.
    NewtonStep solve(double unit = 1) const {
        NewtonSystem system(fixed);
        system.open(prescribed);
        for (Index i = 0; i < 6; ++i) {
            for (Index j = 0; j <= i; ++j) system.add(i, j, unit * H.block<3, 3>(3 * i, 3 * j));
            system.add_force(i, unit * F.segment<3>(3 * i));
        }
        for (auto row : rows) {
            row.stiffening *= unit;
            system.add(row);
        }
        return system.solve(unit);
    }

    Eigen::VectorXd gradient(std::size_t i) const {
        Eigen::VectorXd sum = Eigen::VectorXd::Zero(18);
        for (std::size_t k = 0; k < 3; ++k) sum.segment<3>(3 * rows[i].vertices[k]) += rows[i].gradient[k];
        return sum;
    }
};

}  // namespace

TEST_CASE("a constrained step satisfies the conditions of Karush, Kuhn and Tucker", "[newton_system]") {
    int pressed = 0, free = 0;
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Problem problem(random);
        const auto [step, multipliers] = problem.solve();
        const Eigen::VectorXd s = step.reshaped();
        Eigen::VectorXd unbalanced = problem.F - problem.H * s;
        for (std::size_t i = 0; i < problem.rows.size(); ++i) {
            const auto& row = problem.rows[i];
            const Eigen::VectorXd gradient = problem.gradient(i);
            const double value = row.value + gradient.dot(s), multiplier = multipliers[static_cast<Eigen::Index>(i)];
            unbalanced += (multiplier - row.stiffening * value) * gradient;
            bool changes = false;
            for (const Index v : row.vertices) changes |= problem.fixed[static_cast<std::size_t>(v)] == 0;
            if (!changes) {
                CHECK(multiplier == 0);
                continue;
            }
            if (row.equality) {
                CHECK(std::abs(value) < 1e-10);
                continue;
            }
            CHECK(multiplier >= 0);
            CHECK(value > -1e-10);
            CHECK(std::abs(multiplier * value) < 1e-9);
            ++(multiplier > 0 ? pressed : free);
        }
        for (Index v = 0; v < 6; ++v) {
            if (problem.fixed[static_cast<std::size_t>(v)] != 0) {
                CHECK(step.col(v) == problem.prescribed.col(v));
            } else {
                CHECK(unbalanced.segment<3>(3 * v).norm() < 1e-9);
            }
        }
    }
    CHECK((pressed > 0 && free > 0));
}

TEST_CASE("where the matrix is not positive definite the step still goes downhill", "[newton_system]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Problem problem(random, -5);
        problem.rows.clear();
        problem.prescribed.setZero();
        const Eigen::VectorXd step = problem.solve().step.reshaped();
        REQUIRE(is_finite(step));
        for (const double unit : {0x1p-20, 0x1p20}) CHECK(problem.solve(unit).step.reshaped() == step);  // exact
        if (!step.isZero(0)) CHECK(problem.F.dot(step) > 0);
    }
}

TEST_CASE("a system that has nothing, or nothing free, has no step", "[newton_system]") {
    NewtonSystem empty({0, 0, 0});
    empty.open(Points<double>::Zero(3, 3));
    CHECK(empty.solve(1).step.isZero(0));

    NewtonSystem held({1, 1, 1});
    const Points<double> prescribed = Points<double>::Ones(3, 3);
    held.open(prescribed);
    held.add({{0, 1, 2}, {Vector3<double>(1, 0, 0), Vector3<double>(1, 0, 0), Vector3<double>(0, 0, 0)}, -1, false});
    const auto result = held.solve(1);
    CHECK(result.step == prescribed);
    CHECK(result.multipliers.isZero(0));
}

TEST_CASE("rows that say the same share their multiplier", "[newton_system]") {
    NewtonSystem system({0, 1, 1});
    system.open(Points<double>::Zero(3, 3));
    system.add(0, 0, 2 * Eigen::Matrix3d::Identity());
    const Vector3<double> up(0, 0, 1), none(0, 0, 0);
    for (int i = 0; i < 3; ++i) system.add({{0, 1, 2}, {up, none, none}, -0.5, false});
    const auto result = system.solve(2);
    CHECK((result.step.col(0) - Vector3<double>(0, 0, 0.5)).norm() < 1e-14);
    CHECK(result.multipliers.minCoeff() >= 0);
    CHECK(result.multipliers.sum() == Approx(1));
}

TEST_CASE("multipliers of random quadratic problems", "[newton_system]") {
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Eigen::Index count = 1 + random.index(12), rank = 1 + random.index(15);
        const Eigen::MatrixXd root = random_matrix(count, rank, random);
        const Eigen::MatrixXd W = root * root.transpose();
        const Eigen::VectorXd q = W * random_vector(count, random);  // bounded below
        std::vector<unsigned char> equality;
        for (Eigen::Index i = 0; i < count; ++i) equality.push_back(random.chance(0.2) ? 1 : 0);
        const Eigen::VectorXd y = estimated_multipliers(W, q, equality), slope = W * y + q;
        for (Eigen::Index i = 0; i < count; ++i) {
            if (equality[static_cast<std::size_t>(i)] != 0) {
                CHECK(std::abs(slope[i]) < 1e-8);
                continue;
            }
            CHECK(y[i] >= 0);
            CHECK(slope[i] > -1e-8);
            CHECK(std::abs(y[i] * slope[i]) < 1e-8 * (1 + y.norm()));
        }
    }
}
