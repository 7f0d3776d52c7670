// SPDX-License-Identifier: MIT
// A network of springs that cannot be doubled, in a membrane that tears.
// expect: follow: this network .* does not tear: make it a TearableSprings
// expect: MassSpringNetwork<double
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/tearing.hpp>

#ifdef CORRECT
using Network = membrane::TearableSprings<double, membrane::LinearSpring>;
#else
using Network = membrane::MassSpringNetwork<double, membrane::LinearSpring>;
#endif

void after(const membrane::TearEvent<double>& event, Network& network) { follow(event, network); }
