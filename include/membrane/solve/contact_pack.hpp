// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <membrane/contact/contact_point.hpp>
#include <membrane/core/fixed_vector.hpp>
#include <membrane/core/lane_points.hpp>

/// Contact points in packs.
///
///     state.packs.append(points, 0, [&](membrane::Index v) { return context.fixed(v); });
///     for (auto& pack : state.packs.items()) { ... }
namespace membrane {

/// How a contact point follows the tool.
enum class ContactKind : unsigned char {
    end,    ///< the point of the triangle nearest to an end of the tool's axis
    plane,  ///< as `end`, but the normal is the triangle's, even if an edge or a corner is nearest
    edge,   ///< the point of the edge from corner 0 to corner 1 nearest to the axis
    fixed,  ///< weights and normal stay as they are through a step
    vertex  ///< corner 0; there are no others
};

/// The feature of a point whose weights and normal stay as they are.
inline constexpr int fixed_feature = -1;

/// Features have the numbers of the pairs of `closest_points`.
template <Real Scalar>
[[nodiscard]] constexpr ContactKind kind_of(const ContactPoint<Scalar>& point) noexcept {
    if (point.feature == fixed_feature) return ContactKind::fixed;
    if (point.feature == vertex_feature) return ContactKind::vertex;
    if (point.feature >= 2) return ContactKind::edge;
    return point.by_plane ? ContactKind::plane : ContactKind::end;
}

/// Number of corners that carry a point.
[[nodiscard]] constexpr std::size_t corner_count(ContactKind kind) noexcept {
    return kind == ContactKind::vertex ? 1 : 3;
}

inline namespace MEMBRANE_INSTRUCTION_SET {

/// Contact points of one kind, one for each lane, no two with a common corner: their forces, and their geometry at the
/// last `locate`. The memory layout is the same for every instruction set.
template <Real Scalar>
struct alignas(32) ContactPack {
    using Wide = Lanes<Scalar>;                        ///< a number for each point
    static constexpr std::size_t lanes = Wide::count;  ///< largest number of points

    /// Force and stiffness of the points on their corners.
    struct Load {
        ///@{
        /// Barycentric weights of the corners, and the unit normal.
        Vector3<Wide> weights, normal;
        ///@}
        Wide force;               ///< multiplier [N], 0 or more: -force normal acts on the membrane
        Vector3<Wide> stiffness;  ///< of each corner along the normal, as the triangle rocks [N/m]
    };

    Load load;      ///< by the last pass
    Load applied;   ///< included in the rows of forces
    Wide distance;  ///< of the tool's axis from the points, along their normals [m]
    Wide lift;      ///< least gap of the points, see `ContactVertices` [m]
    Wide wall;      ///< of vertices that carry the contact: how far along the normal they may go [m]
    Wide change;    ///< of the forces in the last pass [N]

    Vector3<Wide> free;  ///< 1 for a corner that may move
    Wide side;           ///< of the points, see `ContactPoint::side`
    Wide end;            ///< 0 or 1: which end of the tool's axis
    Wide listed;         ///< 1 for lanes in use
    Wide used;           ///< as `listed`, but 0 if an end of the tool's axis is nearest to an edge
    std::array<std::array<Index, lanes>, 3> corner;  ///< begins of the corners' rows
    std::array<Index, lanes> point;                  ///< number of the contact point in the step
    std::array<unsigned char, lanes> turn;           ///< number of the point's corner that is corner 0 here
    std::size_t size = 0;                            ///< lanes in use
    ContactKind kind = ContactKind::end;             ///< of all its points
    bool on_fixed = false;                           ///< whether a corner of a point is fixed or shared
    bool has_walls = false;                          ///< whether updates of its vertices find the forces
    bool has_sides = false;                          ///< whether the side of a point is known
    bool acts = true;  ///< whether a point pressed or penetrated in the last pass over all packs
};

/// Contact points in packs, for all constraints of a step. A point joins the first pack of its kind with a free lane
/// and none of its corners, a greedy colouring: so the points of one pack may be solved at once.
template <Real Scalar>
class ContactPacks {
  public:
    /// Allocates for `capacity` packs.
    ContactPacks(Index vertex_count, std::size_t capacity)
        : packs_(capacity),
          colours_(static_cast<std::size_t>(vertex_count), 0),
          unused_row_(begin_of_row(vertex_count)) {}

    /// Removes all packs.
    void clear() noexcept { packs_.clear(); }

    /// Number of packs.
    [[nodiscard]] std::size_t size() const noexcept { return packs_.size(); }

    ///@{
    /// All packs, valid until one is added.
    [[nodiscard]] std::span<ContactPack<Scalar>> items() noexcept { return packs_.items(); }
    [[nodiscard]] std::span<const ContactPack<Scalar>> items() const noexcept { return packs_.items(); }
    ///@}

    /// Appends packs of these points, whose forces are in the rows of forces; the first is number `first` of all. The
    /// capacity in packs is that in points. Cost: linear in the points.
    template <class IsFixed>
    void append(std::span<const ContactPoint<Scalar>> points, std::size_t first, IsFixed is_fixed) noexcept;

    /// Sets `on_fixed` of each pack by that of its points; `points` are all of the step.
    void set_on_fixed(std::span<const ContactPoint<Scalar>> points) noexcept;

    /// Brings weights, normal and force of `points`, all of the step, up to date with their packs. Cost: linear in the
    /// points.
    void unpack(std::span<ContactPoint<Scalar>> points) const noexcept;

  private:
    static constexpr std::size_t colour_count = 64;
    static constexpr std::size_t lanes = ContactPack<Scalar>::lanes;

    void begin_pack(ContactKind kind) noexcept;
    template <class IsFixed>
    static void add_lane(ContactPack<Scalar>& pack, const ContactPoint<Scalar>& point, Index number,
                         const IsFixed& is_fixed) noexcept;

    FixedVector<ContactPack<Scalar>> packs_;
    std::vector<std::uint64_t> colours_;  // of each vertex, the colours of its points as bits; zero between calls
    Index unused_row_;
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
void ContactPacks<Scalar>::begin_pack(ContactKind kind) noexcept {
    ContactPack<Scalar> pack;
    const Vector3<Lanes<Scalar>> none(0, 0, 0);
    pack.load = {{1, 0, 0}, none, 0, none};  // unused lanes have valid numbers
    pack.applied = {none, none, 0, none};
    pack.free = none;
    pack.distance = pack.lift = pack.wall = pack.change = pack.side = pack.end = pack.listed = pack.used = Scalar(0);
    for (auto& begins : pack.corner) begins.fill(unused_row_);
    pack.point.fill(no_index);
    pack.turn.fill(0);
    pack.kind = kind;
    packs_.try_push_back(pack);
}

template <Real Scalar>
template <class IsFixed>
void ContactPacks<Scalar>::add_lane(ContactPack<Scalar>& pack, const ContactPoint<Scalar>& point, Index number,
                                    const IsFixed& is_fixed) noexcept {
    const std::size_t i = pack.size++;
    const auto turn = static_cast<unsigned char>(pack.kind == ContactKind::edge ? point.feature - 2 : 0);
    for (std::size_t k = 0; k < corner_count(pack.kind); ++k) {
        const std::size_t corner = (k + turn) % 3;
        const auto row = static_cast<Eigen::Index>(k);
        pack.corner[k][i] = begin_of_row(point.corners[corner]);
        pack.load.weights[row].set(i, point.weights[static_cast<Eigen::Index>(corner)]);
        pack.free[row].set(i, is_fixed(point.corners[corner]) ? Scalar(0) : Scalar(1));
    }
    for (Eigen::Index k = 0; k < 3; ++k) pack.load.normal[k].set(i, point.normal[k]);
    pack.load.force.set(i, norm(point.force));
    pack.lift.set(i, point.lift);
    pack.end.set(i, point.feature == 1 ? Scalar(1) : Scalar(0));
    pack.side.set(i, point.side);
    pack.has_sides = pack.has_sides || point.side != 0;
    pack.listed.set(i, 1);
    pack.used.set(i, 1);
    pack.point[i] = number;
    pack.turn[i] = turn;
    pack.on_fixed = pack.on_fixed || point.on_fixed;
    pack.applied = pack.load;
}

template <Real Scalar>
template <class IsFixed>
void ContactPacks<Scalar>::append(std::span<const ContactPoint<Scalar>> points, std::size_t first,
                                  IsFixed is_fixed) noexcept {
    constexpr auto none = static_cast<std::size_t>(-1);
    std::array<std::array<std::size_t, colour_count>, 5> open;  // of each kind and colour, the pack with a free lane
    for (auto& of_kind : open) of_kind.fill(none);
    const auto colours = [this](Index v) -> std::uint64_t& { return colours_[static_cast<std::size_t>(v)]; };
    const auto add = [&](const ContactPoint<Scalar>& point) {
        const ContactKind kind = kind_of(point);
        // If the points of a vertex have all colours, each further point gets a pack of its own.
        std::uint64_t taken = 0;
        for (const Index v : point.vertices()) taken |= colours(v);
        const auto colour = static_cast<std::size_t>(std::countr_one(taken));
        std::size_t at = colour < colour_count ? open[static_cast<std::size_t>(kind)][colour] : none;
        if (at == none || packs_[at].size == lanes) {
            at = packs_.size();
            begin_pack(kind);
            if (colour < colour_count) open[static_cast<std::size_t>(kind)][colour] = at;
        }
        const auto number = first + static_cast<std::size_t>(&point - points.data());
        add_lane(packs_.items()[at], point, static_cast<Index>(number), is_fixed);
        for (const Index corner : point.vertices()) {
            if (colour < colour_count) colours(corner) |= std::uint64_t{1} << colour;
        }
    };
    // Pressing points first: in packs of their own, points that are only near cost less.
    const auto presses = [](const ContactPoint<Scalar>& point) { return !(point.force == Vector3<Scalar>::Zero()); };
    for (const auto& point : points) {
        if (presses(point)) add(point);
    }
    for (auto& of_kind : open) of_kind.fill(none);
    for (const auto& point : points) {
        if (!presses(point)) add(point);
    }
    for (const auto& point : points) {
        for (const Index v : point.vertices()) colours(v) = 0;
    }
}

template <Real Scalar>
void ContactPacks<Scalar>::set_on_fixed(std::span<const ContactPoint<Scalar>> points) noexcept {
    for (auto& pack : items()) {
        const auto members = std::span(pack.point).first(pack.size);
        const auto is_on_fixed = [&](Index i) { return points[static_cast<std::size_t>(i)].on_fixed; };
        if (pack.on_fixed || std::none_of(members.begin(), members.end(), is_on_fixed)) continue;
        pack.on_fixed = true;
        // What has been added along the normal stays until the step ends.
        pack.applied.stiffness = Vector3<Lanes<Scalar>>(0, 0, 0);
    }
}

template <Real Scalar>
void ContactPacks<Scalar>::unpack(std::span<ContactPoint<Scalar>> points) const noexcept {
    for (const auto& pack : items()) {
        for (std::size_t i = 0; i < pack.size; ++i) {
            auto& point = points[static_cast<std::size_t>(pack.point[i])];
            for (std::size_t k = 0; k < 3; ++k) {
                const auto row = static_cast<Eigen::Index>(k);
                point.weights[static_cast<Eigen::Index>((k + pack.turn[i]) % 3)] = pack.load.weights[row][i];
                point.normal[row] = pack.load.normal[row][i];
            }
            point.force = -pack.load.force[i] * point.normal;
        }
    }
}

}  // namespace membrane
