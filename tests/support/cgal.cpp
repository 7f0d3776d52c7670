// SPDX-License-Identifier: MIT
#include "support/cgal.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>

#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Side_of_triangle_mesh.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <CGAL/boost/graph/helpers.h>

#include "support/cgal_mesh.hpp"

namespace test {

namespace PMP = CGAL::Polygon_mesh_processing;
using membrane::Index;

CgalFacts cgal_facts(const membrane::Points<double>& x, const membrane::Triangles& triangles) {
    const CgalMesh mesh = cgal_mesh(x, triangles);
    CgalFacts facts;
    facts.faces = static_cast<Index>(mesh.number_of_faces());
    for (const auto v : mesh.vertices()) facts.isolated += mesh.is_isolated(v) ? 1 : 0;
    facts.euler = static_cast<int>(mesh.number_of_vertices()) - static_cast<int>(mesh.number_of_edges()) +
                  static_cast<int>(mesh.number_of_faces());
    facts.valid = mesh.is_valid() && CGAL::is_valid_polygon_mesh(mesh);
    facts.closed = CGAL::is_closed(mesh);
    facts.intersects_itself = PMP::does_self_intersect(mesh);
    facts.area = PMP::area(mesh);
    if (facts.closed) {
        facts.outward = PMP::is_outward_oriented(mesh);
        facts.bounds_a_volume = PMP::does_bound_a_volume(mesh);
        facts.volume = PMP::volume(mesh);
    }
    for (const auto h : mesh.halfedges()) {
        if (mesh.is_border(h)) continue;
        const auto &a = mesh.point(mesh.source(h)), &b = mesh.point(mesh.target(h));
        const auto& c = mesh.point(mesh.target(mesh.next(h)));
        facts.smallest_angle = std::min(facts.smallest_angle, CGAL::approximate_angle(a - b, c - b));
    }
    return facts;
}

bool cgal_takes_for_mesh(const membrane::Triangles& triangles) {
    return PMP::is_polygon_soup_a_polygon_mesh(cgal_soup(triangles));
}

std::optional<bool> cgal_touches_box(const membrane::Triangle<double>& triangle, const membrane::Vector3<double>& low,
                                     const membrane::Vector3<double>& high) {
    const CgalKernel::Triangle_3 t(cgal_point(triangle.a), cgal_point(triangle.b), cgal_point(triangle.c));
    if (t.is_degenerate()) return std::nullopt;
    return CGAL::do_intersect(t, CgalKernel::Iso_cuboid_3(cgal_point(low), cgal_point(high)).bbox());
}

struct CgalTree::Trees {
    using Primitive = CGAL::AABB_face_graph_triangle_primitive<CgalMesh>;
    using Tree = CGAL::AABB_tree<CGAL::AABB_traits<CgalKernel, Primitive>>;

    CgalMesh mesh;
    Tree tree{faces(mesh).first, faces(mesh).second, mesh};
    CGAL::Side_of_triangle_mesh<CgalMesh, CgalKernel> side{tree};
};

CgalTree::CgalTree(const membrane::Points<double>& x, const membrane::Triangles& triangles)
    : trees_(new Trees{.mesh = cgal_mesh(x, triangles)}) {}

CgalTree::~CgalTree() = default;

double CgalTree::distance(const Point& p) const {
    return std::sqrt(CGAL::to_double(trees_->tree.squared_distance(cgal_point(p))));
}

bool CgalTree::intersects(const Point& p, const Point& q) const {
    return trees_->tree.do_intersect(CgalKernel::Segment_3(cgal_point(p), cgal_point(q)));
}

std::size_t CgalTree::count_in_box(const Point& low, const Point& high) const {
    std::vector<CgalMesh::Face_index> found;
    trees_->tree.all_intersected_primitives(CGAL::Bbox_3(low.x(), low.y(), low.z(), high.x(), high.y(), high.z()),
                                            std::back_inserter(found));
    return found.size();
}

bool CgalTree::is_outside(const Point& p) const { return trees_->side(cgal_point(p)) == CGAL::ON_UNBOUNDED_SIDE; }

membrane::Triangles cgal_delaunay(const Eigen::Matrix2Xd& points) {
    using Vertex = CGAL::Triangulation_vertex_base_with_info_2<Index, CgalKernel>;
    using Delaunay = CGAL::Delaunay_triangulation_2<CgalKernel, CGAL::Triangulation_data_structure_2<Vertex>>;
    Delaunay delaunay;
    for (Index v = 0; v < points.cols(); ++v) {
        const auto vertex = delaunay.insert(Delaunay::Point(points(0, v), points(1, v)));
        if (delaunay.number_of_vertices() != static_cast<std::size_t>(v) + 1) throw std::logic_error("points coincide");
        vertex->info() = v;
    }
    membrane::Triangles triangles(3, static_cast<Index>(delaunay.number_of_faces()));
    Index count = 0;
    for (auto f = delaunay.finite_faces_begin(); f != delaunay.finite_faces_end(); ++f, ++count) {
        for (int k = 0; k < 3; ++k) triangles(k, count) = f->vertex(k)->info();
    }
    return triangles;
}

}  // namespace test
