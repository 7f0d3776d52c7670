// SPDX-License-Identifier: MIT
#include <membrane/haptics/smooth_contact.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <membrane/collision/aabb_tree.hpp>
#include <membrane/collision/contact_tracker.hpp>
#include <membrane/mesh/normals.hpp>
#include <membrane/mesh/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

TEST_CASE("a tool slides over edges and vertices, and the normal turns without a jump", "[smooth]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 2});
    const auto tree = AabbTree(mesh);
    const auto normals = VertexNormals(mesh);
    const auto x = mesh.positions();
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto tracker = ContactTracker(mesh);
        // Great circles through a vertex: edges and vertices are all on the way.
        const Vector3<double> from = point(x, random.index(static_cast<Index>(x.cols()))) / 0.01;
        const Vector3<double> across = direction<double>(cross<double>(from, random.unit_vector()), {1, 0, 0});
        const double step = 2e-3;  // [rad]; an edge is 0.3 long
        Vector3<double> last = Vector3<double>::Zero(), last_flat = last;
        double jump = 0, flat_jump = 0;
        for (int i = 0; i < 500; ++i) {
            Tool<double> tool{.radius = 1e-3};
            tool.position = 0.0107 * (std::cos(step * i) * from + std::sin(step * i) * across);
            tool.time = 1e-3 * i;
            const auto contact = tracker.update(tree, x, tool);
            REQUIRE(contact.touching());
            const auto smooth = smooth_contact(contact, normals.values());
            REQUIRE(std::abs(norm(smooth.normal) - 1) < 1e-12);
            REQUIRE(dot<double>(smooth.normal, contact.normal) > 0.9);
            REQUIRE(smooth.depth == contact.depth);
            if (i > 0) {
                jump = std::max(jump, norm<double>(smooth.normal - last));
                flat_jump = std::max(flat_jump, norm<double>(contact.normal - last_flat));
            }
            last = smooth.normal;
            last_flat = contact.normal;
        }
        CHECK(jump < 3 * step);
        CHECK(flat_jump > 5 * step);  // the triangles themselves
    }
}

TEMPLATE_TEST_CASE("at a vertex its normal, on an edge both, on the other side the other way", "[smooth]", double,
                   float) {
    using S = TestType;
    Points<S> normals(3, 3);
    normals << 0, 1, 0, 0, 0, 1, 1, 0, 0;
    Contact<S> contact;
    CHECK(smooth_contact(contact, normals).normal == contact.normal);  // no contact, nothing read
    contact.phase = ContactPhase::ongoing;
    contact.corners = {0, 1, 2};
    contact.normal = {0, 0, 1};
    contact.barycentric = {0, 1, 0};
    CHECK(smooth_contact(contact, normals).normal == Vector3<S>(1, 0, 0));
    contact.side = -1;
    CHECK(smooth_contact(contact, normals).normal == Vector3<S>(-1, 0, 0));
    contact.side = 1;
    contact.barycentric = {S(0.5), 0, S(0.5)};
    const Vector3<S> between(0, std::sqrt(S(0.5)), std::sqrt(S(0.5)));
    CHECK(norm<S>(smooth_contact(contact, normals).normal - between) < S(1e-6));
    normals.col(2) = -normals.col(0);  // they cancel out
    CHECK(smooth_contact(contact, normals).normal == contact.normal);
}
