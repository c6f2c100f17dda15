#include "drive_map.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "lanes.h"

namespace swgjoint {
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

void DriveMap::Secant(double dtheta, double dpsi, DriveValue* out) {
  SumHarmonics(dtheta, dpsi, out);
  FinishSecant(dtheta, dpsi, out);
}

void DriveMap::Begin(double theta, double psi) {
  theta_ = theta;
  psi_ = psi;
  rotated_ = !local_.used();
  const double error =
      rotated_ ? Rotate(theta, psi)
               : error_mean_ + local_.Begin(theta + shift_theta_, psi + shift_psi_);
  torsion_ = theta / ratio_ + error_scale_ * error - psi;
  j0_ = SegmentNear(j0_, torsion_);
  d0_ = torsion_ - base_[j0_];
}

// Computes cos and sin of all phases at the given angles, and returns e0.
template <class V, int kSize>
SWGJOINT_INLINE double DriveMap::RotateBlocks(double theta, double psi) {
  constexpr BlockSizes size = {kSize};
  constexpr int width = sizeof(V) / sizeof(double);
  theta += shift_theta_;
  psi += shift_psi_;
  double* all = harmonics_.data();
  V sums[kSize / width] = {};
  for (int b = 0; b < blocks_; ++b) {
    const Recipe& recipe = recipe_[b];
    for (int part = 0; part < kSize; part += width) {
      double* own = all + b * size.harmonics() + part;
      V c, s, error_c, error_s;
      if (recipe.from < 0) {
        V n, m;
        Load(own, &n);
        Load(own + size.lanes, &m);
        CosSin(n * theta + m * psi, &c, &s);
      } else {
        const double* from = all + recipe.from + size.phases() + part;
        const double* shift = all + recipe.shift + size.phases();
        const double shift_c = shift[0], shift_s = shift[size.lanes];
        V c0, s0;
        Load(from, &c0);
        Load(from + size.lanes, &s0);
        c = c0 * shift_c - s0 * shift_s;
        s = s0 * shift_c + c0 * shift_s;
      }
      Load(own + 2 * size.lanes, &error_c);
      Load(own + 3 * size.lanes, &error_s);
      sums[part / width] += error_c * c + error_s * s;
      Store(own + 4 * size.lanes, c);
      Store(own + 5 * size.lanes, s);
    }
  }
  V sum = sums[0];
  for (int part = 1; part < kSize / width; ++part) sum += sums[part];
  double error[4];
  Sums(sum, sum, sum, sum, error);
  return error_mean_ + error[0];
}

SWGJOINT_CLONES double DriveMap::Rotate(double theta, double psi) {
  if (!many()) return RotateBlocks<Lanes, kLanes>(theta, psi);
  return kHasWide ? RotateBlocks<Wide, kWideLanes>(theta, psi)
                  : RotateBlocks<Lanes, kWideLanes>(theta, psi);
}

// Stores, at the place of the first weights of every block, cos and sin of half the phase
// change eta of its harmonics, and n sin(eta)/eta for their orders n. kPsi means that a
// harmonic depends on psi. No phase changes by more than 2^kHalvings rad; at
// kHalvings < 0 phases may change by any angle.
template <class V, int kSize, bool kPsi, int kHalvings>
SWGJOINT_INLINE void DriveMap::HalfStep(double dtheta, double dpsi) {
  constexpr BlockSizes size = {kSize};
  constexpr int width = sizeof(V) / sizeof(double);
  double* all = weight_.data();
  const Recipe* recipe = recipe_.data();
  for (int b = 0; b < blocks_; ++b, ++recipe) {
    for (int part = 0; part < kSize; part += width) {
      const double* own = harmonics_.data() + b * size.harmonics() + part;
      double* out = all + b * size.weights() + part;
      V n, m = {}, c, s, sinc;
      Load(own, &n);
      if (kPsi) Load(own + size.lanes, &m);
      V eta = n * (0.5 * dtheta);
      if (kPsi) eta += m * (0.5 * dpsi);
      if (!kPsi && recipe->from >= 0) {
        const double* shift = all + recipe->shift;
        const double shift_c = shift[0], shift_s = shift[size.lanes];
        V c0, s0;
        Load(all + recipe->from + part, &c0);
        Load(all + recipe->from + size.lanes + part, &s0);
        c = c0 * shift_c - s0 * shift_s;
        s = s0 * shift_c + c0 * shift_s;
      } else if constexpr (kHalvings >= 0) {
        SincCos<kHalvings>(eta, &sinc, &c);
        s = eta * sinc;
      } else {
        CosSin(eta, &c, &s);
        for (int lane = 0; kPsi && lane < width; ++lane) {
          const double x = eta[lane];
          out[lane] = std::fabs(x) < 1e-4 ? 1 - x * x / 6 : s[lane] / x;
        }
        if (kPsi) Load(out, &sinc);
      }
      Store(out, c);
      Store(out + size.lanes, s);
      if (kPsi) {
        Store(out + 2 * size.lanes, n * sinc);
        Store(out + 3 * size.lanes, m * sinc);
      }
    }
  }
}

// Adds to `out` the polynomial coefficients of a weighted sum over the harmonics in one
// segment; `weight` points to the weights of A and B in the first block.
template <class V, int kSize>
SWGJOINT_INLINE void DriveMap::CombineBlocks(int segment, const double* weight,
                                             double out[5]) const {
  constexpr BlockSizes size = {kSize};
  constexpr int width = sizeof(V) / sizeof(double);
  V total[5];
  Clear(total);
  for (int part = 0; part < kSize; part += width) {
    V sum[5];
    Clear(sum);
    const double* by = weight + part;
    // data() is used because a map without harmonics has an empty table
    const double* row =
        table_->data() + static_cast<size_t>(segment) * blocks_ * size.block() + part;
    for (int b = 0; b < blocks_; ++b, row += size.block(), by += size.weights()) {
      V wc, ws, even, odd;
      Load(by, &wc);
      Load(by + size.lanes, &ws);
      for (int p = 0; p < 5; ++p) {
        Load(row + 2 * p * size.lanes, &even);
        Load(row + (2 * p + 1) * size.lanes, &odd);
        sum[p] += wc * even + ws * odd;
      }
    }
    for (int p = 0; p < 5; ++p) total[p] += sum[p];
  }
  double low[4], high[4];
  Sums(total[0], total[1], total[2], total[3], low);
  Sums(total[4], total[4], total[4], total[4], high);
  for (int p = 0; p < 4; ++p) out[p] += low[p];
  out[4] += high[0];
}

SWGJOINT_CLONES void DriveMap::Combine(int segment, const double* weight,
                                       double out[5]) const {
  if (!many()) {
    CombineBlocks<Lanes, kLanes>(segment, weight, out);
  } else if (kHasWide) {
    CombineBlocks<Wide, kWideLanes>(segment, weight, out);
  } else {
    CombineBlocks<Lanes, kWideLanes>(segment, weight, out);
  }
}

// Computes, in one pass over the table, the weights of all A and B, the weighted sums
// in the segment of the start state, and g. HalfStep must have been called.
template <class V, int kSize, bool kPsi>
SWGJOINT_INLINE void DriveMap::Sweep(double dtheta, DriveValue* out) {
  constexpr BlockSizes size = {kSize};
  constexpr int width = sizeof(V) / sizeof(double);
  V all_w[5], all_u[5], all_v[5], all_theta, all_psi;
  const int blocks = blocks_;
  // n sin(eta)/eta is sin(eta) times this number, or n if eta^2/6 is less than 2^-53
  const bool still = std::fabs(dtheta) * top_theta_ < 1e-8;
  const double per_step = still ? 0 : 2 / dtheta;
  for (int part = 0; part < kSize; part += width) {
    const double* row =
        table_->data() + static_cast<size_t>(j0_) * blocks_ * size.block() + part;
    const double* own = harmonics_.data() + part;
    double* weight = weight_.data() + part;
    V w[5], u[5], v[5], g_theta = {}, g_psi = {};
    Clear(w);
    Clear(u);
    Clear(v);
    for (int b = 0; b < blocks;
         ++b, row += size.block(), own += size.harmonics(), weight += size.weights()) {
      V c0, s0, ch, sh, by_theta, by_psi, error_c, error_s, psi_c, psi_s, even, odd;
      Load(weight, &ch);
      Load(weight + size.lanes, &sh);
      if (kPsi) {
        Load(weight + 2 * size.lanes, &by_theta);
        Load(weight + 3 * size.lanes, &by_psi);
      } else if (still) {
        Load(own, &by_theta);
      } else {
        by_theta = sh * per_step;
      }
      Load(own + 2 * size.lanes, &error_c);
      Load(own + 3 * size.lanes, &error_s);
      Load(own + 4 * size.lanes, &c0);
      Load(own + 5 * size.lanes, &s0);
      const V c = c0 * ch - s0 * sh, s = s0 * ch + c0 * sh;
      const V mean_c = c * ch, mean_s = s * ch;
      const V theta_c = s * (by_theta * -1), theta_s = c * by_theta;
      g_theta += error_c * theta_c + error_s * theta_s;
      Store(weight, mean_c);
      Store(weight + size.lanes, mean_s);
      Store(weight + 2 * size.lanes, theta_c);
      Store(weight + 3 * size.lanes, theta_s);
      if (kPsi) {
        psi_c = s * (by_psi * -1);
        psi_s = c * by_psi;
        g_psi += error_c * psi_c + error_s * psi_s;
        Store(weight + 4 * size.lanes, psi_c);
        Store(weight + 5 * size.lanes, psi_s);
      }
      for (int p = 0; p < 5; ++p) {
        Load(row + 2 * p * size.lanes, &even);
        Load(row + (2 * p + 1) * size.lanes, &odd);
        // the torque does not need w[0]
        if (p > 0) w[p] += mean_c * even + mean_s * odd;
        u[p] += theta_c * even + theta_s * odd;
        if (kPsi) v[p] += psi_c * even + psi_s * odd;
      }
    }
    // the mean harmonic joins the others in one of their lanes
    const double* mean = &mean_[static_cast<size_t>(j0_) * size.mean()] + part;
    for (int p = 0; p < 5; ++p) {
      V a;
      Load(mean + p * size.lanes, &a);
      w[p] += a;
      all_w[p] = part ? all_w[p] + w[p] : w[p];
      all_u[p] = part ? all_u[p] + u[p] : u[p];
      all_v[p] = part ? all_v[p] + v[p] : v[p];
    }
    all_theta = part ? all_theta + g_theta : g_theta;
    all_psi = part ? all_psi + g_psi : g_psi;
  }
  double rest[4];
  Sums(all_w[1], all_w[2], all_w[3], all_w[4], w_ + 1);
  Sums(all_u[0], all_u[1], all_u[2], all_u[3], u_theta_);
  Sums(all_u[4], all_theta, all_psi, all_psi, rest);
  u_theta_[4] = rest[0];
  out->g = Pair{inverse_ratio_, -1.0} + Pair{rest[1], rest[2]} * error_scale_;
  if (kPsi) {
    Sums(all_v[0], all_v[1], all_v[2], all_v[3], u_psi_);
    Sums(all_v[4], all_v[4], all_v[4], all_v[4], rest);
    u_psi_[4] = rest[0];
  }
}

void DriveMap::Add(int segment, Weighting by, double out[5]) {
  if (!by_waves_) {
    return Combine(segment, weight_.data() + 2 * static_cast<int>(by) * size_.lanes, out);
  }
  if (segment != totals_of_) {
    const size_t row = static_cast<size_t>(segment) * blocks_ * size_.block();
    local_.Sum(segment, table_->data() + row, &totals_);
    totals_of_ = segment;
  }
  const double* sums = by == Weighting::kMean    ? totals_.mean
                       : by == Weighting::kTheta ? totals_.theta
                                                 : totals_.psi;
  for (int p = 0; p < 5; ++p) out[p] += sums[p];
}

// Computes the same as Step from the waves of many harmonics. Returns false if the step
// is too large for this.
bool DriveMap::LocalStep(double dtheta, double dpsi, DriveValue* out) {
  by_waves_ = local_.used() && local_.Step(dtheta, dpsi);
  if (!by_waves_) return false;
  totals_of_ = -1;
  const double* mean = &mean_[static_cast<size_t>(j0_) * size_.mean()];
  for (int p = 0; p < 5; ++p) {
    w_[p] = mean[p * size_.lanes];
    u_theta_[p] = u_psi_[p] = 0;
  }
  Add(j0_, Weighting::kMean, w_);
  Add(j0_, Weighting::kTheta, u_theta_);
  Add(j0_, Weighting::kPsi, u_psi_);
  constexpr int e = LocalSums::kError;
  out->g = Pair{inverse_ratio_, -1.0} +
           Pair{totals_.theta[e], totals_.psi[e]} * error_scale_;
  return true;
}

// Computes the mean torque of a step that crosses knots. The work is summed piece by
// piece, which avoids the difference of two large energies.
MeanTorque DriveMap::Work(int j1, double x1) {
  double w[5], work = 0, begin = 0;
  const int step = j1 > j0_ ? 1 : -1;
  double from = torsion_;
  for (int j = j0_;; j += step) {
    if (j == j0_) {
      std::copy_n(w_, 5, w);
    } else {
      const double* mean = &mean_[static_cast<size_t>(j) * size_.mean()];
      for (int p = 0; p < 5; ++p) w[p] = mean[p * size_.lanes];
      Add(j, Weighting::kMean, w);
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

template <class V, int kSize>
SWGJOINT_INLINE void DriveMap::Step(double dtheta, double dpsi, DriveValue* out) {
  const double top = top_theta_ * std::fabs(dtheta) + top_psi_ * std::fabs(dpsi);
  if (moves_psi_) {
    if (top <= 1) {
      HalfStep<V, kSize, true, 0>(dtheta, dpsi);
    } else if (top <= 4) {
      HalfStep<V, kSize, true, 2>(dtheta, dpsi);
    } else {
      HalfStep<V, kSize, true, -1>(dtheta, dpsi);
    }
    Sweep<V, kSize, true>(dtheta, out);
  } else {
    if (top <= 1) {
      HalfStep<V, kSize, false, 0>(dtheta, dpsi);
    } else if (top <= 4) {
      HalfStep<V, kSize, false, 2>(dtheta, dpsi);
    } else {
      HalfStep<V, kSize, false, -1>(dtheta, dpsi);
    }
    Sweep<V, kSize, false>(dtheta, out);
  }
}

SWGJOINT_CLONES void DriveMap::SumHarmonics(double dtheta, double dpsi, DriveValue* out) {
  // With the phase phi at the midpoint and half the phase change eta,
  //   cos(phi + eta) - cos(phi - eta) = -2 sin(phi) sin(eta), and similarly for sin.
  // The secants of every harmonic for theta and psi therefore have a closed form, and
  // the mean of its two end values is cos(eta) times its value at the midpoint.
  if (!many()) {
    Step<Lanes, kLanes>(dtheta, dpsi, out);
  } else if (!LocalStep(dtheta, dpsi, out)) {
    if (!rotated_) Rotate(theta_, psi_);
    rotated_ = true;
    if (kHasWide) {
      Step<Wide, kWideLanes>(dtheta, dpsi, out);
    } else {
      Step<Lanes, kWideLanes>(dtheta, dpsi, out);
    }
  }
}

}  // namespace swgjoint
