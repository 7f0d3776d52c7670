// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>
#include <membrane/tissue/spring_stiffness.hpp>

#include "loop_call.hpp"
#include "types.hpp"

namespace membrane_python {

namespace {

void bind_mesh(py::module_& module) {
    py::class_<Mesh>(module, "TriangleMesh", doc("TriangleMesh"))
        .def(py::init([](const py::object& positions, const py::object& triangles) {
                 return Mesh(points_of(positions), triangles_of(triangles));
             }),
             py::arg("positions"), py::arg("triangles"), doc("TriangleMesh::TriangleMesh"))
        .def_property_readonly("vertex_count", &Mesh::vertex_count, doc("TriangleMesh::vertex_count"))
        .def_property_readonly("triangle_count", &Mesh::triangle_count, doc("TriangleMesh::triangle_count"))
        .def_property_readonly(
            "positions", [](const py::object& self) { return view(self.cast<const Mesh&>().positions(), self); },
            doc("TriangleMesh::positions"))
        .def_property_readonly(
            "triangles", [](const py::object& self) { return view(self.cast<const Mesh&>().triangles(), self); },
            doc("TriangleMesh::triangles"))
        .def("__repr__", [](const Mesh& mesh) {
            return "TriangleMesh of " + std::to_string(mesh.vertex_count()) + " vertices and " +
                   std::to_string(mesh.triangle_count()) + " triangles";
        });
    module.def(
        "border", [](const Mesh& mesh) { return copy(membrane::border(mesh)); }, py::arg("mesh"), doc("border"));
    module.def(
        "edges",
        [](const Mesh& mesh) {
            const membrane::Adjacency adjacency(mesh);
            std::vector<Index> ends;
            for (const auto& [first, second] : adjacency.edges()) ends.insert(ends.end(), {first, second});
            return py::object(copy(std::span<const Index>(ends)).attr("reshape")(-1, 2));
        },
        py::arg("mesh"), doc("Adjacency::edges"));
    module.def("mean_edge", &membrane::mean_edge<double>, py::arg("mesh"), doc("mean_edge"));
}

void bind_shapes(py::module_& module) {
    using namespace membrane;
    const Keywords icosphere_options("IcosphereOptions", std::pair("radius", &IcosphereOptions::radius),
                                     std::pair("subdivisions", &IcosphereOptions::subdivisions));
    icosphere_options.def(module, "icosphere", icosphere_options.taking<>(&icosphere<double>));
    const Keywords sheet_options("SheetOptions", std::pair("width", &SheetOptions::width),
                                 std::pair("height", &SheetOptions::height),
                                 std::pair("columns", &SheetOptions::columns), std::pair("rows", &SheetOptions::rows));
    sheet_options.def(module, "sheet", sheet_options.taking<>(&sheet<double>));
    const Keywords disc_options("DiscOptions", std::pair("radius", &DiscOptions::radius),
                                std::pair("rings", &DiscOptions::rings));
    disc_options.def(module, "disc", disc_options.taking<>(&disc<double>));
    const Keywords cap_options("SphericalCapOptions", std::pair("radius", &SphericalCapOptions::radius),
                               std::pair("diameter", &SphericalCapOptions::diameter),
                               std::pair("rings", &SphericalCapOptions::rings));
    cap_options.def(module, "spherical_cap", cap_options.taking<>(&spherical_cap<double>));
}

void bind_normals(py::module_& module) {
    auto normals = py::class_<Normals>(module, "VertexNormals", doc("VertexNormals"));
    normals
        .def(py::init([](const Mesh& mesh) {
                 return Normals{membrane::VertexNormals(mesh), mesh.vertex_count(), SurfaceVersion(mesh)};
             }),
             py::arg("mesh"), doc("VertexNormals::VertexNormals"))
        .def_property_readonly(
            "values", [](const py::object& self) { return view(self.cast<const Normals&>().normals.values(), self); },
            doc("VertexNormals::values"));
    def_in_loop(
        normals, "update",
        [](Normals& self, Positions x, const std::optional<Moved>& moved) {
            check_count("VertexNormals", "x", x.count, self.vertex_count);
            if (!moved) {
                (void)self.normals.update(x.map());
                return;
            }
            check_moved("VertexNormals", *moved, self.vertex_count);
            (void)self.normals.update(x.map(), moved->vertices);
        },
        py::arg("x"), py::arg("moved") = py::none(), doc("VertexNormals::update"));
}

}  // namespace

void bind_surface(py::module_& module) {
    bind_mesh(module);
    bind_shapes(module);
    bind_normals(module);
}

}  // namespace membrane_python
