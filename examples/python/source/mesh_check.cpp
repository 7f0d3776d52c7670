// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>
#include <membrane/mesh_check/quality.hpp>
#include <membrane/mesh_check/repair.hpp>
#include <membrane/mesh_check/validate.hpp>

#include "types.hpp"

namespace membrane_python {

namespace {

using Repaired = membrane::RepairedMesh<double>;
using membrane::MeshFinding;
using membrane::MeshReport;
using membrane::RepairOptions;
using membrane::RepairReport;
using membrane::SurfaceFacts;

void bind_facts(py::module_& module) {
    py::class_<SurfaceFacts>(module, "SurfaceFacts", doc("SurfaceFacts"))
        .def_readonly("vertices", &SurfaceFacts::vertices, doc("SurfaceFacts::vertices"))
        .def_readonly("edges", &SurfaceFacts::edges, doc("SurfaceFacts::edges"))
        .def_readonly("triangles", &SurfaceFacts::triangles, doc("SurfaceFacts::triangles"))
        .def_readonly("components", &SurfaceFacts::components, doc("SurfaceFacts::components"))
        .def_readonly("borders", &SurfaceFacts::borders, doc("SurfaceFacts::borders"))
        .def_readonly("border_edges", &SurfaceFacts::border_edges, doc("SurfaceFacts::border_edges"))
        .def_readonly("genus", &SurfaceFacts::genus, doc("SurfaceFacts::genus"))
        .def_readonly("shortest_edge", &SurfaceFacts::shortest_edge, doc("SurfaceFacts::shortest_edge"))
        .def_readonly("mean_edge", &SurfaceFacts::mean_edge, doc("SurfaceFacts::mean_edge"))
        .def_readonly("max_edge", &SurfaceFacts::max_edge, doc("SurfaceFacts::max_edge"))
        .def_readonly("area", &SurfaceFacts::area, doc("SurfaceFacts::area"))
        .def_readonly("volume", &SurfaceFacts::volume, doc("SurfaceFacts::volume"));
    using membrane::MeshQuality;
    py::class_<MeshQuality>(module, "MeshQuality", doc("MeshQuality"))
        .def_readonly("smallest_angle", &MeshQuality::smallest_angle, doc("MeshQuality::smallest_angle"))
        .def_readonly("mean_smallest_angle", &MeshQuality::mean_smallest_angle, doc("MeshQuality::mean_smallest_angle"))
        .def_readonly("mean_edge", &MeshQuality::mean_edge, doc("MeshQuality::mean_edge"))
        .def_readonly("even_edges", &MeshQuality::even_edges, doc("MeshQuality::even_edges"));
    module.def("quality_of", &membrane::quality_of<double>, py::arg("mesh"), doc("quality_of"));
}

void bind_validate(py::module_& module) {
    py::class_<MeshFinding>(module, "MeshFinding", doc("MeshFinding"))
        .def_property_readonly(
            "defect", [](const MeshFinding& self) { return std::string(membrane::name(self.defect)); },
            doc("MeshFinding::defect"))
        .def_property_readonly(
            "remedy", [](const MeshFinding& self) { return std::string(membrane::remedy(self.defect)); }, doc("remedy"))
        .def_property_readonly(
            "is_error",
            [](const MeshFinding& self) { return membrane::severity(self.defect) == membrane::Severity::error; },
            doc("severity"))
        .def_readonly("vertices", &MeshFinding::vertices, doc("MeshFinding::vertices"))
        .def_readonly("triangles", &MeshFinding::triangles, doc("MeshFinding::triangles"))
        .def_readonly("text", &MeshFinding::text, doc("MeshFinding::text"));
    py::class_<MeshReport>(module, "MeshReport", doc("MeshReport"))
        .def_readonly("facts", &MeshReport::facts, doc("MeshReport::facts"))
        .def_readonly("findings", &MeshReport::findings, doc("MeshReport::findings"))
        .def_readonly("complete", &MeshReport::complete, doc("MeshReport::complete"))
        .def_property_readonly("empty", &MeshReport::empty, doc("MeshReport::empty"))
        .def_property_readonly("valid", &MeshReport::valid, doc("MeshReport::valid"))
        .def("__str__", [](const MeshReport& self) { return to_string(self); });
    using membrane::ValidateOptions;
    const Keywords options("ValidateOptions", std::pair("tolerance", &ValidateOptions::tolerance),
                           std::pair("max_findings_per_kind", &ValidateOptions::max_findings_per_kind),
                           std::pair("max_pairs_per_triangle", &ValidateOptions::max_pairs_per_triangle));
    const auto validate = [](const py::object& positions, const py::object& triangles, const ValidateOptions& o) {
        const auto x = points_of(positions);
        const auto corners = triangles_of(triangles);
        const py::gil_scoped_release unlock;
        return membrane::validate(x, corners, o);
    };
    options.def(module, "validate", options.taking<const py::object&, const py::object&>(validate),
                py::arg("positions"), py::arg("triangles"));
}

void bind_repair(py::module_& module) {
    py::class_<RepairReport>(module, "RepairReport", doc("RepairReport"))
        .def_readonly("welded", &RepairReport::welded, doc("RepairReport::welded"))
        .def_readonly("repeated", &RepairReport::repeated, doc("RepairReport::repeated"))
        .def_readonly("zero_area", &RepairReport::zero_area, doc("RepairReport::zero_area"))
        .def_readonly("duplicates", &RepairReport::duplicates, doc("RepairReport::duplicates"))
        .def_readonly("reversed", &RepairReport::reversed, doc("RepairReport::reversed"))
        .def_readonly("split", &RepairReport::split, doc("RepairReport::split"))
        .def_readonly("flipped", &RepairReport::flipped, doc("RepairReport::flipped"))
        .def_readonly("isolated", &RepairReport::isolated, doc("RepairReport::isolated"))
        .def_readonly("complete", &RepairReport::complete, doc("RepairReport::complete"))
        .def("__str__", [](const RepairReport& self) { return to_string(self); });
    py::class_<Repaired>(module, "RepairedMesh", doc("RepairedMesh"))
        .def_property_readonly(
            "positions", [](const py::object& self) { return view(self.cast<const Repaired&>().positions, self); },
            doc("RepairedMesh::positions"))
        .def_property_readonly(
            "triangles", [](const py::object& self) { return view(self.cast<const Repaired&>().triangles, self); },
            doc("RepairedMesh::triangles"))
        .def_property_readonly(
            "vertices",
            [](const py::object& self) {
                return view(std::span<const Index>(self.cast<const Repaired&>().vertices), self);
            },
            doc("RepairedMesh::vertices"))
        .def_property_readonly(
            "source_triangles",
            [](const py::object& self) {
                return view(std::span<const Index>(self.cast<const Repaired&>().source_triangles), self);
            },
            doc("RepairedMesh::source_triangles"))
        .def_readonly("report", &Repaired::report, doc("RepairedMesh::report"));
    const Keywords options("RepairOptions", std::pair("weld", &RepairOptions::weld),
                           std::pair("drop_repeated", &RepairOptions::drop_repeated),
                           std::pair("drop_zero_area", &RepairOptions::drop_zero_area),
                           std::pair("drop_duplicates", &RepairOptions::drop_duplicates),
                           std::pair("orient", &RepairOptions::orient),
                           std::pair("split_vertices", &RepairOptions::split_vertices),
                           std::pair("flip_inward", &RepairOptions::flip_inward),
                           std::pair("drop_isolated", &RepairOptions::drop_isolated));
    const auto repair = [](const py::object& positions, const py::object& triangles, const RepairOptions& o) {
        const auto x = points_of(positions);
        const auto corners = triangles_of(triangles);
        const py::gil_scoped_release unlock;
        return membrane::repair(x, corners, o);
    };
    options.def(module, "repair", options.taking<const py::object&, const py::object&>(repair), py::arg("positions"),
                py::arg("triangles"));
}

}  // namespace

void bind_mesh_check(py::module_& module) {
    bind_facts(module);
    bind_validate(module);
    bind_repair(module);
}

}  // namespace membrane_python
