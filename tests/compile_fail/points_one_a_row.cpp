// SPDX-License-Identifier: MIT
// Points as libigl and numpy have them, one a row.
// expect: points must be 3 x V
// expect: transpose
#include <membrane/contact/aabb_tree.hpp>

void refit(membrane::AabbTree<double>& tree, const Eigen::MatrixX3d& x) {
#ifdef CORRECT
    tree.refit(x.transpose());
#else
    tree.refit(x);
#endif
}
