// SPDX-License-Identifier: MIT
#pragma once

///@{
/// The version of these headers. The build files read it from here.
#define MEMBRANE_VERSION_MAJOR 0
#define MEMBRANE_VERSION_MINOR 2
#define MEMBRANE_VERSION_PATCH 0
///@}
