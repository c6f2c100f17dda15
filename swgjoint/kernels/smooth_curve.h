// Smooth curves of a tooth profile, quintic over the arc length.
//
// Compiled version of swgjoint/gear/teeth/smooth_curve.py, which explains the method.
// Lengths are in metres.

#ifndef SWGJOINT_KERNELS_SMOOTH_CURVE_H_
#define SWGJOINT_KERNELS_SMOOTH_CURVE_H_

#include <cstddef>
#include <vector>

#include "vec.h"

namespace swgjoint {

class SmoothCurve {
 public:
  // stations: arc lengths of the nodes (intervals + 1,); coefficients (intervals, 6, 2)
  // from the constant upwards; side: +1 for external, -1 for internal teeth
  SmoothCurve(const double* stations, const double* coefficients, std::size_t intervals,
              double side);

  // Point, normal and curvature at an arc length from the start of the curve.
  At evaluate(double s) const;

  // Distance along the normal at the foot of a point; inside: whether the foot is a
  // perpendicular one.
  double project(Vec point, Vec* normal, double* curvature, bool* inside) const;

 private:
  // Point at an arc length and its first two derivatives.
  void derivatives(double s, Vec* value, Vec* first, Vec* second) const;

  std::vector<double> stations_, coefficients_;
  // where the search for a foot may start: arc lengths and points
  std::vector<double> coarse_;
  std::vector<Vec> coarse_points_;
  double side_;
};

// Index of the interval, between n increasing breaks, that contains s. The first and
// the last interval also contain the values beyond the breaks.
std::size_t interval_of(const double* breaks, std::size_t n, double s);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_SMOOTH_CURVE_H_
