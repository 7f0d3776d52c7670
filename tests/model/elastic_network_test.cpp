// SPDX-License-Identifier: MIT
#include <membrane/model/elastic_network.hpp>

#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/catch.hpp"
#include "support/spring_law_check.hpp"

using namespace membrane;

namespace {

template <class Scalar>
using Springs = MassSpringNetwork<Scalar, LinearSpring>;

}  // namespace

static_assert(ElasticNetwork<Springs<float>, float> && ElasticNetwork<Springs<double>, double>);
static_assert(ElasticNetwork<MassSpringNetwork<double, ExponentialSpring>, double>);
static_assert(ElasticNetwork<Tissue<Springs<double>>, double>);
static_assert(ElasticNetwork<Tissue<Springs<float>, Elements<float, Hinge<float>>>, float>);
static_assert(!ElasticNetwork<Springs<float>, double> && !ElasticNetwork<int, double>);

TEST_CASE("changes of energy add up", "[elastic_network]") {
    EnergyChange<double> sum;
    sum += {.change = -1, .size = 3};
    sum += {.change = 0.5, .size = 2};
    CHECK(sum.change == -0.5);
    CHECK(sum.size == 5);
}
