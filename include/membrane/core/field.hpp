// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>

namespace membrane {

/// One number for all vertices or springs, or one for each.
///
///     membrane::VolumeSpringOptions<double> uniform{.stiffness = 8.0};
///     membrane::VolumeSpringOptions<double> graded{.stiffness = std::vector<double>{8.0, 9.5, 11.0}};
template <Real Scalar>
class Field {
  public:
    Field() = default;  ///< No value given.

    ///@{
    /// One number for all, or one for each; copied.
    Field(Scalar uniform) : values_{uniform}, uniform_{true} {}                 // NOLINT(google-explicit-constructor)
    Field(std::vector<Scalar> each) : values_(std::move(each)) {}               // NOLINT(google-explicit-constructor)
    Field(std::span<const Scalar> each) : values_(each.begin(), each.end()) {}  // NOLINT(google-explicit-constructor)
    ///@}

    /// Whether a value was given.
    [[nodiscard]] bool given() const noexcept { return !values_.empty(); }

    /// The numbers for `count` items. Each must be finite and positive, or zero if `allow_zero`.
    /// @throws InvalidInput if a number or their count is invalid; the message names component, field, item and unit
    [[nodiscard]] std::vector<Scalar> expand(Index count, std::string_view component, std::string_view field,
                                             std::string_view item, std::string_view unit,
                                             bool allow_zero = true) const;

  private:
    std::vector<Scalar> values_;
    bool uniform_ = false;
};

template <Real Scalar>
std::vector<Scalar> Field<Scalar>::expand(Index count, std::string_view component, std::string_view field,
                                          std::string_view item, std::string_view unit, bool allow_zero) const {
    if (!uniform_ && values_.size() != static_cast<std::size_t>(count)) {
        refuse(component, field, " must be one number or one for each ", item, " (", count, "), got ", values_.size());
    }
    for (std::size_t i = 0; i < values_.size(); ++i) {
        const Scalar value = values_[i];
        if (is_finite(value) && (value > 0 || (allow_zero && value == 0))) continue;
        const std::string_view bound = allow_zero ? "finite and not negative" : "finite and positive";
        if (uniform_) refuse(component, field, " must be ", bound, " [", unit, "], got ", value);
        refuse(component, field, " of ", item, " ", i, " must be ", bound, " [", unit, "], got ", value);
    }
    return uniform_ ? std::vector<Scalar>(static_cast<std::size_t>(count), values_.front()) : values_;
}

}  // namespace membrane
