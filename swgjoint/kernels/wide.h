// Loops compiled for several widths of vectors, one of which is chosen when the library
// is loaded. All give the same bits: vectors hold independent sums, and products are not
// fused with sums. SWGJOINT_WIDE marks such a function, SWGJOINT_INLINE what it calls,
// SWGJOINT_INLINED its lambdas.

#ifndef SWGJOINT_KERNELS_WIDE_H_
#define SWGJOINT_KERNELS_WIDE_H_

#include <cstddef>
#include <cstring>

#if defined(__GLIBC__) && defined(__x86_64__) && defined(__GNUC__) && \
    !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define SWGJOINT_WIDE __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define SWGJOINT_WIDE
#endif
#if defined(__GNUC__)
#define SWGJOINT_INLINE inline __attribute__((always_inline))
#define SWGJOINT_INLINED __attribute__((always_inline))
#else
#define SWGJOINT_INLINE inline
#define SWGJOINT_INLINED
#endif

// Loops over tiles stay in registers only if they are unrolled.
#if defined(__GNUC__) && !defined(__clang__)
#define SWGJOINT_UNROLL _Pragma("GCC unroll 8")
#else
#define SWGJOINT_UNROLL
#endif

namespace swgjoint {

// Sum of products in four parts that do not wait for each other. Written with vectors,
// because compilers turn a loop over an array of parts into slow permutations.
SWGJOINT_INLINE double sum_of_products(const double* a, const double* b,
                                          std::size_t n) {
  std::size_t i = 0;
#if defined(__GNUC__)
  typedef double Four __attribute__((vector_size(32), aligned(8)));
  Four part = {0.0, 0.0, 0.0, 0.0};
  for (; i + 4 <= n; i += 4) {
    Four x, y;
    std::memcpy(&x, a + i, sizeof x);
    std::memcpy(&y, b + i, sizeof y);
    part += x * y;
  }
#else
  double part[4] = {0.0, 0.0, 0.0, 0.0};
  for (; i + 4 <= n; i += 4) {
    for (int k = 0; k < 4; ++k) part[k] += a[i + k] * b[i + k];
  }
#endif
  double sum = (part[0] + part[1]) + (part[2] + part[3]);
  for (; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_WIDE_H_
