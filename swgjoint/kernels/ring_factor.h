// Cholesky factorisation of a ring of sectors by substructuring.

#ifndef SWGJOINT_KERNELS_RING_FACTOR_H_
#define SWGJOINT_KERNELS_RING_FACTOR_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

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

  // Products L^T A^-1 L of the loads L with the inverse matrix, (d + k, d + k): d loads
  // on all sectors (sectors, n, d), then k rows (k, n), each on one sector only.
  void condense(const double* loads, std::size_t d, const std::int64_t* sector,
                const double* rows, std::size_t k, double* result) const;

 private:
  // A sector, two merged parts, or the closed ring. Its matrix is the upper triangle of
  // the unknowns that it eliminates, followed by those of its first and last face; the
  // rows of eliminated unknowns contain the factor, with inverted diagonal.
  struct Part {
    std::size_t first, last;   // range of its sectors
    std::size_t pivots, size;  // eliminated and all unknowns
    std::int64_t left, right;  // merged parts, -1 for none
    double* matrix;            // (size, size)
  };

  std::int64_t add(std::size_t first, std::size_t last);
  bool eliminate(Part& part) const;
  void gather(Part& part, const double* block) const;
  void place(const double* load, std::size_t apart, double* to) const;
  void merge(Part& part) const;
  void close();

  std::size_t sectors_, size_, face_, inner_;
  std::vector<Part> parts_;  // children before parents; the last one is the closed ring
  std::unique_ptr<double[]> memory_;  // of all matrices
};

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_RING_FACTOR_H_
