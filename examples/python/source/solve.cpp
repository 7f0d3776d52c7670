// SPDX-License-Identifier: MIT
#include <memory>

#include <pybind11/stl.h>

#include "loop_call.hpp"
#include "solver.hpp"

namespace membrane_python {

namespace {

[[nodiscard]] std::unique_ptr<Solver> solver_of(const Network& network, const Rule& rule,
                                                const SolverOptions& options) {
    const auto build = [&](const auto& springs, const auto& one) {
        using Type = SolverOf<std::remove_cvref_t<decltype(one)>>;
        return std::make_unique<Solver>(Solver{Type(springs, options, one), springs.vertex_count(), network.version});
    };
    return std::visit(build, network.any, rule);
}

StepReport& step(Solver& solver, double seconds, MovingPositions x, double dt, const Network& network,
                 const Foundation& foundation, const py::args& arguments) {
    constexpr auto name = "QuasiStaticSolver";
    check_fit(name, solver.vertex_count, x.count, network, foundation);
    check_version(name, "the network", network.version, solver.version);
    const Constraints constraints(name, arguments, solver.vertex_count);
    const StepArguments with{x, dt, network, constraints, seconds};
    solver.report = std::visit([&](auto& one, const auto& volume) { return take_step(one, with, volume); }, solver.any,
                               foundation.any);
    network.rethrow();
    return solver.report;
}

void bind_report(py::module_& module) {
    using membrane::StepStatus;
    py::enum_<StepStatus>(module, "StepStatus", doc("StepStatus"))
        .value("advanced", StepStatus::advanced, doc("StepStatus::advanced"))
        .value("bad_time_step", StepStatus::bad_time_step, doc("StepStatus::bad_time_step"))
        .value("invalid_input", StepStatus::invalid_input, doc("StepStatus::invalid_input"))
        .value("unstable", StepStatus::unstable, doc("StepStatus::unstable"))
        .value("too_many_contact_points", StepStatus::too_many_contact_points,
               doc("StepStatus::too_many_contact_points"))
        .value("wrong_vertex_count", StepStatus::wrong_vertex_count, doc("StepStatus::wrong_vertex_count"))
        .value("network_missed_split", StepStatus::network_missed_split, doc("StepStatus::network_missed_split"))
        .value("foundation_missed_split", StepStatus::foundation_missed_split,
               doc("StepStatus::foundation_missed_split"))
        .value("solver_missed_split", StepStatus::solver_missed_split, doc("StepStatus::solver_missed_split"))
        .value("contact_missed_split", StepStatus::contact_missed_split, doc("StepStatus::contact_missed_split"));
    auto report = py::class_<StepReport>(module, "StepReport", doc("StepReport"));
    report.def_readonly("status", &StepReport::status, doc("StepReport::status"))
        .def_readonly("converged", &StepReport::converged, doc("StepReport::converged"))
        .def_readonly("out_of_time", &StepReport::out_of_time, doc("StepReport::out_of_time"))
        .def_readonly("residual", &StepReport::residual, doc("StepReport::residual"))
        .def_readonly("residual_beyond", &StepReport::residual_beyond, doc("StepReport::residual_beyond"))
        .def_readonly("unsupported", &StepReport::unsupported, doc("StepReport::unsupported"))
        .def_readonly("violation", &StepReport::violation, doc("StepReport::violation"))
        .def_readonly("violated", &StepReport::violated, doc("StepReport::violated"))
        .def_readonly("vertex_updates", &StepReport::vertex_updates, doc("StepReport::vertex_updates"))
        .def("total_reaction", &StepReport::total_reaction, doc("StepReport::total_reaction"));
    def_property_in_loop(
        report, "moved", [](const py::object& self) { return view(self.cast<const StepReport&>().moved, self); },
        doc("StepReport::moved"));
    def_property_in_loop(
        report, "reactions",
        [](const py::object& self) { return view(self.cast<const StepReport&>().reactions, self); },
        doc("StepReport::reactions"));
}

void bind_constraints(py::module_& module) {
    py::class_<Acting>(module, "Constraint", doc("Constraint"));
    def_in_loop(
        module, "press",
        [](const Tool& tool, const py::object& contact, const Grasp* grasp) {
            const auto& of = contact.cast<const Contact&>();
            return Acting{.any = membrane::press<double>(tool, of, grasp != nullptr ? *grasp : Grasp{}),
                          .contact = contact,
                          .vertex_count = of.vertex_count};
        },
        py::arg("tool"), py::arg("contact"), py::arg("grasp") = py::none(), doc("press"));
    module.def(
        "pull", [](const Tool& tool, const Grasp& grasp) { return Acting{.any = membrane::pull(tool, grasp)}; },
        py::arg("tool"), py::arg("grasp"), doc("pull"));
    module.def(
        "pull",
        [](Index v, const Vector& target) {
            return Acting{.any = membrane::VertexAttachment<double>{v, target}};
        },
        py::arg("vertex"), py::arg("target"), doc("pull"));
    module.def(
        "load",
        [](const std::array<Index, 3>& corners, const Vector& barycentric, const Vector& force) {
            return Acting{.any = membrane::load(corners, barycentric, force)};
        },
        py::arg("corners"), py::arg("barycentric"), py::arg("force"), doc("load"));
    module.def(
        "pin",
        [](std::vector<Index> vertices) {
            auto pins = std::make_shared<const std::vector<Index>>(std::move(vertices));
            return Acting{.any = membrane::pin(*pins), .pins = pins};
        },
        py::arg("vertices"), "`vertices` keep their positions.");
}

void bind_friction(py::module_& module) {
    using Vertex = membrane::StickingVertex<double>;
    py::class_<Vertex>(module, "StickingVertex", doc("StickingVertex"))
        .def_readonly("vertex", &Vertex::vertex, doc("StickingVertex::vertex"))
        .def_readonly("along", &Vertex::along, doc("StickingVertex::along"))
        .def_readonly("offset", &Vertex::offset, doc("StickingVertex::offset"))
        .def_readonly("force", &Vertex::force, doc("StickingVertex::force"))
        .def_readonly("sticking_force", &Vertex::sticking_force, doc("StickingVertex::sticking_force"))
        .def_readonly("normal_force", &Vertex::normal_force, doc("StickingVertex::normal_force"));
    using Options = membrane::ToolFrictionOptions;
    auto friction = py::class_<ToolFriction>(module, "ToolFriction", doc("ToolFriction"));
    const std::string text = std::string(doc("ToolFriction::ToolFriction")) +
                             "\n\ncoefficient: " + doc("ToolFrictionOptions::coefficient") +
                             "\nmax_vertices: " + doc("ToolFrictionOptions::max_vertices") + "\n";
    friction
        .def(py::init([](double coefficient, Index max_vertices) {
                 return ToolFriction({.coefficient = coefficient, .max_vertices = max_vertices});
             }),
             py::kw_only(), py::arg("coefficient"), py::arg("max_vertices") = Options{}.max_vertices, text.c_str())
        .def_property_readonly(
            "vertices",
            [](const ToolFriction& self) { return std::vector(self.vertices().begin(), self.vertices().end()); },
            doc("ToolFriction::vertices"))
        .def_property_readonly("slips", &ToolFriction::slips, doc("ToolFriction::slips"))
        .def_property_readonly("dissipated", &ToolFriction::dissipated, doc("ToolFriction::dissipated"))
        .def("reset", &ToolFriction::reset, doc("ToolFriction::reset"));
    def_in_loop(
        friction, "press",
        [](const py::object& self, const Tool& tool, const py::object& contact, const Grasp* grasp) {
            const auto& of = contact.cast<const Contact&>();
            return Acting{.any = self.cast<ToolFriction&>().press(tool, of, grasp != nullptr ? *grasp : Grasp{}),
                          .contact = contact,
                          .vertex_count = of.vertex_count,
                          .owner = self};
        },
        py::arg("tool"), py::arg("contact"), py::arg("grasp") = py::none(), doc("ToolFriction::press"));
}

void bind_rules(py::module_& module) {
    using membrane::UpdateOrder;
    py::enum_<UpdateOrder>(module, "UpdateOrder", doc("UpdateOrder"))
        .value("breadth_first", UpdateOrder::breadth_first, doc("UpdateOrder::breadth_first"))
        .value("colour_layers", UpdateOrder::colour_layers, doc("UpdateOrder::colour_layers"))
        .value("colour_all", UpdateOrder::colour_all, doc("UpdateOrder::colour_all"));
    const auto bind = [&]<class Rule>(const char* name, Rule) {
        const std::string omega = std::string(name) + "::omega";
        py::class_<Rule>(module, name, doc(name))
            .def(py::init([](double omega_of) { return Rule{.omega = omega_of}; }), py::arg("omega") = Rule{}.omega)
            .def_readonly("omega", &Rule::omega, doc(omega.c_str()));
    };
    bind("BlockStep", membrane::BlockStep{});
    bind("SafeStep", membrane::SafeStep{});
    py::class_<membrane::MassStep>(module, "MassStep", doc("MassStep")).def(py::init());
    auto options = py::class_<SolverOptions>(module, "SolverOptions", doc("SolverOptions"));
    const auto keywords = solver_keywords();
    keywords.def_init(options, keywords.taking<>([](const SolverOptions& o) { return (o.validate(), o); }));
    keywords.def_fields(options);
}

void bind_solver(py::module_& module) {
    auto solver = py::class_<Solver>(module, "QuasiStaticSolver", doc("QuasiStaticSolver"));
    solver.def(py::init([](const Network& network, const SolverOptions& options, const Rule& rule) {
                   return solver_of(network, rule, options);
               }),
               py::arg("network"), py::arg("options"), py::arg("rule") = membrane::BlockStep{});
    const auto keywords = solver_keywords();
    keywords.def_init(solver, keywords.taking<const Network&, const Rule&>(&solver_of), py::arg("network"),
                      py::arg("rule") = membrane::BlockStep{});
    def_in_loop<py::return_value_policy::reference_internal>(
        solver, "step",
        [](Solver& self, MovingPositions x, double dt, const Network& network, const Foundation& foundation,
           const py::args& constraints) -> StepReport& {
            return step(self, std::numeric_limits<double>::infinity(), x, dt, network, foundation, constraints);
        },
        py::arg("x"), py::arg("dt"), py::arg("network"), py::arg("foundation"), doc("QuasiStaticSolver::step"));
    def_in_loop<py::return_value_policy::reference_internal>(
        solver, "step_within",
        [](Solver& self, double seconds, MovingPositions x, double dt, const Network& network,
           const Foundation& foundation, const py::args& constraints) -> StepReport& {
            return step(self, (std::max)(seconds, 0.0), x, dt, network, foundation, constraints);
        },
        py::arg("seconds"), py::arg("x"), py::arg("dt"), py::arg("network"), py::arg("foundation"),
        doc("QuasiStaticSolver::step_until"));
    solver.def(
        "wake",
        [](Solver& self, const Moved& vertices) {
            std::visit([&](auto& one) { one.wake(vertices.vertices); }, self.any);
        },
        py::arg("vertices"), doc("QuasiStaticSolver::wake"));
    solver.def(
        "wake_all", [](Solver& self) { std::visit([](auto& one) { one.wake_all(); }, self.any); },
        doc("QuasiStaticSolver::wake_all"));
    solver.def(
        "reset", [](Solver& self) { std::visit([](auto& one) { one.reset(); }, self.any); },
        doc("QuasiStaticSolver::reset"));
}

}  // namespace

void bind_solve(py::module_& module) {
    bind_report(module);
    bind_constraints(module);
    bind_friction(module);
    bind_rules(module);
    bind_solver(module);
}

}  // namespace membrane_python
