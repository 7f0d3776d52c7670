// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/tissue/material.hpp>

/// Constants of springs from those of a material, so that a force does not depend on the mesh, if the mesh resolves the
/// tool: at a depth of half its radius, the force on a sphere is within 6 % of that on a fine mesh for a radius of 1.5
/// mean edges, within 3 % for 2.5.
///
///     const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
///                                                      {.stiffness = membrane::spring_stiffnesses(mesh, material),
///                                                       .mass = membrane::vertex_masses(mesh, material)});
///     const auto foundation =
///         membrane::FoundationSprings(mesh, {.normal = membrane::normal_stiffnesses(mesh, layer),
///                                            .tangential = membrane::tangential_stiffnesses(mesh, layer),
///                                            .recovery_time = 0.2});
namespace membrane {

/// A stiffness for each spring [N/m], in the order of `Adjacency::edges()`: E' t (A1 + A2) / l^2, A1 and A2 the areas
/// of the triangles at an edge of length l [VanGelder98]; 0 for an edge of length 0.
///
/// A sheet of springs alone has Poisson ratio 1/3. At this ratio, on equilateral triangles, E' = E is exact. At another
/// ratio E' = 2 E / (3 (1 - nu)): under equal strain in all directions, as under a tool, the tension is exact; the
/// shear modulus is (1 + nu) / (2 (1 - nu)) times the exact one, 1.39 times at 0.47. On irregular triangles there is an
/// error that does not decrease with their size: every flat mesh is exact under equal strain in all directions without
/// lateral displacement, but squares cut by a diagonal are a third too soft in shear along their sides.
/// @throws InvalidInput for a material out of its range. O(F log F).
template <Real Scalar>
[[nodiscard]] std::vector<Scalar> spring_stiffnesses(const TriangleMesh<Scalar>& mesh, const Material& material);

/// The area around each vertex, a third of each of its triangles [m^2]; the sum is the area of the mesh.
template <Real Scalar>
[[nodiscard]] std::vector<Scalar> vertex_areas(const TriangleMesh<Scalar>& mesh);

/// A mass for each vertex [kg]: density times thickness times its area.
/// @throws InvalidInput for a material out of its range
template <Real Scalar>
[[nodiscard]] std::vector<Scalar> vertex_masses(const TriangleMesh<Scalar>& mesh, const Material& material);

///@{
/// Stiffnesses of the layer under each vertex [N/m]: those of the foundation times the vertex's area.
/// @throws InvalidInput for a foundation out of its range
template <Real Scalar>
[[nodiscard]] std::vector<Scalar> normal_stiffnesses(const TriangleMesh<Scalar>& mesh,
                                                     const FoundationLayer& foundation);
template <Real Scalar>
[[nodiscard]] std::vector<Scalar> tangential_stiffnesses(const TriangleMesh<Scalar>& mesh,
                                                         const FoundationLayer& foundation);
///@}

/// Mean length of the edges [m]. O(F log F).
template <Real Scalar>
[[nodiscard]] Scalar mean_edge(const TriangleMesh<Scalar>& mesh);

namespace detail {

/// `weight` times each area.
template <Real Scalar>
[[nodiscard]] std::vector<Scalar> weighted_areas(const TriangleMesh<Scalar>& mesh, double weight) {
    auto areas = vertex_areas(mesh);
    for (Scalar& area : areas) area *= static_cast<Scalar>(weight);
    return areas;
}

template <Real Scalar>
[[nodiscard]] Scalar area_of(const TriangleMesh<Scalar>& mesh, Index f) noexcept {
    return norm(area_vector(triangle_at(mesh.positions(), mesh.triangles().col(f))));
}

template <Real Scalar>
[[nodiscard]] Vector3<Scalar> edge_of(const TriangleMesh<Scalar>& mesh, const HalfEdge& side) noexcept {
    return point(mesh.positions(), side.second) - point(mesh.positions(), side.first);
}

}  // namespace detail

template <Real Scalar>
std::vector<Scalar> spring_stiffnesses(const TriangleMesh<Scalar>& mesh, const Material& material) {
    material.validate();
    const auto scale = static_cast<Scalar>(material.biaxial_stiffness() * 2 / 3);
    std::vector<Scalar> result;
    for_each_edge(half_edges(mesh.triangles()), [&](std::span<const HalfEdge> sides) {
        Scalar area = 0;
        for (const HalfEdge& side : sides) area += detail::area_of(mesh, side.triangle);
        const Scalar squared = squared_norm(detail::edge_of(mesh, sides[0]));
        result.push_back(squared > 0 ? scale * (area / squared) : Scalar(0));
    });
    return result;
}

template <Real Scalar>
std::vector<Scalar> vertex_areas(const TriangleMesh<Scalar>& mesh) {
    std::vector<Scalar> areas(static_cast<std::size_t>(mesh.vertex_count()));
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        const Scalar third = detail::area_of(mesh, f) / 3;
        for (const Index v : mesh.triangles().col(f)) areas[static_cast<std::size_t>(v)] += third;
    }
    return areas;
}

template <Real Scalar>
std::vector<Scalar> vertex_masses(const TriangleMesh<Scalar>& mesh, const Material& material) {
    material.validate();
    return detail::weighted_areas(mesh, material.density * material.thickness);
}

template <Real Scalar>
std::vector<Scalar> normal_stiffnesses(const TriangleMesh<Scalar>& mesh, const FoundationLayer& foundation) {
    foundation.validate();
    return detail::weighted_areas(mesh, foundation.normal_stiffness());
}

template <Real Scalar>
std::vector<Scalar> tangential_stiffnesses(const TriangleMesh<Scalar>& mesh, const FoundationLayer& foundation) {
    foundation.validate();
    return detail::weighted_areas(mesh, foundation.tangential_stiffness());
}

template <Real Scalar>
Scalar mean_edge(const TriangleMesh<Scalar>& mesh) {
    double sum = 0, count = 0;
    for_each_edge(half_edges(mesh.triangles()), [&](std::span<const HalfEdge> sides) {
        sum += static_cast<double>(norm(detail::edge_of(mesh, sides[0])));
        ++count;
    });
    return static_cast<Scalar>(sum / count);
}

}  // namespace membrane
