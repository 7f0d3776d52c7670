// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <membrane/surface/triangle.hpp>

/// The same queries as those of `surface/triangle.hpp` and the tree, by other means and one triangle after the other.
/// Works for any number type that Eigen takes: `long double` for accuracy, 64-bit integers where a result must be
/// exact.
///
///     const auto triangle = test::brute_triangle<long double>(membrane::triangle_at(x, corners));
///     CHECK(test::squared_distance(triangle, q) == Approx(...));
namespace test {

template <class Number>
using Vector = Eigen::Matrix<Number, 3, 1>;

template <class Number>
struct BruteTriangle {
    Vector<Number> a, b, c;
};

template <class Number, membrane::Real Scalar>
BruteTriangle<Number> brute_triangle(const membrane::Triangle<Scalar>& t) {
    return {t.a.eigen().template cast<Number>(), t.b.eigen().template cast<Number>(),
            t.c.eigen().template cast<Number>()};
}

template <class Number>
Vector<Number> cross(const Vector<Number>& a, const Vector<Number>& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Six times the volume of the tetrahedron; positive where d sees a, b, c clockwise.
template <class Number>
Number volume(const Vector<Number>& a, const Vector<Number>& b, const Vector<Number>& c, const Vector<Number>& d) {
    return cross<Number>(b - a, c - a).dot(d - a);
}

template <class Number>
Number squared_distance(const Vector<Number>& p, const Vector<Number>& q, const Vector<Number>& to) {
    const Vector<Number> segment = q - p;
    const Number length = segment.dot(segment);
    const Number along = length > 0 ? std::clamp<Number>((to - p).dot(segment) / length, 0, 1) : Number(0);
    return (to - (p + along * segment)).squaredNorm();
}

/// The least of the distances to the three edges and, where the perpendicular from q meets the triangle, to its plane.
template <class Number>
Number squared_distance(const BruteTriangle<Number>& t, const Vector<Number>& q) {
    const Vector<Number> normal = cross<Number>(t.b - t.a, t.c - t.b);
    const auto left_of = [&](const Vector<Number>& from, const Vector<Number>& to) {
        return cross<Number>(to - from, q - from).dot(normal) >= 0;
    };
    const Number to_edges = std::min({squared_distance<Number>(t.a, t.b, q), squared_distance<Number>(t.b, t.c, q),
                                      squared_distance<Number>(t.c, t.a, q)});
    if (!(normal.squaredNorm() > 0) || !left_of(t.a, t.b) || !left_of(t.b, t.c) || !left_of(t.c, t.a)) return to_edges;
    const Number height = normal.dot(q - t.b);
    return std::min(to_edges, height * height / normal.squaredNorm());
}

/// The least value of a convex function on [0, 1], by halving the bracket where it falls.
template <class Function>
long double least(Function f) {
    long double low = 0, high = 1;
    for (int step = 0; step < 120; ++step) {
        const long double third = (high - low) / 3;
        if (f(low + third) < f(high - third))
            high -= third;
        else
            low += third;
    }
    return std::min({f(low), f((low + high) / 2), f(high)});
}

/// The same for any triangle, however thin: the least over all segments in it that are parallel to a c; convex from
/// one to the next. Slow.
inline long double squared_distance_by_search(const BruteTriangle<long double>& t, const Vector<long double>& q) {
    return least([&](long double part) {
        return squared_distance<long double>(t.a + part * (t.b - t.a), t.c + part * (t.b - t.c), q);
    });
}

/// The distance of a point of the segment to the triangle is convex along the segment. Slow.
inline long double squared_distance_by_search(const BruteTriangle<long double>& t, const Vector<long double>& p,
                                              const Vector<long double>& q) {
    return least([&](long double along) { return squared_distance<long double>(t, p + along * (q - p)); });
}

/// Whether two segments in the plane, seen along `axis`, have a point in common.
template <class Number>
bool segments_meet(const Vector<Number>& a, const Vector<Number>& b, const Vector<Number>& c, const Vector<Number>& d,
                   int axis) {
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    const auto side = [&](const Vector<Number>& p, const Vector<Number>& q, const Vector<Number>& r) {
        const Number area = (q[i] - p[i]) * (r[j] - p[j]) - (q[j] - p[j]) * (r[i] - p[i]);
        return area > 0 ? 1 : area < 0 ? -1 : 0;
    };
    if (side(a, b, c) * side(a, b, d) > 0 || side(c, d, a) * side(c, d, b) > 0) return false;
    for (const int k : {i, j}) {  // matters where all four are on one line
        if (std::max(a[k], b[k]) < std::min(c[k], d[k]) || std::max(c[k], d[k]) < std::min(a[k], b[k])) return false;
    }
    return true;
}

/// Whether segment and triangle have a point in common, by the signs of volumes. A triangle without area has none.
template <class Number>
bool meet(const BruteTriangle<Number>& t, const Vector<Number>& p, const Vector<Number>& q) {
    const Vector<Number> normal = cross<Number>(t.b - t.a, t.c - t.a);
    if (normal.squaredNorm() == 0) return false;
    const Number above = volume(t.a, t.b, t.c, p), below = volume(t.a, t.b, t.c, q);
    if ((above > 0 && below > 0) || (above < 0 && below < 0)) return false;
    if (above == 0 && below == 0) {
        int axis = 0;
        normal.cwiseAbs().maxCoeff(&axis);
        const auto outside = [&](const Vector<Number>& u, const Vector<Number>& v) {
            return cross<Number>(v - u, p - u)[axis] * (normal[axis] > 0 ? 1 : -1) < 0;
        };
        if (!outside(t.a, t.b) && !outside(t.b, t.c) && !outside(t.c, t.a)) return true;
        return segments_meet(p, q, t.a, t.b, axis) || segments_meet(p, q, t.b, t.c, axis) ||
               segments_meet(p, q, t.c, t.a, axis);
    }
    const Number ab = volume(p, q, t.a, t.b), bc = volume(p, q, t.b, t.c), ca = volume(p, q, t.c, t.a);
    return (ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0);
}

/// Whether triangle and box have a point in common: what the six sides of the box leave of the triangle.
template <class Number>
bool meet_box(const BruteTriangle<Number>& t, const Vector<Number>& low, const Vector<Number>& high) {
    std::vector<Vector<Number>> polygon{t.a, t.b, t.c};
    for (int side = 0; side < 6 && !polygon.empty(); ++side) {
        const int k = side / 2;
        const auto inside = [&](const Vector<Number>& p) { return side % 2 == 0 ? p[k] - low[k] : high[k] - p[k]; };
        std::vector<Vector<Number>> rest;
        for (std::size_t i = 0; i < polygon.size(); ++i) {
            const Vector<Number>&p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
            const Number here = inside(p), there = inside(q);
            if (here >= 0) rest.push_back(p);
            if ((here > 0 && there < 0) || (here < 0 && there > 0)) rest.push_back(p + here / (here - there) * (q - p));
        }
        polygon = rest;
    }
    return !polygon.empty();
}

/// The least squared distance from `q` to the triangles [m^2].
template <class Positions>
double squared_distance_to_all(const Positions& x, const membrane::Triangles& triangles, const Vector<double>& q) {
    double least = std::numeric_limits<double>::infinity();
    for (membrane::Index f = 0; f < triangles.cols(); ++f) {
        const auto triangle = brute_triangle<double>(membrane::triangle_at(x, triangles.col(f)));
        least = std::min(least, squared_distance<double>(triangle, q));
    }
    return least;
}

/// The triangles of which `contacts(triangle)` says so, ascending.
template <class Number, class Positions, class Touches>
std::vector<membrane::Index> all_that(const Positions& x, const membrane::Triangles& triangles, Touches contacts) {
    std::vector<membrane::Index> found;
    for (membrane::Index f = 0; f < triangles.cols(); ++f) {
        if (contacts(brute_triangle<Number>(membrane::triangle_at(x, triangles.col(f))))) found.push_back(f);
    }
    return found;
}

}  // namespace test
