// SPDX-License-Identifier: MIT
//
// The operations of the page for JavaScript.
#include <memory>
#include <string>
#include <vector>

#include <emscripten.h>
#include <emscripten/bind.h>

#include "operation.hpp"
#include "views.hpp"

using namespace emscripten;
using namespace web;

namespace {

std::unique_ptr<Operation> of_kind(const std::string& kind) {
    if (kind == "peel") return std::make_unique<PeelOperation>();
    return std::make_unique<RhexisOperation>();
}

class OperationLoop {
  public:
    explicit OperationLoop(const std::string& kind) : operation_(of_kind(kind)), body_(operation_->body()) {}

    void demonstrate() { operation_->demonstrate(); }
    void place(const Vector3& position) { operation_->place(position); }
    void aim(const Vector3& target, bool close) { operation_->aim(target, close); }

    /// Up to `ticks` ticks within `budget` [ms].
    void run(int ticks, double budget) {
        const double begin = emscripten_get_now();
        double before = begin;
        for (int done = 0; done < ticks && before - begin < budget; ++done) {
            operation_->step();
            const double after = emscripten_get_now();
            times_.push_back(after - before);
            forces_.push_back(membrane::norm(operation_->forceps().force));
            before = after;
        }
    }

    /// Forgets force and time of the ticks so far.
    void begin_frame() {
        forces_.clear();
        times_.clear();
    }

    [[nodiscard]] val rest() const { return view(operation_->rest()); }
    [[nodiscard]] val positions() { return view(positions_ = operation_->positions()); }
    [[nodiscard]] val forces() const { return view(forces_); }
    [[nodiscard]] val times() const { return view(times_); }
    [[nodiscard]] val body_positions() const { return view(body_.positions()); }
    [[nodiscard]] val body_triangles() const { return view(body_.triangles()); }

    /// Null if they are as they were last time.
    [[nodiscard]] val changed_triangles() {
        const auto& now = operation_->triangles();
        if (now.cols() == triangles_.cols() && now == triangles_) return val::null();
        return view(triangles_ = now);
    }

    /// A number for each vertex: `displacement` [m], `tension` [N/m].
    [[nodiscard]] val values(const std::string& quantity) {
        if (quantity == "tension")
            values_ = operation_->tension().cast<float>();
        else
            values_ = (operation_->positions() - operation_->rest()).colwise().norm().transpose().cast<float>();
        return view(values_);
    }

    [[nodiscard]] ForcepsState forceps() const { return operation_->forceps(); }
    [[nodiscard]] Progress progress() const { return operation_->progress(); }
    [[nodiscard]] double radius() const { return operation_->radius(); }

    /// Half the largest extent [m].
    [[nodiscard]] double size() const {
        const auto& x = operation_->rest();
        return (x.rowwise().maxCoeff() - x.rowwise().minCoeff()).maxCoeff() / 2;
    }

  private:
    std::unique_ptr<Operation> operation_;
    std::vector<double> forces_, times_;  // of each tick of the frame [N], [ms]

    // What views are of.
    Mesh body_;
    Points positions_;
    membrane::Triangles triangles_;
    Eigen::VectorXf values_;
};

OperationLoop* new_loop(const std::string& kind) { return new OperationLoop(kind); }

}  // namespace

EMSCRIPTEN_BINDINGS(operation) {
    value_object<Progress>("Progress")
        .field("length", &Progress::length)
        .field("area", &Progress::area)
        .field("circularity", &Progress::circularity)
        .field("finished", &Progress::finished);
    value_object<ForcepsState>("ForcepsState")
        .field("position", &ForcepsState::position)
        .field("force", &ForcepsState::force)
        .field("closed", &ForcepsState::closed);
    function("operation", &new_loop, allow_raw_pointers());
    class_<OperationLoop>("OperationLoop")
        .function("demonstrate", &OperationLoop::demonstrate)
        .function("place", &OperationLoop::place)
        .function("aim", &OperationLoop::aim)
        .function("run", &OperationLoop::run)
        .function("beginFrame", &OperationLoop::begin_frame)
        .function("rest", &OperationLoop::rest)
        .function("positions", &OperationLoop::positions)
        .function("forces", &OperationLoop::forces)
        .function("times", &OperationLoop::times)
        .function("bodyPositions", &OperationLoop::body_positions)
        .function("bodyTriangles", &OperationLoop::body_triangles)
        .function("changedTriangles", &OperationLoop::changed_triangles)
        .function("values", &OperationLoop::values)
        .function("forceps", &OperationLoop::forceps)
        .function("progress", &OperationLoop::progress)
        .function("radius", &OperationLoop::radius)
        .function("size", &OperationLoop::size);
}
