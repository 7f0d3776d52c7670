// SPDX-License-Identifier: MIT
#include "arrays.hpp"

#include <algorithm>
#include <cstring>

#include <membrane/core/check.hpp>

namespace membrane_python {

namespace {

using Api = py::detail::npy_api;

/// A copy as numbers of another type, C order; an empty object if that is impossible.
template <class Number>
[[nodiscard]] py::array_t<Number, py::array::c_style | py::array::forcecast> converted(const py::object& array) {
    auto result = py::array_t<Number, py::array::c_style | py::array::forcecast>::ensure(array);
    if (!result) throw py::error_already_set();
    return result;
}

template <class Result, class Number>
[[nodiscard]] Result by_threes(const py::object& array, const char* what) {
    const auto numbers = converted<Number>(array);
    if (numbers.ndim() != 2 || numbers.shape(1) != 3) {
        throw py::value_error(std::string(what) + " must be an array of three columns");
    }
    return Eigen::Map<const Eigen::Matrix<Number, 3, Eigen::Dynamic>>(numbers.data(), 3, numbers.shape(0))
        .template cast<typename Result::Scalar>();
}

}  // namespace

py::object make_array(int type, std::initializer_list<Py_intptr_t> shape, const void* data, py::handle owner) {
    const auto& api = Api::get();
    const int flags = data == nullptr ? 0 : Api::NPY_ARRAY_C_CONTIGUOUS_ | Api::NPY_ARRAY_ALIGNED_;
    auto array = py::reinterpret_steal<py::object>(
        api.PyArray_NewFromDescr_(api.PyArray_Type_, api.PyArray_DescrFromType_(type), static_cast<int>(shape.size()),
                                  shape.begin(), nullptr, const_cast<void*>(data), flags, nullptr));
    if (!array) throw py::error_already_set();
    if (owner) api.PyArray_SetBaseObject_(array.ptr(), owner.inc_ref().ptr());
    return array;
}

namespace {

template <class Array, class Number>
[[nodiscard]] Array copy_of(int type, std::initializer_list<Py_intptr_t> shape, const Number* data, std::size_t count) {
    auto array = make_array(type, shape, nullptr, {});
    if (count > 0) std::memcpy(py::detail::array_proxy(array.ptr())->data, data, count * sizeof(Number));
    return py::reinterpret_steal<Array>(array.release());
}

}  // namespace

FloatArray copy(std::span<const double> numbers) {
    return copy_of<FloatArray>(Api::NPY_DOUBLE_, {static_cast<Py_intptr_t>(numbers.size())}, numbers.data(),
                               numbers.size());
}

IndexArray copy(std::span<const Index> indices) {
    return copy_of<IndexArray>(Api::NPY_INT_, {static_cast<Py_intptr_t>(indices.size())}, indices.data(),
                               indices.size());
}

BoolArray copy(std::span<const unsigned char> flags) {
    return copy_of<BoolArray>(Api::NPY_BOOL_, {static_cast<Py_intptr_t>(flags.size())}, flags.data(), flags.size());
}

FloatArray copy(const Points& x) {
    return copy_of<FloatArray>(Api::NPY_DOUBLE_, {x.cols(), 3}, x.data(), static_cast<std::size_t>(x.size()));
}

FloatArray copy(const Eigen::MatrixXd& numbers) {
    const Eigen::MatrixXd by_rows = numbers.transpose();
    return copy_of<FloatArray>(Api::NPY_DOUBLE_, {numbers.rows(), numbers.cols()}, by_rows.data(),
                               static_cast<std::size_t>(numbers.size()));
}

Points points_of(const py::object& array) { return by_threes<Points, double>(array, "positions"); }

membrane::Triangles triangles_of(const py::object& array) {
    return by_threes<membrane::Triangles, Index>(array, "triangles");
}

void check_count(std::string_view component, std::string_view what, Eigen::Index found, Index expected) {
    if (found == expected) return;
    membrane::refuse(component, what, " must have ", expected, " vertices, got ", found);
}

void check_moved(std::string_view component, const Moved& moved, Index vertex_count) {
    // A negative index is a large one without sign; one maximum is faster than std::minmax_element by iterators.
    unsigned most = 0;
    for (const Index v : moved.vertices) most = (std::max)(most, static_cast<unsigned>(v));
    if (moved.vertices.empty() || most < static_cast<unsigned>(vertex_count)) return;
    membrane::refuse(component, "moved vertices must be 0 to ", vertex_count - 1, ", got ", static_cast<Index>(most));
}

}  // namespace membrane_python

namespace pybind11::detail {

using membrane_python::Index;

namespace {

[[nodiscard]] const PyArray_Proxy* as_array(handle source, int type) {
    const auto& api = npy_api::get();
    if (!api.PyArray_Check_(source.ptr())) return nullptr;
    const auto* array = array_proxy(source.ptr());
    const auto* descr = array_descriptor_proxy(array->descr);
    const bool is_native = descr->byteorder == '=' || descr->byteorder == '|';
    if (descr->type_num != type || !is_native || (array->flags & npy_api::NPY_ARRAY_ALIGNED_) == 0) return nullptr;
    return array;
}

}  // namespace

membrane_python::MovingPositions positions_of(handle source, bool writes) {
    constexpr auto size = static_cast<Py_intptr_t>(sizeof(double));
    const auto* array = as_array(source, npy_api::NPY_DOUBLE_);
    const bool fits = array != nullptr && array->nd == 2 && array->dimensions[1] == 3 && array->strides[1] == size &&
                      (array->strides[0] >= 3 * size || array->dimensions[0] <= 1) && array->strides[0] % size == 0;
    if (!fits) throw type_error("positions must be an array of float64, V x 3, each row contiguous");
    if (writes && (array->flags & npy_api::NPY_ARRAY_WRITEABLE_) == 0) {
        throw type_error("positions must be writeable, for the step moves them: mesh.positions.copy()");
    }
    return {reinterpret_cast<double*>(array->data), array->dimensions[0],
            (std::max)(array->strides[0] / size, Py_intptr_t(3))};
}

bool type_caster<membrane_python::Moved>::load(handle source, bool) {
    constexpr auto size = static_cast<Py_intptr_t>(sizeof(Index));
    if (const auto* array = as_array(source, npy_api::NPY_INT_)) {
        if (array->nd != 1 || (array->strides[0] != size && array->dimensions[0] > 1)) return false;
        value.vertices = {reinterpret_cast<const Index*>(array->data), static_cast<std::size_t>(array->dimensions[0])};
        return true;
    }
    make_caster<membrane::StepReport<double>> report;
    if (!report.load(source, false)) return false;
    value.vertices = cast_op<const membrane::StepReport<double>&>(report).moved;
    return true;
}

bool type_caster<membrane::Vector3<double>>::load(handle source, bool) {
    if (const auto* array = as_array(source, npy_api::NPY_DOUBLE_)) {
        if (array->nd != 1 || array->dimensions[0] != 3) return false;
        for (int k = 0; k < 3; ++k) std::memcpy(&value[k], array->data + k * array->strides[0], sizeof(double));
        return true;
    }
    if (!PySequence_Check(source.ptr()) || PySequence_Size(source.ptr()) != 3) {
        PyErr_Clear();
        return false;
    }
    const auto numbers = reinterpret_borrow<sequence>(source);
    for (int k = 0; k < 3; ++k) {
        value[k] = PyFloat_AsDouble(object(numbers[static_cast<std::size_t>(k)]).ptr());
        if (value[k] == -1 && PyErr_Occurred() != nullptr) {
            PyErr_Clear();
            return false;
        }
    }
    return true;
}

handle type_caster<membrane::Vector3<double>>::cast(const membrane::Vector3<double>& vector, return_value_policy,
                                                    handle) {
    auto array = membrane_python::make_array(npy_api::NPY_DOUBLE_, {3}, nullptr, {});
    std::memcpy(array_proxy(array.ptr())->data, vector.data(), sizeof vector);
    return array.release();
}

bool type_caster<membrane::Field<double>>::load(handle source, bool convert) {
    if (source.is_none()) return true;
    make_caster<double> uniform;
    if (uniform.load(source, convert)) {
        value = cast_op<double>(uniform);
        return true;
    }
    const auto each = array_t<double, array::c_style | array::forcecast>::ensure(source);
    if (!each || each.ndim() != 1) {
        PyErr_Clear();
        return false;
    }
    value = std::span<const double>(each.data(), static_cast<std::size_t>(each.size()));
    return true;
}

// The only field that the module returns is that of a default.
handle type_caster<membrane::Field<double>>::cast(const membrane::Field<double>&, return_value_policy, handle) {
    return none().release();
}

}  // namespace pybind11::detail
