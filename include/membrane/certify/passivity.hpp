// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include <membrane/haptics/device_profile.hpp>

/// Passivity of a haptic loop: a condition before it runs, an observer while it runs.
///
///     const membrane::SampledLoop loop{.stiffness = 40 * 12.0, .damping = 0.5, .tick = 1e-3,  // scaled to the device
///                                      .negative_stiffness = 100, .off_potential = 0.06};
///     const auto device = membrane::devices::touch;
///     membrane::require_passive(loop, device, {.hand_damping = 2});     // throws if the loop is not passive
///     const auto most = membrane::passivity(loop, device, {.hand_damping = 2}).max_stiffness;  // [N/m]
namespace membrane {

/// The force rendered to the hand. It is conservative, except for its damping and the part bounded by `off_potential`.
/// Stiffness means every eigenvalue of the Hessian of its potential: in all directions, not only along a normal.
///
/// | force | negative_stiffness | off_potential |
/// |---|---|---|
/// | `ReactionForce` | reaction / radius of a convex surface's curvature; more in buckling | scale * report.residual |
/// | `SpringDamperForce` on a `RestContact` | stiffness * depth / distance, see `RestContact` | 0 |
/// | `SpringDamperForce` on another contact | stiffness * depth / distance | stiffness * depth * sin(a) |
///
/// Other contacts are a tracked contact or a `SmoothContact`; a is the angle between its normal and that of a
/// `RestContact`.
struct SampledLoop {
    double stiffness;    ///< K, the largest tangent stiffness at the device, tissue-to-device scale included [N/m]
    double damping = 0;  ///< B, largest damping of the force, velocity from backward differences [N s/m]
    double tick = 1e-3;  ///< T, time from one force to the next [s]
    double delay = 0;    ///< from a position to the tick that responds to it, whole ticks as a rule [s]
    /// N, largest magnitude of a negative tangent stiffness [N/m]: 0 if it is never negative, infinity if the force
    /// drops discontinuously with depth or if N is not known. N matters only with a delay or with a resolution of the
    /// device.
    double negative_stiffness = std::numeric_limits<double>::infinity();
    /// Largest part of the force, without its damping, that has no potential [N]: 0 if the force has a potential,
    /// infinity if this part is not known. In a slow loop no damping dissipates its energy; friction must. A jump of
    /// the force counts in full.
    double off_potential = std::numeric_limits<double>::infinity();

    /// @throws InvalidInput if a number is out of its range; only `negative_stiffness` and `off_potential` may be
    /// infinite
    void validate() const;
};

/// Dissipation of the loop, in addition to the device's own damping and friction.
struct Dissipation {
    double hand_damping;  ///< lower bound of the damping of the hand on the device [N s/m]; 0: it may let go
    /// Upper bound of the tool's speed in contact [m/s]. Friction counts as a damper of friction / `max_speed`.
    /// Infinity: friction counts only against a resolution and `off_potential`.
    double max_speed = std::numeric_limits<double>::infinity();

    /// @throws InvalidInput if a number is out of its range
    void validate() const;
};

/// Result of `passivity`.
struct PassivityReport {
    bool passive = false;          ///< whether the loop as given is passive
    double max_stiffness = 0;      ///< largest passive K, all else equal, at most the device's [N/m]; 0: none above 0
    double damping_needed = 0;     ///< by the loop as given [N s/m]
    double damping_available = 0;  ///< of device and hand, and of friction as far as it is counted [N s/m]
    double friction_needed = 0;    ///< of the device, for its resolution and the force without a potential [N]
};

/// Whether a force, sampled with zero-order hold, gives the hand no more energy than the hand put in.
///
/// The loop is passive if the damping b of device and hand and the friction c of the device satisfy
///
/// - b >= K T / 2 + B + max(K, N) delay,                                           [Colgate97], extended by the delay
/// - c >= (max(K, N) / 2 + B / T) resolution + off_potential,                      [Abbott05], extended
///
/// and K is at most `DeviceProfile::stiffness`. The rest of c, over `max_speed`, counts as damping [Diolaiti06]. The
/// conditions are sufficient. For N <= K the first is necessary if the hand may be any passive system. Derivation:
/// README.md in this folder.
///
/// @throws InvalidInput if a number is out of its range
[[nodiscard]] inline PassivityReport passivity(const SampledLoop& loop, const DeviceProfile& device,
                                               const Dissipation& dissipation);

/// Does nothing if the loop is passive.
/// @throws InvalidInput if the loop is not passive, or if a number is out of its range. The message names the first
/// cause that applies: an unknown `off_potential`, an unknown `negative_stiffness`, too little friction, or too much
/// stiffness, with the largest passive one and the damping needed
inline void require_passive(const SampledLoop& loop, const DeviceProfile& device, const Dissipation& dissipation);

/// The energy that a hand has put into the loop, updated each tick [Hannaford02]. If it falls below zero, the loop has
/// given more energy than it received.
///
///     membrane::PassivityObserver observer(2.0);          // lower bound of device and hand damping [N s/m]
///     observer.update(tool.position, force, dt);          // the force that is written in this tick
///     if (observer.energy() < 0) ...                      // active
class PassivityObserver {
  public:
    /// Lower bounds of `damping` [N s/m] and `friction` [N] of device and hand: their dissipation is added to `energy`.
    /// Without it even a passive sampled spring appears to generate some energy.
    explicit PassivityObserver(double damping = 0, double friction = 0) noexcept
        : damping_(damping), friction_(friction) {}

    /// `position` of the tool now [m], `force` on the hand from now on [N], `dt` since the last call [s]. Input that is
    /// not finite is ignored; if `dt` is not positive, no energy is added.
    template <Real Scalar>
    void update(const Vector3<Scalar>& position, const Vector3<Scalar>& force, double dt) noexcept;

    /// Energy that the hand put in, minus the energy it got back [J].
    [[nodiscard]] double energy() const noexcept { return energy_; }
    /// Energy that the hand put in, without subtracting the energy it got back [J].
    [[nodiscard]] double energy_in() const noexcept { return energy_in_; }
    /// Smallest `energy` so far [J].
    [[nodiscard]] double min_energy() const noexcept { return min_energy_; }

    /// As new: all energies are zero.
    void reset() noexcept { *this = PassivityObserver(damping_, friction_); }

  private:
    double damping_, friction_;
    bool began_ = false;
    Vector3<double> position_ = Vector3<double>::Zero(), force_ = Vector3<double>::Zero();
    double energy_ = 0, energy_in_ = 0, min_energy_ = 0;
};

inline void SampledLoop::validate() const {
    constexpr std::string_view component = "SampledLoop";
    detail::check_option(component, stiffness, "stiffness", "N/m");
    detail::check_option(component, damping, "damping", "N s/m");
    detail::check_option(component, tick, "tick", "s", false);
    detail::check_option(component, delay, "delay", "s");
    if (!(negative_stiffness >= 0)) {
        refuse(component, "negative_stiffness must not be negative [N/m], got ", negative_stiffness);
    }
    if (!(off_potential >= 0)) refuse(component, "off_potential must not be negative [N], got ", off_potential);
}

inline void Dissipation::validate() const {
    detail::check_option("Dissipation", hand_damping, "hand_damping", "N s/m");
    if (!(max_speed > 0)) refuse("Dissipation", "max_speed must be positive [m/s], got ", max_speed);
}

inline PassivityReport passivity(const SampledLoop& loop, const DeviceProfile& device, const Dissipation& dissipation) {
    loop.validate();
    device.validate();
    dissipation.validate();
    const double lag = loop.tick / 2, coarse = device.resolution, negative = loop.negative_stiffness;
    const double per_speed = 1 / dissipation.max_speed;
    const double viscous = device.damping + dissipation.hand_damping;
    const double friction = device.friction - loop.off_potential - loop.damping / loop.tick * coarse;
    // An infinite slope over nothing has no effect.
    const auto over = [](double slope, double by) { return by > 0 ? slope * by : 0.0; };

    PassivityReport report;
    const double steepest = (std::max)(loop.stiffness, negative);
    const double left = friction - over(steepest, coarse / 2);
    report.friction_needed = device.friction - left;
    report.damping_needed = loop.stiffness * lag + over(steepest, loop.delay) + loop.damping;
    report.damping_available = viscous + (std::max)(left, 0.0) * per_speed;

    // The largest stiffness if the stiffness is the steepest slope; if that is below `negative`, with `negative` as the
    // steepest slope.
    const double late = loop.delay + coarse / 2 * per_speed;
    const double spare = viscous + friction * per_speed - loop.damping;
    double most = spare / (lag + late);
    if (late > 0 && !(most >= negative)) most = (spare - negative * late) / lag;
    const double max_slope = coarse > 0 ? 2 * friction / coarse : std::numeric_limits<double>::infinity();
    const bool borne = friction >= 0 && (coarse == 0 || negative <= max_slope);
    report.max_stiffness = borne ? (std::max)((std::min)({most, max_slope, device.stiffness}), 0.0) : 0;

    // Without stiffness and damping there is no force.
    const bool shows_nothing = loop.stiffness == 0 && loop.damping == 0;
    const bool enough = left >= 0 && report.damping_available >= report.damping_needed;
    report.passive = shows_nothing || (enough && loop.stiffness <= device.stiffness);
    return report;
}

inline void require_passive(const SampledLoop& loop, const DeviceProfile& device, const Dissipation& dissipation) {
    const auto report = passivity(loop, device, dissipation);
    if (report.passive) return;
    if (!is_finite(loop.off_potential)) {
        refuse("passivity", "off_potential must be known, 0 for a force that has a potential [N], got ",
               loop.off_potential);
    }
    if (!is_finite(loop.negative_stiffness) && (loop.delay > 0 || device.resolution > 0)) {
        refuse("passivity", "with a delay of ", loop.delay, " s and a resolution of ", device.resolution,
               " m negative_stiffness must be known and finite [N/m], got ", loop.negative_stiffness);
    }
    if (report.friction_needed > device.friction) {
        refuse("passivity", "with damping ", loop.damping, " N s/m, negative_stiffness ", loop.negative_stiffness,
               " N/m and off_potential ", loop.off_potential, " N friction of ", device.name, " must be at least ",
               report.friction_needed, " [N], got ", device.friction);
    }
    refuse("passivity", "with damping ", loop.damping, " N s/m and a tick of ", loop.tick, " s on ", device.name,
           " stiffness must be at most ", report.max_stiffness, " [N/m], got ", loop.stiffness, "; damping needed ",
           report.damping_needed, " [N s/m], there is ", report.damping_available);
}

template <Real Scalar>
void PassivityObserver::update(const Vector3<Scalar>& position, const Vector3<Scalar>& force, double dt) noexcept {
    if (!is_finite(position) || !is_finite(force) || !is_finite(dt)) return;
    const Vector3<double> now = position.template cast<double>();
    if (began_ && dt > 0) {
        const Vector3<double> displacement = now - position_;
        const double more =
            damping_ / dt * squared_norm(displacement) + friction_ * norm(displacement) - dot(force_, displacement);
        energy_ += more;
        energy_in_ += (std::max)(more, 0.0);
        min_energy_ = (std::min)(min_energy_, energy_);
    }
    began_ = true;
    position_ = now;
    force_ = force.template cast<double>();
}

}  // namespace membrane
