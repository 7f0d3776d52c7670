// SPDX-License-Identifier: MIT
//
// The module `membrane._membrane`: the library's own names, one source file for each of its folders.
#include <algorithm>
#include <stdexcept>
#include <string_view>

#include <membrane/core/check.hpp>
#include <membrane/core/version.hpp>

#include "types.hpp"

namespace membrane_python {

namespace {

struct Comment {
    std::string_view name;
    const char* text;
};

constexpr Comment comments[] = {
#include "docstrings.inc"
};

}  // namespace

const char* doc(const char* name) {
    const auto* found = std::lower_bound(std::begin(comments), std::end(comments), std::string_view(name),
                                         [](const Comment& comment, std::string_view of) { return comment.name < of; });
    if (found == std::end(comments) || found->name != name) {
        throw std::logic_error(std::string("the headers have no comment of ") + name);
    }
    return found->text;
}

Constraints::Constraints(std::string_view component, const py::args& arguments, Index vertex_count) {
    if (arguments.size() > max_constraints) {
        refuse(component, "there must be at most ", max_constraints, " constraints, got ", arguments.size());
    }
    for (const auto& argument : arguments) {
        py::detail::make_caster<Acting> caster;
        if (!caster.load(argument, false)) {
            throw py::type_error("constraints are press, pull, load and pin, and the ligaments of a tear");
        }
        const auto& constraint = py::detail::cast_op<const Acting&>(caster);
        if (constraint.vertex_count != membrane::no_index) {
            const bool is_contact = static_cast<bool>(constraint.contact);
            check_count(component, is_contact ? "the contact" : "the tear", constraint.vertex_count, vertex_count);
        }
        for (std::size_t i = 0; constraint.friction() != nullptr && i < count; ++i) {
            if (all[i].acting().friction() != constraint.friction()) continue;
            refuse(component, "constraints must each have a friction of its own, got the same for ", i, " and ", count);
        }
        all[count++] = Described(constraint);
    }
}

void Constraints::check_static(std::string_view component) const {
    for (std::size_t i = 0; i < count; ++i) {
        const auto& any = all[i].acting().any;
        if (std::holds_alternative<membrane::FrictionalContact<double>>(any)) {
            refuse(component, "constraints must be press, pull, load and pin, got one with friction");
        }
        if (std::holds_alternative<membrane::LigamentForces<double>>(any)) {
            refuse(component, "constraints must be press, pull, load and pin, got ligaments");
        }
    }
}

void check_fit(std::string_view component, Index vertex_count, Eigen::Index points, const Network& network,
               const Foundation& foundation) {
    check_count(component, "x", points, vertex_count);
    check_count(component, "the network", network.vertex_count(), vertex_count);
    check_count(component, "the foundation", foundation.vertex_count(vertex_count), vertex_count);
    if (std::holds_alternative<membrane::NoFoundation>(foundation.any)) return;
    check_version(component, "the foundation", foundation.version, network.version);
}

SurfaceVersion::SurfaceVersion(const Mesh& mesh) {
    add(mesh.vertex_count());
    for (const Index v : mesh.triangles().reshaped()) add(v);
}

SurfaceVersion SurfaceVersion::after(const membrane::TearEvent<double>& event) const {
    SurfaceVersion next = *this;
    ++next.events_;
    for (const Index v : {event.moved.vertex, event.split.vertex, event.split.copy}) next.add(v);
    for (const Index f : event.split.triangles) next.add(f);
    return next;
}

void check_version(std::string_view component, std::string_view what, const SurfaceVersion& found,
                   const SurfaceVersion& expected) {
    const bool are_whole = found.events() == 0 && expected.events() == 0;
    if (are_whole || found == expected) return;
    refuse(component, what, " must have followed the same ", expected.events(), " events of a tear, got ",
           found.events());
}

}  // namespace membrane_python

PYBIND11_MODULE(_membrane, module) {
    using namespace membrane_python;
    module.doc() = "The library `membrane`: thin tissue under a tool, and the force on the hand. SI units everywhere.";
    module.attr("__version__") = std::to_string(MEMBRANE_VERSION_MAJOR) + "." + std::to_string(MEMBRANE_VERSION_MINOR) +
                                 "." + std::to_string(MEMBRANE_VERSION_PATCH);
    module.attr("no_index") = membrane::no_index;
    module.attr("unlimited") = membrane::unlimited;
    py::register_exception<membrane::InvalidInput>(module, "InvalidInput", PyExc_ValueError).doc() =
        doc("InvalidInput");
    bind_surface(module);
    bind_mesh_check(module);
    bind_meshing(module);
    bind_model(module);
    bind_material(module);
    bind_contact(module);
    bind_solve(module);
    bind_coarse(module);
    bind_tear(module);
    bind_haptics(module);
    bind_recording(module);
    bind_equilibrium(module);
    bind_error_bound(module);
    bind_settings(module);
    bind_calibration(module);
}
