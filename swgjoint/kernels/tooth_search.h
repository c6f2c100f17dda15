// Closest points of displaced flexspline flanks on displaced circular-spline flanks.
//
// Compiled version of swgjoint/fe/plane/tooth_contact.py and of the feet in
// circular_spline.py, which explain the method. Lengths are in metres.

#ifndef SWGJOINT_KERNELS_TOOTH_SEARCH_H_
#define SWGJOINT_KERNELS_TOOTH_SEARCH_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "flank.h"

namespace swgjoint {

// Piecewise cubic weights of flank nodes. The coefficients (4, intervals, nodes) belong
// to descending powers of the distance from a break, as in scipy's CubicSpline.
struct NodeSpline {
  const double* breaks;
  const double* coefficients;
  std::size_t intervals, nodes;
};

// Displacements of flanks (flanks, nodes, 2) in mirrored frames, as piecewise cubic
// curves. An interval is fitted when a point first faces it; most intervals face none.
class FlankShapes {
 public:
  FlankShapes(NodeSpline spline, const double* nodes, std::size_t flanks)
      : spline_(spline), nodes_(nodes), flanks_(flanks),
        fitted_(spline.intervals * flanks, 0),
        coefficients_(new double[8 * spline.intervals * flanks]) {}

  bool rigid() const { return flanks_ == 0; }
  const NodeSpline& spline() const { return spline_; }
  double low() const { return spline_.breaks[0]; }
  double high() const { return spline_.breaks[spline_.intervals]; }

  // Upper bound of the displacement of a flank
  double largest(std::size_t flank) const;

  // Displacement of a flank and its derivative with respect to the arc length.
  void evaluate(std::size_t flank, double s, Vec* value, Vec* slope) const;

 private:
  void fit(std::size_t flank, std::size_t interval) const;

  NodeSpline spline_;
  const double* nodes_;
  std::size_t flanks_;
  mutable std::vector<char> fitted_;  // (flanks, intervals)
  // (flanks, intervals, 4, 2) of ascending powers of the distance from a break
  std::unique_ptr<double[]> coefficients_;
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
  double past;            // PAST of compiled_search.py, per flank length [-]
  double refined;         // change of the arc lengths below which refinement ends [m]
  int refinements;        // largest number of refinement steps
};

// Place of a point on a flank of the flexspline.
struct Place {
  std::int64_t sector, side;
  double station;
};

// Numbers of gap samples per flank node, and the largest gap and smallest radius of
// points that may touch.
struct Sampling {
  int coarse, dense;  // dense: zero for a fast search
  double limit, radius;
};

// Contact point of two flanks: columns of ToothContact.gather, with the weights of the
// nodes of its two flanks in the gap and in the sliding motion.
struct Meeting {
  double gap;
  Vec normal, point, tangent;
  double slip;
  std::int64_t tooth;
  Vec circular_normal, circular_tangent;
};

class ToothSearch {
 public:
  ToothSearch(const Profile& flexspline, NodeSpline spline, double low, double high,
              const Profile& circular, const double* radii, const double* stations,
              std::size_t samples, FlankShapes flanks, std::int64_t teeth,
              std::int64_t teeth_in_model, const double* angle, const double* bearing,
              Limits limits)
      : flexspline_(flexspline), spline_(spline), low_(low), high_(high),
        circular_(circular), radii_(radii), stations_(stations), samples_(samples),
        flanks_(std::move(flanks)), teeth_(teeth), teeth_in_model_(teeth_in_model), angle_(angle),
        bearing_(bearing), limits_(limits) {}

  // Foot of a point in a mirrored sector frame. outward: outward normal of the
  // flexspline at the point; start: arc length near the foot, or null to start from the
  // foot on the rigid flank
  Seen see(Vec point, Vec outward, const Pose& pose, bool rigid, const double* start,
           int steps) const;

  // Pose of a flank
  Pose pose_of(std::int64_t sector, std::int64_t side) const;

  // Local minima of the gap, sampled and refined. flank: displacements in the sector
  // frames (sectors, 2, nodes, 2); searched: whether to search each flank (sectors, 2)
  std::vector<Place> minima(const double* flank, std::size_t sectors,
                            const bool* searched, const Sampling& sampling) const;

  // Contact point at a place, and weights of its nodes (nodes,) on both flanks; the
  // second ones only for elastic flanks of the circular spline; null for none
  Meeting meet(const double* flank, const Place& place, double* weights,
               double* circular_weights) const;

  bool rigid() const { return flanks_.rigid(); }

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

  // Samples of a flank on the rigid circular spline: arc lengths, displaced points, and
  // lower bounds of their distances from it
  struct Coarse {
    const std::vector<double>& stations;
    std::vector<Vec> points;
    std::vector<double> clear;
  };

  bool place(const double* mirrored, const struct Samples& samples, double radius,
             std::vector<Vec>* points) const;

  // Gaps of samples on the rigid circular spline, with bounds as in Coarse
  std::vector<double> rigid_gaps(const std::vector<Vec>& points,
                                 const struct Samples& samples, const Pose& pose,
                                 double limit, std::vector<double>* clear) const;

  // Gaps of samples on the elastic one; coarse: samples whose bounds spare some of them
  std::vector<double> elastic_gaps(const std::vector<Vec>& points,
                                   const struct Samples& samples, const Pose& pose,
                                   double limit, const Coarse& coarse) const;

  const Profile& flexspline_;
  NodeSpline spline_;
  double low_, high_;
  const Profile& circular_;
  const double *radii_, *stations_;
  std::size_t samples_;
  FlankShapes flanks_;
  std::int64_t teeth_, teeth_in_model_;
  const double *angle_, *bearing_;
  Limits limits_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_TOOTH_SEARCH_H_
