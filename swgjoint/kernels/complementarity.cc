#include "complementarity.h"

#include <algorithm>
#include <cmath>

#include "dense_factors.h"

namespace swgjoint {

namespace {

// A new reference is taken after kFewest changes and one per kShare active contacts: then
// the factors cost less than the extra unknowns.
constexpr std::size_t kFewest = 4, kShare = 12;

}  // namespace

double StripLaw::excess(std::size_t strip, double force, double* derivative) const {
  const double f = std::max(force, 0.0);
  const double width = narrowest + growth * f;
  const double steady = std::log1p(widest / width);
  const double falling = growth * f * widest / (width * (width + widest));
  *derivative = 0.5 * softness * (steady - falling) - slope[strip];
  return 0.5 * softness * f * steady - slope[strip] * f - offset[strip];
}

StripSolver::StripSolver(const Problem& problem, const StripLaw& law)
    : p_(problem), law_(law), members_(law.strips), force_row_(problem.size, -1),
      seat_(problem.size, -1), seen_(new double[problem.size * problem.size]),
      seen_strips_(new double[problem.size * law.strips]), row_(problem.size, -1),
      extra_of_(problem.size, -1), place_(law.strips, -1),
      stride_(padded(law.strips + kFewest + problem.size / kShare + 1)),
      moved_(problem.size * stride_), across_(problem.size * stride_),
      x_(stride_), work_(problem.size), rows_(problem.size), line_(stride_),
      force_(law.strips), excess_(law.strips), slope_(law.strips), at_rest_(law.strips) {
  for (std::size_t j = 0; j < law_.strips; ++j) law_.excess(j, 0.0, &at_rest_[j]);
  for (std::size_t k = 0; k < p_.size; ++k) {
    if (p_.strip[k] < 0) continue;
    members_[p_.strip[k]].push_back(k);
    if (!p_.closed[k]) continue;
    force_row_[k] = static_cast<std::int64_t>(forces_.size());
    forces_.push_back(k);
    watch(k);
  }
  forced_.resize(forces_.size() * stride_);
}

bool StripSolver::solve(const double* offset, double tolerance, bool* active,
                        double* result, double* approach, double* slope) {
  const std::size_t n = p_.size;
  std::size_t fewest = n + 1;
  int tries = p_.tries;
  // first guess of the forces: the closed contacts alone
  std::fill(force_.begin(), force_.end(), 0.0);
  for (const std::size_t k : forces_) force_[p_.strip[k]] += p_.force_unit[k] * offset[k];
  for (std::size_t j = 0; j < law_.strips; ++j) {
    excess_[j] = law_.excess(j, force_[j], &slope_[j]);
  }
  for (std::size_t k = 0; k < n; ++k) {
    if (active[k]) watch(k);
  }
  bool fresh = false;  // whether the reference is the active set itself
  if (referred_) start(offset);
  while (true) {
    if (!referred_ || !follow(active)) {
      fresh = true;
      if (!refer(offset, active) || !follow(active)) return referred_ = false;
    }
    if (!solve_extra(active, false)) {
      referred_ = false;
      if (fresh) return false;
      continue;
    }
    double residual = spread(offset, active, false, result);
    for (std::size_t j = 0; j < law_.strips; ++j) {
      approach[j] = place_[j] < 0 ? -law_.offset[j] : x_[place_[j]];
    }

    // forces of the strips, and the error of their approaches
    double error = 0.0;
    for (std::size_t j = 0; j < law_.strips; ++j) {
      force_[j] = 0.0;
      bool loaded = false;
      for (const std::size_t k : members_[j]) {
        if (active[k] == p_.closed[k]) continue;
        force_[j] += p_.force_unit[k] * result[k];
        loaded = true;
      }
      if (loaded) {
        excess_[j] = law_.excess(j, force_[j], &slope_[j]);
      } else {
        excess_[j] = -law_.offset[j];
        slope_[j] = at_rest_[j];
      }
      error = std::max(error, std::abs(excess_[j] - approach[j]));
    }

    std::size_t wrong = 0, last = 0;
    double lowest = 0.0;
    const auto judge = [&](std::size_t k) {
      lowest = std::min(lowest, result[k]);
      if (!(result[k] >= -tolerance)) {
        ++wrong;
        last = std::max(last, k);
      }
    };
    for (const std::size_t k : watched_) judge(k);
    if (wrong == 0 && error <= p_.tolerance_m) {
      // solved as far as it is watched: check all other contacts
      residual = spread(offset, active, true, result);
      for (std::size_t k = 0; k < n; ++k) {
        if (result[k] >= -tolerance) continue;
        watch(k);
        judge(k);
      }
      if (wrong > 0) fewest = n + 1;
    }
    if (wrong == 0 && !fresh && !(residual <= kResidual * tolerance)) {
      referred_ = false;
      continue;
    }
    if (wrong == 0 && error <= p_.tolerance_m) break;
    fresh = false;
    if (wrong == 0) {
      if (--tries < -p_.singles) return false;
      continue;
    }
    tries = wrong < fewest ? p_.tries : tries - 1;
    fewest = std::min(fewest, wrong);
    if (tries < -p_.singles) return false;
    if (tries < 0) {
      active[last] = !active[last];
    } else {
      const double part = tries < p_.tries ? kMostViolated : kViolated;
      const double limit = std::max(tolerance, -part * lowest);
      for (const std::size_t k : watched_) {
        if (!(result[k] >= -limit)) active[k] = !active[k];
      }
    }
  }

  // derivatives by the load, with the tangents of the strips at the solution
  if (!solve_extra(active, true)) return false;
  *slope = 0.0;
  for (std::size_t i = 0; i < inside_.size(); ++i) {
    *slope += p_.by_value[inside_[i]] * work_[i];
  }
  for (std::size_t t = 0; t < extra_.size(); ++t) {
    const std::size_t k = extra_[t].index;
    if (extra_[t].kind == Kind::kActive) *slope += p_.by_value[k] * x_[t];
    if (extra_[t].kind == Kind::kStrip) *slope += p_.by_strip[k] * x_[t];
  }
  return true;
}

bool StripSolver::refer(const double* offset, const bool* active) {
  const std::size_t n = p_.size;
  inside_.clear();
  for (const std::size_t k : watched_) {
    row_[k] = active[k] ? static_cast<std::int64_t>(inside_.size()) : -1;
    if (active[k]) inside_.push_back(k);
    extra_of_[k] = -1;
  }
  // the strips that carry force or have moved from where the law is linearised
  extra_.clear();
  std::fill(place_.begin(), place_.end(), -1);
  for (std::size_t j = 0; j < law_.strips; ++j) {
    bool there = law_.offset[j] != 0.0;
    for (const std::size_t k : members_[j]) there = there || active[k] != p_.closed[k];
    if (!there) continue;
    place_[j] = static_cast<std::int64_t>(extra_.size());
    extra_.push_back({Kind::kStrip, j});
  }
  const std::size_t a = inside_.size(), count = extra_.size(), width = a + count + 2,
                    stride = width + kPadding;
  system_.resize(a * stride);
  for (std::size_t c = 0; c < width - 2; ++c) {
    const double* column = c < a ? p_.columns + n * inside_[c]
                                 : p_.strip_columns + n * extra_[c - a].index;
    for (std::size_t i = 0; i < a; ++i) system_[i * stride + c] = column[inside_[i]];
  }
  for (std::size_t i = 0; i < a; ++i) {
    system_[i * stride + width - 2] = -p_.direction[inside_[i]];
    system_[i * stride + width - 1] = -offset[inside_[i]];
    std::fill_n(system_.data() + i * stride + width, kPadding, 0.0);
  }
  pivots_.resize(a);
  if (!eliminate(system_.data(), a, width, stride, pivots_.data())) return false;
  const std::size_t forces = forces_.size();
  factors_.resize(a * a);
  into_forces_.resize(forces * a);
  for (std::size_t i = 0; i < a; ++i) {
    const double* row = system_.data() + i * stride;
    for (std::size_t c = 0; c < a; ++c) factors_[c * a + i] = row[c];
    std::copy_n(row + a, count, moved_.data() + i * stride_);
    const double* column = p_.columns + n * inside_[i];
    for (std::size_t f = 0; f < forces; ++f) into_forces_[f * a + i] = column[forces_[f]];
  }
  for (std::size_t f = 0; f < forces; ++f) {
    double* row = forced_.data() + f * stride_;
    for (std::size_t t = 0; t < count; ++t) row[t] = coupling(forces_[f], extra_[t]);
  }
  subtract_product(forced_.data(), into_forces_.data(), moved_.data(), forces, a, wide(),
                   stride_);
  for (std::size_t load = 0; load < 2; ++load) {
    value_[load].resize(a);
    for (std::size_t i = 0; i < a; ++i) {
      value_[load][i] = system_[i * stride + width - 1 - load];
    }
    const double* q = load ? p_.direction : offset;
    slack_[load].resize(forces);
    for (std::size_t f = 0; f < forces; ++f) slack_[load][f] = q[forces_[f]];
    add_products(slack_[load].data(), 1.0, into_forces_.data(), forces, a,
                 value_[load].data(), a);
  }
  offset_ = offset;
  return referred_ = true;
}

void StripSolver::start(const double* offset) {
  const std::size_t a = inside_.size();
  for (std::size_t i = 0; i < a; ++i) value_[0][i] = -offset[inside_[i]];
  substitute(factors_.data(), pivots_.data(), a, value_[0].data());
  for (std::size_t f = 0; f < forces_.size(); ++f) slack_[0][f] = offset[forces_[f]];
  add_products(slack_[0].data(), 1.0, into_forces_.data(), forces_.size(), a,
               value_[0].data(), a);
  offset_ = offset;
}

bool StripSolver::follow(const bool* active) {
  std::size_t changes = 0;
  for (const std::size_t k : watched_) changes += active[k] != (row_[k] >= 0);
  if (changes > kFewest + inside_.size() / kShare) return false;
  // first those that have changed back, so that all others find room
  const auto changed = [&](std::size_t k) { return active[k] != (row_[k] >= 0); };
  for (const std::size_t k : watched_) {
    if (extra_of_[k] >= 0 && !changed(k)) drop(static_cast<std::size_t>(extra_of_[k]));
  }
  for (const std::size_t k : watched_) {
    if (extra_of_[k] < 0 && changed(k)) {
      add(active[k] ? Kind::kActive : Kind::kInactive, k);
    }
  }
  for (std::size_t j = 0; j < law_.strips; ++j) {
    for (const std::size_t k : members_[j]) {
      if (place_[j] < 0 && active[k] != p_.closed[k]) add(Kind::kStrip, j);
    }
  }
  return true;
}

void StripSolver::add(Kind kind, std::size_t index) {
  const std::size_t a = inside_.size(), forces = forces_.size(), t = extra_.size();
  const Extra extra{kind, index};
  extra_.push_back(extra);
  (kind == Kind::kStrip ? place_ : extra_of_)[index] = static_cast<std::int64_t>(t);
  column_.resize(a + forces);
  for (std::size_t i = 0; i < a; ++i) column_[i] = coupling(inside_[i], extra);
  substitute(factors_.data(), pivots_.data(), a, column_.data());
  double* forced = column_.data() + a;
  for (std::size_t f = 0; f < forces; ++f) forced[f] = coupling(forces_[f], extra);
  add_products(forced, -1.0, into_forces_.data(), forces, a, column_.data(), a);
  for (std::size_t i = 0; i < a; ++i) moved_[i * stride_ + t] = column_[i];
  for (std::size_t f = 0; f < forces; ++f) forced_[f * stride_ + t] = forced[f];
  if (kind == Kind::kActive) {
    double* row = across_.data() + t * p_.size;
    for (std::size_t i = 0; i < a; ++i) row[i] = p_.columns[p_.size * inside_[i] + index];
  }
}

void StripSolver::drop(std::size_t t) {
  const std::size_t last = extra_.size() - 1;
  extra_of_[extra_[t].index] = -1;
  if (t != last) {
    extra_[t] = extra_[last];
    for (std::size_t i = 0; i < inside_.size(); ++i) {
      moved_[i * stride_ + t] = moved_[i * stride_ + last];
    }
    for (std::size_t f = 0; f < forces_.size(); ++f) {
      forced_[f * stride_ + t] = forced_[f * stride_ + last];
    }
    std::copy_n(across_.data() + last * p_.size, inside_.size(),
                across_.data() + t * p_.size);
    (extra_[t].kind == Kind::kStrip ? place_ : extra_of_)[extra_[t].index] =
        static_cast<std::int64_t>(t);
  }
  extra_.pop_back();
}

double StripSolver::coupling(std::size_t k, const Extra& extra) const {
  if (extra.kind == Kind::kStrip) return p_.strip_columns[p_.size * extra.index + k];
  if (extra.kind == Kind::kActive) return p_.columns[p_.size * extra.index + k];
  return extra.index == k ? -1.0 : 0.0;
}

double StripSolver::equation(std::size_t r, const bool* active, bool by_load) {
  const std::size_t a = inside_.size(), count = extra_.size(), k = extra_[r].index;
  const std::vector<double>&value = value_[by_load], &slack = slack_[by_load];
  double* row = line_.data();
  if (extra_[r].kind == Kind::kActive) {
    // its slack is zero
    const double* across = across_.data() + r * p_.size;
    for (std::size_t t = 0; t < count; ++t) row[t] = coupling(k, extra_[t]);
    subtract_product(row, across, moved_.data(), 1, a, wide(), stride_);
    double known = (by_load ? p_.direction : offset_)[k];
    add_products(&known, 1.0, across, 1, a, value.data(), a);
    return -known;
  }
  if (extra_[r].kind == Kind::kInactive) {
    // its value is zero
    std::copy_n(moved_.data() + row_[k] * stride_, count, row);
    return value[row_[k]];
  }
  // its approach follows the tangent of the law at the last force
  const double d = slope_[k];
  double right = by_load ? 0.0 : excess_[k] - d * std::max(force_[k], 0.0);
  std::fill_n(row, count, 0.0);
  for (const std::size_t j : members_[k]) {
    if (active[j] == p_.closed[j]) continue;
    const double unit = d * p_.force_unit[j];
    if (extra_of_[j] >= 0) {
      row[extra_of_[j]] -= unit;
    } else if (active[j]) {
      const double* moved = moved_.data() + row_[j] * stride_;
      for (std::size_t t = 0; t < count; ++t) row[t] += unit * moved[t];
      right += unit * value[row_[j]];
    } else {
      const double* forced = forced_.data() + force_row_[j] * stride_;
      for (std::size_t t = 0; t < count; ++t) row[t] -= unit * forced[t];
      right += unit * slack[force_row_[j]];
    }
  }
  row[r] += 1.0;
  return right;
}

bool StripSolver::solve_extra(const bool* active, bool by_load) {
  const std::size_t a = inside_.size(), count = extra_.size();
  // a strip without force is known: as far apart as its law says
  std::fill(x_.begin(), x_.end(), 0.0);
  unknown_.clear();
  for (std::size_t r = 0; r < count; ++r) {
    bool known = extra_[r].kind == Kind::kStrip;
    if (known) {
      for (const std::size_t j : members_[extra_[r].index]) {
        known = known && active[j] == p_.closed[j];
      }
    }
    if (!known) {
      unknown_.push_back(r);
    } else if (!by_load) {
      x_[r] = -law_.offset[extra_[r].index];
    }
  }
  const std::size_t size = unknown_.size(), stride = size + 1 + kPadding;
  system_.resize(size * stride);
  for (std::size_t u = 0; u < size; ++u) {
    double right = equation(unknown_[u], active, by_load);
    add_products(&right, -1.0, line_.data(), 1, count, x_.data(), count);
    double* reduced = system_.data() + u * stride;
    for (std::size_t v = 0; v < size; ++v) reduced[v] = line_[unknown_[v]];
    reduced[size] = right;
    std::fill_n(reduced + size + 1, kPadding, 0.0);
  }
  order_.resize(size);
  if (!eliminate(system_.data(), size, size + 1, stride, order_.data())) return false;
  for (std::size_t u = 0; u < size; ++u) x_[unknown_[u]] = system_[u * stride + size];
  std::copy(value_[by_load].begin(), value_[by_load].end(), work_.begin());
  add_products(work_.data(), -1.0, moved_.data(), a, stride_, x_.data(), count);
  return true;
}

}  // namespace swgjoint
