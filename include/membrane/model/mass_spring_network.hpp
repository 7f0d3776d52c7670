// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/core/compressed_rows.hpp>
#include <membrane/core/field.hpp>
#include <membrane/core/fixed_vector.hpp>
#include <membrane/model/elastic_network.hpp>
#include <membrane/model/element.hpp>
#include <membrane/model/spring_law.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// The membrane as masses joined by springs, one along each edge of the mesh.
///
///     const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 3});
///     const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
///     const auto force = network.force_on(v, x).force;                                          // [N]
namespace membrane {

/// Constants of a network. Values for each spring are in the order of `Adjacency::edges()`.
template <Real Scalar>
struct NetworkOptions {
    Field<Scalar> stiffness = {};    ///< k_ij [N/m], required; a spring of stiffness zero is left out
    Field<Scalar> mass = {};         ///< m_i [kg]; only (4) as published and explicit Euler need it
    Field<Scalar> viscosity = {};    ///< d_i [N s/m], zero if not given; only explicit Euler uses it
    Field<Scalar> rest_length = {};  ///< r_ij [m]; if not given, the lengths in the mesh
    std::vector<Index> pinned = {};  ///< vertices that never move: a clamped rim is `border(mesh)`
};
// For g++ 12, which otherwise fails on this type's initialiser inside another's.
static_assert(std::is_default_constructible_v<NetworkOptions<float>>);
static_assert(std::is_default_constructible_v<NetworkOptions<double>>);

/// One spring of the network.
template <Real Scalar>
struct Spring {
    ///@{
    /// Vertices at its ends.
    Index first, second;
    ///@}

    Scalar stiffness;    ///< [N/m]
    Scalar rest_length;  ///< [m]
};

/// One spring, from the vertex at one end.
template <Real Scalar>
struct SpringEnd {
    Index other;         ///< vertex at the other end
    Scalar stiffness;    ///< [N/m]
    Scalar rest_length;  ///< [m]
};

/// The vector from the first end of a spring to the second [m].
template <Real Scalar, class Positions>
[[nodiscard]] Vector3<typename Positions::Scalar> edge_vector(const Spring<Scalar>& spring,
                                                              const Positions& x) noexcept {
    return point(x, spring.second) - point(x, spring.first);
}

/// The Hessian of a spring's energy by its edge vector, or a bound of it: along u u^T + across (I - u u^T), u the
/// direction [N/m].
template <Number Scalar>
struct SpringStiffness {
    ///@{
    /// [N/m]
    Scalar along, across;
    ///@}

    Vector3<Scalar> direction;  ///< to the other end; zero if the length is zero
};

/// Force and stiffness of one spring on the vertex at one end. A spring of length zero has no direction and no force,
/// and the same stiffness in all directions.
template <Number Scalar>
struct SpringForce : SpringStiffness<Scalar> {
    Vector3<Scalar> edge;  ///< to the other end [m]
    Scalar length;         ///< [m]
    Scalar tension;        ///< [N]

    [[nodiscard]] Vector3<Scalar> force() const noexcept { return this->across * edge; }  ///< [N]
};

/// The edge vector of a spring from the vertex at one end, and its length. For several springs compute all of these
/// first: roots and divisions have a long latency, and those of different springs overlap.
template <Number Scalar>
struct SpringEdge {
    Vector3<Scalar> edge;  ///< to the other end [m]
    Scalar length;         ///< [m]
    Scalar divisor;        ///< the length, or 1 if it is 0 [m]
    Scalar per_length;     ///< 1 / divisor [1/m]

    SpringEdge() = default;  ///< Not initialised.

    /// From the vector to the other end [m].
    MEMBRANE_INLINE explicit SpringEdge(const Vector3<Scalar>& to) noexcept
        : edge(to), length(norm(to)), divisor(select(length != 0, length, Scalar(1))), per_length(1 / divisor) {}
};

///@{
/// Force of a spring of this stiffness [N/m] and rest length [m] on the vertex where its edge vector starts.
template <Number Scalar, class Law>
[[nodiscard]] MEMBRANE_INLINE SpringForce<Scalar> spring_force(const Law& law, const SpringEdge<Scalar>& to,
                                                               const Scalar& stiffness,
                                                               const Scalar& rest_length) noexcept {
    const auto has_length = to.length != 0;
    const auto response = response_of<Scalar>(law, {stiffness, rest_length, to.divisor});
    return {{select(has_length, response.stiffness, stiffness),
             select<Scalar>(has_length, response.tension * to.per_length, stiffness), to.per_length * to.edge},
            to.edge,
            to.length,
            select(has_length, response.tension, Scalar(0))};
}
template <Number Scalar, class Law>
[[nodiscard]] MEMBRANE_INLINE SpringForce<Scalar> spring_force(const Law& law, const Vector3<Scalar>& edge,
                                                               const Scalar& stiffness,
                                                               const Scalar& rest_length) noexcept {
    return spring_force(law, SpringEdge<Scalar>(edge), stiffness, rest_length);
}
///@}

/// Adds the force and the stiffness of a spring to those on a vertex.
template <Number Scalar>
MEMBRANE_INLINE void add(VertexForce<Scalar>& sum, const SpringForce<Scalar>& spring) noexcept {
    sum.force += spring.force();
    sum.stiffness += larger(spring.along, spring.across);
}

/// The springs' sum for an `EnergyMajoriser`, in few operations: the stiffness reduction as a sum of dyads, the size as
/// a quotient. A spring of stiffness k, tension T and length l stores at the length l' the energy k (l' - r)^2 / 2 and
/// a constant, r = l - T / k (or less, if it never stiffens). Of k (l'^2 - 2 r l' + r^2) / 2 only the second term is
/// not quadratic in the position. Let u be the direction away from the other end. A displacement of the vertex by a
/// along u and b across, of length at most rho, makes l' = sqrt((l + a)^2 + b^2) >= l + a + b^2 / (2 (l + rho)). So the
/// energy stays below a quadratic of stiffness k along the spring and k (1 - r / (l + rho)) across it.
/// `stiffness_reduction` is the sum of k min(r / l, 1) (I - u u^T), `size` the smallest max(l, r): with these,
/// stiffness_reduction / (1 + rho / size) is at most the sum of k r / (l + rho) (I - u u^T).
template <Number Scalar>
struct CurvedSum {
    Vector3<Scalar> force = Vector3<Scalar>::Zero();  ///< [N]
    Scalar stiffness = 0;                             ///< [N/m]
    Symmetric3<Scalar> dyads;                         ///< sum of k min(r / l, 1) u u^T [N/m]
    ///@{
    /// The quotient is the smallest size: [N] over [N/m].
    Scalar size_force = 1, size_stiffness = 0;
    ///@}

    /// The sum as an `EnergyMajoriser`.
    [[nodiscard]] MEMBRANE_INLINE EnergyMajoriser<Scalar> total() const noexcept {
        EnergyMajoriser<Scalar> sum{force, stiffness, diagonal3(dyads.trace())};
        sum.stiffness_reduction += Scalar(-1) * dyads;
        const auto has_size = size_stiffness > 0;
        sum.size = select(has_size, size_force / select(has_size, size_stiffness, Scalar(1)), sum.size);
        return sum;
    }
};

/// Adds a spring.
template <Number Scalar>
MEMBRANE_INLINE void add(CurvedSum<Scalar>& sum, const SpringForce<Scalar>& spring) noexcept {
    const Scalar stiffness = larger(spring.along, spring.across);
    const Scalar stiffness_reduction = smaller(stiffness - spring.across, stiffness);
    sum.force += spring.force();
    sum.stiffness += stiffness;
    sum.dyads += outer<Scalar>(larger(stiffness_reduction, Scalar(0)), spring.direction);
    const Scalar size_force = stiffness * spring.length + larger<Scalar>(-spring.tension, Scalar(0));
    const auto is_smaller = (stiffness_reduction > 0) & (size_force * sum.size_stiffness < sum.size_force * stiffness);
    sum.size_force = select(is_smaller, size_force, sum.size_force);
    sum.size_stiffness = select(is_smaller, stiffness, sum.size_stiffness);
}

/// Adds a spring's stiffness to a Hessian block.
template <Number Scalar>
inline void add(Symmetric3<Scalar>& sum, const SpringStiffness<Scalar>& spring) noexcept {
    sum += diagonal3(spring.across);
    sum += outer<Scalar>(spring.along - spring.across, spring.direction);
}

/// A spring's stiffness as a 3 x 3 block [N/m].
template <Number Scalar>
[[nodiscard]] Symmetric3<Scalar> block_of(const SpringStiffness<Scalar>& spring) noexcept {
    Symmetric3<Scalar> block;
    add(block, spring);
    return block;
}

/// Lower bound of the stiffness of a linear spring at all edge vectors within `displacement` [m] of `edge`; there it is
/// in no direction stiffer than its constant k. If the spring may become too short for the bound, returns nullopt.
///
/// With the length l of `edge`, `displacement` = s l and q = r / (l - s l) it is k (1 - q) across the edge and
/// k (1 - 2 s q) along it, r the rest length. Derivation: README.md in this folder.
[[nodiscard]] inline std::optional<SpringStiffness<double>> min_stiffness(const Spring<double>& spring,
                                                                          const Vector3<double>& edge,
                                                                          double displacement) noexcept {
    constexpr double rounding = 1e-14;  // above the rounding error here
    const double length = norm(edge);
    if (!(2 * displacement < length)) return std::nullopt;
    const double q = (1 + rounding) * spring.rest_length / (length - displacement), s = displacement / length;
    if (!(q <= 2 && 2 * s * q <= 1)) return std::nullopt;
    return SpringStiffness<double>{spring.stiffness * (1 - rounding - 2 * s * q), spring.stiffness * (1 - rounding - q),
                                   edge / length};
}

/// A spring as an `Element`, between its two ends.
template <Number Scalar, class Law>
struct SpringElement {
    static constexpr std::size_t corner_count = 2;  ///< its ends

    const Law* law;      ///< must outlive this
    Scalar stiffness;    ///< [N/m]
    Scalar rest_length;  ///< [m]

    /// Force of the spring on the vertex where its `edge` vector starts.
    template <Real N>
    [[nodiscard]] SpringForce<N> force_along(const Vector3<N>& edge) const noexcept {
        static_assert(SpringLaw<Law, N>,
                      "a law must take SpringState of the scalar it is asked in: an equilibrium is found in double");
        return spring_force<N>(*law, edge, static_cast<N>(stiffness), static_cast<N>(rest_length));
    }

    /// The law at this length [m].
    template <Number N>
    [[nodiscard]] SpringResponse<N> response(const N& length) const noexcept {
        constexpr auto shortest = (std::numeric_limits<Each<N>>::min)();  // no law is called with a smaller length
        return response_of<N>(*law,
                              {static_cast<N>(stiffness), static_cast<N>(rest_length), larger<N>(length, shortest)});
    }

    ///@{
    /// As `Element` requires.
    template <Real N>
    [[nodiscard]] CornerForce<N> force_on(const Corners<N, 2>& x, std::size_t i) const noexcept {
        const auto spring = force_along<N>(x[1 - i] - x[i]);
        const SpringStiffness<N> bound{(std::max)(spring.along, N(0)), (std::max)(spring.across, N(0)),
                                       spring.direction};
        return {spring.force(), block_of(bound)};
    }
    template <Real N>
    [[nodiscard]] N energy(const Corners<N, 2>& x) const noexcept {
        return response(norm<N>(x[1] - x[0])).energy;
    }
    template <Number N>
    [[nodiscard]] EnergyChange<N> energy_change(const Corners<N, 2>& x, std::size_t i,
                                                const Vector3<N>& displacement) const noexcept {
        using std::abs;
        const Vector3<N> edge = x[1 - i] - x[i];
        const N length = norm(edge), largest_coordinate = detail::largest_magnitude(x[i]);
        const auto before = response(length), after = response(norm<N>(edge - displacement));
        return {after.energy - before.energy, before.energy + abs(before.tension) * (length + largest_coordinate)};
    }
    [[nodiscard]] Eigen::Matrix3d hessian_block(const Corners<double, 2>& x, std::size_t i,
                                                std::size_t j) const noexcept {
        const auto block = block_of<double>(force_along<double>(x[1] - x[0]));
        return dense(i == j ? block : -1.0 * block);
    }
    ///@}
};
static_assert(Element<SpringElement<float, LinearSpring>> && Element<SpringElement<double, ExponentialSpring>>);

/// Masses, viscosities, springs and pins of a membrane, [Liu07] 2.2 and (1). Immutable; holds no positions.
template <Real Scalar_, CheckedSpringLaw<Scalar_> Law = LinearSpring>
class MassSpringNetwork {
  public:
    using Scalar = Scalar_;  ///< of the constants and forces

    static constexpr bool never_stiffens = membrane::never_stiffens<Law>();  ///< that of the law

    /// A spring for each edge of `mesh`; keeps a copy of `law`, and not the mesh.
    /// @throws InvalidInput for a number that is negative, not finite, missing, or of the wrong count. Cost: O(V + F
    /// log F).
    MassSpringNetwork(const TriangleMesh<Scalar>& mesh, const Law& law, const NetworkOptions<Scalar>& options);

    /// Number of vertices V.
    [[nodiscard]] Index vertex_count() const noexcept { return ends_.row_count(); }

    /// All springs, by ascending ends; none of stiffness zero.
    [[nodiscard]] std::span<const Spring<Scalar>> springs() const& noexcept { return springs_.items(); }
    void springs() && = delete;

    /// The most springs that there may be: all, or more if the network may tear.
    [[nodiscard]] std::size_t spring_capacity() const noexcept { return springs_.capacity(); }

    /// The law of all springs.
    [[nodiscard]] const Law& law() const& noexcept { return law_; }
    [[nodiscard]] Law law() && noexcept { return std::move(law_); }

    /// The springs of vertex `v`, by ascending vertex at the other end.
    [[nodiscard]] std::span<const SpringEnd<Scalar>> springs_of(Index v) const& noexcept { return ends_[v]; }
    void springs_of(Index) && = delete;

    /// Calls `act(instance)` for each spring: `ElementInstance<SpringElement>`.
    template <class Act>
    void for_each_element(Act act) const {
        for (const auto& spring : springs()) act(instance(spring));
    }

    ///@{
    /// The springs of vertex `v`, and its constants. @pre `has_masses()` for `mass`
    [[nodiscard]] std::span<const SpringEnd<Scalar>> neighbours(Index v) const& noexcept { return ends_[v]; }
    void neighbours(Index) && = delete;

    [[nodiscard]] bool pinned(Index v) const noexcept { return pinned_[static_cast<std::size_t>(v)] != 0; }
    [[nodiscard]] bool has_masses() const noexcept { return !mass_.empty(); }
    [[nodiscard]] Scalar mass(Index v) const noexcept { return mass_[static_cast<std::size_t>(v)]; }
    [[nodiscard]] Scalar viscosity(Index v) const noexcept {
        return viscosity_.empty() ? Scalar(0) : viscosity_[static_cast<std::size_t>(v)];
    }
    ///@}

    /// Calls `act(force)` with the `SpringForce` of each spring of vertex `v` at positions `x`.
    template <class Act>
    void for_each_force(Index v, const ConstPointsRef<Scalar>& x, Act act) const noexcept;

    /// Sum of the spring forces on vertex `v` at positions `x`.
    [[nodiscard]] VertexForce<Scalar> force_on(Index v, const ConstPointsRef<Scalar>& x) const noexcept;

    /// Hessian of the energy by the position of vertex `v` alone [N/m].
    [[nodiscard]] Symmetric3<Scalar> hessian(Index v, const ConstPointsRef<Scalar>& x) const noexcept;

    /// Tension of spring `s` [N].
    [[nodiscard]] Scalar tension(Index s, const ConstPointsRef<Scalar>& x) const noexcept {
        const auto& spring = springs()[static_cast<std::size_t>(s)];
        return instance(spring).element.response(norm(edge_vector(spring, x))).tension;
    }

    /// Energy stored in all springs [J]. Cost: O(springs).
    [[nodiscard]] Scalar energy(const ConstPointsRef<Scalar>& x) const noexcept;

    /// A negligible residual force [N]. The largest of: 1e-9 of the force of the stiffest spring stretched by its own
    /// length; its stiffness times 16 roundings of half the mesh's size; and the stiffness at a vertex times the
    /// rounding of its position in the mesh, which grows with the distance from the origin.
    [[nodiscard]] Scalar force_tolerance() const noexcept { return force_tolerance_; }

  protected:  // for networks that tear
    [[nodiscard]] ElementInstance<SpringElement<Scalar, Law>> instance(const Spring<Scalar>& spring) const noexcept {
        return {{spring.first, spring.second}, {&law_, spring.stiffness, spring.rest_length}};
    }
    void build_springs(const Adjacency& adjacency, const Points<Scalar>& x, const NetworkOptions<Scalar>& options);
    template <class Self, class Visit>
    static void visit_tear(Self& self, const Visit& visit) noexcept {
        visit(self.springs_, self.ends_, self.mass_, self.viscosity_, self.pinned_);
    }

    [[no_unique_address]] Law law_;
    FixedVector<Spring<Scalar>> springs_;
    CompressedRows<SpringEnd<Scalar>> ends_;  // each spring twice
    std::vector<Scalar> mass_, viscosity_;
    std::vector<unsigned char> pinned_;
    Scalar force_tolerance_ = 0;
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
    if constexpr (requires { law_.validate(); }) law_.validate();
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
        for (const auto& s : springs()) {  // ascending, so each row is
            put(s.first, SpringEnd<Scalar>{s.second, s.stiffness, s.rest_length});
            put(s.second, SpringEnd<Scalar>{s.first, s.stiffness, s.rest_length});
        }
    });
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
void MassSpringNetwork<Scalar, Law>::build_springs(const Adjacency& adjacency, const Points<Scalar>& x,
                                                   const NetworkOptions<Scalar>& options) {
    const auto edges = adjacency.edges();
    const auto edge_count = static_cast<Index>(edges.size());
    if (!options.stiffness.given()) refuse(detail::network_name, "stiffness of the springs [N/m] is required");
    const auto stiffness = options.stiffness.expand(edge_count, detail::network_name, "stiffness", "spring", "N/m");
    std::vector<Scalar> rest(edges.size());
    if (options.rest_length.given()) {
        rest = options.rest_length.expand(edge_count, detail::network_name, "rest length", "spring", "m");
    } else {
        for (std::size_t s = 0; s < edges.size(); ++s) {
            rest[s] = norm<Scalar>(point(x, edges[s][1]) - point(x, edges[s][0]));
        }
    }
    const auto count = std::count_if(stiffness.begin(), stiffness.end(), [](Scalar each) { return each > 0; });
    springs_ = FixedVector<Spring<Scalar>>(static_cast<std::size_t>(count));
    for (std::size_t s = 0; s < edges.size(); ++s) {
        if (stiffness[s] > 0) springs_.try_push_back({edges[s][0], edges[s][1], stiffness[s], rest[s]});
    }
    detail::NegligibleForce<Scalar> negligible(x);
    for (const auto& s : springs()) {
        for (const Index v : {s.first, s.second}) negligible.add(v, s.stiffness, s.rest_length);
    }
    force_tolerance_ = negligible.force;
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
template <class Act>
void MassSpringNetwork<Scalar, Law>::for_each_force(Index v, const ConstPointsRef<Scalar>& x, Act act) const noexcept {
    const Vector3<Scalar> here = point(x, v);
    for (const auto& end : springs_of(v)) {
        const Vector3<Scalar> edge = point(x, end.other) - here;
        act(spring_force<Scalar>(law_, edge, end.stiffness, end.rest_length));
    }
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
VertexForce<Scalar> MassSpringNetwork<Scalar, Law>::force_on(Index v, const ConstPointsRef<Scalar>& x) const noexcept {
    VertexForce<Scalar> sum;
    for_each_force(v, x, [&](const SpringForce<Scalar>& spring) { add(sum, spring); });
    return sum;
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
Symmetric3<Scalar> MassSpringNetwork<Scalar, Law>::hessian(Index v, const ConstPointsRef<Scalar>& x) const noexcept {
    Symmetric3<Scalar> block;
    for_each_force(v, x, [&](const SpringForce<Scalar>& spring) { add(block, spring); });
    return block;
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
Scalar MassSpringNetwork<Scalar, Law>::energy(const ConstPointsRef<Scalar>& x) const noexcept {
    Scalar sum = 0;
    for_each_element([&](const auto& spring) { sum += spring.element.energy(spring.where(x)); });
    return sum;
}

}  // namespace membrane
