// SPDX-License-Identifier: MIT
#include <membrane/accuracy/equilibrium.hpp>

#include "accuracy.hpp"

namespace membrane_python {

namespace {

using membrane::Equilibrium;
using membrane::EquilibriumOptions;

[[nodiscard]] Equilibrium find(Positions x, const Mesh& mesh, const Network& network, const Foundation& foundation,
                               const py::args& arguments, const EquilibriumOptions& options) {
    check_fit("equilibrium", mesh.vertex_count(), x.count, network, foundation);
    const Constraints constraints("equilibrium", arguments, mesh.vertex_count());
    constraints.check_static("equilibrium");
    auto found = unlocked("equilibrium", network, foundation, [&](const auto& springs, const auto& volume) {
        return std::apply(
            [&](const auto&... each) {
                return membrane::equilibrium(x.map(), mesh, springs, volume, options, each...);
            },
            constraints.all);
    });
    found.reactions.resize(constraints.count);
    return found;
}

}  // namespace

void bind_equilibrium(py::module_& module) {
    py::class_<Equilibrium>(module, "Equilibrium", doc("Equilibrium"))
        .def_property_readonly(
            "x", [](const py::object& self) { return view(self.cast<const Equilibrium&>().x, self); },
            doc("Equilibrium::x"))
        .def_property_readonly(
            "reactions",
            [](const py::object& self) {
                return view(std::span<const Vector>(self.cast<const Equilibrium&>().reactions), self);
            },
            doc("Equilibrium::reactions"))
        .def_readonly("residual", &Equilibrium::residual, doc("Equilibrium::residual"))
        .def_readonly("penetration", &Equilibrium::penetration, doc("Equilibrium::penetration"))
        .def_readonly("iterations", &Equilibrium::iterations, doc("Equilibrium::iterations"))
        .def_readonly("converged", &Equilibrium::converged, doc("Equilibrium::converged"));
    const Keywords options("EquilibriumOptions", std::pair("increments", &EquilibriumOptions::increments),
                           std::pair("layers", &EquilibriumOptions::layers),
                           std::pair("max_iterations", &EquilibriumOptions::max_iterations),
                           std::pair("tolerance", &EquilibriumOptions::tolerance));
    options.def(module, "equilibrium",
                options.taking<Positions, const Mesh&, const Network&, const Foundation&, const py::args&>(&find),
                py::arg("x"), py::arg("mesh"), py::arg("network"), py::arg("foundation"));
}

}  // namespace membrane_python
