// SPDX-License-Identifier: MIT
#include <membrane/solve/contact_points.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

struct NonePinned {
    bool pinned(Index) const { return false; }
};

/// Triangles that share no vertex, each with contact points of a tool, and a compliance block for every vertex.
template <class S>
struct Patch {
    Patch(Random& random, Index triangles, const Tool<S>& with)
        : tool(with), x(3, 3 * triangles), rows(3 * triangles), contacts(3 * triangles, 5 * triangles) {
        for (Index f = 0; f < triangles; ++f) {
            const Vector3<S> centre = tool.position + random.number(S(0), S(1)) * tool.axis +
                                      random.number(S(0.5), S(1.5)) * tool.radius * random.unit_vector<S>();
            for (Index k = 0; k < 3; ++k) x.col(3 * f + k) = centre + random.vector(S(-0.5), S(0.5));
        }
        const ConstPointsRef<S> start = x;
        rows.begin_step();
        contacts.begin_step();
        for (Index v = 0; v < x.cols(); ++v) {
            rows.load(v, start, NonePinned{});
            Symmetric3<S> block = diagonal3(random.number(S(0.1), S(1)));
            block += outer<S>(random.number(S(0), S(2)), random.unit_vector<S>());
            rows.set_response(v, {block, S(100), S(100)}, S(0.1));
            rows.forced.insert(v);
        }
        for (Index f = 0; f < triangles; ++f) {
            for (int feature = 0; feature < feature_pairs(tool); ++feature) {
                const auto nearest = closest_points(triangle(f), tool, feature);
                if (!nearest) continue;
                points.push_back({f, feature, corners(f), nearest->barycentric,
                                  direction<S>(nearest->separation, Vector3<S>::UnitZ()), Vector3<S>::Zero()});
            }
        }
        contacts.packs.append(std::span<const ContactPoint<S>>(points), 0, [](Index) { return false; });
    }
    [[nodiscard]] std::array<Index, 3> corners(Index f) const { return {3 * f, 3 * f + 1, 3 * f + 2}; }
    [[nodiscard]] Triangle<S> triangle(Index f) const { return triangle_at(rows.positions(), corners(f)); }
    [[nodiscard]] ToolShape<S> shape() const { return {tool.position, tool.axis, tool.position, tool.radius}; }
    [[nodiscard]] std::vector<ContactPoint<S>> unpacked() const {
        auto found = points;
        contacts.packs.unpack(found);
        return found;
    }

    Tool<S> tool;
    Points<S> x;
    VertexRows<S> rows;
    ContactState<S> contacts;
    std::vector<ContactPoint<S>> points;
};

template <class S>
Tool<S> random_tool(Random& random, bool is_capsule) {
    Tool<S> tool{.position = random.vector<S>(), .radius = random.number(S(0.5), S(1.5))};
    if (is_capsule) tool.axis = random.number(S(0.5), S(2)) * random.unit_vector<S>();
    return tool;
}

/// Presses with each point by 1 N where it is now: `act(pack, lane, point, nearest)`, the last by one triangle after
/// another.
template <class S, class Act>
void for_each_located(Patch<S>& patch, Act act) {
    for (auto& pack : patch.contacts.packs.items()) {
        pack.load.force = S(1);
        detail::locate(patch.shape(), detail::corners_of<3>(patch.rows, pack), pack);
        for (std::size_t i = 0; i < pack.size; ++i) {
            const auto& point = patch.points[static_cast<std::size_t>(pack.point[i])];
            act(pack, i, point, closest_points(patch.triangle(point.triangle), patch.tool, point.feature));
        }
    }
}

/// The rocking stiffness of one point, by its geometric cases.
template <class S>
Vector3<S> rocking_of_one(const Triangle<S>& t, const Vector3<S>& weights, S moment) {
    const Vector3<S> squares(squared_norm<S>(t.c - t.b), squared_norm<S>(t.a - t.c), squared_norm<S>(t.b - t.a));
    if (weights.minCoeff() > 0) return moment / (4 * squared_norm(area_vector(t))) * squares;
    Vector3<S> stiffness = Vector3<S>::Zero();
    if (!(weights.maxCoeff() < 1)) return stiffness;
    Eigen::Index apart;
    weights.eigen().minCoeff(&apart);
    stiffness = Vector3<S>::Constant(moment / squares[apart]);
    stiffness[apart] = 0;
    return stiffness;
}

}  // namespace

TEMPLATE_TEST_CASE("located points are the nearest ones of their features", "[contact]", TEST_SCALARS) {
    using S = TestType;
    const S slack = sizeof(S) == 4 ? S(1e-4) : S(1e-12);
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Patch<S> patch(random, 1 + random.index(9), random_tool<S>(random, seed % 2 == 0));
        patch.tool.position += random.vector(S(-0.1), S(0.1));  // it has gone on since the points were found
        for_each_located(patch, [&](const auto& pack, std::size_t i, const auto&, const auto& nearest) {
            REQUIRE((pack.used[i] > 0) == nearest.has_value());
            REQUIRE(pack.load.force[i] == (nearest ? 1 : 0));
            if (!nearest) return;
            Vector3<S> weights, normal;
            for (std::size_t k = 0; k < 3; ++k) {
                const auto row = static_cast<Eigen::Index>(k),
                           corner = static_cast<Eigen::Index>((k + pack.turn[i]) % 3);
                weights[corner] = pack.load.weights[row][i];
                normal[row] = pack.load.normal[row][i];
            }
            REQUIRE(norm<S>(weights - nearest->barycentric) <= slack);
            REQUIRE(std::abs(norm(normal) - 1) <= slack);
            REQUIRE(norm<S>(pack.distance[i] * normal - nearest->separation) <= slack);
        });
    }
}

TEMPLATE_TEST_CASE("on a triangle too thin for its normal to be known a point is off by at most its thickness",
                   "[contact]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Patch<S> patch(random, 1, random_tool<S>(random, false));
        const Vector3<S> a = random.vector<S>(), along = random.unit_vector<S>();
        const Vector3<S> aside = cross(along, random.unit_vector<S>()).normalized();
        const S thickness = std::pow(std::numeric_limits<S>::epsilon(), random.number(S(0.65), S(0.95)));
        const S apex = random.number(S(0.2), S(0.8)), distance = random.number(S(0), S(10)) * thickness;
        const S slack = thickness + 64 * std::numeric_limits<S>::epsilon();
        patch.rows.set_position(0, a);
        patch.rows.set_position(1, a + along);
        patch.rows.set_position(2, a + apex * along + thickness * aside);
        const Vector3<S> over = Vector3<S>::Constant(S(0.2)) + S(0.4) * random.barycentric<S>();
        patch.tool.position = point_at(patch.triangle(0), over) + distance * cross(along, aside);
        for_each_located(patch, [&](const auto& pack, std::size_t i, const auto& point, const auto&) {
            Vector3<S> weights;
            for (Eigen::Index k = 0; k < 3; ++k) weights[k] = pack.load.weights[k][i];
            const Vector3<S> located = point_at(patch.triangle(point.triangle), weights);
            REQUIRE(std::abs(norm<S>(located - patch.tool.position) - distance) <= slack);
            REQUIRE(std::abs(std::abs(pack.distance[i]) - distance) <= slack);
        });
    }
}

TEMPLATE_TEST_CASE("forces that act add the stiffness of rocking faces, and take it back with them", "[contact]",
                   TEST_SCALARS) {
    using S = TestType;
    const S slack = sizeof(S) == 4 ? S(1e-4) : S(1e-12);
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Patch<S> patch(random, 1 + random.index(9), random_tool<S>(random, seed % 2 == 0));
        auto& rows = patch.rows;
        auto& contacts = patch.contacts;
        std::vector<S> expected(static_cast<std::size_t>(patch.x.cols()), 0);
        for_each_located(patch, [&](const auto&, std::size_t, const auto& point, const auto& nearest) {
            if (!nearest) return;
            const Vector3<S> stiffness =
                rocking_of_one<S>(patch.triangle(point.triangle), nearest->barycentric, norm(nearest->separation));
            for (std::size_t k = 0; k < 3; ++k) {
                expected[static_cast<std::size_t>(point.corners[k])] += stiffness[static_cast<Eigen::Index>(k)];
            }
        });
        apply_forces(rows, contacts, contacts.packs.items());
        for (Index v = 0; v < patch.x.cols(); ++v) {
            const S exact = expected[static_cast<std::size_t>(v)];
            REQUIRE(std::abs(rows.row(rows.force, v).extra() - exact) <= 100 * slack * (1 + exact));
        }
        for (auto& pack : contacts.packs.items()) pack.load.force = S(0);
        apply_forces(rows, contacts, contacts.packs.items());
        for (Index v = 0; v < patch.x.cols(); ++v) {
            REQUIRE(norm(rows.constraint_force(v)) <= slack);
            REQUIRE(std::abs(rows.row(rows.force, v).extra()) <=
                    100 * slack * (1 + expected[static_cast<std::size_t>(v)]));
        }
    }
}

TEMPLATE_TEST_CASE("solved contacts push, never pull, and their corners move by what pushes them", "[contact]",
                   TEST_SCALARS) {
    using S = TestType;
    const S slack = sizeof(S) == 4 ? S(1e-3) : S(1e-10);
    int touching = 0;
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Patch<S> patch(random, 1 + random.index(9), random_tool<S>(random, false));
        auto& rows = patch.rows;
        auto& contacts = patch.contacts;
        for (int pass = 0; pass < 200; ++pass) solve_contacts(rows, contacts, patch.shape(), contacts.packs.items());
        apply_forces(rows, contacts, contacts.packs.items());
        for (const auto& point : patch.unpacked()) {
            const S force = -dot(point.force, point.normal);
            const S gap =
                norm(closest_points(patch.triangle(point.triangle), patch.tool, 0)->separation) - patch.tool.radius;
            REQUIRE(force >= 0);
            REQUIRE(norm<S>(point.force + force * point.normal) <= slack);
            REQUIRE(gap >= -slack);
            REQUIRE(force * gap <= slack);
            if (force == 0) continue;
            ++touching;
            for (std::size_t k = 0; k < 3; ++k) {
                const Vector3<S> share = point.weights[static_cast<Eigen::Index>(k)] * point.force;
                const Vector3<S> row = rows.constraint_force(point.corners[k]);
                REQUIRE(norm<S>(row - share) <= slack);
            }
        }
    }
    CHECK(touching > 0);
}

TEMPLATE_TEST_CASE("one pass closes the gap as far as the compliance of the corners says", "[contact]", TEST_SCALARS) {
    using S = TestType;
    const S slack = sizeof(S) == 4 ? S(1e-4) : S(1e-12);
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Patch<S> patch(random, 1 + random.index(9), random_tool<S>(random, false));
        auto& rows = patch.rows;
        auto& contacts = patch.contacts;
        const auto pass = solve_contacts(rows, contacts, patch.shape(), contacts.packs.items());
        REQUIRE_FALSE(pass.released);
        S largest = 0;
        for (const auto& point : patch.unpacked()) {
            const S force = -dot(point.force, point.normal);
            largest = std::max(largest, force);
            S compliance = 0;
            for (std::size_t k = 0; k < 3; ++k) {
                const Index v = point.corners[k];
                const S weight = point.weights[static_cast<Eigen::Index>(k)];
                const Vector3<S> by = rows.response_of(v).compliance * Vector3<S>(weight * point.force);
                compliance += weight * weight * dot<S>(point.normal, rows.response_of(v).compliance * point.normal);
                const Vector3<S> moved = membrane::point(rows.positions(), v) - membrane::point(patch.x, v);
                REQUIRE(norm<S>(moved - by) <= slack * (1 + force));
            }
            const auto before = triangle_at(patch.x, point.corners);
            const S gap = norm(closest_points(before, patch.tool, 0)->separation) - patch.tool.radius;
            REQUIRE(std::abs(force - std::max(-gap / compliance, S(0))) <= 100 * slack * (1 + force));
        }
        REQUIRE(std::abs(pass.largest - largest) <= slack * (1 + largest));
    }
}

TEMPLATE_TEST_CASE("a point that presses far harder than what resists at it is let go", "[contact]", TEST_SCALARS) {
    using S = TestType;
    Random random(1);
    Patch<S> patch(random, 4, random_tool<S>(random, false));
    auto& rows = patch.rows;
    auto& contacts = patch.contacts;
    for (Index v = 0; v < patch.x.cols(); ++v) rows.set_response(v, {rows.response_of(v).compliance, 0, 0}, S(0.1));
    const auto pass = solve_contacts(rows, contacts, patch.shape(), contacts.packs.items());
    CHECK(pass.released);
    CHECK(pass.largest == 0);
    for (const auto& point : patch.unpacked()) CHECK(point.force.isZero(0));
}

TEMPLATE_TEST_CASE("what is pushed out is outside, and moves along the normals", "[contact]", TEST_SCALARS) {
    using S = TestType;
    const S slack = sizeof(S) == 4 ? S(1e-5) : S(1e-12);
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Patch<S> patch(random, 1 + random.index(9), random_tool<S>(random, false));
        bool moves = true;
        for (int pass = 0; pass < 1000 && moves; ++pass)
            moves = push_out(patch.rows, patch.contacts, patch.shape(), patch.contacts.packs.items());
        for (const auto& point : patch.points) {
            const auto now = patch.triangle(point.triangle), before = triangle_at(patch.x, point.corners);
            const bool was_inside = norm(closest_points(before, patch.tool, 0)->separation) < patch.tool.radius - slack;
            REQUIRE(norm(closest_points(now, patch.tool, 0)->separation) >=
                    patch.tool.radius * (1 - 100 * slack) - 10 * slack);
            if (!was_inside) REQUIRE(norm<S>(now.a - before.a) <= slack);
        }
    }
}

TEMPLATE_TEST_CASE("beside a fixed corner that has no stiffness yet the free ones are pushed out as far as any",
                   "[contact]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Tool<S> tool = random_tool<S>(random, false);
        Patch<S> patch(random, 1, tool);
        REQUIRE(patch.points.size() == 1);
        Patch<S> free = patch;
        auto& point = patch.points.front();
        point.on_fixed = true;
        patch.contacts.packs.clear();
        patch.contacts.packs.append(std::span<const ContactPoint<S>>(patch.points), 0, [](Index v) { return v == 0; });
        REQUIRE(push_out<S>(patch.rows, patch.contacts, patch.shape(), patch.contacts.packs.items()) ==
                push_out<S>(free.rows, free.contacts, free.shape(), free.contacts.packs.items()));
        REQUIRE(patch.rows.position_of(0) == Vector3<S>(patch.x.col(0)));
        for (const Index v : {1, 2}) REQUIRE(patch.rows.position_of(v) == free.rows.position_of(v));
    }
}

TEST_CASE("the largest move is that of the vertex that has moved farthest from where it was kept", "[contact]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        VertexRows<double> rows(20);
        ContactState<double> contacts(20, 0);
        double expected = 0;
        for (Index v = 0; v < 20; ++v) {
            const Vector3<double> kept = random.vector(), now = random.vector();
            contacts.keep(v, kept);
            rows.set_position(v, now);
            if (!random.chance(0.5)) continue;
            contacts.candidates.insert(v);
            expected = std::max(expected, squared_norm<double>(now - kept));
        }
        CHECK(largest_squared_move(rows, contacts) == expected);
    }
}
