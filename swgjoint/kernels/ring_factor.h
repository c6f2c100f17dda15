// Cholesky factorisation of a ring of sectors by substructuring.

#ifndef SWGJOINT_KERNELS_RING_FACTOR_H_
#define SWGJOINT_KERNELS_RING_FACTOR_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "partial_cholesky.h"

namespace swgjoint {

// Twin of CyclicFactor in swgjoint/fe/common/cyclic.py for symmetric matrices whose sum
// is positive definite. Neighbouring sectors are merged in pairs, the pairs again in
// pairs, and so on: each merge eliminates the face between two parts. A load on one
// sector then passes only a few merges, and after a change of one sector only these
// merges are repeated.
class RingFactor {
 public:
  // sectors > 0; size: degrees of freedom n of a sector, in the order first face,
  // interior, last face; face: those of a face, 0 < 2 face <= size.
  RingFactor(std::size_t sectors, std::size_t size, std::size_t face);

  std::size_t sectors() const { return sectors_; }
  std::size_t size() const { return size_; }

  // Factorises the ring anew after a change of some of its blocks (sectors, n, n).
  // False if the matrix is not positive definite.
  bool update(const double* blocks, const std::int64_t* changed, std::size_t count);

  // Solution for loads (sectors, n, width), in place: contributions of the sectors on
  // input, displacements of the sectors on output.
  void solve(double* loads, std::size_t width) const;

  // Half of the solution for d loads on all sectors (sectors, n, d) and k rows (k, n),
  // each on one sector only. Only what has changed since the call before is computed.
  void reduce(const double* loads, std::size_t d, const std::int64_t* sector,
              const double* rows, std::size_t k);

  // Products L^T A^-1 L of these loads L with the inverse matrix (d + k, d + k).
  void products(double* result) const;

  // Solution (sectors, n) for the sum of these loads, each times its factor (d + k,).
  void solve_reduced(const double* factors, double* solution) const;

 private:
  // A sector, two merged parts, or the closed ring. After the unknowns that it
  // eliminates come those of its near face, by which it is merged, and its far face.
  struct Part {
    std::size_t first, last;   // range of its sectors
    std::int64_t left, right;  // merged parts, -1 for none
    bool turned;               // whether the near face is the last one
    PartialCholesky matrix;
  };

  // Loads after the elimination.
  struct Reduced {
    std::size_t d = 0, k = 0;          // loads on all sectors, loads on single ones
    std::vector<double> loads, rows;   // the loads themselves
    std::vector<std::int64_t> sector;  // sectors of single ones (k,)
    std::vector<std::size_t> order;    // single ones by their sector (k,)
    std::vector<std::size_t> begin;    // first of them on each sector (sectors + 1,)
    std::vector<std::size_t> at;       // first value of each part
    std::unique_ptr<double[]> values;  // of all parts

    // Whether these are loads on the same sectors, with the same rows (k, n), and as
    // many on all sectors, which take up `all` columns of n numbers.
    bool holds(const std::int64_t* others, const double* their_rows, std::size_t count,
               std::size_t n, std::size_t all) const;
  };

  std::int64_t add(std::size_t first, std::size_t last, bool turned);
  void gather(const Part& part, const double* block) const;
  void merge(const Part& part) const;
  void close(const Part& ring) const;
  std::size_t place(const Part& part, std::size_t row) const;
  void spread(const Part& part, const double* own, std::size_t width, double* left,
              double* right) const;
  void arrange(const std::int64_t* sector, const double* rows, std::size_t k,
               std::size_t d);
  std::size_t width_of(const Part& part) const;
  std::size_t number_of(const Part& part, std::size_t column) const;

  std::size_t sectors_, size_, face_, inner_;
  std::vector<Part> parts_;          // sectors, then merged parts, last the closed ring
  std::vector<std::size_t> order_;   // of the parts: those that are merged, then theirs
  std::vector<char> changed_;        // whether a part changed since the last loads
  Reduced reduced_;
  std::unique_ptr<double[]> memory_;  // of all matrices
};

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_RING_FACTOR_H_
