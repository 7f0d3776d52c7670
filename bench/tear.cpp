// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/peel_strip.hpp"
#include "support/tear_shear.hpp"
#include "support/tear_speed.hpp"
#include "support/torn_centre.hpp"
#include "support/trousers.hpp"

// tear FOLDER [--short] [PART...]: tears beside closed forms, over meshes and directions of their grids, and what they
// cost. Writes Markdown tables to tear.md, and a .tsv for each plot, to FOLDER.

namespace {

using namespace bench::tears;

/// A line of the summary: what was found, and the bar for it; NaN if it has none.
struct Check {
    std::string name;
    double found, bar;
    const char* unit;
};

/// The tables, on the page and on the terminal.
class Page {
  public:
    explicit Page(const std::filesystem::path& folder)
        : folder_(folder), file_(std::fopen((folder / "tear.md").c_str(), "w")) {
        if (file_ == nullptr) throw std::runtime_error("cannot write to " + folder.string());
    }
    Page(const Page&) = delete;
    Page& operator=(const Page&) = delete;
    ~Page() { std::fclose(file_); }

    template <class... Values>
    void print(const char* format, const Values&... values) {
        for (std::FILE* file : {stdout, file_}) {
            if constexpr (sizeof...(values) == 0) {
                std::fputs(format, file);
            } else {
                std::fprintf(file, format, values...);
            }
            std::fflush(file);
        }
    }
    void add(const Check& check) { checks_.push_back(check); }
    void summarise() {
        print("\n| | found | bar |\n|---|---|---|\n");
        for (const Check& check : checks_) {
            if (std::isnan(check.bar)) {
                print("| %s | %.3g %s | none |\n", check.name.c_str(), check.found, check.unit);
                continue;
            }
            const char* const mark = check.found <= check.bar ? "" : "**";
            print("| %s | %s%.2g %s%s | %g %s |\n", check.name.c_str(), mark, check.found, check.unit, mark, check.bar,
                  check.unit);
        }
    }
    /// A table for a plot.
    [[nodiscard]] std::ofstream table(const std::string& name, const std::string& columns) const {
        std::ofstream file(folder_ / ("tear_" + name + ".tsv"));
        file.precision(6);
        file << columns << '\n';
        return file;
    }

  private:
    std::filesystem::path folder_;
    std::FILE* file_;
    std::vector<Check> checks_;
};

/// How much is run.
struct Effort {
    std::vector<int> rows;    ///< edges over the height of a strip
    std::vector<int> widths;  ///< of a leg [edges]
    int directions;           ///< of grids
    double edges;             ///< of advance
    int ticks;                ///< for times
};

constexpr double none = std::numeric_limits<double>::quiet_NaN();
double percent(double ratio) { return 100 * std::abs(ratio - 1); }

// A strip whose ends are far from the tear, on a grid that is turned so that no edge is along it.
Strip long_strip(int rows, double edges) {
    const int notch = rows * 6 / 10;
    return strip_of(rows, 2 * notch + static_cast<int>(edges) + 4, notch, 17 * degree);
}

void shear(Page& page, const Effort& effort) {
    page.print(
        "\n### A strip in pure shear\n\n| edges over the height | vertices | driving force over the closed form, three "
        "notches | begins at, over the right stretch | off the line [edges] | energy the tear took, over toughness x "
        "area | energy that steps take, of that given |\n|---|---|---|---|---|---|---|\n");
    double force = 0, begins = 0, off = 0, relaxed = 0, lost = 0;
    for (const int rows : effort.rows) {
        page.print("| %d | ", rows);
        std::string forces;
        for (const int tenths : {6, 8, 10}) {
            const double found = driving_force(strip_of(rows, 2 * rows, rows * tenths / 10));
            force = std::max(force, percent(found));
            char text[20];
            std::snprintf(text, sizeof text, "%s%.3f", forces.empty() ? "" : ", ", found);
            forces += text;
        }
        const ShearRun found = run(long_strip(rows, effort.edges), effort.edges);
        begins = std::max(begins, percent(found.begins));
        off = std::max(off, found.off_line);
        relaxed = std::max(relaxed, 100 * found.relaxed / found.given);
        lost = std::max(lost, std::abs(found.lost) / found.given * 100);
        page.print("%d | %s | %.4f | %.2f | %.3f | %.1f %% |\n", int{found.vertices}, forces.c_str(), found.begins,
                   found.off_line, found.dissipated / (resistance * found.torn), 100 * found.relaxed / found.given);
    }
    page.add({"pure shear: driving force, from the closed form", force, 5, "%"});
    page.add({"pure shear: stretch at which it begins, from the right one", begins, 3, "%"});
    page.add({"pure shear: distance from a straight line", off, 0.7, "edges"});
    page.add({"pure shear: energy that steps take, of that given", relaxed, none, "%"});
    page.add({"pure shear: energy in no account", lost, 1, "%"});
}

// In a viscous fluid jumps take several ticks, and its drag takes their energy. Ticks resolve how an edge opens if drag
// / dt is above the stiffness of the membrane at a vertex, young_modulus x thickness whatever the mesh.
void fluid(Page& page, const Effort& effort) {
    page.print(
        "\n### In a viscous fluid\n\n| | taken by the tear, of the energy given | by the drag | by the steps "
        "|\n|---|---|---|---|\n");
    double lost = 0;
    const auto add = [&](const std::string& scene, double torn, double damped, double relaxed, double missing) {
        page.print("| %s | %.1f %% | %.1f %% | %.2f %% |\n", scene.c_str(), 100 * torn, 100 * damped, 100 * relaxed);
        lost = std::max(lost, 100 * std::abs(missing));
        return 100 * std::abs(relaxed);
    };
    double relaxed = 0;
    for (const int rows : effort.rows) {
        Strip strip = long_strip(rows, effort.edges / 2);
        strip.drag = test::drag_of_stiffness(1.5);
        const ShearRun found = run(strip, effort.edges / 2);
        relaxed =
            std::max(relaxed, add("pure shear, " + std::to_string(rows) + " edges high", found.dissipated / found.given,
                                  found.damped / found.given, found.relaxed / found.given, found.lost / found.given));
    }
    page.add({"in a fluid, pure shear: energy that steps take, of that given", relaxed, 1, "%"});

    struct Legs {
        double strain, ticks;  // for an edge
    };
    double force = 0;
    relaxed = 0;
    for (const auto& [strain, ticks] : {Legs{0.02, 8000}, Legs{0.05, 4000}, Legs{0.1, 2000}}) {
        const auto found = test::tear_trousers<double>(
            {.width = 4, .turn = 20 * degree, .strain = strain, .relative_drag = 1.5, .steps = 1},
            std::max(4.0, 0.3 * effort.edges), 1 / ticks);
        char legs[80];
        std::snprintf(legs, sizeof legs, "trousers whose legs stretch by %.0f %%, force %.2f to %.2f", 100 * strain,
                      found.low, found.high);
        relaxed = std::max(relaxed, add(legs, found.torn, found.damped, found.relaxed, found.lost));
        force = std::max(force, percent(found.mean));
    }
    page.add({"in a fluid, trousers: energy that steps take, of what the hands give", relaxed, 1, "%"});
    page.add({"in a fluid, trousers: mean force, with the drag, from the closed form", force, 5, "%"});

    const auto cut =
        test::tear_from_centre<double>({.rows = 30, .turn = 15 * degree, .relative_drag = 5}, effort.edges / 5);
    relaxed = add("cut in a sheet", cut.torn, cut.damped, cut.relaxed, cut.lost);
    page.add({"in a fluid, cut in a sheet: energy that steps take, of what it releases", relaxed, 1, "%"});
    page.add({"in a fluid: energy in no account", lost, 1, "%"});
}

void grids(Page& page, const Effort& effort) {
    page.print(
        "\n### Grids of %d directions, 0 to 60 degrees\n\n| edges over the height | off the line [edges]: mean | "
        "largest | at [degrees] | begins at, over the right stretch |\n|---|---|---|---|---|\n",
        effort.directions);
    auto paths = page.table("paths", "rows\tturn\tx\ty");
    auto distances = page.table("grids", "rows\tturn\toff\tbegins");
    double worst = 0, late = 0, along_edges = 0;
    for (const int rows : effort.rows) {
        double sum = 0, largest = 0, at = 0, least = 2, most = 0;
        for (int i = 0; i < effort.directions; ++i) {
            Strip strip = long_strip(rows, effort.edges);
            const double turn = 60.0 * i / (effort.directions - 1);
            strip.turn = turn * degree;
            const ShearRun found = run(strip, effort.edges);
            sum += found.off_line;
            if (found.off_line > largest) largest = found.off_line, at = turn;
            least = std::min(least, found.begins), most = std::max(most, found.begins);
            if (rows == effort.rows[1]) {
                strip.tear.move_vertices = false;
                along_edges = std::max(along_edges, run(strip, effort.edges).off_line);
            }
            distances << rows << '\t' << turn << '\t' << found.off_line << '\t' << found.begins << '\n';
            for (const auto& [x, y] : found.path) paths << rows << '\t' << turn << '\t' << x << '\t' << y << '\n';
            paths << "\n\n";
        }
        page.print("| %d | %.2f | %.2f | %.0f | %.3f to %.3f |\n", rows, sum / effort.directions, largest, at, least,
                   most);
        worst = std::max(worst, largest);
        late = std::max({late, percent(least), percent(most)});
    }
    page.add({"turned grids: distance from a straight line", worst, 0.7, "edges"});
    page.add({"the same along the edges that the grid has, without moved vertices", along_edges, none, "edges"});
    page.add({"turned grids: stretch at which it begins, from the right one", late, 3, "%"});
}

// The strength is that which opens the notch at the critical stretch on the middle mesh.
void criteria(Page& page, const Effort& effort) {
    page.print(
        "\n### Energy and stress\n\n| edge [mm] | force per length at which it begins [N/m], by `EnergyRelease` | by "
        "`LargestTension` |\n|---|---|---|\n");
    std::vector<double> stretches;
    for (int i = 0; i <= 12; ++i) stretches.push_back(1.1 + 0.03 * i);
    std::vector<std::vector<AtStretch>> states;
    for (const int rows : effort.rows) {
        states.push_back(loaded(strip_of(rows, 2 * rows, rows * 6 / 10, 17 * degree), stretches));
    }
    const auto released = [](const AtStretch& state) { return state.driving_force; };
    const auto tension = [](const AtStretch& state) { return state.tension; };
    const auto force = [](const AtStretch& state) { return state.force; };
    const auto& middle = states[states.size() / 2];
    const double usual = value_where(middle, released, force, resistance);
    const double strength = value_where(middle, force, tension, usual);
    auto plot = page.table("criteria", "edge\tenergy\ttension");
    std::vector<double> by_energy, by_tension;
    for (std::size_t i = 0; i < states.size(); ++i) {
        by_energy.push_back(value_where(states[i], released, force, resistance));
        by_tension.push_back(value_where(states[i], tension, force, strength));
        const double edge = 20.0 / effort.rows[i];
        page.print("| %g | %.3f | %.3f |\n", edge, by_energy.back(), by_tension.back());
        plot << edge << '\t' << by_energy.back() << '\t' << by_tension.back() << '\n';
    }
    const auto spread = [](const std::vector<double>& values) {
        const auto [least, most] = std::minmax_element(values.begin(), values.end());
        return percent(*most / *least);
    };
    page.add({"force at which it begins, over the meshes: `EnergyRelease`", spread(by_energy), 5, "%"});
    page.add({"the same: `LargestTension`", spread(by_tension), none, "%"});
}

// Legs that stretch more take up the peaks of the force.
void trouser_test(Page& page, const Effort& effort) {
    page.print(
        "\n### Trousers\n\n| strain of the legs | edges over the width of a leg | directions | force over the closed "
        "form: mean | least and largest mean of a grid | least and largest of any tick | energy that steps take "
        "| off the line [edges] |\n|---|---|---|---|---|---|---|---|\n");
    auto curves = page.table("trousers", "width\tturn\tdrawn\tforce");
    auto means = page.table("trouser_means", "width\tturn\tmean\tlow\thigh");
    for (const double strain : {0.02, 0.05, 0.1}) {
        const bool stiff = strain == 0.02;
        const int directions = stiff ? effort.directions : std::min(effort.directions, 5);
        double all = 0, bottom = 10, top = 0, largest_relaxed = 0, largest_lost = 0;
        for (const int width : effort.widths) {
            double sum = 0, relaxed = 0, off = 0, least = 10, largest = 0, low = 10, high = 0;
            for (int i = 0; i < directions; ++i) {
                const double turn = 60.0 * i / (directions - 1);
                const auto found = test::tear_trousers<double>(
                    {.width = width, .turn = turn * degree, .strain = strain, .steps = 20}, effort.edges);
                sum += found.mean / directions, relaxed += found.relaxed / directions;
                largest_lost = std::max(largest_lost, std::abs(found.lost));
                off = std::max(off, found.off_line);
                least = std::min(least, found.mean), largest = std::max(largest, found.mean);
                low = std::min(low, found.low), high = std::max(high, found.high);
                if (!stiff) continue;
                means << width << '\t' << turn << '\t' << found.mean << '\t' << found.low << '\t' << found.high << '\n';
                for (std::size_t k = 0; k < found.curve.size(); k += 4) {
                    const auto& [drawn, force] = found.curve[k];
                    curves << width << '\t' << turn << '\t' << drawn << '\t' << force << '\n';
                }
                curves << "\n\n";
            }
            page.print("| %.0f %% | %d | %d | %.3f | %.3f to %.3f | %.2f to %.2f | %.0f %% | %.2f |\n", 100 * strain,
                       width, directions, sum, least, largest, low, high, 100 * relaxed, off);
            largest_relaxed = std::max(largest_relaxed, relaxed);
            all += sum / static_cast<double>(effort.widths.size());
            bottom = std::min(bottom, least), top = std::max(top, largest);
        }
        char legs[60];
        std::snprintf(legs, sizeof legs, "trousers whose legs stretch by %.0f %%: ", 100 * strain);
        page.add({legs + std::string("mean force, from the closed form"), percent(all), 5, "%"});
        page.add({legs + std::string("spread of all meshes and grids"), 100 * (top - bottom) / all, 10, "%"});
        page.add({legs + std::string("energy that steps take, of that given"), 100 * largest_relaxed, 1, "%"});
        page.add({legs + std::string("energy in no account"), 100 * largest_lost, 1, "%"});
    }
}

void centre(Page& page, const Effort& effort) {
    page.print(
        "\n### A cut in a sheet stretched in both directions\n\n| edges along a side | directions | driving force, "
        "from the cut [degrees] | of both ends, difference | off the line while it tears [edges] | difference of the "
        "advances [edges] |\n|---|---|---|---|---|---|\n");
    double angle = 0, unlike = 0, off = 0, lost = 0;
    for (const int rows : effort.rows) {
        test::CentreRun worst;
        double longer = 0;
        for (const double turn : {0.0, 15.0, 30.0, 45.0}) {
            const auto found =
                test::tear_from_centre<double>({.rows = rows * 3 / 2, .turn = turn * degree}, effort.edges / 5);
            worst.angle = std::max(worst.angle, found.angle);
            worst.unlike = std::max(worst.unlike, found.unlike);
            worst.off_line = std::max(worst.off_line, found.off_line);
            lost = std::max(lost, std::abs(found.lost));
            longer = std::max(longer, std::abs(found.advances[0] - found.advances[1]));
        }
        page.print("| %d | 4 | %.2f | %.1f %% | %.2f | %.1f |\n", rows * 3 / 2, worst.angle / degree,
                   100 * worst.unlike, worst.off_line, longer);
        angle = std::max(angle, worst.angle / degree), unlike = std::max(unlike, worst.unlike);
        off = std::max(off, worst.off_line);
    }
    page.add({"cut in a sheet: driving force, from the cut", angle, 3, "degrees"});
    page.add({"cut in a sheet: driving forces of both ends, difference", 100 * unlike, 5, "%"});
    page.add({"cut in a sheet: distance from a straight line", off, 0.7, "edges"});
    page.add({"cut in a sheet: energy in no account, of that released", 100 * lost, 1, "%"});
}

void peel(Page& page, const Effort&) {
    page.print(
        "\n### Peel at 90 degrees\n\n| edge [um] | energy per area by the force, over that of adhesion | stored and "
        "taken, over given |\n|---|---|---|\n");
    double force = 0, lost = 0;
    for (const double edge : {12e-6, 8e-6, 6e-6}) {
        test::PeelStrip<double> strip(edge);
        const double found = strip.peel() / strip.energy;
        const double balance = (strip.stored() + strip.adhesion.dissipated()) / strip.work;
        page.print("| %g | %.3f | %.3f |\n", 1e6 * edge, found, balance);
        force = std::max(force, percent(found)), lost = std::max(lost, percent(balance));
    }
    page.add({"peel: force, from the closed form", force, 2, "%"});
    page.add({"peel: energy that nothing has taken, of that given", lost, 1, "%"});
}

// Under a hand that takes hold anew, vertices behind it relax for some time, whether the membrane tears or not.
void speed(Page& page, const Effort& effort) {
    const auto costs = cost_of_ticks(effort.ticks);
    page.print(
        "\n### Cost of a tick, 10,267 vertices\n\n| | time of a tick | one tick of 20 is slower than | vertex updates "
        "| "
        "torn [edges] |\n|---|---|---|---|---|\n");
    for (const TickCost& cost : costs) {
        page.print("| %s | %.0f us | %.0f us | %.0f | %.1f |\n", cost.name.c_str(), 1e6 * cost.seconds, 1e6 * cost.slow,
                   cost.vertex_updates, cost.torn / DrawnDisc::edge);
    }
    const auto of = [&](Disc disc) -> const TickCost& { return costs[static_cast<std::size_t>(disc)]; };
    const auto over = [&](Disc disc, Disc other) { return of(disc).seconds / of(other).seconds; };
    const auto beside = [&](Disc disc) { return percent(of(disc).torn / of(Disc::all).torn); };
    page.add({"a tick while a tear with one tip runs, over one of the whole membrane under the same hand",
              over(Disc::one_tip_runs, Disc::whole_as_one), 1.5, ""});
    page.add({"the same with two tips", over(Disc::two_tips_run, Disc::whole_as_two), 1.5, ""});
    page.add({"the same with " + bounded_updates(), over(Disc::bounded, Disc::whole_as_two), 1.5, ""});
    page.add({"a tick while a tear with two tips runs, over one of the whole membrane under a hand that stays",
              over(Disc::two_tips_run, Disc::hand_stays), none, ""});
    page.add({"length of that tear, from the one with all layers and 8 sweeps", beside(Disc::two_tips_run), none, "%"});
    page.add({"the same with " + bounded_updates(), beside(Disc::bounded), none, "%"});
}

struct Part {
    const char* name;
    void (*run)(Page&, const Effort&);
};
constexpr Part parts[]{{"shear", shear},   {"fluid", fluid},       {"grids", grids}, {"trousers", trouser_test},
                       {"centre", centre}, {"criteria", criteria}, {"peel", peel},   {"speed", speed}};

}  // namespace

int main(int argc, char** argv) {
    try {
        if (argc < 2) throw std::runtime_error("tear FOLDER [--short] [PART...]");
        Effort effort{.rows = {10, 20, 40}, .widths = {4, 6, 8}, .directions = 20, .edges = 20, .ticks = 1200};
        std::vector<std::string> names;
        for (int i = 2; i < argc; ++i) {
            if (std::strcmp(argv[i], "--short") == 0) {
                effort = {.rows = {10, 14}, .widths = {4}, .directions = 3, .edges = 6, .ticks = 200};
            } else {
                names.emplace_back(argv[i]);
            }
        }
        for (const std::string& name : names) {
            if (std::none_of(std::begin(parts), std::end(parts), [&](const Part& part) { return name == part.name; })) {
                throw std::runtime_error("there is no part " + name);
            }
        }
        std::filesystem::create_directories(argv[1]);
        Page page(argv[1]);
        for (const Part& part : parts) {
            if (names.empty() || std::find(names.begin(), names.end(), part.name) != names.end()) {
                part.run(page, effort);
            }
        }
        page.summarise();
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "tear: %s\n", error.what());
        return 2;
    }
}
