// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include <membrane/contact/tool.hpp>
#include <membrane/core/types.hpp>

#include "support/camera.hpp"
#include "support/plot.hpp"

/// The record of a run of `press_and_pull`.
namespace examples {

/// The parts of a frame, in their order.
inline constexpr std::array<std::string_view, 5> parts{"contact", "solve", "refit", "normals", "force"};

/// Times the parts of a frame, one after the other.
class Stopwatch {
  public:
    /// Ends the current part.
    void lap() {
        const auto now = std::chrono::steady_clock::now();
        seconds_[part_++] = std::chrono::duration<double>(now - last_).count();
        last_ = now;
    }

    [[nodiscard]] const std::array<double, parts.size()>& seconds() const { return seconds_; }

  private:
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
    std::array<double, parts.size()> seconds_{};
    std::size_t part_ = 0;
};

/// One tick of the loop.
struct Frame {
    membrane::Tool<double> tool;
    double depth = 0;                            ///< Of the tool in the membrane [m].
    double pulled = 0;                           ///< Displacement of the held point from its rest position [m].
    Vector3d felt = Vector3d::Zero();            ///< Force policy's force on the device [N].
    Vector3d reaction = Vector3d::Zero();        ///< Of the membrane on the tool, from the solver [N].
    bool active = false;                         ///< The tool is in contact, or the membrane not yet in equilibrium.
    std::array<double, parts.size()> seconds{};  ///< Duration of each part.
};

/// The membrane and the tool at one time.
struct Snapshot {
    membrane::Points<double> points;
    Frame frame;
};

struct Record {
    std::vector<Phase> phases;
    std::vector<Frame> frames = {};
    std::vector<Snapshot> snapshots = {};  ///< The last of each phase.
    std::size_t film_interval = 0;         ///< Frames from one state of the film to the next; 0: no film.
    std::vector<Snapshot> film = {};

    void add(const Frame& frame, const membrane::Points<double>& x) {
        const double time = frame.tool.time + 1e-9;  // phases end on ticks, up to rounding
        if (snapshots.empty() || (time >= phases[snapshots.size() - 1].end && snapshots.size() < phases.size())) {
            snapshots.emplace_back();
        }
        snapshots.back() = {x, frame};
        if (film_interval > 0 && frames.size() % film_interval == 0) film.push_back(snapshots.back());
        frames.push_back(frame);
    }

    /// This record and then another.
    [[nodiscard]] Record then(Record next) && {
        const auto append = [](auto& to, auto& from) {
            to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
        };
        append(phases, next.phases);
        append(frames, next.frames);
        append(snapshots, next.snapshots);
        return std::move(*this);
    }
};

}  // namespace examples
