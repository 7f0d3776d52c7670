// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/compressed_rows.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/model/element.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/vertex_split.hpp>

/// Elements of any number of vertices: triangles that resist stretch, hinges, pressure, loads.
///
///     const auto triangles = membrane::triangular_springs(mesh, material);
///     const auto tissue = membrane::Tissue(springs, triangles, membrane::pressure(mesh, 2000.0));
namespace membrane {

namespace detail {

/// The pairs of corners that edges of the mesh join.
template <class E>
[[nodiscard]] constexpr auto edges_of() noexcept {
    if constexpr (requires { E::edges; }) {
        return E::edges;
    } else {
        constexpr std::size_t n = E::corner_count;
        std::array<std::array<std::size_t, 2>, n*(n - 1) / 2> all{};
        for (std::size_t j = 1, k = 0; j < n; ++j) {
            for (std::size_t i = 0; i < j; ++i) all[k++] = {i, j};
        }
        return all;
    }
}

/// The triples of corners that are triangles of the mesh.
template <class E>
[[nodiscard]] constexpr auto triangles_of() noexcept {
    if constexpr (requires { E::triangles; }) {
        return E::triangles;
    } else {
        static_assert(E::corner_count == 3, "an element that is no triangle must name its triangles, to tear");
        return std::array<std::array<std::size_t, 3>, 1>{{{0, 1, 2}}};
    }
}

/// A triangle of a material, whose constants depend on its shape at rest.
template <class E, class Scalar>
concept CanReshape = E::corner_count == 3 && requires(const E& element, const Corners<Scalar, 3>& corners) {
    { element.reshaped(corners, corners) }
    noexcept->std::same_as<E>;
};

/// The order of corners in which an element is evaluated at corner `i`.
template <class E>
[[nodiscard]] constexpr std::array<std::size_t, E::corner_count> order_at(std::size_t i) noexcept {
    if constexpr (requires { E::orders; }) {
        return E::orders[i];
    } else {
        std::array<std::size_t, E::corner_count> order{};
        for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
        return order;
    }
}

/// The place of corner `i` in that order.
template <class E>
[[nodiscard]] constexpr std::size_t place_of(std::size_t i) noexcept {
    const auto order = order_at<E>(i);
    return static_cast<std::size_t>(std::find(order.begin(), order.end(), i) - order.begin());
}

/// `instance` with its corners in the order of corner `i`.
template <class E>
[[nodiscard]] ElementInstance<E> in_order_of(const ElementInstance<E>& instance, std::size_t i) noexcept {
    ElementInstance<E> ordered = instance;
    if constexpr (requires { instance.element.in_order(i); }) {
        const auto order = order_at<E>(i);
        for (std::size_t k = 0; k < order.size(); ++k) ordered.corners[k] = instance.corners[order[k]];
        ordered.element = instance.element.in_order(i);
    }
    return ordered;
}

}  // namespace detail

/// Whether an element can be evaluated in lanes, see `Element`.
template <class E, class Scalar>
concept ElementInLanes = StructOfNumbers<E> &&
    requires(const InLanes<E>& element, const Corners<Lanes<Scalar>, E::corner_count>& x, std::size_t i) {
    { element.force_on(x, i) } -> std::same_as<CornerForce<Lanes<Scalar>>>;
    { element.energy(x) } -> std::same_as<Lanes<Scalar>>;
    { element.energy_change(x, i, x[i]) } -> std::same_as<EnergyChange<Lanes<Scalar>>>;
};

/// An element a lane, of a kind that does not take `Lanes`: evaluated one after the other.
template <class E, Real Scalar>
struct LaneByLane {
    std::array<const E*, Lanes<Scalar>::count> of_lane{};  ///< null: none

    ///@{
    /// As of one element; zero in lanes without one.
    [[nodiscard]] CornerForce<Lanes<Scalar>> force_on(const Corners<Lanes<Scalar>, E::corner_count>& x,
                                                      std::size_t i) const noexcept {
        CornerForce<Lanes<Scalar>> all;
        for (std::size_t lane = 0; lane < of_lane.size(); ++lane) {
            const auto one = of_lane[lane] ? of_lane[lane]->force_on(corners_of(x, lane), i) : none();
            set_lane(all, lane, CornerForce<Scalar>(one));
        }
        return all;
    }
    [[nodiscard]] Lanes<Scalar> energy(const Corners<Lanes<Scalar>, E::corner_count>& x) const noexcept {
        Lanes<Scalar> all = 0;
        for (std::size_t lane = 0; lane < of_lane.size(); ++lane) {
            if (of_lane[lane]) all.set(lane, static_cast<Scalar>(of_lane[lane]->energy(corners_of<double>(x, lane))));
        }
        return all;
    }
    [[nodiscard]] EnergyChange<Lanes<Scalar>> energy_change(const Corners<Lanes<Scalar>, E::corner_count>& x,
                                                            std::size_t i,
                                                            const Vector3<Lanes<Scalar>>& displacement) const noexcept {
        EnergyChange<Lanes<Scalar>> all;
        for (std::size_t lane = 0; lane < of_lane.size(); ++lane) {
            if (!of_lane[lane]) continue;
            const auto by = lane_of<Vector3<Scalar>>(displacement, lane);
            set_lane(all, lane, EnergyChange<Scalar>(of_lane[lane]->energy_change(corners_of(x, lane), i, by)));
        }
        return all;
    }
    ///@}

  private:
    [[nodiscard]] static CornerForce<Scalar> none() noexcept { return {.remainder = {}}; }
    template <Real N = Scalar>
    [[nodiscard]] static auto corners_of(const Corners<Lanes<Scalar>, E::corner_count>& x, std::size_t lane) noexcept {
        Corners<N, E::corner_count> corners;
        for (std::size_t k = 0; k < corners.size(); ++k)
            corners[k] = lane_of<Vector3<Scalar>>(x[k], lane).template cast<N>();
        return corners;
    }
};

/// Elements of one kind, each with its vertices. Constant until the membrane tears; holds no positions.
template <Real Scalar_, CheckedElement Each>
class Elements {
  public:
    using Scalar = Scalar_;                                          ///< of the constants and forces
    static constexpr std::size_t corner_count = Each::corner_count;  ///< vertices of one element
    using Instance = ElementInstance<Each>;                          ///< one element with its vertices
    static constexpr bool in_lanes = ElementInLanes<Each, Scalar>;   ///< whether several are evaluated at once
    using OneByOne = LaneByLane<Each, Scalar>;                       ///< several of a kind that is not

    /// The elements `all` of `mesh`. @throws InvalidInput for a corner that is no vertex, or whose force or stiffness
    /// at rest is not finite: a triangle is too thin, or a constant too large, for the scalar. Cost: linear.
    Elements(const TriangleMesh<Scalar>& mesh, std::vector<Instance> all);

    /// Number of vertices of the mesh.
    [[nodiscard]] Index vertex_count() const noexcept { return at_vertex_.row_count(); }

    /// All elements, in the order in which they were given.
    [[nodiscard]] std::span<const Instance> all() const& noexcept { return all_; }
    [[nodiscard]] std::vector<Instance> all() && noexcept { return std::move(all_); }

    /// Whether a corner comes to this place.
    [[nodiscard]] static constexpr bool is_place(std::size_t place) noexcept {
        for (std::size_t i = 0; i < corner_count; ++i) {
            if (detail::place_of<Each>(i) == place) return true;
        }
        return false;
    }

    /// Calls `act(instance)` for each element.
    template <class Act>
    void for_each_element(Act act) const {
        for (const auto& instance : all_) act(instance);
    }

    /// An element as it is evaluated at one of its vertices.
    struct AtVertex {
        Instance instance;    ///< in the order of corners for this vertex
        std::uint32_t place;  ///< of the vertex among the corners
        Index number;         ///< of the element in `all`
    };

    ///@{
    /// The elements of vertex `v`, by their `place`; and those where it has one `place`.
    [[nodiscard]] std::span<const AtVertex> at(Index v) const& noexcept { return at_vertex_[v]; }
    void at(Index) && = delete;
    [[nodiscard]] std::span<const AtVertex> at(Index v, std::size_t place) const& noexcept {
        const auto all = at_vertex_[v];
        const auto first = std::find_if(all.begin(), all.end(), [&](const auto& at) { return at.place >= place; });
        const auto end = std::find_if(first, all.end(), [&](const auto& at) { return at.place > place; });
        return {first, end};
    }
    void at(Index, std::size_t) && = delete;
    ///@}

    /// Calls `act(instance, x, place)` for each element of vertex `v`: `x` are the positions of its corners, number
    /// `place` is `v`.
    template <class Act>
    void for_each(Index v, const ConstPointsRef<Scalar>& x, Act act) const noexcept {
        for (const auto& at : at_vertex_[v]) act(at.instance, at.instance.where(x), std::size_t{at.place});
    }

    /// Positions of the corners of an element.
    template <class Positions>
    [[nodiscard]] static auto where(const Instance& instance, const Positions& x) noexcept {
        return instance.where(x);
    }

    /// Adds the energy [J] of the element of a triangle, and its forces on the corners [N], at positions `x`.
    void add_response(const std::array<Index, 3>& corners, const ConstPointsRef<Scalar>& x,
                      TriangleResponse<Scalar>& sum) const noexcept;

    /// A vertex becomes two. An element keeps to its triangles; one of two triangles that part acts no more. Online.
    /// Cost: that of listing the elements around the vertex.
    void split(const VertexSplit& split) noexcept;

    /// Triangles change their shape at rest: their elements are `reshaped`, if they can be. Online.
    void reshape(const MovedVertex<Scalar>& moved) noexcept;

    /// See `MassSpringNetwork::force_tolerance`.
    [[nodiscard]] Scalar force_tolerance() const noexcept { return force_tolerance_; }

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.all_, self.at_vertex_);
    }

  private:
    [[nodiscard]] static bool add_element(const Instance& instance, const Points<Scalar>& x,
                                          detail::NegligibleForce<Scalar>& negligible);
    template <class Act>
    void for_each_copy(Index number, Act act) noexcept;
    [[nodiscard]] Index number_of(const std::array<Index, 3>& corners) const noexcept;

    std::vector<Instance> all_;
    CompressedRows<AtVertex> at_vertex_;
    Scalar force_tolerance_ = 0;
};

template <Real Scalar, CheckedElement Each>
Elements<Scalar, Each>::Elements(const TriangleMesh<Scalar>& mesh, std::vector<Instance> all) : all_(std::move(all)) {
    detail::NegligibleForce<Scalar> negligible(mesh.positions());
    for (std::size_t i = 0; i < all_.size(); ++i) {
        for (const Index v : all_[i].corners) {
            if (v >= 0 && v < mesh.vertex_count()) continue;
            refuse("Elements", "element ", i, " names vertex ", v, ", expected 0 to ", mesh.vertex_count() - 1);
        }
        if (!add_element(all_[i], mesh.positions(), negligible)) {
            refuse("Elements", "element ", i, " at vertex ", all_[i].corners[0],
                   " must pull with a finite force and stiffness at rest: its triangle is too thin, or a constant too "
                   "large");
        }
    }
    force_tolerance_ = negligible.force;
    at_vertex_ = CompressedRows<AtVertex>(mesh.vertex_count(), [this](auto put) {
        for (std::size_t place = 0; place < corner_count; ++place) {
            for (std::size_t n = 0; n < all_.size(); ++n) {
                for (std::size_t i = 0; i < corner_count; ++i) {
                    if (detail::place_of<Each>(i) != place) continue;
                    put(all_[n].corners[i], AtVertex{detail::in_order_of(all_[n], i), static_cast<std::uint32_t>(place),
                                                     static_cast<Index>(n)});
                }
            }
        }
    });
}

// Calls `act(instance)` for the element, and as it is at each of its vertices.
template <Real Scalar, CheckedElement Each>
template <class Act>
void Elements<Scalar, Each>::for_each_copy(Index number, Act act) noexcept {
    Instance& instance = all_[static_cast<std::size_t>(number)];
    for (const Index v : instance.corners) {
        for (AtVertex& at : at_vertex_[v]) {
            if (at.number == number) act(at.instance);
        }
    }
    act(instance);
}

template <Real Scalar, CheckedElement Each>
void Elements<Scalar, Each>::split(const VertexSplit& split) noexcept {
    // How many of the element's triangles at the vertex get the copy, and how many there are.
    const auto count = [&](const Instance& instance) {
        std::array<int, 2> found{};
        for (const auto& triple : detail::triangles_of<Each>()) {
            std::array<Index, 3> others{};
            int at = 0;
            for (const std::size_t i : triple) {
                if (instance.corners[i] != split.vertex) others[static_cast<std::size_t>(at++)] = instance.corners[i];
            }
            if (at == 3) continue;
            found[0] += split.takes(others[0], others[1]) ? 1 : 0;
            ++found[1];
        }
        return found;
    };
    for (const AtVertex& at : at_vertex_[split.vertex]) {
        const auto [taken, all] = count(at.instance);
        if (taken == 0) continue;
        for_each_copy(at.number, [&, parts = taken != all](Instance& instance) {
            if (parts) {
                instance.element = Each{};
            } else {
                std::replace(instance.corners.begin(), instance.corners.end(), split.vertex, split.copy);
            }
        });
    }
    at_vertex_.split(split.vertex, split.copy, [&](const AtVertex& at) {
        const auto& corners = at.instance.corners;
        return std::find(corners.begin(), corners.end(), split.copy) != corners.end();
    });
}

template <Real Scalar, CheckedElement Each>
void Elements<Scalar, Each>::reshape([[maybe_unused]] const MovedVertex<Scalar>& moved) noexcept {
    if constexpr (detail::CanReshape<Each, Scalar>) {
        for (const auto& triangle : moved.triangles) {
            const auto number = number_of(triangle.corners);
            if (number == no_index) continue;
            for_each_copy(number, [&](Instance& instance) {
                Corners<Scalar, 3> before, after;
                for (std::size_t i = 0; i < 3; ++i) {
                    const auto k = static_cast<std::size_t>(
                        std::find(triangle.corners.begin(), triangle.corners.end(), instance.corners[i]) -
                        triangle.corners.begin());
                    before[i] = triangle.before[k];
                    after[i] = triangle.after[k];
                }
                instance.element = instance.element.reshaped(before, after);
            });
        }
    }
}

template <Real Scalar, CheckedElement Each>
void Elements<Scalar, Each>::add_response([[maybe_unused]] const std::array<Index, 3>& corners,
                                          [[maybe_unused]] const ConstPointsRef<Scalar>& x,
                                          [[maybe_unused]] TriangleResponse<Scalar>& sum) const noexcept {
    static_assert(
        detail::CanReshape<Each, Scalar> || Each::corner_count != 3 || requires { Each::is_load; },
        "an element of a membrane that tears must have reshaped(before, after), or is_load if its energy does "
        "not depend on the shape at rest");
    if constexpr (detail::CanReshape<Each, Scalar>) {
        const Index number = number_of(corners);
        if (number == no_index) return;
        const Instance& instance = all_[static_cast<std::size_t>(number)];
        const auto at = instance.where(x);
        sum.energy += instance.element.energy(at);
        for (std::size_t i = 0; i < 3; ++i) {
            const auto k = static_cast<std::size_t>(std::find(corners.begin(), corners.end(), instance.corners[i]) -
                                                    corners.begin());
            sum.force[k] += instance.element.force_on(at, i).force;
        }
    }
}

// The element of a triangle, or `no_index`.
template <Real Scalar, CheckedElement Each>
Index Elements<Scalar, Each>::number_of(const std::array<Index, 3>& corners) const noexcept {
    for (const AtVertex& at : at_vertex_[corners[0]]) {
        const auto& own = at.instance.corners;
        const auto has = [&](Index v) { return std::find(own.begin(), own.end(), v) != own.end(); };
        if (has(corners[1]) && has(corners[2])) return at.number;
    }
    return no_index;
}

// Adds the rounding errors of an element's forces; false if a force or stiffness is not finite.
template <Real Scalar, CheckedElement Each>
bool Elements<Scalar, Each>::add_element(const Instance& instance, const Points<Scalar>& x,
                                         detail::NegligibleForce<Scalar>& negligible) {
    const auto corners = instance.where(x);
    Scalar largest = 0, stiffness = 0, size = 0;
    for (std::size_t i = 0; i < corner_count; ++i) {
        const auto corner = instance.element.force_on(corners, i);
        if (!is_finite(corner.force) || !is_finite(corner.hessian.trace())) return false;
        stiffness = (std::max)(stiffness, corner.hessian.trace());
        size = (std::max)(size, norm<Scalar>(corners[i] - corners[0]));
        largest = (std::max)(largest, norm(corner.force));
    }
    for (const Index v : instance.corners) negligible.add(v, stiffness, size);
    negligible.force = (std::max)(negligible.force, 64 * std::numeric_limits<Scalar>::epsilon() * largest);
    return is_finite(negligible.force);
}

}  // namespace membrane
