// Distance of points from the outline of a wave generator.
//
// Compiled twins of signed_distance in swgjoint/gear/wave_generators/ellipse.py and
// simplified.py, which explain the methods.

#ifndef SWGJOINT_KERNELS_OUTLINE_H_
#define SWGJOINT_KERNELS_OUTLINE_H_

#include <cstddef>

#include "vec.h"

namespace swgjoint {

// An ellipse, or two semicircles joined by straight lines. The major axis is the y axis.
struct Outline {
  bool elliptical;
  double major;  // semi-major axis
  double minor;  // semi-minor axis of the ellipse, radius of the semicircles
};

// Distance of a point, positive outside, with normal and curvature at its foot.
struct Nearest {
  double gap;
  Vec normal;
  double curvature;
};

Nearest nearest(const Outline& outline, Vec point);

// points: (n, 2); result: (n, 4) of distance, normal x, y, curvature at the foot.
void outline_distance(const double* points, std::size_t n, const Outline& outline,
                      double* result);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_OUTLINE_H_
