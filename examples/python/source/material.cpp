// SPDX-License-Identifier: MIT
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/recommended_layers.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

#include "types.hpp"

namespace membrane_python {

namespace {

using membrane::Material;
using Layer = membrane::FoundationLayer;

/// A function of a mesh and of constants that returns a number for each vertex or spring.
template <class Constants>
void def_each(py::module_& module, const char* name, std::vector<double> (*of)(const Mesh&, const Constants&),
              const char* constants) {
    module.def(
        name, [of](const Mesh& mesh, const Constants& with) { return copy(of(mesh, with)); }, py::arg("mesh"),
        py::arg(constants), doc(name));
}

}  // namespace

void bind_material(py::module_& module) {
    auto material = py::class_<Material>(module, "Material", doc("Material"));
    const Keywords fields("Material", std::pair("young_modulus", &Material::young_modulus),
                          std::pair("poisson_ratio", &Material::poisson_ratio),
                          std::pair("thickness", &Material::thickness), std::pair("density", &Material::density));
    fields.def_init(material, fields.taking<>([](const Material& m) { return (m.validate(), m); }));
    fields.def_fields(material);
    material.def("biaxial_stiffness", &Material::biaxial_stiffness, doc("Material::biaxial_stiffness"));

    auto layer = py::class_<Layer>(module, "FoundationLayer", doc("FoundationLayer"));
    const Keywords layer_fields("FoundationLayer", std::pair("young_modulus", &Layer::young_modulus),
                                std::pair("poisson_ratio", &Layer::poisson_ratio),
                                std::pair("thickness", &Layer::thickness));
    layer_fields.def_init(layer, layer_fields.taking<>([](const Layer& l) { return (l.validate(), l); }));
    layer_fields.def_fields(layer);
    layer.def("normal_stiffness", &Layer::normal_stiffness, doc("FoundationLayer::normal_stiffness"))
        .def("tangential_stiffness", &Layer::tangential_stiffness, doc("FoundationLayer::tangential_stiffness"));

    using Range = membrane::MaterialRange;
    py::class_<Range>(module, "MaterialRange", doc("MaterialRange"))
        .def_readonly("typical", &Range::typical, doc("MaterialRange::typical"))
        .def_readonly("lower", &Range::lower, doc("MaterialRange::lower"))
        .def_readonly("upper", &Range::upper, doc("MaterialRange::upper"));
    auto materials = module.def_submodule("materials", "Published constants of tissues of the eye.");
    materials.def("cornea", &membrane::materials::cornea, doc("materials::cornea"));
    materials.def("lens_capsule", &membrane::materials::lens_capsule, doc("materials::lens_capsule"));
    materials.def("retina", &membrane::materials::retina, doc("materials::retina"));

    def_each<Material>(module, "spring_stiffnesses", &membrane::spring_stiffnesses<double>, "material");
    def_each<Material>(module, "vertex_masses", &membrane::vertex_masses<double>, "material");
    def_each<Layer>(module, "normal_stiffnesses", &membrane::normal_stiffnesses<double>, "foundation");
    def_each<Layer>(module, "tangential_stiffnesses", &membrane::tangential_stiffnesses<double>, "foundation");
    module.def(
        "vertex_areas", [](const Mesh& mesh) { return copy(membrane::vertex_areas(mesh)); }, py::arg("mesh"),
        doc("vertex_areas"));
    module.def("flexural_rigidity", &membrane::flexural_rigidity, py::arg("material"), doc("flexural_rigidity"));

    using Layers = membrane::RecommendedLayers;
    py::class_<Layers>(module, "RecommendedLayers", doc("RecommendedLayers"))
        .def_readonly("normal", &Layers::normal, doc("RecommendedLayers::normal"))
        .def_readonly("tangential", &Layers::tangential, doc("RecommendedLayers::tangential"));
    module.def("recommended_layers", &membrane::recommended_layers<double>, py::arg("mesh"), py::arg("material"),
               py::arg("foundation"), doc("recommended_layers"));
}

}  // namespace membrane_python
