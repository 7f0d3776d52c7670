// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/contact/contact_tracker.hpp>

/// The force on an indenter at each depth, as a function of the membrane's constants: a `ForceModel` for `fit`.
///
///     const auto build = [&](std::span<const double> c) {
///         return std::pair(membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = c[0]}),
///                          membrane::VirtualVolumeSprings(mesh, {.stiffness = c[1]}));
///     };
///     const membrane::Tool<double> tip{.position = {0, 0, 0.015}, .radius = 1e-3};
///     const auto model = membrane::Indentation(mesh, tip, {0, 0, -1}, build);
///     const auto found = membrane::fit(table, {40.0, 8.0}, model);
namespace membrane {

/// Builds network and foundation from constants, as a std::pair.
template <class Build>
concept MembraneBuilder = requires(const Build& build, std::span<const double> constants) {
    std::declval<const std::remove_cvref_t<decltype(build(constants).first)>&>().springs();
    build(constants).second;
};

/// A tool that is pressed into a membrane along a line: quasi-static, with an equilibrium at each depth.
template <Real Scalar, MembraneBuilder Build>
class Indentation {
  public:
    /// `tool` starts outside and moves along `direction`, of any length. Depth is its displacement beyond first contact
    /// with the undeformed surface [m]. `tracker` are the options of its tracker. `mesh` must outlive this.
    /// @throws InvalidInput for a tool that is invalid, has no radius, does not start outside or misses the surface,
    /// for a direction that is zero or not finite, and for an option out of its range. Cost: about ten times O(F).
    Indentation(const TriangleMesh<Scalar>& mesh, const Tool<Scalar>& tool,
                const std::type_identity_t<Vector3<Scalar>>& direction, Build build,
                const TrackerOptions& tracker = {});

    /// Force of the membrane on the tool at each depth, against `direction` [N]; NaN from the first depth on at which
    /// no equilibrium was found. Depths may be in any order; each solution starts from that of the next smaller depth.
    /// @throws InvalidInput for a depth that is not finite and for arguments that `equilibrium` refuses; exceptions of
    /// `build`
    /// Cost: an `equilibrium` for each depth.
    [[nodiscard]] std::vector<double> operator()(std::span<const double> constants,
                                                 std::span<const double> depths) const;

    /// The tool at first contact.
    [[nodiscard]] Tool<Scalar> touching() const noexcept { return tool_; }

  private:
    const TriangleMesh<Scalar>* mesh_;
    Tool<Scalar> tool_;
    Vector3<Scalar> direction_;  // a unit vector
    Build build_;
    AabbTree<Scalar> tree_;
    ContactTracker<Scalar> tracker_;
};

namespace detail {

inline constexpr std::string_view indentation_name = "Indentation";

/// Distance from `tool` to first contact along `direction`, a unit vector; infinite if it misses. Sphere tracing: each
/// step is the present gap.
[[nodiscard]] inline double distance_to_touch(Tool<double> tool, const Vector3<double>& direction,
                                              const Triangles& triangles, const Points<double>& x) {
    const double max_displacement = norm<double>(tool.position - x.col(0)) + norm(tool.axis) +
                                    2 * norm<double>(x.rowwise().maxCoeff() - x.rowwise().minCoeff());
    const double negligible = 1e-12 * max_displacement;
    double sum = 0;
    for (int turn = 0; sum <= max_displacement && turn < 10000; ++turn) {
        double gap = std::numeric_limits<double>::infinity();
        for (const auto& corners : triangles.colwise()) {
            gap = (std::min)(gap, distance_from_axis(triangle_at(x, corners), tool) - tool.radius);
        }
        if (gap <= negligible) return sum;
        sum += gap;
        tool.position += gap * direction;
    }
    return std::numeric_limits<double>::infinity();
}

}  // namespace detail

template <Real Scalar, MembraneBuilder Build>
Indentation<Scalar, Build>::Indentation(const TriangleMesh<Scalar>& mesh, const Tool<Scalar>& tool,
                                        const std::type_identity_t<Vector3<Scalar>>& direction, Build build,
                                        const TrackerOptions& tracker)
    : mesh_(&mesh), tool_(tool), direction_(direction), build_(std::move(build)), tree_(mesh), tracker_(mesh, tracker) {
    constexpr auto name = detail::indentation_name;
    if (!is_valid(tool) || !(tool.radius > 0)) {
        refuse(name, "the tool must be finite and have a radius [m], got one that is not or has none");
    }
    if (!is_finite(direction) || !(norm(direction) > 0))
        refuse(name, "the direction must be finite and not zero, got one that is not");
    direction_ /= norm(direction);
    Tool<double> moving;
    moving.position = tool.position.template cast<double>();
    moving.axis = tool.axis.template cast<double>();
    moving.radius = tool.radius;
    const double distance = detail::distance_to_touch(moving, direction_.template cast<double>(), mesh.triangles(),
                                                      mesh.positions().template cast<double>());
    if (!(distance > 0)) refuse(name, "the tool must stand outside the surface, got one that touches it");
    if (!is_finite(distance))
        refuse(name, "the tool must meet the surface along its direction, got one that misses it");
    tool_.position += static_cast<Scalar>(distance) * direction_;
}

template <Real Scalar, MembraneBuilder Build>
std::vector<double> Indentation<Scalar, Build>::operator()(std::span<const double> constants,
                                                           std::span<const double> depths) const {
    for (std::size_t i = 0; i < depths.size(); ++i) {
        if (is_finite(depths[i])) continue;
        refuse(detail::indentation_name, "depth ", i, " must be finite [m], got ", depths[i]);
    }
    const auto [network, foundation] = build_(constants);
    auto tree = tree_;
    auto tracker = tracker_;
    Points<Scalar> x = mesh_->positions();
    std::vector<std::size_t> ascending(depths.size());
    std::iota(ascending.begin(), ascending.end(), std::size_t{0});
    std::sort(ascending.begin(), ascending.end(), [&](auto i, auto j) { return depths[i] < depths[j]; });
    std::vector<double> forces(depths.size(), std::numeric_limits<double>::quiet_NaN());
    for (const std::size_t i : ascending) {
        auto tool = tool_;
        tool.position += static_cast<Scalar>(depths[i]) * direction_;
        tree.refit(x);
        const auto contact = tracker.update(tree, x, tool);
        const auto rest = equilibrium(x, *mesh_, network, foundation, {}, press(tool, contact));
        if (!rest.converged) break;
        forces[i] = -dot<double>(rest.reactions[0], direction_.template cast<double>());
        x = rest.x.template cast<Scalar>();
    }
    return forces;
}

}  // namespace membrane
