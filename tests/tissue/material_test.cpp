// SPDX-License-Identifier: MIT
#include <membrane/tissue/material.hpp>

#include <cmath>
#include <limits>
#include <string>

#include <Eigen/Dense>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;

namespace {

/// Normal strains for normal stresses, Hooke's law in three dimensions.
Eigen::Matrix3d compliance(double young_modulus, double poisson_ratio) {
    Eigen::Matrix3d result = Eigen::Matrix3d::Constant(-poisson_ratio);
    result.diagonal().setOnes();
    return result / young_modulus;
}

}  // namespace

TEST_CASE("moduli are those of Hooke's law", "[material]") {
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double modulus = std::pow(10, random.number(2.0, 7.0)),
                     thickness = std::pow(10, random.number(-6.0, -2.0));
        const double nu = random.number(0.0, 0.49);
        const Eigen::Matrix3d soft = compliance(modulus, nu);

        // A layer on ground that does not yield is pressed without moving aside.
        const Eigen::Vector3d pressed = soft.inverse() * Eigen::Vector3d(0, 0, 1 / thickness);
        const FoundationLayer layer{.young_modulus = modulus, .poisson_ratio = nu, .thickness = thickness};
        REQUIRE(layer.normal_stiffness() == Approx(pressed.z()));
        // Sheared by one length for each length of height: the same as stretched and pressed by half of that at 45
        // degrees.
        const Eigen::Vector3d sheared = soft.inverse() * Eigen::Vector3d(0.5, -0.5, 0);
        REQUIRE(layer.tangential_stiffness() == Approx(sheared.x() / thickness));

        // A sheet without stress across.
        const Eigen::Vector3d stretched = soft * Eigen::Vector3d(1, 1, 0);
        const Material sheet{.young_modulus = modulus, .poisson_ratio = nu, .thickness = thickness};
        REQUIRE(sheet.biaxial_stiffness() == Approx(thickness / stretched.x()));
    }
}

TEST_CASE("tissues are materials, typical ones within the range", "[material]") {
    for (const MaterialRange& tissue : {materials::cornea(), materials::lens_capsule(), materials::retina()}) {
        for (const Material& material : {tissue.typical, tissue.lower, tissue.upper}) {
            CHECK(test::refusal([&] { material.validate(); }) == "");
        }
        CHECK((tissue.lower.young_modulus < tissue.typical.young_modulus));
        CHECK((tissue.typical.young_modulus < tissue.upper.young_modulus));
        CHECK((tissue.lower.thickness < tissue.typical.thickness && tissue.typical.thickness < tissue.upper.thickness));
    }
    // [Fisher69] gives dyn/cm^2.
    CHECK(materials::lens_capsule().upper.young_modulus == Approx(6e7 * 1e-5 / 1e-4));
    // [Jones92] gives the tension of the sheet per strain.
    const Material retina = materials::retina().typical;
    CHECK(retina.young_modulus * retina.thickness == Approx(2).epsilon(0.05));
    const auto has_ratio = [](const MaterialRange& tissue, double ratio) {
        return tissue.typical.poisson_ratio == ratio && tissue.lower.poisson_ratio == ratio &&
               tissue.upper.poisson_ratio == ratio;
    };
    CHECK(has_ratio(materials::cornea(), 0.49));
    CHECK(has_ratio(materials::lens_capsule(), 0.47));
    CHECK(has_ratio(materials::retina(), 0.49));
}

TEST_CASE("materials and foundations that make no sense are refused by name", "[material][bad]") {
    const Material valid{.young_modulus = 1e5, .poisson_ratio = 0.47, .thickness = 1e-4};
    const auto refused = [&](double Material::*field, double value) {
        Material material = valid;
        material.*field = value;
        return test::refusal([&] { material.validate(); });
    };
    CHECK(refused(&Material::young_modulus, -3) == "Material: young_modulus must be finite and positive [Pa], got -3");
    CHECK(refused(&Material::poisson_ratio, 0.51) == "Material: poisson_ratio must be 0 to 0.5, got 0.51");
    CHECK(refused(&Material::poisson_ratio, 0.5) == "");
    CHECK(refused(&Material::thickness, 0) == "Material: thickness must be finite and positive [m], got 0");
    CHECK(refused(&Material::density, std::numeric_limits<double>::infinity()) ==
          "Material: density must be finite and positive [kg/m^3], got inf");

    const auto refused_layer = [&](double FoundationLayer::*field, double value) {
        FoundationLayer layer{.young_modulus = 1e3, .poisson_ratio = 0.3, .thickness = 1e-3};
        layer.*field = value;
        return test::refusal([&] { layer.validate(); });
    };
    CHECK(refused_layer(&FoundationLayer::young_modulus, 0) ==
          "Foundation: young_modulus must be finite and positive [Pa], got 0");
    CHECK(refused_layer(&FoundationLayer::poisson_ratio, 0.49) == "");
    CHECK(refused_layer(&FoundationLayer::poisson_ratio, 0.4901) ==
          "Foundation: poisson_ratio must be 0 to 0.49, got 0.4901");
    CHECK(refused_layer(&FoundationLayer::poisson_ratio, -0.1) ==
          "Foundation: poisson_ratio must be 0 to 0.49, got -0.1");
    CHECK(refused_layer(&FoundationLayer::thickness, std::numeric_limits<double>::quiet_NaN()) ==
          "Foundation: thickness must be finite and positive [m], got nan");
}
