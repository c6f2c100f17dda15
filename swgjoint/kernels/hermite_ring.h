// Forces and tangents of the elements of an elastic ring of Hermite cubics.
//
// The compiled twin of HermiteRing.forces in swgjoint/fe/rings/hermite_ring.py.

#ifndef SWGJOINT_KERNELS_HERMITE_RING_H_
#define SWGJOINT_KERNELS_HERMITE_RING_H_

#include <cstddef>

namespace swgjoint {

// Number of Gauss points of an element.
constexpr std::size_t kGauss = 3;

// A ring's element: its length in the undeformed ring, axial and bending stiffness times
// the weights of the Gauss points (2, kGauss), and the first two derivatives of the four
// shape functions there (kGauss, 2, 4).
struct RingElement {
  double step;
  const double* stiffness;
  const double* shapes;
};

// Gradients (n, 8) and Hessians (n, 8, 8) of n elements. `derivatives` are the first two
// of the position (n, kGauss, 2, 2), hoop and moment the forces of stretch and curvature
// times the weights (n, kGauss), and turning the curvature (n, kGauss).
void ring_forces(const RingElement& element, const double* derivatives,
                 const double* hoop, const double* moment, const double* turning,
                 std::size_t n, double* gradient, double* hessian);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_HERMITE_RING_H_
