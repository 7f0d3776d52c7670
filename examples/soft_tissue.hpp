// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include <membrane/haptics/handover.hpp>
#include <membrane/membrane.hpp>
#include <membrane/mesh_check/repair.hpp>
#include <membrane/replay/initial_state.hpp>
#include <membrane/replay/snapshot.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/recommended_layers.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

/// One vertex as the engine sends it to the graphics card.
struct EngineVertex {
    float position[3], normal[3], texture[2];
};

/// A membrane as a component of an engine, made to be copied and changed: all parts, and a haptic thread of 1 kHz. One
/// thread of the engine calls the functions; the haptic thread never waits for it.
class SoftTissue {
  public:
    using Tool = membrane::Tool<float>;
    struct Feedback {
        membrane::Vector3<float> force = membrane::Vector3<float>::Zero();  ///< on the tool [N]; zero if refused
        membrane::StepStatus status = membrane::StepStatus::advanced;       ///< or why the step was refused
    };

    /// Vertices at one position, as along a seam of the texture, are one vertex of the membrane.
    /// @throws membrane::InvalidInput for a mesh that is no membrane
    SoftTissue(std::span<const EngineVertex> vertices, std::span<const std::uint32_t> indices, const Tool& tool)
        : SoftTissue(weld(vertices, indices), tool) {}
    ~SoftTissue() {
        running_ = false;
        thread_.join();
    }

    ///@{
    /// In each frame: moves the tool; the last tick's feedback, with the tick's number and time; writes the vertices
    /// that have changed, and returns how many.
    void move(const Tool& tool) { tool_.publish(tool, now()); }
    [[nodiscard]] const auto& feedback() { return feedback_.read(); }
    std::size_t draw(std::span<EngineVertex> vertices);
    ///@}

    ///@{
    /// Commands between two ticks: the caller waits until a tick is over, the haptic thread leaves out the next ones.
    void pause(bool paused) {
        const std::scoped_lock between_ticks(mutex_);
        paused_ = paused;
        feedback_.publish({}, now());
    }
    void teleport(const Tool& tool) {  // not through the surface between
        const std::scoped_lock between_ticks(mutex_);
        tracker_.reset();
        move(tool);
    }
    void reset() {
        const std::scoped_lock between_ticks(mutex_);
        if (rest_.reset(solver_, tracker_, x_)) show_all();
    }
    [[nodiscard]] std::vector<std::byte> save() {
        const std::scoped_lock between_ticks(mutex_);
        std::vector<std::byte> state(membrane::snapshot_capacity(solver_, tracker_, x_, last_tool_));
        state.resize(membrane::save_snapshot(state, solver_, tracker_, x_, last_tool_));
        return state;
    }
    [[nodiscard]] bool load(std::span<const std::byte> state) {  // the tool too; false for another membrane's state
        const std::scoped_lock between_ticks(mutex_);
        if (!membrane::restore_snapshot(state, solver_, tracker_, x_, last_tool_)) return false;
        move(last_tool_);
        show_all();
        return true;
    }
    ///@}

  private:
    using Clock = std::chrono::steady_clock;
    static constexpr auto tick_length = std::chrono::milliseconds(1);
    static constexpr membrane::Material capsule = membrane::materials::lens_capsule().typical;
    static constexpr membrane::FoundationLayer fibres{.young_modulus = 2e3, .poisson_ratio = 0.45, .thickness = 1e-3};

    static membrane::RepairedMesh<float> weld(std::span<const EngineVertex> vertices,
                                              std::span<const std::uint32_t> indices);
    SoftTissue(const membrane::RepairedMesh<float>& welded, const Tool& tool);
    static double now() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }
    void run() noexcept;
    void tick() noexcept;
    void show_all() noexcept;

    // Of the haptic thread; of a command between two ticks.
    membrane::TriangleMesh<float> mesh_;
    membrane::MassSpringNetwork<float> network_;
    membrane::FoundationSprings<float> foundation_;
    membrane::QuasiStaticSolver<float> solver_;
    membrane::AabbTree<float> tree_;
    membrane::ContactTracker<float> tracker_;
    membrane::Points<float> x_;  // [m]
    membrane::InitialState rest_;
    Tool last_tool_;
    bool paused_ = false;
    // Of both threads.
    membrane::Latest<Tool> tool_;
    membrane::Latest<Feedback> feedback_;
    membrane::MovedPoints<float> moved_;
    std::mutex mutex_;
    std::atomic<bool> running_{true};
    // Of the engine's thread.
    membrane::Points<float> shown_;  // [m]
    membrane::VertexNormals<float> normals_;
    std::vector<std::vector<std::uint32_t>> copies_;  // for each vertex of the membrane, those of the engine
    std::thread thread_;                              // last: starts when all else is made
};

inline membrane::RepairedMesh<float> SoftTissue::weld(std::span<const EngineVertex> vertices,
                                                      std::span<const std::uint32_t> indices) {
    constexpr Eigen::Index stride = sizeof(EngineVertex) / sizeof(float);
    const Eigen::Map<const Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> positions(
        vertices.empty() ? nullptr : vertices.front().position, 3, static_cast<Eigen::Index>(vertices.size()),
        Eigen::OuterStride<>(stride));
    const Eigen::Map<const Eigen::Matrix<std::uint32_t, 3, Eigen::Dynamic>> triangles(
        indices.data(), 3, static_cast<Eigen::Index>(indices.size() / 3));
    return membrane::repair(positions, triangles, {.weld = 1e-6, .drop_repeated = true, .drop_isolated = true});
}

inline SoftTissue::SoftTissue(const membrane::RepairedMesh<float>& welded, const Tool& tool)
    : mesh_(welded.positions, welded.triangles),
      network_(mesh_, {}, {.stiffness = membrane::spring_stiffnesses(mesh_, capsule)}),
      foundation_(mesh_, {.normal = membrane::normal_stiffnesses(mesh_, fibres),
                          .tangential = membrane::tangential_stiffnesses(mesh_, fibres),
                          .recovery_time = 0.02F}),
      solver_(network_, {.layers = membrane::recommended_layers(mesh_, capsule, fibres).normal}),
      tree_(mesh_),
      tracker_(mesh_),
      x_(mesh_.positions()),
      rest_(solver_, tracker_, x_),
      last_tool_(tool),
      tool_(tool),
      moved_(mesh_.vertex_count()),
      shown_(x_),
      normals_(mesh_),
      copies_(static_cast<std::size_t>(mesh_.vertex_count())) {
    for (std::size_t i = 0; i < welded.new_vertices.size(); ++i) {
        const membrane::Index v = welded.new_vertices[i];  // `no_index` if no triangle has it
        if (v != membrane::no_index) copies_[static_cast<std::size_t>(v)].push_back(static_cast<std::uint32_t>(i));
    }
    thread_ = std::thread([this] { run(); });
}

inline void SoftTissue::run() noexcept {
    for (auto due = Clock::now(); running_; std::this_thread::sleep_until(due)) {
        if (const std::unique_lock turn(mutex_, std::try_to_lock); turn && !paused_) tick();
        due = std::max(due + tick_length, Clock::now());  // ticks lost are lost
    }
}

inline void SoftTissue::tick() noexcept {
    const Tool tool = tool_.read().value;  // a haptic device would be read here, and get the force below
    const auto contact = tracker_.update(tree_, x_, tool);
    const auto report = solver_.step(x_, std::chrono::duration<float>(tick_length).count(), network_, foundation_,
                                     press(tool, contact));
    if (report.status == membrane::StepStatus::advanced) last_tool_ = tool;
    tree_.refit(x_, report.moved);
    moved_.publish(report.moved, x_, now());
    feedback_.publish({report.total_reaction(), report.status}, now());
}

inline void SoftTissue::show_all() noexcept {
    tree_.refit(x_);
    moved_.publish_all(x_, now());
}

inline std::size_t SoftTissue::draw(std::span<EngineVertex> vertices) {
    const auto news = moved_.read();
    for (const auto v : news.moved) shown_.col(v) = news.x.col(v);
    std::size_t written = 0;
    for (const auto v : normals_.update(shown_, news.moved)) {
        for (const std::uint32_t i : copies_[static_cast<std::size_t>(v)]) {
            Eigen::Map<Eigen::Vector3f>(vertices[i].position) = shown_.col(v);
            Eigen::Map<Eigen::Vector3f>(vertices[i].normal) = normals_.values().col(v);
            ++written;
        }
    }
    return written;
}
