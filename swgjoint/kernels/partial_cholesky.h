// Elimination of the first unknowns of small symmetric systems, for ring_factor.h.
//
// Rows of matrices and of right-hand sides begin at multiples of kLanes numbers. Entries
// below a diagonal or behind the last column are unused. The results have the same bits
// on every machine.

#ifndef SWGJOINT_KERNELS_PARTIAL_CHOLESKY_H_
#define SWGJOINT_KERNELS_PARTIAL_CHOLESKY_H_

#include <cstddef>

namespace swgjoint {

// A matrix of pivots + rest unknowns, of which the first ones are eliminated.
struct PartialCholesky {
  std::size_t pivots, rest;
  std::size_t stride, rest_stride;  // distances of rows
  double* factor;                   // rows of the eliminated ones (pivots, stride)
  double* schur;                    // matrix of the others (rest, rest_stride)
};

// Eliminates the first unknowns, in place. The diagonal of the factor becomes its
// inverse. False if the matrix is not positive definite.
bool eliminate_first(const PartialCholesky& matrix);

// The same for right-hand sides (pivots + rest, width), in place.
void forward(const PartialCholesky& matrix, double* right, std::size_t width);

// Values of the eliminated unknowns, given those of the others (pivots + rest, width), in
// place.
void backward(const PartialCholesky& matrix, double* values, std::size_t width);

// The same for a single column without space between its values.
void backward_one(const PartialCholesky& matrix, double* values);

// products = - x^T x for x (rows, width) and products (width, width), of which only the
// upper triangle is written.
void minus_products(const double* x, std::size_t rows, std::size_t width,
                    double* products);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_PARTIAL_CHOLESKY_H_
