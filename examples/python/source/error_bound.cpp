// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>
#include <membrane/certify/error_bound.hpp>

#include "types.hpp"

namespace membrane_python {

namespace {

using Bound = membrane::ErrorBound<>;
using membrane::BoundStatus;
using membrane::Equilibrium;
using membrane::ErrorReport;
using membrane::ForceEnclosure;
using LinearNetwork = membrane::MassSpringNetwork<double, membrane::LinearSpring>;

/// A bound with its last report.
struct BoundOf {
    Bound bound;
    ErrorReport report = {};
};

[[nodiscard]] const LinearNetwork& linear(const Network& network) {
    const auto* springs = std::get_if<LinearNetwork>(&network.any);
    if (springs == nullptr) refuse("ErrorBound", "the springs must be linear, got another law, or springs that tear");
    return *springs;
}

/// The report of `compute(volume, constraint...)`, which is that of the last call for `self`.
template <class Compute>
ErrorReport& report_of(BoundOf& self, Positions x, const Network& network, const Foundation& foundation,
                       const py::args& arguments, Compute compute) {
    constexpr auto name = "ErrorBound";
    const auto& springs = linear(network);
    check_fit(name, springs.vertex_count(), x.count, network, foundation);
    const Constraints constraints(name, arguments, springs.vertex_count());
    constraints.check_static(name);
    const auto find = [&](const auto& volume, const auto&... each) {
        if constexpr (membrane::LinearFoundation<std::remove_cvref_t<decltype(volume)>>) {
            return compute(springs, volume, each...);
        } else {
            refuse(name, "the foundation must be VirtualVolumeSprings or NoFoundation, got another one");
            return ErrorReport{};
        }
    };
    {
        const py::gil_scoped_release unlock;
        self.report = std::visit(
            [&](const auto& volume) {
                return std::apply([&](const auto&... each) { return find(volume, each...); }, constraints.all);
            },
            foundation.any);
    }
    self.report.reactions = self.report.reactions.first((std::min)(self.report.reactions.size(), constraints.count));
    return self.report;
}

ErrorReport& compute(BoundOf& self, Positions x, const Network& network, const Foundation& foundation,
                     const py::args& arguments) {
    return report_of(self, x, network, foundation, arguments,
                     [&](const auto&... scene) { return self.bound.compute(x.map(), scene...); });
}

ErrorReport& compute_near(BoundOf& self, Positions x, const Network& network, const Foundation& foundation,
                          const py::args& arguments, const Equilibrium& rest, const Mesh& mesh) {
    return report_of(self, x, network, foundation, arguments,
                     [&](const auto&... scene) { return self.bound.compute(rest, x.map(), mesh, scene...); });
}

void bind_reports(py::module_& module) {
    py::enum_<BoundStatus>(module, "BoundStatus", doc("BoundStatus"))
        .value("certified", BoundStatus::certified, doc("BoundStatus::certified"))
        .value("not_convex", BoundStatus::not_convex, doc("BoundStatus::not_convex"))
        .value("not_converged", BoundStatus::not_converged, doc("BoundStatus::not_converged"))
        .value("contact", BoundStatus::contact, doc("BoundStatus::contact"))
        .value("unsupported", BoundStatus::unsupported, doc("BoundStatus::unsupported"))
        .value("invalid_input", BoundStatus::invalid_input, doc("BoundStatus::invalid_input"));
    py::class_<ForceEnclosure>(module, "ForceEnclosure", doc("ForceEnclosure"))
        .def_readonly("centre", &ForceEnclosure::centre, doc("ForceEnclosure::centre"))
        .def_readonly("radius", &ForceEnclosure::radius, doc("ForceEnclosure::radius"))
        .def(
            "max_distance_to",
            [](const ForceEnclosure& self, const Vector& force) { return self.max_distance_to(force.eigen()); },
            py::arg("force"), doc("ForceEnclosure::max_distance_to"));
    py::class_<ErrorReport>(module, "ErrorReport", doc("ErrorReport"))
        .def_readonly("status", &ErrorReport::status, doc("ErrorReport::status"))
        .def_property_readonly("certified", &ErrorReport::certified, doc("ErrorReport::certified"))
        .def_readonly("position", &ErrorReport::position, doc("ErrorReport::position"))
        .def_readonly("estimate", &ErrorReport::estimate, doc("ErrorReport::estimate"))
        .def_readonly("convexity", &ErrorReport::convexity, doc("ErrorReport::convexity"))
        .def_readonly("cg_iterations", &ErrorReport::cg_iterations, doc("ErrorReport::cg_iterations"))
        .def_property_readonly(
            "reactions",
            [](const ErrorReport& self) { return std::vector(self.reactions.begin(), self.reactions.end()); },
            doc("ErrorReport::reactions"));
}

}  // namespace

void bind_error_bound(py::module_& module) {
    bind_reports(module);
    using membrane::ErrorBoundOptions;
    const Keywords options("ErrorBoundOptions", std::pair("cg_iterations", &ErrorBoundOptions::cg_iterations));
    auto bound = py::class_<BoundOf>(module, "ErrorBound", doc("ErrorBound"));
    options.def_init(bound, options.taking<const Network&>([](const Network& network, const ErrorBoundOptions& o) {
        return BoundOf{Bound(linear(network), o)};
    }),
                     py::arg("network"));
    bound.def("compute", &compute, py::arg("x"), py::arg("network"), py::arg("foundation"),
              py::return_value_policy::reference_internal, doc("ErrorBound::compute"));
    bound.def("compute", &compute_near, py::arg("x"), py::arg("network"), py::arg("foundation"), py::arg("rest"),
              py::arg("mesh"), py::return_value_policy::reference_internal, doc("ErrorBound::compute"));
}

}  // namespace membrane_python
