// Symmetric banded matrices of many small parts, factorised without pivoting.
//
// The compiled twin of BandedAssembly.solve in swgjoint/fe/rings/assembly.py.

#ifndef SWGJOINT_KERNELS_BANDED_H_
#define SWGJOINT_KERNELS_BANDED_H_

#include <cstddef>
#include <cstdint>

namespace swgjoint {

// Add the lower halves of n matrices (n, m, m) at the rows (n, m) of a matrix. Its
// column j begins at number j width with the entry of the diagonal.
void add_banded(const std::int64_t* rows, const double* parts, std::size_t n,
                std::size_t m, std::size_t width, double* columns);

// Replace a positive definite matrix (size, width) by its factors L D L^T and the loads
// (size, count) by the solutions; false if a pivot is not positive.
bool solve_banded(double* columns, std::size_t size, std::size_t width, double* loads,
                  std::size_t count);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_BANDED_H_
