// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

#include <membrane/collision/contact.hpp>
#include <membrane/core/types.hpp>

namespace membrane {

/// The contact with a normal that changes continuously as the contact point slides over edges and vertices: the normals
/// of the corners, in the shares of the point. For the force; the solver takes the contact as it is.
///
///     device.write(feel({tool, membrane::smooth_contact(contact, normals.values()), report}));
///
/// `normals` 3 x V, of length 1, as `VertexNormals` has them. Where they cancel out, the normal as it was. A point that
/// jumps, as it does from one side of a crease that the tool is in to the other, still takes its normal along.
template <Real Scalar>
[[nodiscard]] Contact<Scalar> smooth_contact(const Contact<Scalar>& contact, const Points<Scalar>& normals) noexcept {
    Contact<Scalar> smooth = contact;
    if (!contact.touching()) return smooth;
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (int i = 0; i < 3; ++i) {
        sum += contact.barycentric[i] * point(normals, contact.corners[static_cast<std::size_t>(i)]);
    }
    smooth.normal = direction<Scalar>(contact.side * sum, contact.normal);
    return smooth;
}

}  // namespace membrane
