// Eight numbers that undergo the same operations.

#ifndef SWGJOINT_KERNELS_EIGHT_LANES_H_
#define SWGJOINT_KERNELS_EIGHT_LANES_H_

#include <cstddef>
#include <type_traits>

#include "wide.h"

namespace swgjoint {

constexpr std::size_t kLanes = 8;
// n rounded up to a multiple of kLanes
inline std::size_t padded(std::size_t n) { return (n + kLanes - 1) / kLanes * kLanes; }

// kLanes numbers, which compilers with vector types keep in one or more registers.
#if defined(__GNUC__)
typedef double Lanes __attribute__((vector_size(64), aligned(8), may_alias));
SWGJOINT_INLINE void invert(Lanes* x) { *x = 1.0 / *x; }
#else
struct Lanes {
  double v[8];
  Lanes& operator+=(const Lanes& other) {
    for (int k = 0; k < 8; ++k) v[k] += other.v[k];
    return *this;
  }
  Lanes& operator-=(const Lanes& other) {
    for (int k = 0; k < 8; ++k) v[k] -= other.v[k];
    return *this;
  }
};
inline Lanes operator*(double a, Lanes x) {
  for (int k = 0; k < 8; ++k) x.v[k] *= a;
  return x;
}
inline Lanes operator*(const Lanes& a, Lanes x) {
  for (int k = 0; k < 8; ++k) x.v[k] *= a.v[k];
  return x;
}
inline void invert(Lanes* x) {
  for (int k = 0; k < 8; ++k) x->v[k] = 1.0 / x->v[k];
}
#endif

// The numbers that begin at an address.
SWGJOINT_INLINE Lanes& lanes_at(double* first) { return *reinterpret_cast<Lanes*>(first); }
SWGJOINT_INLINE const Lanes& lanes_at(const double* first) {
  return *reinterpret_cast<const Lanes*>(first);
}

constexpr std::size_t kRows = 8;  // rows of a tile that stays in registers

// Calls act(row, size) for blocks of rows, whose sizes are constants.
template <typename Act>
SWGJOINT_INLINE void by_blocks(std::size_t rows, Act act) {
  std::size_t row = 0;
  for (; row + kRows <= rows; row += kRows) {
    act(row, std::integral_constant<std::size_t, kRows>());
  }
  for (; row + 4 <= rows; row += 4) act(row, std::integral_constant<std::size_t, 4>());
  for (; row < rows; ++row) act(row, std::integral_constant<std::size_t, 1>());
}

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_EIGHT_LANES_H_
