// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include <membrane/core/types.hpp>

/// What all fuzz targets share: numbers from libFuzzer's bytes, and a check that stops it.
///
///     test::Bytes bytes(data, size);
///     while (bytes.left()) test::require(holds(bytes.number<double>(-1, 1)));
namespace test {

/// Stops the fuzzer, which keeps the bytes.
inline void require(bool holds) {
    if (!holds) __builtin_trap();
}

/// Numbers from the bytes, zeros when they are used up.
class Bytes {
  public:
    Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

    [[nodiscard]] std::size_t left() const { return size_; }
    [[nodiscard]] const std::uint8_t* data() const { return data_; }

    /// Any number, infinite and NaN too.
    template <class Number>
    Number next() {
        Number number{};
        if (size_ >= sizeof number) {
            std::memcpy(&number, data_, sizeof number);
            data_ += sizeof number;
            size_ -= sizeof number;
        } else {
            size_ = 0;
        }
        return number;
    }

    /// In 0 .. count - 1, at most 256.
    membrane::Index index(membrane::Index count) { return next<std::uint8_t>() % count; }
    /// In one of 65,536 steps from `low` to `high`.
    template <membrane::Real Scalar = double>
    Scalar number(double low, double high) {
        return static_cast<Scalar>(low + (high - low) * next<std::uint16_t>() / 65535);
    }
    template <membrane::Real Scalar = double>
    membrane::Vector3<Scalar> vector(double low = -1, double high = 1) {
        const auto x = number<Scalar>(low, high), y = number<Scalar>(low, high), z = number<Scalar>(low, high);
        return {x, y, z};
    }
    /// A number that no device and no caller should ever hand in, or any.
    template <membrane::Real Scalar>
    Scalar wild() {
        using Limits = std::numeric_limits<Scalar>;
        const std::array<Scalar, 8> numbers{Limits::quiet_NaN(), Limits::infinity(),  -Limits::infinity(),
                                            Limits::max(),       Limits::lowest(),    Limits::min(),
                                            Scalar(-0.0),        Limits::denorm_min()};
        const auto which = static_cast<std::size_t>(index(9));
        return which < 8 ? numbers[which] : next<Scalar>();
    }

  private:
    const std::uint8_t* data_;
    std::size_t size_;
};

/// The bits of a byte as switches.
class Switches {
  public:
    explicit Switches(std::uint8_t bits) : bits_(bits) {}
    [[nodiscard]] bool on(unsigned bit) const { return ((bits_ >> bit) & 1U) != 0; }

  private:
    unsigned bits_;
};

}  // namespace test
