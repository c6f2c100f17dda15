// Closest points of displaced flexspline flanks on displaced circular-spline flanks.
//
// Compiled version of swgjoint/fe/plane/tooth_contact.py and of the feet in
// circular_spline.py, which explain the method. Lengths are in metres.

#ifndef SWGJOINT_KERNELS_TOOTH_SEARCH_H_
#define SWGJOINT_KERNELS_TOOTH_SEARCH_H_

#include <cstddef>
#include <cstdint>

#include "flank.h"

namespace swgjoint {

// Piecewise cubic weights of flank nodes. The coefficients (4, intervals, nodes) belong
// to descending powers of the distance from a break, as in scipy's CubicSpline.
struct NodeSpline {
  const double* breaks;
  const double* coefficients;
  std::size_t intervals, nodes;
};

// Piecewise cubic displacements of flanks. The coefficients (flanks, intervals, 4, 2)
// belong to ascending powers of the distance from a break.
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
  bool corner;  // whether the foot is an end of the flank
  Vec rest;     // vector from that end to the point; zero for a perpendicular foot
  double station;  // arc length of the foot
};

// Foot of one point in the mirrored frame of a circular-spline tooth, and its vectors
// in the mirrored sector frame.
struct Seen {
  Foot foot;
  Vec normal, rest;  // those of the foot
  std::int64_t tooth;
};

// Rotation from the mirrored frame of a sector to that of the circular-spline tooth that
// one of its flanks faces. Points of one flank share it.
struct Pose {
  std::int64_t sector, side, tooth;
  double cos, sin;
};

// Constants of the search, with the values of the Python modules.
struct Limits {
  double corner, beyond;  // CORNER, BEYOND of circular_spline.py, per flank length [-]
  double refined;         // change of the arc lengths below which refinement ends [m]
  int refinements;        // largest number of refinement steps
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

  // Foot of a point in a mirrored sector frame. outward: outward normal of the
  // flexspline at the point; start: arc length near the foot, or null to start from the
  // foot on the rigid flank
  Seen see(Vec point, Vec outward, const Pose& pose, bool rigid, const double* start,
           int steps) const;

  // Pose of a flank
  Pose pose_of(std::int64_t sector, std::int64_t side) const;

  // Refine n minima of the gap in place. station: their arc lengths; mirrored: node
  // displacements of their flanks (n, nodes, 2); spacing: half width of the brackets
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
