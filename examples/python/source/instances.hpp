// SPDX-License-Identifier: MIT
#pragma once

#include <type_traits>

#include <pybind11/pybind11.h>

/// The classes whose instances the calls of a tick take and return.
///
/// For each argument of each call pybind11 finds its class by the hash of its name, and asks None for an attribute that
/// it has not before it is a null pointer. The caster below keeps the class and takes None first.
namespace membrane_python {

/// Whether a class has this caster. Specialise it before a function that takes or returns the class is bound.
template <class Type>
inline constexpr bool is_in_loop = false;

}  // namespace membrane_python

namespace pybind11::detail {

template <class Type>
class type_caster<Type, enable_if_t<membrane_python::is_in_loop<Type>>> : public type_caster_generic {
  public:
    static constexpr auto name = const_name<Type>();

    type_caster() : type_caster_generic(record()) {}

    bool load(handle source, bool convert) {
        if (source.is_none()) return true;  // a null pointer, which is refused as a reference
        return type_caster_generic::load(source, convert);
    }

    static handle cast(const Type& source, return_value_policy policy, handle parent) {
        const bool automatic =
            policy == return_value_policy::automatic || policy == return_value_policy::automatic_reference;
        return cast(&source, automatic ? return_value_policy::copy : policy, parent);
    }
    static handle cast(Type&& source, return_value_policy, handle parent) {
        return cast(&source, return_value_policy::move, parent);
    }
    static handle cast(const Type* source, return_value_policy policy, handle parent) {
        return type_caster_generic::cast(source, policy, parent, record(), copying(), moving());
    }

    template <class Taken>
    using cast_op_type = detail::cast_op_type<Taken>;
    operator Type*() { return static_cast<Type*>(value); }
    operator Type&() {
        if (value == nullptr) throw reference_cast_error();
        return *static_cast<Type*>(value);
    }

  private:
    using Constructor = void* (*)(const void*);

    /// What pybind11 knows of the class: nothing until it is bound.
    static const type_info* record() {
        static const type_info* found = nullptr;
        if (found == nullptr) found = get_type_info(typeid(Type));
        return found;
    }
    static Constructor copying() {
        if constexpr (!std::is_copy_constructible_v<Type>)
            return nullptr;
        else
            return [](const void* from) -> void* { return new Type(*static_cast<const Type*>(from)); };
    }
    static Constructor moving() {
        return [](const void* from) -> void* {
            return new Type(std::move(*const_cast<Type*>(static_cast<const Type*>(from))));
        };
    }
};

}  // namespace pybind11::detail
