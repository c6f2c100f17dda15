#include "drive_map.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

namespace swgjoint {
namespace {

// A and B of a harmonic go through the same products: two lanes at once.
#if defined(__GNUC__)
typedef double Pair __attribute__((vector_size(16)));
#else
struct Pair {
  double v[2];
  double operator[](int i) const { return v[i]; }
  void operator+=(Pair o) { v[0] += o.v[0], v[1] += o.v[1]; }
};
inline Pair operator*(Pair a, Pair b) { return {a[0] * b[0], a[1] * b[1]}; }
inline Pair operator*(Pair a, double b) { return {a[0] * b, a[1] * b}; }
#endif
inline Pair Load(const double* from) { return Pair{from[0], from[1]}; }
inline void Store(double* to, Pair x) { to[0] = x[0], to[1] = x[1]; }

double Value(const double w[5], double d) {
  return w[0] + d * (w[1] + d * (w[2] + d * (w[3] + d * w[4])));
}
double Slope(const double w[5], double d) {
  return w[1] + d * (2 * w[2] + d * (3 * w[3] + d * 4 * w[4]));
}
double Curvature(const double w[5], double d) {
  return 2 * w[2] + d * (6 * w[3] + d * 12 * w[4]);
}
// (w(b) - w(a))/(b - a) without a difference: exact also where b == a.
double Divided(const double w[5], double a, double b) {
  const double ab = a * a + a * b + b * b;
  return w[1] + w[2] * (a + b) + w[3] * ab + w[4] * (a + b) * (a * a + b * b);
}
// Derivative of Divided by b.
double DividedSlope(const double w[5], double a, double b) {
  return w[2] + w[3] * (a + 2 * b) + w[4] * (a * a + 2 * a * b + 3 * b * b);
}

bool Fail(std::string* error, const char* attribute, const std::string& why) {
  *error = std::string("attribute '") + attribute + "' " + why;
  return false;
}

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
  std::vector<double> list;
  if (!Numbers(text.ratio, "ratio", 1, &list, error)) return false;
  ratio_ = list[0];
  if (ratio_ == 0) return Fail(error, "ratio", "is 0");

  // orders by (theta, psi), the mean (0, 0) first
  if (!Numbers(text.orders, "orders", 0, &list, error)) return false;
  if (list.size() % 2) return Fail(error, "orders", "does not hold pairs");
  n_ = static_cast<int>(list.size() / 2);
  n_theta_.resize(n_);
  n_psi_.resize(n_);
  for (int k = 0; k < n_; ++k) {
    n_theta_[k] = list[2 * k];
    n_psi_[k] = list[2 * k + 1];
    if (n_theta_[k] != std::rint(n_theta_[k]) || n_psi_[k] != std::rint(n_psi_[k]) ||
        std::fabs(n_theta_[k]) > 1e6 || std::fabs(n_psi_[k]) > 1e6) {
      return Fail(error, "orders", "holds a number that is no integer below 1e6");
    }
    moves_psi_ |= n_psi_[k] != 0;
    top_theta_ = std::max(top_theta_, std::fabs(n_theta_[k]));
    top_psi_ = std::max(top_psi_, std::fabs(n_psi_[k]));
  }
  if (n_theta_[0] != 0 || n_psi_[0] != 0) {
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
  error_ = list;

  // one table for the intervals and, as parabolas about the end knots, beyond them
  segments_ = m + 2;
  base_.resize(segments_);
  low_.assign(segments_, -std::numeric_limits<double>::infinity());
  high_.assign(segments_, std::numeric_limits<double>::infinity());
  table_.assign(static_cast<size_t>(segments_) * n_ * 10, 0.0);
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
        double* row = &table_[(static_cast<size_t>(seg) * n_ + k) * 10 + ab];
        for (int p = 0; p < 5; ++p) row[2 * p] = to[p];
      }
    }
  }

  // sums and differences of earlier harmonics need no call of sin and cos
  recipe_.assign(n_, Recipe());
  for (int k = 1; k < n_; ++k) {
    for (int a = 1; a < k && recipe_[k].a < 0; ++a) {
      for (int b = 1; b <= a && recipe_[k].a < 0; ++b) {
        for (double sign : {1.0, -1.0}) {
          if (n_theta_[a] + sign * n_theta_[b] == n_theta_[k] &&
              n_psi_[a] + sign * n_psi_[b] == n_psi_[k]) {
            recipe_[k] = Recipe{a, b, sign};
            break;
          }
        }
      }
    }
  }
  for (auto* v : {&c_, &s_, &eta_, &sinc_, &ch_}) v->assign(n_, 0.0);
  for (auto* v : {&weight_, &by_theta_, &by_psi_}) v->assign(2 * n_, 0.0);
  weight_[0] = 1;  // of the mean
  return true;
}

int DriveMap::Segment(double torsion) const {
  if (torsion < knots_.front()) return 0;
  if (torsion == knots_.back()) return segments_ - 2;
  return static_cast<int>(std::upper_bound(knots_.begin(), knots_.end(), torsion) -
                          knots_.begin());
}

// The same with a guess: torsion seldom leaves its segment from step to step.
int DriveMap::SegmentNear(int guess, double torsion) const {
  return low_[guess] < torsion && torsion < high_[guess] ? guess : Segment(torsion);
}

void DriveMap::Rotate(double theta, double psi, double* c, double* s) const {
  c[0] = 1;
  s[0] = 0;
  for (int k = 1; k < n_; ++k) {
    const Recipe& r = recipe_[k];
    if (r.a < 0) {
      const double phase = n_theta_[k] * theta + n_psi_[k] * psi;
      c[k] = std::cos(phase);
      s[k] = std::sin(phase);
    } else {
      const double sb = r.sign * s[r.b];
      c[k] = c[r.a] * c[r.b] - s[r.a] * sb;
      s[k] = s[r.a] * c[r.b] + c[r.a] * sb;
    }
  }
}

// Coefficients of sum_k weight[2k] A_k + weight[2k+1] B_k in one segment.
void DriveMap::Combine(int segment, const double* weight, double out[5]) const {
  Pair sum[5] = {};
  const double* row = &table_[static_cast<size_t>(segment) * n_ * 10];
  for (int k = 0; k < n_; ++k, row += 10, weight += 2) {
    for (int p = 0; p < 5; ++p) sum[p] += Load(weight) * Load(row + 2 * p);
  }
  for (int p = 0; p < 5; ++p) out[p] = sum[p][0] + sum[p][1];
}

void DriveMap::Gradient(double theta, double psi, DriveValue* out) {
  Begin(theta, psi);
  Secant(0.0, 0.0, out);
}

void DriveMap::Begin(double theta, double psi) {
  Rotate(theta, psi, c_.data(), s_.data());
  double e0 = 0;
  for (int k = 0; k < n_; ++k) e0 += error_[2 * k] * c_[k] + error_[2 * k + 1] * s_[k];
  torsion_ = theta / ratio_ + e0 - psi;
  j0_ = SegmentNear(j0_, torsion_);
  d0_ = torsion_ - base_[j0_];
}

// sin(eta)/eta and cos(eta) of half the phase step of every harmonic.
void DriveMap::HalfStep(double dtheta, double dpsi) {
  const double* __restrict n_theta = n_theta_.data();
  const double* __restrict n_psi = n_psi_.data();
  double* __restrict eta = eta_.data();
  double* __restrict sinc = sinc_.data();
  double* __restrict ch = ch_.data();
  const double top = top_theta_ * std::fabs(dtheta) + top_psi_ * std::fabs(dpsi);
  if (top <= 0.5) {
    // what a step carries: |eta| <= 1/4, where these series end below 2^-53
    for (int k = 1; k < n_; ++k) {
      const double x = 0.5 * (n_theta[k] * dtheta + n_psi[k] * dpsi), z = x * x;
      eta[k] = x;
      sinc[k] = 1 + z * (-1. / 6 + z * (1. / 120 + z * (-1. / 5040 + z * (1. / 362880 +
                z * (-1. / 39916800)))));
      ch[k] = 1 + z * (-1. / 2 + z * (1. / 24 + z * (-1. / 720 + z * (1. / 40320 +
              z * (-1. / 3628800 + z * (1. / 479001600))))));
    }
  } else {
    for (int k = 1; k < n_; ++k) {
      const double x = 0.5 * (n_theta[k] * dtheta + n_psi[k] * dpsi);
      eta[k] = x;
      sinc[k] = std::fabs(x) < 1e-4 ? 1 - x * x / 6 : std::sin(x) / x;
      ch[k] = std::cos(x);
    }
  }
}

// Weights of all A and B, their sums in the segment of the begin state, and g. One
// sweep over the table; `row` is that segment's.
template <bool kPsi>
void DriveMap::Weigh(const double* row, DriveValue* out) {
  Pair w[5], u[5] = {}, v[5] = {};
  Pair g_theta = {}, g_psi = {};
  // the mean: weight 1 of A, no secants
  for (int p = 0; p < 5; ++p) w[p] = Pair{row[2 * p], 0.0};
  for (int k = 1; k < n_; ++k) {
    row += 10;
    const double ch = ch_[k], sinc = sinc_[k], sh = eta_[k] * sinc;
    const double c = c_[k] * ch - s_[k] * sh, s = s_[k] * ch + c_[k] * sh;
    const Pair mean = Pair{c, s} * ch;
    const Pair d = Pair{-s, c} * sinc;
    const Pair theta = d * n_theta_[k];
    const Pair error = Load(&error_[2 * k]);
    g_theta += error * theta;
    Pair table[5];
    for (int p = 0; p < 5; ++p) table[p] = Load(row + 2 * p);
    for (int p = 0; p < 5; ++p) w[p] += mean * table[p];
    for (int p = 0; p < 5; ++p) u[p] += theta * table[p];
    Store(&weight_[2 * k], mean);
    Store(&by_theta_[2 * k], theta);
    if (kPsi) {
      const Pair psi = d * n_psi_[k];
      g_psi += error * psi;
      for (int p = 0; p < 5; ++p) v[p] += psi * table[p];
      Store(&by_psi_[2 * k], psi);
    }
  }
  for (int p = 0; p < 5; ++p) {
    w_[p] = w[p][0] + w[p][1];
    u_theta_[p] = u[p][0] + u[p][1];
    if (kPsi) u_psi_[p] = v[p][0] + v[p][1];
  }
  out->g_theta = 1.0 / ratio_ + (g_theta[0] + g_theta[1]);
  out->g_psi = g_psi[0] + g_psi[1] - 1.0;
}

// Mean torque across knots: piece by piece, no difference of two large energies.
void DriveMap::Work(int j1, double x1, DriveValue* out) const {
  double w[5], work = 0, torque_end = 0;
  const int step = j1 > j0_ ? 1 : -1;
  double from = torsion_;
  for (int j = j0_;; j += step) {
    Combine(j, weight_.data(), w);
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
  // With phi the phase half way and eta half its step,
  //   cos(phi + eta) - cos(phi - eta) = -2 sin(phi) sin(eta), likewise for sin,
  // so every harmonic has its secant by theta and psi in closed form, and the mean
  // of its two end values is cos(eta) times the value half way.
  HalfStep(dtheta, dpsi);
  const double* row = &table_[static_cast<size_t>(j0_) * n_ * 10];
  moves_psi_ ? Weigh<true>(row, out) : Weigh<false>(row, out);
  const double x1 = torsion_ + (out->g_theta * dtheta + out->g_psi * dpsi);
  const int j1 = SegmentNear(j0_, x1);
  const double d1 = x1 - base_[j1];

  // torque: mean of dV/d(torsion) along the step, harmonics held at their mean
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

  // explicit derivative by the angles: mean of its values at the two torsions
  const auto angle = [&](const double u[5], const std::vector<double>& weight) {
    double end[5];
    if (j1 != j0_) Combine(j1, weight.data(), end);
    return 0.5 * (Value(u, d0_) + Value(j1 == j0_ ? u : end, d1));
  };
  out->e_theta = angle(u_theta_, by_theta_);
  out->e_psi = moves_psi_ ? angle(u_psi_, by_psi_) : 0.0;
}

}  // namespace swgjoint
