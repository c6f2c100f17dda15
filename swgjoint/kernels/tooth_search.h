// Closest points of displaced flexspline flanks on displaced circular-spline flanks.
//
// The compiled twin of swgjoint/fe/plane/tooth_contact.py, which explains the method.

#ifndef SWGJOINT_KERNELS_TOOTH_SEARCH_H_
#define SWGJOINT_KERNELS_TOOTH_SEARCH_H_

#include <cstddef>
#include <cstdint>

#include "flank.h"

namespace swgjoint {

// Piecewise cubic weights of flank nodes: coefficients (4, intervals, nodes) of
// descending powers, as in scipy's CubicSpline.
struct NodeSpline {
  const double* breaks;
  const double* coefficients;
  std::size_t intervals, nodes;
};

// Displacements of flanks: coefficients (flanks, intervals, 4, 2), ascending powers.
struct FlankSplines {
  const double* breaks;
  const double* coefficients;
  std::size_t flanks, intervals;
};

// Foot of one point on a flank of the circular spline.
struct Foot {
  double gap;
  Vec normal;
  double curvature;
  bool corner;  // the foot is an end of the flank
  Vec rest;     // from that end to the point; zero otherwise
  double station;
};

// Foot of one point, with vectors in the mirrored sector frame.
struct Seen {
  Foot foot;
  Vec normal, rest;
  std::int64_t tooth;
};

// Limits of the search, constants of the Python modules.
struct Limits {
  double corner, beyond;  // of circular_spline.py, as fractions of the flank [-]
  double refined;         // change at which a refinement ends [m]
  int refinements;
};

class ToothSearch {
 public:
  ToothSearch(const Profile& flexspline, NodeSpline spline, double low, double high,
              const Profile& circular, const double* radii, const double* stations,
              std::size_t samples, FlankSplines flanks, std::int64_t teeth,
              std::int64_t teeth_in_model, const double* angle, const double* bearing,
              Limits limits)
      : flexspline_(flexspline), spline_(spline), low_(low), high_(high),
        circular_(circular), radii_(radii), stations_(stations), samples_(samples),
        flanks_(flanks), teeth_(teeth), teeth_in_model_(teeth_in_model), angle_(angle),
        bearing_(bearing), limits_(limits) {}

  // start: arc length near the foot, null to begin at the foot on the rigid flank
  Seen see(Vec point, Vec outward, std::int64_t sector, std::int64_t side, bool rigid,
           const double* start, int steps) const;

  // Refine n minima in place; mirrored: node displacements (n, nodes, 2)
  void refine(std::size_t n, double* station, const double* mirrored,
              const std::int64_t* sector, const std::int64_t* side,
              double spacing) const;

 private:
  Foot foot_of(Vec point, Vec facing, std::size_t flank, bool rigid,
               const double* start, int steps) const;
  void displaced(double s, const double* mirrored, Vec* point, Vec* tangent,
                 double* curvature) const;

  const Profile& flexspline_;
  NodeSpline spline_;
  double low_, high_;
  const Profile& circular_;
  const double *radii_, *stations_;
  std::size_t samples_;
  FlankSplines flanks_;
  std::int64_t teeth_, teeth_in_model_;
  const double *angle_, *bearing_;
  Limits limits_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_TOOTH_SEARCH_H_
