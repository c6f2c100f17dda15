// Potential map of one drive: V(torsion, angles) and its discrete gradient.
// It implements the same law as swgjoint/maps/drive_map.py; README.md has the formulas.
#ifndef SWGJOINT_PLUGIN_DRIVE_MAP_H_
#define SWGJOINT_PLUGIN_DRIVE_MAP_H_

#include <algorithm>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "lanes.h"
#include "local_sums.h"

namespace swgjoint {

// Text attributes of an instance, as written in the model.
struct DriveText {
  const char* ratio;
  const char* orders;
  const char* knots;
  const char* potential;
  const char* end_stiffness;
  const char* kinematic_error;
};

// Start of a string that holds the bytes of little-endian doubles in base64.
constexpr char kBase64[] = "base64:";

// Reads a string of numbers, which are written in decimals or in base64. Returns false if
// the string is empty or contains anything other than finite numbers.
bool ParseNumbers(const char* text, std::vector<double>* out);

// V and its derivatives at one state (Gradient) or over one step (Secant).
struct DriveValue {
  Pair g = {};                    // d(torsion)/d(theta, psi)
  double torque = 0;              // dV/d(torsion) at fixed angles [N m]
  double slope = 0;               // d(torque)/d(torsion at the end of the step)
  double stiffness_begin = 0, stiffness_end = 0;  // d2V/d(torsion)2 [N m/rad]
  Pair e = {};                    // dV/d(theta, psi) at fixed torsion [N m]
};

// Mean of dV/d(torsion) between two torsions, at fixed angles.
struct MeanTorque {
  double torque, slope;  // mean, and its derivative by the second torsion
  Pair stiffness;        // d2V/d(torsion)2 at both
};

// Polynomial with coefficients w, and its derivative.
inline double Value(const double w[5], double d) {
  return w[0] + d * (w[1] + d * (w[2] + d * (w[3] + d * w[4])));
}
inline double Slope(const double w[5], double d) {
  return w[1] + d * (2 * w[2] + d * (3 * w[3] + d * 4 * w[4]));
}

// Sizes of what belongs to the harmonics that are processed together, a block:
struct BlockSizes {
  int lanes;  // number of harmonics
  // coefficients A0, B0, .. A4, B4 in one segment;
  constexpr int block() const { return 10 * lanes; }
  // A0, .. A4 of the mean in one segment, each with zeros in all lanes but the first;
  constexpr int mean() const { return 5 * lanes; }
  // orders in theta and psi, amplitudes of cos and sin in e0, and cos and sin of the
  // phases at the start state, of which the places begin at `phases`;
  constexpr int harmonics() const { return 6 * lanes; }
  constexpr int phases() const { return 4 * lanes; }
  // weights of A and B in the mean, and in the secants for theta and for psi.
  constexpr int weights() const { return 6 * lanes; }
};

// The mean torque between two torsions that belong to one polynomial of the potential,
// and its derivative by the second torsion.
SWGJOINT_INLINE MeanTorque Mean(const double w[5], const Pair& d) {
  // The torque is cubic, so that the trapezoidal rule with a correction by the end
  // derivatives is exact. It needs no difference of energies and remains accurate if
  // the torsions are close or equal.
  const double c2 = 2 * w[2], c3 = 3 * w[3], c4 = 4 * w[4];
  const Pair cubic = d * c4;
  const Pair stiffness = c2 + d * (2 * c3 + cubic * 3);
  const Pair torque = w[1] + d * (c2 + d * (c3 + cubic));
  const double step = d[1] - d[0], growth = stiffness[1] - stiffness[0];
  return {0.5 * (torque[0] + torque[1]) - step * (1. / 12) * growth,
          0.5 * stiffness[1] - growth * (1. / 12) -
              step * (1. / 6) * (c3 + 3 * cubic[1]),
          stiffness};
}
// Mean of the polynomial's values at two places.
SWGJOINT_INLINE double MeanValue(const double w[5], const Pair& d) {
  const Pair value = w[0] + d * (w[1] + d * (w[2] + d * (w[3] + d * w[4])));
  return 0.5 * (value[0] + value[1]);
}

class DriveMap {
 public:
  // On failure returns false and names the invalid attribute in `error`.
  bool Parse(const DriveText& text, std::string* error);

  // Whether the map has so many harmonics that its table exceeds the fastest cache.
  bool many() const { return size_.lanes == kWideLanes; }
  double ratio() const { return ratio_; }
  // Largest order of a harmonic, in cycles per rotor turn.
  double top_order() const { return top_order_; }

  // From the next Begin or Gradient on, V is multiplied by `potential` and e0 by
  // `error`, and both are evaluated at rotor and link angles increased by `theta` and
  // `psi`.
  void Vary(double potential, double error, double theta, double psi) {
    scale_ = potential;
    error_scale_ = error;
    shift_theta_ = theta;
    shift_psi_ = psi;
  }

  // Derivatives of V at one state.
  void Gradient(double theta, double psi, DriveValue* out);

  // Sets the start state of the following Secant calls.
  void Begin(double theta, double psi);
  double torsion() const { return torsion_; }  // at the start state

  // Discrete gradient from the start state to start + (dtheta, dpsi):
  // (torque g + e) . (dtheta, dpsi) equals the change of V up to round-off.
  void Secant(double dtheta, double dpsi, DriveValue* out);

  // The two parts of Secant: the sums over all harmonics with g, and all other values.
  void SumHarmonics(double dtheta, double dpsi, DriveValue* out);
  SWGJOINT_INLINE void FinishSecant(double dtheta, double dpsi, DriveValue* out);

 private:
  // Number of harmonics above which blocks are wide.
  static constexpr int kMany = 128;
  // Length of the texts above which maps are looked for that have the same ones.
  static constexpr size_t kLongTexts = 100000;
  // Largest total length of the texts of maps that are kept after use.
  static constexpr size_t kKeptTexts = 40000000;

  struct Origin;

  // Rule that computes cos and sin of one block of harmonics from those of an earlier
  // block, if all four orders differ from it by the same amount.
  struct Recipe {
    int from = -1;  // place of the earlier block; -1: compute from the phases
    int shift = 0;  // place of the earlier harmonic with the difference as order
  };

  enum class Weighting { kMean, kTheta, kPsi };  // in the order of the weights

  bool Read(const DriveText& text, std::string* error);
  void FindRecipes(const std::vector<double>& orders);
  int Segment(double torsion) const;
  // The same, but tests a guess first, because the torsion rarely leaves its segment
  // within a step.
  int SegmentNear(int guess, double torsion) const {
    return low_[guess] < torsion && torsion < high_[guess] ? guess : Segment(torsion);
  }
  // Parts of Begin and Secant. Each processes all blocks, which have kSize harmonics, as
  // often as vectors V fit in a block.
  template <class V, int kSize, bool kPsi, int kHalvings>
  void HalfStep(double dtheta, double dpsi);
  template <class V, int kSize, bool kPsi>
  void Sweep(double dtheta, DriveValue* out);
  template <class V, int kSize>
  void Step(double dtheta, double dpsi, DriveValue* out);
  template <class V, int kSize>
  double RotateBlocks(double theta, double psi);
  template <class V, int kSize>
  void CombineBlocks(int segment, const double* weight, double out[5]) const;
  MeanTorque Work(int j1, double x1);
  double Rotate(double theta, double psi);
  void Combine(int segment, const double* weight, double out[5]) const;
  bool LocalStep(double dtheta, double dpsi, DriveValue* out);
  // Adds a weighted sum over the harmonics in one segment, as Combine does.
  void Add(int segment, Weighting by, double out[5]);

  int n_ = 0;         // number of harmonics, including the mean
  BlockSizes size_ = {kLanes};
  int blocks_ = 0;    // number of blocks of harmonics, without the mean
  int segments_ = 0;  // number of intervals between knots, plus two end parabolas
  bool moves_psi_ = false;  // whether a harmonic depends on psi
  double ratio_ = 1, inverse_ratio_ = 1;
  double scale_ = 1, error_scale_ = 1, shift_theta_ = 0, shift_psi_ = 0;  // Vary
  double top_theta_ = 0, top_psi_ = 0;  // largest orders in theta and psi
  double top_order_ = 0;                // largest |n_theta + n_psi/ratio|
  std::vector<double> knots_;
  std::vector<double> base_;   // (segments) torsion origin of each polynomial
  std::vector<double> low_, high_;  // (segments) bounds of the open interval
  LaneVector mean_;                 // (segments, mean)
  // (segments, blocks, block), never null once a map is read
  std::shared_ptr<const LaneVector> table_;
  LaneVector harmonics_;            // (blocks, harmonics), padded with zeros
  std::shared_ptr<const Origin> origin_;  // map that this one is a copy of, or null
  double error_mean_ = 0;
  std::vector<Recipe> recipe_;  // one per block

  LocalSums local_;  // of many harmonics with few different orders in theta

  // start state
  double theta_ = 0, psi_ = 0;
  bool rotated_ = false;  // whether harmonics_ has its phases
  double torsion_ = 0, d0_ = 0;
  int j0_ = 0;  // segment; between steps an initial guess that does not affect results

  // data of a step, sized in Parse, so that no step allocates memory
  LaneVector weight_;  // (blocks, weights)
  bool by_waves_ = false;  // whether local_ has the weights, not weight_
  LocalSums::Totals totals_ = {};
  int totals_of_ = -1;  // segment of totals_
  double w_[5] = {}, u_theta_[5] = {}, u_psi_[5] = {};  // weighted sums in segment j0_
};

SWGJOINT_INLINE void DriveMap::FinishSecant(double dtheta, double dpsi, DriveValue* out) {
  const double x1 = torsion_ + Dot(out->g, Pair{dtheta, dpsi});
  const int j1 = SegmentNear(j0_, x1);
  const Pair d = {d0_, x1 - base_[j1]};

  // torque: mean of dV/d(torsion) along the step, with cos and sin at their means
  const MeanTorque mean = j0_ == j1 ? Mean(w_, d) : Work(j1, x1);
  const double begin = mean.stiffness[0], end = mean.stiffness[1];
  out->torque = scale_ * mean.torque;
  out->slope = scale_ * std::clamp(mean.slope, 0.5 * std::min(begin, end),
                                   0.5 * std::max(begin, end));
  out->stiffness_begin = scale_ * begin;
  out->stiffness_end = scale_ * end;

  // secants of V for the angles: mean of their values at the two torsions
  const auto angle = [&](const double u[5], Weighting by) {
    if (j1 == j0_) return MeanValue(u, d);
    double other[5] = {0, 0, 0, 0, 0};
    Add(j1, by, other);
    return 0.5 * (Value(u, d[0]) + Value(other, d[1]));
  };
  const double e_theta = scale_ * angle(u_theta_, Weighting::kTheta);
  out->e = Pair{e_theta, moves_psi_ ? scale_ * angle(u_psi_, Weighting::kPsi) : 0.0};
}

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_DRIVE_MAP_H_
