// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <membrane/tissue/material.hpp>

#include "support/tissue_experiments.hpp"
#include "support/tissue_strip.hpp"

// tissue FOLDER [--short]: published experiments on tissue beside the library's numbers for them, from constants that
// others published and fitted. Writes Markdown tables to tissue.md, and a .tsv for each plot, to FOLDER.

namespace {

using namespace bench::tissue;

void print(const Experiment& row, std::FILE* file) {
    std::fprintf(file, "| %s | %.4g +- %.2g %s | %.3g (%.3g to %.3g) | %+.1f |", row.name.c_str(), row.measured,
                 row.deviation, row.unit.c_str(), row.predicted, row.lowest(), row.highest(), row.score());
    if (std::isnan(row.shell)) {
        std::fprintf(file, " none |");
    } else {
        std::fprintf(file, " %.3g |", row.shell);
    }
    const auto modulus = [&](double value) { return 1e-6 * row.by_modulus.modulus_for(value); };
    const auto ends = std::minmax({modulus(row.measured - row.deviation), modulus(row.measured + row.deviation)});
    std::fprintf(file, " %+.1f %% | %.2f (%.2f to %.2f) | %s |\n", 100 * (row.coarse / row.predicted - 1),
                 modulus(row.measured), ends.first, ends.second, row.keys.c_str());
}

void print(const std::vector<Experiment>& rows, std::FILE* file) {
    std::fprintf(file,
                 "\n### Measured, and from the constants of others\n\n"
                 "| experiment | measured | from published constants | off, in deviations | shell of revolution | "
                 "half as many rings | E fitted [MPa] | measured by; constants of |\n"
                 "|---|---|---|---|---|---|---|---|\n");
    for (const Experiment& row : rows) print(row, file);
}

// The experiments on pigs, the first three, by one modulus.
void print(const membrane::Fit& fit, const std::vector<Experiment>& pigs, std::FILE* file) {
    std::fprintf(
        file,
        "\n### One modulus for the pig\n\n`fit`: E = %.3f MPa, 95 %% interval %.3f to %.3f, misfit %.2f deviations%s. ",
        1e-6 * fit.constants[0], 1e-6 * fit.intervals[0].lower, 1e-6 * fit.intervals[0].upper, fit.misfit,
        fit.converged ? "" : ", not converged");
    std::fprintf(file,
                 "Published: 0.188 MPa [Munoz21].\n\n| experiment | measured | fitted | off, in deviations "
                 "|\n|---|---|---|---|\n");
    for (const Experiment& row : pigs) {
        const double value = row.by_modulus(fit.constants[0]);
        std::fprintf(file, "| %s | %.4g +- %.2g %s | %.3g | %+.1f |\n", row.name.c_str(), row.measured, row.deviation,
                     row.unit.c_str(), value, (value - row.measured) / row.deviation);
    }
}

// A bag of two discs, as a stiffness per diameter [mN/mm].
double bag(double modulus, double front) {
    return bag_stiffness({.young_modulus = modulus, .poisson_ratio = 0.47, .thickness = front}, 3.5e-6) / 2;
}

// Strips of another treatment, by the curve through the two points of the fresh ones.
void print_strips(std::FILE* file) {
    const auto [modulus, stiffening] = strip_through(fresh_amnion);
    const membrane::Fit fit = fitted_strip();
    std::fprintf(
        file,
        "\n### Amnion in tension\n\nThe exponential spring through the two points of fresh strips: %.2f MPa at "
        "rest, stiffening %.1f. `fit` of all four points: %.2f MPa (%.2f to %.2f), %.1f (%.1f to %.1f), misfit %.1f "
        "deviations.\n\n| acellular strips, stress at a strain of | measured | from fresh strips | off, in "
        "deviations | fitted |\n|---|---|---|---|---|\n",
        modulus, stiffening, fit.constants[0], fit.intervals[0].lower, fit.intervals[0].upper, fit.constants[1],
        fit.intervals[1].lower, fit.intervals[1].upper, fit.misfit);
    for (const StripPoint& point : acellular_amnion) {
        const double predicted = strip_stress(modulus, stiffening, point.strain);
        std::fprintf(file, "| %.1f %% | %.3f +- %.3f MPa | %.3f | %+.1f | %.3f |\n", 100 * point.strain, point.stress,
                     point.deviation, predicted, (predicted - point.stress) / point.deviation,
                     strip_stress(fit.constants[0], fit.constants[1], point.strain));
    }
}

// What has no mean with a deviation, and what the model misses.
void print_others(const Experiment& rises, std::FILE* file) {
    const auto row = [&](const char* name, const std::string& measured, const std::string& model, const char* keys) {
        std::fprintf(file, "| %s | %s | %s | %s |\n", name, measured.c_str(), model.c_str(), keys);
    };
    const auto number = [](const char* format, auto... values) {
        char text[200];
        std::snprintf(text, sizeof text, format, values...);
        return std::string(text);
    };
    std::fprintf(file,
                 "\n### Ranges, ratios and failures\n\n| experiment | measured | model | measured by; constants of "
                 "|\n|---|---|---|---|\n");
    row("empty human lens bag, pulled at its rim [mN/mm of diameter]", "25 to 343",
        number("%.0f (%.0f to %.0f)", bag(3e6, 13e-6), bag(1.5e6, 11e-6), bag(6e6, 15e-6)),
        "[Ziebarth08]; [Fisher69] [Barraquer06]");
    const ByModulus& linked = rises.by_modulus;
    row("cross-linked over untreated pig cornea, modulus", "1.43 +- 0.24, from 307 +- 65 and 437 +- 63 um",
        number("%.2f", linked.modulus_for(307) / linked.modulus_for(437)), "[Chang20]");
    const double thin = tonometer_reading(0.47e-3), usual = tonometer_reading(0.52e-3),
                 thick = tonometer_reading(0.57e-3);
    row("tonometer on a human cornea of 0.52 mm at 16 mmHg [mmHg]", "16", number("%.0f", usual), "[Ehlers75]; [Pye20]");
    row("its change by 10 um of thickness [mmHg]", "0.28 (0.23 to 0.36); 0.71 with a manometer",
        number("%.2f", (thick - thin) / 10), "[Eballe10], [Ehlers75]; [Pye20]");
    const Eye button = human_cornea.with(&Eye::thickness, 0.535e-3);
    const auto found = inflated(button, {10, 20, 30}, 12);
    row("human cornea, rise by 1 mmHg from 10 to 30 mmHg [um]", "0.49 to 0.59",
        number("%.0f", 1e6 * (found[2].rise - found[0].rise) / 20), "[Kling20]; [Pye20] [Eballe10] [Kadhim16]");
    row("retina of cattle, tension per strain [N/m]", "2",
        number("%.1f to %.1f, of the pig", 5.5e3 * 0.277e-3, 5.5e3 * 0.326e-3), "[Jones92]; [Milan25] [Macula21]");
}

// Columns of numbers.
void write(const std::filesystem::path& path, const std::string& names,
           const std::vector<std::vector<double>>& columns) {
    std::ofstream file(path);
    file.precision(6);
    file << names << '\n';
    for (std::size_t i = 0; i < columns[0].size(); ++i) {
        for (std::size_t c = 0; c < columns.size(); ++c) file << (c > 0 ? "\t" : "") << columns[c][i];
        file << '\n';
    }
}

// A curve with the lowest and the highest of its variants at each load.
struct Band {
    std::vector<double> curve, low, high;

    void add(const std::vector<double>& other) {
        if (curve.empty()) curve = low = high = other;
        for (std::size_t i = 0; i < curve.size(); ++i) {
            low[i] = (std::min)(low[i], other[i]);
            high[i] = (std::max)(high[i], other[i]);
        }
    }
};

const std::vector<double> pressures{2.5, 5, 10, 15, 20, 25, 27.25, 30};  // [mmHg]

// Rise [um] and thinning [%] over the pressure.
void write_inflation(const std::filesystem::path& path, const Eye& eye, const std::vector<Eye>& variants, int rings) {
    Band rises, thins;
    const auto add = [&](const Eye& changed) {
        std::vector<double> up, thinner;
        const auto found = inflated(changed, pressures, rings);
        for (const Middle& middle : found) {
            up.push_back(1e6 * middle.rise);
            thinner.push_back(-100 * thickness_strain(found[1].stretch, middle.stretch, eye.poisson_ratio));
        }
        rises.add(up);
        thins.add(thinner);
        if (changed.clamped && changed.young_modulus == pig_cornea.young_modulus) {  // zero at 5 mmHg
            for (double& value : up) value -= 1e6 * found[1].rise;
            rises.add(up);
        }
    };
    add(eye);
    for (const Eye& variant : variants) add(variant);
    write(path, "pressure\trise\tlow\thigh\tthinning\tlow\thigh",
          {pressures, rises.curve, rises.low, rises.high, thins.curve, thins.low, thins.high});
}

void write_punch(const std::filesystem::path& path, int rings) {
    Band forces;
    std::vector<double> depths{0};
    for (const double depth : punch_depths) depths.push_back(1e3 * depth);
    const auto add = [&](const Eye& eye) {
        std::vector<double> found{0};
        for (const double force : punch_forces(eye, 15 * mmhg, punch_depths, rings)) found.push_back(1e3 * force);
        forces.add(found);
    };
    add(pig_sclera);
    for (const Eye& variant : pig_sclera_variants()) add(variant);
    write(path, "depth\tforce\tlow\thigh", {depths, forces.curve, forces.low, forces.high});
}

// All over the measured value; the last column by the modulus fitted to the pigs, NaN for others.
void write_ratios(const std::filesystem::path& path, const std::vector<Experiment>& rows, std::size_t pigs,
                  double fitted) {
    std::vector<std::vector<double>> columns(6);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const Experiment& row = rows[i];
        const double values[]{row.predicted,
                              row.lowest(),
                              row.highest(),
                              row.measured - row.deviation,
                              row.measured + row.deviation,
                              i < pigs ? row.by_modulus(fitted) : std::numeric_limits<double>::quiet_NaN()};
        for (std::size_t c = 0; c < columns.size(); ++c) columns[c].push_back(values[c] / row.measured);
    }
    write(path, "predicted\tlow\thigh\tmeasured_low\tmeasured_high\tfitted", columns);
}

void write_strips(const std::filesystem::path& path) {
    const auto [modulus, stiffening] = strip_through(fresh_amnion);
    std::vector<std::vector<double>> columns(2);
    for (int i = 0; i <= 36; ++i) {
        columns[0].push_back(i);
        columns[1].push_back(strip_stress(modulus, stiffening, 0.01 * i));
    }
    write(path, "strain\tstress", columns);
}

void write_bags(const std::filesystem::path& path) {
    std::vector<std::vector<double>> columns(4);
    for (const double modulus : {1.5, 3.0, 6.0}) {
        const double values[]{modulus, bag(1e6 * modulus, 13e-6), bag(1e6 * modulus, 11e-6), bag(1e6 * modulus, 15e-6)};
        for (std::size_t c = 0; c < columns.size(); ++c) columns[c].push_back(values[c]);
    }
    write(path, "modulus\tstiffness\tlow\thigh", columns);
}

void run(const std::filesystem::path& folder, int rings) {
    const std::vector<Experiment> rows{
        pig_cornea_rises(rings),
        cornea_thins("pig", pig_cornea, 6.42, 1.50, pig_cornea_variants(), "[Munoz21] [Sanchez11] [Menduni18]", rings),
        pig_sclera_pressed(rings),
        cornea_thins("human", human_cornea, 2.85, 0.09, human_cornea_variants(), "[Pye20] [Atchison05] [Rufer05]",
                     rings)};
    for (const Experiment& row : rows) {
        if (std::abs(row.table_error()) > 0.01)
            throw std::runtime_error("the table by moduli is too coarse: " + row.name);
    }
    const std::vector<Experiment> pigs(rows.begin(), rows.end() - 1);
    const membrane::Fit fit = one_modulus(pigs);
    std::FILE* page = std::fopen((folder / "tissue.md").c_str(), "w");
    if (page == nullptr) throw std::runtime_error("cannot write " + (folder / "tissue.md").string());
    print(rows, page);
    print(fit, pigs, page);
    print_strips(page);
    print_others(rows[0], page);
    std::fclose(page);
    write_ratios(folder / "tissue_ratios.tsv", rows, pigs.size(), fit.constants[0]);
    write_inflation(folder / "tissue_pig.tsv", pig_cornea, pig_cornea_variants(), rings / 2);
    write_inflation(folder / "tissue_human.tsv", human_cornea, human_cornea_variants(), rings / 2);
    write_punch(folder / "tissue_punch.tsv", rings);
    write_strips(folder / "tissue_strips.tsv");
    write_bags(folder / "tissue_bags.tsv");
}

}  // namespace

int main(int argc, char** argv) {
    try {
        if (argc < 2) throw std::runtime_error("tissue FOLDER [--short]");
        const std::filesystem::path folder = argv[1];
        std::filesystem::create_directories(folder);
        run(folder, argc > 2 && std::strcmp(argv[2], "--short") == 0 ? 8 : 16);
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "tissue: %s\n", error.what());
        return 2;
    }
}
