// SPDX-License-Identifier: MIT
// wrong: ForceModel: model(std::span<const double> constants, std::span<const double> depths) const must
// wrong: ForceModel: model(std::span<const double> constants, std::span<const double> depths) const must
#include <type_traits>

#include <membrane/calibration/fit.hpp>

struct Punch {
    std::conditional_t<WRONG == 2, double, std::vector<double>> operator()(std::span<const double>,
                                                                           std::span<const double>)
#if WRONG != 1
        const
#endif
        ;
};

static_assert(membrane::CheckedForceModel<Punch>);
