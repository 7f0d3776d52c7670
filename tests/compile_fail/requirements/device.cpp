// SPDX-License-Identifier: MIT
// wrong: Device: running() const noexcept must return bool
// wrong: Device: read() noexcept must return Tool<Scalar>
// wrong: Device: write(const Vector3<Scalar>& force) noexcept must return void
#include <membrane/haptics/device.hpp>

struct Mouse {
    bool running() const noexcept(WRONG != 1);
    membrane::Tool<double> read() noexcept(WRONG != 2);
    void write(const membrane::Vector3<double>& force) noexcept(WRONG != 3);
};

static_assert(membrane::CheckedDevice<Mouse, double>);
