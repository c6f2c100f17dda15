#include "drive_map.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

#include "lanes.h"

namespace swgjoint {
namespace {

// Polynomial with coefficients w, and its first two derivatives.
double Value(const double w[5], double d) {
  return w[0] + d * (w[1] + d * (w[2] + d * (w[3] + d * w[4])));
}
double Slope(const double w[5], double d) {
  return w[1] + d * (2 * w[2] + d * (3 * w[3] + d * 4 * w[4]));
}
double Curvature(const double w[5], double d) {
  return 2 * w[2] + d * (6 * w[3] + d * 12 * w[4]);
}
// (w(b) - w(a))/(b - a), computed without these differences, so that it is accurate for
// small b - a and equals the derivative if b == a.
double Divided(const double w[5], double a, double b) {
  const double ab = a * a + a * b + b * b;
  return w[1] + w[2] * (a + b) + w[3] * ab + w[4] * (a + b) * (a * a + b * b);
}
// Derivative of Divided with respect to b.
double DividedSlope(const double w[5], double a, double b) {
  return w[2] + w[3] * (a + 2 * b) + w[4] * (a * a + 2 * a * b + 3 * b * b);
}

// Sets an error message about an attribute, and returns false.
bool Fail(std::string* error, const char* attribute, const std::string& why) {
  *error = std::string("attribute '") + attribute + "' " + why;
  return false;
}

// Reads an attribute of `count` numbers, or of any number of them if `count` is 0.
bool Numbers(const char* text, const char* attribute, size_t count,
             std::vector<double>* out, std::string* error) {
  if (!ParseNumbers(text, out)) {
    return Fail(error, attribute, "is not a list of finite numbers");
  }
  if (count && out->size() != count) {
    return Fail(error, attribute,
                "has " + std::to_string(out->size()) + " numbers, needs " +
                    std::to_string(count));
  }
  return true;
}

}  // namespace

bool ParseNumbers(const char* text, std::vector<double>* out) {
  out->clear();
  if (!text) return false;
  const char* end = text + std::strlen(text);
  while (true) {
    while (text < end && std::isspace(static_cast<unsigned char>(*text))) ++text;
    if (text == end) return !out->empty();
    double value;
    const auto result = std::from_chars(text, end, value);
    if (result.ec != std::errc() || !std::isfinite(value)) return false;
    text = result.ptr;
    if (text < end && !std::isspace(static_cast<unsigned char>(*text))) return false;
    out->push_back(value);
  }
}

bool DriveMap::Parse(const DriveText& text, std::string* error) {
  std::vector<double> list, orders;
  if (!Numbers(text.ratio, "ratio", 1, &list, error)) return false;
  ratio_ = list[0];
  if (ratio_ == 0) return Fail(error, "ratio", "is 0");
  inverse_ratio_ = 1 / ratio_;

  // orders in (theta, psi), with the mean (0, 0) first
  if (!Numbers(text.orders, "orders", 0, &orders, error)) return false;
  if (orders.size() % 2) return Fail(error, "orders", "does not hold pairs");
  n_ = static_cast<int>(orders.size() / 2);
  for (int k = 0; k < n_; ++k) {
    const double theta = orders[2 * k], psi = orders[2 * k + 1];
    if (theta != std::rint(theta) || psi != std::rint(psi) || std::fabs(theta) > 1e6 ||
        std::fabs(psi) > 1e6) {
      return Fail(error, "orders", "holds a number that is no integer below 1e6");
    }
    moves_psi_ |= psi != 0;
    top_order_ = std::max(top_order_, std::fabs(theta + psi / ratio_));
    top_theta_ = std::max(top_theta_, std::fabs(theta));
    top_psi_ = std::max(top_psi_, std::fabs(psi));
  }
  if (orders[0] != 0 || orders[1] != 0) {
    return Fail(error, "orders", "does not begin with the mean (0 0)");
  }

  if (!Numbers(text.knots, "knots", 0, &knots_, error)) return false;
  const int m = static_cast<int>(knots_.size()) - 1;
  if (m < 1) return Fail(error, "knots", "has fewer than two numbers");
  for (int j = 0; j < m; ++j) {
    if (knots_[j + 1] <= knots_[j]) return Fail(error, "knots", "does not increase");
  }
  const size_t n = n_;
  std::vector<double> potential, end;
  if (!Numbers(text.potential, "potential", n * 2 * m * 5, &potential, error) ||
      !Numbers(text.end_stiffness, "end_stiffness", n * 4, &end, error) ||
      !Numbers(text.kinematic_error, "kinematic_error", n * 2, &list, error)) {
    return false;
  }
  blocks_ = (n_ - 1 + kLanes - 1) / kLanes;
  const size_t padded = static_cast<size_t>(blocks_) * kLanes;
  std::vector<double> n_theta(padded, 0.0), n_psi(padded, 0.0);
  for (auto* v : {&error_c_, &error_s_, &c_, &s_, &sinc_, &ch_}) {
    v->assign(padded, 0.0);
  }
  weight_.assign(static_cast<size_t>(blocks_) * kWeights, 0.0);
  for (int k = 1; k < n_; ++k) {
    n_theta[k - 1] = orders[2 * k];
    n_psi[k - 1] = orders[2 * k + 1];
    error_c_[k - 1] = list[2 * k];
    error_s_[k - 1] = list[2 * k + 1];
  }
  error_mean_ = list[0];
  n_theta_ = n_theta;
  n_psi_ = n_psi;

  // one table for the intervals and for the parabolas beyond the first and last knot
  segments_ = m + 2;
  base_.resize(segments_);
  low_.assign(segments_, -std::numeric_limits<double>::infinity());
  high_.assign(segments_, std::numeric_limits<double>::infinity());
  mean_.assign(static_cast<size_t>(segments_) * 5, 0.0);
  table_.assign(static_cast<size_t>(segments_) * blocks_ * kBlock, 0.0);
  for (int seg = 0; seg < segments_; ++seg) {
    base_[seg] = knots_[std::clamp(seg - 1, 0, m)];
    if (seg > 0) low_[seg] = knots_[seg - 1];
    if (seg <= m) high_[seg] = knots_[seg];
    for (int k = 0; k < n_; ++k) {
      for (int ab = 0; ab < 2; ++ab) {
        double to[5] = {0, 0, 0, 0, 0};
        const int j = std::clamp(seg - 1, 0, m - 1);
        const double* from = &potential[((2 * k + ab) * static_cast<size_t>(m) + j) * 5];
        if (seg >= 1 && seg <= m) {
          std::copy(from, from + 5, to);
        } else {
          const double d = seg == 0 ? 0.0 : knots_[m] - knots_[m - 1];
          to[0] = Value(from, d);
          to[1] = Slope(from, d);
          to[2] = 0.5 * end[4 * k + 2 * ab + (seg == 0 ? 0 : 1)];
        }
        if (k == 0) {
          if (ab == 0) std::copy(to, to + 5, &mean_[static_cast<size_t>(seg) * 5]);
          continue;
        }
        const int block = (k - 1) / kLanes, lane = (k - 1) % kLanes;
        double* row = &table_[(static_cast<size_t>(seg) * blocks_ + block) * kBlock];
        for (int p = 0; p < 5; ++p) row[(2 * p + ab) * kLanes + lane] = to[p];
      }
    }
  }

  return true;
}

// Segment that contains a torsion; 0 and segments_ - 1 are the end parabolas.
int DriveMap::Segment(double torsion) const {
  if (torsion < knots_.front()) return 0;
  if (torsion == knots_.back()) return segments_ - 2;
  return static_cast<int>(std::upper_bound(knots_.begin(), knots_.end(), torsion) -
                          knots_.begin());
}

// The same, but tests a guess first, because the torsion rarely leaves its segment
// within a step.
int DriveMap::SegmentNear(int guess, double torsion) const {
  return low_[guess] < torsion && torsion < high_[guess] ? guess : Segment(torsion);
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
  for (int k = 0; k < blocks_ * kLanes; k += kLanes) {
    Lanes n, m, c, s, error_c, error_s;
    Load(&n_theta_[k], &n);
    Load(&n_psi_[k], &m);
    Load(&error_c_[k], &error_c);
    Load(&error_s_[k], &error_s);
    CosSin(n * theta + m * psi, &c, &s);
    sum += error_c * c + error_s * s;
    Store(&c_[k], c);
    Store(&s_[k], s);
  }
  return error_mean_ + ((sum[0] + sum[1]) + (sum[2] + sum[3]));
}

// Computes sin(eta)/eta and cos(eta) for half the phase change eta of every harmonic.
void DriveMap::HalfStep(double dtheta, double dpsi) {
  for (int k = 0; k < n_ - 1; ++k) {
    const double x = 0.5 * (n_theta_[k] * dtheta + n_psi_[k] * dpsi);
    sinc_[k] = std::fabs(x) < 1e-4 ? 1 - x * x / 6 : std::sin(x) / x;
    ch_[k] = std::cos(x);
  }
}

// Adds to `out` the polynomial coefficients of a weighted sum over the harmonics in one
// segment; `weight` points to the weights of A and B in the first block.
void DriveMap::Combine(int segment, const double* weight, double out[5]) const {
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
// in the segment of the start state, and g. kPsi means that a harmonic depends on psi.
// No phase changes by more than 2^kHalvings/2 rad; at kHalvings < 0, HalfStep has
// computed sinc_ and ch_ for any change.
template <bool kPsi, int kHalvings>
SWGJOINT_INLINE void DriveMap::Sweep(double dtheta, double dpsi, DriveValue* out) {
  const double* __restrict row =
      table_.data() + static_cast<size_t>(j0_) * blocks_ * kBlock;
  const double* __restrict in_sinc = sinc_.data();
  const double* __restrict in_ch = ch_.data();
  const double* __restrict in_c = c_.data();
  const double* __restrict in_s = s_.data();
  const double* __restrict in_theta = n_theta_.data();
  const double* __restrict in_psi = n_psi_.data();
  const double* __restrict in_error_c = error_c_.data();
  const double* __restrict in_error_s = error_s_.data();
  double* __restrict out_weight = weight_.data();
  Lanes w[5] = {}, u[5] = {}, v[5] = {}, g_theta = {}, g_psi = {};
  const int blocks = blocks_;
  for (int b = 0, k = 0; b < blocks; ++b, k += kLanes) {
    Lanes n, m = {}, sinc, ch, c0, s0, error_c, error_s;
    Load(in_theta + k, &n);
    if (kPsi) Load(in_psi + k, &m);
    Lanes eta = n * (0.5 * dtheta);
    if (kPsi) eta += m * (0.5 * dpsi);
    if constexpr (kHalvings >= 0) {
      SincCos<kHalvings>(eta, &sinc, &ch);
    } else {
      Load(in_sinc + k, &sinc);
      Load(in_ch + k, &ch);
    }
    Load(in_c + k, &c0);
    Load(in_s + k, &s0);
    Load(in_error_c + k, &error_c);
    Load(in_error_s + k, &error_s);
    const Lanes sh = eta * sinc;
    const Lanes c = c0 * ch - s0 * sh, s = s0 * ch + c0 * sh;
    const Lanes mean_c = c * ch, mean_s = s * ch;
    const Lanes dc = s * sinc * -1, ds = c * sinc;
    const Lanes theta_c = dc * n, theta_s = ds * n, psi_c = dc * m, psi_s = ds * m;
    g_theta += error_c * theta_c + error_s * theta_s;
    if (kPsi) g_psi += error_c * psi_c + error_s * psi_s;
    double* weight = out_weight + b * kWeights;
    Store(weight, mean_c);
    Store(weight + kLanes, mean_s);
    Store(weight + 2 * kLanes, theta_c);
    Store(weight + 3 * kLanes, theta_s);
    if (kPsi) {
      Store(weight + 4 * kLanes, psi_c);
      Store(weight + 5 * kLanes, psi_s);
    }
  }
  for (int b = 0; b < blocks; ++b, row += kBlock) {
    const double* weight = out_weight + b * kWeights;
    Lanes mean_c, mean_s, theta_c, theta_s, psi_c, psi_s, even, odd;
    Load(weight, &mean_c);
    Load(weight + kLanes, &mean_s);
    Load(weight + 2 * kLanes, &theta_c);
    Load(weight + 3 * kLanes, &theta_s);
    if (kPsi) {
      Load(weight + 4 * kLanes, &psi_c);
      Load(weight + 5 * kLanes, &psi_s);
    }
    for (int p = 0; p < 5; ++p) {
      Load(row + 2 * p * kLanes, &even);
      Load(row + (2 * p + 1) * kLanes, &odd);
      w[p] += mean_c * even + mean_s * odd;
      u[p] += theta_c * even + theta_s * odd;
      if (kPsi) v[p] += psi_c * even + psi_s * odd;
    }
  }
  const double* mean = &mean_[static_cast<size_t>(j0_) * 5];
  double rest[4];
  Sums(w[0], w[1], w[2], w[3], w_);
  Sums(u[0], u[1], u[2], u[3], u_theta_);
  Sums(w[4], u[4], g_theta, g_psi, rest);
  for (int p = 0; p < 4; ++p) w_[p] += mean[p];
  w_[4] = mean[4] + rest[0];
  u_theta_[4] = rest[1];
  out->g_theta = inverse_ratio_ + error_scale_ * rest[2];
  out->g_psi = error_scale_ * rest[3] - 1.0;
  if (kPsi) {
    Sums(v[0], v[1], v[2], v[3], u_psi_);
    Sums(v[4], v[4], v[4], v[4], rest);
    u_psi_[4] = rest[0];
  }
}

SWGJOINT_CLONES void DriveMap::Weigh(double dtheta, double dpsi, DriveValue* out) {
  const double top = top_theta_ * std::fabs(dtheta) + top_psi_ * std::fabs(dpsi);
  if (top <= 0.5) {
    moves_psi_ ? Sweep<true, 0>(dtheta, dpsi, out) : Sweep<false, 0>(dtheta, dpsi, out);
  } else if (top <= 2) {
    moves_psi_ ? Sweep<true, 2>(dtheta, dpsi, out) : Sweep<false, 2>(dtheta, dpsi, out);
  } else {
    HalfStep(dtheta, dpsi);
    moves_psi_ ? Sweep<true, -1>(dtheta, dpsi, out)
               : Sweep<false, -1>(dtheta, dpsi, out);
  }
}

// Computes the mean torque of a step that crosses knots. The work is summed piece by
// piece, which avoids the difference of two large energies.
void DriveMap::Work(int j1, double x1, DriveValue* out) const {
  double w[5], work = 0, torque_end = 0;
  const int step = j1 > j0_ ? 1 : -1;
  double from = torsion_;
  for (int j = j0_;; j += step) {
    if (j == j0_) {
      std::copy_n(w_, 5, w);
    } else {
      std::copy_n(&mean_[static_cast<size_t>(j) * 5], 5, w);
      Combine(j, weight_.data(), w);
    }
    const double to = j == j1 ? x1 : knots_[step > 0 ? j : j - 1];
    work += Divided(w, from - base_[j], to - base_[j]) * (to - from);
    from = to;
    if (j == j0_) out->stiffness_begin = Curvature(w, d0_);
    if (j == j1) {
      out->stiffness_end = Curvature(w, x1 - base_[j]);
      torque_end = Slope(w, x1 - base_[j]);
      break;
    }
  }
  out->torque = work / (x1 - torsion_);
  out->slope = (torque_end - out->torque) / (x1 - torsion_);
}

void DriveMap::Secant(double dtheta, double dpsi, DriveValue* out) {
  // With the phase phi at the midpoint and half the phase change eta,
  //   cos(phi + eta) - cos(phi - eta) = -2 sin(phi) sin(eta), and similarly for sin.
  // The secants of every harmonic for theta and psi therefore have a closed form, and
  // the mean of its two end values is cos(eta) times its value at the midpoint.
  Weigh(dtheta, dpsi, out);
  const double x1 = torsion_ + (out->g_theta * dtheta + out->g_psi * dpsi);
  const int j1 = SegmentNear(j0_, x1);
  const double d1 = x1 - base_[j1];

  // torque: mean of dV/d(torsion) along the step, with cos and sin at their means
  if (j0_ == j1) {
    out->torque = Divided(w_, d0_, d1);
    out->slope = DividedSlope(w_, d0_, d1);
    out->stiffness_begin = Curvature(w_, d0_);
    out->stiffness_end = Curvature(w_, d1);
  } else {
    Work(j1, x1, out);
  }
  const auto bound = std::minmax(out->stiffness_begin, out->stiffness_end);
  out->slope = std::clamp(out->slope, 0.5 * bound.first, 0.5 * bound.second);

  // secants of V for the angles: mean of their values at the two torsions
  const auto angle = [&](const double u[5], int weights) {
    double end[5] = {0, 0, 0, 0, 0};
    if (j1 != j0_) Combine(j1, weight_.data() + weights * kLanes, end);
    return 0.5 * (Value(u, d0_) + Value(j1 == j0_ ? u : end, d1));
  };
  out->e_theta = angle(u_theta_, 2);
  out->e_psi = moves_psi_ ? angle(u_psi_, 4) : 0.0;
  for (double* x : {&out->torque, &out->slope, &out->stiffness_begin,
                    &out->stiffness_end, &out->e_theta, &out->e_psi}) {
    *x *= scale_;
  }
}

}  // namespace swgjoint
