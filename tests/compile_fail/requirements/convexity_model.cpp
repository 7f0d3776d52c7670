// SPDX-License-Identifier: MIT
// wrong: ConvexityModel: must be copyable
// wrong: ConvexityModel: must have a constructor from const RestProblem&
// wrong: ConvexityModel: around(const RestProblem&, double radius) noexcept must return double
#include <membrane/accuracy/convexity.hpp>

struct Guess {
#if WRONG != 2
    explicit Guess(const membrane::RestProblem&);
#endif
#if WRONG == 1
    Guess(const Guess&) = delete;
#endif
    double around(const membrane::RestProblem&, double radius) noexcept(WRONG != 3);
};

static_assert(membrane::CheckedConvexityModel<Guess>);
