// SPDX-License-Identifier: MIT
#pragma once

#include <string_view>

#include <membrane/core/check.hpp>

/// Limits of haptic devices, and their own damping and friction.
///
///     auto limit = membrane::ForceLimiter(membrane::devices::touch);
///     auto mine  = membrane::devices::touch;
///     mine.peak_force = 2;                                             // [N]: below the manufacturer's limit
namespace membrane {

/// Data of a device. If damping or friction is not known, zero is conservative.
struct DeviceProfile {
    std::string_view name;     ///< for messages
    double peak_force;         ///< largest force for a short time [N]
    double continuous_force;   ///< largest force for unlimited time [N]; the peak: the device limits heating itself
    double stiffness;          ///< largest stiffness it can render [N/m]
    double damping = 0;        ///< lower bound of its own viscous damping [N s/m]
    double friction = 0;       ///< its own Coulomb friction: the force to back-drive it [N]
    double resolution = 0;     ///< of its position [m]; 0: neglected
    double thermal_time = 10;  ///< time constant of its motors [s]; not published, 5 to 15 for small windings

    /// @throws InvalidInput if a number is not finite or out of its range
    void validate() const;
};

/// Compare a profile with the data sheet of your device. Peak forces and stiffnesses agree with the settings of CHAI3D
/// (`CPhantomDevices.cpp`, `CDeltaDevices.cpp` in github.com/chai3d/chai3d), but for one stiffness: that of the
/// Geomagic Touch is 400 N/m there, and 700 N/m for the Omni. Continuous forces, back-drive friction and resolutions
/// are of no source that can be checked. Damping is published only for the PHANToM 1.0 [Diolaiti06], the predecessor of
/// the Premium.
namespace devices {

/// 3D Systems Touch, formerly Geomagic Touch and SensAble PHANTOM Omni.
inline constexpr DeviceProfile touch{.name = "Touch",
                                     .peak_force = 3.3,
                                     .continuous_force = 0.88,
                                     .stiffness = 500,
                                     .friction = 0.26,
                                     .resolution = 55e-6};

/// SensAble PHANTOM Desktop, the device of [Liu07].
inline constexpr DeviceProfile phantom_desktop{.name = "PHANTOM Desktop",
                                               .peak_force = 7.9,
                                               .continuous_force = 1.75,
                                               .stiffness = 1000,
                                               .friction = 0.06,
                                               .resolution = 23e-6};

/// SensAble PHANTOM Premium 1.5.
inline constexpr DeviceProfile premium_1_5{.name = "PHANTOM Premium 1.5",
                                           .peak_force = 8.5,
                                           .continuous_force = 1.4,
                                           .stiffness = 800,
                                           .damping = 0.005,
                                           .friction = 0.04,
                                           .resolution = 30e-6};

/// SensAble PHANTOM Premium 3.0.
inline constexpr DeviceProfile premium_3_0{.name = "PHANTOM Premium 3.0",
                                           .peak_force = 22,
                                           .continuous_force = 3,
                                           .stiffness = 1000,
                                           .friction = 0.2,
                                           .resolution = 20e-6};

///@{
/// Of these, one force is known, and no friction. Without friction a resolution would rule out every stiffness, so the
/// resolution is neglected. Those of the sigma are CHAI3D's.
inline constexpr DeviceProfile omega{.name = "omega", .peak_force = 12, .continuous_force = 12, .stiffness = 5000};
inline constexpr DeviceProfile delta{.name = "delta", .peak_force = 20, .continuous_force = 20, .stiffness = 5000};
inline constexpr DeviceProfile sigma{.name = "sigma", .peak_force = 12, .continuous_force = 12, .stiffness = 4000};
///@}

}  // namespace devices

inline void DeviceProfile::validate() const {
    constexpr std::string_view component = "DeviceProfile";
    detail::check_option(component, peak_force, "peak_force", "N", false);
    detail::check_option(component, continuous_force, "continuous_force", "N", false);
    detail::check_option(component, stiffness, "stiffness", "N/m", false);
    detail::check_option(component, damping, "damping", "N s/m");
    detail::check_option(component, friction, "friction", "N");
    detail::check_option(component, resolution, "resolution", "m");
    detail::check_option(component, thermal_time, "thermal_time", "s", false);
    if (continuous_force > peak_force) {
        refuse(component, "continuous_force must not exceed the peak_force of ", peak_force, " N, got ",
               continuous_force, " N");
    }
}

}  // namespace membrane
