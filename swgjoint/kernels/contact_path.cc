#include "contact_path.h"

#include <algorithm>
#include <limits>

#include "dense_factors.h"

namespace swgjoint {

bool follow_path(const PathProblem& p, double reach, std::size_t most,
                 std::vector<PathChange>* changes, double* slope) {
  std::vector<std::size_t> inside, pivots;
  std::vector<bool> active(p.n, false);
  std::vector<double> system, value(p.n), rate(p.n);
  double away = 0.0;
  for (;;) {
    // values and their rates where contacts are active, slacks elsewhere
    inside.clear();
    for (std::size_t i = 0; i < p.n; ++i) {
      if (active[i]) inside.push_back(i);
    }
    const std::size_t k = inside.size(), stride = k + 2 + kPadding;
    system.assign(k * stride + kPadding, 0.0);
    pivots.assign(k, 0);
    for (std::size_t a = 0; a < k; ++a) {
      double* row = system.data() + stride * a;
      const double* from = p.matrix + p.n * inside[a];
      for (std::size_t b = 0; b < k; ++b) row[b] = from[inside[b]];
      row[k] = -p.slack[inside[a]];
      row[k + 1] = -p.by_torque[inside[a]];
    }
    if (k && !eliminate(system.data(), k, k + 2, stride, pivots.data())) return false;
    for (std::size_t i = 0; i < p.n; ++i) {
      value[i] = p.slack[i];
      rate[i] = p.by_torque[i];
      const double* row = p.matrix + p.n * i;
      for (std::size_t b = 0; b < k; ++b) {
        value[i] += row[inside[b]] * system[stride * b + k];
        rate[i] += row[inside[b]] * system[stride * b + k + 1];
      }
    }
    *slope = 0.0;
    for (std::size_t b = 0; b < k; ++b) {
      value[inside[b]] = system[stride * b + k];
      rate[inside[b]] = system[stride * b + k + 1];
      *slope += rate[inside[b]] * p.by_value[inside[b]];
    }
    // the first of them that reaches zero
    double left = std::numeric_limits<double>::infinity();
    std::size_t first = p.n;
    for (std::size_t i = 0; i < p.n; ++i) {
      if (!(rate[i] < 0.0)) continue;
      const double until = std::max(value[i] + away * rate[i], 0.0) / -rate[i];
      if (until < left) {
        left = until;
        first = i;
      }
    }
    if (first == p.n || changes->size() == most || away + left > reach) return true;
    away += left;
    changes->push_back({static_cast<std::int64_t>(first), away, *slope});
    active[first] = !active[first];
  }
}

}  // namespace swgjoint
