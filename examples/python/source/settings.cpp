// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>

#include "settings.hpp"

namespace membrane_python {

namespace {

using membrane::Requirement;
using membrane::TrialResult;

/// A trajectory, with its mesh's number of vertices.
struct Path {
    Trajectory trajectory;
    Index vertex_count;
};

void check(const char* name, const Mesh& mesh, const Network& network, const Foundation& foundation, const Path& path) {
    check_fit(name, mesh.vertex_count(), mesh.vertex_count(), network, foundation);
    check_count(name, "the trajectory", path.vertex_count, mesh.vertex_count());
}

[[nodiscard]] Choice choose(const Mesh& mesh, const Network& network, const Foundation& foundation, const Path& path,
                            double force_error, double time, const Rule& rule, double mesh_error,
                            const Experiment& experiment) {
    check("choose_settings", mesh, network, foundation, path);
    const Scene scene{mesh, network, foundation, path.trajectory};
    const Requirement requirement{.force_error = force_error, .time = time, .mesh_error = mesh_error};
    return std::visit([&](const auto& one) { return choose_settings(scene, requirement, experiment, one); }, rule);
}

[[nodiscard]] References references_of(const Mesh& mesh, const Network& network, const Foundation& foundation,
                                       const Path& path, Index tick_stride) {
    check("equilibria", mesh, network, foundation, path);
    return unlocked("equilibria", network, foundation, [&](const auto& springs, const auto& volume) {
        return membrane::equilibria(mesh, springs, volume, path.trajectory, tick_stride);
    });
}

[[nodiscard]] TrialResult trial(const Mesh& mesh, const Network& network, const Foundation& foundation,
                                const Path& path, const References& references, const Rule& rule,
                                const SolverOptions& options) {
    check("run_trial", mesh, network, foundation, path);
    const Scene scene{mesh, network, foundation, path.trajectory};
    return std::visit([&](const auto& one) { return run_trial(scene, references, options, one); }, rule);
}

void bind_results(py::module_& module) {
    py::class_<TrialResult>(module, "TrialResult", doc("TrialResult"))
        .def_readonly("force_error", &TrialResult::force_error, doc("TrialResult::force_error"))
        .def_readonly("position_error", &TrialResult::position_error, doc("TrialResult::position_error"))
        .def_readonly("time", &TrialResult::time, doc("TrialResult::time"))
        .def_readonly("layers_reached", &TrialResult::layers_reached, doc("TrialResult::layers_reached"))
        .def_readonly("ticks_compared", &TrialResult::ticks_compared, doc("TrialResult::ticks_compared"))
        .def_readonly("advanced", &TrialResult::advanced, doc("TrialResult::advanced"))
        .def_readonly("max_force_error", &TrialResult::max_force_error, doc("TrialResult::max_force_error"))
        .def_readonly("max_speed", &TrialResult::max_speed, doc("TrialResult::max_speed"))
        .def_readonly("max_displacement", &TrialResult::max_displacement, doc("TrialResult::max_displacement"));
    py::class_<Choice, TrialResult>(module, "ChosenSettings", doc("ChosenSettings"))
        .def_readonly("options", &Choice::options, doc("ChosenSettings::options"))
        .def_readonly("satisfied", &Choice::satisfied, doc("ChosenSettings::satisfied"))
        .def_readonly("keeps_error", &Choice::keeps_error, doc("ChosenSettings::keeps_error"))
        .def_readonly("keeps_time", &Choice::keeps_time, doc("ChosenSettings::keeps_time"))
        .def_readonly("edge_factor", &Choice::edge_factor, doc("ChosenSettings::edge_factor"));
    using membrane::ReferenceTick;
    py::class_<ReferenceTick>(module, "ReferenceTick", doc("ReferenceTick"))
        .def_readonly("tick", &ReferenceTick::tick, doc("ReferenceTick::tick"))
        .def_readonly("force", &ReferenceTick::force, doc("ReferenceTick::force"))
        .def_property_readonly(
            "x", [](const py::object& self) { return view(self.cast<const ReferenceTick&>().x, self); },
            doc("ReferenceTick::x"));
}

}  // namespace

void bind_settings(py::module_& module) {
    bind_results(module);
    py::class_<Path>(module, "ToolTrajectory", doc("ToolTrajectory"))
        .def(py::init([](const Mesh& mesh, const std::vector<Tool>& tools, double dt, double fine_triangles) {
                 return Path{Trajectory(mesh, tools, dt, {.fine_triangles = fine_triangles}), mesh.vertex_count()};
             }),
             py::arg("mesh"), py::arg("tools"), py::arg("dt"),
             py::arg("fine_triangles") = membrane::TrackerOptions().fine_triangles,
             doc("ToolTrajectory::ToolTrajectory"))
        .def_property_readonly(
            "ticks", [](const Path& self) { return self.trajectory.ticks(); }, doc("ToolTrajectory::ticks"))
        .def_property_readonly(
            "dt", [](const Path& self) { return self.trajectory.dt(); }, doc("ToolTrajectory::dt"));
    const auto mesh = py::arg("mesh"), network = py::arg("network"), foundation = py::arg("foundation"),
               trajectory = py::arg("trajectory");
    const auto rule = py::arg("rule") = membrane::BlockStep{};
    module.def("equilibria", &references_of, mesh, network, foundation, trajectory, py::arg("tick_stride") = 1,
               doc("equilibria"));
    const auto keywords = solver_keywords();
    keywords.def(
        module, "run_trial",
        keywords.taking<const Mesh&, const Network&, const Foundation&, const Path&, const References&, const Rule&>(
            &trial),
        mesh, network, foundation, trajectory, py::arg("references"), rule);
    const Keywords options(
        "GridSearchOptions", std::pair("layers", &Experiment::layers), std::pair("sweeps", &Experiment::sweeps),
        std::pair("contact_iterations", &Experiment::contact_iterations), std::pair("others", &Experiment::others),
        std::pair("safety_factor", &Experiment::safety_factor), std::pair("tick_stride", &Experiment::tick_stride),
        std::pair("repetitions", &Experiment::repetitions), std::pair("count_viscosity", &Experiment::count_viscosity));
    options.def(module, "choose_settings",
                options.taking<const Mesh&, const Network&, const Foundation&, const Path&, double, double, const Rule&,
                               double>(&choose),
                mesh, network, foundation, trajectory, py::arg("force_error") = Requirement{}.force_error,
                py::arg("time") = Requirement{}.time, rule, py::arg("mesh_error") = Requirement{}.mesh_error);
}

}  // namespace membrane_python
