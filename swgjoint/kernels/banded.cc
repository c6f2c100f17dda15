#include "banded.h"

#include <algorithm>

#include "wide.h"

namespace swgjoint {

namespace {

// y -= a x
SWGJOINT_INLINE void subtract(double* y, const double* x, double a, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) y[i] -= a * x[i];
}

// Factors of the matrix: each column, divided by its pivot, changes those after it.
SWGJOINT_WIDE bool factorise(double* columns, std::size_t size, std::size_t width) {
  for (std::size_t k = 0; k < size; ++k) {
    double* own = columns + k * width;
    const double pivot = own[0];
    if (!(pivot > 0.0)) return false;
    const std::size_t reach = std::min(width, size - k);
    for (std::size_t j = 1; j < reach; ++j) {
      const double lower = own[j] / pivot;
      if (lower != 0.0) subtract(own + j * width, own + j, lower, reach - j);
    }
    for (std::size_t j = 1; j < reach; ++j) own[j] /= pivot;
  }
  return true;
}

SWGJOINT_WIDE void substitute(const double* columns, std::size_t size,
                              std::size_t width, double* loads, std::size_t count) {
  for (std::size_t k = 0; k < size; ++k) {
    const double* own = columns + k * width;
    const std::size_t reach = std::min(width, size - k);
    for (std::size_t j = 1; j < reach; ++j) {
      subtract(loads + (k + j) * count, loads + k * count, own[j], count);
    }
  }
  for (std::size_t k = size; k-- > 0;) {
    const double* own = columns + k * width;
    const std::size_t reach = std::min(width, size - k);
    for (std::size_t r = 0; r < count; ++r) loads[k * count + r] /= own[0];
    for (std::size_t j = 1; j < reach; ++j) {
      subtract(loads + k * count, loads + (k + j) * count, own[j], count);
    }
  }
}

}  // namespace

void add_banded(const std::int64_t* rows, const double* parts, std::size_t n,
                std::size_t m, std::size_t width, double* columns) {
  for (std::size_t e = 0; e < n; ++e) {
    const std::int64_t* own = rows + e * m;
    const double* part = parts + e * m * m;
    for (std::size_t i = 0; i < m; ++i) {
      for (std::size_t j = 0; j < m; ++j) {
        if (own[i] < own[j]) continue;
        columns[own[j] * width + (own[i] - own[j])] += part[i * m + j];
      }
    }
  }
}

bool solve_banded(double* columns, std::size_t size, std::size_t width, double* loads,
                  std::size_t count) {
  if (!factorise(columns, size, width)) return false;
  substitute(columns, size, width, loads, count);
  return true;
}

}  // namespace swgjoint
