// SPDX-License-Identifier: MIT
#include "springs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include <pybind11/stl.h>
#include <membrane/core/check.hpp>

namespace membrane_python {

namespace {

void check_table(const std::vector<double>& strain, const std::vector<double>& tension) {
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
    const auto above = std::upper_bound(strain.begin() + 1, strain.end() - 1, 0.0) - strain.begin();
    const auto i = static_cast<std::size_t>(above);
    const double slope = (tension[i] - tension[i - 1]) / (strain[i] - strain[i - 1]);
    const double at_rest = tension[i - 1] - slope * strain[i - 1];
    if (std::abs(at_rest) > 1e-12 * (std::max)(std::abs(tension.front()), std::abs(tension.back()))) {
        membrane::refuse(name, "the tension at strain 0 must be 0, got ", at_rest);
    }
}

}  // namespace

TableSpring::TableSpring(const std::vector<double>& strain, const std::vector<double>& tension) {
    check_table(strain, tension);
    const std::size_t rows = strain.size();
    const auto slope_above = [&](std::size_t i) { return (tension[i + 1] - tension[i]) / (strain[i + 1] - strain[i]); };
    // From rest outwards: near rest the energy is then no difference of large numbers, whose rounding would hide the
    // gain of an update.
    Piece end{0, 0, 0, 0};
    const auto piece_to = [&](double far, double pull, double slope) {
        const Piece piece{end.strain, end.tension, end.energy, slope};
        end = {far, pull, end.energy + (far - end.strain) * (end.tension + pull) / 2, 0};
        return piece;
    };
    std::vector<Piece> pieces;
    for (std::size_t i = rows; i-- > 0;) {  // an interval or its part below rest, from its upper end
        if (strain[i] < 0) pieces.push_back(piece_to(strain[i], tension[i], slope_above((std::min)(i, rows - 2))));
    }
    if (pieces.empty()) pieces.push_back({0, 0, 0, slope_above(0)});
    std::reverse(pieces.begin(), pieces.end());
    const std::size_t below = pieces.size();
    end = {0, 0, 0, 0};
    for (std::size_t i = 0; i < rows; ++i) {  // above rest, from its lower end
        if (strain[i] > 0) pieces.push_back(piece_to(strain[i], tension[i], slope_above(i == 0 ? 0 : i - 1)));
    }
    if (pieces.size() == below) pieces.push_back({0, 0, 0, slope_above(rows - 2)});
    pieces_ = std::make_shared<const std::vector<Piece>>(std::move(pieces));
}

const TableSpring::Piece& TableSpring::piece_at(double strain) const noexcept {
    const auto above = std::upper_bound(pieces_->begin(), pieces_->end(), strain,
                                        [](double at, const Piece& piece) { return at < piece.strain; });
    return strain < 0 ? *above : *(above - 1);
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
