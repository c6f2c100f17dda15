// Complementarity problems that share one matrix, with contact strips that indent.
//
// The compiled twin of StripProblems in swgjoint/fe/common/strip_problems.py, which
// explains the problem.

#ifndef SWGJOINT_KERNELS_COMPLEMENTARITY_H_
#define SWGJOINT_KERNELS_COMPLEMENTARITY_H_

#include <cstddef>
#include <cstdint>
#include <vector>

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
  // Matrix and right-hand side in the active unknowns and the loaded strips.
  void assemble(const double* offset, const bool* active);
  // LU factors of the matrix with partial pivoting; false if it is singular.
  bool factorise();
  // Replace the right-hand side by the solution.
  void substitute();
  // Unknowns and slacks from the solution.
  void spread(double* result) const;

  const Problem& p_;
  const StripLaw& law_;
  std::vector<std::size_t> inside_, loaded_, pivots_;
  std::vector<std::int64_t> place_;  // number of each strip in loaded_, or -1
  std::vector<double> matrix_, right_, force_, derivative_, base_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_COMPLEMENTARITY_H_
