// SPDX-License-Identifier: MIT
#pragma once

///@{
/// The version of these headers. The build files read it from here.
#define MEMBRANE_VERSION_MAJOR 0
#define MEMBRANE_VERSION_MINOR 20
#define MEMBRANE_VERSION_PATCH 0
///@}

/// The same as one number, 600 for 0.6.0: `#if MEMBRANE_VERSION >= 700`. Of the numbers for minor and patch, each is
/// below 100.
#define MEMBRANE_VERSION (10000 * MEMBRANE_VERSION_MAJOR + 100 * MEMBRANE_VERSION_MINOR + MEMBRANE_VERSION_PATCH)
