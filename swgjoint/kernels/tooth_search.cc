#include "tooth_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace swgjoint {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Vec rotate(Vec v, double cos, double sin) {
  return {cos * v.x - sin * v.y, sin * v.x + cos * v.y};
}

// Mirror image about the tooth axis, which turns a left flank into a right one.
Vec mirror(Vec v) { return {-v.x, v.y}; }

// Displacement of a flank and its derivative with respect to the arc length.
void evaluate(const FlankSplines& flanks, std::size_t flank, double s, Vec* value,
              Vec* slope) {
  const std::size_t j = interval_of(flanks.breaks, flanks.intervals + 1, s);
  const double* c = flanks.coefficients + 8 * (flanks.intervals * flank + j);
  const double d = s - flanks.breaks[j];
  value->x = c[0] + d * (c[2] + d * (c[4] + d * c[6]));
  value->y = c[1] + d * (c[3] + d * (c[5] + d * c[7]));
  slope->x = c[2] + d * (2.0 * c[4] + d * 3.0 * c[6]);
  slope->y = c[3] + d * (2.0 * c[5] + d * 3.0 * c[7]);
}

}  // namespace

Foot ToothSearch::foot_of(Vec point, Vec facing, std::size_t flank, bool rigid,
                          const double* start, int steps) const {
  Foot foot{};
  bool outside = false;
  double s;
  if (rigid || !start) {
    foot.gap = circular_.signed_distance(point, &foot.normal, &foot.curvature);
    if (rigid) return foot;
    outside = !std::isfinite(foot.gap);
    const double inside = outside ? 0.0 : foot.gap;
    const Vec near = {point.x - inside * foot.normal.x,
                      point.y - inside * foot.normal.y};
    s = interpolate(radii_, stations_, samples_, size(near));
  } else {
    s = *start;
  }
  const double low = flanks_.breaks[0], high = flanks_.breaks[flanks_.intervals];
  const double side = circular_.side();
  double wanted = s;
  for (int k = 0; k < steps; ++k) {
    const At at = circular_.evaluate(s);
    Vec moved, slope;
    evaluate(flanks_, flank, s, &moved, &slope);
    const Vec tangent = {side * at.normal.y + slope.x, side * -at.normal.x + slope.y};
    const Vec rest = point - at.point - moved;
    const double length = size(tangent);
    const Vec unit = {tangent.x / length, tangent.y / length};
    foot.normal = {side * -unit.y, side * unit.x};
    foot.curvature = at.curvature;
    foot.gap = dot(rest, foot.normal);
    const double along = dot(rest, unit) / length;
    wanted = s + along / std::max(1.0 + at.curvature * foot.gap, 0.1);
    s = std::clamp(wanted, low, high);
  }
  foot.station = s;
  foot.corner = std::abs(wanted - s) > limits_.beyond * (high - low);
  if (foot.corner) {
    Vec moved, slope;
    evaluate(flanks_, flank, s, &moved, &slope);
    foot.rest = point - (circular_.evaluate(s).point + moved);
    foot.normal = {-facing.x, -facing.y};
    const bool near =
        size(foot.rest) < limits_.corner * (high - low);
    foot.gap = near ? dot(foot.rest, foot.normal) : kInfinity;
  } else if (outside) {
    foot.gap = kInfinity;
  }
  return foot;
}

Pose ToothSearch::pose_of(std::int64_t sector, std::int64_t side) const {
  const double pitch = 2.0 * kPi / static_cast<double>(teeth_);
  const double sign = side == 0 ? 1.0 : -1.0;
  const double space = std::nearbyint(sign * bearing_[sector] / pitch);
  const double turn = sign * angle_[sector] - (space - 0.5) * pitch;
  Pose pose{sector, side, 0, std::cos(turn), std::sin(turn)};
  pose.tooth = static_cast<std::int64_t>(side == 0 ? space - 1.0 : -space);
  pose.tooth %= teeth_in_model_;
  if (pose.tooth < 0) pose.tooth += teeth_in_model_;
  return pose;
}

Seen ToothSearch::see(Vec point, Vec outward, const Pose& pose, bool rigid,
                      const double* start, int steps) const {
  const double cos = pose.cos, sin = pose.sin;
  Seen seen;
  seen.tooth = pose.tooth;
  const auto flank = static_cast<std::size_t>(2 * seen.tooth + 1 - pose.side);
  seen.foot = foot_of(mirror(rotate(point, cos, sin)), mirror(rotate(outward, cos, sin)),
                      flank, rigid, start, steps);
  seen.normal = rotate(mirror(seen.foot.normal), cos, -sin);
  seen.rest = rotate(mirror(seen.foot.rest), cos, -sin);
  return seen;
}

void ToothSearch::displaced(double s, const double* mirrored, Vec* point, Vec* tangent,
                            double* curvature) const {
  const At at = flexspline_.evaluate(s);
  const std::size_t j = interval_of(spline_.breaks, spline_.intervals + 1, s);
  const double d = s - spline_.breaks[j];
  const std::size_t step = spline_.intervals * spline_.nodes;
  const double* c = spline_.coefficients + spline_.nodes * j;
  Vec moved{}, slope{};
  for (std::size_t k = 0; k < spline_.nodes; ++k, ++c) {
    const double c3 = c[0], c2 = c[step], c1 = c[2 * step], c0 = c[3 * step];
    const double weight = c0 + d * (c1 + d * (c2 + d * c3));
    const double by_s = c1 + d * (2.0 * c2 + d * 3.0 * c3);
    moved.x += weight * mirrored[2 * k];
    moved.y += weight * mirrored[2 * k + 1];
    slope.x += by_s * mirrored[2 * k];
    slope.y += by_s * mirrored[2 * k + 1];
  }
  *point = at.point + moved;
  // tangent of the profile from tip to root: the outward normal turned clockwise
  *tangent = {at.normal.y + slope.x, -at.normal.x + slope.y};
  *curvature = at.curvature;
}

void ToothSearch::refine(std::size_t n, double* station, const double* mirrored,
                         const std::int64_t* sector, const std::int64_t* side,
                         double spacing) const {
  const bool rigid = flanks_.flanks == 0;
  std::vector<double> low(n), high(n), foot(n);
  for (std::size_t i = 0; i < n; ++i) {
    low[i] = std::max(station[i] - spacing, low_);
    high[i] = std::min(station[i] + spacing, high_);
  }
  for (int round = 0; round < limits_.refinements; ++round) {
    double change = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const double s = station[i];
      Vec point, tangent;
      double curvature;
      displaced(s, mirrored + 2 * spline_.nodes * i, &point, &tangent, &curvature);
      const double length = size(tangent);
      const Vec outward = {-tangent.y / length, tangent.x / length};
      const Seen seen = see(point, outward, pose_of(sector[i], side[i]), rigid,
                            round ? &foot[i] : nullptr, round ? 2 : 3);
      foot[i] = seen.foot.station;
      double slope = dot(seen.normal, tangent);
      double relative = curvature + seen.foot.curvature;
      if (seen.foot.corner) {
        // at a corner, find the point of the flank that is closest to it
        slope = dot(seen.rest, tangent);
        relative = 1.0 + curvature * dot(seen.rest, seen.normal);
      }
      // shrink the bracket around the minimum and stay inside
      (slope > 0.0 ? high[i] : low[i]) = s;
      const double newton = s - slope / (std::abs(relative) > 1e-3 ? relative : 1e-3);
      const bool good = relative > 1e-3 && newton >= low[i] && newton <= high[i];
      station[i] = good ? newton : 0.5 * (low[i] + high[i]);
      change = std::max(change, std::abs(station[i] - s));
    }
    if (change < limits_.refined) break;
  }
}

}  // namespace swgjoint
