// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <membrane/core/field.hpp>
#include <membrane/core/types.hpp>
#include <membrane/core/vector3.hpp>
#include <membrane/solve/step.hpp>

/// numpy arrays as the library's arguments and results. Points are the rows of a V x 3 array in C order, which has the
/// memory of the library's 3 x V matrix.
///
/// What is called in a loop reads an array by its fields, without a converted copy: that costs 20 ns, an Eigen::Ref of
/// pybind11 300 ns.
namespace membrane_python {

namespace py = pybind11;
using membrane::Index;
using Points = membrane::Points<double>;
using Vector = membrane::Vector3<double>;
static_assert(sizeof(Vector) == 3 * sizeof(double));

/// The points of a numpy array, in place.
template <bool writes>
struct PointsInPlace {
    using Map = Eigen::Map<std::conditional_t<writes, Points, const Points>, 0, Eigen::OuterStride<>>;

    double* data = nullptr;
    Eigen::Index count = 0, stride = 3;

    [[nodiscard]] Map map() const noexcept { return Map(data, 3, count, Eigen::OuterStride<>(stride)); }
};
using Positions = PointsInPlace<false>;       ///< that are read
using MovingPositions = PointsInPlace<true>;  ///< that a step moves

/// Vertices that moved: a `StepReport`, or an array of int32.
struct Moved {
    std::span<const Index> vertices;
};

/// Arrays that the module returns.
class FloatArray : public py::object {
  public:
    PYBIND11_OBJECT_DEFAULT(FloatArray, py::object, PyObject_Type)
};
class IndexArray : public py::object {
  public:
    PYBIND11_OBJECT_DEFAULT(IndexArray, py::object, PyObject_Type)
};
class BoolArray : public py::object {
  public:
    PYBIND11_OBJECT_DEFAULT(BoolArray, py::object, PyObject_Type)
};

/// An array of a numpy type on memory of `owner`, which may not be written; without `owner`, on memory of its own.
[[nodiscard]] py::object make_array(int type, std::initializer_list<Py_intptr_t> shape, const void* data,
                                    py::handle owner);

///@{
/// A view of memory that `owner` keeps: of points, vectors and indices.
[[nodiscard]] inline FloatArray view(const Points& x, py::handle owner) {
    return py::reinterpret_steal<FloatArray>(
        make_array(py::detail::npy_api::NPY_DOUBLE_, {x.cols(), 3}, x.data(), owner).release());
}
[[nodiscard]] inline FloatArray view(std::span<const Vector> vectors, py::handle owner) {
    return py::reinterpret_steal<FloatArray>(make_array(py::detail::npy_api::NPY_DOUBLE_,
                                                        {static_cast<Py_intptr_t>(vectors.size()), 3}, vectors.data(),
                                                        owner)
                                                 .release());
}
[[nodiscard]] inline IndexArray view(std::span<const Index> indices, py::handle owner) {
    return py::reinterpret_steal<IndexArray>(
        make_array(py::detail::npy_api::NPY_INT_, {static_cast<Py_intptr_t>(indices.size())}, indices.data(), owner)
            .release());
}
[[nodiscard]] inline IndexArray view(const membrane::Triangles& triangles, py::handle owner) {
    return py::reinterpret_steal<IndexArray>(
        make_array(py::detail::npy_api::NPY_INT_, {triangles.cols(), 3}, triangles.data(), owner).release());
}
///@}

///@{
/// A copy.
[[nodiscard]] FloatArray copy(std::span<const double> numbers);
[[nodiscard]] IndexArray copy(std::span<const Index> indices);
[[nodiscard]] BoolArray copy(std::span<const unsigned char> flags);
[[nodiscard]] FloatArray copy(const Points& x);
[[nodiscard]] FloatArray copy(const Eigen::MatrixXd& numbers);
///@}

///@{
/// V x 3 numbers, F x 3 indices of any type: a copy, offline.
[[nodiscard]] Points points_of(const py::object& array);
[[nodiscard]] membrane::Triangles triangles_of(const py::object& array);
///@}

/// Refuses an array of another number of vertices than `expected`.
void check_count(std::string_view component, std::string_view what, Eigen::Index found, Index expected);

/// Refuses indices that are no vertices.
void check_moved(std::string_view component, const Moved& moved, Index vertex_count);

}  // namespace membrane_python

namespace pybind11::detail {

/// The fields of a C-contiguous row of three numbers each; throws a TypeError that says what is expected.
[[nodiscard]] membrane_python::MovingPositions positions_of(handle source, bool writes);

template <bool writes>
struct type_caster<membrane_python::PointsInPlace<writes>> {
    PYBIND11_TYPE_CASTER(membrane_python::PointsInPlace<writes>, const_name("numpy.typing.NDArray[numpy.float64]"));
    bool load(handle source, bool) {
        const auto [data, count, stride] = positions_of(source, writes);
        value = {data, count, stride};
        return true;
    }
};

template <>
struct type_caster<membrane_python::Moved> {
    PYBIND11_TYPE_CASTER(membrane_python::Moved, const_name("StepReport | numpy.typing.NDArray[numpy.int32]"));
    bool load(handle source, bool);
};

template <>
struct type_caster<membrane::Vector3<double>> {
    PYBIND11_TYPE_CASTER(membrane::Vector3<double>, const_name("Vector3"));
    bool load(handle source, bool convert);
    static handle cast(const membrane::Vector3<double>& vector, return_value_policy, handle);
};

template <>
struct type_caster<membrane::Field<double>> {
    PYBIND11_TYPE_CASTER(membrane::Field<double>, const_name("Field"));
    bool load(handle source, bool convert);
    static handle cast(const membrane::Field<double>& field, return_value_policy, handle);
};

template <>
struct handle_type_name<membrane_python::FloatArray> {
    static constexpr auto name = const_name("numpy.typing.NDArray[numpy.float64]");
};
template <>
struct handle_type_name<membrane_python::IndexArray> {
    static constexpr auto name = const_name("numpy.typing.NDArray[numpy.int32]");
};
template <>
struct handle_type_name<membrane_python::BoolArray> {
    static constexpr auto name = const_name("numpy.typing.NDArray[numpy.bool_]");
};

}  // namespace pybind11::detail
