// SPDX-License-Identifier: MIT
#include <membrane/certify/passivity.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <membrane/haptics/force_limits.hpp>
#include <membrane/haptics/force_policy.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// A device of nothing but its damping, strong enough for all.
DeviceProfile bare(double damping) {
    return {.name = "bare", .peak_force = 1e6, .continuous_force = 1e6, .stiffness = 1e9, .damping = damping};
}

/// A hand that follows its own paths over a membrane that is a wall of springs: soft where it is touched first, and
/// nowhere stiffer than it says.
struct Scene {
    explicit Scene(Random& random, bool stiffening)
        : hand_mass(random.number(0.05, 0.3)),
          hand_stiffness(random.number(50.0, 500.0)),
          damping(random.number(0.2, 4.0)),
          normal(random.unit_vector()),
          soft(stiffening ? random.number(0.0, 3e-3) : 0) {
        frequency = 2 * std::numbers::pi * std::pow(10, random.number(-0.3, 2.0));
        for (auto& displacement : displacements) displacement = random.vector(-0.01, 0.01);
    }

    double hand_mass, hand_stiffness, damping;  // damping of device and hand together
    Vector3<double> normal;
    double soft;       // depth at which the wall has half its stiffness [m]
    double frequency;  // [rad/s]
    std::array<Vector3<double>, 2> displacements;

    [[nodiscard]] Vector3<double> wanted(double time) const {
        return std::sin(frequency * time) * displacements[0] + std::sin(0.37 * frequency * time) * displacements[1];
    }

    /// Depth from which the force of a spring has slope depth^2 / (depth^2 + soft^2) <= 1.
    [[nodiscard]] double effective(double depth) const {
        return soft > 0 ? depth - soft * std::atan(depth / soft) : depth;
    }

    [[nodiscard]] HapticState<double> state(const Vector3<double>& position, const Vector3<double>& velocity,
                                            Vector3<double>& reaction, double tissue) const {
        HapticState<double> state{};
        state.tool.position = position;
        state.tool.velocity = velocity;
        const double depth = -dot(position, normal);
        if (depth > 0) state.contact.phase = ContactPhase::ongoing;
        state.contact.normal = normal;
        state.contact.depth = effective(std::max(depth, 0.0));
        reaction = tissue * state.contact.depth * normal;
        state.report.reactions = {&reaction, 1};
        return state;
    }
};

/// What a loop has come to.
struct Energies {
    PassivityObserver port;      // of the loop, device and hand damping included
    double hand = 0, given = 0;  // by what the hand wants: all it did, and what of it went in [J]
    double least = 0;
    bool touched = false;
};

/// The hand between two ticks under a held force, by implicit midpoints, whose energies balance exactly.
struct Hand {
    Vector3<double> position, velocity = Vector3<double>::Zero();

    void go(const Scene& scene, const Vector3<double>& held, double time, double dt, Energies& energies) {
        constexpr int parts = 2;
        const double h = dt / parts;
        for (int i = 0; i < parts; ++i) {
            const double k = scene.hand_stiffness, b = scene.damping, m = scene.hand_mass;
            const Vector3<double> pull = k * scene.wanted(time + (i + 0.5) * h);  // the spring's other end
            const Vector3<double> push = held + pull - k * position - b * velocity - k * h / 2 * velocity;
            const Vector3<double> more = push / (m / h + b / 2 + k * h / 4);
            const Vector3<double> displacement = h * (velocity + more / 2);
            position += displacement;
            velocity += more;
            const double work = dot(pull, displacement);
            energies.hand += work;
            energies.given += std::max(work, 0.0);
            energies.least = std::min(energies.least, energies.hand);
        }
    }
};

/// Plays a loop of `policy`, with forces `delay` ticks late.
template <class Policy>
Energies play(const Scene& scene, Policy policy, double tissue, const SampledLoop& loop, int ticks) {
    Energies energies{.port = PassivityObserver(scene.damping)};
    Hand hand{.position = Vector3<double>::Zero()};
    const auto late = static_cast<std::size_t>(std::lround(loop.delay / loop.tick));
    std::vector<Vector3<double>> positions(late + 2, hand.position);
    for (int tick = 0; tick < ticks; ++tick) {
        std::rotate(positions.rbegin(), positions.rbegin() + 1, positions.rend());
        positions[0] = hand.position;
        const Vector3<double> seen = positions[late], velocity = (seen - positions[late + 1]) / loop.tick;
        Vector3<double> reaction;
        const Vector3<double> force = policy(scene.state(seen, velocity, reaction, tissue));
        energies.port.update(hand.position, force, loop.tick);
        energies.touched = energies.touched || norm(force) > 0;
        hand.go(scene, force, tick * loop.tick, loop.tick, energies);
        if (!(norm(hand.position) < 1e3)) break;  // it has blown up
    }
    return energies;
}

SampledLoop random_loop(Random& random, double damping) {
    const double tick = 1e-3 * random.number(0.25, 2.0);
    return {.stiffness = 0,
            .damping = random.number(0.0, 0.8) * damping,
            .tick = tick,
            .delay = tick * random.index(4),
            .negative_stiffness = 0,
            .off_potential = 0};
}

}  // namespace

TEST_CASE("random loops inside the check never give energy", "[passivity]") {
    const int loops = cases(10'000);
    int touched = 0;
    for (int seed = 1; seed <= loops; ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const Scene scene(random, random.chance(0.5));
        auto loop = random_loop(random, scene.damping);
        const bool by_reaction = random.chance(0.4);
        if (by_reaction) loop.damping = 0;
        const double share = random.number(0.0, 1.0);
        const auto device = bare(share * scene.damping);
        const Dissipation there{.hand_damping = (1 - share) * scene.damping};
        loop.stiffness = random.number(0.2, 0.9999) * passivity(loop, device, there).max_stiffness;
        if (!passivity(loop, device, there).passive) FAIL("refused, seed " << seed);

        const double tissue = random.number(1.0, 50.0);
        const auto energies = by_reaction
                                  ? play(scene, ReactionForce{.scale = loop.stiffness / tissue}, tissue, loop, 150)
                                  : play(scene, SpringDamperForce{.stiffness = loop.stiffness, .damping = loop.damping},
                                         tissue, loop, 150);
        const bool good =
            energies.port.min_energy() >= -1e-9 * energies.port.energy_in() && energies.least >= -1e-9 * energies.given;
        if (!good) {
            FAIL("seed " << seed << ": " << energies.port.min_energy() << " of " << energies.port.energy_in() << " J, "
                         << energies.least << " of " << energies.given << " J");
        }
        touched += energies.touched ? 1 : 0;
    }
    CHECK(touched > loops / 2);
}

TEST_CASE("at 1.5 times the bound loops are active", "[passivity]") {
    // A hand that throws a tool against a spring: what comes back is more than it put in.
    const int loops = cases(300);
    for (int seed = 1; seed <= loops; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Scene scene(random, false);
        scene.frequency = 0;
        scene.hand_stiffness = 0;
        auto loop = random_loop(random, scene.damping);
        loop.damping = 0;  // it would help here: what a damper gives, it gives to a quiver, see below
        const auto device = bare(scene.damping);
        const double bound = passivity(loop, device, {.hand_damping = 0}).max_stiffness;
        // Heavy for the stiffness: an oscillation takes a hundred ticks and more.
        scene.hand_mass = 1.5 * bound * std::pow(30 * loop.tick, 2);
        for (const double times : {0.9, 1.5}) {
            loop.stiffness = times * bound;
            CHECK(passivity(loop, device, {.hand_damping = 0}).passive == (times < 1));
            Energies energies{.port = PassivityObserver(scene.damping)};
            Hand hand{.position = Vector3<double>::Zero(), .velocity = 0.01 * scene.normal};
            const double energy_in = scene.hand_mass * 1e-4 / 2;  // in motion
            std::array<Vector3<double>, 4> positions;
            positions.fill(hand.position);
            const auto late = static_cast<std::size_t>(std::lround(loop.delay / loop.tick));
            double last = 0;
            for (int tick = 0; tick < 4000; ++tick) {
                std::rotate(positions.rbegin(), positions.rbegin() + 1, positions.rend());
                positions[0] = hand.position;
                const Vector3<double> force = -loop.stiffness * positions[late];
                energies.port.update(hand.position, force, loop.tick);
                hand.go(scene, force, 0, loop.tick, energies);
                last = scene.hand_mass / 2 * squared_norm(hand.velocity) +
                       loop.stiffness / 2 * squared_norm(hand.position);
            }
            CHECK((energies.port.min_energy() < -0.01 * energy_in) == (times > 1));
            CHECK((last > 1.05 * energy_in) == (times > 1));
        }
    }
}

TEST_CASE("a quiver as fast as the ticks is the worst for spring and damper together", "[passivity]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const double damping = random.number(0.2, 4.0);
        auto loop = random_loop(random, damping);
        loop.delay = 0;
        const double bound = passivity(loop, bare(damping), {.hand_damping = 0}).max_stiffness;
        for (const double times : {0.9, 1.5}) {
            loop.stiffness = times * bound;
            const SpringDamperForce feel{.stiffness = loop.stiffness, .damping = loop.damping};
            PassivityObserver observer(damping);
            HapticState<double> state{};
            state.contact.phase = ContactPhase::ongoing;
            state.contact.normal = {0, 0, 1};
            for (int tick = 0; tick < 500; ++tick) {
                const double before = state.contact.depth;
                state.contact.depth = tick % 2 == 0 ? 0.010 : 0.012;
                const double up = tick == 0 ? 0 : before - state.contact.depth;
                state.tool.velocity = {0, 0, up / loop.tick};
                observer.update<double>({0, 0, -state.contact.depth}, feel(state), loop.tick);
            }
            REQUIRE((observer.energy() < 0) == (times > 1));
        }
    }
}

TEST_CASE("the bound is that of Colgate and Schenkel, with delay, friction and resolution", "[passivity]") {
    const SampledLoop wall{
        .stiffness = 1000, .damping = 0.3, .tick = 1e-3, .negative_stiffness = 0, .off_potential = 0};
    CHECK(passivity(wall, bare(0.5), {.hand_damping = 0.4}).damping_needed == Approx(0.8));
    CHECK(passivity(wall, bare(0.5), {.hand_damping = 0.4}).damping_available == Approx(0.9));
    CHECK(passivity(wall, bare(0.5), {.hand_damping = 0.4}).max_stiffness == Approx(1200));
    const SampledLoop late{.stiffness = 1000, .tick = 1e-3, .delay = 2e-3, .negative_stiffness = 0, .off_potential = 0};
    CHECK(passivity(late, bare(0.5), {.hand_damping = 0}).damping_needed == Approx(2.5));
    CHECK(passivity(late, bare(0.5), {.hand_damping = 0}).max_stiffness == Approx(200));
    // Friction of 0.2 N is a damper of 2 N s/m up to 0.1 m/s, of nothing if the speed is not known.
    auto device = bare(0);
    device.friction = 0.2;
    CHECK(passivity(wall, device, {.hand_damping = 0, .max_speed = 0.1}).damping_available == Approx(2));
    CHECK(passivity(wall, device, {.hand_damping = 0}).damping_available == 0);
    CHECK_FALSE(passivity(wall, device, {.hand_damping = 0}).passive);
    // A coarse position takes its share of it; a device shows no more than it can.
    device.resolution = 1e-4;
    CHECK(passivity(wall, device, {.hand_damping = 5}).max_stiffness == Approx(2 * (0.2 - 0.03) / 1e-4));
    device.friction = 0.05;
    CHECK_FALSE(passivity(wall, device, {.hand_damping = 5}).passive);
    device = bare(5);
    device.stiffness = 900;
    CHECK_FALSE(passivity(wall, device, {.hand_damping = 0}).passive);
    CHECK(passivity(wall, device, {.hand_damping = 0}).max_stiffness == 900);
    CHECK(passivity({.stiffness = 0}, device, {.hand_damping = 0}).passive);
}

TEST_CASE("what a check presumes of a force has to be said", "[passivity]") {
    const auto refused = [](const SampledLoop& loop, const DeviceProfile& device) {
        return test::refusal([&] { require_passive(loop, device, {.hand_damping = 5}); });
    };
    CHECK(refused({.stiffness = 100}, bare(0)) ==
          "passivity: off_potential must be known, 0 for a force that has a potential [N], got inf");
    CHECK(refused({.stiffness = 100, .off_potential = 0}, bare(0)) == "");  // nothing comes too late or is coarse
    CHECK(
        refused({.stiffness = 100, .delay = 1e-3, .off_potential = 0}, bare(0)) ==
        "passivity: with a delay of 0.001 s and a resolution of 0 m negative_stiffness must be known and finite [N/m], "
        "got inf");
    CHECK(refused({.stiffness = 100, .off_potential = 0}, devices::touch) ==
          "passivity: with a delay of 0 s and a resolution of 5.5e-05 m negative_stiffness must be known and finite "
          "[N/m], "
          "got inf");
    CHECK(refused({.stiffness = 100, .negative_stiffness = 100, .off_potential = 0}, devices::touch) == "");
    // What has no potential gives in slow loops, and only friction takes that.
    CHECK(
        refused({.stiffness = 100, .off_potential = 0.1}, bare(0)) ==
        "passivity: with damping 0 N s/m, negative_stiffness inf N/m and off_potential 0.1 N friction of bare must be "
        "at least 0.1 [N], got 0");
    CHECK(refused({.stiffness = 100, .negative_stiffness = 0, .off_potential = 0.1}, devices::touch) == "");
    CHECK(refused({.stiffness = 100, .negative_stiffness = 0, .off_potential = 0.3}, devices::touch) != "");
}

TEST_CASE("the most stiffness is that with which a loop is just passive, whatever the rest", "[passivity]") {
    for (int seed = 1; seed <= cases(5000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto device = bare(random.number(0.0, 2.0));
        device.friction = random.chance(0.3) ? 0 : random.number(0.0, 0.3);
        device.resolution = random.chance(0.5) ? 0 : random.number(0.0, 1e-4);
        auto loop = random_loop(random, 0.2);
        loop.negative_stiffness = random.chance(0.2) ? infinity : std::pow(10, random.number(-1.0, 5.0));
        loop.off_potential = random.chance(0.5) ? 0 : random.number(0.0, 0.2);
        const Dissipation there{.hand_damping = random.number(0.0, 3.0),
                                .max_speed = random.chance(0.5) ? infinity : random.number(0.05, 1.0)};
        const auto passive_at = [&](double stiffness) {
            loop.stiffness = stiffness;
            return passivity(loop, device, there).passive;
        };
        const double most = passivity(loop, device, there).max_stiffness;
        REQUIRE(is_finite(most));
        if (most > 0) REQUIRE(passive_at(0.999 * most));
        if (most < device.stiffness) REQUIRE_FALSE(passive_at(1.001 * most + 1e-9));
    }
}

namespace {

/// A force law over a row of places, linear between them, and the search for a walk along them that gains energy.
class Walks {
  public:
    static constexpr std::size_t places = 7;
    using Law = std::array<double, places>;

    explicit Walks(const Law& force) : force_(force) {
        for (std::size_t i = 1; i < places; ++i) potential_[i] = potential_[i - 1] + (force[i - 1] + force[i]) / 2;
    }

    /// Energy of the hand at the end of the worst walk there is, above that of the law's potential: in places apart and
    /// ticks of 1, the force `delay` ticks late, beside a damper. By dynamic programming over the last places.
    [[nodiscard]] double worst(std::size_t delay, double damping, int ticks) const {
        std::size_t states = places;
        for (std::size_t i = 0; i < delay; ++i) states *= places;
        std::vector<double> best(states, 0.0), next(states);
        for (int tick = 0; tick < ticks; ++tick) {
            for (std::size_t state = 0; state < states; ++state) {  // places from the last to the earliest
                const std::size_t here = state % places, seen = state / (states / places);
                double least = infinity;
                for (std::size_t to = 0; to < places; ++to) {
                    const double displacement = static_cast<double>(to) - static_cast<double>(here);
                    const double more = force_[seen] * displacement + damping * displacement * displacement -
                                        (potential_[to] - potential_[here]);
                    least = std::min(least, more + best[state % (states / places) * places + to]);
                }
                next[state] = least;
            }
            best.swap(next);
        }
        double least = infinity;
        for (std::size_t place = 0; place < places; ++place) {
            std::size_t resting = 0;
            for (std::size_t i = 0; i <= delay; ++i) resting = resting * places + place;
            least = std::min(least, best[resting]);
        }
        return least;
    }

  private:
    Law force_, potential_{};
};

}  // namespace

TEST_CASE("no walk over a force law within its slopes gains energy, whatever the delay", "[passivity]") {
    constexpr int ticks = 40;
    std::array<int, 4> gained{};
    for (int seed = 1; seed <= cases(100); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const double up = random.chance(0.2) ? 0.01 : 1, down = random.chance(0.2) ? 0 : random.number(0.0, 20.0);
        const double steep = random.number();  // how often a slope is one of the two
        Walks::Law force{random.number(-3.0, 3.0)};
        for (std::size_t i = 1; i < Walks::places; ++i) {
            const double slope = random.chance(steep) ? (random.chance(0.5) ? up : -down) : random.number(-down, up);
            force[i] = force[i - 1] + slope;
        }
        const Walks walks(force);
        for (std::size_t delay = 0; delay < 4; ++delay) {
            CAPTURE(seed, delay, up, down, force);
            const SampledLoop loop{.stiffness = up,
                                   .tick = 1,
                                   .delay = static_cast<double>(delay),
                                   .negative_stiffness = down,
                                   .off_potential = 0};
            const double damping = passivity(loop, bare(0), {.hand_damping = 0}).damping_needed;
            REQUIRE(walks.worst(delay, damping, ticks) >= -1e-12);
            // As much as a wall needs that has no slope downward.
            auto wall = loop;
            wall.negative_stiffness = 0;
            const double less = passivity(wall, bare(0), {.hand_damping = 0}).damping_needed;
            gained[delay] += walks.worst(delay, less, ticks) < -1e-3;
        }
    }
    CHECK(gained[0] == 0);  // without a delay a wall may end
    for (std::size_t delay = 1; delay < 4; ++delay) CHECK(gained[delay] > 0);
}

TEST_CASE("with less damping than the bound there is a walk that gains energy", "[passivity]") {
    const Walks spring({0, 1, 2, 3, 4, 5, 6});
    CHECK(spring.worst(0, 0.499, 40) < -1e-3);
    CHECK(spring.worst(1, 1.2, 60) < -1e-3);
    CHECK(spring.worst(2, 1.8, 60) < -1e-3);
}

TEST_CASE("a wall that ends is refused where its force comes late", "[passivity]") {
    const double stiffness = 100, end = 0.01, tick = 1e-3, off = 0.5e-3;
    for (int delay = 0; delay < 4; ++delay) {
        const SampledLoop wall{.stiffness = stiffness, .tick = tick, .delay = delay * tick, .off_potential = 0};
        const Dissipation hand{.hand_damping = 1.01 * stiffness * (tick / 2 + delay * tick)};
        CHECK(passivity(wall, bare(0), hand).passive == (delay == 0));
        PassivityObserver observer(hand.hand_damping);
        std::vector<double> displacement;
        for (int i = 0; i <= 100; ++i) displacement.push_back((end - off) * i / 100);
        for (int i = 0; i < 2000; ++i) displacement.push_back(i / std::max(delay, 1) % 2 == 1 ? end - off : end + off);
        for (std::size_t i = 0; i < displacement.size(); ++i) {
            const auto late = static_cast<std::size_t>(delay);
            const double seen = i >= late ? displacement[i - late] : 0;
            const double force = seen > 0 && seen < end ? -stiffness * seen : 0;
            observer.update(Vector3<double>(displacement[i], 0, 0), Vector3<double>(force, 0, 0), tick);
        }
        if (delay == 0) CHECK(observer.min_energy() == 0);
        if (delay == 1) CHECK(observer.energy() < -0.5);
    }
}

TEST_CASE("accepted at 0.9 of the bound, refused at 1.1, on every device", "[passivity]") {
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        constexpr std::array all{devices::touch, devices::phantom_desktop, devices::premium_1_5, devices::premium_3_0,
                                 devices::omega};
        const auto device = all[static_cast<std::size_t>(random.index(5))];
        const double hand = random.number(0.0, 5.0);
        auto loop = random_loop(random, 0.5 * hand);
        const Dissipation there{.hand_damping = hand, .max_speed = random.chance(0.5) ? infinity : 0.2};
        const double bound = passivity(loop, device, there).max_stiffness;
        if (bound == 0) continue;
        loop.stiffness = 0.9 * bound;
        REQUIRE(passivity(loop, device, there).passive);
        REQUIRE(test::refusal([&] { require_passive(loop, device, there); }) == "");
        loop.stiffness = 1.1 * bound;
        REQUIRE_FALSE(passivity(loop, device, there).passive);
    }
}

TEST_CASE("friction and a coarse position are counted rightly on any path", "[passivity]") {
    // On any path, not only that of a hand: what the observer counts at the least is never negative.
    for (int seed = 1; seed <= cases(2000); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        auto device = bare(random.number(0.0, 1.0));
        device.friction = random.number(0.05, 0.3);
        device.resolution = random.chance(0.5) ? 0 : 5e-5;
        SampledLoop loop{.stiffness = 0,
                         .damping = 0.02,
                         .tick = 1e-3,
                         .delay = 1e-3 * random.index(3),
                         .negative_stiffness = 0,
                         .off_potential = 0};
        const double max_speed = random.number(0.02, 0.5);
        const Dissipation there{.hand_damping = random.number(0.0, 1.0), .max_speed = max_speed};
        loop.stiffness = passivity(loop, device, there).max_stiffness;
        if (loop.stiffness == 0) continue;
        PassivityObserver observer(device.damping + there.hand_damping, device.friction);
        std::array<double, 5> seen{};
        double position = 0, speed = 0;
        const auto late = static_cast<std::size_t>(std::lround(loop.delay / loop.tick));
        for (int tick = 0; tick < 500; ++tick) {
            std::rotate(seen.rbegin(), seen.rbegin() + 1, seen.rend());
            seen[0] = device.resolution > 0 ? device.resolution * std::round(position / device.resolution) : position;
            const double at = seen[late], before = seen[late + 1];
            const double depth = std::max(-at, 0.0);
            const double push =
                depth > 0 ? std::max(loop.stiffness * depth - loop.damping * (at - before) / loop.tick, 0.0) : 0;
            observer.update(Vector3<double>(position, 0, 0), Vector3<double>(push, 0, 0), loop.tick);
            if (random.chance(0.3)) speed = random.number(-max_speed, max_speed);
            if (std::abs(position) > 0.005) speed = position > 0 ? -max_speed : max_speed;
            position += loop.tick * speed;
        }
        if (observer.min_energy() < -1e-9 * observer.energy_in())
            FAIL("seed " << seed << ": " << observer.min_energy() << " J");
    }
}

TEMPLATE_TEST_CASE("the observer counts what a held force does", "[passivity]", TEST_SCALARS) {
    using S = TestType;
    PassivityObserver observer;
    observer.update<S>({0, 0, 0}, {0, 0, 2}, 1e-3);
    CHECK(observer.energy() == 0);
    observer.update<S>({0, 0, S(-0.5)}, {0, 0, 4}, 1e-3);  // half a metre against 2 N
    CHECK(observer.energy() == 1);
    observer.update<S>({0, 0, 0}, {0, 0, 0}, 1e-3);  // and back along with 4 N
    CHECK(observer.energy() == -1);
    CHECK(observer.min_energy() == -1);
    CHECK(observer.energy_in() == 1);
    const S nan = std::numeric_limits<S>::quiet_NaN();
    observer.update<S>({nan, 0, 0}, {0, 0, 0}, 1e-3);
    observer.update<S>({0, 0, 0}, {0, nan, 0}, 1e-3);
    observer.update<S>({0, 0, 0}, {0, 0, 0}, static_cast<double>(nan));
    CHECK(observer.energy() == -1);
    observer.reset();
    CHECK(observer.energy() == 0);
    PassivityObserver damped(2, 0.5);
    damped.update<S>({0, 0, 0}, {0, 0, 0}, 0.25);
    damped.update<S>({0, 0, S(0.5)}, {0, 0, 0}, 0.25);
    CHECK(damped.energy() == 2 * 0.25 / 0.25 + 0.5 * 0.5);
    STATIC_REQUIRE(noexcept(damped.update(std::declval<const Vector3<S>&>(), std::declval<const Vector3<S>&>(), 0.0)));
}

TEST_CASE("what is not passive is refused, and the message says what would be", "[passivity][bad]") {
    const SampledLoop loop{
        .stiffness = 1000, .damping = 0.25, .tick = 1e-3, .negative_stiffness = 0, .off_potential = 0};
    CHECK(test::refusal([&] { require_passive(loop, bare(0.25), {.hand_damping = 0.25}); }) ==
          "passivity: with damping 0.25 N s/m and a tick of 0.001 s on bare stiffness must be at most 500 [N/m], got "
          "1000; damping needed 0.75 [N s/m], there is 0.5");
    const auto refused = [](const SampledLoop& wrong, const Dissipation& dissipation) {
        return test::refusal([&] { static_cast<void>(passivity(wrong, bare(1), dissipation)); });
    };
    CHECK(refused({.stiffness = -1}, {.hand_damping = 0}) ==
          "SampledLoop: stiffness must be finite and not negative [N/m], got -1");
    CHECK(refused({.stiffness = 1, .damping = -1}, {.hand_damping = 0}) ==
          "SampledLoop: damping must be finite and not negative [N s/m], got -1");
    CHECK(refused({.stiffness = 1, .tick = 0}, {.hand_damping = 0}) ==
          "SampledLoop: tick must be finite and positive [s], got 0");
    CHECK(refused({.stiffness = 1, .delay = infinity}, {.hand_damping = 0}) ==
          "SampledLoop: delay must be finite and not negative [s], got inf");
    CHECK(refused({.stiffness = 1, .negative_stiffness = -2}, {.hand_damping = 0}) ==
          "SampledLoop: negative_stiffness must not be negative [N/m], got -2");
    CHECK(refused({.stiffness = 1, .off_potential = -3}, {.hand_damping = 0}) ==
          "SampledLoop: off_potential must not be negative [N], got -3");
    CHECK(refused({.stiffness = 1}, {.hand_damping = -1}) ==
          "Dissipation: hand_damping must be finite and not negative [N s/m], got -1");
    CHECK(refused({.stiffness = 1}, {.hand_damping = 1, .max_speed = 0}) ==
          "Dissipation: max_speed must be positive [m/s], got 0");
}
