// SPDX-License-Identifier: MIT
// wrong: Element: must be copyable
// wrong: Element: must have static constexpr corner_count, the number of its corners
// wrong: Element: force_on(const Corners<double, corner_count>&, std::size_t) const noexcept must return
// CornerForce<double> wrong: Element: force_on(const Corners<float, corner_count>&, std::size_t) const noexcept must
// return CornerForce<float> wrong: Element: energy(const Corners<double, corner_count>&) const noexcept must return
// double wrong: Element: energy_change(const Corners<double, corner_count>&, std::size_t, const Vector3<double>&) const
// noexcept must wrong: Element: energy_change(const Corners<float, corner_count>&, std::size_t, const Vector3<float>&)
// const noexcept must wrong: Element: hessian_block(const Corners<double, corner_count>&, std::size_t, std::size_t)
// const must return
#include <membrane/tissue/elements.hpp>

template <class Scalar>
using Corners = membrane::Corners<Scalar, 3>;

struct Patch {
#if WRONG == 1
    Patch(const Patch&) = delete;
#endif
#if WRONG != 2
    static constexpr std::size_t corner_count = 3;
#endif
    membrane::CornerForce<double> force_on(const Corners<double>&, std::size_t) const noexcept(WRONG != 3);
    membrane::CornerForce<float> force_on(const Corners<float>&, std::size_t) const noexcept(WRONG != 4);
    double energy(const Corners<double>&) const noexcept(WRONG != 5);
    membrane::EnergyChange<double> energy_change(const Corners<double>&, std::size_t,
                                                 const membrane::Vector3<double>&) const noexcept(WRONG != 6);
    membrane::EnergyChange<float> energy_change(const Corners<float>&, std::size_t,
                                                const membrane::Vector3<float>&) const noexcept(WRONG != 7);
#if WRONG != 8
    Eigen::Matrix3d hessian_block(const Corners<double>&, std::size_t, std::size_t) const;
#endif
};

using Patches = membrane::Elements<double, Patch>;
auto count(const Patches& patches) { return sizeof patches; }
