// SPDX-License-Identifier: MIT
#pragma once

/// Headers of the haptic loop, in the order of the data flow. Scripts, the explicit Euler method, threads and error
/// measures are included separately.

// clang-format off
#include <membrane/core/types.hpp>
#include <membrane/core/check.hpp>
#include <membrane/core/executor.hpp>
#include <membrane/core/field.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/core/version.hpp>

#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/surface/reordered.hpp>
#include <membrane/surface/normals.hpp>

#include <membrane/model/spring_law.hpp>
#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/volume_springs.hpp>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/contact/grasper.hpp>

#include <membrane/solve/propagation_queue.hpp>
#include <membrane/solve/step_rule.hpp>
#include <membrane/solve/constraints.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/solve/quasi_static.hpp>

#include <membrane/haptics/force_policy.hpp>
#include <membrane/haptics/device.hpp>
// clang-format on

/// The whole library. The namespaces `detail` in it are not for its users, and change without notice.
namespace membrane {}

#if defined(MEMBRANE_INSTANTIATED)
#include <membrane/instantiated.hpp>
#endif
