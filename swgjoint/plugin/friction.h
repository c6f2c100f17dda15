// Friction between two members: an elasto-plastic bristle and a viscous part.
// It implements the same law as swgjoint/maps/friction.py; README.md has the formulas.
#ifndef SWGJOINT_PLUGIN_FRICTION_H_
#define SWGJOINT_PLUGIN_FRICTION_H_

#include <vector>

namespace swgjoint {

// Friction in one step of the scheme: torque = force + h metric dnu.
struct FrictionStep {
  double stretch = 0, reach = 0;  // stretch of the bristle at the begin, and its limit
  double force = 0, metric = 0;   // terms that the engine receives
  double offset = 0, rate = 0;    // torque of the bristle alone: offset + rate dx
};

class Friction {
 public:
  // Reads "b_theta b_psi stiffness damping coulomb static stribeck viscous load".
  bool Parse(const std::vector<double>& list);

  // Multiplies all torques of the law by `scale` > 0; the stretch at slip is unchanged.
  void Scale(double scale) {
    stiffness_ = scale * own_stiffness_;
    damping_ = scale * own_damping_;
    viscous_ = scale * own_viscous_;
  }

  double b_theta() const { return b_theta_; }
  double b_psi() const { return b_psi_; }

  // Largest stretch at a relative speed and a torque along the torsion.
  double Reach(double speed, double torque) const;

  // Torque at one state; x is the rotation from the angle where the bristle is relaxed.
  double Torque(double x, double reach, double speed) const;

  // Solves the predicted step, in which the speed changes by `free` without friction
  // and by -response per unit of friction torque. Returns the friction torque.
  double Solve(double h, double speed, double free, double response,
               FrictionStep* step) const;

  // Stretch after a rotation dx. The bristle slips at its reach and stores no more
  // energy than the step supplied.
  double After(const FrictionStep& step, double dx) const;

 private:
  double b_theta_ = 0, b_psi_ = 0;  // relative rotation by (theta, psi)
  double own_stiffness_ = 1, own_damping_ = 0, own_viscous_ = 0;  // before scaling
  double stiffness_ = 1, damping_ = 0, viscous_ = 0;              // scaled
  double coulomb_ = 0, static_ = 0, stribeck_ = 1, load_ = 0;
};

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_FRICTION_H_
