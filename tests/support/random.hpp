// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <random>
#include <type_traits>

#include <membrane/core/types.hpp>

/// Seeded random numbers, vectors, rotations and meshes: the same everywhere (the standard's own distributions are
/// not).
///
///     test::Random random(seed);
///     const auto q = random.vector<double>(-1, 1);
///     const auto x = test::jittered(mesh.positions(), 1e-4, random);
namespace test {

/// What MEMBRANE_SEED adds to every seed, so that a campaign is continued with other cases; 0 if that is not set.
inline std::uint64_t seed_offset() {
    const char* const number = std::getenv("MEMBRANE_SEED");
    return number == nullptr ? 0 : std::strtoull(number, nullptr, 10) << 40;  // beyond the tests' own seeds
}

class Random {
  public:
    explicit Random(std::uint64_t seed) : engine_(seed + seed_offset()) {}

    /// In [low, high).
    template <membrane::Real Scalar = double>
    Scalar number(Scalar low = 0, Scalar high = 1) {
        const double unit = static_cast<double>(engine_() >> 11) * 0x1p-53;
        return static_cast<Scalar>(low + (high - low) * unit);
    }

    /// In 0 .. count - 1.
    membrane::Index index(membrane::Index count) {
        return static_cast<membrane::Index>(engine_() % static_cast<std::uint64_t>(count));
    }

    bool chance(double probability) { return number() < probability; }

    /// Each coordinate in [low, high).
    template <membrane::Real Scalar = double>
    membrane::Vector3<Scalar> vector(Scalar low = -1, Scalar high = 1) {
        const Scalar x = number(low, high), y = number(low, high), z = number(low, high);
        return {x, y, z};
    }

    /// On the unit sphere, every direction alike.
    template <membrane::Real Scalar = double>
    membrane::Vector3<Scalar> unit_vector() {
        for (;;) {
            const membrane::Vector3<double> candidate = vector<double>();
            const double length = membrane::norm(candidate);
            if (length > 0.1 && length <= 1) return (candidate / length).cast<Scalar>();
        }
    }

    /// Barycentric coordinates inside a triangle, evenly spread.
    template <membrane::Real Scalar = double>
    membrane::Vector3<Scalar> barycentric() {
        Scalar u = number<Scalar>(), v = number<Scalar>();
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        return {1 - u - v, u, v};
    }

    /// A proper rotation, from a random unit quaternion.
    template <membrane::Real Scalar = double>
    Eigen::Matrix<Scalar, 3, 3> rotation() {
        double w = 0, x = 0, y = 0, z = 0, length = 0;
        do {
            w = number(-1.0, 1.0), x = number(-1.0, 1.0), y = number(-1.0, 1.0), z = number(-1.0, 1.0);
            length = std::sqrt(w * w + x * x + y * y + z * z);
        } while (length < 0.1 || length > 1);
        w /= length, x /= length, y /= length, z /= length;
        Eigen::Matrix<double, 3, 3> r;
        r << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),   //
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
        return r.cast<Scalar>();
    }

    /// For std::shuffle and the like.
    std::mt19937_64& engine() { return engine_; }

  private:
    std::mt19937_64 engine_;
};

/// The points, each coordinate moved by up to `amplitude`.
template <membrane::Real Scalar>
membrane::Points<Scalar> jittered(membrane::Points<Scalar> x, std::type_identity_t<Scalar> amplitude, Random& random) {
    for (Eigen::Index v = 0; v < x.cols(); ++v) x.col(v) += random.vector<Scalar>(-amplitude, amplitude);
    return x;
}

}  // namespace test
