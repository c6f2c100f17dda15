// Complementarity problems with good guesses, eight at a time.
//
// The problems are those of complementarity.h. Near the solutions few contacts are
// active, so that the systems of the active contacts are small and of similar size. Those
// of eight problems are solved at once, each in its own lane of the vectors.

#ifndef SWGJOINT_KERNELS_LANE_PROBLEMS_H_
#define SWGJOINT_KERNELS_LANE_PROBLEMS_H_

#include <cstddef>
#include <vector>

#include "complementarity.h"
#include "dense_factors.h"

namespace swgjoint {

// The strips are not among the unknowns: their approaches follow from the last forces.
// This converges fast if the lines in the matrix are close to the law of the strips.
class LaneSolver {
 public:
  LaneSolver(const Problem& problem, const StripLaw& law);

  // Solve up to kLanes problems, whose arrays are those of StripSolver::solve, one
  // after another. The active set of a problem that is not solved keeps its guess.
  void solve(std::size_t count, const double* offset, const double* tolerance,
             bool* active, double* result, double* approach, double* slope,
             bool* solved);

 private:
  struct Lane {
    bool open = false;      // whether the iteration goes on
    bool changed = false;   // whether the active set differs from that of the system
    bool settled = false;   // whether no contact has violated its state
    std::vector<char> active;
    std::vector<std::size_t> set;  // contacts of the system, in the order of its rows
    std::vector<char> inside;      // whether a contact is one of them
    std::size_t written = 0;       // rows of the system that are not those of the identity
    std::vector<double> known;     // slacks while all unknowns are zero
    std::vector<double> value;     // unknowns where active, slacks elsewhere
    std::vector<double> approach;  // excess of each strip
    std::vector<double> tangent;   // its derivative by the force
    double residual = 0.0;         // largest error of an active equation
    std::size_t fewest = 0;        // violations
    int tries = 0, loops = 0;
  };

  void begin(Lane& lane, const double* offset, const bool* guess);
  // Unknowns of all lanes for their known slacks; factorises the systems if one of the
  // active sets has changed.
  void solve_systems();
  // The system of a lane; false if it is too large.
  bool write(Lane& lane, std::size_t number);
  // Unknowns of a lane and, in the first rows, slacks for the solution of its system.
  void spread(Lane& lane, std::size_t number, std::size_t rows);
  // Whether the approaches of the strips are those that follow from the values. If not,
  // they move there, and the known slacks with them.
  bool follow_strips(Lane& lane, bool by_load);
  // Change of the output by the unknowns and the approaches of the strips
  double output(const Lane& lane) const;
  // Exchange the contacts that violate their state; false if there are none. Clears
  // lane.open if the search makes no progress.
  bool exchange(Lane& lane, double tolerance);

  const Problem& p_;
  const StripLaw& law_;
  std::size_t rows_;            // size of the problems, in whole vectors
  std::size_t strip_rows_ = 0;  // as many rows have all contacts with strips
  std::vector<double> columns_, strip_columns_;  // (size, rows_), (strips, rows_)
  // contacts with strips, and the change of their force by the approach of the strip
  std::vector<std::size_t> members_;
  std::vector<double> yields_;
  Lane lanes_[kLanes];
  std::size_t size_ = 0;  // of the largest system
  std::vector<double> memory_;
  double *systems_, *factors_, *unknowns_;
  // of the strips of one lane: force, its change by the approach, number of contacts
  std::vector<double> force_, yield_;
  std::vector<int> loaded_;
  std::vector<const double*> list_;
  std::vector<double> parts_;
  std::vector<std::size_t> moved_, places_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_LANE_PROBLEMS_H_
