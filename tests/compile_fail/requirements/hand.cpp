// SPDX-License-Identifier: MIT
// wrong: Hand: must be copyable
// wrong: Hand: there must be reset_to(const Vector3<Scalar>& position) noexcept
// wrong: Hand: there must be set_target(const Vector3<Scalar>& target, const Vector3<Scalar>& velocity) noexcept
// wrong: Hand: there must be advance(const Vector3<Scalar>& force, Scalar dt) noexcept
// wrong: Hand: position() const noexcept must give a Vector3<Scalar>
// wrong: Hand: velocity() const noexcept must give a Vector3<Scalar>
#include <membrane/haptics/device.hpp>

using Vector = membrane::Vector3<double>;

struct Stump {
#if WRONG == 1
    Stump(const Stump&) = delete;
#endif
    void reset_to(const Vector& position) noexcept(WRONG != 2);
    void set_target(const Vector& target, const Vector& velocity) noexcept(WRONG != 3);
    void advance(const Vector& force, double dt) noexcept(WRONG != 4);
    const Vector& position() const noexcept(WRONG != 5);
    const Vector& velocity() const noexcept(WRONG != 6);
};

using Device = membrane::ScriptedDevice<double, Stump>;
auto run(Device& device) { return device.running(); }
