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

#include <membrane/core/fixed_vector.hpp>
#include <membrane/core/lane_points.hpp>
#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/solve/packed_elements.hpp>
#include <membrane/tissue/elements.hpp>

/// The forces of a whole membrane, and changes of its energy, several elements at a time.
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

    /// By how much the energy at positions `y` is larger than at `x` [J]; of a foundation by the mean of its forces,
    /// which is exact where it is linear. Online.
    [[nodiscard]] virtual Scalar energy_change(const Rows& x, const Rows& y) const noexcept = 0;

    /// Reads network and foundation again, which have changed: a tear, adhesion that fails. Online. Cost: about that of
    /// the forces.
    virtual void update() noexcept = 0;
};

namespace detail {

/// Elements of which several are evaluated at once. `Kind` names the number of their corners, and packs their
/// constants; its `for_each_force(constants, x, act)` calls `act(i, force)` for each corner, and its
/// `energy_change(constants, x, y)` is that of each lane. `source(put)` calls `put` for each element.
template <Real Scalar, class Kind, class Source>
class ForcesInLanes final : public ElementForces<Scalar> {
  public:
    using typename ElementForces<Scalar>::Rows;

    /// Of a mesh of `vertex_count` vertices, for at most `capacity` elements.
    ForcesInLanes(Kind kind, Source source, Index vertex_count, std::size_t capacity)
        : kind_(std::move(kind)),
          source_(std::move(source)),
          spare_(begin_of_row(vertex_count)),
          packs_((capacity + lanes - 1) / lanes) {
        ForcesInLanes::update();
    }

    void update() noexcept override {
        packs_.clear();
        Pack empty;
        for (auto& corner : empty.corners) corner.fill(spare_);
        std::size_t count = 0;
        source_([&](const typename Kind::Instance& instance) {
            const std::size_t lane = count++ % lanes;
            if (lane == 0) packs_.try_push_back(empty);
            Pack& pack = packs_.items().back();
            kind_.set(pack.constants, lane, instance);
            for (std::size_t i = 0; i < Kind::corner_count; ++i)
                pack.corners[i][lane] = begin_of_row(instance.corners[i]);
        });
    }

    void add_forces(const Rows& x, Rows& forces) const noexcept override {
        for (const Pack& pack : packs_.items()) {
            kind_.for_each_force(pack.constants, corners_of(pack, x), [&](std::size_t i, const Vector3<Wide>& force) {
                for (std::size_t lane = 0; lane < lanes; ++lane) {  // two lanes may have the same vertex
                    Scalar* sum = forces.front().number.data() + pack.corners[i][lane];
                    sum[0] += force.x()[lane], sum[1] += force.y()[lane], sum[2] += force.z()[lane];
                }
            });
        }
    }

    [[nodiscard]] Scalar energy_change(const Rows& x, const Rows& y) const noexcept override {
        Wide sum = 0;
        for (const Pack& pack : packs_.items())
            sum += kind_.energy_change(pack.constants, corners_of(pack, x), corners_of(pack, y));
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

    [[nodiscard]] static auto corners_of(const Pack& pack, const Rows& rows) noexcept {
        Corners<Wide, Kind::corner_count> corners;
        for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = gather(rows.data(), pack.corners[i].data());
        return corners;
    }

    Kind kind_;
    Source source_;
    Index spare_;
    FixedVector<Pack> packs_;
};

/// Springs of a law.
template <Real Scalar, class Law>
struct SpringKind {
    static constexpr std::size_t corner_count = 2;
    using Instance = ElementInstance<SpringElement<Scalar, Law>>;
    struct Constants {
        Lanes<Scalar> stiffness = 0, rest_length = 1;  // a law may divide by it
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
    [[nodiscard]] Lanes<Scalar> energy_change(const Constants& constants, const Corners<Lanes<Scalar>, 2>& x,
                                              const Corners<Lanes<Scalar>, 2>& y) const noexcept {
        const SpringElement<Lanes<Scalar>, Law> spring{&law, constants.stiffness, constants.rest_length};
        const Lanes<Scalar> before = norm<Lanes<Scalar>>(x[1] - x[0]), after = norm<Lanes<Scalar>>(y[1] - y[0]);
        return spring.response(after).energy - spring.response(before).energy;
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
    [[nodiscard]] static Lanes<Scalar> energy_change(const Constants& constants,
                                                     const Corners<Lanes<Scalar>, corner_count>& x,
                                                     const Corners<Lanes<Scalar>, corner_count>& y) noexcept {
        return constants.energy(y) - constants.energy(x);
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
        const auto all = lane_by_lane(constants);
        for (std::size_t i = 0; i < corner_count; ++i) act(i, all.force_on(x, i).force);
    }
    [[nodiscard]] static Lanes<Scalar> energy_change(const Constants& constants,
                                                     const Corners<Lanes<Scalar>, corner_count>& x,
                                                     const Corners<Lanes<Scalar>, corner_count>& y) noexcept {
        const auto all = lane_by_lane(constants);
        return all.energy(y) - all.energy(x);
    }

  private:
    [[nodiscard]] static auto lane_by_lane(const Constants& constants) noexcept {
        LaneByLane<E, Scalar> all;
        for (std::size_t lane = 0; lane < constants.size(); ++lane) {
            if (constants[lane]) all.of_lane[lane] = &*constants[lane];
        }
        return all;
    }
};

/// A vertex on a foundation.
template <class Volume>
struct OnFoundation {
    std::array<Index, 1> corners;  ///< the vertex
    const Volume* foundation;      ///< must outlive this; null: none
};

/// The forces of a foundation without damping, in lanes.
template <Real Scalar, class Volume, bool in_lanes = SpringsInLanes<Volume, Scalar>>
struct SpringsOfFoundation {
    using Constants = InLanes<SpringOf<Volume, Scalar>>;

    static void set(Constants& constants, std::size_t lane, const OnFoundation<Volume>& on) noexcept {
        set_lane(constants, lane, on.foundation->spring(on.corners[0], Vector3<Scalar>::Zero(), Scalar(1)));
    }
    [[nodiscard]] static auto force_on(const Constants& constants, const Vector3<Lanes<Scalar>>& x) noexcept {
        return constants.elastic_force(x).force;
    }
};

/// The forces of a foundation that does not take lanes.
template <Real Scalar, class Volume>
struct SpringsOfFoundation<Scalar, Volume, false> {
    using Constants = std::array<OnFoundation<Volume>, Lanes<Scalar>::count>;

    static void set(Constants& constants, std::size_t lane, const OnFoundation<Volume>& on) noexcept {
        constants[lane] = on;
    }
    [[nodiscard]] static auto force_on(const Constants& constants, const Vector3<Lanes<Scalar>>& x) noexcept {
        Vector3<Lanes<Scalar>> all = Vector3<Lanes<Scalar>>::Zero();
        for (std::size_t lane = 0; lane < constants.size(); ++lane) {
            const OnFoundation<Volume>& on = constants[lane];
            if (!on.foundation) continue;
            const auto here = lane_of<Vector3<Scalar>>(x, lane);
            set_lane(all, lane, on.foundation->force_on(on.corners[0], here, here, Scalar(1)).force);
        }
        return all;
    }
};

/// Vertices on a foundation.
template <Real Scalar, class Volume>
struct FoundationKind : SpringsOfFoundation<Scalar, Volume> {
    static constexpr std::size_t corner_count = 1;
    using Instance = OnFoundation<Volume>;
    using typename SpringsOfFoundation<Scalar, Volume>::Constants;
    using Wide = Lanes<Scalar>;

    template <class Act>
    static void for_each_force(const Constants& constants, const Corners<Wide, 1>& x, const Act& act) noexcept {
        act(0, FoundationKind::force_on(constants, x[0]));
    }
    [[nodiscard]] static Wide energy_change(const Constants& constants, const Corners<Wide, 1>& x,
                                            const Corners<Wide, 1>& y) noexcept {
        const Vector3<Wide> both =
            FoundationKind::force_on(constants, x[0]) + FoundationKind::force_on(constants, y[0]);
        return -dot<Wide>(both, y[0] - x[0]) / Wide(2);
    }
};

}  // namespace detail

/// The forces of all kinds of elements of a network, and of the foundation. Both must outlive the result, at their
/// place, if `update` is called; else a foundation whose springs do not take lanes. Offline. Cost: linear.
template <class Network, class Volume, Real Scalar = typename Network::Scalar>
[[nodiscard]] std::vector<std::unique_ptr<ElementForces<Scalar>>> element_forces(const Network& network,
                                                                                 const Volume& volume) {
    const Index vertex_count = network.vertex_count();
    std::vector<std::unique_ptr<ElementForces<Scalar>>> all;
    const auto add = [&]<class Kind, class Source>(const Kind& kind, std::size_t capacity, const Source& source) {
        all.push_back(
            std::make_unique<detail::ForcesInLanes<Scalar, Kind, Source>>(kind, source, vertex_count, capacity));
    };
    const auto add_springs = [&](const auto& springs) {
        using Law = std::remove_cvref_t<decltype(springs.law())>;
        add(detail::SpringKind<Scalar, Law>{springs.law()}, springs.spring_capacity(),
            [&springs](const auto& put) { springs.for_each_element(put); });
    };
    if constexpr (HasElements<Network>) {
        add_springs(network.springs());
        network.for_each_kind([&]<class E>(const Elements<Scalar, E>& elements) {
            add(detail::ElementKind<Scalar, E>(), elements.all().size(),
                [&elements](const auto& put) { elements.for_each_element(put); });
        });
    } else {
        add_springs(network);
    }
    if constexpr (!std::same_as<Volume, NoFoundation>) {
        add(detail::FoundationKind<Scalar, Volume>(), static_cast<std::size_t>(vertex_count),
            [&volume, vertex_count](const auto& put) {
                for (Index v = 0; v < vertex_count; ++v) put(detail::OnFoundation<Volume>{{v}, &volume});
            });
    }
    return all;
}

}  // namespace membrane
