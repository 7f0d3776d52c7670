// SPDX-License-Identifier: MIT
//
// The loop of the page for JavaScript: a worker moves a `Loop` by the ticks of each displayed frame.
#include <algorithm>
#include <cstring>
#include <string>

#include <emscripten.h>
#include <emscripten/bind.h>
#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/mesh_check/validate.hpp>

#include "hand.hpp"
#include "recording.hpp"

using namespace emscripten;
using namespace web;

// The module is compiled without exceptions: invalid input becomes an error of JavaScript.
EM_JS(void, throw_error, (const char* message), { throw new Error(UTF8ToString(message)); });

namespace {

template <class Number>
val view(const std::vector<Number>& numbers) {
    return val(typed_memory_view(numbers.size(), numbers.data()));
}

template <class Matrix>
val view(const Matrix& numbers) {
    return val(typed_memory_view(static_cast<std::size_t>(numbers.size()), numbers.data()));
}

class Loop {
  public:
    explicit Loop(Mesh mesh, const Settings& settings)
        : session_(std::move(mesh), settings),
          hand_(tool_radius(session_.mesh()), 12 * size_of(session_.mesh())),
          layers_(static_cast<std::size_t>(session_.mesh().vertex_count())) {}

    void configure(const Settings& settings) { session_.configure(settings); }

    void place(const Vector3& position) {
        hand_.place(position);
        session_.lift_tool();
        placed_ = true;
    }

    /// Up to `ticks` ticks toward `target` within `budget` [ms]; returns how many. The forceps close at the membrane.
    int run(int ticks, double budget, const Vector3& target, bool close) {
        return run_frame(ticks, budget, [&] {
            const auto& last = session_.moment();
            hand_.follow(target, close && (last.tool.grasping || last.contact.touching()), dt);
            step(hand_.tool(), std::exchange(placed_, false));
        });
    }

    /// Up to `ticks` ticks of the recording, with the present settings; returns how many were left.
    int replay(int ticks, double budget) {
        const auto left = [&] { return static_cast<int>(script_.size() - next_); };
        run_frame(std::min(ticks, left()), budget, [&] {
            const Row& row = script_[next_++];
            if (row.placed != 0) session_.lift_tool();
            step(tool_of(row, hand_.tool().radius), row.placed != 0);
        });
        return left();
    }

    void start_recording() {
        recording_ = true;
        rows_.clear();
        rows_.reserve(max_rows);
    }
    void stop_recording() { recording_ = false; }

    /// Rows of a recording, to be replayed.
    void load(const val& rows) {
        const auto numbers = convertJSArrayToNumberVector<double>(rows);
        script_.resize(numbers.size() / row_size);
        std::memcpy(script_.data(), numbers.data(), script_.size() * sizeof(Row));
        next_ = 0;
    }

    [[nodiscard]] val rest() const { return view(session_.mesh().positions()); }
    [[nodiscard]] val triangles() const { return view(session_.mesh().triangles()); }
    [[nodiscard]] val positions() const { return view(session_.x()); }
    [[nodiscard]] val normals() const { return view(session_.normals()); }
    [[nodiscard]] val forces() const { return view(forces_); }
    [[nodiscard]] val times() const { return view(times_); }
    [[nodiscard]] val recording() const {
        return val(typed_memory_view(row_size * rows_.size(), reinterpret_cast<const double*>(rows_.data())));
    }

    /// For each vertex 1 + the number of its layer in the queue; 0 outside.
    [[nodiscard]] val layers() {
        std::fill(layers_.begin(), layers_.end(), std::uint8_t{0});
        const auto& queue = session_.queue();
        for (Index k = 0; k < queue.layer_count(); ++k)
            for (const Index v : queue.layer(k))
                layers_[static_cast<std::size_t>(v)] = static_cast<std::uint8_t>(k + 1);
        return view(layers_);
    }

    /// Triangles with a contact force.
    [[nodiscard]] val contact_triangles() {
        touched_.clear();
        for (const auto& point : session_.contact_points())
            if (!point.force.isZero(0)) touched_.push_back(point.triangle);
        return view(touched_);
    }

    [[nodiscard]] Moment moment() const { return session_.moment(); }
    [[nodiscard]] Vector3 force() const { return session_.force(); }
    [[nodiscard]] double radius() const { return hand_.tool().radius; }
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

  private:
    static constexpr std::size_t max_rows = 60'000;                        // a minute
    static constexpr std::size_t row_size = sizeof(Row) / sizeof(double);  // in numbers

    /// Up to `ticks` calls of `tick` within `budget` [ms], with force and time of each; returns how many.
    template <class Tick>
    int run_frame(int ticks, double budget, Tick tick) {
        forces_.clear();
        times_.clear();
        const double begin = emscripten_get_now();
        double before = begin;
        int done = 0;
        for (; done < ticks && before - begin < budget; ++done) {
            tick();
            const double after = emscripten_get_now();
            times_.push_back(after - before);
            forces_.push_back(membrane::norm(session_.force()));
            before = after;
        }
        return done;
    }

    void step(const membrane::Tool<double>& tool, bool placed) {
        session_.step(tool);
        if (recording_ && rows_.size() < max_rows) rows_.push_back(row_of(session_, placed));
    }

    Session session_;
    Hand hand_;
    bool placed_ = false, recording_ = false;
    std::vector<Row> rows_, script_;      // recorded, and to be replayed
    std::size_t next_ = 0;                // of `script_`
    std::vector<double> forces_, times_;  // of each tick of the frame [N], [ms]
    std::vector<std::uint8_t> layers_;
    std::vector<Index> touched_;
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
        .field("volumeSprings", &Settings::volume_springs);
    using Tool = membrane::Tool<double>;
    value_object<Tool>("Tool").field("position", &Tool::position).field("radius", &Tool::radius);
    using Contact = membrane::Contact<double>;
    value_object<Contact>("Contact")  // what an equilibrium needs of it
        .field("touching", &touching, &set_touching)
        .field("corners", &Contact::corners)
        .field("point", &Contact::point)
        .field("normal", &Contact::normal)
        .field("axisPoint", &Contact::axis_point)
        .field("gap", &Contact::gap)
        .field("detectionDistance", &Contact::detection_distance)
        .field("radius", &Contact::radius);
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
    value_object<Findings>("Findings").field("valid", &Findings::valid).field("text", &Findings::text);

    function("validate", &validate);
    function("sphere", &of_sphere, allow_raw_pointers());
    function("cornea", &of_cornea, allow_raw_pointers());
    function("lens", &of_lens, allow_raw_pointers());
    function("surface", &of_surface, allow_raw_pointers());
    class_<Loop>("Loop")
        .function("configure", &Loop::configure)
        .function("place", &Loop::place)
        .function("run", &Loop::run)
        .function("replay", &Loop::replay)
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
        .function("layers", &Loop::layers)
        .function("contactTriangles", &Loop::contact_triangles)
        .function("moment", &Loop::moment)
        .function("force", &Loop::force)
        .function("radius", &Loop::radius)
        .function("size", &Loop::size)
        .function("equilibrium", &Loop::equilibrium);
}
