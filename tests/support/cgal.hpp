// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// What CGAL says of our meshes, as an oracle: compiled once, as its headers are long.
namespace test {

/// A surface as CGAL sees it: `x` 3 x V [m]. Area [m^2], volume [m^3, if it is closed], angle in degrees.
struct CgalFacts {
    membrane::Index faces = 0, isolated = 0;
    int euler = 0;  // vertices - edges + faces
    bool valid = false, closed = false, intersects_itself = false;
    bool outward = false, bounds_a_volume = false;  // false if it is not closed
    double area = 0, volume = 0, smallest_angle = 180;
};
CgalFacts cgal_facts(const membrane::Points<double>& x, const membrane::Triangles& triangles);

template <membrane::Real Scalar>
CgalFacts cgal_facts(const membrane::TriangleMesh<Scalar>& mesh) {
    return cgal_facts(mesh.positions().template cast<double>(), mesh.triangles());
}

/// Whether CGAL takes the triangles for a mesh.
bool cgal_takes_for_mesh(const membrane::Triangles& triangles);

/// Whether the triangle touches the box; null if the triangle is degenerate.
std::optional<bool> cgal_touches_box(const membrane::Triangle<double>& triangle, const membrane::Vector3<double>& low,
                                     const membrane::Vector3<double>& high);

/// CGAL's tree over the triangles.
class CgalTree {
  public:
    using Point = membrane::Vector3<double>;

    CgalTree(const membrane::Points<double>& x, const membrane::Triangles& triangles);
    ~CgalTree();
    [[nodiscard]] double distance(const Point& p) const;
    [[nodiscard]] bool intersects(const Point& p, const Point& q) const;
    [[nodiscard]] std::size_t count_in_box(const Point& low, const Point& high) const;
    /// Whether the point is outside of the surface, which is closed.
    [[nodiscard]] bool is_outside(const Point& p) const;

  private:
    struct Trees;
    std::unique_ptr<Trees> trees_;
};

/// The Delaunay triangulation of points in the plane: three indices a triangle, counter-clockwise. Points that coincide
/// are refused.
membrane::Triangles cgal_delaunay(const Eigen::Matrix2Xd& points);

}  // namespace test
