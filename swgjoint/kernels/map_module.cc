// Python interface of the loops over the harmonics and hysteresis elements of a map.

#include "flank_arrays.h"
#include "harmonic_sums.h"
#include "map_sums.h"

namespace {

using Orders = nb::ndarray<const std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Powers = nb::ndarray<const double, nb::ndim<4>, nb::c_contig, nb::device::cpu>;

void error_sums(In<2> phases, In<2> amplitudes, Orders orders, Out<2> cos, Out<2> sin,
                Out<2> result) {
  const std::size_t n = phases.shape(0), h = phases.shape(1);
  require(amplitudes.shape(0) == h && amplitudes.shape(1) == 2 && orders.shape(0) == h &&
              orders.shape(1) == 2,
          "amplitudes, orders: (h, 2)");
  require(cos.shape(0) == n && cos.shape(1) == h && sin.shape(0) == n && sin.shape(1) == h,
          "cos, sin: (n, h)");
  require(result.shape(0) == 3 && result.shape(1) == n, "result: (3, n)");
  const nb::gil_scoped_release release;
  swgjoint::error_sums(phases.data(), n, h, amplitudes.data(), orders.data(), cos.data(),
                       sin.data(), result.data());
}

void potential_sums(In<1> torsion, In<2> cos, In<2> sin, Orders orders, In<1> knots,
                    Powers powers, In<3> ends, bool torque, bool stiffness, bool by_phase,
                    Out<2> result) {
  const std::size_t n = torsion.shape(0), h = orders.shape(0), m = powers.shape(2);
  require(cos.shape(0) == n && cos.shape(1) == h && sin.shape(0) == n && sin.shape(1) == h,
          "cos, sin: (n, h)");
  require(orders.shape(1) == 2, "orders: (h, 2)");
  require(m > 0 && knots.shape(0) == m + 1, "knots: (m + 1,)");
  require(powers.shape(0) == h && powers.shape(1) == 2 && powers.shape(3) == 5,
          "powers: (h, 2, m, 5)");
  require(ends.shape(0) == h && ends.shape(1) == 2 && ends.shape(2) == 2,
          "ends: (h, 2, 2)");
  require(result.shape(0) == 4 && result.shape(1) == n, "result: (4, n)");
  const nb::gil_scoped_release release;
  swgjoint::potential_sums({knots.data(), powers.data(), ends.data(), h, m},
                           torsion.data(), n, cos.data(), sin.data(), orders.data(),
                           {torque, stiffness, by_phase}, result.data());
}

// Sums of one map, and the arrays that they read.
class Sums {
 public:
  Sums(In<1> knots, Powers powers, In<3> ends, In<2> amplitudes, Orders orders,
       In<1> of_theta, In<1> of_psi, Orders which, double ratio)
      : knots_(knots), powers_(powers), ends_(ends),
        sums_(checked(knots, powers, ends, amplitudes, orders),
              {of_theta.data(), of_psi.data(),
               checked(which, orders.shape(0), of_theta.shape(0), of_psi.shape(0)),
               of_theta.shape(0), of_psi.shape(0)},
              amplitudes.data(), orders.data(), ratio) {}

  void evaluate(In<1> theta, In<1> psi, Out<2> result) const {
    const std::size_t n = theta.shape(0);
    require(psi.shape(0) == n, "theta, psi: (n,)");
    require(result.shape(0) == swgjoint::HarmonicSums::kRows && result.shape(1) == n,
            "result: (7, n)");
    const nb::gil_scoped_release release;
    sums_.evaluate(theta.data(), psi.data(), n, result.data());
  }

 private:
  static swgjoint::Pieces checked(const In<1>& knots, const Powers& powers,
                                  const In<3>& ends, const In<2>& amplitudes,
                                  const Orders& orders) {
    const std::size_t h = orders.shape(0), m = powers.shape(2);
    require(m > 0 && knots.shape(0) == m + 1, "knots: (m + 1,)");
    require(powers.shape(0) == h && powers.shape(1) == 2 && powers.shape(3) == 5,
            "powers: (h, 2, m, 5)");
    require(ends.shape(0) == h && ends.shape(1) == 2 && ends.shape(2) == 2,
            "ends: (h, 2, 2)");
    require(amplitudes.shape(0) == h && amplitudes.shape(1) == 2 && orders.shape(1) == 2,
            "amplitudes, orders: (h, 2)");
    return {knots.data(), powers.data(), ends.data(), h, m};
  }
  static const std::int64_t* checked(const Orders& which, std::size_t h, std::size_t u,
                                     std::size_t v) {
    require(which.shape(0) == h && which.shape(1) == 2, "which: (h, 2)");
    for (std::size_t k = 0; k < h; ++k) {
      const std::int64_t i = which.data()[2 * k], j = which.data()[2 * k + 1];
      require(i >= 0 && i < static_cast<std::int64_t>(u) && j >= 0 &&
                  j < static_cast<std::int64_t>(v),
              "which: indices of the numbers of waves");
    }
    return which.data();
  }

  In<1> knots_;
  Powers powers_;
  In<3> ends_;
  swgjoint::HarmonicSums sums_;
};

void stretches(In<1> torsion, In<1> reach, Out<1> result) {
  const std::size_t n = torsion.shape(0);
  require(reach.shape(0) == n && result.shape(0) == n, "torsion, reach, result: (n,)");
  const nb::gil_scoped_release release;
  swgjoint::stretches(torsion.data(), reach.data(), n, result.data());
}

void yield_torsions(Index first, In<1> at, In<1> yields, In<1> stiffness, In<1> elastic,
                    Out<2> reach, Out<2> slope) {
  const std::size_t n = elastic.shape(0), count = stiffness.shape(0);
  require(first.shape(0) == count + 1 && first.data()[0] == 0 &&
              first.data()[count] == static_cast<std::int64_t>(at.shape(0)),
          "first: (k + 1,), from zero to the number of points");
  for (std::size_t e = 0; e < count; ++e)
    require(first.data()[e] < first.data()[e + 1], "first: increasing");
  require(yields.shape(0) == at.shape(0), "at, yields: equal length");
  require(reach.shape(0) == n && reach.shape(1) == count && slope.shape(0) == n &&
              slope.shape(1) == count,
          "reach, slope: (n, k)");
  swgjoint::yield_torsions(
      {first.data(), at.data(), yields.data(), stiffness.data(), count}, elastic.data(),
      n, reach.data(), slope.data());
}

}  // namespace

void bind_map(nb::module_& m) {
  m.def("error_sums", &error_sums, nb::arg("phases").noconvert(),
        nb::arg("amplitudes").noconvert(), nb::arg("orders").noconvert(),
        nb::arg("cos").noconvert(), nb::arg("sin").noconvert(),
        nb::arg("result").noconvert());
  m.def("potential_sums", &potential_sums, nb::arg("torsion").noconvert(),
        nb::arg("cos").noconvert(), nb::arg("sin").noconvert(),
        nb::arg("orders").noconvert(), nb::arg("knots").noconvert(),
        nb::arg("powers").noconvert(), nb::arg("ends").noconvert(), nb::arg("torque"),
        nb::arg("stiffness"), nb::arg("by_phase"), nb::arg("result").noconvert());
  nb::class_<Sums>(m, "HarmonicSums")
      .def(nb::init<In<1>, Powers, In<3>, In<2>, Orders, In<1>, In<1>, Orders, double>(),
           nb::arg("knots").noconvert(), nb::arg("powers").noconvert(),
           nb::arg("ends").noconvert(), nb::arg("amplitudes").noconvert(),
           nb::arg("orders").noconvert(), nb::arg("of_theta").noconvert(),
           nb::arg("of_psi").noconvert(), nb::arg("which").noconvert(),
           nb::arg("ratio"))
      .def("evaluate", &Sums::evaluate, nb::arg("theta").noconvert(),
           nb::arg("psi").noconvert(), nb::arg("result").noconvert());
  m.def("stretches", &stretches, nb::arg("torsion").noconvert(),
        nb::arg("reach").noconvert(), nb::arg("result").noconvert());
  m.def("yield_torsions", &yield_torsions, nb::arg("first").noconvert(),
        nb::arg("at").noconvert(), nb::arg("yields").noconvert(),
        nb::arg("stiffness").noconvert(), nb::arg("elastic").noconvert(),
        nb::arg("reach").noconvert(), nb::arg("slope").noconvert());
}
