// Tooth profiles of circular arcs and straight lines, and displaced flanks on them.
//
// The formulas are those of swgjoint/gear/teeth/profile.py, segments.py and
// swgjoint/fe/plane/circular_spline.py, which are the reference of these functions.

#ifndef SWGJOINT_KERNELS_FLANK_H_
#define SWGJOINT_KERNELS_FLANK_H_

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

// Point, outward unit normal and signed curvature of a flank at one arc length.
struct At {
  Vec point, normal;
  double curvature;
};

// One arc or straight line: a row of ToothProfile.table.
struct Piece {
  Vec start, end;
  double length;
  Vec centre;
  double radius;  // zero for a straight line
  double sign;    // +1 convex, -1 concave
  double first, last;  // directions of both ends from the centre [rad]

  // derived
  Vec direction, normal;  // of a straight line
  double middle_cos, middle_sin, half, curvature;
};

// Point where the chain has a corner, with the directions of the chain there.
struct Edge {
  Vec vertex, before, after;
};

class Profile {
 public:
  // table: (n_pieces, 11), edges: (n_edges, 6), both row by row
  Profile(const double* table, std::size_t pieces, const double* edges,
          std::size_t n_edges, double side);

  At evaluate(double s) const;

  // Signed distance of a point, with normal and curvature at its foot; infinite
  // where the point projects on no piece.
  double signed_distance(Vec point, Vec* normal, double* curvature) const;

  double side() const { return side_; }

 private:
  double project(const Piece& piece, Vec point, Vec* normal, bool* inside) const;

  std::vector<Piece> pieces_;
  std::vector<double> stations_;
  std::vector<Edge> edges_;
  double side_;
};

// Interval of increasing breaks that contains s; the end intervals reach beyond.
std::size_t interval_of(const double* breaks, std::size_t n, double s);

// Value at x of the line through increasing points, constant beyond the ends.
double interpolate(const double* at, const double* value, std::size_t n, double x);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_FLANK_H_
