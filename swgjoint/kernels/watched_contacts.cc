#include <algorithm>
#include <cmath>

#include "complementarity.h"
#include "dense_factors.h"

namespace swgjoint {

void StripSolver::watch(std::size_t k) {
  if (seat_[k] >= 0) return;
  const std::size_t n = p_.size, w = watched_.size();
  seat_[k] = static_cast<std::int64_t>(w);
  watched_.push_back(k);
  for (std::size_t v = 0; v <= w; ++v) {
    seen_[n * w + v] = p_.columns[n * k + watched_[v]];
    seen_[n * v + w] = p_.columns[n * watched_[v] + k];
  }
  for (std::size_t j = 0; j < law_.strips; ++j) {
    seen_strips_[n * j + w] = p_.strip_columns[n * j + k];
  }
}

double StripSolver::spread(const double* offset, const bool* active, bool all,
                           double* result) {
  const std::size_t n = p_.size;
  columns_.clear();
  parts_.clear();
  const auto column = [&](std::size_t k) {
    return all ? p_.columns + n * k : seen_.get() + n * seat_[k];
  };
  for (std::size_t i = 0; i < inside_.size(); ++i) {
    if (!active[inside_[i]]) continue;
    columns_.push_back(column(inside_[i]));
    parts_.push_back(work_[i]);
  }
  const double* strips = all ? p_.strip_columns : seen_strips_.get();
  for (std::size_t t = 0; t < extra_.size(); ++t) {
    const std::size_t k = extra_[t].index;
    if (extra_[t].kind == Kind::kInactive) continue;
    columns_.push_back(extra_[t].kind == Kind::kStrip ? strips + n * k : column(k));
    parts_.push_back(x_[t]);
  }
  if (all) {
    std::copy(offset, offset + n, result);
    add_columns(result, columns_.data(), parts_.data(), parts_.size(), n);
  } else {
    const std::size_t count = watched_.size();
    for (std::size_t w = 0; w < count; ++w) rows_[w] = offset[watched_[w]];
    add_columns(rows_.data(), columns_.data(), parts_.data(), parts_.size(), count);
    for (std::size_t w = 0; w < count; ++w) result[watched_[w]] = rows_[w];
  }
  double residual = 0.0;
  for (const std::size_t k : watched_) {
    if (!active[k]) continue;
    residual = std::max(residual, std::abs(result[k]));
    result[k] = row_[k] >= 0 ? work_[row_[k]] : x_[extra_of_[k]];
  }
  return residual;
}

}  // namespace swgjoint
