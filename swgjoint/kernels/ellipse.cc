#include "ellipse.h"

#include <cmath>

#include "flank.h"

namespace swgjoint {
namespace {

constexpr int kIterations = 60;
constexpr double kConverged = 1e-15;

Vec unit(Vec v) {
  const double length = size(v);
  return {v.x / length, v.y / length};
}

double cross(Vec a, Vec b) { return a.x * b.y - a.y * b.x; }

// Eccentric angle t of the foot of a point in the first quadrant, as (cos t, sin t).
// A turn by the arctangent of a Newton step needs no trigonometric function.
Vec foot_of(Vec p, double a, double b) {
  Vec t = b * p.y + a * p.x > 0.0 ? unit({b * p.y, a * p.x}) : Vec{1.0, 0.0};
  Vec low{1.0, 0.0}, high{0.0, 1.0};
  for (int k = 0; k < kIterations; ++k) {
    const double dx = p.x - b * t.y, dy = p.y - a * t.x;
    // zero of the projection on the tangent (b cos t, -a sin t)
    const double f = dx * b * t.x - dy * a * t.y;
    const double slope = -(b * t.x) * (b * t.x) - (a * t.y) * (a * t.y) -
                         dx * b * t.y - dy * a * t.x;
    if (f >= 0.0) low = t;
    if (f <= 0.0) high = t;
    const double step = -f / slope;
    Vec next = unit({t.x - step * t.y, t.y + step * t.x});
    // written so that a step that is not a number is replaced, too
    if (!(cross(low, next) >= 0.0 && cross(next, high) >= 0.0)) {
      next = unit({low.x + high.x, low.y + high.y});
    }
    const double change = std::abs(cross(t, next));
    t = next;
    if (change < kConverged) break;
  }
  return t;
}

}  // namespace

void ellipse_distance(const double* points, std::size_t n, double major, double minor,
                      double* result) {
  for (std::size_t i = 0; i < n; ++i, points += 2, result += 4) {
    const Vec p{std::abs(points[0]), std::abs(points[1])};  // x = b sin t, y = a cos t
    const Vec t = foot_of(p, major, minor);
    const double length = size({major * t.y, minor * t.x});
    const Vec normal{major * t.y / length, minor * t.x / length};
    result[0] = (p.x - minor * t.y) * normal.x + (p.y - major * t.x) * normal.y;
    result[1] = points[0] < 0.0 ? -normal.x : normal.x;
    result[2] = points[1] < 0.0 ? -normal.y : normal.y;
    result[3] = major * minor / (length * length * length);
  }
}

}  // namespace swgjoint
