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

// Weights of the nodes at an arc length and their derivatives.
template <typename Take>
void weigh(const NodeSpline& spline, double s, Take take) {
  const std::size_t j = interval_of(spline.breaks, spline.intervals + 1, s);
  const double d = s - spline.breaks[j];
  const std::size_t step = spline.intervals * spline.nodes;
  const double* c = spline.coefficients + spline.nodes * j;
  for (std::size_t k = 0; k < spline.nodes; ++k, ++c) {
    const double c3 = c[0], c2 = c[step], c1 = c[2 * step], c0 = c[3 * step];
    take(k, c0 + d * (c1 + d * (c2 + d * c3)), c1 + d * (2.0 * c2 + d * 3.0 * c3));
  }
}

// Displacements of one flank (nodes, 2) in its mirrored frame.
void to_mirrored(const double* flank, std::size_t nodes, std::int64_t sector,
                 std::int64_t side, double* mirrored) {
  const auto number = static_cast<std::size_t>(2 * sector + side);
  const double* from = flank + 2 * nodes * number;
  const double sign = side == 0 ? 1.0 : -1.0;
  for (std::size_t k = 0; k < nodes; ++k) {
    mirrored[2 * k] = sign * from[2 * k];
    mirrored[2 * k + 1] = from[2 * k + 1];
  }
}

}  // namespace

// Equally spaced points of a flank, with the weights of its nodes there.
struct Samples {
  std::vector<double> stations, weights;
  std::vector<At> at;

  Samples(const Profile& profile, const NodeSpline& spline, double low, double high,
          int per_node) {
    const std::size_t n = static_cast<std::size_t>(per_node) * spline.nodes;
    const double spacing = (high - low) / static_cast<double>(n - 1);
    for (std::size_t i = 0; i < n; ++i) {
      const double s = i + 1 < n ? low + static_cast<double>(i) * spacing : high;
      stations.push_back(s);
      at.push_back(profile.evaluate(s));
      weigh(spline, s, [&](std::size_t, double w, double) { weights.push_back(w); });
    }
  }
};

void FlankShapes::fit(std::size_t flank, std::size_t interval) const {
  const double* from = nodes_ + 2 * spline_.nodes * flank;
  double* to = coefficients_.get() + 8 * (spline_.intervals * flank + interval);
  for (std::size_t power = 0; power < 4; ++power, to += 2) {
    const double* c =
        spline_.coefficients +
        spline_.nodes * (spline_.intervals * (3 - power) + interval);
    double x = 0.0, y = 0.0;
    for (std::size_t k = 0; k < spline_.nodes; ++k) {
      x += c[k] * from[2 * k];
      y += c[k] * from[2 * k + 1];
    }
    to[0] = x;
    to[1] = y;
  }
}

double FlankShapes::largest(std::size_t flank) const {
  const double* nodes = nodes_ + 2 * spline_.nodes * flank;
  double square = 0.0;
  for (std::size_t k = 0; k < spline_.nodes; ++k, nodes += 2) {
    square = std::max(square, nodes[0] * nodes[0] + nodes[1] * nodes[1]);
  }
  // a spline through smooth values overshoots by less than they are
  return 2.0 * std::sqrt(square);
}

void FlankShapes::evaluate(std::size_t flank, double s, Vec* value, Vec* slope) const {
  const std::size_t j = interval_of(spline_.breaks, spline_.intervals + 1, s);
  const std::size_t number = spline_.intervals * flank + j;
  if (!fitted_[number]) {
    fit(flank, j);
    fitted_[number] = 1;
  }
  const double* c = coefficients_.get() + 8 * number;
  const double d = s - spline_.breaks[j];
  value->x = c[0] + d * (c[2] + d * (c[4] + d * c[6]));
  value->y = c[1] + d * (c[3] + d * (c[5] + d * c[7]));
  slope->x = c[2] + d * (2.0 * c[4] + d * 3.0 * c[6]);
  slope->y = c[3] + d * (2.0 * c[5] + d * 3.0 * c[7]);
}

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
  const double low = flanks_.low(), high = flanks_.high();
  const double side = circular_.side();
  double wanted = s;
  for (int k = 0; k < steps; ++k) {
    const At at = circular_.evaluate(s);
    Vec moved, slope;
    flanks_.evaluate(flank, s, &moved, &slope);
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
    flanks_.evaluate(flank, s, &moved, &slope);
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
  Vec moved{}, slope{};
  weigh(spline_, s, [&](std::size_t k, double weight, double by_s) {
    moved.x += weight * mirrored[2 * k];
    moved.y += weight * mirrored[2 * k + 1];
    slope.x += by_s * mirrored[2 * k];
    slope.y += by_s * mirrored[2 * k + 1];
  });
  *point = at.point + moved;
  // tangent of the profile from tip to root: the outward normal turned clockwise
  *tangent = {at.normal.y + slope.x, -at.normal.x + slope.y};
  *curvature = at.curvature;
}

void ToothSearch::refine(std::size_t n, double* station, const double* mirrored,
                         const std::int64_t* sector, const std::int64_t* side,
                         double spacing) const {
  const bool rigid = flanks_.rigid();
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

// Displaced samples of a flank; false if none of them reaches a radius.
bool ToothSearch::place(const double* mirrored, const Samples& samples, double radius,
                        std::vector<Vec>* points) const {
  const std::size_t n = samples.stations.size(), nodes = spline_.nodes;
  points->resize(n);
  bool deep = false;
  for (std::size_t i = 0; i < n; ++i) {
    const double* weights = samples.weights.data() + nodes * i;
    Vec moved{};
    for (std::size_t k = 0; k < nodes; ++k) {
      moved.x += weights[k] * mirrored[2 * k];
      moved.y += weights[k] * mirrored[2 * k + 1];
    }
    (*points)[i] = samples.at[i].point + moved;
    deep |= size((*points)[i]) > radius;
  }
  return deep;
}

// A sample cannot be closer to the circular spline than its neighbour is, less the
// distance between the two. Samples that are thus known to be farther than the largest
// gap of interest get a gap of infinity.
std::vector<double> ToothSearch::rigid_gaps(const std::vector<Vec>& points,
                                            const Samples& samples, const Pose& pose,
                                            double limit,
                                            std::vector<double>* clear) const {
  std::vector<double> gaps;
  clear->clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double known = i ? clear->back() - size(points[i] - points[i - 1]) : 0.0;
    if (known > limit) {
      gaps.push_back(kInfinity);
      clear->push_back(known);
      continue;
    }
    const Vec outward = samples.at[i].normal;
    gaps.push_back(see(points[i], outward, pose, true, nullptr, 2).foot.gap);
    const Vec there = mirror(rotate(points[i], pose.cos, pose.sin));
    clear->push_back(std::min(gaps.back(), circular_.distance_of_ends(there)));
  }
  return gaps;
}

std::vector<double> ToothSearch::elastic_gaps(const std::vector<Vec>& points,
                                              const Samples& samples, const Pose& pose,
                                              double limit, const Coarse& coarse) const {
  double moved = 0.0, corner = 0.0;
  Vec ends[2] = {};
  if (!rigid()) {
    moved = flanks_.largest(static_cast<std::size_t>(2 * pose.tooth + 1 - pose.side));
    corner = limits_.corner * (flanks_.high() - flanks_.low()) + moved;
    ends[0] = circular_.evaluate(flanks_.low()).point;
    ends[1] = circular_.evaluate(flanks_.high()).point;
  }
  std::vector<double> gaps;
  std::size_t k = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    while (k + 2 < coarse.points.size() &&
           coarse.stations[k + 1] <= samples.stations[i])
      ++k;
    double known = -kInfinity;
    for (const std::size_t j : {k, k + 1}) {
      known = std::max(known, coarse.clear[j] - size(points[i] - coarse.points[j]));
    }
    const Vec there = mirror(rotate(points[i], pose.cos, pose.sin));
    // an end of an elastic flank may touch beside its normal
    const bool beside =
        !rigid() && std::min(size(there - ends[0]), size(there - ends[1])) <= corner;
    if (!beside && known > limit + moved) {
      gaps.push_back(kInfinity);
      continue;
    }
    // a foot near a close point has almost its radius; far from ends there is one
    const double start = interpolate(radii_, stations_, samples_, size(there));
    const bool close = !beside && !rigid() && known > -limit && moved < limit;
    const Vec outward = samples.at[i].normal;
    gaps.push_back(see(points[i], outward, pose, rigid(), close ? &start : nullptr,
                       close ? 3 : 2)
                       .foot.gap);
  }
  return gaps;
}

std::vector<Place> ToothSearch::minima(const double* flank, std::size_t sectors,
                                       const bool* searched,
                                       const Sampling& sampling) const {
  const Samples coarse(flexspline_, spline_, low_, high_, sampling.coarse);
  std::vector<Samples> fine;
  if (sampling.dense > 0) fine.emplace_back(flexspline_, spline_, low_, high_, sampling.dense);
  const Samples& used = fine.empty() ? coarse : fine.front();
  std::vector<Place> found;
  std::vector<double> mirrored(2 * spline_.nodes), of_found, stations;
  Coarse known{coarse.stations, {}, {}};
  std::vector<Vec> points;
  std::vector<std::int64_t> sector, side;
  for (std::int64_t s = 0; s < static_cast<std::int64_t>(sectors); ++s) {
    for (std::int64_t f = 0; f < 2; ++f) {
      if (!searched[2 * s + f]) continue;
      to_mirrored(flank, spline_.nodes, s, f, mirrored.data());
      const Pose pose = pose_of(s, f);
      if (!place(mirrored.data(), coarse, sampling.radius, &known.points)) continue;
      std::vector<double> gap =
          rigid_gaps(known.points, coarse, pose, sampling.limit, &known.clear);
      if (!(*std::min_element(gap.begin(), gap.end()) < sampling.limit)) continue;
      if (!fine.empty()) {
        if (!place(mirrored.data(), used, sampling.radius, &points)) continue;
        gap = elastic_gaps(points, used, pose, sampling.limit, known);
      }
      for (std::size_t k = 0; k < gap.size(); ++k) {
        const double before = k > 0 ? gap[k - 1] : kInfinity;
        const double after = k + 1 < gap.size() ? gap[k + 1] : kInfinity;
        if (std::isfinite(gap[k]) && gap[k] <= before && gap[k] < after &&
            gap[k] < sampling.limit) {
          stations.push_back(used.stations[k]);
          sector.push_back(s);
          side.push_back(f);
          of_found.insert(of_found.end(), mirrored.begin(), mirrored.end());
        }
      }
    }
  }
  refine(stations.size(), stations.data(), of_found.data(), sector.data(), side.data(),
         used.stations[1] - used.stations[0]);
  for (std::size_t i = 0; i < stations.size(); ++i) {
    found.push_back({sector[i], side[i], stations[i]});
  }
  return found;
}

Meeting ToothSearch::meet(const double* flank, const Place& place, double* weights,
                          double* circular_weights) const {
  std::vector<double> mirrored(2 * spline_.nodes);
  to_mirrored(flank, spline_.nodes, place.sector, place.side, mirrored.data());
  Vec point, tangent;
  double curvature;
  displaced(place.station, mirrored.data(), &point, &tangent, &curvature);
  const double length = size(tangent);
  const Seen seen = see(point, {-tangent.y / length, tangent.x / length},
                        pose_of(place.sector, place.side), rigid(), nullptr, 3);
  if (weights) {
    weigh(spline_, place.station,
          [&](std::size_t k, double weight, double) { weights[k] = weight; });
  }
  Meeting meeting{};
  meeting.slip = std::numeric_limits<double>::quiet_NaN();
  if (!rigid()) {
    if (circular_weights) {
      weigh(flanks_.spline(), seen.foot.station,
            [&](std::size_t k, double weight, double) { circular_weights[k] = weight; });
    }
    meeting.slip = place.station + seen.foot.station;
  }
  // a flank and the flank that it faces are on opposite sides of their teeth
  const double sign = place.side == 0 ? 1.0 : -1.0;
  const Vec out = seen.foot.normal;
  meeting.gap = seen.foot.gap;
  // a corner that has slipped past the tip of the flexspline touches nothing
  const double corner = place.station - dot(seen.rest, tangent) / length;
  if (seen.foot.corner && corner < low_ - limits_.past * (high_ - low_)) {
    meeting.gap = kInfinity;
  }
  meeting.normal = {sign * seen.normal.x, seen.normal.y};
  meeting.point = {sign * point.x, point.y};
  // in the mirrored frame the flexspline's normal is -n: its tangent is J n
  meeting.tangent = {sign * -seen.normal.y, seen.normal.x};
  meeting.tooth = seen.tooth;
  meeting.circular_normal = {-sign * out.x, out.y};
  meeting.circular_tangent = {-sign * out.y, -out.x};
  return meeting;
}

}  // namespace swgjoint
