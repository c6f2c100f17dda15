// Tooth profiles of circular arcs, straight lines and smooth curves, and interpolation in
// tables.
//
// The formulas are those of swgjoint/gear/teeth/profile.py and segments.py, which are
// the reference for these functions. Lengths are in metres.

#ifndef SWGJOINT_KERNELS_FLANK_H_
#define SWGJOINT_KERNELS_FLANK_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "smooth_curve.h"
#include "vec.h"

namespace swgjoint {

// One arc, straight line or smooth curve: a row of ToothProfile.pieces.
struct Piece {
  Vec start, end;
  double length;
  Vec centre;
  double radius;  // zero except for an arc
  double sign;    // +1 convex, -1 concave
  double first, last;  // polar angles of start and end about the centre [rad]

  // derived from these: direction and outward normal of a straight line
  Vec direction, normal;
  // direction of the middle of an arc from its centre, cosine and sine of half its
  // angle, and its signed curvature [1/m]
  Vec middle;
  double half_cos, half_sin, curvature;
  bool wide;  // whether half the angle exceeds a right angle
  int curve;  // index of the smooth curve; -1 for an arc or a straight line
};

// Smooth curves of a profile, one after the other: the number of intervals of every piece
// (zero for an arc or a straight line), arc lengths of the nodes, and coefficients.
struct Curves {
  const std::int64_t* intervals;
  const double* stations;
  const double* coefficients;
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
          std::size_t n_edges, const Curves& curves, double side);

  At evaluate(double s) const;

  // Signed distance of a point, with normal and curvature at its foot; infinite if the
  // point has a foot neither on a piece nor at an edge.
  double signed_distance(Vec point, Vec* normal, double* curvature) const;

  // Distance of a point from the closer end of the profile
  double distance_of_ends(Vec point) const;

  double side() const { return side_; }

 private:
  double project(const Piece& piece, Vec point, Vec* normal, double* curvature,
                 bool* inside) const;

  std::vector<Piece> pieces_;
  std::vector<SmoothCurve> curves_;
  std::vector<double> stations_;
  std::vector<Edge> edges_;
  double side_;
};

// Piecewise linear interpolation at x between n values at increasing points; constant
// beyond the ends.
double interpolate(const double* at, const double* value, std::size_t n, double x);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_FLANK_H_
