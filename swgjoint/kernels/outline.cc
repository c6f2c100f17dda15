#include "outline.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "wide.h"

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

constexpr std::size_t kBlock = 24;  // points whose feet are found at once

// Points in the first quadrant, and the results for them.
struct Block {
  double x[kBlock], y[kBlock];
  double gap[kBlock], normal_x[kBlock], normal_y[kBlock], curvature[kBlock];
  double settled[kBlock];  // 1 if the first step of foot_of is its last one, else 0
};

// The first step of foot_of and nearest_of_ellipse for all points of a block. Points near
// the outline need no other step.
SWGJOINT_WIDE void first_feet(double a, double b, Block* block) {
  for (std::size_t i = 0; i < kBlock; ++i) {
    const double x = block->x[i], y = block->y[i];
    const double from_x = b * y, from_y = a * x;
    const double first = 1.0 / std::sqrt(from_x * from_x + from_y * from_y);
    const double tx = from_x * first, ty = from_y * first;
    const double dx = x - b * ty, dy = y - a * tx;
    const double f = dx * b * tx - dy * a * ty;
    const double slope =
        -(b * tx) * (b * tx) - (a * ty) * (a * ty) - dx * b * ty - dy * a * tx;
    const double bend = 3.0 * (b - a) * (b + a) * tx * ty - f;
    const double step = -f * slope / (slope * slope - 0.5 * f * bend);
    const double next_x = tx - step * ty, next_y = ty + step * tx;
    const double second = 1.0 / std::sqrt(next_x * next_x + next_y * next_y);
    const double ux = next_x * second, uy = next_y * second;
    const double change = tx * uy - ty * ux;
    // within the bracket: towards the sign of f, in the first quadrant
    const double lowest = std::min(std::min(ux, uy), f * change);
    block->settled[i] = (std::abs(change) < kSmall && lowest >= 0.0) ? 1.0 : 0.0;
    const double length = std::sqrt(a * uy * (a * uy) + b * ux * (b * ux));
    const double nx = a * uy / length, ny = b * ux / length;
    block->normal_x[i] = nx;
    block->normal_y[i] = ny;
    block->gap[i] = (x - b * uy) * nx + (y - a * ux) * ny;
    block->curvature[i] = a * b / (length * length * length);
  }
}

void nearest_of_ellipse(double major, double minor, const Vec* points, std::size_t n,
                        Nearest* feet) {
  Block block;
  for (std::size_t first = 0; first < n; first += kBlock) {
    const std::size_t count = std::min(kBlock, n - first);
    for (std::size_t i = 0; i < kBlock; ++i) {
      const Vec point = points[first + std::min(i, count - 1)];
      block.x[i] = std::abs(point.x);
      block.y[i] = std::abs(point.y);
    }
    first_feet(major, minor, &block);
    for (std::size_t i = 0; i < count; ++i) {
      const Vec point = points[first + i];
      if (block.settled[i] == 0.0) {
        feet[first + i] = nearest_of_ellipse(major, minor, point);
        continue;
      }
      const double nx = block.normal_x[i], ny = block.normal_y[i];
      feet[first + i] = {block.gap[i],
                         {point.x < 0.0 ? -nx : nx, point.y < 0.0 ? -ny : ny},
                         block.curvature[i]};
    }
  }
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
  if (kind_ == Kind::kCosine || kind_ == Kind::kSpline) {
    radial_.emplace(rows, n);
  } else if (kind_ != Kind::kEllipse && kind_ != Kind::kSimplified) {
    chain_.emplace(rows, n);
  }
}

Nearest Outline::nearest(Vec point) const {
  if (chain_) return chain_->nearest(point);
  if (radial_) return radial_->nearest(point);
  return kind_ == Kind::kEllipse ? nearest_of_ellipse(major_, minor_, point)
                                 : nearest_of_simplified(major_, minor_, point);
}

void Outline::nearest(const Vec* points, std::size_t n, Nearest* feet) const {
  if (kind_ == Kind::kEllipse) return nearest_of_ellipse(major_, minor_, points, n, feet);
  for (std::size_t i = 0; i < n; ++i) feet[i] = nearest(points[i]);
}

void outline_distance(const double* points, std::size_t n, const Outline& outline,
                      double* result) {
  std::vector<Vec> seen(n);
  for (std::size_t i = 0; i < n; ++i) seen[i] = {points[2 * i], points[2 * i + 1]};
  std::vector<Nearest> feet(n);
  outline.nearest(seen.data(), n, feet.data());
  for (const Nearest& foot : feet) {
    *result++ = foot.gap;
    *result++ = foot.normal.x;
    *result++ = foot.normal.y;
    *result++ = foot.curvature;
  }
}

}  // namespace swgjoint
