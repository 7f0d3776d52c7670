// SPDX-License-Identifier: MIT
#include <membrane/core/symmetric3.hpp>

#include <cmath>
#include <cstdint>
#include <limits>

#include <Eigen/Core>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

template <class S>
using Dense = Eigen::Matrix<S, 3, 3>;

template <class S>
Symmetric3<S> packed(const Dense<S>& a) {
    return {a(0, 0), a(1, 1), a(2, 2), a(0, 1), a(0, 2), a(1, 2)};
}

template <class S>
Dense<S> dense(const Symmetric3<S>& a) {
    Dense<S> full;
    full << a.xx, a.xy, a.xz, a.xy, a.yy, a.yz, a.xz, a.yz, a.zz;
    return full;
}

template <class S>
Dense<S> random_symmetric(Random& random) {
    Dense<S> a;
    for (int i = 0; i < 3; ++i) a.col(i) = random.vector<S>();
    return (a + a.transpose()) / 2;
}

}  // namespace

TEMPLATE_TEST_CASE("symmetric matrices add up and multiply as dense ones do", "[symmetric3]", double, float) {
    using S = TestType;
    const S tolerance = 8 * std::numeric_limits<S>::epsilon();
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Dense<S> a = random_symmetric<S>(random), b = random_symmetric<S>(random);
        const Vector3<S> u = random.vector<S>();
        const S s = random.number<S>(-2, 2);
        Symmetric3<S> sum = packed<S>(a);
        sum += s * packed<S>(b);
        sum += diagonal3(s);
        sum += outer(s, u);
        const Dense<S> expected = a + s * b + s * Dense<S>::Identity() + s * u * u.transpose();
        REQUIRE((dense(sum) - expected).cwiseAbs().maxCoeff() <= tolerance);
        REQUIRE((packed<S>(a) * u - a * u).cwiseAbs().maxCoeff() <= tolerance);
        REQUIRE(std::abs(packed<S>(a).trace() - a.trace()) <= tolerance);
    }
}

TEMPLATE_TEST_CASE("the inverse of a positive definite matrix", "[symmetric3]", double, float) {
    using S = TestType;
    const S epsilon = std::numeric_limits<S>::epsilon(), flattest = std::cbrt(epsilon);
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Dense<double> turn = random.rotation<double>();
        const double size = std::pow(10, random.number(-9.0, 9.0));
        const auto one = [&] { return size * std::pow(static_cast<double>(flattest), random.number()); };
        const Vector3<double> eigenvalues(size, one(), one());
        const Dense<double> a = turn * eigenvalues.eigen().asDiagonal() * turn.transpose();
        const Dense<double> expected = turn * eigenvalues.eigen().cwiseInverse().asDiagonal() * turn.transpose();
        const Dense<S> found = dense(inverse(packed<S>(a.cast<S>())));
        const double error = (found.template cast<double>() - expected).norm() / expected.norm();
        REQUIRE(error <= 100 * std::cbrt(static_cast<double>(epsilon)));
    }
    CHECK(dense(inverse(diagonal3(S(4)))) == Dense<S>(Dense<S>::Identity() / 4));
}

TEMPLATE_TEST_CASE("largest eigenvalue of symmetric matrices", "[symmetric3]", double, float) {
    using S = TestType;
    // Half of the digits, where two eigenvalues are equal: what a closed form can do.
    const S tolerance = 2 * std::sqrt(std::numeric_limits<S>::epsilon());
    const auto check = [&](const Dense<S>& a) {
        const S size = a.cwiseAbs().maxCoeff();
        const auto expected = static_cast<S>(test::eigenvalues_of(a.template cast<double>())[2]);
        CAPTURE(a);
        REQUIRE(std::abs(largest_eigenvalue(packed<S>(a)) - expected) <= tolerance * size);
    };
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Dense<S> a = random_symmetric<S>(random);
        check(a);
        check(static_cast<S>(std::pow(10, random.number(-15.0, 15.0))) * a);
        check(a * a.transpose());
        // Of one direction, of two, and nearly the same in all three: where a closed form may fail.
        const Vector3<S> u = random.unit_vector<S>(), w = random.unit_vector<S>();
        check(u * u.transpose());
        check(-u * u.transpose());
        check(u * u.transpose() + w * w.transpose());
        check(Dense<S>(Dense<S>::Identity() + std::numeric_limits<S>::epsilon() * a));
        check(Dense<S>(random.vector<S>().eigen().asDiagonal()));
    }
    CHECK(largest_eigenvalue(Symmetric3<S>{}) == 0);
    CHECK(largest_eigenvalue(diagonal3(S(7))) == 7);
    CHECK(largest_eigenvalue(Symmetric3<S>{1, 5, 2, 0, 0, 0}) == Approx(5));
    CHECK(largest_eigenvalue(Symmetric3<S>{-1, -5, -2, 0, 0, 0}) == Approx(-1));
}

TEMPLATE_TEST_CASE("a symmetric matrix that is turned with everything", "[symmetric3]", double, float) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Dense<S> a = random_symmetric<S>(random), r = random.rotation<S>();
        const Dense<S> expected = r * a * r.transpose();
        REQUIRE((dense(rotated(packed<S>(a), r)) - expected).cwiseAbs().maxCoeff() <=
                32 * std::numeric_limits<S>::epsilon());
    }
}
