// Friction between two members: an elasto-plastic bristle and a viscous part.
// The same law as swgjoint/maps/friction.py; formulas in README.md.
#ifndef SWGJOINT_PLUGIN_FRICTION_H_
#define SWGJOINT_PLUGIN_FRICTION_H_

#include <vector>

namespace swgjoint {

// What one step of the scheme needs and does: torque = force + h metric dnu.
struct FrictionStep {
  double stretch = 0, reach = 0;  // of the bristle at the begin, and its limit
  double force = 0, metric = 0;   // handed to the engine
  double offset = 0, rate = 0;    // of the bristle alone: offset + rate dx
};

class Friction {
 public:
  // Reads "b_theta b_psi stiffness damping coulomb static stribeck viscous load".
  bool Parse(const std::vector<double>& list);

  // All torques of the law times `scale` > 0; where it slips stays the same.
  void Scale(double scale) {
    stiffness_ = scale * own_stiffness_;
    damping_ = scale * own_damping_;
    viscous_ = scale * own_viscous_;
  }

  double b_theta() const { return b_theta_; }
  double b_psi() const { return b_psi_; }

  // Largest stretch at a relative speed under a torque along the torsion.
  double Reach(double speed, double torque) const;

  // Torque at one state, x the rotation since the bristle was relaxed.
  double Torque(double x, double reach, double speed) const;

  // Solves the step that is predicted: the speed changes by `free` without friction
  // and by -response per torque. Returns the torque that it finds.
  double Solve(double h, double speed, double free, double response,
               FrictionStep* step) const;

  // Stretch after a rotation dx: slips, and stores no more than the step put in.
  double After(const FrictionStep& step, double dx) const;

 private:
  double b_theta_ = 0, b_psi_ = 0;  // relative rotation by (theta, psi)
  double own_stiffness_ = 1, own_damping_ = 0, own_viscous_ = 0;  // as given
  double stiffness_ = 1, damping_ = 0, viscous_ = 0;              // scaled
  double coulomb_ = 0, static_ = 0, stribeck_ = 1, load_ = 0;
};

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_FRICTION_H_
