// Tooth profiles of circular arcs and straight lines, and interpolation in tables.
//
// The formulas are those of swgjoint/gear/teeth/profile.py and segments.py, which are
// the reference for these functions. Lengths are in metres.

#ifndef SWGJOINT_KERNELS_FLANK_H_
#define SWGJOINT_KERNELS_FLANK_H_

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace swgjoint {

struct Vec {
  double x, y;
};

inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y}; }
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y}; }
inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y; }
// of lengths of a gear, far from overflow
inline double size(Vec a) { return std::sqrt(dot(a, a)); }

// Point, outward unit normal and signed curvature of a flank at one arc length.
struct At {
  Vec point, normal;
  double curvature;
};

// One arc or straight line: a row of ToothProfile.pieces.
struct Piece {
  Vec start, end;
  double length;
  Vec centre;
  double radius;  // zero for a straight line
  double sign;    // +1 convex, -1 concave
  double first, last;  // polar angles of start and end about the centre [rad]

  // derived from these: direction and outward normal of a straight line
  Vec direction, normal;
  // direction of the middle of an arc from its centre, cosine and sine of half its
  // angle, and its signed curvature [1/m]
  Vec middle;
  double half_cos, half_sin, curvature;
  bool wide;  // whether half the angle exceeds a right angle
};

// Corner between two pieces, with the directions of the profile before and after it.
struct Edge {
  Vec vertex, before, after;
};

class Profile {
 public:
  // table: rows of ToothProfile.pieces (pieces, 11); edges: rows of ToothProfile.edges
  // (n_edges, 6); side: +1 for external, -1 for internal teeth
  Profile(const double* table, std::size_t pieces, const double* edges,
          std::size_t n_edges, double side);

  At evaluate(double s) const;

  // Signed distance of a point, with normal and curvature at its foot; infinite if the
  // point has a foot neither on a piece nor at an edge.
  double signed_distance(Vec point, Vec* normal, double* curvature) const;

  double side() const { return side_; }

 private:
  double project(const Piece& piece, Vec point, Vec* normal, bool* inside) const;

  std::vector<Piece> pieces_;
  std::vector<double> stations_;
  std::vector<Edge> edges_;
  double side_;
};

// Index of the interval, between n increasing breaks, that contains s. The first and
// the last interval also contain the values beyond the breaks.
std::size_t interval_of(const double* breaks, std::size_t n, double s);

// Piecewise linear interpolation at x between n values at increasing points; constant
// beyond the ends.
double interpolate(const double* at, const double* value, std::size_t n, double x);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_FLANK_H_
