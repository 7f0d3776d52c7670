// SPDX-License-Identifier: MIT
#include <membrane/core/instruction_set.hpp>

#include <type_traits>

#include <membrane/core/lane_points.hpp>
#include <membrane/surface/triangle_mesh.hpp>

#include "support/catch.hpp"

// That such programs link, or do not, is tested by tests/checks/instruction_sets.

using namespace membrane;

TEST_CASE("what is packed in registers can be named with its instruction set, and without", "[instruction set]") {
    namespace set = membrane::MEMBRANE_INSTRUCTION_SET;
    STATIC_REQUIRE(std::is_same_v<Lanes<float>, set::Lanes<float>>);
    STATIC_REQUIRE(std::is_same_v<PaddedVector<double>, set::PaddedVector<double>>);
}

TEMPLATE_TEST_CASE("what may pass from unit to unit is aligned like its numbers", "[instruction set]", float, double) {
    STATIC_REQUIRE(alignof(TriangleMesh<TestType>) == alignof(void*));
    STATIC_REQUIRE(alignof(Points<TestType>) == alignof(void*));
    STATIC_REQUIRE(alignof(Vector3<TestType>) == alignof(TestType));
    STATIC_REQUIRE(int(Points<TestType>::Options) == Eigen::DontAlign);  // else its memory is another allocator's
    STATIC_REQUIRE(int(Triangles::Options) == Eigen::DontAlign);
    STATIC_REQUIRE(alignof(PaddedPoint<TestType>) == 4 * sizeof(TestType));
}
