// SPDX-License-Identifier: MIT
#include <membrane/core/lanes.hpp>

#include <cstddef>
#include <string>

#include <membrane/core/symmetric3.hpp>

#include "support/catch.hpp"

using namespace membrane;

namespace {

template <class Scalar>
struct Constants {
    Scalar first;
    Symmetric3<Scalar> block;
    Vector3<Scalar> vector;
};
template <class Scalar>
struct WithCount {
    Scalar number;
    int count;
};
template <class Scalar>
struct WithText {
    std::string text;
    Scalar number;
};

static_assert(StructOfNumbers<Constants<float>> && StructOfNumbers<Constants<double>>);
static_assert(!StructOfNumbers<WithCount<double>> && !StructOfNumbers<WithText<double>> && !StructOfNumbers<double>);
static_assert(std::same_as<InLanes<Constants<float>>, Constants<Lanes<float>>>);

}  // namespace

TEMPLATE_TEST_CASE("a struct's numbers are set in one lane, and stay in the others", "[lanes]", float, double) {
    using S = TestType;
    Constants<Lanes<S>> all{};
    for (std::size_t lane = 0; lane < Lanes<S>::count; ++lane) {
        const auto at = [&](int k) { return static_cast<S>(100 * static_cast<int>(lane) + k); };
        const Constants<S> one{at(1), {at(2), at(3), at(4), at(5), at(6), at(7)}, {at(8), at(9), at(10)}};
        set_lane(all, lane, one);
    }
    for (std::size_t lane = 0; lane < Lanes<S>::count; ++lane) {
        const auto at = [&](int k) { return static_cast<S>(100 * static_cast<int>(lane) + k); };
        CHECK(all.first[lane] == at(1));
        CHECK((all.block.xx[lane] == at(2) && all.block.yy[lane] == at(3) && all.block.zz[lane] == at(4)));
        CHECK((all.block.xy[lane] == at(5) && all.block.xz[lane] == at(6) && all.block.yz[lane] == at(7)));
        for (Eigen::Index k = 0; k < 3; ++k) CHECK(all.vector[k][lane] == at(8 + static_cast<int>(k)));
    }
}
