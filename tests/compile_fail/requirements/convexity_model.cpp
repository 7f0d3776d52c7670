// SPDX-License-Identifier: MIT
// wrong: ConvexityModel: must be copyable
// wrong: ConvexityModel: must have a constructor from const EquilibriumProblem&
// wrong: ConvexityModel: eigenvalue_bound(const EquilibriumProblem&, double radius) noexcept must return double
#include <membrane/certify/convexity.hpp>

struct Guess {
#if WRONG != 2
    explicit Guess(const membrane::EquilibriumProblem&);
#endif
#if WRONG == 1
    Guess(const Guess&) = delete;
#endif
    double eigenvalue_bound(const membrane::EquilibriumProblem&, double radius) noexcept(WRONG != 3);
};

static_assert(membrane::CheckedConvexityModel<Guess>);
