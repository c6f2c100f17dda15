#include "hermite_ring.h"

#include <algorithm>
#include <cmath>

namespace swgjoint {
namespace {

// Force and tangent of one Gauss point with respect to (v, w), the first two derivatives
// of the position by the element parameter.
struct Point {
  double force[4];
  double tangent[4][4];
};

Point at_point(const double* v, const double* w, double h, double axial, double bending,
               double hoop, double moment, double turning) {
  Point out;
  const double square = v[0] * v[0] + v[1] * v[1], length = std::sqrt(square);
  const double by_v[2] = {w[1], -w[0]}, by_w[2] = {-v[1], v[0]};  // of v x w
  // gradients of stretch and curvature
  double s[4] = {}, k[4];
  for (int c = 0; c < 2; ++c) {
    s[c] = v[c] / (h * length);
    k[c] = (by_v[c] / h - 2.0 * turning * v[c]) / square;
    k[2 + c] = by_w[c] / (h * square);
  }
  // second derivatives of the stretch, then of the curvature
  const double twice = moment / (h * square), of_stretch = hoop / (h * length);
  const double along = 4.0 * moment * turning / square - 0.5 * of_stretch;
  double across[2];
  for (int c = 0; c < 2; ++c) {
    across[c] = along * v[c] / square - 2.0 * twice / square * by_v[c];
  }
  const double diagonal = of_stretch - 2.0 * moment * turning / square;
  const double cross[2][2] = {{0.0, twice}, {-twice, 0.0}};
  for (int c = 0; c < 4; ++c) {
    out.force[c] = hoop * s[c] + moment * k[c];
    for (int d = 0; d < 4; ++d) {
      out.tangent[c][d] = axial * s[c] * s[d] + bending * k[c] * k[d];
    }
  }
  for (int c = 0; c < 2; ++c) {
    out.tangent[c][c] += diagonal;
    for (int d = 0; d < 2; ++d) {
      out.tangent[c][d] += across[c] * v[d] + across[d] * v[c];
      const double mixed = -2.0 * twice / square * v[c] * by_w[d] + cross[c][d];
      out.tangent[c][2 + d] += mixed;
      out.tangent[2 + d][c] += mixed;
    }
  }
  return out;
}

}  // namespace

void ring_forces(const RingElement& element, const double* derivatives,
                 const double* hoop, const double* moment, const double* turning,
                 std::size_t n, double* gradient, double* hessian) {
  std::fill_n(gradient, 8 * n, 0.0);
  std::fill_n(hessian, 64 * n, 0.0);
  for (std::size_t e = 0; e < n; ++e) {
    double *own = gradient + 8 * e, *matrix = hessian + 64 * e;
    for (std::size_t g = 0; g < kGauss; ++g) {
      const std::size_t at = kGauss * e + g;
      const double *v = derivatives + 4 * at, *shapes = element.shapes + 8 * g;
      const Point p =
          at_point(v, v + 2, element.step, element.stiffness[g],
                   element.stiffness[kGauss + g], hoop[at], moment[at], turning[at]);
      // coordinate c of shape function a is number 2 a + c
      for (int a = 0; a < 4; ++a) {
        double by[2][4];  // of a change of the coordinate
        for (int c = 0; c < 2; ++c) {
          own[2 * a + c] += shapes[a] * p.force[c] + shapes[4 + a] * p.force[2 + c];
          for (int d = 0; d < 4; ++d) {
            by[c][d] = shapes[a] * p.tangent[c][d] + shapes[4 + a] * p.tangent[2 + c][d];
          }
        }
        for (int c = 0; c < 2; ++c) {
          double* row = matrix + 8 * (2 * a + c);
          for (int b = 0; b < 4; ++b) {
            for (int d = 0; d < 2; ++d) {
              row[2 * b + d] += by[c][d] * shapes[b] + by[c][2 + d] * shapes[4 + b];
            }
          }
        }
      }
    }
  }
}

}  // namespace swgjoint
