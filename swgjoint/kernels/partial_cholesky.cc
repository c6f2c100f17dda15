#include "partial_cholesky.h"

#include <algorithm>
#include <cmath>

#include "eight_lanes.h"
#include "wide.h"

namespace swgjoint {

namespace {

// Factor of up to kRows unknowns that follow each other.
using Corner = double[kRows];

// Rows of numbers.
template <typename Number>
struct RowsOf {
  Number* begin;
  std::size_t stride;
};
using Rows = RowsOf<double>;
using Known = RowsOf<const double>;

// Subtracts from `count` rows of `right` the multiples of the first `known` rows of
// `source`, in the columns from begin to end. The factors stand in as many rows of
// `factor`, from its first column on. With a corner, the rows are then eliminated from
// each other.
template <std::size_t count, bool corner>
SWGJOINT_INLINE void reduce(Known factor, std::size_t known, const Corner* own,
                            Known source, Rows right, std::size_t begin, std::size_t end) {
  for (std::size_t k = begin; k < end; k += kLanes) {
    Lanes tile[count];
    for (std::size_t r = 0; r < count; ++r) {
      tile[r] = lanes_at(right.begin + r * right.stride + k);
    }
    for (std::size_t p = 0; p < known; ++p) {
      const Lanes upper = lanes_at(source.begin + p * source.stride + k);
      const double* factors = factor.begin + p * factor.stride;
      for (std::size_t r = 0; r < count; ++r) tile[r] -= factors[r] * upper;
    }
    if (corner) {
      SWGJOINT_UNROLL
      for (std::size_t p = 0; p < count; ++p) {
        tile[p] = own[p][p] * tile[p];
        SWGJOINT_UNROLL
        for (std::size_t r = p + 1; r < count; ++r) tile[r] -= own[p][r] * tile[p];
      }
    }
    for (std::size_t r = 0; r < count; ++r) {
      lanes_at(right.begin + r * right.stride + k) = tile[r];
    }
  }
}

// Square block of a matrix.
template <std::size_t count>
SWGJOINT_INLINE void copy_corner(const double* from, std::size_t from_stride, double* to,
                                 std::size_t to_stride) {
  for (std::size_t p = 0; p < count; ++p) {
    for (std::size_t r = 0; r < count; ++r) {
      to[p * to_stride + r] = from[p * from_stride + r];
    }
  }
}

// Factor of `count` unknowns from their matrix, in place; false if it is not positive
// definite.
template <std::size_t count>
SWGJOINT_INLINE bool factorise(Corner* own) {
  SWGJOINT_UNROLL
  for (std::size_t p = 0; p < count; ++p) {
    if (!(own[p][p] > 0.0)) return false;
    const double inverse = 1.0 / std::sqrt(own[p][p]);
    for (std::size_t c = 0; c < count; ++c) own[p][c] *= inverse;
    SWGJOINT_UNROLL
    for (std::size_t r = p + 1; r < count; ++r) {
      for (std::size_t c = 0; c < count; ++c) own[r][c] -= own[p][r] * own[p][c];
    }
    own[p][p] = inverse;
  }
  return true;
}

std::size_t aligned(std::size_t column) { return column / kLanes * kLanes; }

template <std::size_t count>
SWGJOINT_INLINE bool eliminate_rows(const PartialCholesky& matrix, std::size_t row) {
  const std::size_t stride = matrix.stride;
  const std::size_t begin = aligned(row), middle = aligned(row + count - 1) + kLanes;
  const Known all = {matrix.factor, stride}, factor = {matrix.factor + row, stride};
  const Rows rows = {matrix.factor + row * stride, stride};
  Corner own[count];
  reduce<count, false>(factor, row, nullptr, all, rows, begin, middle);
  copy_corner<count>(rows.begin + row, stride, own[0], kRows);
  if (!factorise<count>(own)) return false;
  reduce<count, true>(factor, 0, own, all, rows, begin, middle);
  copy_corner<count>(own[0], kRows, rows.begin + row, stride);
  reduce<count, true>(factor, row, own, all, rows, middle, stride);
  return true;
}

template <std::size_t count>
SWGJOINT_INLINE void forward_rows(const PartialCholesky& matrix, std::size_t row,
                                  double* right, std::size_t width) {
  const Known factor = {matrix.factor + row, matrix.stride};
  Corner own[count];
  copy_corner<count>(factor.begin + row * factor.stride, factor.stride, own[0], kRows);
  reduce<count, true>(factor, row, own, {right, width}, {right + row * width, width}, 0,
                      width);
}

template <std::size_t count>
SWGJOINT_INLINE void backward_rows(const PartialCholesky& matrix, std::size_t row,
                                   double* values, std::size_t width) {
  const std::size_t size = matrix.pivots + matrix.rest, stride = matrix.stride;
  const double* factor = matrix.factor + row * stride;
  for (std::size_t k = 0; k < width; k += kLanes) {
    Lanes tile[count];
    double* own = values + row * width + k;
    for (std::size_t r = 0; r < count; ++r) tile[r] = lanes_at(own + r * width);
    for (std::size_t j = row + count; j < size; ++j) {
      const Lanes known = lanes_at(values + j * width + k);
      const double* column = factor + j;
      for (std::size_t r = 0; r < count; ++r) tile[r] -= column[r * stride] * known;
    }
    SWGJOINT_UNROLL
    for (std::size_t q = 0; q < count; ++q) {
      const std::size_t p = count - 1 - q;
      const double* column = factor + row + p;
      tile[p] = column[p * stride] * tile[p];
      SWGJOINT_UNROLL
      for (std::size_t r = 0; r < p; ++r) tile[r] -= column[r * stride] * tile[p];
    }
    for (std::size_t r = 0; r < count; ++r) lanes_at(own + r * width) = tile[r];
  }
}

// The same for a single column.
template <std::size_t count>
SWGJOINT_INLINE void backward_rows(const PartialCholesky& matrix, std::size_t row,
                                   double* values) {
  const std::size_t stride = matrix.stride, next = row + count;
  const std::size_t known = matrix.pivots + matrix.rest - next;
  const double* factor = matrix.factor + row * stride;
  double own[count];
  for (std::size_t r = 0; r < count; ++r) {
    own[r] = values[row + r] -
             sum_of_products(factor + r * stride + next, values + next, known);
  }
  SWGJOINT_UNROLL
  for (std::size_t q = 0; q < count; ++q) {
    const std::size_t p = count - 1 - q;
    const double* column = factor + row + p;
    own[p] *= column[p * stride];
    SWGJOINT_UNROLL
    for (std::size_t r = 0; r < p; ++r) own[r] -= column[r * stride] * own[p];
  }
  for (std::size_t r = 0; r < count; ++r) values[row + r] = own[r];
}

}  // namespace

SWGJOINT_WIDE bool eliminate_first(const PartialCholesky& matrix) {
  const std::size_t pivots = matrix.pivots, rest = matrix.rest;
  bool definite = true;
  by_blocks(pivots, [&](std::size_t row, auto count) SWGJOINT_INLINED {
    definite = definite && eliminate_rows<count>(matrix, row);
  });
  if (!definite) return false;
  const Known source = {matrix.factor + pivots, matrix.stride};
  by_blocks(rest, [&](std::size_t row, auto count) SWGJOINT_INLINED {
    const Rows right = {matrix.schur + row * matrix.rest_stride, matrix.rest_stride};
    reduce<count, false>({source.begin + row, source.stride}, pivots, nullptr, source,
                         right, aligned(row), rest);
  });
  return true;
}

SWGJOINT_WIDE void forward(const PartialCholesky& matrix, double* right,
                           std::size_t width) {
  const std::size_t pivots = matrix.pivots;
  by_blocks(pivots, [&](std::size_t row, auto count) SWGJOINT_INLINED {
    forward_rows<count>(matrix, row, right, width);
  });
  const double* factor = matrix.factor + pivots;
  double* rest = right + pivots * width;
  by_blocks(matrix.rest, [&](std::size_t row, auto count) SWGJOINT_INLINED {
    reduce<count, false>({factor + row, matrix.stride}, pivots, nullptr, {right, width},
                         {rest + row * width, width}, 0, width);
  });
}

SWGJOINT_WIDE void backward(const PartialCholesky& matrix, double* values,
                            std::size_t width) {
  by_blocks(matrix.pivots, [&](std::size_t row, auto count) SWGJOINT_INLINED {
    backward_rows<count>(matrix, matrix.pivots - row - count, values, width);
  });
}

SWGJOINT_WIDE void backward_one(const PartialCholesky& matrix, double* values) {
  by_blocks(matrix.pivots, [&](std::size_t row, auto count) SWGJOINT_INLINED {
    backward_rows<count>(matrix, matrix.pivots - row - count, values);
  });
}

SWGJOINT_WIDE void minus_products(const double* x, std::size_t rows, std::size_t width,
                                  double* products) {
  std::fill(products, products + width * width, 0.0);
  for (std::size_t row = 0; row < width; row += kRows) {
    reduce<kRows, false>({x + row, width}, rows, nullptr, {x, width},
                         {products + row * width, width}, row, width);
  }
}

}  // namespace swgjoint
