#include "dense_factors.h"

#include <algorithm>
#include <cmath>

#include "wide.h"

namespace swgjoint {

namespace {

// y += a x
SWGJOINT_INLINE void add_multiple(double* y, const double* x, double a, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) y[i] += a * x[i];
}

// Scalar product, in eight sums
SWGJOINT_INLINE double product(const double* x, const double* y, std::size_t n) {
  double sums[8] = {};
  std::size_t i = 0;
  for (; i + 8 <= n; i += 8) {
    for (std::size_t k = 0; k < 8; ++k) sums[k] += x[i + k] * y[i + k];
  }
  for (; i < n; ++i) sums[0] += x[i] * y[i];
  return ((sums[0] + sums[4]) + (sums[2] + sums[6])) +
         ((sums[1] + sums[5]) + (sums[3] + sums[7]));
}

constexpr std::size_t kPanel = 8;  // columns that are eliminated at once
constexpr std::size_t kTile = 6;   // rows of a tile that stays in registers
constexpr std::size_t kSmall = 4000;  // numbers of a matrix that is not divided in panels

// Rows from end on, less the multiples of the kPanel rows from first = end - kPanel on.
SWGJOINT_WIDE void subtract_panel(double* matrix, std::size_t rows, std::size_t width,
                                  std::size_t stride, std::size_t end) {
  const std::size_t first = end - kPanel;
  for (std::size_t k = end; k < width; k += kLanes) {
    Lanes upper[kPanel];
    for (std::size_t c = 0; c < kPanel; ++c) {
      upper[c] = *reinterpret_cast<const Lanes*>(matrix + (first + c) * stride + k);
    }
    std::size_t i = end;
    for (; i + kTile <= rows; i += kTile) {
      double* row = matrix + i * stride;
      Lanes tile[kTile];
      for (std::size_t r = 0; r < kTile; ++r) {
        tile[r] = *reinterpret_cast<const Lanes*>(row + r * stride + k);
      }
      for (std::size_t c = 0; c < kPanel; ++c) {
        for (std::size_t r = 0; r < kTile; ++r) {
          tile[r] -= row[r * stride + first + c] * upper[c];
        }
      }
      for (std::size_t r = 0; r < kTile; ++r) {
        *reinterpret_cast<Lanes*>(row + r * stride + k) = tile[r];
      }
    }
    for (; i < rows; ++i) {
      double* row = matrix + i * stride;
      Lanes sum = *reinterpret_cast<const Lanes*>(row + k);
      for (std::size_t c = 0; c < kPanel; ++c) sum -= row[first + c] * upper[c];
      *reinterpret_cast<Lanes*>(row + k) = sum;
    }
  }
}

// Factors of the columns from first to end, in all rows from first on. The copy of the
// panel (kPanel, rows) has one column after another, so that loops run along columns.
SWGJOINT_WIDE bool eliminate_panel(double* matrix, std::size_t rows, std::size_t width,
                                   std::size_t stride, std::size_t first,
                                   std::size_t end, std::size_t* pivots, double* panel) {
  for (std::size_t i = first; i < rows; ++i) {
    for (std::size_t k = first; k < end; ++k) {
      panel[(k - first) * rows + i] = matrix[i * stride + k];
    }
  }
  for (std::size_t c = first; c < end; ++c) {
    double* own = panel + (c - first) * rows;
    std::size_t best = c;
    double largest = std::abs(own[c]);
    for (std::size_t i = c + 1; i < rows; ++i) {
      if (std::abs(own[i]) > largest) {
        largest = std::abs(own[i]);
        best = i;
      }
    }
    if (!(largest > 0.0)) return false;
    pivots[c] = best;
    if (best != c) {
      double* row = matrix + c * stride;
      std::swap_ranges(row, row + width, matrix + best * stride);
      for (std::size_t k = 0; k < end - first; ++k) {
        std::swap(panel[k * rows + c], panel[k * rows + best]);
      }
    }
    const double pivot = own[c];
    for (std::size_t i = c + 1; i < rows; ++i) own[i] /= pivot;
    for (std::size_t k = c + 1; k < end; ++k) {
      double* column = panel + (k - first) * rows;
      const double upper = column[c];
      for (std::size_t i = c + 1; i < rows; ++i) column[i] -= own[i] * upper;
    }
  }
  for (std::size_t i = first; i < rows; ++i) {
    for (std::size_t k = first; k < end; ++k) {
      matrix[i * stride + k] = panel[(k - first) * rows + i];
    }
  }
  // the columns after the panel in its own rows
  for (std::size_t c = first + 1; c < end; ++c) {
    double* own = matrix + c * stride;
    for (std::size_t b = first; b < c; ++b) {
      add_multiple(own + end, matrix + b * stride + end, -own[b], width - end);
    }
  }
  return true;
}

// Factors of all columns, one after another: the same bits as by panels, and faster for
// a matrix that fits in the first cache.
SWGJOINT_WIDE bool eliminate_columns(double* matrix, std::size_t rows, std::size_t width,
                                     std::size_t stride, std::size_t* pivots) {
  for (std::size_t c = 0; c < rows; ++c) {
    double* own = matrix + c * stride;
    std::size_t best = c;
    double largest = std::abs(own[c]);
    for (std::size_t i = c + 1; i < rows; ++i) {
      const double size = std::abs(matrix[i * stride + c]);
      if (size > largest) {
        largest = size;
        best = i;
      }
    }
    if (!(largest > 0.0)) return false;
    pivots[c] = best;
    if (best != c) std::swap_ranges(own, own + width, matrix + best * stride);
    const double pivot = own[c];
    for (std::size_t i = c + 1; i < rows; ++i) {
      double* row = matrix + i * stride;
      const double lower = row[c] /= pivot;
      for (std::size_t k = c + 1; k < width; k += kLanes) {
        Lanes sum = *reinterpret_cast<const Lanes*>(row + k);
        sum -= lower * *reinterpret_cast<const Lanes*>(own + k);
        *reinterpret_cast<Lanes*>(row + k) = sum;
      }
    }
  }
  return true;
}

// Solutions of the columns after the first rows ones, given the factors of these.
SWGJOINT_WIDE void substitute_back(double* matrix, std::size_t rows, std::size_t width,
                                   std::size_t stride) {
  for (std::size_t j = rows; j-- > 0;) {
    double* own = matrix + j * stride;
    const double pivot = own[j];
    for (std::size_t k = rows; k < width; ++k) own[k] /= pivot;
    for (std::size_t k = rows; k < width; k += kLanes) {
      const Lanes upper = *reinterpret_cast<const Lanes*>(own + k);
      for (std::size_t i = 0; i < j; ++i) {
        double* row = matrix + i * stride;
        Lanes sum = *reinterpret_cast<const Lanes*>(row + k);
        sum -= row[j] * upper;
        *reinterpret_cast<Lanes*>(row + k) = sum;
      }
    }
  }
}

// The same for a single column, by scalar products along the rows.
SWGJOINT_WIDE void substitute_one(double* matrix, std::size_t rows, std::size_t stride,
                                  double* column) {
  for (std::size_t j = rows; j-- > 0;) {
    double* own = matrix + j * stride;
    const double known = product(own + j + 1, column + j + 1, rows - j - 1);
    column[j] = (own[rows] - known) / own[j];
    own[rows] = column[j];
  }
}

}  // namespace

SWGJOINT_WIDE void add_columns(double* y, const double* const* x, const double* a,
                               std::size_t count, std::size_t n) {
  std::size_t c = 0;
  for (; c + 4 <= count; c += 4) {
    const double *x0 = x[c], *x1 = x[c + 1], *x2 = x[c + 2], *x3 = x[c + 3];
    const double a0 = a[c], a1 = a[c + 1], a2 = a[c + 2], a3 = a[c + 3];
    for (std::size_t i = 0; i < n; ++i) {
      y[i] = y[i] + a0 * x0[i] + a1 * x1[i] + a2 * x2[i] + a3 * x3[i];
    }
  }
  for (; c < count; ++c) add_multiple(y, x[c], a[c], n);
}

SWGJOINT_WIDE void add_products(double* y, double sign, const double* rows,
                                std::size_t count, std::size_t stride, const double* x,
                                std::size_t n) {
  for (std::size_t r = 0; r < count; ++r) y[r] += sign * product(rows + r * stride, x, n);
}

SWGJOINT_WIDE void subtract_product(double* c, const double* a, const double* b,
                                    std::size_t count, std::size_t inner,
                                    std::size_t width, std::size_t stride) {
  for (std::size_t k = 0; k < width; k += kLanes) {
    std::size_t r = 0;
    for (; r + kTile <= count; r += kTile) {
      const double* left = a + r * inner;
      Lanes tile[kTile];
      for (std::size_t t = 0; t < kTile; ++t) {
        tile[t] = *reinterpret_cast<const Lanes*>(c + (r + t) * stride + k);
      }
      for (std::size_t i = 0; i < inner; ++i) {
        const Lanes row = *reinterpret_cast<const Lanes*>(b + i * stride + k);
        for (std::size_t t = 0; t < kTile; ++t) tile[t] -= left[t * inner + i] * row;
      }
      for (std::size_t t = 0; t < kTile; ++t) {
        *reinterpret_cast<Lanes*>(c + (r + t) * stride + k) = tile[t];
      }
    }
    for (; r < count; ++r) {
      Lanes sum = *reinterpret_cast<const Lanes*>(c + r * stride + k);
      for (std::size_t i = 0; i < inner; ++i) {
        sum -= a[r * inner + i] * *reinterpret_cast<const Lanes*>(b + i * stride + k);
      }
      *reinterpret_cast<Lanes*>(c + r * stride + k) = sum;
    }
  }
}

bool eliminate(double* matrix, std::size_t rows, std::size_t width, std::size_t stride,
               std::size_t* pivots) {
  if (rows * stride <= kSmall) {
    if (!eliminate_columns(matrix, rows, width, stride, pivots)) return false;
    if (width == rows + 1) {
      std::vector<double> column(rows);
      substitute_one(matrix, rows, stride, column.data());
    } else {
      substitute_back(matrix, rows, width, stride);
    }
    return true;
  }
  std::vector<double> panel(kPanel * rows);
  for (std::size_t first = 0; first < rows; first += kPanel) {
    const std::size_t end = std::min(first + kPanel, rows);
    if (!eliminate_panel(matrix, rows, width, stride, first, end, pivots, panel.data())) {
      return false;
    }
    // then in the rows below
    if (end < rows) subtract_panel(matrix, rows, width, stride, end);
  }
  substitute_back(matrix, rows, width, stride);
  return true;
}

SWGJOINT_WIDE void substitute(const double* factors, const std::size_t* pivots,
                              std::size_t rows, double* right) {
  for (std::size_t c = 0; c < rows; ++c) std::swap(right[c], right[pivots[c]]);
  for (std::size_t c = 0; c < rows; ++c) {
    const double* column = factors + c * rows;
    const double known = right[c];
    for (std::size_t i = c + 1; i < rows; ++i) right[i] -= known * column[i];
  }
  for (std::size_t c = rows; c-- > 0;) {
    const double* column = factors + c * rows;
    const double known = right[c] /= column[c];
    for (std::size_t i = 0; i < c; ++i) right[i] -= known * column[i];
  }
}

SWGJOINT_WIDE void eliminate_lanes(double* matrices, std::size_t rows,
                                   std::size_t stride) {
  Lanes* a = reinterpret_cast<Lanes*>(matrices);
  for (std::size_t c = 0; c < rows; ++c) {
    Lanes* own = a + c * stride;
    invert(own + c);
    const Lanes inverse = own[c];
    std::size_t i = c + 1;
    for (; i + 2 <= rows; i += 2) {
      Lanes *row = a + i * stride, *next = row + stride;
      const Lanes lower = row[c] * inverse, below = next[c] * inverse;
      row[c] = lower;
      next[c] = below;
      for (std::size_t k = c + 1; k < rows; ++k) {
        const Lanes upper = own[k];
        row[k] -= lower * upper;
        next[k] -= below * upper;
      }
    }
    for (; i < rows; ++i) {
      Lanes* row = a + i * stride;
      const Lanes lower = row[c] * inverse;
      row[c] = lower;
      for (std::size_t k = c + 1; k < rows; ++k) row[k] -= lower * own[k];
    }
  }
}

SWGJOINT_WIDE void substitute_lanes(const double* factors, std::size_t rows,
                                    std::size_t stride, double* right) {
  const Lanes* a = reinterpret_cast<const Lanes*>(factors);
  Lanes* x = reinterpret_cast<Lanes*>(right);
  for (std::size_t i = 1; i < rows; ++i) {
    const Lanes* row = a + i * stride;
    Lanes sum = x[i];
    for (std::size_t k = 0; k < i; ++k) sum -= row[k] * x[k];
    x[i] = sum;
  }
  for (std::size_t i = rows; i-- > 0;) {
    const Lanes* row = a + i * stride;
    Lanes sum = x[i];
    for (std::size_t k = i + 1; k < rows; ++k) sum -= row[k] * x[k];
    x[i] = sum * row[i];
  }
}

}  // namespace swgjoint
