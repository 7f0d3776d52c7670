// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>

#include "types.hpp"

namespace membrane_python {

namespace {

using NetworkOptions = membrane::NetworkOptions<double>;
using Law = std::variant<membrane::LinearSpring, membrane::TensionSpring, membrane::ExponentialSpring, TableSpring,
                         PythonSpring>;

[[nodiscard]] Network network_of(const Mesh& mesh, const Law& law, const NetworkOptions& options) {
    const auto build = [&](const auto& one) -> Network {
        if constexpr (std::same_as<std::remove_cvref_t<decltype(one)>, membrane::LinearSpring>) {
            return {membrane::MassSpringNetwork(mesh, one, options)};
        } else {
            if constexpr (requires { one.check(); }) one.check();
            return {membrane::MassSpringNetwork(mesh, AnySpring{one}, options)};
        }
    };
    return std::visit(build, law);
}

/// What a law says at these numbers: tension, stiffness, energy.
template <class Spring, class Class>
void def_call(Class& scope) {
    scope.def(
        "__call__",
        [](const Spring& law, double stiffness, double rest_length, double length) {
            const auto response = law(SpringState<double>{stiffness, rest_length, length});
            if constexpr (std::same_as<Spring, PythonSpring>) law.rethrow();
            return std::tuple(response.tension, response.stiffness, response.energy);
        },
        py::arg("stiffness"), py::arg("rest_length"), py::arg("length"), doc("LinearSpring::operator()"));
}

void bind_laws(py::module_& module) {
    using namespace membrane;
    auto linear = py::class_<LinearSpring>(module, "LinearSpring", doc("LinearSpring")).def(py::init());
    auto tension = py::class_<TensionSpring>(module, "TensionSpring", doc("TensionSpring")).def(py::init());
    auto exponential = py::class_<ExponentialSpring>(module, "ExponentialSpring", doc("ExponentialSpring"));
    const Keywords options("ExponentialSpring", std::pair("stiffening", &ExponentialSpring::stiffening),
                           std::pair("strain_limit", &ExponentialSpring::strain_limit));
    options.def_init(exponential, options.taking<>([](const ExponentialSpring& law) { return (law.check(), law); }));
    options.def_fields(exponential);
    auto table =
        py::class_<TableSpring>(
            module, "TableSpring",
            "A law by a table: tension over stiffness and rest length at each strain, straight in between and\n"
            "beyond both ends. Strains ascend, tensions do not descend, the tension at strain 0 is 0.")
            .def(py::init<const std::vector<double>&, const std::vector<double>&>(), py::arg("strain"),
                 py::arg("tension"), "Raises InvalidInput for a table that is not as above.");
    auto python =
        py::class_<PythonSpring>(
            module, "PythonSpring",
            "A law that is a function of Python: function(stiffness, rest_length, length) returns tension [N],\n"
            "stiffness [N/m], the derivative of the tension, and energy [J]. Slow: it is called for each\n"
            "spring of each update. `TableSpring` is fast. An error of the function is raised by the step.")
            .def(py::init<py::function>(), py::arg("function"));
    def_call<LinearSpring>(linear);
    def_call<TensionSpring>(tension);
    def_call<ExponentialSpring>(exponential);
    def_call<TableSpring>(table);
    def_call<PythonSpring>(python);
}

void bind_network(py::module_& module) {
    const Keywords options("NetworkOptions", std::pair("stiffness", &NetworkOptions::stiffness),
                           std::pair("mass", &NetworkOptions::mass), std::pair("viscosity", &NetworkOptions::viscosity),
                           std::pair("rest_length", &NetworkOptions::rest_length),
                           std::pair("pinned", &NetworkOptions::pinned));
    auto network = py::class_<Network>(module, "MassSpringNetwork", doc("MassSpringNetwork"));
    options.def_init(network, options.taking<const Mesh&, const Law&>(&network_of), py::arg("mesh"),
                     py::arg("law") = membrane::LinearSpring{});
    network.def_property_readonly("vertex_count", &Network::vertex_count, doc("MassSpringNetwork::vertex_count"));
    network.def_property_readonly(
        "springs",
        [](const Network& self) {
            py::list springs;
            std::visit(
                [&](const auto& one) {
                    for (const auto& s : one.springs())
                        springs.append(py::make_tuple(s.first, s.second, s.stiffness, s.rest_length));
                },
                self.any);
            return springs;
        },
        doc("MassSpringNetwork::springs"));
    network.def(
        "forces",
        [](const Network& self, Positions x) {
            check_count("MassSpringNetwork", "x", x.count, self.vertex_count());
            Points forces(3, x.count);
            std::visit(
                [&](const auto& one) {
                    for (Index v = 0; v < one.vertex_count(); ++v)
                        forces.col(v) = one.force_on(v, x.map()).force.eigen();
                },
                self.any);
            self.rethrow();
            return copy(forces);
        },
        py::arg("x"), "The force of the springs on each vertex at the positions `x`, V x 3 [N].");
}

void bind_foundations(py::module_& module) {
    py::class_<Foundation>(module, "Foundation", doc("FoundationModel"));
    using VolumeOptions = membrane::VolumeSpringOptions<double>;
    const Keywords volume_options("VolumeSpringOptions", std::pair("stiffness", &VolumeOptions::stiffness),
                                  std::pair("damping", &VolumeOptions::damping));
    auto volume = py::class_<VolumeSprings, Foundation>(module, "VirtualVolumeSprings", doc("VirtualVolumeSprings"));
    volume_options.def_init(volume, volume_options.taking<const Mesh&>([](const Mesh& mesh, const VolumeOptions& o) {
        return VolumeSprings{{membrane::VirtualVolumeSprings(mesh, o)}};
    }),
                            py::arg("mesh"));

    using LayerOptions = membrane::FoundationOptions<double>;
    const Keywords layer_options("FoundationOptions", std::pair("normal", &LayerOptions::normal),
                                 std::pair("tangential", &LayerOptions::tangential),
                                 std::pair("recovery_time", &LayerOptions::recovery_time));
    auto layer = py::class_<LayerSprings, Foundation>(module, "FoundationSprings", doc("FoundationSprings"));
    layer_options.def_init(layer, layer_options.taking<const Mesh&>([](const Mesh& mesh, const LayerOptions& o) {
        return LayerSprings{{membrane::FoundationSprings(mesh, o)}};
    }),
                           py::arg("mesh"));

    py::class_<NoSprings, Foundation>(module, "NoFoundation", doc("NoFoundation")).def(py::init([] {
        return NoSprings{{membrane::NoFoundation{}}};
    }));
}

}  // namespace

void bind_model(py::module_& module) {
    bind_laws(module);
    bind_network(module);
    bind_foundations(module);
}

}  // namespace membrane_python
