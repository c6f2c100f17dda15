// Potential map of one drive: V(torsion, angles) and its discrete gradient.
// The same law as swgjoint/maps/drive_map.py; formulas in README.md.
#ifndef SWGJOINT_PLUGIN_DRIVE_MAP_H_
#define SWGJOINT_PLUGIN_DRIVE_MAP_H_

#include <string>
#include <vector>

// A second version of the inner loop, chosen at run time.
#if defined(__GNUC__) && defined(__x86_64__)
#define SWGJOINT_AVX2
#endif

namespace swgjoint {

// Text attributes of an instance, as they stand in the model.
struct DriveText {
  const char* ratio;
  const char* orders;
  const char* knots;
  const char* potential;
  const char* end_stiffness;
  const char* kinematic_error;
};

// Reads a whole string of numbers; returns false unless every character is used
// and every number is finite.
bool ParseNumbers(const char* text, std::vector<double>* out);

// V and its derivatives at one state (Gradient) or over one step (Secant).
struct DriveValue {
  double g_theta = 0, g_psi = 0;  // d(torsion)/d(theta, psi)
  double torque = 0;              // dV/d(torsion) at fixed angles [N m]
  double slope = 0;               // d(torque)/d(torsion at the end of the step)
  double stiffness_begin = 0, stiffness_end = 0;  // d2V/d(torsion)2 [N m/rad]
  double e_theta = 0, e_psi = 0;  // dV/d(theta, psi) at fixed torsion [N m]
};

class DriveMap {
 public:
  static constexpr int kLanes = 4;            // harmonics side by side
  static constexpr int kBlock = 10 * kLanes;  // A0, B0, .. A4, B4 of them
  // weights of A and B of them in the mean, in the secants by theta and by psi
  static constexpr int kWeights = 6 * kLanes;

  // On failure returns false and says in `error` which attribute is wrong.
  bool Parse(const DriveText& text, std::string* error);

  double ratio() const { return ratio_; }
  double top_order() const { return top_order_; }  // per turn of the rotor

  // From the next Begin or Gradient on: V times `potential`, e0 times `error`, and
  // both where rotor and link stand further by the two angles.
  void Vary(double potential, double error, double theta, double psi) {
    scale_ = potential;
    error_scale_ = error;
    shift_theta_ = theta;
    shift_psi_ = psi;
  }

  // Gradient of V at one state.
  void Gradient(double theta, double psi, DriveValue* out);

  // Sets the state from which the following Secant calls step.
  void Begin(double theta, double psi);
  double torsion() const { return torsion_; }  // at that state

  // Discrete gradient from the begin state to begin + (dtheta, dpsi):
  // (torque g + e) . (dtheta, dpsi) is the change of V, to round-off.
  void Secant(double dtheta, double dpsi, DriveValue* out);

 private:
  // How cos and sin of one harmonic follow from those of earlier ones.
  struct Recipe {
    int a = -1, b = -1;  // harmonics whose phases add; a < 0: call sin and cos
    double sign = 1;     // phase = phase_a + sign * phase_b
  };

  void FindRecipes();
  int Segment(double torsion) const;
  int SegmentNear(int guess, double torsion) const;
  void HalfStep(double dtheta, double dpsi);
  template <bool kPsi, bool kSmall>
  void Sweep(double dtheta, double dpsi, DriveValue* out);
  void WeighInline(double dtheta, double dpsi, DriveValue* out);
  void Weigh(double dtheta, double dpsi, DriveValue* out);
#ifdef SWGJOINT_AVX2
  void WeighAvx2(double dtheta, double dpsi, DriveValue* out);
  bool avx2_ = false;
#endif
  void Work(int j1, double x1, DriveValue* out) const;
  void Rotate(double theta, double psi);
  void Combine(int segment, const double* weight, double out[5]) const;

  int n_ = 0;         // harmonics, the mean included
  int blocks_ = 0;    // of kLanes harmonics without the mean, zeros at the end
  int segments_ = 0;  // intervals between knots and the two continuations
  bool moves_psi_ = false;  // whether a harmonic depends on psi
  double ratio_ = 1;
  double scale_ = 1, error_scale_ = 1, shift_theta_ = 0, shift_psi_ = 0;  // Vary
  double top_theta_ = 0, top_psi_ = 0;  // largest orders
  double top_order_ = 0;                // largest |n_theta + n_psi/ratio|
  std::vector<double> knots_;
  std::vector<double> base_;   // (segments) torsion about which a segment expands
  std::vector<double> low_, high_;  // (segments) open interval of a segment
  std::vector<double> mean_;        // (segments, 5): A0, .. A4 of the mean
  std::vector<double> table_;       // (segments, blocks, kBlock)
  double error_mean_ = 0;
  // per harmonic without the mean, padded to whole blocks
  std::vector<double> n_theta_, n_psi_;
  std::vector<double> error_c_, error_s_;  // amplitudes of cos and sin in e0
  std::vector<Recipe> recipe_;

  // begin state
  double torsion_ = 0, d0_ = 0;
  int j0_ = 0;  // segment; between steps the first guess, which changes no result
  std::vector<double> c_, s_;  // cos and sin of the phases

  // step; sized beforehand, so that nothing is allocated
  std::vector<double> sinc_, ch_;  // of half the phase step: sin(eta)/eta, cos(eta)
  std::vector<double> weight_;     // (blocks, kWeights)
  double w_[5] = {}, u_theta_[5] = {}, u_psi_[5] = {};  // their sums in segment j0
};

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_DRIVE_MAP_H_
