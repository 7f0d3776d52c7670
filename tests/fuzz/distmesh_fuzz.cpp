// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <membrane/meshing/distmesh.hpp>
#include <membrane/surface/adjacency.hpp>

#include "bytes.hpp"

// Bodies put together at random, and functions that are no distances: a refusal, or a mesh whose vertices are on the
// surface, within the bounds.

using namespace membrane;
using test::Bytes;
using test::require;

namespace {

using Distance = std::function<double(const Vector3<double>&)>;

Distance any_part(Bytes& bytes) {
    const Vector3<double> centre = 0.5 * bytes.vector(), size = bytes.vector(0.05, 0.6);
    switch (bytes.index(5)) {
        case 0: return Ball{.centre = centre, .radius = size.x()};
        case 1: return Ellipsoid{.centre = centre, .radii = size};
        case 2: return Cuboid{.centre = centre, .half_size = size};
        case 3: return Capsule{.start = centre, .end = centre + size, .radius = size.z()};
        default: return HalfSpace{.point = centre, .normal = size - Vector3<double>::Constant(0.3)};
    }
}

/// A body of up to 8 parts.
Distance any_body(Bytes& bytes) {
    Distance body = any_part(bytes);
    for (Index more = bytes.index(8); more > 0; --more) {
        switch (bytes.index(4)) {
            case 0: body = united(body, any_part(bytes)); break;
            case 1: body = intersection(body, any_part(bytes)); break;
            case 2: body = difference(body, any_part(bytes)); break;
            default: body = offset(body, bytes.number(-0.1, 0.1));
        }
    }
    return body;
}

/// What breaks the promises of a distance: jumps, steep and flat slopes, numbers that are none.
Distance spoilt(Distance body, Bytes& bytes) {
    const Vector3<double> at = bytes.vector();
    const double wild = bytes.wild<double>(), factor = std::pow(10, bytes.number(-12, 12));
    switch (bytes.index(4)) {
        case 0: return [=](const Vector3<double>& p) { return p.x() > at.x() ? wild : body(p); };
        case 1: return [=](const Vector3<double>& p) { return factor * body(p); };
        case 2: return [=](const Vector3<double>& p) { return body(p) > 0 ? 1.0 : -1.0; };
        default: return [=](const Vector3<double>& p) { return body(p) + 0.2 * std::sin(factor * p.x()); };
    }
}

void examine(Bytes bytes) {
    const test::Switches switches(bytes.next<std::uint8_t>());
    Distance body = any_body(bytes);
    const bool is_distance = !switches.on(0);
    if (!is_distance) body = spoilt(body, bytes);
    Bounds bounds{{-1.3, -1.3, -1.3}, {1.3, 1.3, 1.3}};
    if (switches.on(1)) bounds.low[bytes.index(3)] = switches.on(2) ? bytes.wild<double>() : bytes.number(-1.3, 1.3);
    DistMeshOptions options{
        .edge_length = bytes.number(0.2, 1), .bounds = bounds, .iterations = bytes.index(8), .spacing = 0.15};
    if (switches.on(3)) {
        const double wild = bytes.wild<double>();
        options.edge_length = std::fabs(wild) < 0.2 ? 0.2 : wild;  // not too many vertices
    }
    if (!(bounds.low.minCoeff() >= -1.3))
        options.spacing = bytes.wild<double>() > 0.15 ? 1e3 : 0;  // few cells, or none
    try {
        const auto mesh = distmesh(body, options);
        require(is_finite(mesh.positions()) && mesh.triangle_count() >= 4);
        require(Adjacency(mesh).closed());
        if (!is_distance) return;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            require(std::abs(body(point(mesh.positions(), v))) <= 1e-9);
        }
    } catch (const InvalidInput&) {
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    examine(Bytes(data, size));
    return 0;
}
