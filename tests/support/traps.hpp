// SPDX-License-Identifier: MIT
#pragma once

// Clang assumes that no trap is set: it divides what is in no use, the fourth of four lanes that hold three numbers.
#if defined(__GLIBC__) && !defined(__clang__)
#define TEST_HAS_TRAPS
#include <fenv.h>
#endif

namespace test {

#ifdef TEST_HAS_TRAPS

/// While it lives, a division by zero, an operation without a result (0/0, inf - inf, a comparison with NaN) or an
/// overflow ends the test with SIGFPE, which names test case and seed.
///
///     {
///         const test::FloatingPointTraps traps;
///         report = solver.step(x, dt, network, foundation);
///     }
class FloatingPointTraps {
  public:
    static constexpr int all = FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW;
    static constexpr int only_division = FE_DIVBYZERO;

    explicit FloatingPointTraps(int which = all) : before_(fegetexcept()) {
        feclearexcept(FE_ALL_EXCEPT);
        fedisableexcept(FE_ALL_EXCEPT);
        feenableexcept(which);
    }
    ~FloatingPointTraps() {
        fedisableexcept(FE_ALL_EXCEPT);
        feclearexcept(FE_ALL_EXCEPT);
        feenableexcept(before_);
    }
    FloatingPointTraps(const FloatingPointTraps&) = delete;
    FloatingPointTraps& operator=(const FloatingPointTraps&) = delete;

  private:
    int before_;
};

#else

/// No traps to set.
struct FloatingPointTraps {
    static constexpr int all = 0, only_division = 0;
    explicit FloatingPointTraps(int = all) {}
    ~FloatingPointTraps() {}
};

#endif

}  // namespace test
