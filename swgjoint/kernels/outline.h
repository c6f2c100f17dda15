// Distance of points from the outline of a wave generator.
//
// Compiled twins of signed_distance in swgjoint/gear/wave_generators/ellipse.py,
// simplified.py, chain.py and radial.py, which explain the methods.

#ifndef SWGJOINT_KERNELS_OUTLINE_H_
#define SWGJOINT_KERNELS_OUTLINE_H_

#include <cstddef>
#include <optional>

#include "chain.h"
#include "radial.h"
#include "vec.h"

namespace swgjoint {

// An ellipse, two semicircles joined by straight lines, a chain of pieces, or a radius
// over the polar angle. The major axis is the y axis.
class Outline {
 public:
  // rows: (n, kColumns), see ClosedCurve.rows; n > 0
  Outline(const double* rows, std::size_t n);

  Nearest nearest(Vec point) const;
  // The same for n points, with the same bits; faster for an ellipse.
  void nearest(const Vec* points, std::size_t n, Nearest* feet) const;

 private:
  Kind kind_;
  double major_;  // semi-major axis
  double minor_;  // semi-minor axis of the ellipse, radius of the semicircles
  std::optional<Chain> chain_;
  std::optional<Radial> radial_;
};

// points: (n, 2); result: (n, 4) of distance, normal x, y, curvature at the foot.
void outline_distance(const double* points, std::size_t n, const Outline& outline,
                      double* result);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_OUTLINE_H_
