// Sums over the harmonics of a drive map, and stretches of its hysteresis elements.
//
// The compiled twins of the sums in swgjoint/maps/sums.py and of stretches and
// the yield curves in swgjoint/maps/hysteresis.py, which explain them. The results have
// the same bits: every operation, and the order in which numpy adds, is the same.

#ifndef SWGJOINT_KERNELS_MAP_SUMS_H_
#define SWGJOINT_KERNELS_MAP_SUMS_H_

#include <cstddef>
#include <cstdint>

namespace swgjoint {

// Kinematic error and its derivatives. phases: (n, h); amplitudes: (h, 2), cosine and
// sine; orders: (h, 2), derivatives of the phases by theta and psi; cos, sin: (n, h),
// of the phases; result: (3, n), e0 and its derivatives by theta and psi.
void error_sums(const double* phases, std::size_t n, std::size_t h,
                const double* amplitudes, const std::int64_t* orders, double* cos,
                double* sin, double* result);

// Numbers of waves: theta: (u), psi: (v), of which harmonic k has those of index
// which[2 k] and which[2 k + 1]; which: (h, 2).
struct WaveNumbers {
  const double *theta, *psi;
  const std::int64_t* which;
  std::size_t count_theta, count_psi;
};

// Polynomials of a map.
struct Pieces {
  const double* knots;  // (m + 1)
  const double* powers;  // (h, 2, m, 5), ascending powers of (torsion - knot)
  const double* ends;  // (h, 2, 2), second derivative below and above the knots
  std::size_t harmonics, intervals;
};

// Which rows of the result potential_sums computes.
struct Rows {
  bool torque, stiffness, by_phase;
};

// Derivatives of the potential. torsion: (n); cos, sin: (n, h); orders: (h, 2);
// result: (4, n), first and second derivative by the torsion, and derivatives by theta
// and psi through the phases. Rows that are not wanted are left as they are.
void potential_sums(const Pieces& map, const double* torsion, std::size_t n,
                    const double* cos, const double* sin, const std::int64_t* orders,
                    Rows rows, double* result);

// Stretch of an element that starts relaxed at zero. torsion, reach, result: (n).
void stretches(const double* torsion, const double* reach, std::size_t n,
               double* result);

// Yield torques that are piecewise linear in the elastic torque. first: (k + 1), the
// first point of each element; at, yields: (first[k]); stiffness: (k).
struct Yields {
  const std::int64_t* first;
  const double *at, *yields, *stiffness;
  std::size_t count;
};

// Yield torsions of all elements, and slopes of their yield torques. elastic: (n);
// reach, slope: (n, k).
void yield_torsions(const Yields& elements, const double* elastic, std::size_t n,
                    double* reach, double* slope);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_MAP_SUMS_H_
