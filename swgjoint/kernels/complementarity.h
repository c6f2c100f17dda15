// Complementarity problems that share one matrix, with contact strips that indent.
//
// The compiled twin of StripProblems in swgjoint/fe/common/strip_problems.py, which
// explains the problem.

#ifndef SWGJOINT_KERNELS_COMPLEMENTARITY_H_
#define SWGJOINT_KERNELS_COMPLEMENTARITY_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "dense_factors.h"

namespace swgjoint {

// The law h(F) = softness / 2 F ln(1 + widest / (narrowest + growth F)) of every strip
// and the line slope F + offset that the matrix contains instead.
struct StripLaw {
  double softness, widest, narrowest, growth;
  const double* slope;   // (strips,)
  const double* offset;  // (strips,)
  std::size_t strips;

  // h(F) minus the line, and its derivative.
  double excess(std::size_t strip, double force, double* derivative) const;
};

// Error of an active equation up to which a solution is accepted, in tolerances
constexpr double kResidual = 1e-4;
// Contacts are exchanged whose violation is at least this fraction of the largest one:
// the first as long as the number of violations falls, the second if it does not. If all
// of them were exchanged, the rim could lift off the wave generator in one step, and the
// search would go around in circles.
constexpr double kViolated = 0.05, kMostViolated = 0.5;

// What all problems share. Everything is scaled to a unit diagonal of the matrix.
struct Problem {
  std::size_t size;
  const double* columns;        // (size, size), one column of the matrix after another
  const double* strip_columns;  // (strips, size), change of the offset by an approach
  const std::int64_t* strip;    // (size,), -1 for contacts without a strip
  const bool* closed;           // (size,), contacts whose slack is their force
  const double* force_unit;     // (size,) [N]
  const double* direction;      // (size,), change of the offset per unit of load
  const double* by_value;       // (size,), change of the output per unknown
  const double* by_strip;       // (strips,), change of the output per approach
  double tolerance_m;           // largest error of an approach [m]
  int tries, singles;           // rule of the exchanges, see solve_many
};

class StripSolver {
 public:
  StripSolver(const Problem& problem, const StripLaw& law);

  // Solve one problem. On entry, active is a guess; on return result has the unknowns
  // where active and the slacks elsewhere, approach (strips,) the excess of each strip,
  // and slope the derivative of the output by the load. False if unsolved.
  bool solve(const double* offset, double tolerance, bool* active, double* result,
             double* approach, double* slope);

 private:
  // An unknown beyond those of the reference: the approach of a strip, the value of a
  // contact that has become active, or the slack of one that has become inactive.
  enum class Kind { kStrip, kActive, kInactive };
  struct Extra {
    Kind kind;
    std::size_t index;  // number of the strip or contact
  };

  // The factors of the active contacts at one time are kept as a reference. Later active
  // sets differ from it by few contacts, whose unknowns are extra, like those of the
  // strips: the reference gives the effect of each extra unknown on all others, and a
  // small system gives the extra unknowns.
  //
  // Most contacts are active in none of the problems. The search therefore watches those
  // only that have been active or infeasible before; a solution is checked at all others.

  // Watch one more contact.
  void watch(std::size_t k);
  // Factorise the matrix of the active contacts, which become the reference.
  bool refer(const double* offset, const bool* active);
  // Solutions for one offset with the reference alone.
  void start(const double* offset);
  // Extra unknowns for all changes since the reference; false if there are too many.
  bool follow(const bool* active);
  void add(Kind kind, std::size_t index);
  void drop(std::size_t t);
  // Number of extra unknowns, rounded up to whole vectors
  std::size_t wide() const { return padded(extra_.size()); }
  // Derivative of the slack of a contact by an extra unknown
  double coupling(std::size_t k, const Extra& extra) const;
  // Values of the extra unknowns; by_load solves for the derivatives by the load.
  bool solve_extra(const bool* active, bool by_load);
  // Equation of one extra unknown: coefficients line_ and right-hand side, returned
  double equation(std::size_t r, const bool* active, bool by_load);
  // Unknowns and slacks of the watched contacts or, with all, of all contacts; returns
  // the largest error of an active equation.
  double spread(const double* offset, const bool* active, bool all, double* result);

  const Problem& p_;
  const StripLaw& law_;
  std::vector<std::vector<std::size_t>> members_;  // contacts of each strip
  std::vector<std::size_t> forces_;                // strip contacts that are closed
  std::vector<std::int64_t> force_row_;            // number of a contact in forces_
  std::vector<std::size_t> watched_;
  std::vector<std::int64_t> seat_;                 // number of a contact in watched_, or -1
  // columns of the watched contacts and of the strips in the rows of the watched ones;
  // a column begins every size numbers
  std::unique_ptr<double[]> seen_, seen_strips_;
  // the reference
  bool referred_ = false;
  const double* offset_ = nullptr;        // of the problem that is being solved
  std::vector<std::size_t> inside_, pivots_;
  std::vector<std::int64_t> row_;         // number of a contact in inside_, or -1
  std::vector<double> factors_;           // LU factors, one column after another
  std::vector<double> into_forces_;       // matrix from inside_ to forces_, row by row
  // values of inside_ and slacks of forces_ for the offset and for the load
  std::vector<double> value_[2], slack_[2];
  // the extra unknowns
  std::vector<Extra> extra_;
  std::vector<std::int64_t> extra_of_;    // number of the extra unknown of a contact
  std::vector<std::int64_t> place_;       // that of a strip
  // their effect on the values of inside_ and on the slacks of forces_, one column each;
  // rows begin stride_ numbers after the one before, for as many as there can be
  std::size_t stride_;
  std::vector<double> moved_, forced_;
  std::vector<double> across_;  // row of the matrix of an active contact (stride_, size)
  std::vector<double> system_, x_, work_, rows_, column_;
  std::vector<double> line_;                 // row of the small system
  std::vector<std::size_t> order_, unknown_;
  std::vector<const double*> columns_;
  std::vector<double> parts_;
  std::vector<double> force_;
  // excess of the strips under these forces, its derivative, and that without force
  std::vector<double> excess_, slope_, at_rest_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_COMPLEMENTARITY_H_
