// SPDX-License-Identifier: MIT
#include <membrane/accuracy/block_cholesky.hpp>

#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>

#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

struct Link {
    Index first, second;
};

/// A random matrix of blocks, sparse and dense.
struct BlockMatrix {
    std::vector<Link> links;
    std::vector<Symmetric3<double>> diagonal, linked;
    Eigen::MatrixXd dense;

    BlockMatrix(Index vertices, test::Random& random) : dense(Eigen::MatrixXd::Zero(3 * vertices, 3 * vertices)) {
        const auto block = [&] {
            const auto a = random.vector<double>(), b = random.vector<double>();
            return Symmetric3<double>{a[0], a[1], a[2], b[0], b[1], b[2]};
        };
        const auto put = [&](Index i, Index j, const Symmetric3<double>& a, double sign) {
            Eigen::Matrix3d m;
            m << a.xx, a.xy, a.xz, a.xy, a.yy, a.yz, a.xz, a.yz, a.zz;
            dense.block<3, 3>(3 * i, 3 * j) += sign * m;
        };
        for (Index v = 0; v < vertices; ++v) {
            diagonal.push_back(block());
            put(v, v, diagonal.back(), 1);
            for (Index w = 0; w < v; ++w) {
                if (!random.chance(0.2)) continue;
                links.push_back(random.chance(0.5) ? Link{v, w} : Link{w, v});
                linked.push_back(block());
                put(v, w, linked.back(), -1);
                put(w, v, linked.back(), -1);
            }
        }
    }
    void fill(BlockCholesky& factors) const {
        factors.open();
        for (std::size_t v = 0; v < diagonal.size(); ++v) factors.add(static_cast<Index>(v), diagonal[v]);
        for (std::size_t l = 0; l < links.size(); ++l) factors.subtract(l, linked[l]);
    }
};

/// The factors of a mesh, of a block for each vertex and each edge.
BlockCholesky factors_of(const TriangleMesh<double>& mesh) {
    const Adjacency adjacency(mesh);
    std::vector<Link> links;
    for (const auto& [first, second] : adjacency.edges()) links.push_back({first, second});
    return {mesh.vertex_count(), links};
}

}  // namespace

TEST_CASE("definite just above the smallest eigenvalue, and never below", "[block_cholesky]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const BlockMatrix matrix(1 + random.index(30), random);
        BlockCholesky factors(static_cast<Index>(matrix.diagonal.size()), matrix.links);
        const double least = test::eigenvalues_of(matrix.dense)[0];
        for (int again = 0; again < 2; ++again) {  // what was factorised before does not matter
            matrix.fill(factors);
            CHECK(factors.definite_above(least - 1e-9));
            CHECK_FALSE(factors.definite_above(least + 1e-12));
            CHECK(factors.definite_above(least - 1));
            CHECK_FALSE(factors.definite_above(least + 1));
        }
        BlockCholesky copy = factors;
        factors.open();
        CHECK(copy.definite_above(least - 1e-9));
        CHECK_FALSE(factors.definite_above(0));
        CHECK(factors.definite_above(-1));
    }
}

TEST_CASE("matrices that are only just not definite are not taken for it", "[block_cholesky]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        // A Laplacian has an eigenvalue of exactly zero, and so has this one, of small whole numbers.
        const Index vertices = 2 + random.index(40);
        std::vector<Link> links;
        for (Index v = 1; v < vertices; ++v) {
            links.push_back({v, random.index(v)});
            if (v > 3) links.push_back({(v - 1) % 3, v});
        }
        BlockCholesky factors(vertices, links);
        factors.open();
        for (std::size_t l = 0; l < links.size(); ++l) {
            const auto block = diagonal3(static_cast<double>(1 + random.index(5)));
            factors.add(links[l].first, block);
            factors.add(links[l].second, block);
            factors.subtract(l, block);
        }
        CHECK_FALSE(factors.definite_above(0));
        CHECK(factors.definite_above(-1e-9));
    }
}

TEST_CASE("by the factors a random system is solved, also where only few rows are not zero", "[block_cholesky]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        BlockMatrix matrix(1 + random.index(60), random);
        BlockCholesky factors(static_cast<Index>(matrix.diagonal.size()), matrix.links);
        matrix.fill(factors);
        for (std::size_t l = 0; l < matrix.links.size(); ++l) {  // and a part that is not symmetric
            const auto [first, second] = matrix.links[l];
            Eigen::Matrix3d block;
            for (double& number : block.reshaped()) number = random.number(-1.0, 1.0);
            factors.subtract(l, block);
            matrix.dense.block<3, 3>(3 * first, 3 * second) -= block;
            matrix.dense.block<3, 3>(3 * second, 3 * first) -= block.transpose();
        }
        const Eigen::Index size = matrix.dense.rows();
        const double shift = 0.1 - test::eigenvalues_of(matrix.dense)[0];
        REQUIRE(factors.factorise(shift, 0));
        const Eigen::MatrixXd inverse = (matrix.dense + shift * Eigen::MatrixXd::Identity(size, size)).inverse();

        // By vertices, and as the factors have them.
        const auto put = [&](const Eigen::VectorXd& from, Eigen::VectorXd& to, bool forth) {
            for (Index v = 0; 3 * v < size; ++v) {
                const auto rank = static_cast<Eigen::Index>(3 * factors.rank(v));
                to.segment<3>(forth ? rank : 3 * v) = from.segment<3>(forth ? 3 * v : rank);
            }
        };
        Eigen::VectorXd b = Eigen::VectorXd::Zero(size), ordered(size), x(size);
        const std::vector<Index> some{random.index(static_cast<Index>(size / 3)),
                                      random.index(static_cast<Index>(size / 3))};
        for (const Index v : some) b.segment<3>(3 * v) = random.vector<double>().eigen();
        put(b, ordered, true);
        const auto ranks = factors.affected(some);
        Eigen::MatrixXd short_b(static_cast<Eigen::Index>(3 * ranks.size()), 2);
        for (std::size_t i = 0; i < ranks.size(); ++i) {
            for (Eigen::Index column = 0; column < 2; ++column) {
                short_b.col(column).segment<3>(static_cast<Eigen::Index>(3 * i)) =
                    static_cast<double>(1 + column) * ordered.segment<3>(static_cast<Eigen::Index>(3 * ranks[i]));
            }
        }
        factors.solve_lower(ordered);
        factors.solve_lower(short_b, ranks);
        Eigen::VectorXd rest = ordered;
        for (std::size_t i = 0; i < ranks.size(); ++i) {
            const auto here = static_cast<Eigen::Index>(3 * i), there = static_cast<Eigen::Index>(3 * ranks[i]);
            for (Eigen::Index column = 0; column < 2; ++column) {
                const Eigen::VectorXd expected = static_cast<double>(1 + column) * ordered.segment<3>(there);
                CHECK((short_b.col(column).segment<3>(here) - expected).norm() < 1e-12 * (1 + expected.norm()));
            }
            rest.segment<3>(there).setZero();
        }
        CHECK(rest.isZero(0));
        factors.solve_upper(ordered);
        put(ordered, x, false);
        CHECK((x - inverse * b).norm() < 1e-9 * (1 + x.norm()));
    }
}

TEST_CASE("a factorisation fails where the square of a pivot is not above the least", "[block_cholesky]") {
    BlockCholesky factors(2, std::vector<Link>{});
    factors.open();
    factors.add(0, diagonal3(2.0));
    factors.add(1, diagonal3(3.0));
    CHECK(factors.factorise(0, 1.5));
    CHECK_FALSE(factors.factorise(0, 2));
    CHECK(factors.factorise(0.5, 2));
    CHECK_FALSE(factors.factorise(-2, 0));
}

// Of n rows: the bounds of nested dissection. By minimum degree the factors of the sphere of 10,242 vertices have 9.4
// n log2 n numbers, and take 178 n^1.5 multiplications.
TEST_CASE("the work of factors and solutions grows as of a plane mesh", "[block_cholesky]") {
    std::vector<TriangleMesh<double>> meshes;
    for (Index i = 1; i <= 5; ++i) {
        meshes.push_back(icosphere<double>({.radius = 1, .subdivisions = i}));
        meshes.push_back(disc<double>({.radius = 1, .rings = 4 << i}));
    }
    for (const auto& mesh : meshes) {
        CAPTURE(mesh.vertex_count());
        const auto factors = factors_of(mesh);
        const double n = 3 * mesh.vertex_count();
        CHECK(static_cast<double>(factors.size()) <= 9 * n * std::log2(n));
        CHECK(factors.multiplications() <= 100 * std::pow(n, 1.5));
        for (Index v = 0; v < mesh.vertex_count(); v += mesh.vertex_count() / 20) {
            CHECK(static_cast<double>(3 * factors.affected(std::vector{v}).size()) <= 16 * std::sqrt(n));
        }
    }
}
