// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <string>
#include <type_traits>

#include <CGAL/Complex_2_in_triangulation_3.h>
#include <CGAL/IO/facets_in_complex_2_to_triangle_mesh.h>
#include <CGAL/Implicit_surface_3.h>
#include <CGAL/Random.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_default_criteria_3.h>
#include <CGAL/Surface_mesh_default_triangulation_3.h>
#include <CGAL/make_surface_mesh.h>
#include <membrane/mesh_check/quality.hpp>
#include <membrane/meshing/distmesh.hpp>

#include "support/scene.hpp"

// Our mesher of signed distances against CGAL's, on the same closed bodies, about as large as the unit ball, with the
// same mean edge: time, and quality of the triangles. CGAL's refines a Delaunay triangulation until no angle is below
// 30 degrees and no triangle too large; its bound on the size is found beforehand, so that the mean edges agree. (A box
// is not among the bodies: on its flat faces CGAL's edges jump from half the target length to twice of it.)

namespace {

using namespace bench;
using membrane::MeshQuality;
using Mesh = membrane::TriangleMesh<double>;

constexpr double max_off = 1e-9;  // distance of a vertex from the surface [m]

/// A body, bounds for ours, a point inside for CGAL's.
template <class Distance>
struct Body {
    Distance distance;
    membrane::Bounds bounds;
    Vector3 inside = Vector3::Zero();
};

template <class Distance>
Body<Distance> stock(const Distance& distance) {
    return {distance, distance.bounds()};
}

double torus(const Vector3& p) { return std::hypot(std::hypot(p.x(), p.y()) - 1, p.z()) - 0.35; }

struct Ours {
    template <class Distance>
    static Mesh mesh(const Body<Distance>& body, double length) {
        return membrane::distmesh(body.distance, {.edge_length = length, .bounds = body.bounds});
    }
    template <class Distance>
    static double size_for(const Body<Distance>&, double length) {
        return length;
    }
};

struct Cgal {
    using Triangulation = CGAL::Surface_mesh_default_triangulation_3;
    using Traits = Triangulation::Geom_traits;

    /// With triangles in circles of radius `size` at most.
    template <class Distance>
    static Mesh mesh(const Body<Distance>& body, double size) {
        CGAL::get_default_random() = CGAL::Random(1);
        const auto function = [&](const Traits::Point_3& p) { return body.distance(Vector3(p.x(), p.y(), p.z())); };
        const double diagonal = (body.bounds.high - body.bounds.low).norm();
        const Traits::Point_3 inside(body.inside.x(), body.inside.y(), body.inside.z());
        const CGAL::Implicit_surface_3<Traits, std::decay_t<decltype(function)>> surface(
            function, Traits::Sphere_3(inside, diagonal * diagonal), max_off / diagonal / 10);
        Triangulation triangulation;
        CGAL::Complex_2_in_triangulation_3<Triangulation> complex(triangulation);
        const CGAL::Surface_mesh_default_criteria_3<Triangulation> criteria(30, size, size);
        CGAL::make_surface_mesh(complex, surface, criteria, CGAL::Manifold_tag());
        CGAL::Surface_mesh<Traits::Point_3> made;
        CGAL::facets_in_complex_2_to_triangle_mesh(complex, made);
        return ours(made);
    }

    template <class Distance>
    static double size_for(const Body<Distance>& body, double length) {
        double size = length;
        for (int i = 0; i < 10; ++i) {
            const double ratio = length / membrane::quality_of(mesh(body, size)).mean_edge;
            if (std::abs(ratio - 1) < 0.03) break;
            size *= ratio;
        }
        return size;
    }

  private:
    static Mesh ours(const CGAL::Surface_mesh<Traits::Point_3>& made) {
        Points x(3, static_cast<Eigen::Index>(made.number_of_vertices()));
        membrane::Triangles triangles(3, static_cast<Eigen::Index>(made.number_of_faces()));
        for (const auto v : made.vertices()) {
            const auto& p = made.point(v);
            x.col(static_cast<Eigen::Index>(v.idx())) << p.x(), p.y(), p.z();
        }
        for (const auto f : made.faces()) {
            Eigen::Index k = 0;
            for (const auto v : made.vertices_around_face(made.halfedge(f))) {
                triangles(k++, static_cast<Eigen::Index>(f.idx())) = static_cast<Index>(v.idx());
            }
        }
        return {x, triangles};
    }
};

template <class Mesher, class Distance>
void measure(benchmark::State& state, const Body<Distance>& body) {
    const double target_length = 1e-3 * static_cast<double>(state.range(0)),
                 size = Mesher::size_for(body, target_length);
    Mesh mesh = Mesher::mesh(body, size);
    for (auto _ : state) mesh = Mesher::mesh(body, size);
    const MeshQuality quality = membrane::quality_of(mesh);
    require(membrane::Adjacency(mesh).closed(), "the surface must be closed");
    require(std::abs(quality.mean_edge / target_length - 1) < 0.2, "the mean edge must be near its target");
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        require(std::abs(body.distance(membrane::point(mesh.positions(), v))) <= max_off,
                "vertices are on the surface");
    }
    state.counters["vertices"] = mesh.vertex_count();
    state.counters["smallest_angle"] = quality.smallest_angle;
    state.counters["mean_smallest_angle"] = quality.mean_smallest_angle;
    state.counters["mean_edge"] = quality.mean_edge;
    state.counters["even_edges"] = quality.even_edges;
}

template <class Distance>
void add(const std::string& name, const Body<Distance>& body) {
    const auto add_one = [&](const std::string& mesher, auto measured) {
        benchmark::RegisterBenchmark((name + "/" + mesher).c_str(), measured, body)
            ->ArgName("thousandths")
            ->Arg(200)
            ->Arg(100)
            ->Unit(benchmark::kMillisecond);
    };
    add_one("ours", measure<Ours, Distance>);
    add_one("cgal", measure<Cgal, Distance>);
}

const bool added = [] {
    using namespace membrane;
    add("sphere", stock(Ball{}));
    add("lens", stock(Ellipsoid{.radii = {1, 1, 0.4}}));
    add("capsule", stock(Capsule{.start = {0, 0, -0.7}, .end = {0, 0, 0.7}, .radius = 0.5}));
    add("merged",
        stock(united(Ball{.centre = {-0.5, 0, 0}, .radius = 0.8}, Ball{.centre = {0.6, 0, 0}, .radius = 0.7})));
    add("torus", Body<decltype(&torus)>{&torus, {{-1.4, -1.4, -0.4}, {1.4, 1.4, 0.4}}, {1, 0, 0}});
    add("ellipsoid", stock(Ellipsoid{.radii = {1, 0.7, 0.5}}));
    return true;
}();

}  // namespace
