// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/tissue_globe.hpp"
#include "support/tissue_skin.hpp"

// tissue_curves FOLDER: measured curves of tissue beside those by the library's laws, from constants that were not
// fitted to the curve, and fitted to it. Writes Markdown tables to tissue_curves.md and the numbers of a plot to
// tissue_curves.tsv.

namespace {

using namespace bench::tissue;

using Values = std::vector<double>;

/// A measured curve and the model's values at the same points.
struct Curve {
    std::string name, unit;
    Values at{}, measured{};
    Values predicted{}, low{}, high{};  ///< from the constants of others, and with those of each other set
    Values fitted{};

    void vary(const Values& other) {
        if (low.empty()) low = high = predicted;
        for (std::size_t i = 0; i < other.size(); ++i) {
            low[i] = (std::min)(low[i], other[i]);
            high[i] = (std::max)(high[i], other[i]);
        }
    }
    [[nodiscard]] double largest() const { return *std::max_element(measured.begin(), measured.end()); }
    /// Root mean square of the differences [% of the largest value].
    [[nodiscard]] double error(const Values& model) const {
        double sum = 0;
        for (std::size_t i = 0; i < at.size(); ++i) sum += std::pow(model[i] - measured[i], 2);
        return 100 * std::sqrt(sum / static_cast<double>(at.size())) / largest();
    }
    [[nodiscard]] int within() const {
        int count = 0;
        for (std::size_t i = 0; i < at.size(); ++i) count += measured[i] >= low[i] && measured[i] <= high[i] ? 1 : 0;
        return count;
    }
};

Values values_of(const SkinPath& path, std::size_t axis, const std::function<Pair(const Pair&)>& model) {
    Values found;
    for (const Biaxial& state : path.states) found.push_back(model(state.stretch)[axis]);
    return found;
}

/// The curves of the stresses across and along the fibres, from the constants of a law; the first set gives the line,
/// all give the band.
void add(std::vector<Curve>& curves, const std::string& whose, const SkinPath& path, Law law,
         const std::vector<Values>& sets, const Values& fit) {
    for (const std::size_t axis : {std::size_t{0}, std::size_t{1}}) {
        Curve curve{.name = whose + path.name + (axis == 0 ? ", stress across" : ", stress along"), .unit = "MPa"};
        for (const Biaxial& state : path.states) {
            curve.at.push_back(state.stretch[static_cast<std::size_t>(path.axis)]);
            curve.measured.push_back(state.stress[axis]);
        }
        const auto by = [&](const Values& constants) {
            return values_of(path, axis, [&](const Pair& stretch) { return law(constants, stretch); });
        };
        curve.predicted = by(sets[0]);
        for (const Values& set : sets) curve.vary(by(set));
        curve.fitted = by(fit);
        curves.push_back(curve);
    }
}

/// A pig's skin: from the published constants of the other loadings, first those of equal stretches.
std::vector<Curve> pig_curves() {
    const std::vector<SkinPath> paths = pig_skin();
    std::vector<Curve> curves;
    for (std::size_t i = 0; i < paths.size(); ++i) {
        std::vector<Values> sets;
        for (const std::size_t other : {2u, 0u, 1u, 3u, 4u}) {
            if (other != i) sets.push_back(paths[other].published);
        }
        const membrane::Fit fit = fitted(two_families, sets[0], paths[i].states);
        add(curves, "pig skin, ", paths[i], two_families, sets, fit.constants);
    }
    return curves;
}

const Values mouse_start{0.01, 30};  // E at rest [MPa], stiffening

std::vector<Biaxial> all_states(const std::vector<SkinPath>& paths, std::size_t left_out) {
    std::vector<Biaxial> states;
    for (std::size_t i = 0; i < paths.size(); ++i) {
        if (i != left_out) states.insert(states.end(), paths[i].states.begin(), paths[i].states.end());
    }
    return states;
}

std::vector<membrane::Fit> mouse_fits() {
    std::vector<membrane::Fit> fits;
    for (const SkinPath& path : mouse_skin()) fits.push_back(fitted(stiffening_skin, mouse_start, path.states));
    return fits;
}

/// Skin of mice: from constants fitted to the three other animals, together and each.
std::vector<Curve> mouse_curves(const std::vector<membrane::Fit>& fits) {
    const std::vector<SkinPath> paths = mouse_skin();
    std::vector<Curve> curves;
    for (std::size_t i = 0; i < paths.size(); ++i) {
        std::vector<Values> sets{fitted(stiffening_skin, mouse_start, all_states(paths, i)).constants};
        for (std::size_t other = 0; other < paths.size(); ++other) {
            if (other != i) sets.push_back(fits[other].constants);
        }
        add(curves, "mouse skin, ", paths[i], stiffening_skin, sets, fits[i].constants);
    }
    return curves;
}

/// A human eye by one law, with the thinnest sclera and that half way to the pole, and the ends of its area.
Curve eye_curve(const std::string& name, Law law, const Values& constants, const membrane::Fit& fit) {
    const Globe eye{globe_radius(sclera_area), mean_thickness()};
    Curve curve{.name = "human eye, 10 to 40 mmHg, " + name, .unit = "ul", .at = globe_pressures};
    for (const double pressure : globe_pressures) curve.measured.push_back(measured_growth(pressure));
    curve.predicted = growths(eye, law, constants, globe_pressures);
    for (const double thickness : {0.42e-3, 0.65e-3})
        curve.vary(growths({eye.radius, thickness}, law, constants, globe_pressures));
    for (const double area : {14.5e-4, 18.1e-4})
        curve.vary(growths({globe_radius(area), eye.thickness}, law, constants, globe_pressures));
    curve.fitted = growths(eye, stiffening_globe, fit.constants, globe_pressures);
    return curve;
}

/// From moduli of strips of sclera, [Sclera88] 2.9 +- 1.4 in front and 1.8 +- 1.1 MPa behind; and from sclera under
/// pressure.
std::vector<Curve> eye_curves(const membrane::Fit& fit) {
    const Globe eye{globe_radius(sclera_area), mean_thickness()};
    Curve strips = eye_curve("from strips", rubber, {(2.9 + 1.8) / 2}, fit);
    for (const double modulus : {2.9 + 1.4, 1.8 - 1.1})
        strips.vary(growths(eye, rubber, Values{modulus}, globe_pressures));
    return {strips, eye_curve("from sclera under pressure", springs_in_matrix, sclera_constants, fit)};
}

void print(const std::vector<Curve>& curves, std::FILE* file) {
    std::fprintf(file,
                 "\n### Measured curves\n\nDifferences: root mean square, in %% of the largest measured value.\n\n"
                 "| curve | up to | from constants not fitted to it | points within the band | fitted |\n"
                 "|---|---|---|---|---|\n");
    for (const Curve& curve : curves) {
        std::fprintf(file, "| %s | %.2g %s | %.0f %% | %d of %zu | %.1f %% |\n", curve.name.c_str(), curve.largest(),
                     curve.unit.c_str(), curve.error(curve.predicted), curve.within(), curve.at.size(),
                     curve.error(curve.fitted));
    }
}

/// One law for all five loadings of the pig's skin.
void print_laws(std::FILE* file) {
    const std::vector<SkinPath> paths = pig_skin();
    const std::vector<Biaxial> states = all_states(paths, paths.size());
    double largest = 0;
    for (const Biaxial& state : states) largest = (std::max)({largest, state.stress[0], state.stress[1]});
    std::fprintf(file,
                 "\n### Laws for skin\n\nFitted to all five loadings of the pig's skin at once; difference in %% of "
                 "the largest stress.\n\n| law | constants | difference |\n|---|---|---|\n");
    const auto row = [&](const char* name, Law law, const Values& start) {
        const membrane::Fit fit = fitted(law, start, states);
        std::fprintf(file, "| %s |", name);
        for (const double constant : fit.constants) std::fprintf(file, " %.3g", constant);
        std::fprintf(file, " | %.0f %%%s |\n", 100 * 1e-3 * fit.misfit / largest, fit.converged ? "" : ", no end");
    };
    row("`triangular_springs`: E [MPa]", linear_sheet, {1});
    row("`neo_hookean`: E [MPa]", rubber, {1});
    row("`fung`: E at rest [MPa], stiffening", stiffening_skin, {0.3, 10});
    row("`fung` and `fibres`: and k1 [MPa], k2", matrix_and_fibres, {0.3, 10, 0.2, 5});
    row("`fibres` of all directions and of one: k1, k2 of each", two_families, {10, 10, 0.2, 5});
}

void print_fits(const membrane::Fit& eye, const std::vector<membrane::Fit>& mice, std::FILE* file) {
    std::fprintf(file,
                 "\n### Constants fitted\n\n| curves | E at rest [MPa] | stiffening |\n|---|---|---|\n"
                 "| human eye | %.2f (%.2f to %.2f) | %.0f (%.0f to %.0f) |\n",
                 eye.constants[0], eye.intervals[0].lower, eye.intervals[0].upper, eye.constants[1],
                 eye.intervals[1].lower, eye.intervals[1].upper);
    const std::vector<SkinPath> paths = mouse_skin();
    for (std::size_t i = 0; i < paths.size(); ++i) {
        const membrane::Fit& fit = mice[i];
        std::fprintf(file, "| mouse skin, %s | %.4f (%.4f to %.4f) | %.0f (%.0f to %.0f) |\n", paths[i].name,
                     fit.constants[0], fit.intervals[0].lower, fit.intervals[0].upper, fit.constants[1],
                     fit.intervals[1].lower, fit.intervals[1].upper);
    }
}

/// A block for each curve, with two lines between.
void write(const std::filesystem::path& path, const std::vector<Curve>& curves) {
    std::ofstream file(path);
    for (const Curve& curve : curves) {
        file << "# " << curve.name << '\n';
        for (std::size_t i = 0; i < curve.at.size(); ++i) {
            file << curve.at[i] << '\t' << curve.measured[i] << '\t' << curve.predicted[i] << '\t' << curve.low[i]
                 << '\t' << curve.high[i] << '\t' << curve.fitted[i] << '\n';
        }
        file << "\n\n";
    }
}

void run(const std::filesystem::path& folder) {
    const membrane::Fit eye = fitted_globe({globe_radius(sclera_area), mean_thickness()});
    std::vector<Curve> curves = pig_curves();
    const std::vector<membrane::Fit> mice = mouse_fits();
    for (const Curve& curve : mouse_curves(mice)) curves.push_back(curve);
    for (const Curve& curve : eye_curves(eye)) curves.push_back(curve);
    std::FILE* page = std::fopen((folder / "tissue_curves.md").c_str(), "w");
    if (page == nullptr) throw std::runtime_error("cannot write " + (folder / "tissue_curves.md").string());
    print(curves, page);
    print_laws(page);
    print_fits(eye, mice, page);
    std::fclose(page);
    write(folder / "tissue_curves.tsv", curves);
}

}  // namespace

int main(int argc, char** argv) {
    try {
        if (argc < 2) throw std::runtime_error("tissue_curves FOLDER");
        std::filesystem::create_directories(argv[1]);
        run(argv[1]);
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "tissue_curves: %s\n", error.what());
        return 2;
    }
}
