// Friction between two members: an elasto-plastic bristle and a viscous part.
// It implements the same law as swgjoint/maps/friction.py; README.md has the formulas.
#ifndef SWGJOINT_PLUGIN_FRICTION_H_
#define SWGJOINT_PLUGIN_FRICTION_H_

#include <vector>

#include "lanes.h"

namespace swgjoint {

// Friction in one step of the scheme. The torque is force + h metric dnu, where dnu is
// the change of the relative speed; dx is the relative rotation during the step.
struct FrictionStep {
  double stretch = 0, reach = 0;  // stretch of the bristle at the start, and its limit
  double force = 0, metric = 0;   // terms that the engine receives
  double offset = 0, rate = 0;    // torque of the bristle alone: offset + rate dx
};

class Friction {
 public:
  // Takes "b_theta b_psi stiffness damping coulomb static stribeck viscous load" in
  // this order; returns false if a number is invalid.
  bool Parse(const std::vector<double>& list);

  // Scales all torques of the law as parsed by `scale` > 0; the stretch at which the
  // bristle slips does not change.
  void Scale(double scale) {
    stiffness_ = scale * own_stiffness_;
    damping_ = scale * own_damping_;
    viscous_ = scale * own_viscous_;
  }

  // Relative rotation by (theta, psi).
  Pair b() const { return Pair{b_theta_, b_psi_}; }

  // Largest stretch [rad] at a relative speed and a torque along the torsion.
  double Reach(double speed, double torque) const;

  // Torque at one state; x is the rotation from where the bristle is relaxed, and
  // `slipped` states whether it slipped in the step of the scheme that led there.
  double Torque(double x, double reach, double speed, bool slipped) const;

  // Solves the predicted step, in which the speed changes by `free` without friction
  // and by -response per unit of friction torque. Returns the friction torque.
  double Solve(double h, double speed, double free, double response,
               FrictionStep* step) const;

  // Stretch after a rotation dx. The bristle slips at its reach and stores at most its
  // previous energy plus the work of the step.
  double After(const FrictionStep& step, double dx) const;

 private:
  double b_theta_ = 0, b_psi_ = 0;  // relative rotation by (theta, psi)
  double own_stiffness_ = 1, own_damping_ = 0, own_viscous_ = 0;  // before scaling
  double stiffness_ = 1, damping_ = 0, viscous_ = 0;              // scaled
  double coulomb_ = 0, static_ = 0, stribeck_ = 1, load_ = 0;
};

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_FRICTION_H_
