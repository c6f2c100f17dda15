#include "outline.h"

#include <algorithm>
#include <cmath>

namespace swgjoint {
namespace {

constexpr int kIterations = 60;
constexpr double kConverged = 1e-15;
// the cube of a change this small, and this much smaller than the last one, is round-off
constexpr double kSmall = 3e-6, kSmaller = 1e-3;

Vec unit(Vec v) {
  const double inverse = 1.0 / size(v);
  return {v.x * inverse, v.y * inverse};
}

double cross(Vec a, Vec b) { return a.x * b.y - a.y * b.x; }

// Eccentric angle t of the foot of a point in the first quadrant, as (cos t, sin t).
// Halley's method converges cubically. A turn by the arctangent of its step needs no
// trigonometric function.
Vec foot_of(Vec p, double a, double b) {
  Vec t = b * p.y + a * p.x > 0.0 ? unit({b * p.y, a * p.x}) : Vec{1.0, 0.0};
  Vec low{1.0, 0.0}, high{0.0, 1.0};
  double last = 1.0;
  for (int k = 0; k < kIterations; ++k) {
    const double dx = p.x - b * t.y, dy = p.y - a * t.x;
    // zero of the projection on the tangent (b cos t, -a sin t)
    const double f = dx * b * t.x - dy * a * t.y;
    const double slope = -(b * t.x) * (b * t.x) - (a * t.y) * (a * t.y) -
                         dx * b * t.y - dy * a * t.x;
    if (f >= 0.0) low = t;
    if (f <= 0.0) high = t;
    const double bend = 3.0 * (b - a) * (b + a) * t.x * t.y - f;
    const double step = -f * slope / (slope * slope - 0.5 * f * bend);
    Vec next = unit({t.x - step * t.y, t.y + step * t.x});
    // written so that a step that is not a number is replaced, too
    const bool inside = cross(low, next) >= 0.0 && cross(next, high) >= 0.0;
    if (!inside) {
      next = unit({low.x + high.x, low.y + high.y});
    }
    const double change = std::abs(cross(t, next));
    t = next;
    if (change < kConverged) break;
    if (inside && change < kSmall && change < kSmaller * last) break;
    last = change;
  }
  return t;
}

Nearest nearest_of_ellipse(double major, double minor, Vec point) {
  const Vec p{std::abs(point.x), std::abs(point.y)};  // x = b sin t, y = a cos t
  const Vec t = foot_of(p, major, minor);
  const double length = size({major * t.y, minor * t.x});
  const Vec normal{major * t.y / length, minor * t.x / length};
  return {(p.x - minor * t.y) * normal.x + (p.y - major * t.x) * normal.y,
          {point.x < 0.0 ? -normal.x : normal.x, point.y < 0.0 ? -normal.y : normal.y},
          major * minor / (length * length * length)};
}

// Distance from the line between the centres of the semicircles, minus the radius.
Nearest nearest_of_simplified(double major, double radius, Vec point) {
  const double half = major - radius;
  const Vec rel{point.x, point.y - std::clamp(point.y, -half, half)};
  const double r = size(rel), length = std::max(r, 1e-300);
  return {r - radius,
          {rel.x / length, rel.y / length},
          std::abs(point.y) > half ? 1.0 / radius : 0.0};
}

}  // namespace

Outline::Outline(const double* rows, std::size_t n)
    : kind_(static_cast<Kind>(static_cast<int>(rows[0]))), major_(rows[1]),
      minor_(rows[2]) {
  if (kind_ != Kind::kEllipse && kind_ != Kind::kSimplified) chain_.emplace(rows, n);
}

Nearest Outline::nearest(Vec point) const {
  if (chain_) return chain_->nearest(point);
  return kind_ == Kind::kEllipse ? nearest_of_ellipse(major_, minor_, point)
                                 : nearest_of_simplified(major_, minor_, point);
}

void outline_distance(const double* points, std::size_t n, const Outline& outline,
                      double* result) {
  for (std::size_t i = 0; i < n; ++i, points += 2, result += 4) {
    const Nearest foot = outline.nearest({points[0], points[1]});
    result[0] = foot.gap;
    result[1] = foot.normal.x;
    result[2] = foot.normal.y;
    result[3] = foot.curvature;
  }
}

}  // namespace swgjoint
