// SPDX-License-Identifier: MIT
// A hand that does not say what a force does to it.
// expect: Hand
// expect: Hand: there must be move\(
#include <membrane/haptics/device.hpp>

struct Stump {
    void place(const membrane::Vector3<double>& position) noexcept;
    void aim(const membrane::Vector3<double>& target, const membrane::Vector3<double>& velocity) noexcept;
#ifdef CORRECT
    void move(const membrane::Vector3<double>& force, double dt) noexcept;
#endif
    const membrane::Vector3<double>& position() const noexcept;
    const membrane::Vector3<double>& velocity() const noexcept;
};

using Device = membrane::ScriptedDevice<double, Stump>;
