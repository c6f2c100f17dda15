#include "lane_problems.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "wide.h"

namespace swgjoint {

namespace {

constexpr std::size_t kMost = 44;  // active contacts
constexpr int kLoops = 50;         // of one problem
constexpr double kSlope = 1e-7;    // error of the approaches by the load, relative

// Smallest value, and how many values are not at least minus the tolerance
SWGJOINT_WIDE std::size_t violations(const double* value, std::size_t n,
                                     double tolerance, double* lowest) {
  double least[kLanes] = {};
  std::size_t wrong = 0;
  for (std::size_t k = 0; k < n; k += kLanes) {
    for (std::size_t i = 0; i < kLanes; ++i) {
      const double v = value[k + i];
      least[i] = v < least[i] ? v : least[i];
      wrong += !(v >= -tolerance);
    }
  }
  *lowest = *std::min_element(least, least + kLanes);
  return wrong;
}

}  // namespace

LaneSolver::LaneSolver(const Problem& problem, const StripLaw& law)
    : p_(problem), law_(law), rows_(padded(problem.size)),
      columns_(problem.size * rows_), strip_columns_(law.strips * rows_),
      memory_(kLanes * (2 * kMost * kMost + kMost + 1)), force_(law.strips),
      yield_(law.strips), loaded_(law.strips) {
  const std::size_t n = p_.size;
  for (std::size_t k = 0; k < n; ++k) {
    std::copy_n(p_.columns + n * k, n, columns_.data() + rows_ * k);
  }
  for (std::size_t j = 0; j < law_.strips; ++j) {
    std::copy_n(p_.strip_columns + n * j, n, strip_columns_.data() + rows_ * j);
  }
  for (std::size_t k = 0; k < n; ++k) {
    if (p_.strip[k] < 0) continue;
    members_.push_back(k);
    strip_rows_ = padded(k + 1);
    const double yield = p_.force_unit[k] * p_.strip_columns[n * p_.strip[k] + k];
    yields_.push_back(p_.closed[k] ? yield : -yield / p_.columns[n * k + k]);
  }
  // a vector of the systems must not cross two lines of the cache
  const std::uintptr_t line = kLanes * sizeof(double);
  const auto first = reinterpret_cast<std::uintptr_t>(memory_.data());
  systems_ = memory_.data() + (line - first % line) % line / sizeof(double);
  factors_ = systems_ + kLanes * kMost * kMost;
  unknowns_ = factors_ + kLanes * kMost * kMost;
  for (Lane& lane : lanes_) lane.inside.assign(n, 0);
  for (std::size_t i = 0; i < kMost; ++i) {
    std::fill_n(systems_ + kLanes * (kMost + 1) * i, kLanes, 1.0);
  }
}

void LaneSolver::solve(std::size_t count, const double* offset,
                       const double* tolerance, bool* active, double* result,
                       double* approach, double* slope, bool* solved) {
  const std::size_t n = p_.size, strips = law_.strips;
  for (std::size_t i = 0; i < count; ++i) {
    begin(lanes_[i], offset + n * i, active + n * i);
    solved[i] = false;
  }
  const auto any_open = [&] {
    return std::any_of(lanes_, lanes_ + count, [](const Lane& l) { return l.open; });
  };
  while (any_open()) {
    solve_systems();
    for (std::size_t i = 0; i < count; ++i) {
      Lane& lane = lanes_[i];
      if (!lane.open) continue;
      // while the active set stays, only the strips have to be followed
      spread(lane, i, lane.settled ? strip_rows_ : rows_);
      const bool exact = follow_strips(lane, false);
      if (lane.settled && exact) spread(lane, i, rows_);
      if (!lane.settled || exact) lane.settled = !exchange(lane, tolerance[i]);
      if (lane.settled && exact) {
        lane.open = false;
        solved[i] = lane.residual <= kResidual * tolerance[i];
      } else if (++lane.loops == kLoops) {
        lane.open = false;
      }
    }
  }

  // derivatives by the load, with the tangents of the strips at the solution
  for (std::size_t i = 0; i < count; ++i) {
    Lane& lane = lanes_[i];
    lane.open = solved[i];
    if (!lane.open) continue;
    std::copy_n(lane.value.data(), n, result + n * i);
    std::copy_n(lane.approach.data(), strips, approach + strips * i);
    for (std::size_t k = 0; k < n; ++k) active[n * i + k] = lane.active[k] != 0;
    std::copy_n(p_.direction, n, lane.known.data());
    std::fill_n(lane.approach.data(), strips, 0.0);
    lane.loops = 0;
  }
  while (any_open()) {
    solve_systems();
    for (std::size_t i = 0; i < count; ++i) {
      Lane& lane = lanes_[i];
      if (!lane.open) continue;
      spread(lane, i, strip_rows_);
      if (follow_strips(lane, true)) {
        lane.open = false;
        slope[i] = output(lane);
      } else if (++lane.loops == kLoops) {
        lane.open = solved[i] = false;
      }
    }
  }
}

double LaneSolver::output(const Lane& lane) const {
  double sum = 0.0;
  for (const std::size_t k : lane.set) sum += p_.by_value[k] * lane.value[k];
  for (std::size_t j = 0; j < law_.strips; ++j) sum += p_.by_strip[j] * lane.approach[j];
  return sum;
}

void LaneSolver::begin(Lane& lane, const double* offset, const bool* guess) {
  const std::size_t n = p_.size;
  lane.active.assign(guess, guess + n);
  lane.known.assign(rows_, 0.0);
  std::copy_n(offset, n, lane.known.data());
  lane.value = lane.known;
  // the first forces are those of the closed contacts alone
  for (std::size_t k = 0; k < n; ++k) {
    if (lane.active[k]) lane.value[k] = 0.0;
  }
  lane.approach.assign(law_.strips, 0.0);
  lane.tangent.assign(law_.strips, 0.0);
  follow_strips(lane, false);
  lane.settled = false;
  lane.fewest = n + 1;
  lane.tries = p_.tries;
  lane.loops = 0;
  lane.open = lane.changed = true;
}

void LaneSolver::solve_systems() {
  bool changed = false;
  size_ = 0;
  for (std::size_t i = 0; i < kLanes; ++i) {
    Lane& lane = lanes_[i];
    if (lane.open && lane.changed) {
      changed = true;
      lane.open = write(lane, i);
      lane.changed = false;
    }
    size_ = std::max(size_, lane.set.size());
  }
  if (changed) {
    for (std::size_t i = 0; i < size_; ++i) {
      const double* row = systems_ + kLanes * kMost * i;
      std::copy_n(row, kLanes * size_, factors_ + kLanes * kMost * i);
    }
    eliminate_lanes(factors_, size_, kMost);
  }
  for (std::size_t l = 0; l < kLanes; ++l) {
    const Lane& lane = lanes_[l];
    const std::size_t own = lane.set.size();
    for (std::size_t i = 0; i < own; ++i) {
      unknowns_[kLanes * i + l] = -lane.known[lane.set[i]];
    }
    for (std::size_t i = own; i < size_; ++i) unknowns_[kLanes * i + l] = 0.0;
  }
  substitute_lanes(factors_, size_, kMost, unknowns_);
}

bool LaneSolver::write(Lane& lane, std::size_t number) {
  // the last contact takes the place of one that leaves
  places_.clear();
  for (std::size_t i = 0; i < lane.set.size();) {
    const std::size_t k = lane.set[i];
    if (lane.active[k]) {
      ++i;
      continue;
    }
    lane.inside[k] = 0;
    lane.set[i] = lane.set.back();
    lane.set.pop_back();
    places_.push_back(i);
  }
  for (std::size_t k = 0; k < p_.size; ++k) {
    if (!lane.active[k] || lane.inside[k]) continue;
    lane.inside[k] = 1;
    places_.push_back(lane.set.size());
    lane.set.push_back(k);
  }
  const bool fits = lane.set.size() <= kMost;
  if (!fits) {
    for (const std::size_t k : lane.set) lane.inside[k] = 0;
    lane.set.clear();
  }
  const std::size_t size = lane.set.size(), most = std::max(size, lane.written);
  double* system = systems_ + number;
  for (const std::size_t i : places_) {
    if (i >= size) continue;
    const std::size_t k = lane.set[i];
    const double* column = columns_.data() + rows_ * k;
    for (std::size_t t = 0; t < size; ++t) {
      system[kLanes * (kMost * t + i)] = column[lane.set[t]];
      system[kLanes * (kMost * i + t)] = columns_[rows_ * lane.set[t] + k];
    }
  }
  // no more unknowns: rows of the identity
  for (std::size_t i = 0; i < most; ++i) {
    for (std::size_t c = i < size ? size : 0; c < most; ++c) {
      system[kLanes * (kMost * i + c)] = i == c ? 1.0 : 0.0;
    }
  }
  lane.written = size;
  return fits;
}

void LaneSolver::spread(Lane& lane, std::size_t number, std::size_t rows) {
  list_.clear();
  parts_.clear();
  for (std::size_t i = 0; i < lane.set.size(); ++i) {
    list_.push_back(columns_.data() + rows_ * lane.set[i]);
    parts_.push_back(unknowns_[kLanes * i + number]);
  }
  std::copy_n(lane.known.data(), rows, lane.value.data());
  add_columns(lane.value.data(), list_.data(), parts_.data(), parts_.size(), rows);
  lane.residual = 0.0;
  for (std::size_t i = 0; i < lane.set.size(); ++i) {
    double& value = lane.value[lane.set[i]];
    if (lane.set[i] < rows) lane.residual = std::max(lane.residual, std::abs(value));
    value = parts_[i];
  }
}

bool LaneSolver::follow_strips(Lane& lane, bool by_load) {
  std::fill(force_.begin(), force_.end(), 0.0);
  std::fill(yield_.begin(), yield_.end(), 0.0);
  std::fill(loaded_.begin(), loaded_.end(), 0);
  for (std::size_t t = 0; t < members_.size(); ++t) {
    const std::size_t k = members_[t], j = p_.strip[k];
    if ((lane.active[k] != 0) == p_.closed[k]) continue;
    force_[j] += p_.force_unit[k] * lane.value[k];
    yield_[j] += yields_[t];
    ++loaded_[j];
  }
  list_.clear();
  parts_.clear();
  double error = 0.0, largest = 0.0;
  moved_.clear();
  for (std::size_t j = 0; j < law_.strips; ++j) {
    double wanted = by_load ? lane.tangent[j] * force_[j] : -law_.offset[j];
    if (!by_load) {
      lane.tangent[j] = 0.0;
      if (loaded_[j]) wanted = law_.excess(j, force_[j], &lane.tangent[j]);
    }
    const double missing = wanted - lane.approach[j];
    error = std::max(error, std::abs(missing));
    largest = std::max(largest, std::abs(wanted));
    if (missing == 0.0) continue;
    // as if no other strip and no other contact gave way
    const double step = missing / (1.0 - lane.tangent[j] * yield_[j]);
    moved_.push_back(j);
    list_.push_back(strip_columns_.data() + rows_ * j);
    parts_.push_back(step);
  }
  if (by_load && largest > 0.0) error /= largest;
  if (error <= (by_load ? kSlope : p_.tolerance_m)) return true;
  for (std::size_t t = 0; t < moved_.size(); ++t) lane.approach[moved_[t]] += parts_[t];
  add_columns(lane.known.data(), list_.data(), parts_.data(), parts_.size(), rows_);
  return false;
}

bool LaneSolver::exchange(Lane& lane, double tolerance) {
  double lowest = 0.0;
  const std::size_t wrong = violations(lane.value.data(), rows_, tolerance, &lowest);
  if (wrong == 0) return false;
  lane.tries = wrong < lane.fewest ? p_.tries : lane.tries - 1;
  lane.fewest = std::min(lane.fewest, wrong);
  const double part = lane.tries < p_.tries ? kMostViolated : kViolated;
  const double limit = std::max(tolerance, -part * lowest);
  for (std::size_t k = 0; k < p_.size; ++k) {
    if (!(lane.value[k] >= -limit)) lane.active[k] ^= 1;
  }
  lane.changed = true;
  lane.open = lane.tries >= 0;
  return true;
}

}  // namespace swgjoint
