// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include <membrane/haptics/device_profile.hpp>

/// Whether a loop can buzz: before it runs, and while it does.
///
///     const membrane::SampledLoop loop{.stiffness = 40 * 12.0, .damping = 0.5, .tick = 1e-3,    // after the scale
///                                      .negative_stiffness = 100, .off_potential = 0.06};
///     const auto device = membrane::devices::touch;
///     membrane::require_passive(loop, device, {.hand_damping = 2});     // throws, and says what would do
///     const auto most = membrane::passivity(loop, device, {.hand_damping = 2}).max_stiffness;  // [N/m]
namespace membrane {

/// What is shown to the hand: a force that has a potential, but for its damping and for what `off_potential` says. Its
/// stiffness is that of the potential, the eigenvalues of its Hessian: in every direction, not along a normal alone.
///
/// | force | negative_stiffness | off_potential |
/// |---|---|---|
/// | `ReactionForce` | reaction / distance to the centre of curvature of a convex membrane; more where it buckles | scale * residual |
/// | `SpringDamperForce` on a `RestContact` | stiffness * depth / distance, see there | 0 |
/// | the same on a contact itself, or a `SmoothContact` | the same | stiffness * depth * sine of the angle between its normal and that of the `RestContact` |
struct SampledLoop {
    double stiffness;    ///< K, the largest tangent stiffness at the device, tissue-to-device scale included [N/m]
    double damping = 0;  ///< B, the largest damping of the policy, by differences of the position [N s/m]
    double tick = 1e-3;  ///< T, from one force to the next [s]
    double delay = 0;    ///< from a position to the tick in which it is answered, a multiple of the tick [s]
    /// N, how far the tangent stiffness goes below zero, at most [N/m]: 0 where it never does, infinity for a wall that
    /// ends, or if it is not known. It matters with a delay, or on a device with a resolution.
    double negative_stiffness = std::numeric_limits<double>::infinity();
    /// How far the force without its damping is from that of any potential, at most [N]: 0 where it has one, infinity if
    /// it is not known. What it gives in a slow loop no damping takes, friction must. A jump of the force counts in full.
    double off_potential = std::numeric_limits<double>::infinity();

    /// @throws InvalidInput for a number that is not finite or out of its range
    void check() const;
};

/// What else takes energy out of the loop, beside the device's own damping and friction.
struct Dissipation {
    double hand_damping;  ///< the least a hand that holds the device ever has [N s/m]; 0: it may let go
    /// In contact the tool is never faster [m/s]. Friction takes as much as a damper of friction / speed up to there, and
    /// is counted so. Infinity: it is not counted, but against a coarse resolution.
    double max_speed = std::numeric_limits<double>::infinity();

    /// @throws InvalidInput for a number out of its range
    void check() const;
};

/// What a check comes to.
struct PassivityReport {
    bool passive = false;
    double max_stiffness = 0;      ///< of the loop, the rest as it is; 0: none [N/m]
    double damping_needed = 0;     ///< by the loop as it is [N s/m]
    double damping_available = 0;  ///< of device and hand, and of friction as far as it is counted [N s/m]
    double friction_needed = 0;    ///< of the device, for a coarse resolution and what has no potential [N]
};

/// Whether a held, sampled force gives the hand no energy that the hand has not brought.
///
/// The force of a tick is held until the next, so a spring that is let go pushes as it did where it was pressed deeper:
/// that makes at most K / 2 d^2 for a tick in which the tool goes by d. A delay of n ticks answers a position that is off
/// by the last n d: where no slope is steeper than L = max(K, N), up or down, that makes n L d^2 more in the mean. A
/// damper by differences makes B d^2 / T. A damper b takes b d^2 / T. So the loop is passive if
///
///     b >= K T / 2 + max(K, N) delay + B,                                                        [Colgate97]
///
/// for any force with a potential: springs that harden, and, where there is no delay, walls that end, of which N is
/// infinite. A position coarse by r makes the force wrong by (L / 2 + B / T) r, against which friction has to stand
/// [Abbott05], as it has against the part of the force that has no potential: that gives in a slow loop what no damper takes.
/// What is left of friction, c, takes c d, no less than c / v d^2 / T at speeds up to v [Diolaiti06]. Sufficient; for
/// N <= K necessary where the hand may be anything passive.
///
/// @throws InvalidInput for a number out of its range
[[nodiscard]] inline PassivityReport passivity(const SampledLoop& loop, const DeviceProfile& device,
                                               const Dissipation& dissipation);

/// @throws InvalidInput for a loop that is not passive, naming the stiffness that would be, and the damping
inline void require_passive(const SampledLoop& loop, const DeviceProfile& device, const Dissipation& dissipation);

/// The energy a hand has put into the loop, tick by tick [Hannaford02]. Where it sinks below zero, the loop has given more
/// than it got.
///
///     membrane::PassivityObserver observer(2.0);             // least damping of device and hand [N s/m]
///     observer.update(tool.position, force, dt);          // the force that is written in this tick
///     if (observer.energy() < 0) ...                      // active
class PassivityObserver {
  public:
    /// With damping and friction of device and hand, what they take counts too: without, each sampled spring gives some.
    explicit PassivityObserver(double damping = 0, double friction = 0) noexcept
        : damping_(damping), friction_(friction) {}

    /// `position` of the tool now [m], `force` on the hand from now on [N], `dt` since the last call [s]. What is not
    /// finite, or no time, is passed over.
    template <Real Scalar>
    void update(const Vector3<Scalar>& position, const Vector3<Scalar>& force, double dt) noexcept;

    /// What the hand has put in, less what it got back [J].
    [[nodiscard]] double energy() const noexcept { return energy_; }
    /// What went in, not counting what came back [J].
    [[nodiscard]] double energy_in() const noexcept { return brought_; }
    /// The least there ever was [J].
    [[nodiscard]] double least() const noexcept { return least_; }
    void reset() noexcept { *this = PassivityObserver(damping_, friction_); }

  private:
    double damping_, friction_;
    bool began_ = false;
    Vector3<double> position_ = Vector3<double>::Zero(), force_ = Vector3<double>::Zero();
    double energy_ = 0, brought_ = 0, least_ = 0;
};

inline void SampledLoop::check() const {
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

inline void Dissipation::check() const {
    detail::check_option("Dissipation", hand_damping, "hand_damping", "N s/m");
    if (!(max_speed > 0)) refuse("Dissipation", "fastest must be positive [m/s], got ", max_speed);
}

inline PassivityReport passivity(const SampledLoop& loop, const DeviceProfile& device, const Dissipation& dissipation) {
    loop.check();
    device.check();
    dissipation.check();
    const double lag = loop.tick / 2, coarse = device.resolution, negative = loop.negative_stiffness;
    const double per_speed = 1 / dissipation.max_speed;
    const double viscous = device.damping + dissipation.hand_damping;
    // For slopes: without a lag even an infinite one does nothing.
    const double friction = device.friction - loop.off_potential - loop.damping / loop.tick * coarse;
    const auto over = [](double slope, double displacement) { return displacement > 0 ? slope * displacement : 0.0; };

    PassivityReport report;
    const double steepest = (std::max)(loop.stiffness, negative);
    const double left = friction - over(steepest, coarse / 2);
    report.friction_needed = device.friction - left;
    report.damping_needed = loop.stiffness * lag + over(steepest, loop.delay) + loop.damping;
    report.damping_available = viscous + (std::max)(left, 0.0) * per_speed;

    // The most where the stiffness is the steepest slope; if that is less than the negative one, where that is.
    const double late = loop.delay + coarse / 2 * per_speed;
    const double spare = viscous + friction * per_speed - loop.damping;
    double most = spare / (lag + late);
    if (late > 0 && !(most >= negative)) most = (spare - negative * late) / lag;
    const double max_slope = coarse > 0 ? 2 * friction / coarse : std::numeric_limits<double>::infinity();
    const bool borne = friction >= 0 && (coarse == 0 || negative <= max_slope);
    report.max_stiffness = borne ? (std::max)((std::min)({most, max_slope, device.stiffness}), 0.0) : 0;

    // A wall of no stiffness and no damping is no wall.
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
        brought_ += (std::max)(more, 0.0);
        least_ = (std::min)(least_, energy_);
    }
    began_ = true;
    position_ = now;
    force_ = force.template cast<double>();
}

}  // namespace membrane
