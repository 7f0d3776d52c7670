// SPDX-License-Identifier: MIT
#include "springs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include <pybind11/stl.h>
#include <membrane/core/check.hpp>

namespace membrane_python {

TableSpring::TableSpring(const std::vector<double>& strain, const std::vector<double>& tension) {
    constexpr auto name = "TableSpring";
    const std::size_t rows = strain.size();
    if (rows < 2 || tension.size() != rows) {
        membrane::refuse(name, "there must be two strains or more and a tension for each, got ", rows, " and ",
                         tension.size());
    }
    for (std::size_t i = 0; i < rows; ++i) {
        if (!membrane::is_finite(strain[i]) || !membrane::is_finite(tension[i])) {
            membrane::refuse(name, "row ", i, " must be finite, got ", strain[i], " and ", tension[i]);
        }
        if (i > 0 && !(strain[i] > strain[i - 1])) {
            membrane::refuse(name, "strain ", i, " must be above ", strain[i - 1], ", got ", strain[i]);
        }
        if (i > 0 && !(tension[i] >= tension[i - 1])) {
            membrane::refuse(name, "tension ", i, " must be at least ", tension[i - 1], ", got ", tension[i]);
        }
    }
    std::vector<Piece> pieces;
    double energy = 0;
    for (std::size_t i = 0; i + 1 < rows; ++i) {
        const double width = strain[i + 1] - strain[i];
        pieces.push_back({strain[i], tension[i], energy, (tension[i + 1] - tension[i]) / width});
        energy += width * (tension[i] + tension[i + 1]) / 2;
    }
    pieces_ = std::make_shared<const std::vector<Piece>>(pieces);
    const Piece& rest = piece_at(0);
    const double at_rest = rest.tension - rest.slope * rest.strain;
    if (std::abs(at_rest) > 1e-12 * (std::max)(std::abs(tension.front()), std::abs(tension.back()))) {
        membrane::refuse(name, "the tension at strain 0 must be 0, got ", at_rest);
    }
    const double energy_at_rest = rest.energy - (rest.tension - rest.slope * rest.strain / 2) * rest.strain;
    for (Piece& piece : pieces) piece.energy -= energy_at_rest;
    pieces_ = std::make_shared<const std::vector<Piece>>(std::move(pieces));
}

const TableSpring::Piece& TableSpring::piece_at(double strain) const noexcept {
    const auto above = std::upper_bound(pieces_->begin() + 1, pieces_->end(), strain,
                                        [](double at, const Piece& piece) { return at < piece.strain; });
    return *(above - 1);
}

SpringResponse<double> TableSpring::operator()(const SpringState<double>& spring) const noexcept {
    if (spring.rest_length == 0) return membrane::LinearSpring{}(spring);
    const double strain = (spring.length - spring.rest_length) / spring.rest_length;
    const Piece& piece = piece_at(strain);
    const double beyond = strain - piece.strain, force = spring.stiffness * spring.rest_length;
    return {
        .tension = force * (piece.tension + piece.slope * beyond),
        .stiffness = spring.stiffness * piece.slope,
        .energy = force * spring.rest_length * (piece.energy + (piece.tension + piece.slope * beyond / 2) * beyond)};
}

PythonSpring::PythonSpring(py::function function)
    : call_(new Call{std::move(function), nullptr}, [](Call* call) {
          const py::gil_scoped_acquire lock;
          delete call;
      }) {}

SpringResponse<double> PythonSpring::operator()(const SpringState<double>& spring) const noexcept {
    const py::gil_scoped_acquire lock;
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    if (call_->error) return {none, none, none};
    try {
        const auto [tension, stiffness, energy] = call_->function(spring.stiffness, spring.rest_length, spring.length)
                                                      .cast<std::tuple<double, double, double>>();
        return {tension, stiffness, energy};
    } catch (...) {
        call_->error = std::current_exception();
        return {none, none, none};
    }
}

void PythonSpring::rethrow() const {
    if (call_->error) std::rethrow_exception(std::exchange(call_->error, nullptr));
}

}  // namespace membrane_python
