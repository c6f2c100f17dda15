// Vectors of the plane, and points of a curve.

#ifndef SWGJOINT_KERNELS_VEC_H_
#define SWGJOINT_KERNELS_VEC_H_

#include <cmath>

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

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_VEC_H_
