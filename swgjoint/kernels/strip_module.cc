// Python interface of the complementarity problems, see module.cc.

#include <algorithm>

#include "complementarity.h"
#include "flank_arrays.h"
#include "lane_problems.h"

namespace {

// What complementarity problems of one linearised drive share. It holds references to
// the arrays that it reads.
class StripProblems {
 public:
  StripProblems(In<2> columns, In<2> strip_columns, Index strip, Mask closed,
                In<1> force_unit, In<1> direction, In<1> by_value, In<1> by_strip,
                In<1> slope, In<1> offset, In<1> law)
      : columns_(columns), strip_columns_(strip_columns), strip_(strip), closed_(closed),
        force_unit_(force_unit), direction_(direction), by_value_(by_value),
        by_strip_(by_strip), slope_(slope), offset_(offset) {
    const std::size_t n = columns.shape(0), strips = slope.shape(0);
    require(n > 0 && columns.shape(1) == n, "columns: (n, n)");
    require(strip_columns.shape(0) == strips && strip_columns.shape(1) == n,
            "strip_columns: (strips, n)");
    require(strip.shape(0) == n && closed.shape(0) == n && force_unit.shape(0) == n &&
                direction.shape(0) == n && by_value.shape(0) == n,
            "strip, closed, force_unit, direction, by_value: (n,)");
    require(by_strip.shape(0) == strips && offset.shape(0) == strips, "strips");
    require(law.shape(0) == 4, "law: (4,)");
    for (std::size_t k = 0; k < n; ++k) {
      const std::int64_t j = strip.data()[k];
      require(j >= -1 && j < static_cast<std::int64_t>(strips), "strip");
    }
    law_ = {law.data()[0], law.data()[1],  law.data()[2], law.data()[3],
            slope.data(),  offset.data(), strips};
  }

  // Each problem starts from the solution of an earlier one; if before is -1 or that one
  // is unsolved, it starts from its own active set. If before is empty, all do, and those
  // that can be are solved eight at a time. Returns how many that are.
  std::size_t solve(In<2> offset, In<1> tolerance, double tolerance_m, int tries, int singles,
             Index before, MasksOut active, Out<2> result, Out<2> approach, Out<1> slope,
             MaskOut solved) const {
    const std::size_t count = offset.shape(0), n = columns_.shape(0);
    const std::size_t strips = law_.strips;
    require(offset.shape(1) == n && active.shape(0) == count && active.shape(1) == n &&
                result.shape(0) == count && result.shape(1) == n,
            "offset, active, result: (count, n)");
    require(approach.shape(0) == count && approach.shape(1) == strips,
            "approach: (count, strips)");
    require(tolerance.shape(0) == count && slope.shape(0) == count &&
                solved.shape(0) == count,
            "tolerance, slope, solved: (count,)");
    const bool together = before.shape(0) == 0;
    require(together || before.shape(0) == count, "before: (count,) or empty");
    for (std::size_t i = 0; i < before.shape(0); ++i) {
      const std::int64_t k = before.data()[i];
      require(k >= -1 && k < static_cast<std::int64_t>(i), "before: earlier problems");
    }
    const swgjoint::Problem problem{n,
                                    columns_.data(),
                                    strip_columns_.data(),
                                    strip_.data(),
                                    closed_.data(),
                                    force_unit_.data(),
                                    direction_.data(),
                                    by_value_.data(),
                                    by_strip_.data(),
                                    tolerance_m,
                                    tries,
                                    singles};
    const nb::gil_scoped_release release;
    std::fill_n(solved.data(), count, false);
    if (together) {
      swgjoint::LaneSolver lanes(problem, law_);
      for (std::size_t i = 0; i < count; i += swgjoint::kLanes) {
        lanes.solve(std::min(swgjoint::kLanes, count - i), offset.data() + n * i,
                    tolerance.data() + i, active.data() + n * i, result.data() + n * i,
                    approach.data() + strips * i, slope.data() + i, solved.data() + i);
      }
    }
    const std::size_t at_once = std::count(solved.data(), solved.data() + count, true);
    swgjoint::StripSolver solver(problem, law_);
    for (std::size_t i = 0; i < count; ++i) {
      if (solved.data()[i]) continue;
      bool* own = active.data() + n * i;
      const std::int64_t k = together ? -1 : before.data()[i];
      if (k >= 0 && solved.data()[k]) std::copy_n(active.data() + n * k, n, own);
      solved.data()[i] = solver.solve(
          offset.data() + n * i, tolerance.data()[i], own, result.data() + n * i,
          approach.data() + strips * i, slope.data() + i);
    }
    return at_once;
  }

 private:
  In<2> columns_, strip_columns_;
  Index strip_;
  Mask closed_;
  In<1> force_unit_, direction_, by_value_, by_strip_, slope_, offset_;
  swgjoint::StripLaw law_{};
};

}  // namespace

void bind_strips(nb::module_& m) {
  nb::class_<StripProblems>(m, "StripProblems")
      .def(nb::init<In<2>, In<2>, Index, Mask, In<1>, In<1>, In<1>, In<1>, In<1>, In<1>,
                    In<1>>(),
           nb::arg("columns").noconvert(), nb::arg("strip_columns").noconvert(),
           nb::arg("strip").noconvert(), nb::arg("closed").noconvert(),
           nb::arg("force_unit").noconvert(), nb::arg("direction").noconvert(),
           nb::arg("by_value").noconvert(), nb::arg("by_strip").noconvert(),
           nb::arg("slope").noconvert(), nb::arg("offset").noconvert(),
           nb::arg("law").noconvert())
      .def("solve", &StripProblems::solve, nb::arg("offset").noconvert(),
           nb::arg("tolerance").noconvert(), nb::arg("tolerance_m"), nb::arg("tries"),
           nb::arg("singles"), nb::arg("before").noconvert(), nb::arg("active").noconvert(),
           nb::arg("result").noconvert(), nb::arg("approach").noconvert(),
           nb::arg("slope").noconvert(), nb::arg("solved").noconvert());
}
