// Python interface of the search for tooth contact, see module.cc.

#include <vector>

#include "flank_arrays.h"
#include "tooth_search.h"

namespace {

// The search at one state. It holds references to the arrays that it reads.
class Search {
 public:
  Search(const Flank& flexspline, In<1> breaks, In<3> weights, double low, double high,
         const Flank& circular, In<1> radii, In<1> stations, In<1> circular_breaks,
         In<3> circular_weights, In<3> displaced, std::int64_t teeth,
         std::int64_t teeth_in_model, In<1> angle, In<1> bearing,
         swgjoint::Limits limits)
      : breaks_(breaks), weights_(weights), radii_(radii), stations_(stations),
        circular_breaks_(circular_breaks), circular_weights_(circular_weights),
        displaced_(displaced), angle_(angle), bearing_(bearing),
        search_(flexspline.profile, spline(breaks, weights), low, high, circular.profile,
                radii.data(), stations.data(), radii.shape(0),
                {spline(circular_breaks, circular_weights), displaced.data(),
                 displaced.shape(0)},
                teeth, teeth_in_model, angle.data(), bearing.data(), limits) {
    require(radii.shape(0) == stations.shape(0) && radii.shape(0) > 1, "radii");
    require(angle.shape(0) == bearing.shape(0), "bearing: one per sector");
    require(teeth > 0 && teeth_in_model > 0, "teeth");
    const std::size_t flanks = displaced.shape(0);
    require(flanks == 0 || (flanks == static_cast<std::size_t>(2 * teeth_in_model) &&
                            displaced.shape(1) == circular_weights.shape(2) &&
                            displaced.shape(2) == 2),
            "displaced: (2 teeth, nodes, 2)");
  }

  // Feet of n points. Columns of real: gap, normal and rest in the mirrored sector
  // frame, curvature, arc length, then normal and rest in the mirrored frame of the
  // circular-spline tooth.
  void see(In<2> points, In<2> outward, Index sector, Index side, bool rigid,
           nb::object start, int steps, Out<2> real, MaskOut corner, IndexOut tooth) const {
    const std::size_t n = points.shape(0);
    require(points.shape(1) == 2 && outward.shape(0) == n && outward.shape(1) == 2 &&
                real.shape(0) == n && real.shape(1) == 11 && corner.shape(0) == n &&
                tooth.shape(0) == n,
            "points: (n, 2)");
    check(n, sector, side);
    require(rigid || !search_.rigid(), "a rigid circular spline");
    const double* from = nullptr;
    In<1> starts;
    if (!start.is_none()) {
      starts = nb::cast<In<1>>(start);
      require(starts.shape(0) == n, "start: (n,)");
      from = starts.data();
    }
    const nb::gil_scoped_release release;
    swgjoint::Pose pose{};
    for (std::size_t i = 0; i < n; ++i) {
      const std::int64_t k = sector.data()[i], flank = side.data()[i];
      if (i == 0 || k != pose.sector || flank != pose.side) {
        pose = search_.pose_of(k, flank);
      }
      const double *p = points.data() + 2 * i, *o = outward.data() + 2 * i;
      const swgjoint::Seen seen =
          search_.see({p[0], p[1]}, {o[0], o[1]}, pose, rigid,
                      from ? from + i : nullptr, steps);
      double* row = real.data() + 11 * i;
      row[0] = seen.foot.gap;
      row[1] = seen.normal.x;
      row[2] = seen.normal.y;
      row[3] = seen.rest.x;
      row[4] = seen.rest.y;
      row[5] = seen.foot.curvature;
      row[6] = seen.foot.station;
      row[7] = seen.foot.normal.x;
      row[8] = seen.foot.normal.y;
      row[9] = seen.foot.rest.x;
      row[10] = seen.foot.rest.y;
      corner.data()[i] = seen.foot.corner;
      tooth.data()[i] = seen.tooth;
    }
  }

  // Sectors, sides and arc lengths of the local minima of the gap.
  nb::tuple minima(In<4> flank, Masks searched, int coarse, int dense, double limit,
                   double radius) const {
    check(flank);
    require(searched.shape(0) == flank.shape(0) && searched.shape(1) == 2,
            "searched: (sectors, 2)");
    require(coarse > 1 && (dense == 0 || dense > 1), "coarse, dense");
    std::vector<swgjoint::Place> places;
    {
      const nb::gil_scoped_release release;
      places = search_.minima(flank.data(), flank.shape(0), searched.data(),
                              {coarse, dense, limit, radius});
    }
    const std::size_t n = places.size();
    auto* index = new std::int64_t[2 * n];
    const nb::capsule of_index(index, [](void* p) noexcept {
      delete[] static_cast<std::int64_t*>(p);
    });
    auto* station = new double[n];
    const nb::capsule of_station(station, [](void* p) noexcept {
      delete[] static_cast<double*>(p);
    });
    for (std::size_t i = 0; i < n; ++i) {
      index[i] = places[i].sector;
      index[n + i] = places[i].side;
      station[i] = places[i].station;
    }
    using Indices = nb::ndarray<nb::numpy, std::int64_t, nb::ndim<1>>;
    using Values = nb::ndarray<nb::numpy, double, nb::ndim<1>>;
    return nb::make_tuple(Indices(index, {n}, of_index), Indices(index + n, {n}, of_index),
                          Values(station, {n}, of_station));
  }

  // Contact points at n places. Columns of real: gap, normal, point and tangent in the
  // sector frame, sum of the arc lengths. Where the arrays have rows, weights of the
  // nodes of both flanks of a tooth in the gap and in the sliding motion.
  void meet(In<4> flank, Index sector, Index side, In<1> station, Out<2> real,
            IndexOut tooth, Out<4> weight, Out<4> circular_weight, Out<4> sliding,
            Out<4> circular_sliding) const {
    check(flank);
    const std::size_t n = station.shape(0), nodes = weights_.shape(2);
    const std::size_t others = search_.rigid() ? 0 : circular_weights_.shape(2);
    check(n, sector, side);
    require(real.shape(0) == n && real.shape(1) == 8 && tooth.shape(0) == n, "real: (n, 8)");
    const bool weighted = weight.shape(0) > 0;
    if (weighted) {
      fit(weight, n, nodes);
      fit(circular_weight, n, others);
    }
    const bool rubs = sliding.shape(0) > 0;
    if (rubs) {
      fit(sliding, n, nodes);
      fit(circular_sliding, n, others);
    }
    const nb::gil_scoped_release release;
    std::vector<double> own(nodes), other(others);
    for (std::size_t i = 0; i < n; ++i) {
      const swgjoint::Place place{sector.data()[i], side.data()[i], station.data()[i]};
      const swgjoint::Meeting at =
          search_.meet(flank.data(), place, weighted || rubs ? own.data() : nullptr,
                       weighted || rubs ? other.data() : nullptr);
      double* row = real.data() + 8 * i;
      row[0] = at.gap;
      row[1] = at.normal.x;
      row[2] = at.normal.y;
      row[3] = at.point.x;
      row[4] = at.point.y;
      row[5] = at.tangent.x;
      row[6] = at.tangent.y;
      row[7] = at.slip;
      tooth.data()[i] = at.tooth;
      const auto s = static_cast<std::size_t>(place.side);
      if (weighted) {
        spread(own, at.normal, 1.0, weight, 2 * i + s);
        spread(other, at.circular_normal, -1.0, circular_weight, 2 * i + 1 - s);
      }
      if (!rubs) continue;
      spread(own, at.tangent, 1.0, sliding, 2 * i + s);
      spread(other, at.circular_tangent, -1.0, circular_sliding, 2 * i + 1 - s);
    }
  }

  // Refine the arc lengths of n minima in place.
  void refine(Out<1> station, In<3> mirrored, Index sector, Index side,
              double spacing) const {
    const std::size_t n = station.shape(0);
    require(mirrored.shape(0) == n && mirrored.shape(1) == weights_.shape(2) &&
                mirrored.shape(2) == 2,
            "mirrored: (n, nodes, 2)");
    check(n, sector, side);
    const nb::gil_scoped_release release;
    search_.refine(n, station.data(), mirrored.data(), sector.data(), side.data(),
                   spacing);
  }

 private:
  static swgjoint::NodeSpline spline(const In<1>& breaks, const In<3>& weights) {
    require(weights.shape(0) == 4 && breaks.shape(0) == weights.shape(1) + 1,
            "weights: (4, intervals, nodes)");
    return {breaks.data(), weights.data(), weights.shape(1), weights.shape(2)};
  }

  void check(const In<4>& flank) const {
    require(flank.shape(0) == angle_.shape(0) && flank.shape(1) == 2 &&
                flank.shape(2) == weights_.shape(2) && flank.shape(3) == 2,
            "flank: (sectors, 2, nodes, 2)");
  }

  // Check the shape (n, 2, nodes, 2) of weights, which must be zero.
  static void fit(const Out<4>& rows, std::size_t n, std::size_t nodes) {
    require(rows.shape(0) == n && rows.shape(1) == 2 && rows.shape(2) == nodes &&
                rows.shape(3) == 2,
            "weights: (n, 2, nodes, 2)");
  }

  // Weights along a direction as the row with a number (2 sides of every point).
  static void spread(const std::vector<double>& weights, swgjoint::Vec direction,
                     double sign, const Out<4>& rows, std::size_t number) {
    double* row = rows.data() + 2 * weights.size() * number;
    for (std::size_t k = 0; k < weights.size(); ++k) {
      row[2 * k] = sign * weights[k] * direction.x;
      row[2 * k + 1] = sign * weights[k] * direction.y;
    }
  }

  // Check that indices of sectors and sides are within the arrays.
  void check(std::size_t n, const Index& sector, const Index& side) const {
    require(sector.shape(0) == n && side.shape(0) == n, "sector, side: (n,)");
    const auto sectors = static_cast<std::int64_t>(angle_.shape(0));
    for (std::size_t i = 0; i < n; ++i) {
      const std::int64_t k = sector.data()[i], s = side.data()[i];
      require(k >= 0 && k < sectors && (s == 0 || s == 1), "sector or side");
    }
  }

  In<1> breaks_;
  In<3> weights_;
  In<1> radii_, stations_, circular_breaks_;
  In<3> circular_weights_, displaced_;
  In<1> angle_, bearing_;
  swgjoint::ToothSearch search_;
};

}  // namespace

void bind_search(nb::module_& m) {
  nb::class_<swgjoint::Limits>(m, "Limits")
      .def(
          "__init__",
          [](swgjoint::Limits* self, double corner, double beyond, double past,
             double refined, int refinements) {
            new (self) swgjoint::Limits{corner, beyond, past, refined, refinements};
          },
          nb::kw_only(), nb::arg("corner"), nb::arg("beyond"), nb::arg("past"),
          nb::arg("refined"), nb::arg("refinements"));
  nb::class_<Flank>(m, "Flank")
      .def(nb::init<In<2>, In<2>, Index, In<1>, In<3>, double>(), nb::arg("pieces"),
           nb::arg("edges"), nb::arg("intervals"), nb::arg("stations"),
           nb::arg("coefficients"), nb::arg("side"));
  nb::class_<Search>(m, "Search")
      .def(nb::init<const Flank&, In<1>, In<3>, double, double, const Flank&, In<1>,
                    In<1>, In<1>, In<3>, In<3>, std::int64_t, std::int64_t, In<1>, In<1>,
                    swgjoint::Limits>(),
           nb::keep_alive<1, 2>(), nb::keep_alive<1, 7>())
      .def("see", &Search::see, nb::arg("points").noconvert(), nb::arg("outward").noconvert(), nb::arg("sector").noconvert(),
           nb::arg("side").noconvert(), nb::arg("rigid"), nb::arg("start").none(), nb::arg("steps"),
           nb::arg("real").noconvert(), nb::arg("corner").noconvert(), nb::arg("tooth").noconvert())
      .def("refine", &Search::refine, nb::arg("station").noconvert(), nb::arg("mirrored").noconvert(),
           nb::arg("sector").noconvert(), nb::arg("side").noconvert(), nb::arg("spacing"))
      .def("minima", &Search::minima, nb::arg("flank").noconvert(),
           nb::arg("searched").noconvert(), nb::arg("coarse"), nb::arg("dense"), nb::arg("limit"), nb::arg("radius"))
      .def("meet", &Search::meet, nb::arg("flank").noconvert(),
           nb::arg("sector").noconvert(), nb::arg("side").noconvert(),
           nb::arg("station").noconvert(), nb::arg("real").noconvert(),
           nb::arg("tooth").noconvert(), nb::arg("weight").noconvert(),
           nb::arg("circular_weight").noconvert(), nb::arg("sliding").noconvert(),
           nb::arg("circular_sliding").noconvert());
}
