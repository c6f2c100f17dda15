#include "chain.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swgjoint {
namespace {

constexpr int kIterations = 60;
constexpr double kConverged = 1e-15;

Vec direction(double angle) { return {std::cos(angle), std::sin(angle)}; }

// Vector by its components along an axis and along the axis turned by a right angle
Vec from_axis(Vec axis, double along, double across) {
  return {axis.x * along - axis.y * across, axis.y * along + axis.x * across};
}

// Largest root of x^3 + c x = h for h >= 0
double largest_root(double c, double h) {
  double x = std::cbrt(h) + std::sqrt(std::max(-c, 0.0));
  if (c > 0.0) x = std::min(x, h / c);
  for (int k = 0; k < kIterations; ++k) {
    const double slope = std::max(3.0 * x * x + c, 1e-300);
    const double step = (x * (x * x + c) - h) / slope;
    x -= step;
    if (std::abs(step) <= kConverged * std::abs(x)) break;
  }
  return x;
}

// Point of a parabola a x^2 below the x axis, with outward normal and curvature
At on_parabola(Vec apex, Vec axis, double a, double x) {
  const double u = 2.0 * a * x, size = std::sqrt(1.0 + u * u);
  return {apex + from_axis(axis, x, -0.5 * u * x),
          from_axis(axis, u / size, 1.0 / size), 2.0 * a / (size * size * size)};
}

}  // namespace

Chain::Chain(const double* rows, std::size_t n) {
  pieces_.reserve(n);
  for (std::size_t k = 0; k < n; ++k, rows += kColumns) {
    switch (static_cast<Kind>(static_cast<int>(rows[0]))) {
      case Kind::kArc:
        pieces_.push_back(arc(rows));
        break;
      case Kind::kLine:
        pieces_.push_back(line(rows));
        break;
      default:
        pieces_.push_back(parabola(rows));
    }
  }
}

Chain::Piece Chain::arc(const double* row) {
  Piece piece{};
  piece.kind = Kind::kArc;
  piece.origin = {row[1], row[2]};
  piece.size = row[3];
  piece.first = direction(row[4]);
  piece.last = direction(row[5]);
  piece.axis = direction(0.5 * (row[4] + row[5]));
  piece.high = 0.5 * (row[5] - row[4]);
  piece.start = piece.origin + from_axis(piece.first, piece.size, 0.0);
  piece.tangent = {-piece.first.y, piece.first.x};
  return piece;
}

Chain::Piece Chain::line(const double* row) {
  Piece piece{};
  piece.kind = Kind::kLine;
  piece.start = {row[1], row[2]};
  const Vec along = Vec{row[3], row[4]} - piece.start;
  piece.size = size(along);
  piece.axis = {along.x / piece.size, along.y / piece.size};
  piece.tangent = piece.axis;
  return piece;
}

Chain::Piece Chain::parabola(const double* row) {
  Piece piece{};
  piece.kind = Kind::kParabola;
  piece.origin = {row[1], row[2]};
  piece.size = row[3];
  piece.high = row[4];
  piece.low = row[5];
  piece.axis = direction(row[6]);
  const At at = on_parabola(piece.origin, piece.axis, piece.size, piece.high);
  piece.start = at.point;
  piece.tangent = {-at.normal.y, at.normal.x};
  return piece;
}

At Chain::foot(const Piece& piece, Vec point) {
  if (piece.kind == Kind::kArc) {
    const Vec rel = point - piece.origin;
    const double r = size(rel);
    const double across = piece.axis.x * rel.y - piece.axis.y * rel.x;
    Vec normal = piece.axis;
    if (std::abs(std::atan2(across, dot(piece.axis, rel))) > piece.high) {
      normal = across > 0.0 ? piece.last : piece.first;
    } else if (r > 0.0) {
      normal = {rel.x / r, rel.y / r};
    }
    return {piece.origin + from_axis(normal, piece.size, 0.0), normal, 1.0 / piece.size};
  }
  if (piece.kind == Kind::kLine) {
    const double s = std::clamp(dot(point - piece.start, piece.axis), 0.0, piece.size);
    return {piece.start + from_axis(piece.axis, s, 0.0),
            {piece.axis.y, -piece.axis.x},
            0.0};
  }
  const Vec rel = point - piece.origin;
  const double a = piece.size, p = dot(rel, piece.axis);
  const double q = piece.axis.x * rel.y - piece.axis.y * rel.x;
  const double scale = 1.0 / (2.0 * a * a);
  const double root = largest_root((1.0 + 2.0 * a * q) * scale, std::abs(p) * scale);
  return on_parabola(piece.origin, piece.axis, a,
                     std::clamp(std::copysign(root, p), piece.low, piece.high));
}

Nearest Chain::nearest(Vec point) const {
  Nearest result{0.0, {0.0, 0.0}, 0.0};
  double least = std::numeric_limits<double>::infinity();
  const auto take = [&](const Piece& piece) {
    const At at = foot(piece, point);
    const Vec rel = point - at.point;
    const double length = size(rel);
    if (!(length < least)) return;
    least = length;
    result = {dot(rel, at.normal), at.normal, at.curvature};
  };
  const auto after = [point](const Piece& piece) {
    return dot(piece.tangent, point) >= dot(piece.tangent, piece.start);
  };
  // pieces whose end normals enclose the point; far inside, where normals of a parabola
  // intersect, there may be none, and all are searched
  const bool begin = after(pieces_.front());
  bool before = begin, any = false;
  for (std::size_t k = 0; k < pieces_.size(); ++k) {
    const bool next = k + 1 < pieces_.size() ? after(pieces_[k + 1]) : begin;
    if (before && !next) {
      take(pieces_[k]);
      any = true;
    }
    before = next;
  }
  if (!any) std::for_each(pieces_.begin(), pieces_.end(), take);
  return result;
}

}  // namespace swgjoint
