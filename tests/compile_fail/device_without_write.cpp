// SPDX-License-Identifier: MIT
// A device that cannot be given a force.
// expect: Device
// expect: device\.write\(force\)
#include <membrane/haptics/device.hpp>

struct Mouse {
    bool running() const noexcept;
    membrane::Tool<double> read() noexcept;
#ifdef CORRECT
    void write(const membrane::Vector3<double>& force) noexcept;
#endif
};

static_assert(membrane::Device<Mouse, double>);
