// SPDX-License-Identifier: MIT
// An option that there is not: the compiler names the options among which it is not.
// expect: (no known conversion|cannot convert initializer list).*SolverOptions<
#include <membrane/model/mass_spring_network.hpp>
#include <membrane/solve/quasi_static.hpp>

auto solver(const membrane::MassSpringNetwork<double, membrane::LinearSpring>& network) {
#ifdef CORRECT
    return membrane::QuasiStaticSolver(network, {.layers = 4});
#else
    return membrane::QuasiStaticSolver(network, {.layer = 4});
#endif
}
