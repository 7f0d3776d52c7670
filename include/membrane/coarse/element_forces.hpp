// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/core/lane_points.hpp>
#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/solve/packed_elements.hpp>
#include <membrane/tissue/elements.hpp>

/// The forces of a whole membrane, several elements at a time.
///
///     const auto kinds = membrane::element_forces(network, foundation);                 // offline
///     for (const auto& kind : kinds) kind->add_forces(x, forces);                       // [N]
namespace membrane {

/// All elements of one kind. Rows are padded points, one for each vertex and one more, which is read and written where
/// a lane has no element.
template <Real Scalar>
class ElementForces {
  public:
    using Rows = std::vector<PaddedPoint<Scalar>>;  ///< of all vertices

    ElementForces() = default;  ///< Without elements.
    ElementForces(const ElementForces&) = delete;
    ElementForces& operator=(const ElementForces&) = delete;
    virtual ~ElementForces() = default;  ///< Of any kind.

    /// Adds the forces of the elements at positions `x` [m] to those on their vertices [N]. Online.
    virtual void add_forces(const Rows& x, Rows& forces) const noexcept = 0;

    /// The sum of these forces times displacements of their vertices [J]. Online.
    [[nodiscard]] virtual Scalar work(const Rows& x, const Rows& displacements) const noexcept = 0;
};

namespace detail {

/// Elements of which several are evaluated at once. `Kind` names the number of their corners, and packs their
/// constants; its `for_each_force(constants, x, act)` calls `act(i, force)` for each corner.
template <Real Scalar, class Kind>
class ForcesInLanes final : public ElementForces<Scalar> {
  public:
    using typename ElementForces<Scalar>::Rows;

    /// Without elements, of a mesh of `vertex_count` vertices.
    ForcesInLanes(Kind kind, Index vertex_count) : kind_(std::move(kind)), spare_(begin_of_row(vertex_count)) {}

    /// Appends an element.
    void append(const typename Kind::Instance& instance) {
        if (count_ % lanes == 0) {
            packs_.emplace_back();
            for (auto& corner : packs_.back().corners) corner.fill(spare_);
        }
        const std::size_t lane = count_++ % lanes;
        kind_.set(packs_.back().constants, lane, instance);
        for (std::size_t i = 0; i < Kind::corner_count; ++i)
            packs_.back().corners[i][lane] = begin_of_row(instance.corners[i]);
    }

    void add_forces(const Rows& x, Rows& forces) const noexcept override {
        for_each_force(x, [&](const Begins& corners, const Vector3<Wide>& force) {
            for (std::size_t lane = 0; lane < lanes; ++lane) {  // two lanes may have the same vertex
                Scalar* sum = forces.front().number.data() + corners[lane];
                sum[0] += force.x()[lane], sum[1] += force.y()[lane], sum[2] += force.z()[lane];
            }
        });
    }

    [[nodiscard]] Scalar work(const Rows& x, const Rows& displacements) const noexcept override {
        Wide sum = 0;
        for_each_force(x, [&](const Begins& corners, const Vector3<Wide>& force) {
            sum += dot<Wide>(force, gather(displacements.data(), corners.data()));
        });
        Scalar all = 0;
        for (std::size_t lane = 0; lane < lanes; ++lane) all += sum[lane];
        return all;
    }

  private:
    using Wide = Lanes<Scalar>;
    static constexpr std::size_t lanes = Wide::count;
    using Begins = std::array<Index, lanes>;  // of the rows of a corner

    struct Pack {
        typename Kind::Constants constants{};
        std::array<Begins, Kind::corner_count> corners{};
    };

    template <class Act>
    void for_each_force(const Rows& x, const Act& act) const noexcept {
        for (const Pack& pack : packs_) {
            Corners<Wide, Kind::corner_count> corners;
            for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = gather(x.data(), pack.corners[i].data());
            kind_.for_each_force(pack.constants, corners,
                                 [&](std::size_t i, const Vector3<Wide>& force) { act(pack.corners[i], force); });
        }
    }

    Kind kind_;
    Index spare_;
    std::vector<Pack> packs_;
    std::size_t count_ = 0;
};

/// Springs of a law.
template <Real Scalar, class Law>
struct SpringKind {
    static constexpr std::size_t corner_count = 2;
    using Instance = ElementInstance<SpringElement<Scalar, Law>>;
    struct Constants {
        Lanes<Scalar> stiffness = 0, rest_length = 0;
    };

    static void set(Constants& constants, std::size_t lane, const Instance& spring) noexcept {
        constants.stiffness.set(lane, spring.element.stiffness);
        constants.rest_length.set(lane, spring.element.rest_length);
    }
    template <class Act>
    void for_each_force(const Constants& constants, const Corners<Lanes<Scalar>, 2>& x, const Act& act) const noexcept {
        const Vector3<Lanes<Scalar>> edge = x[1] - x[0];
        const auto force = spring_force<Lanes<Scalar>>(law, edge, constants.stiffness, constants.rest_length).force();
        act(0, force);
        act(1, Vector3<Lanes<Scalar>>(-force));
    }

    Law law;
};

/// Elements `E` of a tissue, in lanes.
template <Real Scalar, class E, bool in_lanes = Elements<Scalar, E>::in_lanes>
struct ElementKind {
    static constexpr std::size_t corner_count = E::corner_count;
    using Instance = ElementInstance<E>;
    using Constants = InLanes<E>;

    static void set(Constants& constants, std::size_t lane, const Instance& instance) noexcept {
        set_lane(constants, lane, instance.element);
    }
    template <class Act>
    static void for_each_force(const Constants& constants, const Corners<Lanes<Scalar>, corner_count>& x,
                               const Act& act) noexcept {
        for (std::size_t i = 0; i < corner_count; ++i) act(i, constants.force_on(x, i).force);
    }
};

/// Elements `E` of a tissue that do not take lanes.
template <Real Scalar, class E>
struct ElementKind<Scalar, E, false> {
    static constexpr std::size_t corner_count = E::corner_count;
    using Instance = ElementInstance<E>;
    using Constants = std::array<std::optional<E>, Lanes<Scalar>::count>;

    static void set(Constants& constants, std::size_t lane, const Instance& instance) {
        constants[lane] = instance.element;
    }
    template <class Act>
    static void for_each_force(const Constants& constants, const Corners<Lanes<Scalar>, corner_count>& x,
                               const Act& act) noexcept {
        LaneByLane<E, Scalar> all;
        for (std::size_t lane = 0; lane < constants.size(); ++lane) {
            if (constants[lane]) all.of_lane[lane] = &*constants[lane];
        }
        for (std::size_t i = 0; i < corner_count; ++i) act(i, all.force_on(x, i).force);
    }
};

/// A vertex on a foundation.
template <class Volume>
struct OnFoundation {
    std::array<Index, 1> corners;  ///< the vertex
    const Volume* foundation;      ///< must outlive this
};

/// The forces of a foundation without damping, in lanes.
template <Real Scalar, class Volume, bool in_lanes = SpringsInLanes<Volume, Scalar>>
struct FoundationKind {
    static constexpr std::size_t corner_count = 1;
    using Instance = OnFoundation<Volume>;
    using Constants = InLanes<SpringOf<Volume, Scalar>>;

    static void set(Constants& constants, std::size_t lane, const Instance& on) noexcept {
        set_lane(constants, lane, on.foundation->spring(on.corners[0], Vector3<Scalar>::Zero(), Scalar(1)));
    }
    template <class Act>
    static void for_each_force(const Constants& constants, const Corners<Lanes<Scalar>, 1>& x,
                               const Act& act) noexcept {
        act(0, constants.elastic_force(x[0]).force);
    }
};

/// The forces of a foundation that does not take lanes.
template <Real Scalar, class Volume>
struct FoundationKind<Scalar, Volume, false> {
    static constexpr std::size_t corner_count = 1;
    using Instance = OnFoundation<Volume>;
    struct Constants {
        const Volume* foundation = nullptr;
        std::array<Index, Lanes<Scalar>::count> vertex;
    };

    static void set(Constants& constants, std::size_t lane, const Instance& on) noexcept {
        if (!constants.foundation) constants.vertex.fill(no_index);
        constants.foundation = on.foundation;
        constants.vertex[lane] = on.corners[0];
    }
    template <class Act>
    static void for_each_force(const Constants& constants, const Corners<Lanes<Scalar>, 1>& x,
                               const Act& act) noexcept {
        Vector3<Lanes<Scalar>> all = Vector3<Lanes<Scalar>>::Zero();
        for (std::size_t lane = 0; lane < constants.vertex.size(); ++lane) {
            if (constants.vertex[lane] == no_index) continue;
            const auto here = lane_of<Vector3<Scalar>>(x[0], lane);
            set_lane(all, lane, constants.foundation->force_on(constants.vertex[lane], here, here, Scalar(1)).force);
        }
        act(0, all);
    }
};

}  // namespace detail

/// The forces of all kinds of elements of a network, and of the foundation, which must outlive the result unless its
/// springs take lanes. Offline. Cost: linear.
template <class Network, class Volume, Real Scalar = typename Network::Scalar>
[[nodiscard]] std::vector<std::unique_ptr<ElementForces<Scalar>>> element_forces(const Network& network,
                                                                                 const Volume& volume) {
    const Index vertex_count = network.vertex_count();
    std::vector<std::unique_ptr<ElementForces<Scalar>>> all;
    const auto add = [&]<class Kind>(const Kind& kind, const auto& for_each_instance) {
        auto forces = std::make_unique<detail::ForcesInLanes<Scalar, Kind>>(kind, vertex_count);
        for_each_instance([&](const auto& instance) { forces->append(instance); });
        all.push_back(std::move(forces));
    };
    const auto add_springs = [&](const auto& springs) {
        using Law = std::remove_cvref_t<decltype(springs.law())>;
        add(detail::SpringKind<Scalar, Law>{springs.law()}, [&](const auto& put) { springs.for_each_element(put); });
    };
    if constexpr (HasElements<Network>) {
        add_springs(network.springs());
        network.for_each_kind([&]<class E>(const Elements<Scalar, E>& elements) {
            add(detail::ElementKind<Scalar, E>(), [&](const auto& put) { elements.for_each_element(put); });
        });
    } else {
        add_springs(network);
    }
    if constexpr (!std::same_as<Volume, NoFoundation>) {
        add(detail::FoundationKind<Scalar, Volume>(), [&](const auto& put) {
            for (Index v = 0; v < vertex_count; ++v) put(detail::OnFoundation<Volume>{{v}, &volume});
        });
    }
    return all;
}

}  // namespace membrane
