// Sums over the thousands of harmonics of a map with tooth errors, for slow output
// angles.
//
// All harmonics with the same order n in theta are one wave exp(i n theta), whose
// complex amplitude is a function of psi. The output of a joint turns by less than a
// millirad per step, so that near a position c this function is a polynomial of
// s = psi - c, which holds for many steps:
//   sum_k (A_k - i B_k) exp(i m_k (c + s)) = sum_d z_d s^d,
//   z_d = sum_k (A_k - i B_k) exp(i m_k c) (i m_k)^d / d!.
// A step evaluates the polynomials of 51 waves instead of 2574 harmonics. The secants
// of V over a step are those of the single harmonics: the mean of exp(i n theta) s^d
// along the step has a closed form, too.
//
// The positions c are multiples of one width, so that results depend on the state
// alone.
#ifndef SWGJOINT_PLUGIN_LOCAL_SUMS_H_
#define SWGJOINT_PLUGIN_LOCAL_SUMS_H_

#include <cmath>
#include <vector>

#include "lanes.h"

namespace swgjoint {

class LocalSums {
 public:
  // Degree of the polynomials, and of the change of psi within a step.
  static constexpr int kDegree = 12, kWithin = 8;
  // A0, .. A4 of the potential, e0 and two zeros.
  static constexpr int kColumns = 8, kError = 5;
  // The truncated terms of every harmonic and of its derivative are below 2^-53 of it:
  // (kReach + kChange)^12/12! and kChange^8/8!, where kReach and kChange are the
  // largest |m s| at the start of a step, and its change within the step.
  static constexpr double kReach = 0.2, kChange = 0.038;
  static constexpr double kTurn = 1;  // largest |n dtheta|
  // Smallest number of harmonics per wave at which these sums take less time.
  static constexpr int kPerWave = 16;

  // Real parts of sums over the waves, by column: mean of the values at both ends of
  // the step, and secants by theta and psi.
  struct Totals {
    double mean[kColumns], theta[kColumns], psi[kColumns];
  };

  // Takes the orders of `count` harmonics in theta and psi, and cosine and sine
  // amplitudes of e0, in pairs. Without effect unless many harmonics share few waves.
  void Set(const double* orders, const double* errors, int count, int segments);
  bool used() const { return waves_ > 0; }

  // Sets the start of the following steps, and returns the sum of e0.
  double Begin(double theta, double psi);

  // Computes values and derivatives at the start, instead of those of a step; `table`
  // is that of Sum.
  void Value(int segment, const double* table, Totals* out);

  // Position near which the polynomials of an output angle are made.
  double Center(double psi) const { return std::rint(psi / width_) * width_; }

  // Sets the step. Returns false if it is too large for these sums.
  bool Step(double dtheta, double dpsi);

  // Computes the sums of a segment; `table` has blocks of kWideLanes harmonics with
  // A0, B0, .. A4, B4 of each.
  void Sum(int segment, const double* table, Totals* out);

 private:
  static constexpr int kTerms = kDegree + 1;
  static constexpr int kWeights = 6;  // of both parts of each amplitude in each sum
  static constexpr int kPowers = 2 * kWideLanes;  // kTerms, padded

  // Polynomials of one segment near one position.
  struct Window {
    bool known = false;
    double center = 0;
    LaneVector harmonics;  // (count, 2, kColumns), of A and B
    LaneVector z;          // (waves, kTerms, 2, kColumns)
  };

  // In a step, (s + t dpsi)^d is the sum over k of by[d][k] t^k; halves of its values at
  // t = 0 and t = 1.
  struct Powers {
    double by[kTerms][kWithin + 1] = {{1}}, begin[kTerms], end[kTerms];
  };

  template <class V>
  double BeginWaves(double theta);
  double BeginAll(double theta);
  Powers PowersOfStep() const;
  template <class V>
  void Weigh(const Powers& of, size_t first, double* to) const;
  template <class V>
  void BuildErrors();
  void BuildErrorsAll();
  template <class V>
  void Build(Window* window) const;
  void BuildAll(Window* window) const;
  template <class V>
  void ValueWaves(const Window& window, Totals* out) const;
  void ValueAll(const Window& window, Totals* out) const;
  Window& Near(int segment, const double* table);
  template <class V>
  void SumWaves(const Window& window, Totals* out) const;
  void SumAll(const Window& window, Totals* out) const;
  void Fill(const double* table, LaneVector* out) const;

  int waves_ = 0;  // number of different orders in theta
  double top_theta_ = 0, top_psi_ = 0, width_ = 0;
  std::vector<int> place_;        // harmonics sorted by their order in theta
  std::vector<int> first_;        // first harmonic of each wave, and their number
  std::vector<int> psi_;          // index of the order in psi of each
  LaneVector n_;                  // orders of the waves, padded with zeros
  LaneVector m_;                  // different orders in psi, padded with zeros
  LaneVector powers_;             // (orders in psi, kPowers), m^d/d!
  LaneVector errors_;             // (count, 2), cosine and sine amplitudes of e0
  std::vector<Window> windows_;   // by segment

  // at the start of the step
  bool known_ = false;            // whether error_z_ and turned_ belong to center_
  double center_ = 0, s_ = 0;
  LaneVector turned_;             // (2, orders in psi), cos and sin of m center_
  LaneVector error_z_;            // (kTerms, 2, waves)
  LaneVector base_;               // (2, waves), exp(i n theta)
  double dtheta_ = 0, dpsi_ = 0;  // of the step
};

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_LOCAL_SUMS_H_
