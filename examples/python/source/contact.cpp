// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>

#include "loop_call.hpp"
#include "types.hpp"

namespace membrane_python {

namespace {

void bind_tool(py::module_& module) {
    auto tool = py::class_<Tool>(module, "Tool", doc("Tool"));
    const Keywords fields("Tool", std::pair("position", &Tool::position), std::pair("axis", &Tool::axis),
                          std::pair("radius", &Tool::radius), std::pair("velocity", &Tool::velocity),
                          std::pair("time", &Tool::time), std::pair("grasping", &Tool::grasping));
    fields.def_init(tool, fields.taking<>([](const Tool& made) { return made; }));
    const auto def_field = [&](const char* name, auto field, const char* comment) {
        tool.def_property(
            name, [field](const Tool& self) { return self.*field; },
            [field](Tool& self, std::remove_cvref_t<decltype(std::declval<Tool>().*field)> value) {
                self.*field = value;
            },
            comment);
    };
    def_field("position", &Tool::position, doc("Tool::position"));
    def_field("axis", &Tool::axis, doc("Tool::axis"));
    def_field("radius", &Tool::radius, doc("Tool::radius"));
    def_field("velocity", &Tool::velocity, doc("Tool::velocity"));
    def_field("time", &Tool::time, doc("Tool::time"));
    def_field("grasping", &Tool::grasping, doc("Tool::grasping"));
    tool.def("__copy__", [](const Tool& self) { return self; });
}

void bind_contact_data(py::module_& module) {
    using membrane::ContactPhase;
    py::enum_<ContactPhase>(module, "ContactPhase", doc("ContactPhase"))
        .value("none", ContactPhase::none, doc("ContactPhase::none"))
        .value("began", ContactPhase::began, doc("ContactPhase::began"))
        .value("ongoing", ContactPhase::ongoing, doc("ContactPhase::ongoing"))
        .value("ended", ContactPhase::ended, doc("ContactPhase::ended"));
    py::class_<Contact>(module, "Contact", doc("Contact"))
        .def_property_readonly(
            "touching", [](const Contact& self) { return self.touching(); }, doc("Contact::touching"))
        .def_readonly("phase", &Contact::phase, doc("Contact::phase"))
        .def_readonly("triangle", &Contact::triangle, doc("Contact::triangle"))
        .def_readonly("corners", &Contact::corners, doc("Contact::corners"))
        .def_readonly("barycentric", &Contact::barycentric, doc("Contact::barycentric"))
        .def_readonly("point", &Contact::point, doc("Contact::point"))
        .def_readonly("normal", &Contact::normal, doc("Contact::normal"))
        .def_property_readonly(
            "side", [](const Contact& self) { return self.patch.side; }, doc("ContactPatch::side"))
        .def_readonly("gap", &Contact::gap, doc("Contact::gap"))
        .def_readonly("depth", &Contact::depth, doc("Contact::depth"))
        .def_property_readonly(
            "radius", [](const Contact& self) { return self.patch.radius; }, doc("ContactPatch::radius"))
        .def_property_readonly(
            "tunnelled", [](const Contact& self) { return self.patch.tunnelled; }, doc("ContactPatch::tunnelled"));
    py::class_<Grasp>(module, "Grasp", doc("Grasp"))
        .def_property_readonly("holding", &Grasp::holding, doc("Grasp::holding"))
        .def_readonly("triangle", &Grasp::triangle, doc("Grasp::triangle"))
        .def_readonly("corners", &Grasp::corners, doc("Grasp::corners"))
        .def_readonly("barycentric", &Grasp::barycentric, doc("Grasp::barycentric"))
        .def_readonly("offset", &Grasp::offset, doc("Grasp::offset"))
        .def_readonly("origin", &Grasp::origin, doc("Grasp::origin"))
        .def_readonly("holding_force", &Grasp::holding_force, doc("Grasp::holding_force"))
        .def("displacement", &Grasp::displacement, py::arg("tool"), doc("Grasp::displacement"));
}

void bind_tree(py::module_& module) {
    using membrane::TreeOptions;
    const Keywords options("TreeOptions", std::pair("balance_threshold", &TreeOptions::balance_threshold));
    auto tree = py::class_<Tree>(module, "AabbTree", doc("AabbTree"));
    options.def_init(tree, options.taking<const Mesh&>([](const Mesh& mesh, const TreeOptions& o) {
        return Tree{membrane::AabbTree(mesh, o), mesh.vertex_count(), SurfaceVersion(mesh)};
    }),
                     py::arg("mesh"));
    def_in_loop(
        tree, "refit",
        [](Tree& self, Positions x, const std::optional<Moved>& moved) {
            check_count("AabbTree", "x", x.count, self.vertex_count);
            if (moved) check_moved("AabbTree", *moved, self.vertex_count);
            (void)(moved ? self.tree.refit(x.map(), moved->vertices) : self.tree.refit(x.map()));
        },
        py::arg("x"), py::arg("moved") = py::none(), doc("AabbTree::refit"));
    tree.def(
        "closest_point",
        [](const Tree& self, Positions x, const Vector& q) {
            check_count("AabbTree", "x", x.count, self.vertex_count);
            return self.tree.closest_point(x.map(), q);
        },
        py::arg("x"), py::arg("q"), doc("AabbTree::closest_point"));
    tree.def(
        "first_hit",
        [](const Tree& self, Positions x, const Vector& from, const Vector& to) {
            check_count("AabbTree", "x", x.count, self.vertex_count);
            return self.tree.first_hit(x.map(), from, to);
        },
        py::arg("x"), py::arg("start"), py::arg("end"), doc("AabbTree::first_hit"));
    tree.def(
        "overlap_sphere",
        [](const Tree& self, Positions x, const Vector& centre, double radius) {
            check_count("AabbTree", "x", x.count, self.vertex_count);
            std::vector<Index> found;
            self.tree.overlap_sphere(x.map(), centre, radius, [&](Index f) { found.push_back(f); });
            return copy(std::span<const Index>(found));
        },
        py::arg("x"), py::arg("centre"), py::arg("radius"),
        "The triangles that intersect the sphere, in a reproducible order.");
    using Point = membrane::SurfacePoint<double>;
    py::class_<Point>(module, "SurfacePoint", doc("SurfacePoint"))
        .def_readonly("triangle", &Point::triangle, doc("SurfacePoint::triangle"))
        .def_readonly("barycentric", &Point::barycentric, doc("SurfacePoint::barycentric"))
        .def_readonly("point", &Point::point, doc("SurfacePoint::point"))
        .def_readonly("squared_distance", &Point::squared_distance, doc("SurfacePoint::squared_distance"));
    using Hit = membrane::SurfaceHit<double>;
    py::class_<Hit>(module, "SurfaceHit", doc("SurfaceHit"))
        .def_readonly("triangle", &Hit::triangle, doc("SurfaceHit::triangle"))
        .def_readonly("fraction", &Hit::fraction, doc("SurfaceHit::fraction"))
        .def_readonly("barycentric", &Hit::barycentric, doc("SurfaceHit::barycentric"));
}

void bind_tracking(py::module_& module) {
    using membrane::TrackerOptions;
    const Keywords options("TrackerOptions", std::pair("margin", &TrackerOptions::margin),
                           std::pair("fine_triangles", &TrackerOptions::fine_triangles),
                           std::pair("full_query_interval", &TrackerOptions::full_query_interval),
                           std::pair("max_contact_points", &TrackerOptions::max_contact_points));
    auto tracker = py::class_<Tracker>(module, "ContactTracker", doc("ContactTracker"));
    options.def_init(tracker, options.taking<const Mesh&>([](const Mesh& mesh, const TrackerOptions& o) {
        return Tracker{membrane::ContactTracker(mesh, o), mesh.vertex_count(), SurfaceVersion(mesh)};
    }),
                     py::arg("mesh"));
    def_in_loop<py::return_value_policy::reference_internal>(
        tracker, "update",
        [](Tracker& self, const Tree& tree, Positions x, const Tool& tool) -> Contact& {
            check_count("ContactTracker", "x", x.count, self.vertex_count);
            check_count("ContactTracker", "the tree", tree.vertex_count, self.vertex_count);
            check_version("ContactTracker", "the tree", tree.version, self.version);
            static_cast<membrane::Contact<double>&>(self.contact) = self.tracker.update(tree.tree, x.map(), tool);
            self.contact.vertex_count = self.vertex_count;
            return self.contact;
        },
        py::arg("tree"), py::arg("x"), py::arg("tool"), doc("ContactTracker::update"));
    tracker.def(
        "reset", [](Tracker& self) { self.tracker.reset(); }, doc("ContactTracker::reset"));

    using membrane::GraspOptions;
    const Keywords grasp_options("GraspOptions", std::pair("snap_to_vertex", &GraspOptions::snap_to_vertex),
                                 std::pair("holding_force", &GraspOptions::holding_force),
                                 std::pair("jaw_length", &GraspOptions::jaw_length));
    auto grasper = py::class_<Forceps>(module, "Grasper", doc("Grasper"));
    grasp_options.def_init(grasper, grasp_options.taking<const Mesh&>([](const Mesh& mesh, const GraspOptions& o) {
        return Forceps{membrane::Grasper(mesh, o), mesh.vertex_count(), SurfaceVersion(mesh)};
    }),
                           py::arg("mesh"));
    def_in_loop<py::return_value_policy::reference_internal>(
        grasper, "update",
        [](Forceps& self, const Contact& contact, Positions x, const Tool& tool) -> Grasp& {
            check_count("Grasper", "x", x.count, self.vertex_count);
            check_count("Grasper", "the contact", contact.vertex_count, self.vertex_count);
            return self.grasp = self.grasper.update(contact, x.map(), tool);
        },
        py::arg("contact"), py::arg("x"), py::arg("tool"), doc("Grasper::update"));
    grasper.def(
        "slip",
        [](Forceps& self, Positions x, const Tool& tool, const Vector& reaction) {
            check_count("Grasper", "x", x.count, self.vertex_count);
            return self.grasper.slip(x.map(), tool, reaction);
        },
        py::arg("x"), py::arg("tool"), py::arg("reaction"), doc("Grasper::slip"));
    grasper.def_property_readonly(
        "dissipated", [](const Forceps& self) { return self.grasper.dissipated(); }, doc("Grasper::dissipated"));
    grasper.def(
        "reset", [](Forceps& self) { self.grasper.reset(); }, doc("Grasper::reset"));
}

}  // namespace

void bind_contact(py::module_& module) {
    bind_tool(module);
    bind_contact_data(module);
    bind_tree(module);
    bind_tracking(module);
}

}  // namespace membrane_python
