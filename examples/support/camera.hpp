// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <numbers>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "support/svg.hpp"

namespace examples {

using Eigen::Vector3d;

/// A gentle perspective on a scene with z upwards.
///
///     const Camera camera({.target = {0, 0, 0}, .azimuth = 20, .elevation = 25, .distance = 0.08, .metre = 1e4});
///     const Pixel p = camera.pixel({0.01, 0, 0});
class Camera {
  public:
    struct Options {
        Vector3d target = Vector3d::Zero();  ///< In the middle of the picture [m].
        double azimuth = 0;                  ///< Turns the eye about z, 0 is a view along +y [degrees].
        double elevation = 20;               ///< Of the eye above the plane z = 0 [degrees].
        double distance = 1;                 ///< From the eye to the target [m].
        double metre = 100;                  ///< Length of one metre at the target in the picture [px].
        Pixel middle = {};                   ///< Position of the target in the picture.
    };

    explicit Camera(const Options& options) : options_(options) {
        const double azimuth = options.azimuth * std::numbers::pi / 180;
        const double elevation = options.elevation * std::numbers::pi / 180;
        right_ = {std::cos(azimuth), std::sin(azimuth), 0};
        toward_ = {std::cos(elevation) * std::sin(azimuth), -std::cos(elevation) * std::cos(azimuth),
                   std::sin(elevation)};
        up_ = toward_.cross(right_);
    }

    [[nodiscard]] Vector3d eye() const { return options_.target + options_.distance * toward_; }

    /// Length in the picture of a metre across the view at `p` [px/m].
    [[nodiscard]] double scale(const Vector3d& p) const {
        return options_.metre * options_.distance / (options_.distance - (p - options_.target).dot(toward_));
    }

    [[nodiscard]] Pixel pixel(const Vector3d& p) const {
        const Vector3d from_target = p - options_.target;
        const double s = scale(p);
        return {options_.middle.x + s * from_target.dot(right_), options_.middle.y - s * from_target.dot(up_)};
    }

    /// A direction given as seen: rightwards, upwards, toward the eye.
    [[nodiscard]] Vector3d seen(double rightwards, double upwards, double toward) const {
        return (rightwards * right_ + upwards * up_ + toward * toward_).normalized();
    }

    [[nodiscard]] const Options& options() const { return options_; }

  private:
    Options options_;
    Vector3d right_, up_, toward_;
};

}  // namespace examples
