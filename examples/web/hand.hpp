// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include <membrane/contact/tool.hpp>

namespace web {

/// A pointer jumps from displayed frame to displayed frame; a hand does not. The tool follows the pointer as a
/// critically damped oscillator with a limited speed, so that its velocity is continuous at 1 kHz.
class Hand {
  public:
    Hand(double radius, double max_speed) : max_speed_(max_speed) { tool_.radius = radius; }

    [[nodiscard]] const membrane::Tool<double>& tool() const noexcept { return tool_; }

    /// Puts the tool at another position, without a path from the last one.
    void place(const membrane::Vector3<double>& position) noexcept {
        tool_.position = position;
        tool_.velocity.setZero();
    }

    /// Moves for `dt` [s] toward `target` [m].
    void follow(const membrane::Vector3<double>& target, bool grasping, double dt) noexcept {
        constexpr double rate = 60;  // [1/s]
        tool_.velocity += dt * rate * (rate * (target - tool_.position) - 2 * tool_.velocity);
        tool_.velocity *= std::min(1.0, max_speed_ / std::max(membrane::norm(tool_.velocity), max_speed_));
        tool_.position += dt * tool_.velocity;
        tool_.time += dt;
        tool_.grasping = grasping;
    }

  private:
    membrane::Tool<double> tool_;
    double max_speed_;  // [m/s]
};

}  // namespace web
