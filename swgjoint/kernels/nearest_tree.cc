#include "nearest_tree.h"

#include <limits>
#include <vector>

namespace swgjoint {

void nearest_tree(const double* distance, std::size_t n, std::int64_t* order,
                  std::int64_t* before) {
  // infinite for problems that are in the tree already
  constexpr double kInside = std::numeric_limits<double>::infinity();
  std::vector<double> nearest(distance, distance + n);
  std::vector<std::int64_t> place(n, 0);
  order[0] = 0;
  before[0] = -1;
  nearest[0] = kInside;
  for (std::size_t k = 1; k < n; ++k) {
    std::size_t row = 0;
    for (std::size_t i = 1; i < n; ++i) {
      if (nearest[i] < nearest[row]) row = i;
    }
    order[k] = static_cast<std::int64_t>(row);
    before[k] = place[row];
    nearest[row] = kInside;
    const double* own = distance + n * row;
    for (std::size_t i = 0; i < n; ++i) {
      if (nearest[i] == kInside || !(own[i] < nearest[i])) continue;
      nearest[i] = own[i];
      place[i] = static_cast<std::int64_t>(k);
    }
  }
}

}  // namespace swgjoint
