// SPDX-License-Identifier: MIT
#include <utility>
#include <vector>

#include <pybind11/stl.h>
#include <membrane/calibration/fit.hpp>
#include <membrane/calibration/indentation.hpp>

#include "accuracy.hpp"

namespace membrane_python {

namespace {

using Numbers = std::span<const double>;
using membrane::Fit;
using membrane::FitOptions;

/// Stands for the builder of a membrane where only the tool's place is asked for; never called.
struct NoBuilder {
    std::pair<membrane::MassSpringNetwork<double, membrane::LinearSpring>, membrane::NoFoundation> operator()(
        Numbers constants) const;
};

/// `Indentation` with a function of Python that returns network and foundation.
class Indentation {
  public:
    Indentation(const Mesh& mesh, const Tool& tool, const Vector& direction, py::object build, double fine_triangles)
        : mesh_(mesh),
          tool_(tool),
          tracker_{.fine_triangles = fine_triangles},
          touching_(membrane::Indentation(mesh, tool, direction, NoBuilder(), tracker_).touching()),
          direction_(direction),
          build_(std::move(build)) {}

    /// With Python's lock, which is released while equilibria are found.
    [[nodiscard]] std::vector<double> operator()(const std::vector<double>& constants,
                                                 const std::vector<double>& depths) const {
        const auto [network_object, foundation_object] =
            build_(copy(constants)).cast<std::pair<py::object, py::object>>();
        const auto& network = network_object.cast<const Network&>();
        const auto& foundation = foundation_object.cast<const Foundation&>();
        check_fit("Indentation", mesh_.vertex_count(), mesh_.vertex_count(), network, foundation);
        const auto press_with = [&](const auto& springs, const auto& volume) {
            const auto build = [&](Numbers) { return std::pair(springs, volume); };
            return membrane::Indentation(mesh_, tool_, direction_, build, tracker_)(constants, depths);
        };
        return unlocked("Indentation", network, foundation, press_with);
    }

    [[nodiscard]] const Tool& touching() const noexcept { return touching_; }

  private:
    const Mesh& mesh_;
    Tool tool_;
    membrane::TrackerOptions tracker_;
    Tool touching_;
    Vector direction_;
    py::object build_;
};

/// A model that is a function of Python.
[[nodiscard]] Fit fit(const std::vector<double>& depth, const std::vector<double>& force,
                      const std::vector<double>& start, const py::object& model, const std::vector<double>& deviation,
                      const FitOptions& options) {
    const auto call = [&](Numbers constants, Numbers depths) {
        const py::gil_scoped_acquire lock;
        return model(copy(constants), copy(depths)).cast<std::vector<double>>();
    };
    const py::gil_scoped_release unlock;
    return membrane::fit({depth, force, deviation}, start, call, options);
}

}  // namespace

void bind_calibration(py::module_& module) {
    py::class_<Indentation>(module, "Indentation", doc("Indentation"))
        .def(py::init<const Mesh&, const Tool&, const Vector&, py::object, double>(), py::arg("mesh"), py::arg("tool"),
             py::arg("direction"), py::arg("build"),
             py::arg("fine_triangles") = membrane::TrackerOptions().fine_triangles, py::keep_alive<1, 2>(),
             doc("Indentation::Indentation"))
        .def(
            "__call__",
            [](const Indentation& self, const std::vector<double>& constants, const std::vector<double>& depths) {
                return copy(self(constants, depths));
            },
            py::arg("constants"), py::arg("depths"), doc("Indentation::operator()"))
        .def_property_readonly("touching", &Indentation::touching, doc("Indentation::touching"));
    py::class_<Fit>(module, "Fit", doc("Fit"))
        .def_property_readonly(
            "constants", [](const Fit& self) { return copy(self.constants); }, doc("Fit::constants"))
        .def_property_readonly(
            "intervals",
            [](const Fit& self) {
                std::vector<std::pair<double, double>> intervals;
                for (const auto& [lower, upper] : self.intervals) intervals.emplace_back(lower, upper);
                return intervals;
            },
            doc("Fit::intervals"))
        .def_property_readonly(
            "correlation", [](const Fit& self) { return copy(self.correlation); }, doc("Fit::correlation"))
        .def_readonly("identifiable", &Fit::identifiable, doc("Fit::identifiable"))
        .def_readonly("misfit", &Fit::misfit, doc("Fit::misfit"))
        .def_readonly("evaluations", &Fit::evaluations, doc("Fit::evaluations"))
        .def_readonly("converged", &Fit::converged, doc("Fit::converged"));
    const Keywords options("FitOptions", std::pair("tolerance", &FitOptions::tolerance),
                           std::pair("step", &FitOptions::step), std::pair("search_factor", &FitOptions::search_factor),
                           std::pair("confidence", &FitOptions::confidence),
                           std::pair("max_interval_ratio", &FitOptions::max_interval_ratio),
                           std::pair("min_sensitivity", &FitOptions::min_sensitivity),
                           std::pair("max_iterations", &FitOptions::max_iterations));
    using Column = const std::vector<double>&;
    options.def(module, "fit", options.taking<Column, Column, Column, const py::object&, Column>(&fit),
                py::arg("depth"), py::arg("force"), py::arg("start"), py::arg("model"),
                py::arg("deviation") = std::vector<double>{});
}

}  // namespace membrane_python
