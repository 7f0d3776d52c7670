// SPDX-License-Identifier: MIT
// wrong: ElasticNetwork: must have Scalar, the scalar of the solver
// wrong: ElasticNetwork: must have static constexpr bool never_stiffens
// wrong: ElasticNetwork: vertex_count() const noexcept must return Index
// wrong: ElasticNetwork: pinned(Index) const noexcept must return bool
// wrong: ElasticNetwork: has_masses() const noexcept must return bool
// wrong: ElasticNetwork: mass(Index) const noexcept must return Scalar
// wrong: ElasticNetwork: viscosity(Index) const noexcept must return Scalar
// wrong: ElasticNetwork: neighbours(Index) const must give a range of something with .other, an Index
// wrong: ElasticNetwork: force_on(Index, const ConstPointsRef<Scalar>&) const noexcept must return VertexForce<Scalar>
// wrong: ElasticNetwork: majoriser(Index, const ConstPointsRef<Scalar>&) const noexcept must return
// EnergyMajoriser<Scalar> wrong: ElasticNetwork: hessian(Index, const ConstPointsRef<Scalar>&) const noexcept must
// return Symmetric3<Scalar> wrong: ElasticNetwork: energy_change(Index, const Vector3<Scalar>&, const
// ConstPointsRef<Scalar>&) const noexcept must wrong: ElasticNetwork: force_tolerance() const noexcept must return
// Scalar
#include <type_traits>

#include <membrane/model/elastic_network.hpp>

using membrane::Index;
using X = membrane::ConstPointsRef<double>;

struct Net {
    using Scalar = std::conditional_t<WRONG == 1, float, double>;
    struct End {
        Index other;
    };
#if WRONG != 2
    static constexpr bool never_stiffens = false;
#endif
    Index vertex_count() const noexcept(WRONG != 3);
    bool pinned(Index) const noexcept(WRONG != 4);
    bool has_masses() const noexcept(WRONG != 5);
    double mass(Index) const noexcept(WRONG != 6);
    double viscosity(Index) const noexcept(WRONG != 7);
    std::conditional_t<WRONG == 8, const Index*, const End*> neighbours(Index) const noexcept;
    membrane::VertexForce<double> force_on(Index, const X&) const noexcept(WRONG != 9);
    membrane::EnergyMajoriser<double> majoriser(Index, const X&) const noexcept(WRONG != 10);
    membrane::Symmetric3<double> hessian(Index, const X&) const noexcept(WRONG != 11);
    membrane::EnergyChange<double> energy_change(Index, const membrane::Vector3<double>&, const X&) const
        noexcept(WRONG != 12);
    double force_tolerance() const noexcept(WRONG != 13);
};

static_assert(membrane::CheckedElasticNetwork<Net, double>);
