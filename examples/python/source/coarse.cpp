// SPDX-License-Identifier: MIT
#include "coarse.hpp"

#include <memory>
#include <utility>

#include "loop_call.hpp"
#include "solver.hpp"

namespace membrane_python {

namespace {

using membrane::CoarseOptions;
using Report = membrane::CoarseReport<double>;

[[nodiscard]] std::unique_ptr<Coarse> coarse_of(const Mesh& mesh, const Network& network, const Foundation& foundation,
                                                const CoarseOptions& options) {
    check_fit("CoarseCorrection", mesh.vertex_count(), mesh.vertex_count(), network, foundation);
    const auto build = [&](const auto& springs, const auto& volume) {
        return std::make_unique<Coarse>(Coarse{membrane::CoarseCorrection<double>(mesh, springs, volume, options),
                                               &network, mesh.vertex_count(), network.version});
    };
    auto built = std::visit(build, network.any, foundation.any);
    network.rethrow();
    return built;
}

/// What `call(solver)` returns, for a solver of one of the rules.
template <class Call>
auto after_step(const Coarse& self, Eigen::Index points, const Solver& solver, Call call) {
    constexpr auto name = "CoarseCorrection";
    check_count(name, "x", points, self.vertex_count);
    check_count(name, "the solver", solver.vertex_count, self.vertex_count);
    check_version(name, "the solver", solver.version, self.version);
    auto result = std::visit(call, solver.any);
    self.network->rethrow();
    return result;
}

void bind_report(py::module_& module) {
    auto report = py::class_<Report>(module, "CoarseReport", doc("CoarseReport"));
    report.def_readonly("corrected", &Report::corrected, doc("CoarseReport::corrected"))
        .def_readonly("moved", &Report::moved, doc("CoarseReport::moved"))
        .def_readonly("step_length", &Report::step_length, doc("CoarseReport::step_length"))
        .def_readonly("reaction_error", &Report::reaction_error, doc("CoarseReport::reaction_error"));
    def_property_in_loop(
        report, "unbalanced", [](const py::object& self) { return view(self.cast<const Report&>().unbalanced, self); },
        doc("CoarseReport::unbalanced"));
}

}  // namespace

void bind_coarse(py::module_& module) {
    bind_report(module);
    auto coarse = py::class_<Coarse>(module, "CoarseCorrection", doc("CoarseCorrection"));
    const Keywords options("CoarseOptions", std::pair("points", &CoarseOptions::points),
                           std::pair("tolerance", &CoarseOptions::tolerance));
    options.def_init(coarse, options.taking<const Mesh&, const Network&, const Foundation&>(&coarse_of),
                     py::arg("mesh"), py::arg("network"), py::arg("foundation"), py::keep_alive<1, 3>(),
                     py::keep_alive<1, 4>());
    def_in_loop<py::return_value_policy::reference_internal>(
        coarse, "correct",
        [](Coarse& self, MovingPositions x, const Solver& solver) -> Report& {
            self.report =
                after_step(self, x.count, solver, [&](const auto& one) { return self.coarse.correct(x.map(), one); });
            return self.report;
        },
        py::arg("x"), py::arg("solver"), doc("CoarseCorrection::correct"));
    coarse
        .def(
            "reaction_error",
            [](Coarse& self, Positions x, const Solver& solver) {
                return after_step(self, x.count, solver,
                                  [&](const auto& one) { return self.coarse.reaction_error(x.map(), one); });
            },
            py::arg("x"), py::arg("solver"), doc("CoarseCorrection::reaction_error"))
        .def(
            "update", [](Coarse& self) { self.coarse.update(); }, doc("CoarseCorrection::update"))
        .def(
            "reset", [](Coarse& self) { self.coarse.reset(); }, doc("CoarseCorrection::reset"));
}

}  // namespace membrane_python
