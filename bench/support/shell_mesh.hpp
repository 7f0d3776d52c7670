// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>
#include <vector>

#include <membrane/surface/triangle_mesh.hpp>

/// Meshes for the other program: a quarter of a disc in quads of eight nodes, a square core with rings around it.
///
///     auto mesh = bench::quarter_disc({.across = 4, .core = 0.5e-3, .zones = {{.radius = 5e-3, .rings = 12}}});
///     mesh = bench::mirrored(mesh, 0);                                       // half a disc, on both sides of x = 0
namespace bench {

using membrane::Index;
using Vector3 = membrane::Vector3<double>;

/// Rings up to a circle, from the last one or from the core; each is `growth` times as wide as the one before.
struct Zone {
    double radius;  ///< [m]
    int rings;
    double growth = 1;
};

/// Options of `quarter_disc`.
struct QuarterDiscOptions {
    int across;               ///< quads along a side of the core
    double core;              ///< distance of its sides from the centre [m]
    std::vector<Zone> zones;  ///< outwards

    /// The mesh of twice as many quads along each direction.
    [[nodiscard]] QuarterDiscOptions refined() const;
};

/// Corners counter-clockwise seen from +z, then the middles of the sides from each corner to the next.
using Quad = std::array<Index, 8>;

/// A shell of quads with eight nodes.
struct ShellMesh {
    std::vector<Vector3> nodes;  ///< [m]
    std::vector<Quad> quads;

    /// The nodes for which `is_in(position)` holds.
    template <class Predicate>
    [[nodiscard]] std::vector<Index> where(Predicate is_in) const {
        std::vector<Index> found;
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            if (is_in(nodes[i])) found.push_back(static_cast<Index>(i));
        }
        return found;
    }
};

/// The part of a disc at x >= 0, y >= 0, z = 0.
[[nodiscard]] ShellMesh quarter_disc(const QuarterDiscOptions& options);

/// The mesh with its mirror image in the plane through the origin across `axis`; nodes on the plane are not doubled.
[[nodiscard]] ShellMesh mirrored(const ShellMesh& mesh, Eigen::Index axis);

/// The area of each node [m^2], positive also at corners: by its squared shape function (HRZ lumping).
[[nodiscard]] std::vector<double> lumped_areas(const ShellMesh& mesh);

inline QuarterDiscOptions QuarterDiscOptions::refined() const {
    QuarterDiscOptions finer{2 * across, core, zones};
    for (Zone& zone : finer.zones) {
        zone.rings *= 2;
        zone.growth = std::sqrt(zone.growth);
    }
    return finer;
}

namespace detail {

/// Nodes by their place in the grid, in half quads.
class QuarterDisc {
  public:
    explicit QuarterDisc(const QuarterDiscOptions& options) : options_(options) {
        double inner = 0;  // in the first zone 0 is the core's outline and 1 the circle
        for (const Zone& zone : options.zones) {
            add_levels(zone, inner);
            inner = zone.radius;
        }
    }

    [[nodiscard]] ShellMesh make() {
        const int n = options_.across;
        for (int i = 0; i < 2 * n; i += 2) {
            for (int j = 0; j < 2 * n; j += 2) {
                add([&](int di, int dj) { return core_node(i + di, j + dj); });
            }
        }
        for (int level = 0; level + 2 < static_cast<int>(levels_.size()); level += 2) {
            for (int s = 0; s < 4 * n; s += 2) {
                add([&](int dl, int ds) { return ring_node(level + dl, s + ds); });
            }
        }
        return std::move(mesh_);
    }

  private:
    // A circle, or in the first zone, `part` of the distance from the core's outline to it.
    struct Level {
        double radius, part;
    };

    void add_levels(const Zone& zone, double inner) {
        const bool first = levels_.empty();
        if (first) levels_.push_back({zone.radius, 0});
        double sum = 0, width = 1;
        for (int i = 0; i < zone.rings; ++i, width *= zone.growth) sum += width;
        double done = 0;
        width = 1;
        for (int i = 0; i < zone.rings; ++i, width *= zone.growth) {
            for (const double half : {0.5, 1.0}) {
                const double part = (done + half * width) / sum;
                levels_.push_back(first ? Level{zone.radius, part} : Level{inner + part * (zone.radius - inner), 1});
            }
            done += width;
        }
    }

    [[nodiscard]] Vector3 core_point(int i, int j) const {
        const double u = 0.5 * i / options_.across, v = 0.5 * j / options_.across, rounding = 0.5;
        return options_.core *
               Vector3(u * std::sqrt(1 - rounding * v * v / 2), v * std::sqrt(1 - rounding * u * u / 2), 0);
    }

    Index core_node(int i, int j) { return node({-1, i, j}, core_point(i, j)); }

    // Around the outline from the x to the y axis.
    Index ring_node(int level, int s) {
        const int side = 2 * options_.across, i = std::min(side, 2 * side - s), j = std::min(side, s);
        if (level == 0) return core_node(i, j);
        const auto& [radius, part] = levels_[static_cast<std::size_t>(level)];
        const double angle = std::numbers::pi / 2 * s / (2 * side);
        // On the axes, exact zeros: symmetry planes are found by them.
        const Vector3 direction(s == 2 * side ? 0 : std::cos(angle), s == 0 ? 0 : std::sin(angle), 0);
        return node({level, s, 0}, (1 - part) * core_point(i, j) + part * radius * direction);
    }

    Index node(const std::tuple<int, int, int>& key, const Vector3& position) {
        const auto [found, is_new] = nodes_.try_emplace(key, static_cast<Index>(mesh_.nodes.size()));
        if (is_new) mesh_.nodes.push_back(position);
        return found->second;
    }

    template <class NodeAt>
    void add(NodeAt at) {
        mesh_.quads.push_back({at(0, 0), at(2, 0), at(2, 2), at(0, 2), at(1, 0), at(2, 1), at(1, 2), at(0, 1)});
    }

    const QuarterDiscOptions& options_;
    std::vector<Level> levels_;  // every half ring
    std::map<std::tuple<int, int, int>, Index> nodes_;
    ShellMesh mesh_;
};

/// Shape functions of a quad of eight nodes at (r, s) in [-1, 1]^2, and their derivatives.
struct ShapeFunctions {
    ShapeFunctions(double r, double s) {
        constexpr std::array<std::array<int, 2>, 8> at{
            {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {0, -1}, {1, 0}, {0, 1}, {-1, 0}}};
        for (std::size_t i = 0; i < 8; ++i) {
            const double a = at[i][0], b = at[i][1];
            if (i < 4) {
                value[i] = (1 + a * r) * (1 + b * s) * (a * r + b * s - 1) / 4;
                by_r[i] = a * (1 + b * s) * (2 * a * r + b * s) / 4;
                by_s[i] = b * (1 + a * r) * (a * r + 2 * b * s) / 4;
            } else if (at[i][0] == 0) {
                value[i] = (1 - r * r) * (1 + b * s) / 2;
                by_r[i] = -r * (1 + b * s);
                by_s[i] = b * (1 - r * r) / 2;
            } else {
                value[i] = (1 + a * r) * (1 - s * s) / 2;
                by_r[i] = a * (1 - s * s) / 2;
                by_s[i] = -s * (1 + a * r);
            }
        }
    }
    std::array<double, 8> value, by_r, by_s;
};

}  // namespace detail

inline ShellMesh quarter_disc(const QuarterDiscOptions& options) { return detail::QuarterDisc(options).make(); }

inline ShellMesh mirrored(const ShellMesh& mesh, Eigen::Index axis) {
    ShellMesh both = mesh;
    std::vector<Index> image(mesh.nodes.size());
    for (std::size_t i = 0; i < mesh.nodes.size(); ++i) {
        Vector3 position = mesh.nodes[i];
        image[i] = static_cast<Index>(i);
        if (position[axis] == 0) continue;
        position[axis] = -position[axis];
        image[i] = static_cast<Index>(both.nodes.size());
        both.nodes.push_back(position);
    }
    for (const Quad& quad : mesh.quads) {
        Quad turned;
        constexpr std::array<std::size_t, 8> order{0, 3, 2, 1, 7, 6, 5, 4};
        for (std::size_t i = 0; i < 8; ++i) turned[i] = image[static_cast<std::size_t>(quad[order[i]])];
        both.quads.push_back(turned);
    }
    return both;
}

inline std::vector<double> lumped_areas(const ShellMesh& mesh) {
    std::vector<double> areas(mesh.nodes.size(), 0.0);
    const double far = std::sqrt(0.6);
    for (const Quad& quad : mesh.quads) {
        std::array<double, 8> shares{};
        double area = 0, sum = 0;
        for (const auto& [r, r_weight] : {std::pair(-far, 5.0 / 9), {0.0, 8.0 / 9}, {far, 5.0 / 9}}) {
            for (const auto& [s, s_weight] : {std::pair(-far, 5.0 / 9), {0.0, 8.0 / 9}, {far, 5.0 / 9}}) {
                const detail::ShapeFunctions shape(r, s);
                Vector3 along_r = Vector3::Zero(), along_s = Vector3::Zero();
                for (std::size_t i = 0; i < 8; ++i) {
                    const Vector3& x = mesh.nodes[static_cast<std::size_t>(quad[i])];
                    along_r += shape.by_r[i] * x;
                    along_s += shape.by_s[i] * x;
                }
                const double weight = r_weight * s_weight * membrane::norm(membrane::cross<double>(along_r, along_s));
                area += weight;
                for (std::size_t i = 0; i < 8; ++i) shares[i] += weight * shape.value[i] * shape.value[i];
            }
        }
        for (const double share : shares) sum += share;
        for (std::size_t i = 0; i < 8; ++i) areas[static_cast<std::size_t>(quad[i])] += area * shares[i] / sum;
    }
    return areas;
}

}  // namespace bench
