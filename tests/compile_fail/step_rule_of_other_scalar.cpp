// SPDX-License-Identifier: MIT
// A rule that knows float vertices only, for a solver of doubles.
// expect: StepRule<.*Damped
// expect: rule.compliance
#include <membrane/solve/quasi_static.hpp>

#ifdef CORRECT
using Scalar = double;
#else
using Scalar = float;
#endif

struct Damped {
    Scalar compliance(const membrane::VertexState<Scalar>& vertex) const noexcept { return 1 / vertex.stiffness; }
};

auto forget(membrane::QuasiStaticSolver<double, Damped>& solver) { solver.reset(); }
