#include "radial.h"

#include <algorithm>
#include <cmath>

namespace swgjoint {
namespace {

constexpr double kTurn = 6.283185307179586476925286766559;
constexpr int kSamples = 2880, kIterations = 50;
constexpr double kLimit = 4.0 * kTurn / kSamples;
constexpr double kConverged = 1e-14;
constexpr double kLeastBend = 0.1;
// Points near the outline have their foot near their own polar angle. For others, or
// close to a centre of curvature, the nearest of all samples decides.
constexpr double kNear = 0.3, kStraight = 0.5;

}  // namespace

Radial::Radial(const double* rows, std::size_t n) {
  if (static_cast<Kind>(static_cast<int>(rows[0])) == Kind::kCosine) {
    mean_ = 0.5 * (rows[1] + rows[2]);
    swing_ = 0.5 * (rows[1] - rows[2]);
    lobes_ = rows[3];
    return;
  }
  for (std::size_t k = 0; k < n; ++k) {
    const double* row = rows + kColumns * k;
    starts_.push_back(row[1]);
    powers_.insert(powers_.end(), row + 2, row + 6);
  }
}

Radial::Radius Radial::radius(double angle) const {
  if (starts_.empty()) {
    const double c = std::cos(lobes_ * angle), s = std::sin(lobes_ * angle);
    return {mean_ + swing_ * c, -lobes_ * swing_ * s, -lobes_ * lobes_ * swing_ * c};
  }
  const double first = starts_.front();
  const double inside = angle - kTurn * std::floor((angle - first) / kTurn);
  const auto next = std::upper_bound(starts_.begin() + 1, starts_.end(), inside);
  const std::size_t k = static_cast<std::size_t>(next - starts_.begin()) - 1;
  const double t = inside - starts_[k];
  const double* c = powers_.data() + 4 * k;
  return {((c[0] * t + c[1]) * t + c[2]) * t + c[3],
          (3.0 * c[0] * t + 2.0 * c[1]) * t + c[2], 6.0 * c[0] * t + 2.0 * c[1]};
}

At Radial::at(double angle, Vec point, double* along, double* speed) const {
  const Radius r = radius(angle);
  const double s = std::sin(angle), c = std::cos(angle);
  const double length = std::sqrt(r.value * r.value + r.slope * r.slope);
  const Vec foot{-r.value * s, r.value * c};
  const Vec normal{(-r.value * s + r.slope * c) / length,
                   (r.value * c + r.slope * s) / length};
  const Vec rel = point - foot;
  *along = rel.y * normal.x - rel.x * normal.y;
  *speed = length;
  const double turn =
      r.value * r.value + 2.0 * r.slope * r.slope - r.value * r.bend;
  return {foot, normal, turn / (length * length * length)};
}

Nearest Radial::from(double angle, Vec point, double* bend) const {
  double along, speed, gap = 0.0;
  At foot{};
  for (int k = 0; k <= kIterations; ++k) {
    foot = at(angle, point, &along, &speed);
    gap = dot(point - foot.point, foot.normal);
    *bend = 1.0 + foot.curvature * gap;
    const double step = along / (std::max(*bend, kLeastBend) * speed);
    if (std::abs(step) < kConverged) break;
    angle += std::clamp(step, -kLimit, kLimit);
  }
  return {gap, foot.normal, foot.curvature};
}

double Radial::nearest_sample(Vec point) const {
  double least = HUGE_VAL, best = 0.0;
  for (int k = 0; k < kSamples; ++k) {
    const double angle = kTurn / kSamples * k;
    const double r = radius(angle).value;
    const Vec rel = point - Vec{-r * std::sin(angle), r * std::cos(angle)};
    if (dot(rel, rel) < least) {
      least = dot(rel, rel);
      best = angle;
    }
  }
  return best;
}

Nearest Radial::nearest(Vec point) const {
  const double angle = std::atan2(-point.x, point.y);
  double bend;
  const Nearest found = from(angle, point, &bend);
  const bool near = std::abs(found.gap) < kNear * size(point);
  if (near && bend > kStraight) return found;
  return from(nearest_sample(point), point, &bend);
}

}  // namespace swgjoint
