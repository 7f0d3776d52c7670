// SPDX-License-Identifier: MIT
#include <functional>

#include <pybind11/stl.h>
#include <membrane/meshing/distmesh.hpp>

#include "types.hpp"

namespace membrane_python {

namespace {

using membrane::Bounds;
using membrane::DistMeshOptions;

/// A body of any type: those of the library, with a gradient or without, and functions of Python.
struct Body {
    std::function<double(const Vector&)> distance;
    std::function<Vector(const Vector&)> own_gradient = {};
    Bounds box = {};

    double operator()(const Vector& p) const { return distance(p); }
    [[nodiscard]] Bounds bounds() const { return box; }
};

/// A body that gives its own gradient.
struct BodyWithGradient : Body {
    [[nodiscard]] Vector gradient(const Vector& p) const { return own_gradient(p); }
};

template <class Solid>
[[nodiscard]] Body body_of(const Solid& solid) {
    Body body{.distance = solid, .box = membrane::bounds_of(solid)};
    if constexpr (membrane::GivesGradient<Solid>) {
        body.own_gradient = [solid](const Vector& p) { return solid.gradient(p); };
    }
    return body;
}

/// A number at a point, by a function of Python, which needs its lock.
[[nodiscard]] std::function<double(const Vector&)> number_by(const py::object& function) {
    return [&function](const Vector& p) {
        const py::gil_scoped_acquire lock;
        return function(p).cast<double>();
    };
}

[[nodiscard]] Body body_from(const py::object& object) {
    if (py::isinstance<Body>(object)) return object.cast<Body>();
    return {.distance = number_by(object)};
}

/// Calls `function` with the body as one that gives a gradient, if it does.
template <class Function>
[[nodiscard]] Mesh with_gradient(const Body& body, Function function) {
    return body.own_gradient ? function(BodyWithGradient{body}) : function(body);
}

[[nodiscard]] Mesh distmesh(const py::object& surface, const py::object& edge_length, const py::object& trim,
                            const std::optional<std::pair<Vector, Vector>>& bounds, const py::object& progress,
                            const DistMeshOptions& given) {
    DistMeshOptions options = given;
    if (bounds) options.bounds = Bounds{bounds->first, bounds->second};
    if (PyCallable_Check(edge_length.ptr()) != 0) {
        options.edge_length = number_by(edge_length);
    } else {
        options.edge_length = edge_length.cast<double>();
    }
    if (!progress.is_none()) {
        options.progress = [&progress](const membrane::RemeshProgress& now) {
            const py::gil_scoped_acquire lock;
            progress(now);
        };
    }
    const Body body = body_from(surface), within = trim.is_none() ? Body{} : body_from(trim);
    const py::gil_scoped_release unlock;
    return with_gradient(body, [&](const auto& whole) {
        if (!within.distance) return membrane::distmesh(whole, options);
        return with_gradient(
            within, [&](const auto& part) { return membrane::distmesh(membrane::trimmed(whole, part), options); });
    });
}

/// Defines the constructor of a body of the library.
template <class Solid, class... Field>
void def_solid(py::module_& module, const char* name, const Keywords<Solid, Field...>& fields) {
    fields.def(module, name, fields.template taking<>([](const Solid& solid) { return body_of(solid); }));
}

void bind_bodies(py::module_& module) {
    using namespace membrane;
    py::class_<Body>(module, "Body", doc("SignedDistance"))
        .def("__call__", &Body::operator(), py::arg("p"), "Signed distance of `p` to the surface [m].");
    def_solid(module, "Ball", Keywords("Ball", std::pair("centre", &Ball::centre), std::pair("radius", &Ball::radius)));
    def_solid(module, "Ellipsoid",
              Keywords("Ellipsoid", std::pair("centre", &Ellipsoid::centre), std::pair("radii", &Ellipsoid::radii)));
    def_solid(module, "Cuboid",
              Keywords("Cuboid", std::pair("centre", &Cuboid::centre), std::pair("half_size", &Cuboid::half_size)));
    def_solid(module, "Capsule",
              Keywords("Capsule", std::pair("start", &Capsule::start), std::pair("end", &Capsule::end),
                       std::pair("radius", &Capsule::radius)));
    def_solid(module, "HalfSpace",
              Keywords("HalfSpace", std::pair("point", &HalfSpace::point), std::pair("normal", &HalfSpace::normal)));
    const auto a = py::arg("a"), b = py::arg("b");
    module.def(
        "united", [](const Body& first, const Body& second) { return body_of(united(first, second)); }, a, b,
        doc("united"));
    module.def(
        "intersection", [](const Body& first, const Body& second) { return body_of(intersection(first, second)); }, a,
        b, doc("intersection"));
    module.def(
        "difference", [](const Body& first, const Body& second) { return body_of(difference(first, second)); }, a, b,
        doc("difference"));
    module.def(
        "offset", [](const Body& body, double by) { return body_of(offset(body, by)); }, py::arg("body"), py::arg("by"),
        doc("offset"));
}

}  // namespace

void bind_meshing(py::module_& module) {
    bind_bodies(module);
    using membrane::RemeshProgress;
    py::class_<RemeshProgress>(module, "RemeshProgress", doc("RemeshProgress"))
        .def_readonly("iteration", &RemeshProgress::iteration, doc("RemeshProgress::iteration"))
        .def_readonly("iterations", &RemeshProgress::iterations, doc("RemeshProgress::iterations"))
        .def_readonly("vertices", &RemeshProgress::vertices, doc("RemeshProgress::vertices"))
        .def_readonly("movement", &RemeshProgress::movement, doc("RemeshProgress::movement"));
    const Keywords options("DistMeshOptions", std::pair("iterations", &DistMeshOptions::iterations),
                           std::pair("spacing", &DistMeshOptions::spacing));
    using Object = const py::object&;
    using Box = const std::optional<std::pair<Vector, Vector>>&;
    options.def(module, "distmesh", options.taking<Object, Object, Object, Box, Object>(&distmesh), py::arg("body"),
                py::arg("edge_length"), py::arg("within") = py::none(), py::arg("bounds") = py::none(),
                py::arg("progress") = py::none());
}

}  // namespace membrane_python
