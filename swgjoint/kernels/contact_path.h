// Contact changes of a linearised drive over the torque.
//
// Compiled version of Influence._followed in swgjoint/fe/common/influence.py, which
// explains the method.

#ifndef SWGJOINT_KERNELS_CONTACT_PATH_H_
#define SWGJOINT_KERNELS_CONTACT_PATH_H_

#include <cstddef>
#include <cstdint>
#include <vector>

namespace swgjoint {

// A complementarity problem of n contacts whose offset is linear in the torque.
struct PathProblem {
  std::size_t n;
  const double* matrix;     // (n, n)
  const double* slack;      // (n,), offset at the start
  const double* by_torque;  // (n,), change of the offset per torque, along the path
  const double* by_value;   // (n,), change of the output per unknown
};

// One change on the path: the contact, the torque from the start, and the change of the
// output per torque by the unknowns before it.
struct PathChange {
  std::int64_t contact;
  double away, slope;
};

// The changes within a reach, at most as many as stated; slope: that after the last one.
// False if the active contacts become singular.
bool follow_path(const PathProblem& problem, double reach, std::size_t most,
                 std::vector<PathChange>* changes, double* slope);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_CONTACT_PATH_H_
