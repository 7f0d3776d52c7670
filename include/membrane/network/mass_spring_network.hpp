// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

#include <membrane/core/compressed_rows.hpp>
#include <membrane/core/field.hpp>
#include <membrane/mesh/adjacency.hpp>
#include <membrane/mesh/triangle_mesh.hpp>
#include <membrane/network/elastic_network.hpp>
#include <membrane/network/spring_law.hpp>

/// The membrane as masses joined by springs, one along each edge of the mesh.
///
///     const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 3});
///     const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
///     const auto force = network.pull(v, x).force;                                          // [N]
namespace membrane {

/// Constants of a network. What is given for each spring stands in the order of `Adjacency::edges()`.
template <Real Scalar>
struct NetworkOptions {
    Field<Scalar> stiffness = {};    ///< k_ij [N/m], required; a spring of stiffness zero is left out
    Field<Scalar> mass = {};         ///< m_i [kg]; only (4) as published and explicit Euler need it
    Field<Scalar> viscosity = {};    ///< d_i [N s/m], zero if not given; only explicit Euler feels it
    Field<Scalar> rest_length = {};  ///< r_ij [m]; if not given, the lengths in the mesh
    std::vector<Index> pinned = {};  ///< vertices that never move: a clamped rim is `border(mesh)`
};
// For g++ 12, which otherwise breaks off over this type's initialiser inside another's.
static_assert(std::is_default_constructible_v<NetworkOptions<float>>);
static_assert(std::is_default_constructible_v<NetworkOptions<double>>);

/// One spring of the network.
template <Real Scalar>
struct Spring {
    Index first, second;
    Scalar stiffness;    ///< [N/m]
    Scalar rest_length;  ///< [m]
};

/// One spring as the vertex at one end sees it.
template <Real Scalar>
struct SpringEnd {
    Index other;
    Scalar stiffness;    ///< [N/m]
    Scalar rest_length;  ///< [m]
};

/// From the first end of a spring to the second [m].
template <Real Scalar, class Positions>
[[nodiscard]] Vector3<typename Positions::Scalar> reach_of(const Spring<Scalar>& spring, const Positions& x) noexcept {
    return point(x, spring.second) - point(x, spring.first);
}

/// What one spring does to the vertex at one end. One of length zero has no direction and no force: it curves the energy
/// alike in all directions.
template <Number Scalar>
struct SpringPull {
    Vector3<Scalar> reach;      ///< to the other end [m]
    Scalar length;              ///< [m]
    Scalar tension;             ///< [N]
    Scalar along, across;       ///< curvature of the energy along the spring, and at right angles to it [N/m]
    Vector3<Scalar> direction;  ///< to the other end, zero without a length
};

/// From the vertex at one end of a spring to the other, and how far that is. Of several springs, first all of these and
/// then the rest: a root and a division take long, and one need not wait for the other's.
template <Number Scalar>
struct SpringReach {
    Vector3<Scalar> reach;  ///< to the other end [m]
    Scalar length;          ///< [m]
    Scalar divisor;         ///< the same, 1 instead of 0 [m]
    Scalar per_length;      ///< [1/m]

    SpringReach() = default;
    [[gnu::always_inline]] explicit SpringReach(const Vector3<Scalar>& reach) noexcept
        : reach(reach), length(norm(reach)), divisor(select(length != 0, length, Scalar(1))), per_length(1 / divisor) {}
};

/// What a spring of this stiffness [N/m] and rest length [m] does to the vertex from which it reaches.
template <Number Scalar, class Law>
[[gnu::always_inline, nodiscard]] inline SpringPull<Scalar> pull_of(const Law& law, const SpringReach<Scalar>& to,
                                                                    const Scalar& stiffness,
                                                                    const Scalar& rest_length) noexcept {
    const auto has_length = to.length != 0;
    const auto answer = law(SpringState<Scalar>{stiffness, rest_length, to.divisor});
    return {to.reach,
            to.length,
            select(has_length, answer.tension, Scalar(0)),
            select(has_length, answer.stiffness, stiffness),
            select<Scalar>(has_length, answer.tension * to.per_length, stiffness),
            to.per_length * to.reach};
}
template <Number Scalar, class Law>
[[gnu::always_inline, nodiscard]] inline SpringPull<Scalar> pull_of(const Law& law, const Vector3<Scalar>& reach,
                                                                    const Scalar& stiffness,
                                                                    const Scalar& rest_length) noexcept {
    return pull_of(law, SpringReach<Scalar>(reach), stiffness, rest_length);
}

/// Adds a spring to what pulls on a vertex.
template <Number Scalar>
[[gnu::always_inline]] inline void add(Pull<Scalar>& sum, const SpringPull<Scalar>& spring) noexcept {
    sum.force += spring.across * spring.reach;
    sum.stiffness += larger(spring.along, spring.across);
}

/// The same for `CurvedPull`, in fewer operations: the relief as a sum of dyads, the size as a quotient.
template <Number Scalar>
struct CurvedSum {
    Vector3<Scalar> force = Vector3<Scalar>::Zero();  ///< [N]
    Scalar stiffness = 0;                             ///< [N/m]
    Symmetric3<Scalar> dyads;                         ///< of what the relief of each spring leaves out, along it [N/m]
    Scalar size_force = 1, size_stiffness = 0;        ///< the quotient is the smallest size [N], [N/m]

    [[gnu::always_inline, nodiscard]] CurvedPull<Scalar> total() const noexcept {
        CurvedPull<Scalar> sum{force, stiffness, diagonal3(dyads.trace())};
        sum.relief += Scalar(-1) * dyads;
        const auto has_size = size_stiffness > 0;
        sum.size = select(has_size, size_force / select(has_size, size_stiffness, Scalar(1)), sum.size);
        return sum;
    }
};
template <Number Scalar>
[[gnu::always_inline]] inline void add(CurvedSum<Scalar>& sum, const SpringPull<Scalar>& spring) noexcept {
    const Scalar stiffness = larger(spring.along, spring.across);
    const Scalar relief = smaller(stiffness - spring.across, stiffness);
    sum.force += spring.across * spring.reach;
    sum.stiffness += stiffness;
    sum.dyads += outer<Scalar>(larger(relief, Scalar(0)), spring.direction);
    const Scalar size_force = stiffness * spring.length + larger<Scalar>(-spring.tension, Scalar(0));
    const auto is_smaller = (relief > 0) & (size_force * sum.size_stiffness < sum.size_force * stiffness);
    sum.size_force = select(is_smaller, size_force, sum.size_force);
    sum.size_stiffness = select(is_smaller, stiffness, sum.size_stiffness);
}

/// Masses, viscosities, springs and pins of a membrane, [Liu07] 2.2 and (1): constant once built, no positions in it.
template <Real Scalar_, CheckedSpringLaw<Scalar_> Law>
class MassSpringNetwork {
  public:
    using Scalar = Scalar_;

    static constexpr bool never_stiffens = membrane::never_stiffens<Law>();

    /// @throws InvalidInput for a number that is negative, not finite, missing, or of the wrong count. Cost: O(V + F log F).
    MassSpringNetwork(const TriangleMesh<Scalar>& mesh, const Law& law, const NetworkOptions<Scalar>& options);

    [[nodiscard]] Index vertex_count() const noexcept { return ends_.row_count(); }
    [[nodiscard]] std::span<const Spring<Scalar>> springs() const noexcept { return springs_; }
    [[nodiscard]] const Law& law() const noexcept { return law_; }

    /// The springs of vertex `v`, by ascending vertex at the other end.
    [[nodiscard]] std::span<const SpringEnd<Scalar>> springs_of(Index v) const noexcept { return ends_[v]; }

    [[nodiscard]] std::span<const SpringEnd<Scalar>> neighbours(Index v) const noexcept { return ends_[v]; }

    [[nodiscard]] bool pinned(Index v) const noexcept { return pinned_[static_cast<std::size_t>(v)] != 0; }
    [[nodiscard]] bool has_masses() const noexcept { return !mass_.empty(); }
    [[nodiscard]] Scalar mass(Index v) const noexcept {
        return mass_[static_cast<std::size_t>(v)];
    }  ///< @pre has_masses()
    [[nodiscard]] Scalar viscosity(Index v) const noexcept {
        return viscosity_.empty() ? Scalar(0) : viscosity_[static_cast<std::size_t>(v)];
    }

    /// Calls `act(pull)` with the `SpringPull` of each spring of vertex `v` at positions `x`.
    template <class Act>
    void for_each_pull(Index v, const ConstPointsRef<Scalar>& x, Act act) const noexcept;

    /// Sum of the spring forces on vertex `v` at positions `x`.
    [[nodiscard]] Pull<Scalar> pull(Index v, const ConstPointsRef<Scalar>& x) const noexcept;

    /// The same, and a bound of the energy. A spring of stiffness k and tension T that is l long stores
    /// k (l' - r)^2 / 2 and a constant when it is l' long, r = l - T / k (or less, where it never stiffens): of
    /// k (l'^2 - 2 r l' + r^2) / 2 only the second term is no square of a distance. Let u be the direction away from the
    /// other end. A vertex that moves by a along u and by b across, no more than rho in all, makes
    /// l' = sqrt((l + a)^2 + b^2) >= l + a + b^2 / (2 (l + rho)). So the energy stays below one that curves by k along the
    /// spring and by k (1 - r / (l + rho)) across it. `relief` is the sum of k min(r / l, 1) (I - u u^T), `size` the
    /// smallest max(l, r): with these, relief / (1 + rho / size) is no more than the sum of k r / (l + rho) (I - u u^T).
    [[nodiscard]] CurvedPull<Scalar> curved_pull(Index v, const ConstPointsRef<Scalar>& x) const noexcept;

    /// Second derivative of the energy by the place of vertex `v` alone [N/m].
    [[nodiscard]] Symmetric3<Scalar> curvature(Index v, const ConstPointsRef<Scalar>& x) const noexcept;

    /// What moving vertex `v` by `way` [m] costs.
    [[nodiscard]] EnergyChange<Scalar> energy_change(Index v, const Vector3<Scalar>& way,
                                                     const ConstPointsRef<Scalar>& x) const noexcept;

    /// Tension of spring `s` [N].
    [[nodiscard]] Scalar tension(Index s, const ConstPointsRef<Scalar>& x) const noexcept {
        return response(springs_[static_cast<std::size_t>(s)], x).tension;
    }

    /// Energy stored in all springs [J]. Cost: O(springs).
    [[nodiscard]] Scalar energy(const ConstPointsRef<Scalar>& x) const noexcept;

    /// An unbalanced force that is nothing beside the others [N]: 1e-9 of the stiffest spring stretched by its own
    /// length, or what the spacing of numbers makes of it where that is more.
    [[nodiscard]] Scalar negligible_force() const noexcept { return negligible_force_; }

  private:
    [[nodiscard]] SpringResponse<Scalar> response(const Spring<Scalar>& s,
                                                  const ConstPointsRef<Scalar>& x) const noexcept {
        return law_(SpringState<Scalar>{s.stiffness, s.rest_length, norm(reach_of(s, x))});
    }
    void build_springs(const Adjacency& adjacency, const Points<Scalar>& x, const NetworkOptions<Scalar>& options);

    [[no_unique_address]] Law law_;
    std::vector<Spring<Scalar>> springs_;
    CompressedRows<SpringEnd<Scalar>> ends_;  // each spring twice
    std::vector<Scalar> mass_, viscosity_;
    std::vector<unsigned char> pinned_;
    Scalar negligible_force_ = 0;
};

template <Real Scalar, class Law>
MassSpringNetwork(const TriangleMesh<Scalar>&, const Law&, const NetworkOptions<Scalar>&)
    -> MassSpringNetwork<Scalar, Law>;

namespace detail {
inline constexpr std::string_view network_name = "MassSpringNetwork";
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
MassSpringNetwork<Scalar, Law>::MassSpringNetwork(const TriangleMesh<Scalar>& mesh, const Law& law,
                                                  const NetworkOptions<Scalar>& options)
    : law_(law) {
    if constexpr (requires { law_.check(); }) law_.check();
    const Index vertices = mesh.vertex_count();
    if (options.mass.given())
        mass_ = options.mass.expand(vertices, detail::network_name, "mass", "vertex", "kg", false);
    if (options.viscosity.given()) {
        viscosity_ = options.viscosity.expand(vertices, detail::network_name, "viscosity", "vertex", "N s/m");
    }
    pinned_.assign(static_cast<std::size_t>(vertices), 0);
    for (std::size_t i = 0; i < options.pinned.size(); ++i) {
        const Index v = options.pinned[i];
        if (v < 0 || v >= vertices) {
            refuse(detail::network_name, "pinned ", i, " names vertex ", v, ", expected 0 to ", vertices - 1);
        }
        pinned_[static_cast<std::size_t>(v)] = 1;
    }
    build_springs(Adjacency(mesh), mesh.positions(), options);
    ends_ = CompressedRows<SpringEnd<Scalar>>(vertices, [this](auto put) {
        for (const auto& s : springs_) {  // ascending, so each row is
            put(s.first, SpringEnd<Scalar>{s.second, s.stiffness, s.rest_length});
            put(s.second, SpringEnd<Scalar>{s.first, s.stiffness, s.rest_length});
        }
    });
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
void MassSpringNetwork<Scalar, Law>::build_springs(const Adjacency& adjacency, const Points<Scalar>& x,
                                                   const NetworkOptions<Scalar>& options) {
    const auto edges = adjacency.edges();
    const auto count = static_cast<Index>(edges.size());
    if (!options.stiffness.given()) refuse(detail::network_name, "stiffness of the springs [N/m] is required");
    const auto stiffness = options.stiffness.expand(count, detail::network_name, "stiffness", "spring", "N/m");
    std::vector<Scalar> rest(edges.size());
    if (options.rest_length.given()) {
        rest = options.rest_length.expand(count, detail::network_name, "rest length", "spring", "m");
    } else {
        for (std::size_t s = 0; s < edges.size(); ++s) {
            rest[s] = norm<Scalar>(point(x, edges[s][1]) - point(x, edges[s][0]));
        }
    }
    springs_.reserve(edges.size());
    for (std::size_t s = 0; s < edges.size(); ++s) {
        if (stiffness[s] > 0) springs_.push_back({edges[s][0], edges[s][1], stiffness[s], rest[s]});
    }
    const Scalar spacing = std::numeric_limits<Scalar>::epsilon() * x.cwiseAbs().maxCoeff();
    for (const auto& s : springs_) {
        const Scalar force = s.stiffness * (std::max)(s.rest_length / Scalar(1e9), 64 * spacing);
        negligible_force_ = (std::max)(negligible_force_, force);
    }
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
template <class Act>
void MassSpringNetwork<Scalar, Law>::for_each_pull(Index v, const ConstPointsRef<Scalar>& x, Act act) const noexcept {
    const Vector3<Scalar> here = point(x, v);
    for (const auto& end : springs_of(v)) {
        const Vector3<Scalar> reach = point(x, end.other) - here;
        act(pull_of<Scalar>(law_, reach, end.stiffness, end.rest_length));
    }
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
Pull<Scalar> MassSpringNetwork<Scalar, Law>::pull(Index v, const ConstPointsRef<Scalar>& x) const noexcept {
    Pull<Scalar> sum;
    for_each_pull(v, x, [&](const SpringPull<Scalar>& spring) { add(sum, spring); });
    return sum;
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
CurvedPull<Scalar> MassSpringNetwork<Scalar, Law>::curved_pull(Index v,
                                                               const ConstPointsRef<Scalar>& x) const noexcept {
    CurvedSum<Scalar> sum;
    for_each_pull(v, x, [&](const SpringPull<Scalar>& spring) { add(sum, spring); });
    return sum.total();
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
Symmetric3<Scalar> MassSpringNetwork<Scalar, Law>::curvature(Index v, const ConstPointsRef<Scalar>& x) const noexcept {
    Symmetric3<Scalar> block;
    for_each_pull(v, x, [&](const SpringPull<Scalar>& spring) {
        block += diagonal3(spring.across);
        block += outer<Scalar>(spring.along - spring.across, spring.direction);
    });
    return block;
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
EnergyChange<Scalar> MassSpringNetwork<Scalar, Law>::energy_change(Index v, const Vector3<Scalar>& way,
                                                                   const ConstPointsRef<Scalar>& x) const noexcept {
    const Vector3<Scalar> here = point(x, v);
    const Scalar far = here.cwiseAbs().maxCoeff();
    EnergyChange<Scalar> sum;
    for (const auto& end : springs_of(v)) {
        const auto response_at = [&](Scalar length) {
            return law_(SpringState<Scalar>{end.stiffness, end.rest_length, length});
        };
        const Vector3<Scalar> reach = point(x, end.other) - here;
        const Scalar length = norm(reach);
        const auto before = response_at(length), after = response_at(norm<Scalar>(reach - way));
        sum += {after.energy - before.energy, before.energy + std::abs(before.tension) * (length + far)};
    }
    return sum;
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
Scalar MassSpringNetwork<Scalar, Law>::energy(const ConstPointsRef<Scalar>& x) const noexcept {
    Scalar sum = 0;
    for (const auto& s : springs_) sum += response(s, x).energy;
    return sum;
}

}  // namespace membrane
