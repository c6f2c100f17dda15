// Contact of the bore of a flexspline with a rigid wave generator.
//
// Compiled twins of the numpy code in swgjoint/fe/plane/bore_contact.py and linearise.py,
// which explain the method. Arrays: nodes (count, m, 2), stations (count, q) with
// q = p times the number of intervals.

#ifndef SWGJOINT_KERNELS_BORE_H_
#define SWGJOINT_KERNELS_BORE_H_

#include <cstddef>
#include <cstdint>

#include "outline.h"

namespace swgjoint {

// Stations between bore nodes: p in each interval, which follow width / 2 nodes.
struct Stations {
  const double* weights;  // derivatives by the nodes of an interval (p, 2, width)
  const double* by_node;  // the same (width, 2, p)
  std::size_t p, width, intervals;

  std::size_t count() const { return p * intervals; }
  std::size_t nodes() const { return width / 2 + intervals - 1; }
};

// A turned and shifted outline. Where an interval neither touches nor has a gap below
// far in its middle, all its stations share the values of the middle.
struct Support {
  const Outline& outline;
  double angle;
  Vec offset;
  double far;
};

// Gap, normal (count, q, 2) and curvature of the parallel curve at every station.
void bore_gaps(const Stations& stations, const Support& support, const double* nodes,
               const bool* touching, std::size_t count, double* gap, double* normal,
               double* curvature);

// Adds energy gradient (count, n) and tangent (count, n, n) of springs at the stations,
// zero where there is none. Without a tangent (null) only the gradient; without
// curvatures (null) the forces do not turn.
// into: degrees of freedom of the nodes (2 m,); sign: their signs (count, n), null for 1.
void bore_forces(const Stations& stations, const double* spring, const double* gap,
                 const double* normal, const double* curvature, const std::int64_t* into,
                 const double* sign, std::size_t count, std::size_t n, double* gradient,
                 double* tangent);

// Gaps after an increment of the degrees of freedom (count, n): result = gap plus the
// shift of each station along its normal.
void bore_gaps_after(const Stations& stations, const double* gap, const double* normal,
                     const std::int64_t* into, const double* increment,
                     std::size_t count, std::size_t n, double* result);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_BORE_H_
