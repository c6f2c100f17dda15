#include "flank.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swgjoint {
namespace {

constexpr int kColumns = 11;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

Profile::Profile(const double* table, std::size_t pieces, const double* edges,
                 std::size_t n_edges, const Curves& curves, double side)
    : side_(side) {
  std::size_t nodes = 0, polynomials = 0;
  stations_.push_back(0.0);
  for (std::size_t k = 0; k < pieces; ++k) {
    const double* row = table + kColumns * k;
    Piece piece{};
    piece.start = {row[0], row[1]};
    piece.end = {row[2], row[3]};
    piece.length = row[4];
    piece.centre = {row[5], row[6]};
    piece.radius = row[7];
    piece.sign = row[8];
    piece.first = row[9];
    piece.last = row[10];
    piece.curve = -1;
    if (curves.intervals[k] > 0) {
      const auto intervals = static_cast<std::size_t>(curves.intervals[k]);
      piece.curve = static_cast<int>(curves_.size());
      curves_.emplace_back(curves.stations + nodes,
                           curves.coefficients + 12 * polynomials, intervals, side);
      nodes += intervals + 1;
      polynomials += intervals;
    } else if (piece.radius == 0.0) {
      piece.direction = {(piece.end.x - piece.start.x) / piece.length,
                         (piece.end.y - piece.start.y) / piece.length};
      piece.normal = {side * -piece.direction.y, side * piece.direction.x};
    } else {
      const double middle = 0.5 * (piece.first + piece.last);
      const double half = 0.5 * std::abs(piece.last - piece.first) * (1.0 + 1e-9);
      piece.middle = {std::cos(middle), std::sin(middle)};
      piece.half_cos = std::cos(half);
      piece.half_sin = std::sin(half);
      piece.wide = piece.half_cos < 0.0;
      piece.curvature = piece.sign / piece.radius;
    }
    pieces_.push_back(piece);
    stations_.push_back(stations_.back() + piece.length);
  }
  for (std::size_t k = 0; k < n_edges; ++k) {
    const double* row = edges + 6 * k;
    edges_.push_back({{row[0], row[1]}, {row[2], row[3]}, {row[4], row[5]}});
  }
}

At Profile::evaluate(double s) const {
  const std::size_t k = interval_of(stations_.data(), stations_.size(), s);
  const Piece& piece = pieces_[k];
  const double along = s - stations_[k];
  if (piece.curve >= 0) return curves_[piece.curve].evaluate(along);
  if (piece.radius == 0.0) {
    return {{piece.start.x + along * piece.direction.x,
             piece.start.y + along * piece.direction.y},
            piece.normal,
            0.0};
  }
  const double rate = (piece.last - piece.first) / piece.length;
  const double angle = piece.first + rate * along;
  const double c = std::cos(angle), d = std::sin(angle);
  return {{piece.centre.x + piece.radius * c, piece.centre.y + piece.radius * d},
          {piece.sign * c, piece.sign * d},
          piece.curvature};
}

double Profile::project(const Piece& piece, Vec point, Vec* normal, double* curvature,
                        bool* inside) const {
  if (piece.curve >= 0)
    return curves_[piece.curve].project(point, normal, curvature, inside);
  *curvature = piece.curvature;
  if (piece.radius == 0.0) {
    const Vec rel = point - piece.start;
    const double along = dot(rel, piece.direction);
    *inside = along >= 0.0 && along <= piece.length;
    *normal = piece.normal;
    return dot(rel, piece.normal);
  }
  const Vec rel = point - piece.centre;
  const double r = size(rel);
  const double ahead = dot(rel, piece.middle);
  const double beside = std::abs(rel.y * piece.middle.x - rel.x * piece.middle.y);
  // the sine tells small angles apart, the cosine those beyond a right angle
  *inside = piece.wide ? ahead >= r * piece.half_cos
                       : ahead >= 0.0 && beside <= r * piece.half_sin;
  const double scale = piece.sign / std::max(r, 1e-300);
  *normal = {scale * rel.x, scale * rel.y};
  return piece.sign * (r - piece.radius);
}

double Profile::signed_distance(Vec point, Vec* normal, double* curvature) const {
  double best = kInfinity;
  *normal = {0.0, 0.0};
  *curvature = 0.0;
  for (const Piece& piece : pieces_) {
    Vec here;
    double bend;
    bool inside;
    const double distance = project(piece, point, &here, &bend, &inside);
    if (inside && std::abs(distance) < std::abs(best)) {
      best = distance;
      *normal = here;
      *curvature = bend;
    }
  }
  for (const Edge& edge : edges_) {
    // between the normals of both pieces at an edge, the edge is the closest point
    const Vec rel = point - edge.vertex;
    const double r = size(rel);
    const bool wedge = dot(rel, edge.before) >= 0.0 && dot(rel, edge.after) <= 0.0;
    if (wedge && r < std::abs(best) && r > 0.0) {
      best = r;
      *normal = {rel.x / r, rel.y / r};
      *curvature = 1.0 / std::max(r, 1e-9);
    }
  }
  return best;
}

double Profile::distance_of_ends(Vec point) const {
  const Vec from = point - pieces_.front().start, to = point - pieces_.back().end;
  return std::min(size(from), size(to));
}

double interpolate(const double* at, const double* value, std::size_t n, double x) {
  if (x <= at[0]) return value[0];
  if (x >= at[n - 1]) return value[n - 1];
  const std::size_t k = interval_of(at, n, x);
  const double slope = (value[k + 1] - value[k]) / (at[k + 1] - at[k]);
  return slope * (x - at[k]) + value[k];
}

}  // namespace swgjoint
