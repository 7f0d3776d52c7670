// SPDX-License-Identifier: MIT
// A hand that does not say what a force does to it.
// expect: Hand
// expect: Hand: there must be advance\(
#include <membrane/haptics/device.hpp>

struct Stump {
    void reset_to(const membrane::Vector3<double>& position) noexcept;
    void set_target(const membrane::Vector3<double>& target, const membrane::Vector3<double>& velocity) noexcept;
#ifdef CORRECT
    void advance(const membrane::Vector3<double>& force, double dt) noexcept;
#endif
    const membrane::Vector3<double>& position() const noexcept;
    const membrane::Vector3<double>& velocity() const noexcept;
};

using Device = membrane::ScriptedDevice<double, Stump>;
