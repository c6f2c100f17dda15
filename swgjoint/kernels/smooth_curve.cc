#include "smooth_curve.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swgjoint {
namespace {

constexpr int kSteps = 8;            // largest number of Newton steps to a foot
constexpr std::size_t kStride = 4;   // stride of the nodes at which a search may start
constexpr double kConverged = 1e-9;  // change of the arc length that ends it [m]

}  // namespace

SmoothCurve::SmoothCurve(const double* stations, const double* coefficients,
                         std::size_t intervals, double side)
    : stations_(stations, stations + intervals + 1),
      coefficients_(coefficients, coefficients + 12 * intervals), side_(side) {
  for (std::size_t k = 0; k < intervals; k += kStride) coarse_.push_back(stations_[k]);
  coarse_.push_back(stations_.back());
  for (const double s : coarse_) {
    Vec point, first, second;
    derivatives(s, &point, &first, &second);
    coarse_points_.push_back(point);
  }
}

void SmoothCurve::derivatives(double s, Vec* value, Vec* first, Vec* second) const {
  const std::size_t k = interval_of(stations_.data(), stations_.size(), s);
  const double h = stations_[k + 1] - stations_[k];
  const double t = (s - stations_[k]) / h;
  const double* c = coefficients_.data() + 12 * k;
  double v[2], d[2], b[2];
  for (int i = 0; i < 2; ++i) {
    v[i] = c[10 + i];
    d[i] = 0.0;
    b[i] = 0.0;
    for (int j = 4; j >= 0; --j) {
      b[i] = b[i] * t + 2.0 * d[i];
      d[i] = d[i] * t + v[i];
      v[i] = v[i] * t + c[2 * j + i];
    }
  }
  *value = {v[0], v[1]};
  *first = {d[0] / h, d[1] / h};
  *second = {b[0] / (h * h), b[1] / (h * h)};
}

At SmoothCurve::evaluate(double s) const {
  Vec point, tangent, bend;
  derivatives(s, &point, &tangent, &bend);
  const double length = size(tangent);
  const Vec normal = {side_ * -tangent.y / length, side_ * tangent.x / length};
  return {point, normal, -dot(bend, normal) / (length * length)};
}

double SmoothCurve::project(Vec point, Vec* normal, double* curvature,
                            bool* inside) const {
  double nearest = std::numeric_limits<double>::infinity(), s = 0.0;
  for (std::size_t k = 0; k < coarse_.size(); ++k) {
    const Vec rel = coarse_points_[k] - point;
    const double apart = dot(rel, rel);
    if (apart < nearest) {
      nearest = apart;
      s = coarse_[k];
    }
  }
  const double length = stations_.back();
  for (int step = 0; step < kSteps; ++step) {
    Vec foot, tangent, bend;
    derivatives(s, &foot, &tangent, &bend);
    const Vec rel = foot - point;
    // beyond the centre of curvature, the distance has no minimum
    const double gain = std::max(1.0 + dot(rel, bend), 0.2);
    const double before = s;
    s = std::clamp(before - dot(rel, tangent) / gain, 0.0, length);
    if (std::abs(s - before) <= kConverged) break;
  }
  const At foot = evaluate(s);
  const Vec rel = point - foot.point;
  // beyond the ends, the remaining vector has a tangential component
  const Vec tangent = {foot.normal.y, -foot.normal.x};
  *inside = std::abs(dot(rel, tangent)) <= 1e-9 * length;
  *normal = foot.normal;
  *curvature = foot.curvature;
  return dot(rel, foot.normal);
}

std::size_t interval_of(const double* breaks, std::size_t n, double s) {
  const auto k = std::upper_bound(breaks, breaks + n, s) - breaks - 1;
  return static_cast<std::size_t>(
      std::clamp<std::ptrdiff_t>(k, 0, static_cast<std::ptrdiff_t>(n) - 2));
}

}  // namespace swgjoint
