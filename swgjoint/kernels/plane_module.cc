// Python interface of the loops that linearise the 2D model, see module.cc.

#include <algorithm>

#include "banded.h"
#include "bore.h"
#include "contact_tangent.h"
#include "corotation.h"
#include "flank_arrays.h"
#include "hermite_ring.h"
#include "race.h"

namespace {

using Indices = nb::ndarray<const std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;


void check_dofs(const Index& dofs, std::size_t n) {
  for (std::size_t i = 0; i < dofs.shape(0); ++i) {
    require(dofs.data()[i] >= 0 && dofs.data()[i] < static_cast<std::int64_t>(n), "dofs");
  }
}

// Checks the arrays to which sectors add; none for the tangent omits it.
void check_assembly(std::size_t count, std::size_t n, const Out<2>& gradient,
                    const Out<3>& tangent) {
  require(gradient.shape(0) == count, "gradient: (n, dofs)");
  require(!tangent.is_valid() || (tangent.shape(0) == count && tangent.shape(1) == n &&
                                  tangent.shape(2) == n),
          "tangent: (n, dofs, dofs)");
}

template <typename Values>
auto data_of(const Values& values) {
  return values.is_valid() ? values.data() : nullptr;
}

// Contact stations of the bore. It holds references to the arrays that it reads.
class Bore {
 public:
  Bore(In<3> weights, std::size_t stations) : weights_(weights) {
    const std::size_t p = weights.shape(0), width = weights.shape(2);
    require(p > 0 && weights.shape(1) == 2 && width > 1 && width % 2 == 0,
            "weights: (p, 2, 2 s)");
    require(stations > 0 && stations % p == 0, "stations: a multiple of p");
    for (std::size_t j = 0; j < width; ++j) {
      for (std::size_t i = 0; i < 2 * p; ++i) {
        by_node_.push_back(weights.data()[(i % p * 2 + i / p) * width + j]);
      }
    }
    stations_ = {weights.data(), by_node_.data(), p, width, stations / p};
  }

  void gaps(In<3> nodes, Masks touching, In<2> outline, double angle, In<1> offset,
            double far, Out<2> gap, Out<3> normal, Out<2> curvature) const {
    const std::size_t count = nodes.shape(0);
    require(nodes.shape(1) == stations_.nodes() && nodes.shape(2) == 2,
            "nodes: (n, m, 2)");
    require(touching.shape(0) == count && touching.shape(1) == stations_.count(),
            "touching: (n, q)");
    require(offset.shape(0) == 2, "offset: (2,)");
    check(count, gap, normal);
    check(count, curvature, normal);
    check_outline(outline);
    const nb::gil_scoped_release release;
    const swgjoint::Outline curve(outline.data(), outline.shape(0));
    const swgjoint::Support support{
        curve, angle, {offset.data()[0], offset.data()[1]}, far};
    swgjoint::bore_gaps(stations_, support, nodes.data(), touching.data(), count,
                        gap.data(), normal.data(), curvature.data());
  }

  void forces(In<2> spring, In<2> gap, In<3> normal, In<2> curvature, Index into,
              In<2> sign, Out<2> gradient, Out<3> tangent) const {
    const std::size_t count = gap.shape(0), n = gradient.shape(1);
    check(count, gap, normal);
    check(count, spring, normal);
    if (curvature.is_valid()) check(count, curvature, normal);
    require(!sign.is_valid() || (sign.shape(0) == count && sign.shape(1) == n),
            "sign: (n, dofs)");
    require(into.shape(0) == 2 * stations_.nodes(), "into: (2 m,)");
    check_assembly(count, n, gradient, tangent);
    check_dofs(into, n);
    const nb::gil_scoped_release release;
    swgjoint::bore_forces(stations_, spring.data(), gap.data(), normal.data(),
                          data_of(curvature), into.data(), data_of(sign), count, n,
                          gradient.data(), data_of(tangent));
  }

  void gaps_after(In<2> gap, In<3> normal, Index into, In<2> increment,
                  Out<2> result) const {
    const std::size_t count = gap.shape(0), n = increment.shape(1);
    check(count, gap, normal);
    check(count, result, normal);
    require(into.shape(0) == 2 * stations_.nodes(), "into: (2 m,)");
    require(increment.shape(0) == count, "increment: (n, dofs)");
    check_dofs(into, n);
    const nb::gil_scoped_release release;
    swgjoint::bore_gaps_after(stations_, gap.data(), normal.data(), into.data(),
                              increment.data(), count, n, result.data());
  }

 private:
  template <typename Values, typename Vectors>
  void check(std::size_t count, const Values& values, const Vectors& vectors) const {
    const std::size_t q = stations_.count();
    require(values.shape(0) == count && values.shape(1) == q &&
                vectors.shape(0) == count && vectors.shape(1) == q &&
                vectors.shape(2) == 2,
            "stations: (n, q), their vectors: (n, q, 2)");
  }

  In<3> weights_;
  std::vector<double> by_node_;
  swgjoint::Stations stations_{};
};

// The condensed sector. It holds references to the arrays that it reads.
class Sector {
 public:
  Sector(In<2> skeleton, std::size_t face, In<2> stiffness, In<2> turning_parts,
         In<2> rim_slopes, In<1> elongation, In<2> flank_from_skeleton,
         In<2> flank_compliance)
      : arrays_{skeleton,   stiffness,           turning_parts,
                rim_slopes, flank_from_skeleton, flank_compliance},
        elongation_(elongation) {
    const std::size_t nodes = skeleton.shape(0), m = 2 * nodes;
    const std::size_t flank = flank_from_skeleton.shape(0);
    require(skeleton.shape(1) == 2 && face > 0 && 2 * face <= nodes, "skeleton: (n, 2)");
    require(stiffness.shape(0) == m && stiffness.shape(1) == m, "stiffness: (m, m)");
    require(turning_parts.shape(0) == 6 && turning_parts.shape(1) == m * m,
            "turning_parts: (6, m m)");
    require(rim_slopes.shape(1) == m && elongation.shape(0) == m, "rim: (..., m)");
    require(flank_from_skeleton.shape(1) == m && flank_compliance.shape(0) == flank &&
                flank_compliance.shape(1) == flank,
            "flank_from_skeleton: (b, m), flank_compliance: (b, b)");
    sector_ = {nodes,
               face,
               rim_slopes.shape(0),
               flank,
               skeleton.data(),
               stiffness.data(),
               turning_parts.data(),
               rim_slopes.data(),
               elongation.data(),
               flank_from_skeleton.data(),
               flank_compliance.data()};
  }

  // Columns of kinematics: position, displacement, deformation, elongating and spin of
  // every sector, one after the other.
  void tangents(In<1> place, In<3> positions, In<2> force, Index dofs, Out<1> angle,
                Out<1> gyration, Out<3> kinematics, Out<2> flank, Out<2> gradient,
                Out<3> tangent) const {
    const std::size_t count = place.shape(0), m = 2 * sector_.nodes;
    const std::size_t n = gradient.shape(1);
    require(positions.shape(0) == count && positions.shape(1) == sector_.nodes &&
                positions.shape(2) == 2,
            "positions: (n, nodes, 2)");
    require(force.shape(0) == count && force.shape(1) == sector_.flank &&
                flank.shape(0) == count && flank.shape(1) == sector_.flank,
            "force, flank: (n, b)");
    require(dofs.shape(0) == m && angle.shape(0) == count && gyration.shape(0) == count,
            "dofs: (m,), angle, gyration: (n,)");
    require(kinematics.shape(0) == 5 && kinematics.shape(1) == count &&
                kinematics.shape(2) == m,
            "kinematics: (5, n, m)");
    check_assembly(count, n, gradient, tangent);
    check_dofs(dofs, n);
    const std::size_t part = count * m;
    double* k = kinematics.data();
    const swgjoint::Kinematics result{angle.data(), gyration.data(), k,
                                      k + part,     k + 2 * part,    k + 3 * part,
                                      k + 4 * part, flank.data()};
    const nb::gil_scoped_release release;
    swgjoint::sector_tangents(sector_, place.data(), positions.data(), force.data(),
                              dofs.data(), count, n, result, gradient.data(),
                              data_of(tangent));
  }

 private:
  In<2> arrays_[6];
  In<1> elongation_;
  swgjoint::Sector sector_{};
};

// weights: of the displacement and of its slope; numbers: see contact_tangent.py.
void add_contact_tangents(In<2> carried, In<1> angle, In<2> spin, In<2> position,
                          Index sector, Index side, In<3> weights, In<2> normal,
                          In<2> numbers, In<1> force, Index dofs, Out<3> tangent) {
  const std::size_t count = sector.shape(0), m = dofs.shape(0), n = tangent.shape(1);
  const std::size_t sectors = tangent.shape(0), nodes = weights.shape(2);
  require(carried.shape(0) == 4 * nodes && carried.shape(1) == m && m % 2 == 0,
          "carried: (4 nodes, m)");
  require(angle.shape(0) == sectors && spin.shape(0) == sectors && spin.shape(1) == m &&
              position.shape(0) == sectors && position.shape(1) == m,
          "angle: (sectors,), spin, position: (sectors, m)");
  require(side.shape(0) == count && weights.shape(0) == 2 && weights.shape(1) == count &&
              normal.shape(0) == count && normal.shape(1) == 2 &&
              numbers.shape(0) == count && numbers.shape(1) == 6 &&
              force.shape(0) == count,
          "contacts: one row each");
  require(tangent.shape(2) == n, "tangent: (sectors, n, n)");
  check_dofs(dofs, n);
  for (std::size_t i = 0; i < count; ++i) {
    const std::int64_t s = sector.data()[i], f = side.data()[i];
    require(s >= 0 && s < static_cast<std::int64_t>(sectors) && (f == 0 || f == 1),
            "sector or side");
  }
  const swgjoint::Turning turning{angle.data(), spin.data(), position.data()};
  const swgjoint::Loaded loaded{count,          sector.data(),
                                side.data(),    weights.data(),
                                weights.data() + count * nodes, normal.data(),
                                numbers.data(), force.data()};
  const nb::gil_scoped_release release;
  swgjoint::add_contact_tangents(carried.data(), nodes, m, turning, loaded, dofs.data(),
                                 n, tangent.data());
}

void race_contact(In<1> places, In<1> press, double half_thickness,
                  std::size_t per_sector, In<1> q, In<3> points, Masks touching,
                  Out<2> gap, Out<3> normal, Out<3> rows, Out<2> gradient,
                  Out<3> hessian) {
  const std::size_t nodes = places.shape(0), count = points.shape(0);
  require(per_sector > 0 && q.shape(0) > 0 && q.shape(0) % 4 == 0, "q: (4 elements,)");
  const swgjoint::Race race{q.shape(0) / 4, per_sector,   nodes,
                            places.data(),  press.data(), half_thickness};
  const std::size_t n = race.width();
  require(press.shape(0) == nodes && count * per_sector <= race.elements,
          "press: (b,), points: (n, b, 2)");
  for (std::size_t j = 0; j < nodes; ++j) require(places.data()[j] > -1.0, "places");
  require(points.shape(1) == nodes && points.shape(2) == 2 &&
              normal.shape(0) == count && normal.shape(1) == nodes &&
              normal.shape(2) == 2,
          "points, normal: (n, b, 2)");
  require(touching.shape(0) == count && touching.shape(1) == nodes &&
              gap.shape(0) == count && gap.shape(1) == nodes,
          "touching, gap: (n, b)");
  require(rows.shape(0) == count && rows.shape(1) == nodes && rows.shape(2) == n,
          "rows: (n, b, width)");
  require(gradient.shape(0) == count && gradient.shape(1) == n &&
              hessian.shape(0) == count && hessian.shape(1) == n &&
              hessian.shape(2) == n,
          "gradient: (n, width), hessian: (n, width, width)");
  const nb::gil_scoped_release release;
  swgjoint::race_contact(race, q.data(), points.data(), touching.data(), count,
                         gap.data(), normal.data(), rows.data(), gradient.data(),
                         hessian.data());
}

void add_banded(Indices rows, In<3> parts, Out<2> columns) {
  const std::size_t n = rows.shape(0), m = rows.shape(1), size = columns.shape(0),
                    width = columns.shape(1);
  require(parts.shape(0) == n && parts.shape(1) == m && parts.shape(2) == m,
          "parts: (n, m, m)");
  for (std::size_t e = 0; e < n; ++e) {
    const auto* own = rows.data() + e * m;
    const auto ends = std::minmax_element(own, own + m);
    require(m == 0 || (*ends.first >= 0 && *ends.second < static_cast<std::int64_t>(size) &&
                       *ends.second - *ends.first < static_cast<std::int64_t>(width)),
            "rows: within the band");
  }
  const nb::gil_scoped_release release;
  swgjoint::add_banded(rows.data(), parts.data(), n, m, width, columns.data());
}

bool solve_banded(Out<2> columns, Out<2> loads) {
  const std::size_t size = columns.shape(0), width = columns.shape(1);
  require(width > 0 && loads.shape(0) == size, "columns, loads: (size, ...)");
  const nb::gil_scoped_release release;
  return swgjoint::solve_banded(columns.data(), size, width, loads.data(),
                                loads.shape(1));
}

void ring_forces(double step, In<2> stiffness, In<3> shapes, In<4> derivatives,
                 In<2> hoop, In<2> moment, In<2> turning, Out<2> gradient,
                 Out<3> hessian) {
  constexpr std::size_t points = swgjoint::kGauss;
  const std::size_t n = derivatives.shape(0);
  require(stiffness.shape(0) == 2 && stiffness.shape(1) == points,
          "stiffness: (2, points)");
  require(shapes.shape(0) == points && shapes.shape(1) == 2 && shapes.shape(2) == 4,
          "shapes: (points, 2, 4)");
  require(derivatives.shape(1) == points && derivatives.shape(2) == 2 &&
              derivatives.shape(3) == 2,
          "derivatives: (n, points, 2, 2)");
  for (const auto& part : {hoop, moment, turning}) {
    require(part.shape(0) == n && part.shape(1) == points,
            "hoop, moment, turning: (n, points)");
  }
  require(gradient.shape(0) == n && gradient.shape(1) == 8 && hessian.shape(0) == n &&
              hessian.shape(1) == 8 && hessian.shape(2) == 8,
          "gradient: (n, 8), hessian: (n, 8, 8)");
  const nb::gil_scoped_release release;
  swgjoint::ring_forces({step, stiffness.data(), shapes.data()}, derivatives.data(),
                        hoop.data(), moment.data(), turning.data(), n, gradient.data(),
                        hessian.data());
}

void face_ring(In<1> q, In<2> points, In<1> start, Index own, bool inside,
               Out<1> place, IndexOut element, Out<1> distance, Out<2> normal,
               Out<2> tangent, Out<3> by_ring, Out<1> curvature) {
  const std::size_t n = points.shape(0), elements = q.shape(0) / 4;
  require(elements > 0 && q.shape(0) % 4 == 0, "q: (4 elements,)");
  require(points.shape(1) == 2 && start.shape(0) == n, "points: (n, 2), start: (n,)");
  require(own.shape(0) == 0 || own.shape(0) == n, "own: (n,) or (0,)");
  for (std::size_t k = 0; k < own.shape(0); ++k) {
    const std::int64_t one = own.data()[k];
    require(one >= 0 && one < static_cast<std::int64_t>(elements), "own: elements");
  }
  require(place.shape(0) == n && element.shape(0) == n && distance.shape(0) == n &&
              curvature.shape(0) == n,
          "place, element, distance, curvature: (n,)");
  require(normal.shape(0) == n && normal.shape(1) == 2 && tangent.shape(0) == n &&
              tangent.shape(1) == 2,
          "normal, tangent: (n, 2)");
  require(by_ring.shape(0) == n && by_ring.shape(1) == 3 && by_ring.shape(2) == 8,
          "by_ring: (n, 3, 8)");
  const nb::gil_scoped_release release;
  swgjoint::face_ring(q.data(), elements, points.data(), start.data(),
                      own.shape(0) > 0 ? own.data() : nullptr, inside, n,
                      {place.data(), element.data(), distance.data(), normal.data(),
                       tangent.data(), by_ring.data(), curvature.data()});
}

}  // namespace

void bind_plane(nb::module_& m) {
  m.def("race_contact", &race_contact, nb::arg("places").noconvert(),
        nb::arg("press").noconvert(), nb::arg("half_thickness"), nb::arg("per_sector"),
        nb::arg("q").noconvert(), nb::arg("points").noconvert(),
        nb::arg("touching").noconvert(), nb::arg("gap").noconvert(),
        nb::arg("normal").noconvert(), nb::arg("rows").noconvert(),
        nb::arg("gradient").noconvert(), nb::arg("hessian").noconvert());
  nb::class_<Bore>(m, "Bore")
      .def(nb::init<In<3>, std::size_t>(), nb::arg("weights").noconvert(),
           nb::arg("stations"))
      .def("gaps", &Bore::gaps, nb::arg("nodes").noconvert(),
           nb::arg("touching").noconvert(), nb::arg("outline").noconvert(),
           nb::arg("angle"), nb::arg("offset").noconvert(), nb::arg("far"),
           nb::arg("gap").noconvert(), nb::arg("normal").noconvert(),
           nb::arg("curvature").noconvert())
      .def("forces", &Bore::forces, nb::arg("spring").noconvert(),
           nb::arg("gap").noconvert(), nb::arg("normal").noconvert(),
           nb::arg("curvature").noconvert().none(), nb::arg("into").noconvert(),
           nb::arg("sign").noconvert().none(), nb::arg("gradient").noconvert(), nb::arg("tangent").noconvert().none())
      .def("gaps_after", &Bore::gaps_after, nb::arg("gap").noconvert(),
           nb::arg("normal").noconvert(), nb::arg("into").noconvert(),
           nb::arg("increment").noconvert(), nb::arg("result").noconvert());
  nb::class_<Sector>(m, "Sector")
      .def(nb::init<In<2>, std::size_t, In<2>, In<2>, In<2>, In<1>, In<2>, In<2>>(),
           nb::arg("skeleton").noconvert(), nb::arg("face"),
           nb::arg("stiffness").noconvert(), nb::arg("turning_parts").noconvert(),
           nb::arg("rim_slopes").noconvert(), nb::arg("elongation").noconvert(),
           nb::arg("flank_from_skeleton").noconvert(),
           nb::arg("flank_compliance").noconvert())
      .def("tangents", &Sector::tangents, nb::arg("place").noconvert(),
           nb::arg("positions").noconvert(), nb::arg("force").noconvert(),
           nb::arg("dofs").noconvert(), nb::arg("angle").noconvert(),
           nb::arg("gyration").noconvert(), nb::arg("kinematics").noconvert(),
           nb::arg("flank").noconvert(), nb::arg("gradient").noconvert(),
           nb::arg("tangent").noconvert().none());
  m.def("add_contact_tangents", &add_contact_tangents, nb::arg("carried").noconvert(),
        nb::arg("angle").noconvert(), nb::arg("spin").noconvert(),
        nb::arg("position").noconvert(), nb::arg("sector").noconvert(),
        nb::arg("side").noconvert(), nb::arg("weights").noconvert(),
        nb::arg("normal").noconvert(), nb::arg("numbers").noconvert(),
        nb::arg("force").noconvert(), nb::arg("dofs").noconvert(),
        nb::arg("tangent").noconvert());
  m.def("add_banded", &add_banded, nb::arg("rows").noconvert(),
        nb::arg("parts").noconvert(), nb::arg("columns").noconvert());
  m.def("solve_banded", &solve_banded, nb::arg("columns").noconvert(),
        nb::arg("loads").noconvert());
  m.def("ring_forces", &ring_forces, nb::arg("step"), nb::arg("stiffness").noconvert(),
        nb::arg("shapes").noconvert(), nb::arg("derivatives").noconvert(),
        nb::arg("hoop").noconvert(), nb::arg("moment").noconvert(),
        nb::arg("turning").noconvert(), nb::arg("gradient").noconvert(),
        nb::arg("hessian").noconvert());
  m.def("face_ring", &face_ring, nb::arg("q").noconvert(),
        nb::arg("points").noconvert(), nb::arg("start").noconvert(),
        nb::arg("own").noconvert(), nb::arg("inside"), nb::arg("place").noconvert(),
        nb::arg("element").noconvert(), nb::arg("distance").noconvert(),
        nb::arg("normal").noconvert(), nb::arg("tangent").noconvert(),
        nb::arg("by_ring").noconvert(), nb::arg("curvature").noconvert());
}
