// Contact of the bore of a flexspline with the outer race of the bearing.
//
// The compiled twin of PlaneRace._numpy_contact in swgjoint/fe/plane/race.py, which
// explains the method.

#ifndef SWGJOINT_KERNELS_RACE_H_
#define SWGJOINT_KERNELS_RACE_H_

#include <cstddef>

namespace swgjoint {

// Race elements of Hermite cubics below the bore nodes of all sectors.
struct Race {
  std::size_t elements;    // of the whole ring
  std::size_t per_sector;  // elements of a sector
  std::size_t nodes;       // bore nodes of a sector
  const double* places;    // position of each bore node, in elements (nodes,)
  const double* press;     // contact stiffness of each bore node (nodes,)
  double half_thickness;

  // Coordinates of a sector: its bore nodes, then its race nodes with both faces.
  std::size_t width() const { return 2 * nodes + 4 * (per_sector + 1); }
};

// Gaps (count, nodes), normals (count, nodes, 2) and their derivatives by the coordinates
// (count, nodes, width). Adds the energy gradient (count, width) and its derivative
// (count, width, width) of the nodes that touch. q: coordinates of the race (elements, 4).
void race_contact(const Race& race, const double* q, const double* points,
                  const bool* touching, std::size_t count, double* gap, double* normal,
                  double* rows, double* gradient, double* hessian);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_RACE_H_
