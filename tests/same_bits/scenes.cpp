// SPDX-License-Identifier: MIT
//
// Runs 30 scenes in double and in float, and prints a hash of all positions, forces and reports after 1, 10, ... ticks:
//
//     scenes [--ticks 10000] [--threads 1] [--scene NAME]
//     scenes [--ticks 1000] [--threads 1] --record FILE
//     scenes --replay FILE
//
// One line for each: scene, scalar, ticks, hash. `--record` instead writes a recording of a hand, with a snapshot in
// the middle; `--replay` replays one, prints its ticks, whether the snapshot is one of this machine, and how many
// forces differ, and returns 1 if one does. The program itself calls no mathematical function but the square root,
// whose result IEEE 754 determines.
#include <algorithm>
#include <array>
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/coarse/coarse_correction.hpp>
#include <membrane/core/thread_pool.hpp>
#include <membrane/haptics/contact_friction.hpp>
#include <membrane/haptics/force_limits.hpp>
#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/haptics/virtual_coupling.hpp>
#include <membrane/membrane.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/replay/initial_state.hpp>
#include <membrane/replay/recording_file.hpp>
#include <membrane/solve/tool_friction.hpp>
#include <membrane/surface/moving_body.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

namespace {

using membrane::Index;

/// What the command line asks for.
struct Request {
    int ticks = 10'000;
    int threads = 1;
    std::string scene;           // all, if empty
    std::string record, replay;  // files
};

/// FNV-1a over the bits of numbers, independent of the order of bytes in memory.
class Hash {
  public:
    void add(std::uint64_t word) noexcept {
        for (int shift = 0; shift < 64; shift += 8) value_ = (value_ ^ (word >> shift & 0xff)) * 0x100000001b3U;
    }
    void add(double number) noexcept { add_bits<std::uint64_t>(number + 0.0); }  // -0 counts as 0
    void add(float number) noexcept { add_bits<std::uint32_t>(number + 0.0F); }
    template <class Scalar>
    void add(const membrane::Vector3<Scalar>& v) noexcept {
        for (int k = 0; k < 3; ++k) add(v[k]);
    }
    [[nodiscard]] std::uint64_t value() const noexcept { return value_; }

  private:
    template <class Word, class Scalar>
    void add_bits(Scalar number) noexcept {
        Word word = 0;
        std::memcpy(&word, &number, sizeof word);
        add(std::uint64_t{word});
    }

    std::uint64_t value_ = 0xcbf29ce484222325U;
};

/// Numbers from 0 to 1, the same everywhere.
class Random {
  public:
    explicit Random(std::uint64_t seed) : state_(seed) {}
    double number() noexcept {
        state_ = state_ * 6364136223846793005U + 1442695040888963407U;
        return static_cast<double>(state_ >> 11) * 0x1p-53;
    }
    double number(double low, double high) noexcept { return low + (high - low) * number(); }

  private:
    std::uint64_t state_;
};

using Vector = membrane::Vector3<double>;

Vector unit(const Vector& v) { return v / membrane::norm(v); }

double smooth_step(double u) { return u * u * (3 - 2 * u); }

/// A hand that presses at one place after the other: down within 60 ticks, along the surface for 130, up for 60.
class Strokes {
  public:
    /// On a membrane of half the size `size` [m]; `deepest`: of a press [m].
    Strokes(std::uint64_t seed, double size, double deepest, bool flat)
        : random_(seed), size_(size), deepest_(deepest), flat_(flat) {}

    template <class Scalar>
    membrane::Tool<Scalar> next(double radius, const Vector& axis = Vector::Zero()) {
        if (tick_ % 250 == 0) choose();
        const int t = tick_++ % 250;
        const double down = smooth_step(std::clamp(t / 60.0, 0.0, 1.0) - std::clamp((t - 190) / 60.0, 0.0, 1.0));
        const double along = smooth_step(std::clamp((t - 60) / 130.0, 0.0, 1.0));
        double height = 1.1 * radius + 0.05 * size_ - down * (depth_ + 0.1 * radius + 0.05 * size_);
        if (lift_ > 0) {
            height +=
                lift_ * smooth_step(std::clamp((t - 60) / 120.0, 0.0, 1.0) - std::clamp((t - 200) / 50.0, 0.0, 1.0));
        }
        const Vector place = from_ + along * (to_ - from_);
        const Vector position =
            flat_ ? Vector(size_ * place[0], size_ * place[1], height) : (size_ + height) * unit(place);
        const Vector velocity = (position - position_) * (tick_ == 1 ? 0.0 : 1e3);
        position_ = position;
        membrane::Tool<Scalar> tool;
        tool.position = position.cast<Scalar>();
        tool.velocity = velocity.cast<Scalar>();
        tool.axis = axis.cast<Scalar>();
        tool.radius = static_cast<Scalar>(radius);
        tool.time = static_cast<Scalar>(tick_) / 1000;
        tool.grasping = grasps_ && t >= 50 && t < 200;
        return tool;
    }

    /// Forceps close in each stroke, and draw what they hold up [m].
    void grasp(double lift) noexcept {
        grasps_ = true;
        lift_ = lift;
    }

  private:
    Vector place() {
        Vector p;
        do {
            p = {random_.number(-0.6, 0.6), random_.number(-0.6, 0.6), flat_ ? 0 : random_.number(-0.6, 0.6)};
        } while (!flat_ && membrane::norm(p) < 0.1);
        return flat_ ? p : unit(p);
    }
    void choose() {
        from_ = place();
        to_ = from_ + 0.4 * (place() - from_);
        depth_ = random_.number(0.2, 1) * deepest_;
    }

    Random random_;
    double size_, deepest_;
    bool flat_, grasps_ = false;
    Vector from_, to_, position_ = Vector::Zero();
    double depth_ = 0, lift_ = 0;
    int tick_ = 0;
};

/// A square sheet of 20 mm, 13 x 13 vertices.
template <class Scalar>
membrane::TriangleMesh<Scalar> sheet() {
    constexpr Index n = 13;
    membrane::Points<Scalar> points(3, n * n);
    std::vector<Index> corners;
    for (Index i = 0; i < n; ++i) {
        for (Index j = 0; j < n; ++j) {
            const auto at = [](Index k) { return Scalar(0.02) * (static_cast<Scalar>(k) / (n - 1) - Scalar(0.5)); };
            points.col(i * n + j) << at(i), at(j), 0;
            if (i + 1 == n || j + 1 == n) continue;
            const Index a = i * n + j, b = a + n, c = b + 1, d = a + 1;
            if ((i + j) % 2 == 0)
                corners.insert(corners.end(), {a, b, c, a, c, d});
            else
                corners.insert(corners.end(), {a, b, d, b, c, d});
        }
    }
    return {std::span<const Scalar>(points.data(), static_cast<std::size_t>(points.size())),
            std::span<const Index>(corners)};
}

template <class Scalar>
membrane::TriangleMesh<Scalar> sphere(Index subdivisions) {
    return membrane::icosphere<Scalar>({.radius = Scalar(0.01), .subdivisions = subdivisions});
}

template <class Scalar>
membrane::TriangleMesh<Scalar> ellipsoid() {
    const auto ball = sphere<Scalar>(2);
    membrane::Points<Scalar> points = ball.positions();
    points.row(0) *= Scalar(1.25);
    points.row(2) *= Scalar(0.75);
    return {points, ball.triangles()};
}

/// Ten times as stiff beyond 4 % of strain.
struct Collagen {
    template <membrane::Real Scalar>
    membrane::SpringResponse<Scalar> operator()(const membrane::SpringState<Scalar>& s) const noexcept {
        const Scalar stretch = s.length - s.rest_length, k = s.stiffness;
        const Scalar taut = std::max(Scalar(0), stretch - Scalar(0.04) * s.rest_length);
        return {.tension = k * (stretch + 9 * taut),
                .stiffness = taut > 0 ? 10 * k : k,
                .energy = k / 2 * (stretch * stretch + 9 * taut * taut)};
    }
};

/// What a scene varies.
template <class Scalar, class Rule = membrane::BlockStep>
struct Variant {
    membrane::SolverOptions<Scalar> options = {.layers = 4};
    Rule rule = {};
    double radius = 0.002, depth = 0.0015;  // of the tool, of a press [m]
    double lift = 0;                        // by which forceps draw up what they hold [m]
    double friction = 0;                    // coefficient
    double fine_triangles = membrane::TrackerOptions().fine_triangles;
    Vector axis = Vector::Zero();  // of the tool [m]
    bool flat = false, grasps = false, two_tools = false, loads = false;
};

/// A membrane in the user's loop, with the hash of what it has done.
template <class Scalar, class Network, class Foundation, class Rule>
class Loop {
  public:
    Loop(std::string_view name, const membrane::TriangleMesh<Scalar>& mesh, const Network& network,
         const Foundation& foundation, const Variant<Scalar, Rule>& variant, membrane::AnyExecutor executor)
        : mesh_(mesh),
          network_(network),
          foundation_(foundation),
          variant_(variant),
          solver_(network, variant.options, variant.rule, std::move(executor)),
          tree_(mesh),
          tracker_(mesh, {.fine_triangles = variant.fine_triangles}),
          second_tracker_(mesh, {.fine_triangles = variant.fine_triangles}),
          grasper_(mesh),
          friction_({.coefficient = variant.friction}),
          strokes_(seed_of(name), 0.01, variant.depth, variant.flat),
          second_(seed_of(name) + 1, 0.01, variant.depth, variant.flat),
          x_(mesh.positions()) {
        if (variant.grasps) strokes_.grasp(variant.lift);
    }

    [[nodiscard]] membrane::Tool<Scalar> next_tool() {
        return strokes_.template next<Scalar>(variant_.radius, variant_.axis);
    }

    void tick() { tick(next_tool()); }

    void tick(const membrane::Tool<Scalar>& tool) {
        const auto contact = tracker_.update(tree_, x_, tool);
        const auto grasp = grasper_.update(contact, x_, tool);
        if (variant_.two_tools) {
            const auto other = second_.template next<Scalar>(variant_.radius);
            const auto other_contact = second_tracker_.update(tree_, x_, other);
            finish(step(foundation_, press(tool, contact, grasp), press(other, other_contact)));
        } else if (variant_.loads) {
            const std::array<Index, 3> corners{mesh_.triangles()(0, 5), mesh_.triangles()(1, 5),
                                               mesh_.triangles()(2, 5)};
            const Vector force(0.002, -0.004, 0.003);
            const std::array<Index, 3> pinned{3, 17, 29};
            finish(step(foundation_, press(tool, contact, grasp),
                        membrane::load(corners, Vector(0.5, 0.25, 0.25).cast<Scalar>(), force.cast<Scalar>()),
                        membrane::pin(std::span<const Index>(pinned))));
        } else if (variant_.friction > 0) {
            finish(step(foundation_, friction_.press(tool, contact, grasp), pull(tool, grasp)));
        } else {
            finish(step(foundation_, press(tool, contact, grasp), pull(tool, grasp)));
        }
        contact_ = contact;
        tool_ = tool;
    }

    [[nodiscard]] std::uint64_t hash() const {
        Hash all = hash_;
        for (Index v = 0; v < mesh_.vertex_count(); ++v) all.add(membrane::point(x_, v));
        return all.value();
    }

  protected:
    static std::uint64_t seed_of(std::string_view name) {
        Hash seed;
        for (const char c : name) seed.add(static_cast<std::uint64_t>(c));
        return seed.value();
    }

    template <class Volume, class... Constraints>
    membrane::StepReport<Scalar> step(const Volume& volume, const Constraints&... constraints) {
        return solver_.step(x_, Scalar(1e-3), network_, volume, constraints...);
    }

    void finish(const membrane::StepReport<Scalar>& report) {
        tree_.refit(x_, report.moved);
        hash_.add(static_cast<std::uint64_t>(report.status));
        hash_.add(static_cast<std::uint64_t>(report.converged));
        hash_.add(static_cast<std::uint64_t>(report.vertex_updates));
        for (const auto& reaction : report.reactions) hash_.add(reaction);
        report_ = report;
    }

    const membrane::TriangleMesh<Scalar> mesh_;
    Network network_;
    Foundation foundation_;
    const Variant<Scalar, Rule> variant_;
    membrane::QuasiStaticSolver<Scalar, Rule> solver_;
    membrane::AabbTree<Scalar> tree_;
    membrane::ContactTracker<Scalar> tracker_, second_tracker_;
    membrane::Grasper<Scalar> grasper_;
    membrane::ToolFriction<Scalar> friction_;
    Strokes strokes_, second_;
    membrane::Points<Scalar> x_;
    membrane::Contact<Scalar> contact_;
    membrane::Tool<Scalar> tool_;
    membrane::StepReport<Scalar> report_;
    Hash hash_;
};

/// The body goes round and to and fro; with `deforms`, it also beats.
template <class Scalar, class Network, class Foundation>
class OnBody : public Loop<Scalar, Network, Foundation, membrane::BlockStep> {
    using Base = Loop<Scalar, Network, Foundation, membrane::BlockStep>;

  public:
    OnBody(std::string_view name, const membrane::TriangleMesh<Scalar>& mesh, const Network& network,
           const Foundation& foundation, bool deforms)
        : Base(name, mesh, network, foundation, {}, membrane::AnyExecutor()), body_(mesh), deforms_(deforms) {}

    void tick() {
        // A triangle wave from 0 to 1 and back in 800 ticks.
        const double phase = std::abs((tick_++ + 400) % 800 - 400) / 400.0;
        membrane::RigidFrame<Scalar> pose;
        if (deforms_) {
            const membrane::Points<Scalar> anchors = static_cast<Scalar>(1 + 0.05 * phase) * this->mesh_.positions();
            if (!body_.move_to(anchors, Scalar(1e-3), this->x_)) std::abort();
        } else {
            const double a = 0.4 * phase, n = 1 + a * a;  // a rotation around z without sine and cosine
            pose.rotation << Scalar((1 - a * a) / n), Scalar(-2 * a / n), 0, Scalar(2 * a / n), Scalar((1 - a * a) / n),
                0, 0, 0, 1;
            pose.origin = Vector(0.004 * phase, 0, 0).cast<Scalar>();
            if (!body_.move_to(pose, this->x_)) std::abort();
        }
        this->tree_.refit(this->x_);
        auto tool = this->strokes_.template next<Scalar>(0.002);
        tool.position = pose.point_to_world(tool.position);
        const auto contact = this->tracker_.update(this->tree_, this->x_, tool, body_);
        const auto grasp = this->grasper_.update(contact, this->x_, tool, body_);
        this->finish(this->step(on(body_, this->foundation_), press(tool, contact, grasp), pull(tool, grasp)));
    }

  private:
    membrane::MovingBody<Scalar> body_;
    bool deforms_;
    int tick_ = 0;
};

/// A membrane that adheres to its body, until forceps peel it off; after four strokes it adheres again.
template <class Scalar, class Network>
class Peeled : public Loop<Scalar, Network, membrane::CohesiveSprings<Scalar>, membrane::BlockStep> {
    using Base = Loop<Scalar, Network, membrane::CohesiveSprings<Scalar>, membrane::BlockStep>;

  public:
    Peeled(std::string_view name, const membrane::TriangleMesh<Scalar>& mesh, const Network& network,
           const membrane::CohesionOptions<Scalar>& cohesion, const Variant<Scalar>& variant)
        : Base(name, mesh, network, {mesh, cohesion}, variant, membrane::AnyExecutor()) {}

    void tick() {
        if (tick_++ % 1000 == 0) this->foundation_.reset();
        Base::tick();
        this->foundation_.update(this->x_, this->report_.moved);
        this->hash_.add(this->foundation_.dissipated());
    }

  private:
    int tick_ = 0;
};

/// A stretched membrane that tears from slits where forceps draw it up. It is whole again when its reserve is used up.
template <class Scalar, class Network, class Foundation>
class Torn : public Loop<Scalar, Network, Foundation, membrane::BlockStep> {
    using Base = Loop<Scalar, Network, Foundation, membrane::BlockStep>;

  public:
    Torn(std::string_view name, const membrane::TriangleMesh<Scalar>& mesh, const Network& network,
         const Foundation& foundation, const membrane::EnergyRelease& criterion, const Variant<Scalar>& variant)
        : Base(name, mesh, network, foundation, variant, membrane::AnyExecutor()), tear_(mesh, criterion) {
        this->x_.template topRows<2>() *= Scalar(1.05);
        visit_parts([&](auto&... parts) { whole_.emplace(parts...); });
    }

    void tick() {
        if (tear_.reserve_used_up()) {
            visit_parts([&](auto&... parts) {
                if (!whole_->reset(parts...)) std::abort();
            });
            this->tree_.refit(this->x_);
        }
        const auto tool = this->next_tool();
        const auto contact = this->tracker_.update(this->tree_, this->x_, tool);
        if (++tick_ % 250 == 40 && contact.touching()) {
            const Vector direction(tick_ % 500 - 145, 200, 0);
            follow(tear_.cut_along(tear_.slit_at(contact.corners[0], direction.cast<Scalar>()), this->x_));
        }
        const auto grasp = this->grasper_.update(contact, this->x_, tool);
        this->finish(this->step(this->foundation_, press(tool, contact, grasp), pull(tool, grasp), tear_.ligaments()));
        follow(tear_.update(this->x_, Scalar(1e-3), this->network_, this->foundation_));
        this->hash_.add(tear_.dissipated());
    }

    /// Positions, triangles, and the length torn.
    [[nodiscard]] std::uint64_t hash() const {
        Hash all;
        all.add(Base::hash());
        for (const Index v : tear_.surface().triangles().reshaped()) all.add(static_cast<std::uint64_t>(v));
        all.add(tear_.torn_length());
        return all.value();
    }

  private:
    template <class Act>
    void visit_parts(Act act) {
        act(this->network_, this->foundation_, this->solver_, this->tree_, this->tracker_, this->grasper_, this->x_,
            tear_);
    }
    void follow(typename membrane::Tearing<Scalar>::Events events) {
        for (const auto& event : events) {
            membrane::follow(event, this->network_, this->foundation_, this->solver_, this->tree_, this->tracker_,
                             this->grasper_);
        }
    }

    membrane::Tearing<Scalar> tear_;
    std::optional<membrane::InitialState> whole_;
    int tick_ = 0;
};

/// A membrane that a coarse correction follows.
template <class Scalar, class Network, class Foundation>
class Corrected : public Loop<Scalar, Network, Foundation, membrane::BlockStep> {
    using Base = Loop<Scalar, Network, Foundation, membrane::BlockStep>;

  public:
    Corrected(std::string_view name, const membrane::TriangleMesh<Scalar>& mesh, const Network& network,
              const Foundation& foundation, const Variant<Scalar>& variant)
        : Base(name, mesh, network, foundation, variant, membrane::AnyExecutor()),
          coarse_(mesh, network, foundation, {.points = 40}) {}

    void tick() {
        Base::tick();
        const auto corrected = coarse_.correct(this->x_, this->solver_);
        this->solver_.wake(corrected.unbalanced);
        if (corrected.moved) this->tree_.refit(this->x_);
        if (membrane::is_finite(corrected.reaction_error)) this->hash_.add(corrected.reaction_error);
    }

  private:
    membrane::CoarseCorrection<Scalar> coarse_;
};

/// What the hand feels is in the hash, too.
template <class Scalar, class Network, class Foundation>
class AtHand : public Loop<Scalar, Network, Foundation, membrane::BlockStep> {
    using Base = Loop<Scalar, Network, Foundation, membrane::BlockStep>;

  public:
    AtHand(std::string_view name, const membrane::TriangleMesh<Scalar>& mesh, const Network& network,
           const Foundation& foundation)
        : Base(name, mesh, network, foundation, {}, membrane::AnyExecutor()), smooth_(mesh) {}

    void tick() { tick(this->next_tool()); }

    void tick(const membrane::Tool<Scalar>& tool) {
        Base::tick(tool);
        const auto smoothed = smooth_(this->contact_);
        const auto force = feel_({this->tool_, smoothed, this->report_});
        felt_ = limit_(force.template cast<double>(), static_cast<double>(this->tool_.time), ++steps_);
        this->hash_.add(force);
        this->hash_.add(felt_);
    }

    [[nodiscard]] membrane::Vector3<Scalar> felt() const { return felt_.template cast<Scalar>(); }

    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.solver_, self.tracker_, self.grasper_, self.x_, self.feel_, self.limit_, self.steps_);
    }

    void refit() { this->tree_.refit(this->x_); }

  private:
    membrane::SmoothContact<Scalar> smooth_;
    membrane::ContactFriction<membrane::SpringDamperForce, Scalar> feel_{
        membrane::SpringDamperForce{.stiffness = 300, .damping = 0.5},
        membrane::FrictionOptions{.coefficient = 0.3, .stiffness = 400}};
    membrane::ForceLimiter limit_{membrane::devices::touch};
    std::uint64_t steps_ = 0;
    Vector felt_ = Vector::Zero();
};

template <class Scalar, class Hand>
bool record(const Request& request, Hand&& hand, Index vertex_count) {
    const int ticks = std::min(request.ticks, 1000);
    membrane::Recorder<Scalar> recorder(static_cast<std::size_t>(ticks), vertex_count,
                                        {.count = 1, .bytes = membrane::snapshot_capacity(hand)});
    for (int tick = 0; tick < ticks; ++tick) {
        if (tick == ticks / 2 && !recorder.add_snapshot(hand)) return false;
        const auto tool = hand.next_tool();
        hand.tick(tool);
        recorder.add(tool, hand.felt());
    }
    std::ofstream file(request.record, std::ios::binary);
    write_recording(file, recorder.recording());
    return file.good();
}

/// From the first tick, and again from the snapshot.
template <class Scalar, class Hand>
bool replay(const Request& request, Hand&& hand, Hand&& other_hand, Index vertex_count) {
    std::ifstream file(request.replay, std::ios::binary);
    const auto recording = membrane::read_recording<Scalar>(file, vertex_count);
    membrane::ReplayDevice<Scalar> device(recording);
    const auto run = [&](Hand& some) {
        while (device.running()) {
            some.tick(device.read());
            device.write(some.felt());
        }
    };
    run(hand);
    const bool restored = device.start_from(recording.ticks.size(), other_hand);
    if (restored) {
        other_hand.refit();
        run(other_hand);
    }
    std::printf("%zu ticks, snapshot %s, %zu differ\n", recording.ticks.size(), restored ? "restored" : "refused",
                device.differing());
    return device.differing() == 0;
}

/// Runs a loop and prints its hashes.
template <class Scalar, class Loop>
void run(const Request& request, std::string_view name, Loop&& loop) {
    int next = 1;
    for (int tick = 1; tick <= request.ticks; ++tick) {
        loop.tick();
        if (tick != next) continue;
        std::printf("%.*s,%s,%d,%016" PRIx64 "\n", static_cast<int>(name.size()), name.data(),
                    sizeof(Scalar) == 8 ? "double" : "float", tick, loop.hash());
        next *= 10;
    }
    std::fflush(stdout);
}

template <class Scalar>
class Scenes {
  public:
    explicit Scenes(const Request& request) : request_(request) {}

    bool run_recording() {
        const auto ball = sphere<Scalar>(2);
        if (request_.replay.empty()) return record<Scalar>(request_, hand(ball), ball.vertex_count());
        return replay<Scalar>(request_, hand(ball), hand(ball), ball.vertex_count());
    }

    void run_all() {
        const auto ball = sphere<Scalar>(2);
        run_on_springs(ball);
        run_laws(ball);
        run_rules_and_orders(ball);
        run_bodies(ball);
        run_tissues(ball);
        run_drag_peel_tear(ball);
    }

  private:
    using Linear = membrane::LinearSpring;

    template <class Law = Linear>
    static auto network(const membrane::TriangleMesh<Scalar>& mesh, const Law& law = {}) {
        std::vector<Index> pinned = membrane::border(mesh);
        return membrane::MassSpringNetwork(mesh, law, {.stiffness = Scalar(40), .pinned = pinned});
    }
    static auto foundation(const membrane::TriangleMesh<Scalar>& mesh) {
        return membrane::VirtualVolumeSprings(mesh, {.stiffness = Scalar(20), .damping = Scalar(0.02)});
    }

    static auto hand(const membrane::TriangleMesh<Scalar>& ball) {
        using Hand = AtHand<Scalar, decltype(network(ball)), decltype(foundation(ball))>;
        return Hand("hand", ball, network(ball), foundation(ball));
    }

    template <class Network, class Foundation, class Rule = membrane::BlockStep>
    void loop(std::string_view name, const membrane::TriangleMesh<Scalar>& mesh, const Network& network,
              const Foundation& foundation, const Variant<Scalar, Rule>& variant = {},
              membrane::AnyExecutor executor = {}) {
        if (!asked(name)) return;
        run<Scalar>(
            request_, name,
            Loop<Scalar, Network, Foundation, Rule>(name, mesh, network, foundation, variant, std::move(executor)));
    }

    void run_on_springs(const membrane::TriangleMesh<Scalar>& ball) {
        const auto small = sphere<Scalar>(1), fine = sphere<Scalar>(3), long_ball = ellipsoid<Scalar>();
        const auto flat = sheet<Scalar>();
        using V = Variant<Scalar>;
        loop("sphere_42", small, network(small), foundation(small), V{.depth = 0.003});
        loop("sphere_162", ball, network(ball), foundation(ball));
        loop("sphere_642", fine, network(fine), foundation(fine));
        loop("by_vertices", fine, network(fine), foundation(fine), V{.friction = 0.2});
        loop("by_faces", fine, network(fine), foundation(fine), V{.friction = 0.2, .fine_triangles = 0});
        loop("ellipsoid", long_ball, network(long_ball), foundation(long_ball), V{.radius = 0.005});
        loop("sheet", flat, network(flat), foundation(flat), V{.flat = true});
        loop("point", ball, network(ball), foundation(ball), V{.radius = 0});
        loop("shaft", ball, network(ball), foundation(ball), V{.radius = 0.0008, .axis = {0.008, 0.012, 0.016}});
        loop("two_tools", ball, network(ball), foundation(ball), V{.two_tools = true});
        loop("forceps", ball, network(ball), foundation(ball), V{.grasps = true});
        loop("load_and_pin", ball, network(ball), foundation(ball), V{.loads = true});
        loop("no_foundation", flat, network(flat), membrane::NoFoundation(), V{.flat = true});
        if (asked("corrected")) {
            run<Scalar>(request_, "corrected",
                        Corrected("corrected", flat, network(flat), membrane::NoFoundation(), V{.flat = true}));
        }
    }

    void run_laws(const membrane::TriangleMesh<Scalar>& ball) {
        loop("tension_springs", ball, network(ball, membrane::TensionSpring()), foundation(ball));
        loop("stiffening_law", ball, network(ball, Collagen()), foundation(ball));
        loop("exponential_law", ball, network(ball, membrane::ExponentialSpring()), foundation(ball));
    }

    void run_rules_and_orders(const membrane::TriangleMesh<Scalar>& ball) {
        using V = Variant<Scalar>;
        loop("safe_step", ball, network(ball), foundation(ball), Variant<Scalar, membrane::SafeStep>{});
        loop("breadth_first", ball, network(ball), foundation(ball),
             V{.options = {.layers = 4, .order = membrane::UpdateOrder::breadth_first}});
        const membrane::ThreadPool pool(request_.threads);
        const auto fine = sphere<Scalar>(3);
        loop("threads", fine, network(fine), foundation(fine),
             V{.options = {.layers = membrane::unlimited, .order = membrane::UpdateOrder::colour_all}},
             pool.executor());
        loop("adaptive_layers", ball, network(ball), foundation(ball),
             V{.options = {.layers = 8, .adaptive_layers = true}});
        loop("few_updates", ball, network(ball), foundation(ball),
             V{.options = {.layers = 8, .predict = false, .max_vertex_updates = 200}});
    }

    void run_bodies(const membrane::TriangleMesh<Scalar>& ball) {
        using Network = decltype(network(ball));
        using Foundation = decltype(foundation(ball));
        const auto body = [&](std::string_view name, bool deforms) {
            if (!asked(name)) return;
            run<Scalar>(request_, name,
                        OnBody<Scalar, Network, Foundation>(name, ball, network(ball), foundation(ball), deforms));
        };
        body("turning_body", false);
        body("beating_body", true);
        if (asked("hand")) run<Scalar>(request_, "hand", hand(ball));
    }

    void run_tissues(const membrane::TriangleMesh<Scalar>& ball) {
        const membrane::Material material{.young_modulus = 5e5, .poisson_ratio = 0.4, .thickness = 1e-4};
        const auto none = membrane::MassSpringNetwork(ball, Linear{}, {.stiffness = Scalar(0)});
        const auto sheet = membrane::triangular_springs(ball, material);
        loop("triangular_springs", ball, membrane::Tissue(none, sheet), foundation(ball));
        loop("bending_and_pressure", ball,
             membrane::Tissue(network(ball), membrane::bending_springs(ball, membrane::flexural_rigidity(material)),
                              membrane::pressure(ball, Scalar(20))),
             foundation(ball));
    }

    void run_drag_peel_tear(const membrane::TriangleMesh<Scalar>& ball) {
        loop("drag", ball, network(ball), foundation(ball), Variant<Scalar>{.friction = 0.4});
        const Variant<Scalar> forceps{.lift = 0.004, .flat = true, .grasps = true};
        if (const auto flat = sheet<Scalar>(); asked("peel")) {
            const membrane::CohesionOptions<Scalar> cohesion{
                .stiffness = Scalar(1e5), .strength = Scalar(20), .energy = Scalar(0.02)};
            run<Scalar>(request_, "peel", Peeled("peel", flat, network(flat), cohesion, forceps));
        }
        if (const auto flat = membrane::with_reserve(sheet<Scalar>(), 60); asked("tear")) {
            const membrane::Material material{.young_modulus = 5e5, .poisson_ratio = 0.4, .thickness = 1e-4};
            const auto springs = membrane::TearableSprings(flat, network(flat));
            const auto tissue = membrane::Tissue(springs, membrane::triangular_springs(flat, material));
            const membrane::EnergyRelease criterion{.toughness = 100, .thickness = material.thickness};
            run<Scalar>(request_, "tear", Torn("tear", flat, tissue, foundation(flat), criterion, forceps));
        }
    }

    [[nodiscard]] bool asked(std::string_view name) const { return request_.scene.empty() || request_.scene == name; }

    const Request& request_;
};

}  // namespace

int main(int argc, char** argv) {
    Request request;
    for (int i = 1; i + 1 < argc; i += 2) {
        const std::string_view name = argv[i];
        if (name == "--ticks")
            request.ticks = std::atoi(argv[i + 1]);
        else if (name == "--threads")
            request.threads = std::atoi(argv[i + 1]);
        else if (name == "--scene")
            request.scene = argv[i + 1];
        else if (name == "--record")
            request.record = argv[i + 1];
        else if (name == "--replay")
            request.replay = argv[i + 1];
        else
            return std::fprintf(stderr, "scenes: unknown option %s\n", argv[i]), 2;
    }
    if (!request.record.empty() || !request.replay.empty()) return Scenes<double>(request).run_recording() ? 0 : 1;
    Scenes<double>(request).run_all();
    Scenes<float>(request).run_all();
}
