#include "drive_map.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>

namespace swgjoint {
namespace {

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
    moves_theta_ |= n_theta_[k] != 0;
    moves_psi_ |= n_psi_[k] != 0;
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
  error_cos_.resize(n_);
  error_sin_.resize(n_);
  for (int k = 0; k < n_; ++k) {
    error_cos_[k] = list[2 * k];
    error_sin_[k] = list[2 * k + 1];
  }

  // one table for the intervals and, as parabolas about the end knots, beyond them
  segments_ = m + 2;
  base_.resize(segments_);
  table_.assign(static_cast<size_t>(segments_) * n_ * 10, 0.0);
  for (int seg = 0; seg < segments_; ++seg) {
    base_[seg] = knots_[std::clamp(seg - 1, 0, m)];
    for (int k = 0; k < n_; ++k) {
      for (int ab = 0; ab < 2; ++ab) {
        double* to = &table_[(static_cast<size_t>(seg) * n_ + k) * 10 + 5 * ab];
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
  for (auto* v : {&c_, &s_, &ch_, &sh_, &wa_, &wb_, &ta_, &tb_, &pa_, &pb_}) {
    v->assign(n_, 0.0);
  }
  return true;
}

int DriveMap::Segment(double torsion) const {
  if (torsion < knots_.front()) return 0;
  if (torsion == knots_.back()) return segments_ - 2;
  return static_cast<int>(std::upper_bound(knots_.begin(), knots_.end(), torsion) -
                          knots_.begin());
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

// Coefficients of sum_k wa_k A_k + wb_k B_k in one segment.
void DriveMap::Combine(int segment, const double* wa, const double* wb,
                       double out[5]) const {
  double w[5] = {0, 0, 0, 0, 0};
  const double* row = &table_[static_cast<size_t>(segment) * n_ * 10];
  for (int k = 0; k < n_; ++k, row += 10) {
    for (int p = 0; p < 5; ++p) w[p] += wa[k] * row[p] + wb[k] * row[5 + p];
  }
  std::copy(w, w + 5, out);
}

void DriveMap::Gradient(double theta, double psi, DriveValue* out) {
  Begin(theta, psi);
  Secant(0.0, 0.0, out);
}

void DriveMap::Begin(double theta, double psi) {
  Rotate(theta, psi, c_.data(), s_.data());
  double e0 = 0;
  for (int k = 0; k < n_; ++k) e0 += error_cos_[k] * c_[k] + error_sin_[k] * s_[k];
  torsion_ = theta / ratio_ + e0 - psi;
}

void DriveMap::Secant(double dtheta, double dpsi, DriveValue* out) {
  // With phi the phase half way and eta half its step,
  //   cos(phi + eta) - cos(phi - eta) = -2 sin(phi) sin(eta), likewise for sin,
  // so every harmonic has its secant by theta and psi in closed form, and the mean
  // of its two end values is cos(eta) times the value half way.
  Rotate(0.5 * dtheta, 0.5 * dpsi, ch_.data(), sh_.data());
  double g_theta = 1.0 / ratio_, g_psi = -1.0;
  for (int k = 0; k < n_; ++k) {
    const double eta = 0.5 * (n_theta_[k] * dtheta + n_psi_[k] * dpsi);
    const double sinc =
        std::fabs(eta) < 1e-4 ? 1.0 - eta * eta / 6.0 : sh_[k] / eta;
    const double c = c_[k] * ch_[k] - s_[k] * sh_[k];
    const double s = s_[k] * ch_[k] + c_[k] * sh_[k];
    wa_[k] = c * ch_[k];
    wb_[k] = s * ch_[k];
    const double da = -s * sinc, db = c * sinc;
    ta_[k] = da * n_theta_[k];
    tb_[k] = db * n_theta_[k];
    pa_[k] = da * n_psi_[k];
    pb_[k] = db * n_psi_[k];
    g_theta += error_cos_[k] * ta_[k] + error_sin_[k] * tb_[k];
    g_psi += error_cos_[k] * pa_[k] + error_sin_[k] * pb_[k];
  }
  out->g_theta = g_theta;
  out->g_psi = g_psi;
  const double x0 = torsion_, ds = g_theta * dtheta + g_psi * dpsi, x1 = x0 + ds;
  const int j0 = Segment(x0), j1 = Segment(x1);
  const double d0 = x0 - base_[j0], d1 = x1 - base_[j1];

  // torque: mean of dV/d(torsion) from x0 to x1, harmonics held at their mean
  double w[5];
  if (j0 == j1) {
    Combine(j0, wa_.data(), wb_.data(), w);
    out->torque = Divided(w, d0, d1);
    out->slope = DividedSlope(w, d0, d1);
    out->stiffness_begin = Curvature(w, d0);
    out->stiffness_end = Curvature(w, d1);
  } else {
    // piece by piece: exact, and no difference of two large energies
    double work = 0, torque_end = 0;
    const int step = j1 > j0 ? 1 : -1;
    double from = x0;
    for (int j = j0;; j += step) {
      Combine(j, wa_.data(), wb_.data(), w);
      const double to = j == j1 ? x1 : knots_[step > 0 ? j : j - 1];
      work += Divided(w, from - base_[j], to - base_[j]) * (to - from);
      from = to;
      if (j == j0) out->stiffness_begin = Curvature(w, d0);
      if (j == j1) {
        out->stiffness_end = Curvature(w, d1);
        torque_end = Slope(w, d1);
        break;
      }
    }
    out->torque = work / (x1 - x0);
    out->slope = (torque_end - out->torque) / (x1 - x0);
  }
  const auto bound = std::minmax(out->stiffness_begin, out->stiffness_end);
  out->slope = std::clamp(out->slope, 0.5 * bound.first, 0.5 * bound.second);

  // explicit derivative by the angles: mean of its values at the two torsions
  const auto angle = [&](const std::vector<double>& a, const std::vector<double>& b) {
    double u[5];
    Combine(j0, a.data(), b.data(), u);
    const double first = Value(u, d0);
    if (j1 != j0) Combine(j1, a.data(), b.data(), u);
    return 0.5 * (first + Value(u, d1));
  };
  out->e_theta = moves_theta_ ? angle(ta_, tb_) : 0.0;
  out->e_psi = moves_psi_ ? angle(pa_, pb_) : 0.0;
}

}  // namespace swgjoint
