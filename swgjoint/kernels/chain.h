// Distance of points from an outline of arcs, straight lines and parabolas.
//
// Compiled twin of signed_distance in swgjoint/gear/wave_generators/chain.py and of the
// feet in pieces.py, which explain the methods.

#ifndef SWGJOINT_KERNELS_CHAIN_H_
#define SWGJOINT_KERNELS_CHAIN_H_

#include <cstddef>
#include <vector>

#include "vec.h"

namespace swgjoint {

// Kinds of the rows of an outline, see ClosedCurve.rows
enum class Kind {
  kEllipse,
  kSimplified,
  kArc,
  kLine,
  kParabola,
  kCosine,
  kSpline
};

constexpr std::size_t kColumns = 7;

// Distance of a point, positive outside, with normal and curvature at its foot.
struct Nearest {
  double gap;
  Vec normal;
  double curvature;
};

class Chain {
 public:
  // rows: (n, kColumns), one per piece in counter-clockwise order
  Chain(const double* rows, std::size_t n);

  Nearest nearest(Vec point) const;

 private:
  struct Piece {
    Kind kind;
    Vec start, tangent;  // point and unit tangent at its start
    Vec origin;          // centre of an arc, apex of a parabola
    Vec axis;            // middle normal of an arc, direction of a line, local x axis
    Vec first, last;     // normals at both ends of an arc
    double size;         // radius, length of a line, coefficient of a parabola
    double low, high;    // half angle of an arc in high; limits of x of a parabola
  };

  static Piece arc(const double* row);
  static Piece line(const double* row);
  static Piece parabola(const double* row);
  // Foot of a point on a piece, with the normal and the curvature there
  static At foot(const Piece& piece, Vec point);

  std::vector<Piece> pieces_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_CHAIN_H_
