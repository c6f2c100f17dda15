// Order of problems in which each follows the one that is most similar to it.

#ifndef SWGJOINT_KERNELS_NEAREST_TREE_H_
#define SWGJOINT_KERNELS_NEAREST_TREE_H_

#include <cstddef>
#include <cstdint>

namespace swgjoint {

// The compiled twin of the loop of next_to in swgjoint/fe/common/pivot_base.py. distance
// (n, n) is symmetric; order and before have n numbers.
void nearest_tree(const double* distance, std::size_t n, std::int64_t* order,
                  std::int64_t* before);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_NEAREST_TREE_H_
