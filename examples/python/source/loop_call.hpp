// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <pybind11/pybind11.h>

/// Functions that a loop calls in each tick.
///
/// For a call pybind11 fills a tuple and two vectors, and for a method makes an object that binds it. Here a call by
/// position, with arguments that need no conversion, goes straight to the function. Every other call goes to pybind11,
/// which defines the function first: signature, docstring, keywords and errors are its own.
namespace membrane_python {

namespace py = pybind11;

namespace detail {

enum class CallKind { method, function };

/// Whether an argument may be left out of a call: it is None then.
template <class Type>
inline constexpr bool may_be_left_out = std::is_pointer_v<Type> || std::is_same_v<Type, const py::args&>;
template <class Type>
inline constexpr bool may_be_left_out<const std::optional<Type>&> = true;

template <class Function, CallKind kind, py::return_value_policy policy,
          class Signature = decltype(&Function::operator())>
struct LoopCall;

template <class Function, CallKind kind, py::return_value_policy policy, class Result, class... Each>
struct LoopCall<Function, kind, policy, Result (Function::*)(Each...) const> {
    static constexpr std::size_t size = sizeof...(Each);
    static constexpr std::size_t own = kind == CallKind::method ? 1 : 0;  // arguments before those of the call
    static constexpr std::size_t required = (std::size_t(!may_be_left_out<Each>) + ...);
    static constexpr bool is_variadic = (std::is_same_v<Each, const py::args&> || ...);

    inline static PyObject* by_pybind11 = nullptr;
    inline static PyMethodDef definition{};

    /// `function`, which pybind11 has defined, as a definition of Python's own.
    static PyMethodDef* define(const char* name, const py::object& function) {
        by_pybind11 = py::object(function).release().ptr();
        const auto* comment = new std::string(py::str(function.attr("__doc__")));  // as long as the module
        definition = {name, reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(&call)),
                      METH_FASTCALL | METH_KEYWORDS, comment->c_str()};
        return &definition;
    }

    static PyObject* call(PyObject* self, PyObject* const* given, Py_ssize_t count, PyObject* names) {
        const std::size_t total = own + static_cast<std::size_t>(count);
        if (names == nullptr && total >= required && (total <= size || is_variadic)) {
            try {
                PyObject* result = called(self, given, total, std::make_index_sequence<size>());
                if (result != nullptr) return result;
            } catch (const py::reference_cast_error&) {  // None where there must be an object
            } catch (...) {
                return raised();
            }
        }
        std::vector<PyObject*> all(given, given + count + (names == nullptr ? 0 : PyTuple_GET_SIZE(names)));
        if (own > 0) all.insert(all.begin(), self);
        return PyObject_Vectorcall(by_pybind11, all.data(), total, names);
    }

  private:
    /// The result, or a null pointer if an argument does not fit.
    template <std::size_t... i>
    static PyObject* called(PyObject* self, PyObject* const* given, std::size_t total, std::index_sequence<i...>) {
        std::tuple<py::detail::make_caster<Each>...> casters;
        const auto load = [&]<class One>(auto& caster, std::size_t at, std::type_identity<One>) {
            if constexpr (std::is_same_v<One, const py::args&>) {
                const std::size_t more = total > at ? total - at : 0;
                py::tuple rest(more);
                for (std::size_t k = 0; k < more; ++k) {
                    PyTuple_SET_ITEM(rest.ptr(), static_cast<Py_ssize_t>(k),
                                     py::handle(given[at - own + k]).inc_ref().ptr());
                }
                return caster.load(rest, false);
            } else {
                return caster.load(at < own ? self : at < total ? given[at - own] : Py_None, false);
            }
        };
        if (!(load(std::get<i>(casters), i, std::type_identity<Each>()) && ...)) return nullptr;
        const auto run = [&]() -> Result {
            return Function()(py::detail::cast_op<Each>(std::move(std::get<i>(casters)))...);
        };
        if constexpr (std::is_void_v<Result>) {
            run();
            return py::none().release().ptr();
        } else {
            const py::handle result = py::detail::make_caster<Result>::cast(run(), policy, self);
            if (!result) throw py::error_already_set();
            return result.ptr();
        }
    }

    /// Sets Python's error for the exception that is being handled, as pybind11 does.
    static PyObject* raised() {
        try {
            throw;
        } catch (py::error_already_set& error) {
            error.restore();
        } catch (...) {
            using py::detail::apply_exception_translators;
            if (!apply_exception_translators(py::detail::get_local_internals().registered_exception_translators) &&
                !apply_exception_translators(py::detail::get_internals().registered_exception_translators)) {
                PyErr_SetString(PyExc_SystemError, "an exception of an unknown type");
            }
        }
        return nullptr;
    }
};

template <class Object>
[[nodiscard]] py::object checked(Object* made) {
    if (made == nullptr) throw py::error_already_set();
    return py::reinterpret_steal<py::object>(made);
}

}  // namespace detail

/// A method, as `scope.def(name, function, extra...)`. `function` captures nothing. Pointers and optional arguments,
/// its last, have the default None.
template <py::return_value_policy policy = py::return_value_policy::automatic, class Class, class Function>
void def_in_loop(Class& scope, const char* name, Function function, const auto&... extra) {
    scope.def(name, function, policy, extra...);
    auto* type = reinterpret_cast<PyTypeObject*>(scope.ptr());
    using Call = detail::LoopCall<Function, detail::CallKind::method, policy>;
    scope.attr(name) = detail::checked(PyDescr_NewMethod(type, Call::define(name, scope.attr(name))));
}

/// A function of a module, likewise.
template <class Function>
void def_in_loop(py::module_& module, const char* name, Function function, const auto&... extra) {
    module.def(name, function, extra...);
    using Call = detail::LoopCall<Function, detail::CallKind::function, py::return_value_policy::automatic>;
    PyMethodDef* definition = Call::define(name, module.attr(name));
    module.attr(name) = detail::checked(PyCFunction_NewEx(definition, nullptr, py::str(module.attr("__name__")).ptr()));
}

/// An attribute that may not be set, likewise.
template <class Class, class Function>
void def_property_in_loop(Class& scope, const char* name, Function function, const char* comment) {
    using Call = detail::LoopCall<Function, detail::CallKind::function, py::return_value_policy::automatic>;
    const py::cpp_function by_pybind11(function, py::is_method(scope));
    const auto get = detail::checked(PyCFunction_NewEx(Call::define(name, by_pybind11), nullptr, nullptr));
    scope.attr(name) = py::reinterpret_borrow<py::object>(reinterpret_cast<PyObject*>(&PyProperty_Type))(
        get, py::none(), py::none(), comment);
}

}  // namespace membrane_python
