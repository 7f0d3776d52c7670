// SPDX-License-Identifier: MIT
// wrong: LoadHistory: must be copyable
// wrong: LoadHistory: ticks() const must return Index
// wrong: LoadHistory: dt() const must return Scalar [s]
// wrong: LoadHistory: history(Index tick, const ConstPointsRef<Scalar>& x, std::span<const Index> moved) must return a
#include <type_traits>

#include <membrane/accuracy/trial.hpp>

using Hold = std::conditional_t<WRONG == 4, int, membrane::VertexAttachment<double>>;

struct Pinch {
#if WRONG == 1
    Pinch(const Pinch&) = delete;
#endif
    std::conditional_t<WRONG == 2, double, membrane::Index> ticks() const;
    std::conditional_t<WRONG == 3, float, double> dt() const;
    std::tuple<Hold> operator()(membrane::Index tick, const membrane::ConstPointsRef<double>& x,
                                std::span<const membrane::Index> moved);
};

static_assert(membrane::CheckedLoadHistory<Pinch, double>);
