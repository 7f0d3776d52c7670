// SPDX-License-Identifier: MIT
#include <membrane/accuracy/block_cholesky.hpp>

#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

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
