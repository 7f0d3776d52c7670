// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/compressed_rows.hpp>
#include <membrane/core/in_lanes.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/model/elastic_network.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Elements of any number of vertices: triangles that resist stretch, hinges, pressure, loads.
///
///     const auto triangles = membrane::triangular_springs(mesh, material);
///     const auto tissue = membrane::Tissue(springs, triangles, membrane::pressure(mesh, 2000.0));
namespace membrane {

/// Force of an element on one of its corners, and the Hessian of its energy by that corner.
template <Number Scalar>
struct CornerForce {
    Vector3<Scalar> force = Vector3<Scalar>::Zero();  ///< [N]
    Symmetric3<Scalar> hessian = {};                  ///< of the energy by the corner, positive semidefinite [N/m]
    EnergyRemainder<Scalar> remainder{
        .per_range = std::numeric_limits<Each<Scalar>>::infinity()};  ///< of the energy beyond force and Hessian

    /// Adds those of another element at the same vertex.
    MEMBRANE_INLINE CornerForce& operator+=(const CornerForce& other) noexcept {
        force += other.force, hessian += other.hessian, remainder += other.remainder;
        return *this;
    }
};

/// Adds the elements at a vertex, with their Hessian at the present positions; the size is left as it is.
template <Number Scalar>
MEMBRANE_INLINE void add(EnergyMajoriser<Scalar>& sum, const CornerForce<Scalar>& elements) noexcept {
    const Scalar stiffness = eigenvalue_bound(elements.hessian);
    sum.force += elements.force;
    sum.stiffness += stiffness;
    sum.stiffness_reduction += diagonal3(stiffness);
    sum.stiffness_reduction += Scalar(-1) * elements.hessian;
    sum.remainder += elements.remainder;
}

/// Positions of an element's corners [m].
template <Number Scalar, std::size_t count>
using Corners = std::array<Vector3<Scalar>, count>;

/// One element with its constants, evaluated in float and in double. Beyond the signatures: force, Hessian and change
/// of energy belong to one energy; `hessian_block(x, i, j)` is its second derivative by corners i and j [N/m], or an
/// approximation with which Newton's method still converges.
///
/// Optional, where not all corners are joined by edges of the mesh:
/// - `E::edges`: the pairs of corners that are. A `PropagationQueue` counts its layers along edges.
///
/// Optional, for speed, and satisfied by the elements of this library:
/// - `CornerForce::remainder`: with it most updates need no evaluation of the energy.
/// - `E` is `E<Scalar>`, its members are `Scalar`s, and it takes `Lanes` as constants and as positions: several elements
///   of one kind at once, each with the same bits as alone. With all constants zero it has neither force nor energy, also
///   where all corners coincide: lanes without an element have such a one.
/// - `E::orders` and `in_order(i)`: in the order `orders[i]` of the corners, with the constants `in_order(i)`, the element
///   is the same. Corners that come to the same place are evaluated together.
template <class E>
concept Element = std::copyable<E> && requires(const E& element, const Corners<double, E::corner_count>& x,
                                               const Corners<float, E::corner_count>& y, std::size_t i) {
    { element.force_on(x, i) }
    noexcept->std::same_as<CornerForce<double>>;
    { element.force_on(y, i) }
    noexcept->std::same_as<CornerForce<float>>;
    { element.energy(x) }
    noexcept->std::same_as<double>;
    { element.energy_change(x, i, x[i]) }
    noexcept->std::same_as<EnergyChange<double>>;
    { element.energy_change(y, i, y[i]) }
    noexcept->std::same_as<EnergyChange<float>>;
    { element.hessian_block(x, i, i) } -> std::same_as<Eigen::Matrix3d>;
};

/// An element and its vertices.
template <class E>
struct ElementInstance {
    std::array<Index, E::corner_count> corners;  ///< vertices, in the order of the element
    E element;                                   ///< the constants

    /// Positions of its corners.
    template <class Positions>
    [[nodiscard]] Corners<typename Positions::Scalar, E::corner_count> where(const Positions& x) const noexcept {
        Corners<typename Positions::Scalar, E::corner_count> positions;
        for (std::size_t i = 0; i < positions.size(); ++i) positions[i] = point(x, corners[i]);
        return positions;
    }
};

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

/// Whether a corner comes to this place.
template <class E>
[[nodiscard]] constexpr bool is_place(std::size_t place) noexcept {
    for (std::size_t i = 0; i < E::corner_count; ++i) {
        if (place_of<E>(i) == place) return true;
    }
    return false;
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

template <class E>
consteval bool check_element() noexcept {  // NOLINT(readability-function-size): a sentence for each requirement
    static_assert(std::copyable<E>, "Element: must be copyable");
    static_assert(
        requires {
            requires E::corner_count >
            0;
        },
        "Element: must have static constexpr corner_count, the number of its corners");
    static_assert(
        requires(const E& element, const Corners<double, E::corner_count>& x, std::size_t i) {
            { element.force_on(x, i) }
            noexcept->std::same_as<CornerForce<double>>;
        },
        "Element: force_on(const Corners<double, corner_count>&, std::size_t) const noexcept must return "
        "CornerForce<double>");
    static_assert(
        requires(const E& element, const Corners<float, E::corner_count>& x, std::size_t i) {
            { element.force_on(x, i) }
            noexcept->std::same_as<CornerForce<float>>;
        },
        "Element: force_on(const Corners<float, corner_count>&, std::size_t) const noexcept must return "
        "CornerForce<float>");
    static_assert(
        requires(const E& element, const Corners<double, E::corner_count>& x, std::size_t i) {
            { element.energy(x) }
            noexcept->std::same_as<double>;
        },
        "Element: energy(const Corners<double, corner_count>&) const noexcept must return double");
    static_assert(
        requires(const E& element, const Corners<double, E::corner_count>& x, std::size_t i) {
            { element.energy_change(x, i, x[i]) }
            noexcept->std::same_as<EnergyChange<double>>;
        },
        "Element: energy_change(const Corners<double, corner_count>&, std::size_t, const Vector3<double>&) const "
        "noexcept must return EnergyChange<double>");
    static_assert(
        requires(const E& element, const Corners<float, E::corner_count>& x, std::size_t i) {
            { element.energy_change(x, i, x[i]) }
            noexcept->std::same_as<EnergyChange<float>>;
        },
        "Element: energy_change(const Corners<float, corner_count>&, std::size_t, const Vector3<float>&) const "
        "noexcept must return EnergyChange<float>");
    static_assert(
        requires(const E& element, const Corners<double, E::corner_count>& x, std::size_t i) {
            { element.hessian_block(x, i, i) } -> std::same_as<Eigen::Matrix3d>;
        },
        "Element: hessian_block(const Corners<double, corner_count>&, std::size_t, std::size_t) const must return "
        "Eigen::Matrix3d");
    return Element<E>;
}

}  // namespace detail

/// An `Element`: if a type does not satisfy it, the error names the missing requirement.
template <class E>
concept CheckedElement = detail::check_element<E>();

/// Whether an element can be evaluated in lanes, see `Element`.
template <class E, class Scalar>
concept ElementInLanes = StructOfNumbers<E> &&
    requires(const InLanes<E>& element, const Corners<Lanes<Scalar>, E::corner_count>& x, std::size_t i) {
    { element.force_on(x, i) } -> std::same_as<CornerForce<Lanes<Scalar>>>;
    { element.energy_change(x, i, x[i]) } -> std::same_as<EnergyChange<Lanes<Scalar>>>;
};

/// Elements of one kind, each with its vertices. Immutable; holds no positions.
template <Real Scalar_, CheckedElement Each>
class Elements {
  public:
    using Scalar = Scalar_;                                          ///< of the constants and forces
    static constexpr std::size_t corner_count = Each::corner_count;  ///< vertices of one element
    using Instance = ElementInstance<Each>;                          ///< one element with its vertices
    static constexpr bool in_lanes = ElementInLanes<Each, Scalar>;   ///< whether they can be evaluated in lanes

    /// The elements `all` of `mesh`. @throws InvalidInput for a corner that is no vertex, or whose force or stiffness
    /// at rest is not finite: a triangle is too thin, or a constant too large, for the scalar. Cost: linear.
    Elements(const TriangleMesh<Scalar>& mesh, std::vector<Instance> all);

    /// Number of vertices of the mesh.
    [[nodiscard]] Index vertex_count() const noexcept { return at_vertex_.row_count(); }

    /// All elements, in the order in which they were given.
    [[nodiscard]] std::span<const Instance> all() const noexcept { return all_; }

    /// Calls `act(instance)` for each element.
    template <class Act>
    void for_each_element(Act act) const {
        for (const auto& instance : all_) act(instance);
    }

    /// An element as it is evaluated at one of its vertices.
    struct AtVertex {
        Instance instance;  ///< in the order of corners for this vertex
        std::size_t place;  ///< of the vertex among the corners
    };

    ///@{
    /// The elements of vertex `v`, by their `place`; and those where it has one `place`.
    [[nodiscard]] std::span<const AtVertex> at(Index v) const noexcept { return at_vertex_[v]; }
    [[nodiscard]] std::span<const AtVertex> at(Index v, std::size_t place) const noexcept {
        const auto all = at_vertex_[v];
        const auto first = std::find_if(all.begin(), all.end(), [&](const auto& at) { return at.place >= place; });
        const auto end = std::find_if(first, all.end(), [&](const auto& at) { return at.place > place; });
        return {first, end};
    }
    ///@}

    /// Calls `act(instance, x, place)` for each element of vertex `v`: `x` are the positions of its corners, number
    /// `place` is `v`.
    template <class Act>
    void for_each(Index v, const ConstPointsRef<Scalar>& x, Act act) const noexcept {
        for (const auto& [instance, place] : at_vertex_[v]) act(instance, instance.where(x), place);
    }

    /// Positions of the corners of an element.
    template <class Positions>
    [[nodiscard]] static auto where(const Instance& instance, const Positions& x) noexcept {
        return instance.where(x);
    }

    /// See `MassSpringNetwork::force_tolerance`.
    [[nodiscard]] Scalar force_tolerance() const noexcept { return force_tolerance_; }

  private:
    [[nodiscard]] Scalar force_tolerance_of(const Instance& instance, const Points<Scalar>& x) const noexcept;

    std::vector<Instance> all_;
    CompressedRows<AtVertex> at_vertex_;
    Scalar force_tolerance_ = 0;
};

template <Real Scalar, CheckedElement Each>
Elements<Scalar, Each>::Elements(const TriangleMesh<Scalar>& mesh, std::vector<Instance> all) : all_(std::move(all)) {
    for (std::size_t i = 0; i < all_.size(); ++i) {
        for (const Index v : all_[i].corners) {
            if (v >= 0 && v < mesh.vertex_count()) continue;
            refuse("Elements", "element ", i, " names vertex ", v, ", expected 0 to ", mesh.vertex_count() - 1);
        }
        const Scalar negligible = force_tolerance_of(all_[i], mesh.positions());
        if (!is_finite(negligible)) {
            refuse("Elements", "element ", i, " at vertex ", all_[i].corners[0],
                   " must pull with a finite force and stiffness at rest: its triangle is too thin, or a constant too "
                   "large");
        }
        force_tolerance_ = (std::max)(force_tolerance_, negligible);
    }
    at_vertex_ = CompressedRows<AtVertex>(mesh.vertex_count(), [this](auto put) {
        for (std::size_t place = 0; place < corner_count; ++place) {
            for (const auto& instance : all_) {
                for (std::size_t i = 0; i < corner_count; ++i) {
                    if (detail::place_of<Each>(i) != place) continue;
                    put(instance.corners[i], AtVertex{detail::in_order_of(instance, i), place});
                }
            }
        }
    });
}

template <Real Scalar, CheckedElement Each>
Scalar Elements<Scalar, Each>::force_tolerance_of(const Instance& instance, const Points<Scalar>& x) const noexcept {
    const auto corners = instance.where(x);
    Scalar largest = 0, stiffness = 0, size = 0;
    for (std::size_t i = 0; i < corner_count; ++i) {
        const auto corner = instance.element.force_on(corners, i);
        if (!is_finite(corner.force) || !is_finite(corner.hessian.trace()))
            return std::numeric_limits<Scalar>::infinity();
        stiffness = (std::max)(stiffness, corner.hessian.trace());
        size = (std::max)(size, norm<Scalar>(corners[i] - corners[0]));
        largest = (std::max)(largest, norm(corner.force));
    }
    const Scalar epsilon = std::numeric_limits<Scalar>::epsilon(), far = x.cwiseAbs().maxCoeff();
    return (std::max)(stiffness * (std::max)(size / Scalar(1e9), 64 * epsilon * far), 64 * epsilon * largest);
}

}  // namespace membrane
