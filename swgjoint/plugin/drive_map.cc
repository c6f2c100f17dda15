#include "drive_map.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "lanes.h"

namespace swgjoint {
namespace {

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

}  // namespace

// Segment that contains a torsion; 0 and segments_ - 1 are the end parabolas.
int DriveMap::Segment(double torsion) const {
  if (torsion < knots_.front()) return 0;
  if (torsion == knots_.back()) return segments_ - 2;
  return static_cast<int>(std::upper_bound(knots_.begin(), knots_.end(), torsion) -
                          knots_.begin());
}

void DriveMap::Gradient(double theta, double psi, DriveValue* out) {
  Begin(theta, psi);
  Secant(0.0, 0.0, out);
}

void DriveMap::Begin(double theta, double psi) {
  torsion_ = theta / ratio_ + error_scale_ * Rotate(theta, psi) - psi;
  j0_ = SegmentNear(j0_, torsion_);
  d0_ = torsion_ - base_[j0_];
}

// Computes cos and sin of all phases at the given angles, and returns e0.
SWGJOINT_CLONES double DriveMap::Rotate(double theta, double psi) {
  theta += shift_theta_;
  psi += shift_psi_;
  Lanes sum = {};
  double* all = harmonics_.data();
  double* own = all;
  for (int b = 0; b < blocks_; ++b, own += kHarmonics) {
    Lanes c, s, error_c, error_s;
    const Recipe& recipe = recipe_[b];
    if (recipe.from < 0) {
      Lanes n, m;
      Load(own, &n);
      Load(own + kLanes, &m);
      CosSin(n * theta + m * psi, &c, &s);
    } else {
      const double* from = all + recipe.from + kPhases;
      const double* shift = all + recipe.shift + kPhases;
      const double shift_c = shift[0], shift_s = shift[kLanes];
      Lanes c0, s0;
      Load(from, &c0);
      Load(from + kLanes, &s0);
      c = c0 * shift_c - s0 * shift_s;
      s = s0 * shift_c + c0 * shift_s;
    }
    Load(own + 2 * kLanes, &error_c);
    Load(own + 3 * kLanes, &error_s);
    sum += error_c * c + error_s * s;
    Store(own + 4 * kLanes, c);
    Store(own + 5 * kLanes, s);
  }
  return error_mean_ + ((sum[0] + sum[1]) + (sum[2] + sum[3]));
}

// Stores, at the place of the first weights of every block, cos and sin of half the phase
// change eta of its harmonics, and n sin(eta)/eta for their orders n. kPsi means that a
// harmonic depends on psi. No phase changes by more than 2^kHalvings rad; at
// kHalvings < 0 phases may change by any angle.
template <bool kPsi, int kHalvings>
SWGJOINT_INLINE void DriveMap::HalfStep(double dtheta, double dpsi) {
  const double* own = harmonics_.data();
  double* all = weight_.data();
  double* out = all;
  const Recipe* recipe = recipe_.data();
  for (int b = 0; b < blocks_; ++b, ++recipe, own += kHarmonics, out += kWeights) {
    Lanes n, m = {}, c, s, sinc;
    Load(own, &n);
    if (kPsi) Load(own + kLanes, &m);
    Lanes eta = n * (0.5 * dtheta);
    if (kPsi) eta += m * (0.5 * dpsi);
    if (!kPsi && recipe->from >= 0) {
      const double shift_c = all[recipe->shift], shift_s = all[recipe->shift + kLanes];
      Lanes c0, s0;
      Load(all + recipe->from, &c0);
      Load(all + recipe->from + kLanes, &s0);
      c = c0 * shift_c - s0 * shift_s;
      s = s0 * shift_c + c0 * shift_s;
    } else if constexpr (kHalvings >= 0) {
      SincCos<kHalvings>(eta, &sinc, &c);
      s = eta * sinc;
    } else {
      CosSin(eta, &c, &s);
      for (int lane = 0; kPsi && lane < kLanes; ++lane) {
        const double x = eta[lane];
        out[lane] = std::fabs(x) < 1e-4 ? 1 - x * x / 6 : s[lane] / x;
      }
      if (kPsi) Load(out, &sinc);
    }
    Store(out, c);
    Store(out + kLanes, s);
    if (kPsi) {
      Store(out + 2 * kLanes, n * sinc);
      Store(out + 3 * kLanes, m * sinc);
    }
  }
}

// Adds to `out` the polynomial coefficients of a weighted sum over the harmonics in one
// segment; `weight` points to the weights of A and B in the first block.
SWGJOINT_CLONES void DriveMap::Combine(int segment, const double* weight,
                                       double out[5]) const {
  Lanes sum[5] = {};
  // data() is used because a map without harmonics has an empty table
  const double* row = table_.data() + static_cast<size_t>(segment) * blocks_ * kBlock;
  for (int b = 0; b < blocks_; ++b, row += kBlock, weight += kWeights) {
    Lanes wc, ws, even, odd;
    Load(weight, &wc);
    Load(weight + kLanes, &ws);
    for (int p = 0; p < 5; ++p) {
      Load(row + 2 * p * kLanes, &even);
      Load(row + (2 * p + 1) * kLanes, &odd);
      sum[p] += wc * even + ws * odd;
    }
  }
  double low[4], high[4];
  Sums(sum[0], sum[1], sum[2], sum[3], low);
  Sums(sum[4], sum[4], sum[4], sum[4], high);
  for (int p = 0; p < 4; ++p) out[p] += low[p];
  out[4] += high[0];
}

// Computes, in one pass over the table, the weights of all A and B, the weighted sums
// in the segment of the start state, and g. HalfStep must have been called.
template <bool kPsi>
SWGJOINT_INLINE void DriveMap::Sweep(double dtheta, DriveValue* out) {
  const double* row =
      table_.data() + static_cast<size_t>(j0_) * blocks_ * kBlock;
  const double* own = harmonics_.data();
  double* weight = weight_.data();
  Lanes w[5] = {}, u[5] = {}, v[5] = {}, g_theta = {}, g_psi = {};
  const int blocks = blocks_;
  // n sin(eta)/eta is sin(eta) times this number, or n if eta^2/6 is less than 2^-53
  const bool still = std::fabs(dtheta) * top_theta_ < 1e-8;
  const double per_step = still ? 0 : 2 / dtheta;
  for (int b = 0; b < blocks;
       ++b, row += kBlock, own += kHarmonics, weight += kWeights) {
    Lanes c0, s0, ch, sh, by_theta, by_psi, error_c, error_s, psi_c, psi_s, even, odd;
    Load(weight, &ch);
    Load(weight + kLanes, &sh);
    if (kPsi) {
      Load(weight + 2 * kLanes, &by_theta);
      Load(weight + 3 * kLanes, &by_psi);
    } else if (still) {
      Load(own, &by_theta);
    } else {
      by_theta = sh * per_step;
    }
    Load(own + 2 * kLanes, &error_c);
    Load(own + 3 * kLanes, &error_s);
    Load(own + 4 * kLanes, &c0);
    Load(own + 5 * kLanes, &s0);
    const Lanes c = c0 * ch - s0 * sh, s = s0 * ch + c0 * sh;
    const Lanes mean_c = c * ch, mean_s = s * ch;
    const Lanes theta_c = s * (by_theta * -1), theta_s = c * by_theta;
    g_theta += error_c * theta_c + error_s * theta_s;
    Store(weight, mean_c);
    Store(weight + kLanes, mean_s);
    Store(weight + 2 * kLanes, theta_c);
    Store(weight + 3 * kLanes, theta_s);
    if (kPsi) {
      psi_c = s * (by_psi * -1);
      psi_s = c * by_psi;
      g_psi += error_c * psi_c + error_s * psi_s;
      Store(weight + 4 * kLanes, psi_c);
      Store(weight + 5 * kLanes, psi_s);
    }
    for (int p = 0; p < 5; ++p) {
      Load(row + 2 * p * kLanes, &even);
      Load(row + (2 * p + 1) * kLanes, &odd);
      if (p > 0) w[p] += mean_c * even + mean_s * odd;  // the torque does not need w[0]
      u[p] += theta_c * even + theta_s * odd;
      if (kPsi) v[p] += psi_c * even + psi_s * odd;
    }
  }
  // the mean harmonic joins the others in one of their lanes
  const double* mean = &mean_[static_cast<size_t>(j0_) * kMean];
  for (int p = 1; p < 5; ++p) {
    Lanes a;
    Load(mean + p * kLanes, &a);
    w[p] += a;
  }
  double rest[4];
  Sums(w[1], w[2], w[3], w[4], w_ + 1);
  Sums(u[0], u[1], u[2], u[3], u_theta_);
  Sums(u[4], g_theta, g_psi, g_psi, rest);
  u_theta_[4] = rest[0];
  out->g = Pair{inverse_ratio_, -1.0} + Pair{rest[1], rest[2]} * error_scale_;
  if (kPsi) {
    Sums(v[0], v[1], v[2], v[3], u_psi_);
    Sums(v[4], v[4], v[4], v[4], rest);
    u_psi_[4] = rest[0];
  }
}

// Computes the mean torque of a step that crosses knots. The work is summed piece by
// piece, which avoids the difference of two large energies.
MeanTorque DriveMap::Work(int j1, double x1) const {
  double w[5], work = 0, begin = 0;
  const int step = j1 > j0_ ? 1 : -1;
  double from = torsion_;
  for (int j = j0_;; j += step) {
    if (j == j0_) {
      std::copy_n(w_, 5, w);
    } else {
      const double* mean = &mean_[static_cast<size_t>(j) * kMean];
      for (int p = 0; p < 5; ++p) w[p] = mean[p * kLanes];
      Combine(j, weight_.data(), w);
    }
    const double to = j == j1 ? x1 : knots_[step > 0 ? j : j - 1];
    const MeanTorque piece = Mean(w, Pair{from - base_[j], to - base_[j]});
    work += piece.torque * (to - from);
    from = to;
    if (j == j0_) begin = piece.stiffness[0];
    if (j != j1) continue;
    const double torque = work / (x1 - torsion_);
    return {torque, (Slope(w, x1 - base_[j]) - torque) / (x1 - torsion_),
            Pair{begin, piece.stiffness[1]}};
  }
}

SWGJOINT_CLONES void DriveMap::Secant(double dtheta, double dpsi, DriveValue* out) {
  // With the phase phi at the midpoint and half the phase change eta,
  //   cos(phi + eta) - cos(phi - eta) = -2 sin(phi) sin(eta), and similarly for sin.
  // The secants of every harmonic for theta and psi therefore have a closed form, and
  // the mean of its two end values is cos(eta) times its value at the midpoint.
  const double top = top_theta_ * std::fabs(dtheta) + top_psi_ * std::fabs(dpsi);
  if (moves_psi_) {
    if (top <= 1) {
      HalfStep<true, 0>(dtheta, dpsi);
    } else if (top <= 4) {
      HalfStep<true, 2>(dtheta, dpsi);
    } else {
      HalfStep<true, -1>(dtheta, dpsi);
    }
    Sweep<true>(dtheta, out);
  } else {
    if (top <= 1) {
      HalfStep<false, 0>(dtheta, dpsi);
    } else if (top <= 4) {
      HalfStep<false, 2>(dtheta, dpsi);
    } else {
      HalfStep<false, -1>(dtheta, dpsi);
    }
    Sweep<false>(dtheta, out);
  }
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
  const auto angle = [&](const double u[5], int weights) {
    if (j1 == j0_) return MeanValue(u, d);
    double other[5] = {0, 0, 0, 0, 0};
    Combine(j1, weight_.data() + weights * kLanes, other);
    return 0.5 * (Value(u, d[0]) + Value(other, d[1]));
  };
  const double e_theta = scale_ * angle(u_theta_, 2);
  out->e = Pair{e_theta, moves_psi_ ? scale_ * angle(u_psi_, 4) : 0.0};
}

}  // namespace swgjoint
