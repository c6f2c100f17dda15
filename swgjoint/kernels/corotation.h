// Forces and tangents of corotational sectors.
//
// Compiled twin of swgjoint/fe/plane/corotation.py, which explains the method, and of
// the first part of linearise in linearise.py. A sector has nodes skeleton nodes and
// m = 2 nodes coordinates.

#ifndef SWGJOINT_KERNELS_COROTATION_H_
#define SWGJOINT_KERNELS_COROTATION_H_

#include <cstddef>
#include <cstdint>

namespace swgjoint {

// Condensed sector, by the attributes of Superelement.
struct Sector {
  std::size_t nodes, face, slopes, flank;  // flank: degrees of freedom of both flanks
  const double* skeleton;                  // (nodes, 2)
  const double* stiffness;                 // (m, m)
  const double* turning_parts;             // (6, m, m)
  const double* rim_slopes;                // (slopes, m)
  const double* elongation;                // (m,)
  const double* flank_from_skeleton;       // (flank, m)
  const double* flank_compliance;          // (flank, flank)
};

// Kinematics and results of count sectors, by the attributes of Frames and Linearised.
struct Kinematics {
  double *angle, *gyration;                                            // (count,)
  double *position, *displacement, *deformation, *elongating, *spin;  // (count, m)
  double* flank;                                                       // (count, flank)
};

// Fills the kinematics and the tangent (count, n, n), and adds the gradient (count, n).
// place: angles in the undeformed ring (count,); positions (count, nodes, 2) in the
// global frame; force: tooth forces on the flanks (count, flank); dofs: degrees of freedom
// of the coordinates (m,). tangent: null to leave it out.
void sector_tangents(const Sector& sector, const double* place, const double* positions,
                     const double* force, const std::int64_t* dofs, std::size_t count,
                     std::size_t n, const Kinematics& result, double* gradient,
                     double* tangent);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_COROTATION_H_
