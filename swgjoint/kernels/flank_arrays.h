// Arrays of the Python interface, and a tooth profile from them.

#ifndef SWGJOINT_KERNELS_FLANK_ARRAYS_H_
#define SWGJOINT_KERNELS_FLANK_ARRAYS_H_

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <stdexcept>

#include "chain.h"
#include "flank.h"

namespace nb = nanobind;

template <int N>
using In = nb::ndarray<const double, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <int N>
using Out = nb::ndarray<double, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
using Index = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using IndexOut = nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using MaskOut = nb::ndarray<bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Mask = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Masks = nb::ndarray<const bool, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using MasksOut = nb::ndarray<bool, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

inline void require(bool fits, const char* what) {
  if (!fits) throw std::invalid_argument(what);
}

// Check rows of an outline: one whole outline, pieces of a chain, or a spline
inline void check_outline(const In<2>& rows) {
  using swgjoint::Kind;
  const std::size_t n = rows.shape(0);
  require(n > 0 && rows.shape(1) == swgjoint::kColumns, "outline: (n, 7)");
  const auto is_piece = [](double kind) {
    return kind >= static_cast<double>(Kind::kArc) &&
           kind <= static_cast<double>(Kind::kParabola);
  };
  const double first = rows.data()[0];
  require(first >= 0.0 && first <= static_cast<double>(Kind::kSpline), "outline: kind");
  const bool spline = first == static_cast<double>(Kind::kSpline);
  for (std::size_t k = 1; k < n; ++k) {
    const double* row = rows.data() + swgjoint::kColumns * k;
    require(spline ? row[0] == first : is_piece(first) && is_piece(row[0]),
            "outline: kind");
    require(!spline || row[1] > row[1 - swgjoint::kColumns], "outline: angles");
  }
}

// A tooth profile.
struct Flank {
  swgjoint::Profile profile;
  Flank(In<2> table, In<2> edges, Index intervals, In<1> stations, In<3> coefficients,
        double side)
      : profile(checked(table, 11, "pieces: (n, 11)"), table.shape(0),
                checked(edges, 6, "edges: (n, 6)"), edges.shape(0),
                curves(table.shape(0), intervals, stations, coefficients), side) {
    require(table.shape(0) > 0, "pieces: none");
  }

 private:
  // before the profile reads the rows
  static const double* checked(const In<2>& rows, std::size_t columns,
                               const char* what) {
    require(rows.shape(1) == columns, what);
    return rows.data();
  }
  static swgjoint::Curves curves(std::size_t pieces, const Index& intervals,
                                 const In<1>& stations, const In<3>& coefficients) {
    require(intervals.shape(0) == pieces, "intervals: one per piece");
    std::size_t polynomials = 0, nodes = 0;
    for (std::size_t k = 0; k < pieces; ++k) {
      const std::int64_t n = intervals.data()[k];
      require(n >= 0 && n <= static_cast<std::int64_t>(coefficients.shape(0)), "intervals");
      polynomials += static_cast<std::size_t>(n);
      nodes += n > 0 ? static_cast<std::size_t>(n) + 1 : 0;
    }
    require(coefficients.shape(0) == polynomials && stations.shape(0) == nodes &&
                coefficients.shape(1) == 6 && coefficients.shape(2) == 2,
            "coefficients: (intervals, 6, 2)");
    return {intervals.data(), stations.data(), coefficients.data()};
  }
};

#endif  // SWGJOINT_KERNELS_FLANK_ARRAYS_H_
