// Forces and tangents of the elements of an elastic ring of Hermite cubics, and points
// that face it.
//
// The compiled twins of HermiteRing.forces in swgjoint/fe/rings/hermite_ring.py and of
// distances_to_ring in swgjoint/fe/rings/facing.py.

#ifndef SWGJOINT_KERNELS_HERMITE_RING_H_
#define SWGJOINT_KERNELS_HERMITE_RING_H_

#include <cstddef>
#include <cstdint>

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

// Feet of the perpendiculars from n points (n, 2), distances and derivatives, see Facing.
struct FacingArrays {
  double* place;          // (n,)
  std::int64_t* element;  // (n,)
  double* distance;       // (n,)
  double* normal;         // (n, 2)
  double* tangent;        // (n, 2)
  double* by_ring;        // (n, 3, 8)
  double* curvature;      // (n,)
};

// Coordinates q (elements, 2, 2) of the ring, initial guesses of the feet (n,), and the
// elements on whose cubics they are sought (n,) or null.
void face_ring(const double* q, std::size_t elements, const double* points,
               const double* start, const std::int64_t* own, bool inside, std::size_t n,
               const FacingArrays& out);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_HERMITE_RING_H_
