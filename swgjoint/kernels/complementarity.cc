#include "complementarity.h"

#include <algorithm>
#include <cmath>

// Two versions of a loop, chosen when the library is loaded. Both give the same bits,
// because they add element by element.
#if defined(__GLIBC__) && defined(__x86_64__) && defined(__GNUC__) && \
    !defined(__SANITIZE_ADDRESS__)
#define SWGJOINT_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define SWGJOINT_WIDE
#endif

namespace swgjoint {

namespace {

// y += a x
SWGJOINT_WIDE void add_multiple(double* y, const double* x, double a, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) y[i] += a * x[i];
}

// y -= a[0] x[0] + a[1] x[1] + ..., one product after another
SWGJOINT_WIDE void subtract_four(double* y, const double* const* x, const double* a,
                                 std::size_t n) {
  const double *x0 = x[0], *x1 = x[1], *x2 = x[2], *x3 = x[3];
  const double a0 = a[0], a1 = a[1], a2 = a[2], a3 = a[3];
  for (std::size_t i = 0; i < n; ++i) {
    y[i] = y[i] - a0 * x0[i] - a1 * x1[i] - a2 * x2[i] - a3 * x3[i];
  }
}

constexpr std::size_t kPanel = 4;  // columns that are eliminated at once

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
    : p_(problem), law_(law), place_(law.strips), force_(law.strips),
      derivative_(law.strips), base_(problem.size) {}

bool StripSolver::solve(const double* offset, double tolerance, bool* active,
                        double* result, double* approach, double* slope) {
  const std::size_t n = p_.size;
  std::size_t fewest = n + 1;
  int tries = p_.tries;
  // first guess of the forces: the closed contacts alone
  std::fill(force_.begin(), force_.end(), 0.0);
  for (std::size_t k = 0; k < n; ++k) {
    if (p_.strip[k] >= 0 && p_.closed[k]) force_[p_.strip[k]] += p_.force_unit[k] * offset[k];
  }
  while (true) {
    assemble(offset, active);
    if (!factorise()) return false;
    substitute();
    for (std::size_t j = 0; j < law_.strips; ++j) {
      approach[j] = place_[j] < 0 ? -law_.offset[j] : right_[inside_.size() + place_[j]];
    }
    spread(result);

    // forces of the strips, and the error of their approaches
    std::fill(force_.begin(), force_.end(), 0.0);
    for (std::size_t k = 0; k < n; ++k) {
      if (p_.strip[k] >= 0 && active[k] != p_.closed[k]) {
        force_[p_.strip[k]] += p_.force_unit[k] * result[k];
      }
    }
    double error = 0.0, derivative;
    for (std::size_t j = 0; j < law_.strips; ++j) {
      error = std::max(error, std::abs(law_.excess(j, force_[j], &derivative) - approach[j]));
    }

    std::size_t wrong = 0, last = 0;
    for (std::size_t k = 0; k < n; ++k) {
      if (!(result[k] >= -tolerance)) {
        ++wrong;
        last = k;
      }
    }
    if (wrong == 0 && error <= p_.tolerance_m) break;
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
      for (std::size_t k = 0; k < n; ++k) {
        if (!(result[k] >= -tolerance)) active[k] = !active[k];
      }
    }
  }

  // derivatives by the load, with the tangents of the strips at the solution
  assemble(offset, active);
  if (!factorise()) return false;
  const std::size_t a = inside_.size();
  std::fill(right_.begin(), right_.end(), 0.0);
  for (std::size_t i = 0; i < a; ++i) right_[i] = -p_.direction[inside_[i]];
  for (std::size_t k = 0; k < n; ++k) {
    if (p_.strip[k] >= 0 && p_.closed[k] && !active[k] && place_[p_.strip[k]] >= 0) {
      const std::size_t j = p_.strip[k];
      right_[a + place_[j]] += derivative_[j] * p_.force_unit[k] * p_.direction[k];
    }
  }
  substitute();
  *slope = 0.0;
  for (std::size_t i = 0; i < a; ++i) *slope += p_.by_value[inside_[i]] * right_[i];
  for (std::size_t l = 0; l < loaded_.size(); ++l) {
    *slope += p_.by_strip[loaded_[l]] * right_[a + l];
  }
  return true;
}

void StripSolver::assemble(const double* offset, const bool* active) {
  const std::size_t n = p_.size;
  inside_.clear();
  loaded_.clear();
  std::fill(place_.begin(), place_.end(), -1);
  for (std::size_t k = 0; k < n; ++k) {
    if (active[k]) inside_.push_back(k);
    const std::int64_t j = p_.strip[k];
    if (j >= 0 && active[k] != p_.closed[k] && place_[j] < 0) {
      place_[j] = static_cast<std::int64_t>(loaded_.size());
      loaded_.push_back(static_cast<std::size_t>(j));
    }
  }
  // strips without force are back at their start
  std::copy(offset, offset + n, base_.begin());
  for (std::size_t j = 0; j < law_.strips; ++j) {
    if (place_[j] >= 0 || law_.offset[j] == 0.0) continue;
    const double* column = p_.strip_columns + n * j;
    add_multiple(base_.data(), column, -law_.offset[j], n);
  }

  const std::size_t a = inside_.size(), size = a + loaded_.size();
  matrix_.assign(size * size, 0.0);
  right_.assign(size, 0.0);
  for (std::size_t c = 0; c < size; ++c) {
    const double* column = c < a ? p_.columns + n * inside_[c]
                                 : p_.strip_columns + n * loaded_[c - a];
    for (std::size_t i = 0; i < a; ++i) matrix_[i * size + c] = column[inside_[i]];
  }
  for (std::size_t i = 0; i < a; ++i) right_[i] = -base_[inside_[i]];
  for (std::size_t l = 0; l < loaded_.size(); ++l) {
    const std::size_t j = loaded_[l];
    const double excess = law_.excess(j, force_[j], &derivative_[j]);
    matrix_[(a + l) * (size + 1)] = 1.0;
    right_[a + l] = excess - derivative_[j] * std::max(force_[j], 0.0);
  }
  // the force of a strip: unknowns of its open contacts, slacks of its closed ones
  for (std::size_t i = 0; i < a; ++i) {
    const std::size_t k = inside_[i];
    if (p_.strip[k] < 0 || p_.closed[k]) continue;
    const std::size_t j = p_.strip[k];
    matrix_[(a + place_[j]) * size + i] -= derivative_[j] * p_.force_unit[k];
  }
  for (std::size_t k = 0; k < n; ++k) {
    if (p_.strip[k] < 0 || !p_.closed[k] || active[k]) continue;
    const std::size_t j = p_.strip[k];
    const double unit = derivative_[j] * p_.force_unit[k];
    double* row = matrix_.data() + (a + place_[j]) * size;
    for (std::size_t c = 0; c < size; ++c) {
      const double* column = c < a ? p_.columns + n * inside_[c]
                                   : p_.strip_columns + n * loaded_[c - a];
      row[c] -= unit * column[k];
    }
    right_[a + place_[j]] += unit * base_[k];
  }
}

bool StripSolver::factorise() {
  const std::size_t size = right_.size();
  pivots_.resize(size);
  for (std::size_t first = 0; first < size; first += kPanel) {
    const std::size_t end = std::min(first + kPanel, size), rest = size - end;
    for (std::size_t c = first; c < end; ++c) {
      std::size_t best = c;
      for (std::size_t i = c + 1; i < size; ++i) {
        if (std::abs(matrix_[i * size + c]) > std::abs(matrix_[best * size + c])) best = i;
      }
      const double pivot = matrix_[best * size + c];
      if (!(std::abs(pivot) > 0.0)) return false;
      pivots_[c] = best;
      double* own = matrix_.data() + c * size;
      if (best != c) std::swap_ranges(own, own + size, matrix_.data() + best * size);
      for (std::size_t i = c + 1; i < size; ++i) {
        double* row = matrix_.data() + i * size;
        const double part = row[c] /= pivot;
        for (std::size_t k = c + 1; k < end; ++k) row[k] -= part * own[k];
      }
    }
    // the columns after the panel: first in its own rows, then in those below
    const double* rows[kPanel];
    for (std::size_t c = first; c < end; ++c) {
      double* own = matrix_.data() + c * size;
      rows[c - first] = own + end;
      for (std::size_t b = first; b < c; ++b) {
        add_multiple(own + end, rows[b - first], -own[b], rest);
      }
    }
    if (rest == 0) break;
    for (std::size_t i = end; i < size; ++i) {
      double* row = matrix_.data() + i * size;
      subtract_four(row + end, rows, row + first, rest);
    }
  }
  return true;
}

void StripSolver::substitute() {
  double* right = right_.data();
  const std::size_t size = pivots_.size();
  for (std::size_t c = 0; c < size; ++c) std::swap(right[c], right[pivots_[c]]);
  for (std::size_t i = 1; i < size; ++i) {
    const double* row = matrix_.data() + i * size;
    double sum = right[i];
    for (std::size_t j = 0; j < i; ++j) sum -= row[j] * right[j];
    right[i] = sum;
  }
  for (std::size_t i = size; i-- > 0;) {
    const double* row = matrix_.data() + i * size;
    double sum = right[i];
    for (std::size_t j = i + 1; j < size; ++j) sum -= row[j] * right[j];
    right[i] = sum / row[i];
  }
}

void StripSolver::spread(double* result) const {
  const std::size_t n = p_.size, a = inside_.size();
  std::copy(base_.begin(), base_.end(), result);
  for (std::size_t c = 0; c < a + loaded_.size(); ++c) {
    const double* column = c < a ? p_.columns + n * inside_[c]
                                 : p_.strip_columns + n * loaded_[c - a];
    add_multiple(result, column, right_[c], n);
  }
  for (std::size_t i = 0; i < a; ++i) result[inside_[i]] = right_[i];
}

}  // namespace swgjoint
