// SPDX-License-Identifier: MIT
#include <membrane/tear/torn_surface.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <numbers>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include <membrane/mesh_check/validate.hpp>
#include <membrane/replay/snapshot.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tear/tearable_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random_tear.hpp"

using namespace membrane;

namespace {

template <Real Scalar>
double area_of(const TornSurface<Scalar>& surface) {
    double sum = 0;
    for (Index f = 0; f < surface.triangles().cols(); ++f) {
        sum += static_cast<double>(surface.rest_area(f));
    }
    return sum;
}

template <Real Scalar>
bool has_corner(const TornSurface<Scalar>& surface, Index f, Index v) {
    const auto corners = surface.corners(f);
    return std::find(corners.begin(), corners.end(), v) != corners.end();
}

// The triangles to the left of the edge from `v` to `out`, as far as the edge to `back` or to a border: each next one
// is searched among all.
template <Real Scalar>
std::vector<Index> left_of(const TornSurface<Scalar>& surface, Index v, Index out, Index back) {
    std::vector<Index> fan;
    const auto next_of = [&](Index corner) -> std::pair<Index, Index> {  // triangle v, corner, third
        for (Index f = 0; f < surface.triangles().cols(); ++f) {
            const auto c = surface.corners(f);
            for (std::size_t k = 0; k < 3; ++k) {
                if (c[k] == v && c[(k + 1) % 3] == corner) return {f, c[(k + 2) % 3]};
            }
        }
        return {no_index, no_index};
    };
    for (auto [f, third] = next_of(out); f != no_index; std::tie(f, third) = next_of(third)) {
        if (std::find(fan.begin(), fan.end(), f) != fan.end()) break;
        fan.push_back(f);
        if (third == back) break;
    }
    return fan;
}

// All lists are those of the triangles, and these are a mesh.
template <Real Scalar>
void check_lists(const TornSurface<Scalar>& surface) {
    const auto& triangles = surface.triangles();
    const auto& adjacency = surface.adjacency();
    std::map<std::pair<Index, Index>, Index> side_of;  // the triangle to the left of each directed edge
    for (Index f = 0; f < triangles.cols(); ++f) {
        const auto c = surface.corners(f);
        for (std::size_t k = 0; k < 3; ++k) REQUIRE(side_of.emplace(std::pair(c[k], c[(k + 1) % 3]), f).second);
    }
    const auto across = [&](Index first, Index second) {
        const auto found = side_of.find({second, first});
        return found == side_of.end() ? no_index : found->second;
    };
    std::set<Index> border, unused;
    std::vector<std::vector<Index>> around(static_cast<std::size_t>(surface.rest_positions().cols()));
    for (Index f = 0; f < triangles.cols(); ++f) {
        const auto c = surface.corners(f);
        for (std::size_t k = 0; k < 3; ++k) {
            around[static_cast<std::size_t>(c[k])].push_back(f);
            const Index other = across(c[k], c[(k + 1) % 3]);
            REQUIRE(adjacency.triangle_neighbours(f)[k] == other);
            REQUIRE(surface.has_inner_edge(c[k], c[(k + 1) % 3]) == (other != no_index));
            if (other == no_index) border.insert({c[k], c[(k + 1) % 3]});
        }
    }
    for (Index v = 0; v < surface.rest_positions().cols(); ++v) {
        const auto found = adjacency.triangles_of(v);
        REQUIRE(std::vector(found.begin(), found.end()) == around[static_cast<std::size_t>(v)]);
        REQUIRE(adjacency.on_border(v) == (border.count(v) > 0));
        if (found.empty()) unused.insert(v);
    }
    REQUIRE(adjacency.closed() == border.empty());
    REQUIRE(surface.reserve() == static_cast<Index>(unused.size()));
    const MeshReport report = validate(surface.rest_positions(), triangles);
    INFO(to_string(report));
    REQUIRE(report.valid());
    REQUIRE(report.count(MeshDefect::isolated_vertex) == unused.size());
    REQUIRE(report.count(MeshDefect::zero_area) == 0);
}

// An inner neighbour of `v`, or `no_index`.
template <Real Scalar>
Index inner_neighbour(test::Random& random, const TornSurface<Scalar>& surface, Index v) {
    std::vector<Index> all;
    for (Index w = 0; w < surface.rest_positions().cols(); ++w) {
        if (surface.has_inner_edge(v, w)) all.push_back(w);
    }
    return all.empty() ? no_index : all[static_cast<std::size_t>(random.index(static_cast<Index>(all.size())))];
}

template <class... Parts>
std::vector<std::byte> state_of(const Parts&... parts) {
    std::vector<std::byte> bytes(snapshot_capacity(parts...));
    bytes.resize(save_snapshot(bytes, parts...));
    return bytes;
}

}  // namespace

TEMPLATE_TEST_CASE("vertices that split and move at random keep every list that of the torn triangles", "[tear]",
                   TEST_SCALARS) {
    int splits = 0, refused = 0, moves = 0;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const bool flat = seed % 3 != 0;
        const auto whole = flat ? disc<TestType>({.radius = 1, .rings = 5})
                                : icosphere<TestType>({.radius = 1, .subdivisions = 1 + seed % 2});
        const auto mesh = with_reserve(whole, 1 + random.index(40));
        TornSurface<TestType> surface(mesh);
        Points<TestType> all = TestType(1.5) * mesh.positions();
        PointsRef<TestType> x = all;
        const double area = area_of(surface);
        for (int n = 0; n < 60; ++n) {
            if (n % 4 == 0) surface.begin();
            const Index v = random.index(whole.vertex_count() + 5);
            const bool inner = v < mesh.vertex_count() && !surface.adjacency().on_border(v) &&
                               !surface.adjacency().triangles_of(v).empty();
            if (v >= mesh.vertex_count()) continue;
            if (random.chance(0.3)) {
                if (!inner) continue;
                const Vector3<TestType> by = random.vector<TestType>(TestType(-0.1), TestType(0.1));
                const Vector3<TestType> flat_by(by[0], by[1], 0);
                const Vector3<TestType> place = point(surface.rest_positions(), v) + (flat ? flat_by : by);
                const Points<TestType> rest = surface.rest_positions();
                moves += surface.move_vertex(x, v, place, TestType(0.3)) ? 1 : 0;
                for (Index w = 0; w < mesh.vertex_count(); ++w) {
                    if (w != v) REQUIRE(rest.col(w) == surface.rest_positions().col(w));
                }
            } else {
                const Index out = random.chance(0.9) ? inner_neighbour(random, surface, v) : random.index(40);
                const Index back = inner ? inner_neighbour(random, surface, v) : no_index;
                if (out == no_index || out == back) continue;
                const bool joined = surface.has_inner_edge(v, out);
                const bool out_on_border = joined && surface.adjacency().on_border(out);
                const bool back_on_border = joined && back != no_index && surface.adjacency().on_border(back);
                const Index more = (out_on_border ? 1 : 0) + (back_on_border ? 1 : 0);
                if (surface.reserve() > 0 && surface.reserve() <= more) continue;
                const auto expected = left_of(surface, v, out, back);
                const auto around = surface.adjacency().triangles_of(v).size();
                const bool legal = !expected.empty() && expected.size() < around && surface.reserve() > 0;
                double taken = 0, total = 0;
                for (const Index f : surface.adjacency().triangles_of(v)) {
                    const auto c = surface.corners_at(surface.rest_positions(), f);
                    const double own = static_cast<double>(norm<TestType>(cross<TestType>(c[1] - c[0], c[2] - c[0])));
                    total += own;
                    if (std::find(expected.begin(), expected.end(), f) != expected.end()) taken += own;
                }
                const auto before = state_of(surface, all);
                const Triangles triangles = surface.triangles();
                const auto events = surface.events().size();
                const Index copy = surface.split(x, v, out, back);
                REQUIRE((copy != no_index) == legal);
                if (!legal) {
                    ++refused;
                    REQUIRE((state_of(surface, all) == before));
                    REQUIRE(surface.events().size() == events);
                    continue;
                }
                ++splits;
                REQUIRE(surface.events().size() == events + 1);
                const VertexSplit& split = surface.events().back().split;
                REQUIRE(surface.events().back().moved.vertex == no_index);
                REQUIRE(split.vertex == v);
                REQUIRE(split.copy == copy);
                REQUIRE(std::set(split.triangles.begin(), split.triangles.end()) ==
                        std::set(expected.begin(), expected.end()));
                REQUIRE(split.area_share == Approx(taken / total));
                for (const Index f : expected) {
                    const auto& c = split.corners_of(f);
                    REQUIRE(c == std::array<Index, 3>{triangles(0, f), triangles(1, f), triangles(2, f)});
                    REQUIRE(has_corner(surface, f, copy));
                    REQUIRE(!has_corner(surface, f, v));
                }
                REQUIRE(all.col(copy) == all.col(v));
                REQUIRE(surface.rest_positions().col(copy) == surface.rest_positions().col(v));
                // Where the edge ends at a border, the vertex there would join two fans.
                if (out_on_border) REQUIRE(surface.split(x, out, v) != no_index);
                if (back_on_border) REQUIRE(surface.split(x, back, copy) != no_index);
            }
            check_lists(surface);
            if (flat) REQUIRE(area_of(surface) == Approx(area));
        }
    }
    CAPTURE(splits, refused, moves);
    CHECK(splits > 5 * cases(60));
    CHECK(refused > cases(60));
    CHECK(moves > cases(60));
}

TEMPLATE_TEST_CASE("a surface that is cut at random is a mesh with the same triangles", "[tear]", TEST_SCALARS) {
    int splits = 0;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto whole = seed % 2 == 0 ? icosphere<TestType>({.radius = 1, .subdivisions = 2})
                                         : disc<TestType>({.radius = 1, .rings = 6});
        const auto mesh = with_reserve(whole, 30);
        Tearing tear(mesh, EnergyRelease{1, 1});
        Points<TestType> x = mesh.positions();
        for (int n = 0; n < 12; ++n) {
            const auto events = test::cut_at_random(random, tear, x);
            splits += static_cast<int>(events.size());
            const auto& surface = tear.surface();
            for (const auto& event : events) {
                REQUIRE(event.split.vertex != no_index);
                REQUIRE(event.split.area_share > 0);
                REQUIRE(event.split.area_share < 1);
                REQUIRE(x.col(event.split.copy) == x.col(event.split.vertex));
            }
            const TriangleMesh<TestType> torn(surface.rest_positions(), surface.triangles());  // one fan at each vertex
            const Adjacency expected(torn);
            for (Index f = 0; f < torn.triangle_count(); ++f) {
                REQUIRE(surface.adjacency().triangle_neighbours(f) == expected.triangle_neighbours(f));
            }
            REQUIRE(area_of(surface) == Approx(area_of(TornSurface<TestType>(whole))));
        }
    }
    CHECK(splits > cases(60));
}

namespace {

// A walk over edges, with mistakes in it now and then.
template <Real Scalar>
std::vector<Index> random_path(test::Random& random, const TornSurface<Scalar>& surface) {
    const auto vertices = static_cast<Index>(surface.rest_positions().cols());
    std::vector<Index> path;
    const Index length = random.index(7);
    for (Index n = 0, tries = 0; n < length && tries < 30; ++tries) {
        Index next = random.chance(0.02) ? random.index(vertices + 20) - 10 : no_index;
        if (next == no_index && path.empty()) next = random.index(vertices);
        if (next == no_index) {
            const Index last = path.back();
            if (last < 0 || last >= vertices || surface.adjacency().triangles_of(last).empty()) break;
            const auto around = surface.adjacency().triangles_of(last);
            const Index f = around[static_cast<std::size_t>(random.index(static_cast<Index>(around.size())))];
            next = surface.corners(f)[static_cast<std::size_t>(random.index(3))];
            if (std::find(path.begin(), path.end(), next) != path.end() && !random.chance(0.05)) continue;
        }
        path.push_back(next);
        ++n;
        if (path.size() == 1 || next < 0 || next >= vertices || !surface.adjacency().on_border(next)) continue;
        if (random.chance(0.8)) break;
    }
    return path;
}

// What `Tearing::cut_along` says about a path, from the triangles alone; the number of vertices that the cut doubles,
// or -1.
template <Real Scalar>
Index doubled_by(const std::vector<Index>& path, const TornSurface<Scalar>& surface) {
    std::map<std::pair<Index, Index>, int> sides;
    for (Index f = 0; f < surface.triangles().cols(); ++f) {
        const auto c = surface.corners(f);
        for (std::size_t k = 0; k < 3; ++k) ++sides[std::minmax(c[k], c[(k + 1) % 3])];
    }
    std::set<Index> border;
    for (const auto& [edge, count] : sides) {
        if (count == 1) border.insert({edge.first, edge.second});
    }
    if (path.size() < 2 || std::set(path.begin(), path.end()).size() < path.size()) return -1;
    for (std::size_t i = 1; i < path.size(); ++i) {
        const auto edge = sides.find(std::minmax(path[i - 1], path[i]));
        if (edge == sides.end() || edge->second != 2) return -1;
        if (i + 1 < path.size() && border.count(path[i]) > 0) return -1;
    }
    const auto doubled = static_cast<Index>(path.size() - 2 + border.count(path.front()) + border.count(path.back()));
    return doubled > 0 ? doubled : -1;
}

// Corners of two triangles are one vertex if they are at one vertex of the mesh before, and triangles around it join
// them over edges that were not cut.
template <Real Scalar>
void check_cut(const TornSurface<Scalar>& surface, const Triangles& whole,
               const std::set<std::array<Index, 2>>& cut_sides) {
    std::map<std::pair<Index, Index>, std::pair<Index, std::size_t>> side_of;
    for (Index f = 0; f < whole.cols(); ++f) {
        for (std::size_t k = 0; k < 3; ++k) {
            side_of[{whole(static_cast<Index>(k), f), whole(static_cast<Index>((k + 1) % 3), f)}] = {f, k};
        }
    }
    // Corner 3 f + k has the lowest such number that it is joined to.
    std::vector<Index> joined(static_cast<std::size_t>(3 * whole.cols()));
    for (std::size_t c = 0; c < joined.size(); ++c) joined[c] = static_cast<Index>(c);
    for (bool changed = true; changed;) {
        changed = false;
        for (const auto& [edge, side] : side_of) {
            const auto other = side_of.find({edge.second, edge.first});
            const auto [f, k] = side;
            if (other == side_of.end() || cut_sides.count({f, static_cast<Index>(k)}) > 0) continue;
            const auto [g, m] = other->second;
            const auto join = [&](std::size_t a, std::size_t b) {
                Index &first = joined[a], &second = joined[b];
                if (first == second) return;
                first = second = std::min(first, second);
                changed = true;
            };
            const auto of = [](Index triangle, std::size_t corner) {
                return 3 * static_cast<std::size_t>(triangle) + corner % 3;
            };
            join(of(f, k), of(g, m + 1));
            join(of(f, k + 1), of(g, m));
        }
    }
    std::map<Index, Index> vertex_of;
    std::set<Index> used;
    for (std::size_t c = 0; c < joined.size(); ++c) {
        const Index v = surface.corners(static_cast<Index>(c / 3))[c % 3];
        const auto [known, is_new] = vertex_of.emplace(joined[c], v);
        REQUIRE(known->second == v);
        if (is_new) REQUIRE(used.insert(v).second);
    }
}

}  // namespace

TEMPLATE_TEST_CASE("a cut parts the edges of its path and nothing else, another path changes nothing", "[tear]",
                   TEST_SCALARS) {
    int cuts = 0, refused = 0, used_up = 0, across = 0, joined = 0;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto whole = seed % 2 == 0 ? icosphere<TestType>({.radius = 1, .subdivisions = 1})
                                         : disc<TestType>({.radius = 1, .rings = 4});
        const auto mesh = with_reserve(whole, random.index(30));
        Tearing tear(mesh, EnergyRelease{1, 1}, {.max_tips = 4});
        const auto& surface = tear.surface();
        Points<TestType> x = TestType(1.1) * mesh.positions();
        std::set<std::array<Index, 2>> cut_sides;
        for (int n = 0; n < 60; ++n) {
            const auto path = random_path(random, surface);
            const Index doubled = doubled_by(path, surface);
            const bool legal = doubled > 0 && doubled <= surface.reserve();
            const auto before = state_of(surface, x);
            const std::size_t tips = tear.tips().size();
            const Index reserve = surface.reserve();
            std::vector<std::array<Index, 2>> sides;  // that the path opens
            for (std::size_t i = 1; legal && i < path.size(); ++i) {
                for (Index f = 0; f < mesh.triangle_count(); ++f) {
                    const auto c = surface.corners(f);
                    for (Index k = 0; k < 3; ++k) {
                        if (std::minmax(c[static_cast<std::size_t>(k)], c[static_cast<std::size_t>((k + 1) % 3)]) ==
                            std::minmax(path[i - 1], path[i])) {
                            sides.push_back({f, k});
                        }
                    }
                }
            }
            std::size_t inner_ends = 0, at_tips = 0;
            if (legal) {
                for (const Index v : {path.front(), path.back()}) {
                    inner_ends += surface.adjacency().on_border(v) ? 0U : 1U;
                    for (const auto& tip : tear.tips()) at_tips += tip.vertex == v ? 1U : 0U;
                }
            }
            const auto events = tear.cut_along(path, x);
            REQUIRE(events.size() == static_cast<std::size_t>(legal ? doubled : 0));
            REQUIRE(tear.reserve_used_up() == (doubled > 0 && !legal));
            used_up += tear.reserve_used_up() ? 1 : 0;
            if (!legal) {
                ++refused;
                REQUIRE((state_of(surface, x) == before));
                REQUIRE(tear.tips().size() == tips);
                continue;
            }
            ++cuts;
            across += inner_ends == 0 ? 1 : 0;
            joined += at_tips > 0 ? 1 : 0;
            REQUIRE(tear.tips().size() == std::min(tips + inner_ends - at_tips, std::size_t{4}));
            cut_sides.insert(sides.begin(), sides.end());
            check_cut(surface, mesh.triangles(), cut_sides);
            check_lists(surface);
            REQUIRE(surface.reserve() == reserve - doubled);
            for (const auto& tip : tear.tips()) {
                REQUIRE(surface.adjacency().on_border(tip.vertex));
                // The sides of the tear are the borders to the two vertices behind.
                for (const Index v : tip.behind) {
                    bool is_beside = false;
                    for (const Index f : surface.adjacency().triangles_of(tip.vertex))
                        is_beside |= has_corner(surface, f, v);
                    CAPTURE(tip.vertex, v);
                    REQUIRE(is_beside);
                    REQUIRE(!surface.has_inner_edge(tip.vertex, v));
                }
            }
            REQUIRE(tear.dissipated() == 0);
            REQUIRE(tear.torn_length() == 0);
        }
    }
    CAPTURE(cuts, refused, used_up, across, joined);
    CHECK(cuts > 2 * cases(100));
    CHECK(refused > 10 * cases(100));
    CHECK(used_up > 0);
    CHECK(across > 0);
    CHECK(joined > 0);
}

TEST_CASE("a vertex that moves at rest keeps the area, the angles, and its point of the membrane", "[tear]") {
    constexpr double least = 0.35;
    int moved = 0;
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = with_reserve(disc<double>({.radius = 1, .rings = 6}), 1);
        TornSurface<double> surface(mesh);
        Eigen::Matrix3d map;
        for (double& number : map.reshaped()) number = random.number(-1.0, 1.0);
        Points<double> all = map * mesh.positions();
        PointsRef<double> x = all;
        const double area = area_of(surface);
        const Index v = random.index(37);  // within the disc
        const Vector3<double> from = point(surface.rest_positions(), v);
        const double farthest = random.chance(0.2) ? 4 : 0.12;
        const Vector3<double> place =
            from + farthest * Vector3<double>(random.number(-1.0, 1.0), random.number(-1.0, 1.0), 0);
        if (!surface.move_vertex(x, v, place, least)) {
            REQUIRE(point(surface.rest_positions(), v) == from);
            REQUIRE(surface.events().empty());
            continue;
        }
        ++moved;
        const Vector3<double> to = point(surface.rest_positions(), v);
        REQUIRE(16 * norm<double>(to - from) >= (1 - 1e-12) * norm<double>(place - from));  // it is halved four times
        const Eigen::Vector3d expected = map * Eigen::Vector3d(to[0], to[1], to[2]);
        REQUIRE((all.col(v) - expected).norm() < 1e-12);
        REQUIRE(norm<double>(cross<double>(to - from, place - from)) < 1e-12);
        REQUIRE(area_of(surface) == Approx(area));
        for (const Index f : surface.adjacency().triangles_of(v)) {
            const auto c = surface.corners_at(surface.rest_positions(), f);
            for (std::size_t k = 0; k < 3; ++k) {
                const Vector3<double> a = c[(k + 1) % 3] - c[k], b = c[(k + 2) % 3] - c[k];
                REQUIRE(std::atan2(norm<double>(cross(a, b)), dot(a, b)) > least - 1e-9);
            }
        }
        REQUIRE(surface.events().size() == 1);
        REQUIRE(surface.events()[0].moved.triangles.size() == surface.adjacency().triangles_of(v).size());
        for (int i = 0; i < 3; ++i) {  // more than there is memory for
            const Vector3<double> before = point(surface.rest_positions(), v);
            const bool moves = surface.move_vertex(x, v, before + Vector3<double>(1e-3, 0, 0), least);
            REQUIRE(moves == (point(surface.rest_positions(), v) != before));
        }
        REQUIRE(surface.events().size() <= 2);
    }
    CHECK(moved > cases(150));
}
