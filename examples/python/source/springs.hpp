// SPDX-License-Identifier: MIT
#pragma once

#include <exception>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

#include <pybind11/pybind11.h>
#include <membrane/model/spring_law.hpp>

/// Spring laws that a program of Python chooses while it runs.
namespace membrane_python {

namespace py = pybind11;
using membrane::SpringResponse;
using membrane::SpringState;

/// A law by a table: tension over stiffness and rest length, k r, at each strain; straight in between, and beyond both
/// ends as in the outermost interval. The stiffness jumps at the strains of the table. A spring of rest length zero has
/// no strain and stays linear.
class TableSpring {
  public:
    /// @throws InvalidInput unless there are two rows or more, all numbers are finite, strains ascend, tensions do not
    /// descend, and the tension at strain 0 is 0
    TableSpring(const std::vector<double>& strain, const std::vector<double>& tension);

    /// Tension [N], stiffness [N/m] and energy [J].
    SpringResponse<double> operator()(const SpringState<double>& spring) const noexcept;

  private:
    struct Piece {  // of the table: relative tension and energy at its end that is nearer to rest, slope from there
        double strain, tension, energy, slope;
    };
    [[nodiscard]] const Piece& piece_at(double strain) const noexcept;

    std::shared_ptr<const std::vector<Piece>> pieces_;
};

/// A law that is a function of Python: function(stiffness, rest_length, length) returns tension [N], stiffness [N/m]
/// and energy [J]. Of an error the first is kept for `rethrow`; the response then is not finite, and a step is refused.
class PythonSpring {
  public:
    explicit PythonSpring(py::function function);

    SpringResponse<double> operator()(const SpringState<double>& spring) const noexcept;

    /// Throws the error that a call has raised since the last time.
    void rethrow() const;

  private:
    struct Call {
        py::function function;
        std::exception_ptr error;
    };
    std::shared_ptr<Call> call_;  // released under Python's lock
};

/// One of the laws that are not linear.
struct AnySpring {
    std::variant<membrane::TensionSpring, membrane::ExponentialSpring, TableSpring, PythonSpring> law;

    SpringResponse<double> operator()(const SpringState<double>& spring) const noexcept {
        return std::visit([&](const auto& one) { return one(spring); }, law);
    }
};
static_assert(membrane::SpringLaw<AnySpring, double>);

}  // namespace membrane_python
