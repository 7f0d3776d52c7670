// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

namespace test {

/// A disc with a pinned rim, stretched in it, on a soft layer that resists along the surface, too.
template <membrane::Real S>
struct SoftDisc {
    membrane::Index rings;
    double stretch = 1;
    membrane::TriangleMesh<S> mesh = membrane::disc<S>({.radius = 5e-3, .rings = rings});
    membrane::Material material{.young_modulus = 1e6, .poisson_ratio = 1.0 / 3, .thickness = 50e-6};
    membrane::FoundationLayer layer{.young_modulus = 2e4, .poisson_ratio = 0.3, .thickness = 1e-3};
    membrane::MassSpringNetwork<S, membrane::LinearSpring> network{
        mesh,
        membrane::LinearSpring{},
        {.stiffness = membrane::spring_stiffnesses(mesh, material),
         .rest_length = relaxed_lengths(),
         .pinned = membrane::border(mesh)}};
    membrane::FoundationSprings<S> foundation{mesh,
                                              {.normal = membrane::normal_stiffnesses(mesh, layer),
                                               .tangential = membrane::tangential_stiffnesses(mesh, layer)}};

    explicit SoftDisc(membrane::Index with_rings, double with_stretch = 1) : rings(with_rings), stretch(with_stretch) {}

    /// Energy of springs and foundation [J].
    [[nodiscard]] double stored(const membrane::Points<S>& x) const {
        auto sum = static_cast<double>(network.energy(x));
        for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
            sum += static_cast<double>(foundation.energy(v, membrane::point(x, v)));
        }
        return sum;
    }

    [[nodiscard]] std::vector<S> relaxed_lengths() const {
        const membrane::MassSpringNetwork relaxed(mesh, membrane::LinearSpring{}, {.stiffness = 1});
        std::vector<S> all;
        for (const auto& spring : relaxed.springs()) {
            all.push_back(spring.rest_length / static_cast<S>(stretch));
        }
        return all;
    }
};

}  // namespace test
