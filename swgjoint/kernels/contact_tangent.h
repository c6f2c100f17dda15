// Second derivatives of tooth gaps, times minus their forces.
//
// Compiled twin of swgjoint/fe/plane/contact_tangent.py, which explains the method. A
// sector has m coordinates of its skeleton and 2 nodes flank nodes.

#ifndef SWGJOINT_KERNELS_CONTACT_TANGENT_H_
#define SWGJOINT_KERNELS_CONTACT_TANGENT_H_

#include <cstddef>
#include <cstdint>

namespace swgjoint {

// Kinematics of the sectors, by the attributes of Frames.
struct Turning {
  const double *angle, *spin, *position;  // (sectors,), (sectors, m), (sectors, m)
};

// Contacts that carry force, by the arguments of _add_products.
struct Loaded {
  std::size_t count;
  const std::int64_t *sector, *side;         // (count,)
  const double *weights, *slopes, *normal;   // (count, nodes) twice, (count, 2)
  const double *numbers, *force;             // (count, 6), (count,)
};

// Adds to the tangents (sectors, n, n). carried: displacement of the flank nodes
// (2, nodes, 2, m); dofs: degrees of freedom of the coordinates (m,).
void add_contact_tangents(const double* carried, std::size_t nodes, std::size_t m,
                          const Turning& turning, const Loaded& loaded,
                          const std::int64_t* dofs, std::size_t n, double* tangent);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_CONTACT_TANGENT_H_
