// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>

#include <membrane/core/types.hpp>
#include <membrane/model/material.hpp>
#include <membrane/model/spring_stiffness.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// How many layers a membrane on a foundation needs.
///
///     const auto layers = membrane::recommended_layers(mesh, tissue, layer);
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = layers.tangential});
namespace membrane {

/// Over which what pulls at one place dies away, sqrt(membrane over foundation): of a pull along the normal by the
/// foundation's normal stiffness, of one along the surface by its tangential stiffness [m].
struct DecayLengths {
    double normal, tangential;
};

/// @throws InvalidInput for a material or a foundation out of its range
[[nodiscard]] inline DecayLengths decay_lengths(const Material& material, const FoundationLayer& foundation);

/// For a solver's threshold of layers.
struct RecommendedLayers {
    Index normal;  ///< for what lifts the membrane; a tool that presses moves all it touches as layer 0, and needs less
    Index tangential;  ///< for what pulls along it as well
};

/// Enough layers that the force of what holds one vertex is off by less than 1 %, and hardly more than that takes.
///
/// A chain of springs on a foundation, of one edge each, falls e-fold over 1 / (2 asinh(edge / (2 decay length))) springs.
/// In those units it takes 2 layers less 0.7 along the surface; along the normal, where the membrane bends the pull into
/// its own plane, 1.4 by the normal decay length and 0.7 by the tangential one, less 1.1. These numbers are fitted to
/// equilibria of 399 materials on a sphere of 642 vertices.
/// @throws InvalidInput for a material or a foundation out of its range. O(F log F).
template <Real Scalar>
[[nodiscard]] RecommendedLayers recommended_layers(const TriangleMesh<Scalar>& mesh, const Material& material,
                                                   const FoundationLayer& foundation);

inline DecayLengths decay_lengths(const Material& material, const FoundationLayer& foundation) {
    material.check();
    foundation.check();
    const double stiffness = material.biaxial_stiffness();
    return {std::sqrt(stiffness / foundation.normal_stiffness()),
            std::sqrt(stiffness / foundation.tangential_stiffness())};
}

template <Real Scalar>
RecommendedLayers recommended_layers(const TriangleMesh<Scalar>& mesh, const Material& material,
                                     const FoundationLayer& foundation) {
    const auto lengths = decay_lengths(material, foundation);
    const auto edge = static_cast<double>(mean_edge(mesh));
    const auto in_springs = [&](double length) { return 1 / (2 * std::asinh(edge / (2 * length))); };
    const auto whole = [](double layers) {
        return static_cast<Index>(std::ceil((std::min)((std::max)(layers, 1.0), 1e9)));
    };
    const double normal = in_springs(lengths.normal), tangential = in_springs(lengths.tangential);
    return {whole(1.4 * normal + 0.7 * tangential - 1.1), whole(2 * tangential - 0.7)};
}

}  // namespace membrane
