// Condensed system of one Newton step of the 2D model.
//
// Compiled twin of NewtonProblem in swgjoint/fe/plane/newton_step.py without friction and
// of solve_mixed in swgjoint/fe/common/complementarity.py, which explain the method.

#ifndef SWGJOINT_KERNELS_CONTACT_STEP_H_
#define SWGJOINT_KERNELS_CONTACT_STEP_H_

#include <cstddef>

namespace swgjoint {

// Lines of force (n) and constraints of the system.
struct ContactStep {
  std::size_t lines;
  const double *gap, *arm;   // gaps without tooth forces and lever arms (n,)
  const double* compliance;  // of teeth and indentation (n, n)
  double anchor_stiffness;
  double moment;    // residual moment on the circular spline
  double rotation;  // rotation of the flexspline minus the prescribed one
  bool turns;       // whether the circular spline turns
  bool held;        // whether the rotation of the flexspline is prescribed
};

// Solves the system, given the products (n + 3, n + 3) of the compliance of the ring with
// minus the gradient, the constraints and the lines. active: guess on input (n,); result:
// forces, force of the anchor, rotation and multiplier (n + 3,). False if a set of active
// contacts is singular or none is found.
bool solve_contact_step(const ContactStep& step, const double* products, bool* active,
                        double* result, double* output_compliance);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_CONTACT_STEP_H_
