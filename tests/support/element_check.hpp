// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>

#include <membrane/core/lanes.hpp>
#include <membrane/tissue/elements.hpp>

#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/random.hpp"

namespace test {

/// Force, change of energy and curvature of an element against differences of its energy, which vary over displacements
/// of `size` [m] by some `energy` [J].
template <class E>
void check_element(const E& element, const membrane::Corners<double, E::corner_count>& x, double size, double energy,
                   Random& random) {
    const double h = 1e-5 * size;
    for (std::size_t i = 0; i < E::corner_count; ++i) {
        const auto pull = element.force_on(x, i);
        const auto moved = [&](const membrane::Vector3<double>& displacement) {
            auto there = x;
            there[i] += displacement;
            return there;
        };
        for (Eigen::Index k = 0; k < 3; ++k) {
            const membrane::Vector3<double> by = h * membrane::Vector3<double>::Unit(k);
            const double slope = (element.energy(moved(by)) - element.energy(moved(-by))) / (2 * h);
            REQUIRE(std::abs(pull.force[k] + slope) < 1e-7 * energy / size);
        }
        const membrane::Vector3<double> displacement = random.number(0.0, 0.3) * size * random.unit_vector();
        const auto change = element.energy_change(x, i, displacement);
        const double difference = element.energy(moved(displacement)) - element.energy(x);
        REQUIRE(std::abs(change.change - difference) < 1e-12 * energy + 1e-15 * change.size);
        REQUIRE(eigenvalues_of(dense(pull.hessian))[0] > -1e-12 * energy / (size * size));
        membrane::Corners<float, E::corner_count> y;
        for (std::size_t k = 0; k < y.size(); ++k) y[k] = x[k].template cast<float>();
        const auto single = element.force_on(y, i);
        REQUIRE((single.force.template cast<double>() - pull.force).norm() < 1e-4 * energy / size);
    }
}

/// What an element's force, Hessian and remainder say of its energy, over displacements of up to twice its range.
/// Returns for how many they said something.
template <class E>
int check_remainder(const E& element, const membrane::Corners<double, E::corner_count>& x, double size, double energy,
                    Random& random) {
    int known = 0;
    for (std::size_t i = 0; i < E::corner_count; ++i) {
        const auto pull = element.force_on(x, i);
        const double most = std::min(3 * size, 2 / std::sqrt(pull.remainder.per_range));
        const membrane::Vector3<double> d = random.number(0.0, 1.0) * most * random.unit_vector();
        const double quadratic = membrane::dot<double>(d, pull.hessian * d) / 2;
        const double beyond = pull.remainder.at(membrane::squared_norm(d), quadratic);
        known += std::isfinite(beyond);
        auto there = x;
        there[i] += d;
        const double change = element.energy(there) - element.energy(x);
        REQUIRE(change <= quadratic + beyond - membrane::dot(pull.force, d) + 1e-12 * (energy + std::abs(change)));
    }
    return known;
}

/// The exact second derivative, by differences of the forces.
template <class E>
void check_hessian(const E& element, const membrane::Corners<double, E::corner_count>& x, double size, double energy) {
    const double h = 1e-5 * size;
    for (std::size_t i = 0; i < E::corner_count; ++i) {
        for (std::size_t j = 0; j < E::corner_count; ++j) {
            const Eigen::Matrix3d block = element.hessian_block(x, i, j);
            for (Eigen::Index k = 0; k < 3; ++k) {
                auto before = x, after = x;
                before[j][k] -= h;
                after[j][k] += h;
                const Eigen::Vector3d slope =
                    (element.force_on(before, i).force - element.force_on(after, i).force) / (2 * h);
                REQUIRE((slope - block.col(k)).norm() < 1e-7 * energy / (size * size));
            }
        }
    }
}

/// A pack of elements at once against each of them alone, to the bit; `in_lanes(elements)` is their constants side by
/// side.
template <class E, class InLanes>
void check_lanes(const std::array<E, membrane::Lanes<double>::count>& elements,
                 const std::array<membrane::Corners<double, E::corner_count>, membrane::Lanes<double>::count>& x,
                 const membrane::Vector3<double>& displacement, const InLanes& in_lanes) {
    using Wide = membrane::Lanes<double>;
    const auto together = in_lanes(elements);
    const auto lanes = [](const auto& number_of) { return Wide::of([&](std::size_t l) { return number_of(l); }); };
    membrane::Corners<Wide, E::corner_count> places;
    for (std::size_t i = 0; i < places.size(); ++i) {
        for (Eigen::Index k = 0; k < 3; ++k) places[i][k] = lanes([&](std::size_t l) { return x[l][i][k]; });
    }
    const membrane::Vector3<Wide> displacements(displacement[0], displacement[1], displacement[2]);
    const auto energy = together.energy(places);
    for (std::size_t i = 0; i < places.size(); ++i) {
        const auto pull = together.force_on(places, i);
        const auto change = together.energy_change(places, i, displacements);
        for (std::size_t l = 0; l < Wide::count; ++l) {
            const auto alone = elements[l].force_on(x[l], i);
            for (Eigen::Index k = 0; k < 3; ++k) REQUIRE(pull.force[k][l] == alone.force[k]);
            const auto& a = pull.hessian;
            const auto& b = alone.hessian;
            REQUIRE((a.xx[l] == b.xx && a.yy[l] == b.yy && a.zz[l] == b.zz));
            REQUIRE((a.xy[l] == b.xy && a.xz[l] == b.xz && a.yz[l] == b.yz));
            const auto changes = elements[l].energy_change(x[l], i, displacement);
            REQUIRE((change.change[l] == changes.change && change.size[l] == changes.size));
            REQUIRE(energy[l] == elements[l].energy(x[l]));
        }
    }
}

}  // namespace test
