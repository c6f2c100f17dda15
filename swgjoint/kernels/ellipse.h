// Distance of points from an ellipse.
//
// The compiled twin of Elliptical.signed_distance in
// swgjoint/gear/wave_generators/ellipse.py, which explains the method.

#ifndef SWGJOINT_KERNELS_ELLIPSE_H_
#define SWGJOINT_KERNELS_ELLIPSE_H_

#include <cstddef>

namespace swgjoint {

// points: (n, 2); result: (n, 4) of distance, normal x, y, curvature at the foot.
// major and minor semi-axis; the major one is the y axis.
void ellipse_distance(const double* points, std::size_t n, double major, double minor,
                      double* result);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_ELLIPSE_H_
