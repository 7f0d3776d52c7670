// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/tissue/elements.hpp>

/// A network of springs and other elements.
///
///     const auto springs = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 0.0});   // none
///     const auto tissue = membrane::Tissue(springs, membrane::triangular_springs(mesh, material),
///                                          membrane::bending_springs(mesh, membrane::flexural_rigidity(material)));
///     auto solver = membrane::QuasiStaticSolver(tissue, {.layers = 8});
///     const auto report = solver.step(x, dt, tissue, foundation, press(tool, contact));
namespace membrane {

/// Springs and elements of one membrane, an `ElasticNetwork`; masses, viscosities and pins are the springs'. Cost: that
/// of its kinds of elements. Without elements a `MassSpringNetwork` alone is faster: non-stiffening springs need no
/// line search.
template <class Springs, class... Kinds>
class Tissue {
  public:
    using Scalar = typename Springs::Scalar;       ///< that of the springs
    static constexpr bool never_stiffens = false;  ///< elements may stiffen: updates need a line search
    static constexpr bool bounds_energy =
        Springs::never_stiffens;  ///< `EnergyMajoriser` is a bound as far as its remainder is known

    /// Keeps copies. @throws InvalidInput for elements of another mesh than the springs'. Linear.
    explicit Tissue(const Springs& springs, const Kinds&... kinds);

    /// The springs, without the elements.
    [[nodiscard]] const Springs& springs() const& noexcept { return springs_; }
    [[nodiscard]] Springs springs() && noexcept { return std::move(springs_); }

    ///@{
    /// As of the springs.
    [[nodiscard]] const auto& law() const& noexcept { return springs_.law(); }
    void law() && = delete;
    [[nodiscard]] auto springs_of(Index v) const noexcept { return springs_.springs_of(v); }
    ///@}

    /// Calls `act(elements)` for each kind.
    template <class Act>
    void for_each_kind(Act act) const {
        std::apply([&](const auto&... kinds) { (act(kinds), ...); }, kinds_);
    }

    /// Calls `act(instance)` for each spring and each element: `ElementInstance`.
    template <class Act>
    void for_each_element(Act act) const {
        springs_.for_each_element(act);
        for_each_kind([&](const auto& elements) { elements.for_each_element(act); });
    }

    /// A vertex whose position changes the force on another.
    struct Neighbour {
        Index other;  ///< the other vertex
    };

    /// The neighbours of vertex `v` that a spring or an edge of an element joins to it.
    [[nodiscard]] std::span<const Neighbour> joined(Index v) const& noexcept { return joined_[v]; }
    void joined(Index) && = delete;

    ///@{
    /// Masses, viscosities and pins are those of the springs. The tolerance is the largest of springs and elements.
    [[nodiscard]] std::span<const Neighbour> neighbours(Index v) const& noexcept { return neighbours_[v]; }
    void neighbours(Index) && = delete;
    [[nodiscard]] Index vertex_count() const noexcept { return springs_.vertex_count(); }
    [[nodiscard]] bool pinned(Index v) const noexcept { return springs_.pinned(v); }
    [[nodiscard]] bool has_masses() const noexcept { return springs_.has_masses(); }
    [[nodiscard]] Scalar mass(Index v) const noexcept { return springs_.mass(v); }
    [[nodiscard]] Scalar viscosity(Index v) const noexcept { return springs_.viscosity(v); }
    [[nodiscard]] Scalar force_tolerance() const noexcept { return force_tolerance_; }
    ///@}

    ///@{
    /// Of `TearableSprings`: a vertex becomes two; a vertex moves at rest. Online. Cost: that of listing springs and
    /// elements around the vertex and its neighbours.
    void split(const VertexSplit& split) noexcept requires FollowsSplit<Springs>;
    void reshape(const MovedVertex<Scalar>& moved) noexcept requires FollowsSplit<Springs>;
    [[nodiscard]] Index splits() const noexcept requires FollowsSplit<Springs> { return springs_.splits(); }
    ///@}

    /// Of `TearableSprings`: the energy [J] of triangle `f` with these corners, and its forces on them [N]: of springs,
    /// and of elements of a material that are triangles.
    [[nodiscard]] TriangleResponse<Scalar> triangle_response(Index f, const std::array<Index, 3>& corners,
                                                             const ConstPointsRef<Scalar>& x) const noexcept requires
        FollowsSplit<Springs>;

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if constexpr (FollowsSplit<Springs>) {
            visit(self.springs_, self.neighbours_, self.joined_);
            std::apply([&](auto&... kinds) { visit(kinds...); }, self.kinds_);
        }
    }

    ///@{
    /// Sums over springs and elements at vertex `v`.
    [[nodiscard]] VertexForce<Scalar> force_on(Index v, const ConstPointsRef<Scalar>& x) const noexcept;
    [[nodiscard]] Symmetric3<Scalar> hessian(Index v, const ConstPointsRef<Scalar>& x) const noexcept;
    ///@}

  private:
    template <class Act>
    void for_each_corner_force(Index v, const ConstPointsRef<Scalar>& x, Act act) const noexcept {
        for_each_kind([&](const auto& elements) {
            elements.for_each(v, x, [&](const auto& instance, const auto& corners, std::size_t i) {
                act(instance.element.force_on(corners, i));
            });
        });
    }
    void join();
    [[nodiscard]] std::size_t capacity(Index v) const noexcept;
    void list_again(Index v) noexcept;

    Springs springs_;
    std::tuple<Kinds...> kinds_;
    CompressedRows<Neighbour> neighbours_, joined_;
    Scalar force_tolerance_;
};

template <class Springs, class... Kinds>
Tissue<Springs, Kinds...>::Tissue(const Springs& springs, const Kinds&... kinds)
    : springs_(springs), kinds_(kinds...), force_tolerance_(springs.force_tolerance()) {
    for_each_kind([&](const auto& elements) {
        if (elements.vertex_count() != vertex_count()) {
            refuse("Tissue", "elements must be of the springs' mesh of ", vertex_count(), " vertices, got one of ",
                   elements.vertex_count());
        }
        force_tolerance_ = (std::max)(force_tolerance_, elements.force_tolerance());
    });
    if constexpr (FollowsSplit<Springs>) {
        neighbours_ = joined_ = CompressedRows<Neighbour>(vertex_count(), [&](auto put) {
            for (Index v = 0; v < vertex_count(); ++v) {
                for (std::size_t i = capacity(v); i > 0; --i) put(v, Neighbour{});
            }
        });
        for (Index v = 0; v < vertex_count(); ++v) list_again(v);
    } else {
        join();
    }
}

template <class Springs, class... Kinds>
void Tissue<Springs, Kinds...>::join() {
    using Pairs = std::vector<std::pair<Index, Index>>;
    Pairs coupled, joined;
    for (Index v = 0; v < vertex_count(); ++v) {
        for (const auto& end : springs_.neighbours(v)) joined.emplace_back(v, end.other);
    }
    for_each_kind([&]<class E>(const Elements<Scalar, E>& elements) {
        for (const auto& instance : elements.all()) {
            for (const Index a : instance.corners) {
                for (const Index b : instance.corners) {
                    if (a != b) coupled.emplace_back(a, b);
                }
            }
            for (const auto& [i, j] : detail::edges_of<E>()) {
                joined.emplace_back(instance.corners[i], instance.corners[j]);
                joined.emplace_back(instance.corners[j], instance.corners[i]);
            }
        }
    });
    coupled.insert(coupled.end(), joined.begin(), joined.end());
    const auto rows = [&](Pairs& pairs) {
        std::sort(pairs.begin(), pairs.end());
        pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
        return CompressedRows<Neighbour>(vertex_count(), [&](auto put) {
            for (const auto& [v, other] : pairs) put(v, Neighbour{other});
        });
    };
    neighbours_ = rows(coupled);
    joined_ = rows(joined);
}

// For the neighbours of `v`, however its triangles part.
template <class Springs, class... Kinds>
std::size_t Tissue<Springs, Kinds...>::capacity(Index v) const noexcept {
    std::size_t sum = springs_.capacity(v);
    for_each_kind(
        [&]<class E>(const Elements<Scalar, E>& elements) { sum += elements.at(v).size() * (E::corner_count - 1); });
    return sum;
}

// Lists the neighbours of `v` by its springs and elements.
template <class Springs, class... Kinds>
void Tissue<Springs, Kinds...>::list_again(Index v) noexcept {
    const auto add = [v](CompressedRows<Neighbour>& rows, Index other) {
        const auto row = std::as_const(rows)[v];
        const auto is_other = [other](const Neighbour& neighbour) { return neighbour.other == other; };
        if (other != v && std::none_of(row.begin(), row.end(), is_other)) rows.append(v, {other});
    };
    neighbours_.truncate(v, 0);
    joined_.truncate(v, 0);
    for (const auto& end : springs_.springs_of(v)) {
        add(joined_, end.other);
        add(neighbours_, end.other);
    }
    for_each_kind([&]<class E>(const Elements<Scalar, E>& elements) {
        for (const auto& at : elements.at(v)) {
            const auto& corners = elements.all()[static_cast<std::size_t>(at.number)].corners;
            for (const Index other : corners) add(neighbours_, other);
            for (const auto& [i, j] : detail::edges_of<E>()) {
                if (corners[i] == v) add(joined_, corners[j]);
                if (corners[j] == v) add(joined_, corners[i]);
            }
        }
    });
}

template <class Springs, class... Kinds>
void Tissue<Springs, Kinds...>::split(const VertexSplit& split) noexcept requires FollowsSplit<Springs> {
    springs_.split(split);
    std::apply([&](auto&... kinds) { (kinds.split(split), ...); }, kinds_);
    for (const Neighbour& neighbour : std::as_const(neighbours_)[split.vertex]) list_again(neighbour.other);
    for (auto* rows : {&neighbours_, &joined_}) {
        rows->truncate(split.vertex, 0);
        rows->split(
            split.vertex, split.copy, [](const Neighbour&) { return true; }, capacity(split.vertex));
    }
    list_again(split.vertex);
    list_again(split.copy);
}

template <class Springs, class... Kinds>
void Tissue<Springs, Kinds...>::reshape(const MovedVertex<Scalar>& moved) noexcept requires FollowsSplit<Springs> {
    springs_.reshape(moved);
    std::apply([&](auto&... kinds) { (kinds.reshape(moved), ...); }, kinds_);
}

template <class Springs, class... Kinds>
auto Tissue<Springs, Kinds...>::triangle_response(Index f, const std::array<Index, 3>& corners,
                                                  const ConstPointsRef<Scalar>& x) const noexcept
    -> TriangleResponse<Scalar>
    requires FollowsSplit<Springs> {
        TriangleResponse<Scalar> sum = springs_.triangle_response(f, corners, x);
        for_each_kind([&](const auto& elements) { elements.add_response(corners, x, sum); });
        return sum;
    }

template <class Springs, class... Kinds>
auto Tissue<Springs, Kinds...>::force_on(Index v, const ConstPointsRef<Scalar>& x) const noexcept
    -> VertexForce<Scalar> {
    auto sum = springs_.force_on(v, x);
    for_each_corner_force(v, x, [&](const CornerForce<Scalar>& corner) {
        sum.force += corner.force;
        sum.stiffness += eigenvalue_bound(corner.hessian);
    });
    return sum;
}

template <class Springs, class... Kinds>
auto Tissue<Springs, Kinds...>::hessian(Index v, const ConstPointsRef<Scalar>& x) const noexcept -> Symmetric3<Scalar> {
    auto sum = springs_.hessian(v, x);
    for_each_corner_force(v, x, [&](const CornerForce<Scalar>& corner) { sum += corner.hessian; });
    return sum;
}

}  // namespace membrane
