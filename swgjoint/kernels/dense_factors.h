// Small dense systems, for the problems of complementarity.h. Matrices are stored row by
// row. The results have the same bits on every machine.

#ifndef SWGJOINT_KERNELS_DENSE_FACTORS_H_
#define SWGJOINT_KERNELS_DENSE_FACTORS_H_

#include <cstddef>
#include <vector>

#include "eight_lanes.h"

namespace swgjoint {

// y += a[0] x[0] + a[1] x[1] + ..., one product after another; the arrays have n numbers.
void add_columns(double* y, const double* const* x, const double* a, std::size_t count,
                 std::size_t n);

// y[r] += sign times the scalar product of row r with x (n,); a row begins stride numbers
// after the one before it.
void add_products(double* y, double sign, const double* rows, std::size_t count,
                  std::size_t stride, const double* x, std::size_t n);

// c -= a b for matrices c (count, width), a (count, inner) and b (inner, width). Rows of
// c and b begin stride numbers after the one before; width is a multiple of kLanes.
void subtract_product(double* c, const double* a, const double* b, std::size_t count,
                      std::size_t inner, std::size_t width, std::size_t stride);

// LU factors of the first columns of a matrix (rows, width), with partial pivoting. The
// columns after the first rows ones are replaced by their solutions. A row begins stride
// numbers after the one before it, at least width + kPadding, and the numbers between are
// zero. False if the matrix is singular.
constexpr std::size_t kPadding = 7;
bool eliminate(double* matrix, std::size_t rows, std::size_t width, std::size_t stride,
               std::size_t* pivots);

// Replace one right-hand side by its solution, given the factors (rows, rows), one column
// after another.
void substitute(const double* factors, const std::size_t* pivots, std::size_t rows,
                double* right);

// LU factors of kLanes matrices at once, without pivoting, for matrices that are nearly
// symmetric or whose symmetric part is positive definite. The numbers of all matrices at
// the same place follow one another and begin at a multiple of their size in memory. A
// row begins stride places after the one before it. The diagonal becomes its inverse.
void eliminate_lanes(double* matrices, std::size_t rows, std::size_t stride);

// Replace one right-hand side of each matrix by its solution.
void substitute_lanes(const double* factors, std::size_t rows, std::size_t stride,
                      double* right);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_DENSE_FACTORS_H_
