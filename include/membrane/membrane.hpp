// SPDX-License-Identifier: MIT
#pragma once

// What the loop needs, in the order of the data flow. Scripts, the explicit Euler method, threads and what tells how
// accurate a step is are included by their own names.
//
// clang-format off
#include <membrane/core/types.hpp>
#include <membrane/core/check.hpp>
#include <membrane/core/executor.hpp>
#include <membrane/core/field.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/core/version.hpp>

#include <membrane/mesh/triangle.hpp>
#include <membrane/mesh/triangle_mesh.hpp>
#include <membrane/mesh/adjacency.hpp>
#include <membrane/mesh/shapes.hpp>
#include <membrane/mesh/reordered.hpp>
#include <membrane/mesh/normals.hpp>

#include <membrane/network/spring_law.hpp>
#include <membrane/network/mass_spring_network.hpp>
#include <membrane/network/volume_springs.hpp>

#include <membrane/collision/aabb_tree.hpp>
#include <membrane/collision/tool.hpp>
#include <membrane/collision/contact_tracker.hpp>
#include <membrane/collision/grasper.hpp>

#include <membrane/solve/propagation_queue.hpp>
#include <membrane/solve/step_rule.hpp>
#include <membrane/solve/constraints.hpp>
#include <membrane/solve/press.hpp>
#include <membrane/solve/quasi_static.hpp>

#include <membrane/haptics/force_policy.hpp>
#include <membrane/haptics/device.hpp>
// clang-format on
