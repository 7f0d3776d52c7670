// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

#include <pybind11/pybind11.h>

/// Docstrings from the comments of the library's headers, and options as keyword arguments.
namespace membrane_python {

namespace py = pybind11;

/// The comment of a name in the headers, as "QuasiStaticSolver::step". An import fails if there is no such name.
[[nodiscard]] const char* doc(const char* name);

/// The fields of a struct of options as keyword arguments of Python, with the struct's own defaults and comments.
///
///     const Keywords options("SheetOptions", std::pair("width", &SheetOptions::width), ...);
///     options.def(module, "sheet", options.taking<>([](const SheetOptions& o) { return membrane::sheet(o); }));
template <class Options, class... Field>
class Keywords {
  public:
    explicit Keywords(const char* name, std::pair<const char*, Field Options::*>... fields)
        : name_(name), fields_(fields...) {}

    /// The function of Python whose arguments are `Leading...`, then a keyword for each field: calls
    /// `build(leading..., options)`.
    template <class... Leading, class Build>
    [[nodiscard]] auto taking(Build build) const {
        return [build, fields = fields_](Leading... leading, Field... values) {
            Options options{};
            std::apply([&](const auto&... field) { ((options.*field.second = std::move(values)), ...); }, fields);
            return build(std::forward<Leading>(leading)..., options);
        };
    }

    /// Defines `function`, as of `taking`, by this name; `leading` are its first arguments.
    template <class... Leading>
    void def(py::module_& module, const char* name, const auto& function, const Leading&... leading) const {
        const std::string text = std::string(doc(name)) + "\n\n" + description();
        std::apply(
            [&](const auto&... field) {
                module.def(name, function, leading..., py::kw_only(), as_argument(field)..., text.c_str());
            },
            fields_);
    }

    /// Defines the constructor of a class by `function`, as of `taking`.
    template <class Class, class Function, class... Leading>
    void def_init(Class& scope, const Function& function, const Leading&... leading) const {
        const std::string text = description();
        std::apply(
            [&](const auto&... field) {
                scope.def(py::init(function), leading..., py::kw_only(), as_argument(field)..., text.c_str());
            },
            fields_);
    }

    /// Defines the fields as attributes of a class that is derived from `Options`.
    template <class Class>
    void def_fields(Class& scope) const {
        std::apply(
            [&](const auto&... field) {
                (scope.def_readonly(field.first, field.second, doc(member(field.first).c_str())), ...);
            },
            fields_);
    }

  private:
    template <class Member>
    [[nodiscard]] static py::arg_v as_argument(const std::pair<const char*, Member>& field) {
        return py::arg(field.first) = Options{}.*field.second;
    }
    [[nodiscard]] std::string member(const char* field) const { return name_ + "::" + field; }

    /// A line for each keyword.
    [[nodiscard]] std::string description() const {
        std::string text;
        std::apply(
            [&](const auto&... field) {
                ((text = text + field.first + ": " + doc(member(field.first).c_str()) + "\n"), ...);
            },
            fields_);
        return text;
    }

    std::string name_;
    std::tuple<std::pair<const char*, Field Options::*>...> fields_;
};

template <class Options, class... Field>
Keywords(const char*, std::pair<const char*, Field Options::*>...) -> Keywords<Options, Field...>;

}  // namespace membrane_python
