// Law of a drive map with many harmonics: torsion and forces at given angles.
//
// The compiled twin of law_sums in swgjoint/maps/sums.py, which explains the quantities.
// It differs from it by round-off. Harmonics are processed in groups of eight; cosines
// and sines of their phases are products of powers of exp(i theta) and exp(i psi).
// Harmonics with the same power of exp(i theta) follow each other. At many states near
// each other, as of a recorded motion, they are one wave, see LocalSums.

#ifndef SWGJOINT_KERNELS_HARMONIC_SUMS_H_
#define SWGJOINT_KERNELS_HARMONIC_SUMS_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "../plugin/local_sums.h"
#include "map_sums.h"

namespace swgjoint {

class HarmonicSums {
 public:
  static constexpr std::size_t kRows = 7;

  // The arrays of `map` and `waves` must outlive the object. amplitudes: (h, 2), cosine
  // and sine of the kinematic error; orders: (h, 2), derivatives of the phases by theta
  // and psi.
  HarmonicSums(const Pieces& map, const WaveNumbers& waves, const double* amplitudes,
               const std::int64_t* orders, double ratio);

  // theta, psi: (n). result: (7, n): torsion, derivatives of the kinematic error by
  // theta and psi, first and second derivative of the potential by the torsion, and its
  // derivatives by theta and psi at a fixed torsion.
  void evaluate(const double* theta, const double* psi, std::size_t n,
                double* result) const;

 private:
  static constexpr std::size_t kGroup = 8;
  static constexpr std::size_t kShared = 4 * kGroup;  // amplitudes and orders
  static constexpr std::size_t kPowers = 10 * kGroup;  // A0, B0, .. A4, B4

  // Fewest states per position near which polynomials of the output angle are made.
  static constexpr std::size_t kFew = 12;

  bool slow(const double* psi, std::size_t n) const;
  void find_segment(double torsion, std::size_t* segment, double* origin) const;
  void evaluate_waves(const double* theta, const double* psi, std::size_t n,
                      double* result) const;
  const double* table(std::size_t segment) const;
  void fill(std::size_t segment) const;

  Pieces map_;
  double ratio_;
  std::size_t groups_;
  std::vector<double> theta_, psi_;  // different numbers of waves
  std::vector<std::size_t> order_;   // harmonics by their number of waves of theta
  std::vector<std::size_t> first_;   // first harmonic of each, and their total
  std::vector<std::uint32_t> place_;  // of the powers of exp(i psi) of each harmonic
  std::vector<double> shared_;        // (groups, kShared), padded with zeros
  // (groups, kPowers) of every interval between two knots and of both continuations,
  // made when a torsion is first in it
  mutable std::vector<std::vector<double>> tables_;
  std::unique_ptr<std::once_flag[]> made_;
  mutable LocalSums waves_;
  mutable std::mutex one_;  // that uses waves_
};

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_HARMONIC_SUMS_H_
