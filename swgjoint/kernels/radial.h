// Distance of points from an outline given by its radius over the polar angle.
//
// Compiled twin of signed_distance in swgjoint/gear/wave_generators/radial.py, which
// explains the method.

#ifndef SWGJOINT_KERNELS_RADIAL_H_
#define SWGJOINT_KERNELS_RADIAL_H_

#include <cstddef>
#include <vector>

#include "chain.h"
#include "vec.h"

namespace swgjoint {

// A cosine or a periodic cubic spline. The polar angle is zero on the y axis.
class Radial {
 public:
  // rows: (n, kColumns), one row of a cosine, or one per interval of a spline
  Radial(const double* rows, std::size_t n);

  Nearest nearest(Vec point) const;

 private:
  struct Radius {
    double value, slope, bend;  // and its derivatives by the angle
  };

  Radius radius(double angle) const;
  // Foot at a polar angle, and how far along the tangent a point lies from it
  At at(double angle, Vec point, double* along, double* speed) const;
  // Newton's method for the polar angle of the foot
  Nearest from(double angle, Vec point, double* bend) const;
  // Polar angle of the sample of the outline that is nearest to a point
  double nearest_sample(Vec point) const;

  double mean_ = 0.0, swing_ = 0.0, lobes_ = 0.0;  // of a cosine
  std::vector<double> starts_;                     // of the intervals of a spline
  std::vector<double> powers_;                     // coefficients (n, 4), cubic first
};

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_RADIAL_H_
