// Python interface of the compiled loops. Results are written into arrays of the
// caller, so array arguments must not be converted to copies. Shapes and indices are
// checked here, because a wrong one would read or write beyond the end of an array.

#include <nanobind/nanobind.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "contact_path.h"
#include "contact_step.h"
#include "flank_arrays.h"
#include "motions.h"
#include "nearest_tree.h"
#include "outline.h"
#include "ring_factor.h"
#include "tangents.h"

namespace {

void outline_distance(In<2> points, In<2> outline, Out<2> result) {
  const std::size_t n = points.shape(0);
  require(points.shape(1) == 2 && result.shape(0) == n && result.shape(1) == 4,
          "points: (n, 2), result: (n, 4)");
  check_outline(outline);
  const nb::gil_scoped_release release;
  swgjoint::outline_distance(points.data(), n, {outline.data(), outline.shape(0)},
                             result.data());
}

void nearest_tree(In<2> distance, IndexOut order, IndexOut before) {
  const std::size_t n = distance.shape(0);
  require(n > 0 && distance.shape(1) == n, "distance: (n, n)");
  require(order.shape(0) == n && before.shape(0) == n, "order, before: (n,)");
  const nb::gil_scoped_release release;
  swgjoint::nearest_tree(distance.data(), n, order.data(), before.data());
}

void grow_oscillation(In<2> sin, In<2> cos, In<1> weight, In<1> omega, double offset,
                      In<1> ramp, In<1> slope, In<1> bend, Out<2> result) {
  const std::size_t count = sin.shape(0), n = sin.shape(1);
  require(cos.shape(0) == count && cos.shape(1) == n && weight.shape(0) == count &&
              omega.shape(0) == count && count > 0,
          "sin, cos: (count, n)");
  require(ramp.shape(0) == n && slope.shape(0) == n && bend.shape(0) == n,
          "ramp, slope, bend: (n,)");
  require(result.shape(0) == 3 && result.shape(1) == n, "result: (3, n)");
  swgjoint::grow_oscillation(sin.data(), cos.data(), count, n, weight.data(),
                             omega.data(), offset, ramp.data(), slope.data(),
                             bend.data(), result.data());
}

void move_back(In<1> time, In<1> there, In<1> back, Out<2> result) {
  require(there.shape(0) == 4 && back.shape(0) == 4, "there, back: (4,)");
  require(result.shape(0) == 3 && result.shape(1) == time.shape(0), "result: (3, n)");
  const double *a = there.data(), *b = back.data();
  swgjoint::move_back(time.data(), time.shape(0), {a[0], a[1], a[2], a[3]},
                      {b[0], b[1], b[2], b[3]}, result.data());
}

void write_plan(In<1> position, In<1> velocity, In<1> acceleration, double load,
                In<1> ramp, double inertia, Out<2> result) {
  const std::size_t m = position.shape(0), n = ramp.shape(0);
  require(velocity.shape(0) == m && acceleration.shape(0) == m && m <= n,
          "position, velocity, acceleration: (m,), m <= n");
  require(result.shape(0) == n && result.shape(1) == 5, "result: (n, 5)");
  swgjoint::write_plan(position.data(), velocity.data(), acceleration.data(), m, load,
                       ramp.data(), inertia, n, result.data());
}

void add_station_stiffness(In<3> weights, In<3> direction, In<2> stiffness,
                           Out<3> result) {
  const std::size_t p = weights.shape(0), width = weights.shape(2);
  const std::size_t count = stiffness.shape(0), q = stiffness.shape(1);
  require(p > 0 && weights.shape(1) == 2 && q > 0 && q % p == 0, "weights: (p, 2, w)");
  require(direction.shape(0) == count && direction.shape(1) == q &&
              direction.shape(2) == 2,
          "direction: (n, q, 2)");
  const std::size_t size = width + 2 * (q / p - 1);
  require(result.shape(0) == count && result.shape(1) == size && result.shape(2) == size,
          "result: (n, m, m)");
  const nb::gil_scoped_release release;
  swgjoint::add_station_stiffness(weights.data(), p, width, direction.data(),
                                  stiffness.data(), count, q / p, result.data());
}

void add_blocks(In<3> blocks, Index into, Out<3> result) {
  const std::size_t count = blocks.shape(0), size = into.shape(0);
  const std::size_t full = result.shape(1);
  require(blocks.shape(1) == size && blocks.shape(2) == size, "blocks: (n, k, k)");
  require(result.shape(0) == count && result.shape(2) == full, "result: (n, m, m)");
  for (std::size_t i = 0; i < size; ++i) {
    require(into.data()[i] >= 0 && into.data()[i] < static_cast<std::int64_t>(full),
            "into: rows of result");
  }
  const nb::gil_scoped_release release;
  swgjoint::add_blocks(blocks.data(), count, size, into.data(), result.data(), full);
}

void respond(Index offsets, In<3> blocks, In<2> force, Out<2> result) {
  const std::size_t count = offsets.shape(0), rows = blocks.shape(1);
  const std::size_t size = blocks.shape(2), teeth = force.shape(0);
  require(blocks.shape(0) == count && force.shape(1) == size,
          "blocks: (n, rows, size), force: (teeth, size)");
  require(result.shape(0) == teeth && result.shape(1) == rows, "result: (teeth, rows)");
  const nb::gil_scoped_release release;
  swgjoint::respond(offsets.data(), blocks.data(), count, rows, size, force.data(), teeth,
                    result.data());
}

void contact_compliance(Index block_of, Index after, In<3> blocks, Index tooth, In<2> weight,
                        Out<2> result) {
  const std::size_t n = tooth.shape(0), size = weight.shape(1);
  const std::size_t teeth = block_of.shape(0);
  require(teeth > 0 && blocks.shape(1) == size && blocks.shape(2) == size,
          "blocks: (n, size, size)");
  require(weight.shape(0) == n && result.shape(0) == n && result.shape(1) == n,
          "weight: (n, size), result: (n, n)");
  const auto count = static_cast<std::int64_t>(blocks.shape(0));
  for (std::size_t i = 0; i < teeth; ++i) {
    require(block_of.data()[i] >= -1 && block_of.data()[i] < count, "block_of");
  }
  require(after.shape(0) == blocks.shape(0), "after: one per block");
  for (std::int64_t k = 0; k < count; ++k) {
    const std::int64_t next = after.data()[k];
    require(next == -1 || (next > k && next < count), "after: increasing");
  }
  const nb::gil_scoped_release release;
  swgjoint::contact_compliance(block_of.data(), teeth, after.data(), blocks.data(), size,
                               tooth.data(), weight.data(), n, result.data());
}

// Rows of contact number, torque from the start and slope before the change; the last row
// has the slope after them and the number -1. None if contacts become singular.
nb::object follow_path(In<2> matrix, In<1> slack, In<1> by_torque, In<1> by_value,
                       double reach, std::size_t most) {
  const std::size_t n = slack.shape(0);
  require(matrix.shape(0) == n && matrix.shape(1) == n && by_torque.shape(0) == n &&
              by_value.shape(0) == n,
          "matrix: (n, n), vectors: (n,)");
  const swgjoint::PathProblem problem{n, matrix.data(), slack.data(), by_torque.data(),
                                      by_value.data()};
  std::vector<swgjoint::PathChange> changes;
  double slope;
  bool solved;
  {
    const nb::gil_scoped_release release;
    solved = swgjoint::follow_path(problem, reach, most, &changes, &slope);
  }
  if (!solved) return nb::none();
  changes.push_back({-1, reach, slope});
  nb::list rows;
  for (const swgjoint::PathChange& one : changes) {
    rows.append(nb::make_tuple(one.contact, one.away, one.slope));
  }
  return rows;
}

// A factorised ring of sectors. Methods return false if it is not positive definite.
class RingFactor {
 public:
  RingFactor(std::int64_t sectors, std::int64_t size, std::int64_t face)
      : ring_(checked(sectors, size, face), size, face) {}

  bool update(In<3> blocks, Index changed) {
    require(blocks.shape(0) == ring_.sectors() && blocks.shape(1) == ring_.size() &&
                blocks.shape(2) == ring_.size(),
            "blocks: (sectors, n, n)");
    check(changed);
    const nb::gil_scoped_release release;
    return ring_.update(blocks.data(), changed.data(), changed.shape(0));
  }

  void solve(Out<3> loads) const {
    require(loads.shape(0) == ring_.sectors() && loads.shape(1) == ring_.size(),
            "loads: (sectors, n, k)");
    const nb::gil_scoped_release release;
    ring_.solve(loads.data(), loads.shape(2));
  }

  void condense(In<3> loads, Index sector, In<2> rows, Out<2> result) {
    const std::size_t d = loads.shape(2), k = rows.shape(0);
    require(loads.shape(0) == ring_.sectors() && loads.shape(1) == ring_.size(),
            "loads: (sectors, n, d)");
    require(rows.shape(1) == ring_.size() && sector.shape(0) == k, "rows: (k, n)");
    require(result.shape(0) == d + k && result.shape(1) == d + k,
            "result: (d + k, d + k)");
    check(sector);
    const nb::gil_scoped_release release;
    ring_.reduce(loads.data(), d, sector.data(), rows.data(), k);
    ring_.products(result.data());
  }

  // Contact forces and increment of one Newton step: the condensed system of the loads
  // (minus the gradient and both constraints) and of rows on single sectors. numbers:
  // stiffness of the anchor, moment, rotation. Compliance of the output; NaN if no active
  // set is found.
  double solve_contacts(In<3> loads, Index sector, In<2> rows, In<1> gap, In<1> arm,
                        In<2> compliance, In<1> numbers, bool turns, bool held,
                        MaskOut active, Out<1> result, Out<3> increment) {
    const std::size_t k = rows.shape(0), n = ring_.size();
    require(loads.shape(0) == ring_.sectors() && loads.shape(1) == n &&
                loads.shape(2) == 3,
            "loads: (sectors, n, 3)");
    require(rows.shape(1) == n && sector.shape(0) == k, "rows: (k, n)");
    require(gap.shape(0) == k && arm.shape(0) == k && compliance.shape(0) == k &&
                compliance.shape(1) == k && active.shape(0) == k,
            "gap, arm, active: (k,), compliance: (k, k)");
    require(numbers.shape(0) == 3 && result.shape(0) == k + 3, "result: (k + 3,)");
    require(increment.shape(0) == ring_.sectors() && increment.shape(1) == n &&
                increment.shape(2) == 1,
            "increment: (sectors, n, 1)");
    check(sector);
    const double* given = numbers.data();
    const swgjoint::ContactStep step{k,        gap.data(), arm.data(), compliance.data(),
                                     given[0], given[1],   given[2],   turns,
                                     held};
    const nb::gil_scoped_release release;
    std::vector<double> products((k + 3) * (k + 3));
    ring_.reduce(loads.data(), 3, sector.data(), rows.data(), k);
    ring_.products(products.data());
    double output = 0.0;
    double* z = result.data();
    if (!swgjoint::solve_contact_step(step, products.data(), active.data(), z, &output)) {
      return std::numeric_limits<double>::quiet_NaN();
    }
    // the loads on all sectors, then those of the teeth
    std::vector<double> factors = {1.0, z[k], z[k + 2]};
    factors.insert(factors.end(), z, z + k);
    ring_.solve_reduced(factors.data(), increment.data());
    return output;
  }

 private:
  static std::size_t checked(std::int64_t sectors, std::int64_t size,
                             std::int64_t face) {
    require(sectors > 0 && face > 0 && size >= 2 * face, "sectors, size, face");
    return sectors;
  }

  void check(const Index& sector) const {
    const auto count = static_cast<std::int64_t>(ring_.sectors());
    for (std::size_t i = 0; i < sector.shape(0); ++i) {
      require(sector.data()[i] >= 0 && sector.data()[i] < count, "sector");
    }
  }

  swgjoint::RingFactor ring_;
};

}  // namespace

// in the other files of this name
void bind_map(nb::module_& m);
void bind_plane(nb::module_& m);
void bind_search(nb::module_& m);
void bind_strips(nb::module_& m);

NB_MODULE(compiled, m) {
  // an interrupted process still holds its objects, which is no leak to report
  nb::set_leak_warnings(false);
  bind_map(m);
  bind_plane(m);
  bind_search(m);
  bind_strips(m);
  m.def("add_station_stiffness", &add_station_stiffness, nb::arg("weights").noconvert(),
        nb::arg("direction").noconvert(), nb::arg("stiffness").noconvert(),
        nb::arg("result").noconvert());
  m.def("add_blocks", &add_blocks, nb::arg("blocks").noconvert(),
        nb::arg("into").noconvert(), nb::arg("result").noconvert());
  m.def("respond", &respond, nb::arg("offsets").noconvert(),
        nb::arg("blocks").noconvert(), nb::arg("force").noconvert(),
        nb::arg("result").noconvert());
  m.def("contact_compliance", &contact_compliance, nb::arg("block_of").noconvert(),
        nb::arg("after").noconvert(), nb::arg("blocks").noconvert(), nb::arg("tooth").noconvert(),
        nb::arg("weight").noconvert(), nb::arg("result").noconvert());
  m.def("follow_path", &follow_path, nb::arg("matrix").noconvert(),
        nb::arg("slack").noconvert(), nb::arg("by_torque").noconvert(),
        nb::arg("by_value").noconvert(), nb::arg("reach"), nb::arg("most"));
  m.def("nearest_tree", &nearest_tree, nb::arg("distance").noconvert(),
        nb::arg("order").noconvert(), nb::arg("before").noconvert());
  m.def("outline_distance", &outline_distance, nb::arg("points").noconvert(),
        nb::arg("outline").noconvert(), nb::arg("result").noconvert());
  m.def("grow_oscillation", &grow_oscillation, nb::arg("sin").noconvert(),
        nb::arg("cos").noconvert(), nb::arg("weight").noconvert(),
        nb::arg("omega").noconvert(), nb::arg("offset"), nb::arg("ramp").noconvert(),
        nb::arg("slope").noconvert(), nb::arg("bend").noconvert(),
        nb::arg("result").noconvert());
  m.def("move_back", &move_back, nb::arg("time").noconvert(),
        nb::arg("there").noconvert(), nb::arg("back").noconvert(),
        nb::arg("result").noconvert());
  m.def("write_plan", &write_plan, nb::arg("position").noconvert(),
        nb::arg("velocity").noconvert(), nb::arg("acceleration").noconvert(),
        nb::arg("load"), nb::arg("ramp").noconvert(), nb::arg("inertia"),
        nb::arg("result").noconvert());
  nb::class_<RingFactor>(m, "RingFactor")
      .def(nb::init<std::int64_t, std::int64_t, std::int64_t>(), nb::arg("sectors"),
           nb::arg("size"), nb::arg("face"))
      .def("update", &RingFactor::update, nb::arg("blocks").noconvert(),
           nb::arg("changed").noconvert())
      .def("solve", &RingFactor::solve, nb::arg("loads").noconvert())
      .def("condense", &RingFactor::condense, nb::arg("loads").noconvert(),
           nb::arg("sector").noconvert(), nb::arg("rows").noconvert(),
           nb::arg("result").noconvert())
      .def("solve_contacts", &RingFactor::solve_contacts, nb::arg("loads").noconvert(),
           nb::arg("sector").noconvert(), nb::arg("rows").noconvert(),
           nb::arg("gap").noconvert(), nb::arg("arm").noconvert(),
           nb::arg("compliance").noconvert(), nb::arg("numbers").noconvert(),
           nb::arg("turns"), nb::arg("held"), nb::arg("active").noconvert(),
           nb::arg("result").noconvert(), nb::arg("increment").noconvert());
}
