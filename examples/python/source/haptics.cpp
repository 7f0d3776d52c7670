// SPDX-License-Identifier: MIT
#include <functional>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <membrane/haptics/contact_friction.hpp>
#include <membrane/haptics/force_limits.hpp>
#include <membrane/haptics/virtual_coupling.hpp>
#include <membrane/replay/script.hpp>
#include <membrane/replay/simulated_hand.hpp>

#include <fstream>

#include "loop_call.hpp"
#include "types.hpp"

namespace membrane_python {

namespace {

using State = membrane::HapticState<double>;
using membrane::DeviceProfile;
using membrane::ForceLimiter;

/// A hand that a program of Python chooses while it runs.
struct AnyHand {
    std::variant<membrane::IdealHand<double>, membrane::SimulatedHand<double>> any;

    void reset_to(const Vector& position) noexcept {
        std::visit([&](auto& hand) { hand.reset_to(position); }, any);
    }
    void set_target(const Vector& target, const Vector& velocity) noexcept {
        std::visit([&](auto& hand) { hand.set_target(target, velocity); }, any);
    }
    void advance(const Vector& force, double dt) noexcept {
        std::visit([&](auto& hand) { static_cast<void>(hand.advance(force, dt)); }, any);
    }
    [[nodiscard]] Vector position() const noexcept {
        return std::visit([](const auto& hand) -> Vector { return hand.position(); }, any);
    }
    [[nodiscard]] Vector velocity() const noexcept {
        return std::visit([](const auto& hand) -> Vector { return hand.velocity(); }, any);
    }
};
static_assert(membrane::CheckedHand<AnyHand, double>);

using Device = membrane::ScriptedDevice<double, AnyHand>;
using Friction = membrane::ContactFriction<membrane::SpringDamperForce, double>;

}  // namespace

template <>
inline constexpr bool is_in_loop<membrane::SpringDamperForce> = true;
template <>
inline constexpr bool is_in_loop<membrane::ReactionForce> = true;
template <>
inline constexpr bool is_in_loop<Friction> = true;
template <>
inline constexpr bool is_in_loop<Device> = true;

namespace {

/// A profile that owns its name.
struct Profile : DeviceProfile {
    Profile(std::string named, const DeviceProfile& numbers) : DeviceProfile(numbers), owned(std::move(named)) {
        name = owned;
    }
    Profile(const Profile& other) : Profile(other.owned, other) {}
    Profile& operator=(const Profile&) = delete;

    std::string owned;
};

/// The force of a policy at the end of a tick.
template <class Class>
void def_call(Class& policy) {
    using Policy = typename Class::type;
    def_in_loop(
        policy, "__call__",
        [](Policy& self, const Tool& tool, const Contact& contact, const StepReport& report, const Grasp* grasp) {
            return self(State{tool, contact, report, grasp != nullptr ? *grasp : Grasp{}});
        },
        py::arg("tool"), py::arg("contact"), py::arg("report"), py::arg("grasp") = py::none(),
        doc("SpringDamperForce::operator()"));
}

void bind_policies(py::module_& module) {
    using membrane::ReactionForce;
    using membrane::SpringDamperForce;
    auto damper = py::class_<SpringDamperForce>(module, "SpringDamperForce", doc("SpringDamperForce"));
    const Keywords damper_fields("SpringDamperForce", std::pair("stiffness", &SpringDamperForce::stiffness),
                                 std::pair("damping", &SpringDamperForce::damping));
    damper_fields.def_init(damper, damper_fields.taking<>([](const SpringDamperForce& made) { return made; }));
    damper_fields.def_fields(damper);
    def_call(damper);
    auto reaction = py::class_<ReactionForce>(module, "ReactionForce", doc("ReactionForce"));
    reaction.def(py::init([](double scale) { return ReactionForce{.scale = scale}; }), py::arg("scale") = 1.0)
        .def_readonly("scale", &ReactionForce::scale, doc("ReactionForce::scale"));
    def_call(reaction);

    using membrane::FrictionOptions;
    auto friction = py::class_<Friction>(module, "ContactFriction", doc("ContactFriction"));
    const Keywords options("FrictionOptions", std::pair("coefficient", &FrictionOptions::coefficient),
                           std::pair("stiffness", &FrictionOptions::stiffness));
    options.def_init(friction,
                     options.taking<const SpringDamperForce&>(
                         [](const SpringDamperForce& policy, const FrictionOptions& o) { return Friction(policy, o); }),
                     py::arg("policy"));
    def_call(friction);
    friction.def_property_readonly("slips", &Friction::slips, doc("ContactFriction::slips"));

    using membrane::CouplingOptions;
    using Coupling = membrane::VirtualCoupling<double>;
    auto coupling = py::class_<Coupling>(module, "VirtualCoupling", doc("VirtualCoupling"));
    const Keywords coupling_options("CouplingOptions", std::pair("stiffness", &CouplingOptions::stiffness),
                                    std::pair("damping", &CouplingOptions::damping),
                                    std::pair("scale", &CouplingOptions::scale));
    coupling_options.def_init(coupling,
                              coupling_options.taking<>([](const CouplingOptions& o) { return Coupling(o); }));
    coupling
        .def("update", &Coupling::update, py::arg("hand"), py::arg("reaction"), py::arg("dt"),
             doc("VirtualCoupling::update"))
        .def_property_readonly("force", &Coupling::force, doc("VirtualCoupling::force"))
        .def("reset", &Coupling::reset, doc("VirtualCoupling::reset"));
}

void bind_profiles(py::module_& module) {
    auto profile = py::class_<Profile>(module, "DeviceProfile", doc("DeviceProfile"));
    const Keywords fields(
        "DeviceProfile", std::pair("peak_force", &DeviceProfile::peak_force),
        std::pair("continuous_force", &DeviceProfile::continuous_force),
        std::pair("stiffness", &DeviceProfile::stiffness), std::pair("damping", &DeviceProfile::damping),
        std::pair("friction", &DeviceProfile::friction), std::pair("resolution", &DeviceProfile::resolution),
        std::pair("thermal_time", &DeviceProfile::thermal_time));
    fields.def_init(profile, fields.taking<std::string>([](std::string name, const DeviceProfile& numbers) {
        return (numbers.validate(), Profile(std::move(name), numbers));
    }),
                    py::arg("name"));
    fields.def_fields(profile);
    profile.def_readonly("name", &Profile::owned, doc("DeviceProfile::name"));
    auto devices =
        module.def_submodule("devices", "Profiles of haptic devices: compare them with the data sheet of yours.");
    using namespace membrane::devices;
    const std::pair<const char*, const DeviceProfile&> all[] = {{"touch", touch},
                                                                {"phantom_desktop", phantom_desktop},
                                                                {"premium_1_5", premium_1_5},
                                                                {"premium_3_0", premium_3_0},
                                                                {"omega", omega},
                                                                {"delta", delta},
                                                                {"sigma", sigma}};
    for (const auto& [name, device] : all) devices.attr(name) = Profile(std::string(device.name), device);
}

void bind_limiter(py::module_& module) {
    using membrane::ActiveLimits;
    using membrane::LimitOptions;
    py::class_<ActiveLimits>(module, "ActiveLimits", doc("ActiveLimits"))
        .def_readonly("fault", &ActiveLimits::fault, doc("ActiveLimits::fault"))
        .def_readonly("faded", &ActiveLimits::faded, doc("ActiveLimits::faded"))
        .def_readonly("peak", &ActiveLimits::peak, doc("ActiveLimits::peak"))
        .def_readonly("heat", &ActiveLimits::heat, doc("ActiveLimits::heat"))
        .def_readonly("slew", &ActiveLimits::slew, doc("ActiveLimits::slew"))
        .def("any", &ActiveLimits::any, doc("ActiveLimits::any"));
    auto limiter = py::class_<ForceLimiter>(module, "ForceLimiter", doc("ForceLimiter"));
    const Keywords options(
        "LimitOptions", std::pair("rise_time", &LimitOptions::rise_time),
        std::pair("soft_start", &LimitOptions::soft_start), std::pair("max_state_age", &LimitOptions::max_state_age),
        std::pair("fade_time", &LimitOptions::fade_time), std::pair("max_tick", &LimitOptions::max_tick),
        std::pair("thermal_limit", &LimitOptions::thermal_limit));
    options.def_init(limiter, options.taking<const Profile&>([](const Profile& device, const LimitOptions& o) {
        return ForceLimiter(device, o);
    }),
                     py::arg("device"));
    limiter
        .def("__call__", &ForceLimiter::operator()<double>, py::arg("force"), py::arg("now"), py::arg("state"),
             doc("ForceLimiter::operator()"))
        .def_property_readonly("active_limits", &ForceLimiter::active_limits, doc("ForceLimiter::active_limits"))
        .def_property_readonly("thermal_load", &ForceLimiter::thermal_load, doc("ForceLimiter::thermal_load"))
        .def_property_readonly("gain", &ForceLimiter::gain, doc("ForceLimiter::gain"))
        .def("reset", &ForceLimiter::reset, doc("ForceLimiter::reset"));
}

void bind_hand(py::module_& module) {
    using membrane::HandOptions;
    using Hand = membrane::SimulatedHand<double>;
    auto hand = py::class_<Hand>(module, "SimulatedHand", doc("SimulatedHand"));
    const Keywords options("HandOptions", std::pair("mass", &HandOptions::mass),
                           std::pair("damping", &HandOptions::damping),
                           std::pair("stiffness", &HandOptions::stiffness));
    options.def_init(hand, options.taking<>([](const HandOptions& o) { return Hand(o); }));
    hand.def("reset_to", &Hand::reset_to, py::arg("position"), doc("SimulatedHand::reset_to"))
        .def("set_target", &Hand::set_target, py::arg("target"), py::arg("velocity"), doc("SimulatedHand::set_target"))
        .def("advance", &Hand::advance, py::arg("force"), py::arg("dt"), doc("SimulatedHand::advance"))
        .def_property_readonly("position", &Hand::position, doc("SimulatedHand::position"))
        .def_property_readonly("velocity", &Hand::velocity, doc("SimulatedHand::velocity"));
}

void bind_waypoints(py::module_& module) {
    using Waypoint = membrane::Waypoint<double>;
    auto waypoint = py::class_<Waypoint>(module, "Waypoint", doc("Waypoint"));
    waypoint
        .def(py::init([](double time, const Vector& position, bool grasping) {
                 return Waypoint{time, position, grasping};
             }),
             py::arg("time"), py::arg("position"), py::arg("grasping") = false)
        .def(py::init([](const py::tuple& row) {
                 if (row.size() != 2 && row.size() != 3)
                     throw py::value_error("a waypoint is (time, position) or (time, position, grasping)");
                 return Waypoint{row[0].cast<double>(), row[1].cast<Vector>(), row.size() == 3 && row[2].cast<bool>()};
             }),
             py::arg("row"))
        .def_readonly("time", &Waypoint::time, doc("Waypoint::time"))
        .def_readonly("position", &Waypoint::position, doc("Waypoint::position"))
        .def_readonly("grasping", &Waypoint::grasping, doc("Waypoint::grasping"));
    py::implicitly_convertible<py::tuple, Waypoint>();
    module.def(
        "read_script",
        [](const std::filesystem::path& path) {
            std::ifstream file(path);
            if (!file) throw py::value_error("cannot read " + path.string());
            return membrane::read_script<double>(file);
        },
        py::arg("path"), doc("read_script"));
}

void bind_device(py::module_& module) {
    using Waypoint = membrane::Waypoint<double>;
    using membrane::ScriptedDeviceOptions;
    using OptionalHand = const std::optional<membrane::SimulatedHand<double>>&;
    auto device = py::class_<Device>(module, "ScriptedDevice", doc("ScriptedDevice"));
    const Keywords options("ScriptedDeviceOptions", std::pair("tick", &ScriptedDeviceOptions::tick),
                           std::pair("radius", &ScriptedDeviceOptions::radius));
    options.def_init(device,
                     options.taking<const std::vector<Waypoint>&, OptionalHand>(
                         [](const std::vector<Waypoint>& script, OptionalHand hand, const ScriptedDeviceOptions& o) {
                             return hand ? Device(script, o, AnyHand{*hand}) : Device(script, o);
                         }),
                     py::arg("script"), py::arg("hand") = py::none());
    device.def_property_readonly("running", &Device::running, doc("ScriptedDevice::running"))
        .def_property_readonly("force", &Device::force, doc("ScriptedDevice::force"))
        .def_property_readonly("time", &Device::time, doc("ScriptedDevice::time"))
        .def("reset", &Device::reset, doc("ScriptedDevice::reset"));
    def_in_loop(
        device, "read", [](Device& self) { return self.read(); }, doc("ScriptedDevice::read"));
    def_in_loop(
        device, "write", [](Device& self, const Vector& force) { self.write(force); }, py::arg("force"),
        doc("ScriptedDevice::write"));
}

}  // namespace

void bind_haptics(py::module_& module) {
    bind_policies(module);
    bind_profiles(module);
    bind_limiter(module);
    bind_hand(module);
    bind_waypoints(module);
    bind_device(module);
}

}  // namespace membrane_python
