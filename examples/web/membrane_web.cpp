// SPDX-License-Identifier: MIT
//
// The loop of the page for JavaScript.
#include <algorithm>
#include <cstring>
#include <string>

#include <emscripten.h>
#include <membrane/accuracy/choose_settings.hpp>
#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/mesh_check/validate.hpp>

#include "hand.hpp"
#include "recording.hpp"
#include "support/surface_state.hpp"
#include "views.hpp"

using namespace emscripten;
using namespace web;

// The module is compiled without exceptions: invalid input becomes an error of JavaScript.
EM_JS(void, throw_error, (const char* message), { throw new Error(UTF8ToString(message)); });

namespace {

/// What a stroke needs, by `choose_settings`.
struct Choice {
    Index layers = 0, sweeps = 0;
    double force_error = 0, time = 0;  // as `membrane::TrialResult`
    bool satisfied = false;
};

class Loop {
  public:
    explicit Loop(Mesh mesh, const Settings& settings)
        : session_(std::move(mesh), settings),
          nodes_(membrane::tree_shape(session_.mesh(), membrane::TreeOptions{}.balance_threshold).nodes),
          hand_(tool_radius(session_.mesh()), 12 * size_of(session_.mesh())),
          target_(hand_.tool().position) {}

    void configure(const Settings& settings) { session_.configure(settings); }

    void place(const Vector3& position) {
        hand_.place(position);
        lift_tool();
        placed_ = true;
    }

    /// What the hand does from now on: it moves toward `target`, and closes the forceps at the membrane.
    void aim(const Vector3& target, bool close) {
        target_ = target;
        close_ = close;
    }

    /// Up to `ticks` ticks within `budget` [ms]: of the recording that is replayed, with the present settings, then of
    /// the hand.
    void run(int ticks, double budget) {
        const double begin = emscripten_get_now();
        double before = begin;
        for (int done = 0; done < ticks && before - begin < budget; ++done) {
            if (left() > 0)
                replay();
            else
                follow();
            const double after = emscripten_get_now();
            times_.push_back(after - before);
            forces_.push_back(membrane::norm(session_.force()));
            before = after;
        }
    }

    /// Forgets force and time of the ticks so far.
    void begin_frame() {
        forces_.clear();
        times_.clear();
    }

    void start_recording() {
        recording_ = true;
        rows_.clear();
        rows_.reserve(max_rows);
    }
    void stop_recording() { recording_ = false; }

    /// Rows of a recording, to be replayed.
    void load(const val& rows) {
        script_ = rows_of(rows);
        next_ = differing_ = 0;
    }

    [[nodiscard]] val rest() const { return view(session_.mesh().positions()); }
    [[nodiscard]] val triangles() const { return view(session_.mesh().triangles()); }
    [[nodiscard]] val positions() const { return view(session_.x()); }
    [[nodiscard]] val normals() const { return view(session_.normals()); }
    [[nodiscard]] val forces() const { return view(forces_); }
    [[nodiscard]] val times() const { return view(times_); }
    [[nodiscard]] val recording() const { return view_of_rows(rows_); }

    /// The ticks since the tool was last put to where it pressed or pulled.
    [[nodiscard]] val stroke() const { return view_of_rows(touched_in_stroke_ ? stroke_ : last_stroke_); }

    /// Ticks of the recording that are still to be replayed.
    [[nodiscard]] int left() const { return static_cast<int>(script_.size()) - next_; }

    /// Replayed ticks whose force is not the recorded one, to the bit.
    [[nodiscard]] int differing() const { return differing_; }

    /// A number for each vertex: `displacement` [m], `tension` [N/m], or `layers`: 1 in the first one of the queue,
    /// less in the next ones, 0 outside.
    [[nodiscard]] val values(const std::string& quantity) {
        values_.setZero(session_.mesh().vertex_count());
        if (quantity == "layers") {
            const auto& queue = session_.queue();
            for (Index k = 0; k < queue.layer_count(); ++k)
                for (const Index v : queue.layer(k)) values_[v] = 1 - static_cast<float>(k) / queue.layer_count();
        } else if (quantity == "displacement") {
            values_ = (session_.x() - session_.mesh().positions()).colwise().norm().transpose().cast<float>();
        } else if (quantity == "tension") {
            const auto state = examples::surface_state(session_.mesh(), session_.x(), session_.network_now(),
                                                       session_.foundation_now());
            values_ = state.tension.cast<float>();
        }
        return view(values_);
    }

    /// Triangles with a contact force, then those that the tracker watches.
    [[nodiscard]] val contact_triangles() {
        triangles_.clear();
        for (const auto& point : session_.contact_points())
            if (!point.force.isZero(0)) triangles_.push_back(point.triangle);
        return view(triangles_);
    }
    [[nodiscard]] val tracked_triangles() {
        triangles_.clear();
        for (const auto& triangle : session_.moment().contact.patch.triangles) triangles_.push_back(triangle.triangle);
        return view(triangles_);
    }

    /// Two corners of each box of the tree that meets the tool.
    [[nodiscard]] val tree_boxes() {
        corners_.clear();
        const auto& tool = hand_.tool();
        for (std::size_t node = 0; node < nodes_.size(); ++node) {
            const auto box = session_.tree().box(static_cast<Index>(node));
            if (squared_distance(box, tool.position) > tool.radius * tool.radius) continue;
            for (const Vector3& corner : {box.low, box.high})
                for (int k = 0; k < 3; ++k) corners_.push_back(static_cast<float>(corner[k]));
        }
        return view(corners_);
    }

    [[nodiscard]] Moment moment() const { return session_.moment(); }
    [[nodiscard]] Vector3 force() const { return session_.force(); }
    [[nodiscard]] double force_error() { return session_.force_error(); }
    [[nodiscard]] double radius() const { return hand_.tool().radius; }
    [[nodiscard]] double drawn_radius() const {
        return membrane::drawn_radius(session_.moment().tool, session_.moment().contact, session_.x());
    }
    [[nodiscard]] double size() const { return size_of(session_.mesh()); }

    /// The reaction in the equilibrium of `moment` near `positions` [N]; null if none was found.
    [[nodiscard]] val equilibrium(const Moment& moment, const val& positions) {
        session_.configure(moment.settings);
        const auto numbers = convertJSArrayToNumberVector<double>(positions);
        const Eigen::Map<const membrane::Points<double>> x(numbers.data(), 3, session_.mesh().vertex_count());
        const auto& [settings, tool, contact, grasp, reaction] = moment;
        const auto exact =
            membrane::equilibrium<double>(x, session_.mesh(), session_.network_now(), session_.foundation_now(), {},
                                          press(tool, contact, grasp), pull(tool, grasp));
        return exact.converged ? val(Vector3(exact.reactions[0] + exact.reactions[1])) : val::null();
    }

    /// Layers and sweeps for a stroke: the quickest with at most this relative error of the force, or if that is 0, the
    /// most accurate with at most this time [s].
    [[nodiscard]] Choice choose(const Settings& settings, const val& stroke, double force_error, double time) {
        session_.configure(settings);
        std::vector<membrane::Tool<double>> tools;
        for (const Row& row : rows_of(stroke)) tools.push_back(tool_of(row, radius()));
        const membrane::ToolTrajectory<double> trajectory(session_.mesh(), tools, dt);
        const auto search = [&](const auto& rule) {
            return membrane::choose_settings(
                session_.mesh(), session_.network_now(), session_.foundation_now(), trajectory,
                {.force_error = force_error, .time = time},
                {.contact_iterations = {membrane::SolverOptions<double>{}.contact_iterations},
                 .tick_stride = 25,
                 .repetitions = 1},
                rule);
        };
        const auto choice =
            session_.settings().safe_step ? search(membrane::SafeStep{}) : search(membrane::BlockStep{});
        return {choice.options.layers, choice.options.sweeps, choice.force_error, choice.time, choice.satisfied};
    }

  private:
    static constexpr std::size_t max_rows = 60'000;                        // of a recording: a minute
    static constexpr std::size_t stroke_rows = 1'000;                      // a second
    static constexpr std::size_t row_size = sizeof(Row) / sizeof(double);  // in numbers

    static val view_of_rows(const std::vector<Row>& rows) {
        return val(typed_memory_view(row_size * rows.size(), reinterpret_cast<const double*>(rows.data())));
    }
    static std::vector<Row> rows_of(const val& numbers) {
        const auto read = convertJSArrayToNumberVector<double>(numbers);
        std::vector<Row> rows(read.size() / row_size);
        std::memcpy(rows.data(), read.data(), rows.size() * sizeof(Row));
        return rows;
    }

    /// The tool's next position begins a stroke.
    void lift_tool() {
        session_.lift_tool();
        if (std::exchange(touched_in_stroke_, false)) last_stroke_.swap(stroke_);
        stroke_.clear();
    }

    void replay() {
        const Row& row = script_[static_cast<std::size_t>(next_++)];
        if (row.placed != 0) lift_tool();
        step(tool_of(row, hand_.tool().radius), row.placed != 0);
        differing_ += session_.force() != Vector3(row.fx, row.fy, row.fz);
    }

    void follow() {
        const auto& last = session_.moment();
        hand_.follow(target_, close_ && (last.tool.grasping || last.contact.touching()), dt);
        step(hand_.tool(), std::exchange(placed_, false));
    }

    void step(const membrane::Tool<double>& tool, bool placed) {
        session_.step(tool);
        if (recording_ && rows_.size() < max_rows) rows_.push_back(row_of(session_, placed));
        if (stroke_.size() == stroke_rows) return;
        stroke_.push_back(row_of(session_, placed));
        touched_in_stroke_ |= session_.moment().contact.touching();
    }

    Session session_;
    std::vector<membrane::TreeTopology::Node> nodes_;  // of the session's tree
    Hand hand_;
    Vector3 target_;  // [m]
    bool close_ = false, placed_ = false, recording_ = false, touched_in_stroke_ = false;
    std::vector<Row> rows_, script_;  // recorded, and to be replayed
    int next_ = 0, differing_ = 0;    // of `script_`
    std::vector<Row> stroke_, last_stroke_;
    std::vector<double> forces_, times_;  // of each tick of the frame [N], [ms]

    // What views are of.
    Eigen::VectorXf values_;
    std::vector<Index> triangles_;
    std::vector<float> corners_;
};

struct Findings {
    bool valid = false;
    std::string text;
};

struct Surface {
    explicit Surface(const val& xyz, const val& corners)
        : numbers(convertJSArrayToNumberVector<double>(xyz)), indices(convertJSArrayToNumberVector<Index>(corners)) {}
    std::vector<double> numbers;
    std::vector<Index> indices;
};

Findings validate(const val& xyz, const val& corners) {
    const Surface surface(xyz, corners);
    const auto report =
        membrane::validate(std::span(surface.numbers), std::span(surface.indices), {.max_findings_per_kind = 5});
    return {report.valid(), to_string(report)};
}

Loop* of_sphere(int subdivisions, const Settings& settings) { return new Loop(sphere(subdivisions), settings); }
Loop* of_cornea(const Settings& settings) { return new Loop(cornea(), settings); }
Loop* of_lens(const Settings& settings) { return new Loop(lens(), settings); }
Loop* of_surface(const val& xyz, const val& corners, const Settings& settings) {
    const Surface surface(xyz, corners);
    return new Loop(Mesh(std::span(surface.numbers), std::span(surface.indices)), settings);
}

template <class Array>
void bind_triple(const char* name) {
    value_array<Array>(name)
        .element(emscripten::index<0>())
        .element(emscripten::index<1>())
        .element(emscripten::index<2>());
}

bool touching(const membrane::Contact<double>& contact) { return contact.touching(); }
void set_touching(membrane::Contact<double>& contact, bool touching) {
    contact.phase = touching ? membrane::ContactPhase::ongoing : membrane::ContactPhase::none;
}

}  // namespace

EMSCRIPTEN_BINDINGS(membrane) {
    membrane::set_invalid_input_handler([](const char* message) { throw_error(message); });

    bind_triple<Vector3>("Vector3");
    bind_triple<std::array<Index, 3>>("Corners");
    value_object<Settings>("Settings")
        .field("layers", &Settings::layers)
        .field("sweeps", &Settings::sweeps)
        .field("safeStep", &Settings::safe_step)
        .field("volumeSprings", &Settings::volume_springs)
        .field("coarseCorrection", &Settings::coarse_correction);
    using Tool = membrane::Tool<double>;
    value_object<Tool>("Tool").field("position", &Tool::position).field("radius", &Tool::radius);
    using Patch = membrane::ContactPatch<double>;
    value_object<Patch>("ContactPatch")
        .field("axisPoint", &Patch::axis_point)
        .field("detectionDistance", &Patch::detection_distance)
        .field("radius", &Patch::radius)
        .field("fineTriangles", &Patch::fine_triangles);
    using Contact = membrane::Contact<double>;
    value_object<Contact>("Contact")  // what an equilibrium needs of it
        .field("touching", &touching, &set_touching)
        .field("corners", &Contact::corners)
        .field("point", &Contact::point)
        .field("normal", &Contact::normal)
        .field("gap", &Contact::gap)
        .field("patch", &Contact::patch);
    using Grasp = membrane::Grasp<double>;
    value_object<Grasp>("Grasp")
        .field("triangle", &Grasp::triangle)
        .field("corners", &Grasp::corners)
        .field("barycentric", &Grasp::barycentric)
        .field("offset", &Grasp::offset);
    value_object<Moment>("Moment")
        .field("settings", &Moment::settings)
        .field("tool", &Moment::tool)
        .field("contact", &Moment::contact)
        .field("grasp", &Moment::grasp)
        .field("reaction", &Moment::reaction);
    value_object<Choice>("Choice")
        .field("layers", &Choice::layers)
        .field("sweeps", &Choice::sweeps)
        .field("forceError", &Choice::force_error)
        .field("time", &Choice::time)
        .field("satisfied", &Choice::satisfied);
    value_object<Findings>("Findings").field("valid", &Findings::valid).field("text", &Findings::text);

    function("validate", &validate);
    function("sphere", &of_sphere, allow_raw_pointers());
    function("cornea", &of_cornea, allow_raw_pointers());
    function("lens", &of_lens, allow_raw_pointers());
    function("surface", &of_surface, allow_raw_pointers());
    class_<Loop>("Loop")
        .function("configure", &Loop::configure)
        .function("place", &Loop::place)
        .function("aim", &Loop::aim)
        .function("run", &Loop::run)
        .function("beginFrame", &Loop::begin_frame)
        .function("startRecording", &Loop::start_recording)
        .function("stopRecording", &Loop::stop_recording)
        .function("load", &Loop::load)
        .function("rest", &Loop::rest)
        .function("triangles", &Loop::triangles)
        .function("positions", &Loop::positions)
        .function("normals", &Loop::normals)
        .function("forces", &Loop::forces)
        .function("times", &Loop::times)
        .function("recording", &Loop::recording)
        .function("stroke", &Loop::stroke)
        .function("left", &Loop::left)
        .function("differing", &Loop::differing)
        .function("values", &Loop::values)
        .function("contactTriangles", &Loop::contact_triangles)
        .function("trackedTriangles", &Loop::tracked_triangles)
        .function("treeBoxes", &Loop::tree_boxes)
        .function("moment", &Loop::moment)
        .function("force", &Loop::force)
        .function("forceError", &Loop::force_error)
        .function("radius", &Loop::radius)
        .function("drawnRadius", &Loop::drawn_radius)
        .function("size", &Loop::size)
        .function("equilibrium", &Loop::equilibrium)
        .function("choose", &Loop::choose);
}
