// SPDX-License-Identifier: MIT
#include <stdexcept>

#include <pybind11/stl.h>

#include "loop_call.hpp"
#include "types.hpp"

namespace membrane_python {

namespace {

using NetworkOptions = membrane::NetworkOptions<double>;
using Law = std::variant<membrane::LinearSpring, membrane::TensionSpring, membrane::ExponentialSpring, TableSpring,
                         PythonSpring>;

[[nodiscard]] PlainSprings network_of(const Mesh& mesh, const Law& law, const NetworkOptions& options) {
    const auto build = [&](const auto& one) -> PlainSprings {
        if constexpr (std::same_as<std::remove_cvref_t<decltype(one)>, membrane::LinearSpring>) {
            return {{membrane::MassSpringNetwork(mesh, one, options), SurfaceVersion(mesh)}};
        } else {
            if constexpr (requires { one.validate(); }) one.validate();
            return {{membrane::MassSpringNetwork(mesh, AnySpring{one}, options), SurfaceVersion(mesh)}};
        }
    };
    return std::visit(build, law);
}

[[nodiscard]] TearableSprings tearable(const Mesh& mesh, const PlainSprings& network) {
    const auto build = [&]<class Springs>(const Springs& springs) -> TearableSprings {
        if constexpr (membrane::FollowsSplit<Springs>) {
            refuse("TearableSprings", "network must be a MassSpringNetwork, got one that tears");
        } else {
            return {{{membrane::TearableSprings(mesh, springs), SurfaceVersion(mesh)}}};
        }
    };
    return std::visit(build, network.any);
}

[[nodiscard]] Tissue tissue_of(const TearableSprings& network) {
    const auto build = [&]<class Springs>(const Springs& springs) -> Tissue {
        if constexpr (is_tearable<Springs>) {
            return {{membrane::Tissue<Springs>(springs), network.version}};
        } else {
            throw std::logic_error("TearableSprings hold other springs");
        }
    };
    return std::visit(build, network.any);
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
    options.def_init(exponential, options.taking<>([](const ExponentialSpring& law) { return (law.validate(), law); }));
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

void bind_any_network(py::module_& module) {
    auto network = py::class_<Network>(module, "ElasticNetwork", doc("ElasticNetwork"));
    network.def_property_readonly("vertex_count", &Network::vertex_count, doc("MassSpringNetwork::vertex_count"));
    network.def_property_readonly(
        "springs",
        [](const Network& self) {
            py::list springs;
            const auto list = [&](const auto& network) {
                for (const auto& s : network.springs())
                    springs.append(py::make_tuple(s.first, s.second, s.stiffness, s.rest_length));
            };
            std::visit(
                [&](const auto& one) {
                    if constexpr (requires { one.springs().springs(); })
                        list(one.springs());
                    else
                        list(one);
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
    network.def(
        "energy",
        [](const Network& self, Positions x) {
            check_count("MassSpringNetwork", "x", x.count, self.vertex_count());
            const auto sum_of = [&](const auto& one) {
                double sum = 0;
                one.for_each_element([&](const auto& spring) { sum += spring.element.energy(spring.where(x.map())); });
                return sum;
            };
            const double sum = std::visit(sum_of, self.any);
            self.rethrow();
            return sum;
        },
        py::arg("x"), doc("MassSpringNetwork::energy"));
}

void bind_network(py::module_& module) {
    bind_any_network(module);
    const Keywords options("NetworkOptions", std::pair("stiffness", &NetworkOptions::stiffness),
                           std::pair("mass", &NetworkOptions::mass), std::pair("viscosity", &NetworkOptions::viscosity),
                           std::pair("rest_length", &NetworkOptions::rest_length),
                           std::pair("pinned", &NetworkOptions::pinned));
    auto network = py::class_<PlainSprings, Network>(module, "MassSpringNetwork", doc("MassSpringNetwork"));
    options.def_init(network, options.taking<const Mesh&, const Law&>(&network_of), py::arg("mesh"),
                     py::arg("law") = membrane::LinearSpring{});
    module.def("with_reserve", &membrane::with_reserve<double>, py::arg("mesh"), py::arg("count"), doc("with_reserve"));
    py::class_<TearableSprings, PlainSprings>(module, "TearableSprings", doc("TearableSprings"))
        .def(py::init(&tearable), py::arg("mesh"), py::arg("network"), doc("TearableSprings::TearableSprings"));
    py::class_<Tissue, Network>(module, "Tissue", doc("Tissue"))
        .def(py::init(&tissue_of), py::arg("springs"), doc("Tissue::Tissue"));
}

void bind_foundations(py::module_& module) {
    py::class_<Foundation>(module, "Foundation", doc("FoundationModel"));
    using VolumeOptions = membrane::VolumeSpringOptions<double>;
    const Keywords volume_options("VolumeSpringOptions", std::pair("stiffness", &VolumeOptions::stiffness),
                                  std::pair("damping", &VolumeOptions::damping));
    auto volume = py::class_<VolumeSprings, Foundation>(module, "VirtualVolumeSprings", doc("VirtualVolumeSprings"));
    volume_options.def_init(volume, volume_options.taking<const Mesh&>([](const Mesh& mesh, const VolumeOptions& o) {
        return VolumeSprings{{membrane::VirtualVolumeSprings(mesh, o), SurfaceVersion(mesh)}};
    }),
                            py::arg("mesh"));

    using LayerOptions = membrane::FoundationOptions<double>;
    const Keywords layer_options("FoundationOptions", std::pair("normal", &LayerOptions::normal),
                                 std::pair("tangential", &LayerOptions::tangential),
                                 std::pair("recovery_time", &LayerOptions::recovery_time));
    auto layer = py::class_<LayerSprings, Foundation>(module, "FoundationSprings", doc("FoundationSprings"));
    layer_options.def_init(layer, layer_options.taking<const Mesh&>([](const Mesh& mesh, const LayerOptions& o) {
        return LayerSprings{{membrane::FoundationSprings(mesh, o), SurfaceVersion(mesh)}};
    }),
                           py::arg("mesh"));

    py::class_<NoSprings, Foundation>(module, "NoFoundation", doc("NoFoundation")).def(py::init([] {
        return NoSprings{{membrane::NoFoundation{}}};
    }));
}

/// What `of(springs, v)` is at each vertex.
template <class Value, class Of>
[[nodiscard]] std::vector<Value> at_each_vertex(const CohesiveSprings& self, Of of) {
    const auto& springs = self.springs();
    std::vector<Value> values(static_cast<std::size_t>(springs.anchors().cols()));
    for (std::size_t v = 0; v < values.size(); ++v) values[v] = of(springs, static_cast<Index>(v));
    return values;
}

void bind_adhesion(py::module_& module) {
    using Options = membrane::CohesionOptions<double>;
    const Keywords options("CohesionOptions", std::pair("stiffness", &Options::stiffness),
                           std::pair("strength", &Options::strength), std::pair("energy", &Options::energy),
                           std::pair("tangential_strength", &Options::tangential_strength),
                           std::pair("tangential_energy", &Options::tangential_energy));
    auto adhesion = py::class_<CohesiveSprings, Foundation>(module, "CohesiveSprings", doc("CohesiveSprings"));
    options.def_init(adhesion, options.taking<const Mesh&>([](const Mesh& mesh, const Options& o) {
        return CohesiveSprings{{membrane::CohesiveSprings(mesh, o), SurfaceVersion(mesh)}};
    }),
                     py::arg("mesh"));
    def_in_loop(
        adhesion, "update",
        [](CohesiveSprings& self, Positions x, const Moved& moved) {
            auto& springs = self.springs();
            const auto vertices = static_cast<Index>(springs.anchors().cols());
            check_count("CohesiveSprings", "x", x.count, vertices);
            check_moved("CohesiveSprings", moved, vertices);
            springs.update(x.map(), moved.vertices);
        },
        py::arg("x"), py::arg("moved"), doc("CohesiveSprings::update"));
    adhesion
        .def_property_readonly(
            "adheres",
            [](const CohesiveSprings& self) {
                return copy(at_each_vertex<unsigned char>(
                    self, [](const auto& springs, Index v) -> unsigned char { return springs.adheres(v) ? 1 : 0; }));
            },
            "Whether each vertex adheres: its spring has not failed.")
        .def_property_readonly(
            "damage",
            [](const CohesiveSprings& self) {
                return copy(
                    at_each_vertex<double>(self, [](const auto& springs, Index v) { return springs.damage(v); }));
            },
            "The part of the stiffness of each vertex that is lost, 0 to 1.")
        .def(
            "energy",
            [](const CohesiveSprings& self, Positions x) {
                check_count("CohesiveSprings", "x", x.count, static_cast<Index>(self.springs().anchors().cols()));
                return copy(at_each_vertex<double>(self, [&](const auto& springs, Index v) {
                    return springs.energy(v, membrane::point(x.map(), v));
                }));
            },
            py::arg("x"), "Energy stored in the spring of each vertex at the positions `x` [J].")
        .def_property_readonly(
            "dissipated", [](const CohesiveSprings& self) { return self.springs().dissipated(); },
            doc("CohesiveSprings::dissipated"))
        .def(
            "reset", [](CohesiveSprings& self) { self.springs().reset(); }, doc("CohesiveSprings::reset"));
}

}  // namespace

void bind_model(py::module_& module) {
    bind_laws(module);
    bind_network(module);
    bind_foundations(module);
    bind_adhesion(module);
}

}  // namespace membrane_python
