// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/coarse/coarse_correction.hpp>

#include "types.hpp"

/// The coarse correction, which follows a tear as other parts do.
namespace membrane_python {

/// With its network, whose law may be one of Python, and the report of its last correction.
struct Coarse {
    membrane::CoarseCorrection<double> coarse;
    const Network* network;  // lives as long
    Index vertex_count;
    SurfaceVersion version;
    membrane::CoarseReport<double> report = {};
};

template <>
inline constexpr bool is_in_loop<Coarse> = true;
template <>
inline constexpr bool is_in_loop<membrane::CoarseReport<double>> = true;

}  // namespace membrane_python
