#include "corotation.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "wide.h"

namespace swgjoint {
namespace {

using Values = std::vector<double>;

SWGJOINT_INLINE void add(double factor, const double* __restrict values,
                            std::size_t n, double* __restrict sum) {
  for (std::size_t i = 0; i < n; ++i) sum[i] += factor * values[i];
}

// Adds the products of values (rows,) with a matrix (rows, n).
SWGJOINT_INLINE void add_rows(const double* values, const double* matrix,
                                 std::size_t rows, std::size_t n, double* sum) {
  for (std::size_t r = 0; r < rows; ++r, matrix += n) {
    if (values[r] != 0.0) add(values[r], matrix, n, sum);
  }
}

// The pairs of a vector turned by an angle, with the cosine and sine given.
void rotate(const double* from, double cos, double sin, std::size_t nodes, double* to) {
  for (std::size_t i = 0; i < nodes; ++i) {
    const double x = from[2 * i], y = from[2 * i + 1];
    to[2 * i] = cos * x - sin * y;
    to[2 * i + 1] = sin * x + cos * y;
  }
}

// The pairs of a vector turned by a right angle.
void quarter(const double* from, std::size_t nodes, double* to) {
  rotate(from, 0.0, 1.0, nodes, to);
}

// A row of a matrix that turns, from its parts.
SWGJOINT_INLINE void turn_row(const double* parts, std::size_t apart, std::size_t n,
                                 double cos, double sin, double* __restrict row) {
  const double *even = parts, *along = even + apart, *across = along + apart;
  for (std::size_t i = 0; i < n; ++i) row[i] = even[i] + cos * along[i] + sin * across[i];
}

// Fills the kinematics of one sector; the pointers of k are those of this sector.
void move(const Sector& e, double place, const double* positions, const double* faces,
          const Kinematics& k) {
  const std::size_t m = 2 * e.nodes;
  double seen_cross = 0.0, seen_dot = 0.0;
  rotate(positions, std::cos(place), -std::sin(place), e.nodes, k.position);
  for (std::size_t i = 0; i < e.nodes; ++i) {
    // faces: place of the node relative to the centre of the faces, zero elsewhere
    const double x = k.position[2 * i], y = k.position[2 * i + 1];
    seen_cross += faces[2 * i] * y - faces[2 * i + 1] * x;
    seen_dot += faces[2 * i] * x + faces[2 * i + 1] * y;
  }
  const double phi = std::atan2(seen_cross, seen_dot);
  *k.angle = place + phi;
  rotate(Values(k.position, k.position + m).data(), std::cos(phi), -std::sin(phi),
         e.nodes, k.position);
  *k.gyration = sum_of_products(faces, k.position, m);
  double mean[2] = {0.0, 0.0};
  for (std::size_t i = 0; i < m; ++i) {
    k.displacement[i] = k.position[i] - e.skeleton[i];
    mean[i % 2] += k.displacement[i];
  }
  quarter(faces, e.nodes, k.spin);
  const double count = static_cast<double>(e.nodes);
  for (std::size_t i = 0; i < m; ++i) {
    k.spin[i] /= *k.gyration;
    k.deformation[i] = k.displacement[i] - mean[i % 2] / count;
    k.elongating[i] = 0.0;
  }
  double longer = 0.0;
  for (std::size_t r = 0; r < e.slopes; ++r) {
    const double* row = e.rim_slopes + r * m;
    const double slope = sum_of_products(row, k.deformation, m);
    add(slope, row, m, k.elongating);
    longer += 0.5 * slope * slope;
  }
  add(longer, e.elongation, m, k.deformation);
}

}  // namespace

SWGJOINT_WIDE void sector_tangents(const Sector& e, const double* place, const double* positions,
                     const double* force, const std::int64_t* dofs, std::size_t count,
                     std::size_t n, const Kinematics& result, double* gradient,
                     double* tangent) {
  const std::size_t m = 2 * e.nodes;
  Values faces(m, 0.0), stretched(m, 0.0);
  double centre[2] = {0.0, 0.0};
  const auto on_face = [&](std::size_t i) {
    return i < 2 * e.face || i >= m - 2 * e.face;
  };
  for (std::size_t i = 0; i < m; ++i) {
    if (on_face(i)) centre[i % 2] += e.skeleton[i] / static_cast<double>(2 * e.face);
  }
  for (std::size_t i = 0; i < m; ++i) {
    if (on_face(i)) faces[i] = e.skeleton[i] - centre[i % 2];
  }
  add_rows(e.elongation, e.stiffness, m, m, stretched.data());
  const double own = sum_of_products(e.elongation, stretched.data(), m);

  Values elastic(m), total(m), j_y(m), k_jy(m), column(m), beside(m), turned(4 * m);
  for (std::size_t s = 0; s < count; ++s) {
    const Kinematics k{result.angle + s,
                       result.gyration + s,
                       result.position + m * s,
                       result.displacement + m * s,
                       result.deformation + m * s,
                       result.elongating + m * s,
                       result.spin + m * s,
                       result.flank + e.flank * s};
    move(e, place[s], positions + m * s, faces.data(), k);
    const double cos = std::cos(*k.angle), sin = std::sin(*k.angle);

    // elastic forces, and their sum with the tooth forces
    std::fill(elastic.begin(), elastic.end(), 0.0);
    add_rows(k.deformation, e.stiffness, m, m, elastic.data());
    const double hoop = sum_of_products(elastic.data(), e.elongation, m);
    add(hoop, k.elongating, m, elastic.data());
    total = elastic;
    for (std::size_t b = 0; b < e.flank; ++b) {
      const double* row = e.flank_from_skeleton + m * b;
      k.flank[b] = sum_of_products(row, k.displacement, m);
      if (force[b] != 0.0) add(-force[b], row, m, total.data());
    }
    add_rows(force, e.flank_compliance, e.flank, e.flank, k.flank);
    force += e.flank;

    // gradient of the elastic energy
    quarter(k.position, e.nodes, j_y.data());
    beside = elastic;
    add(-sum_of_products(elastic.data(), j_y.data(), m), k.spin, m, beside.data());
    rotate(beside.data(), cos, sin, e.nodes, turned.data());
    for (std::size_t i = 0; i < m; ++i) gradient[dofs[i]] += turned[i];
    gradient += n;
    if (!tangent) continue;

    // vectors of the tangent, whose products are added to the turned stiffness
    const double tension = sum_of_products(k.deformation, stretched.data(), m);
    column = stretched;
    add(0.5 * own, k.elongating, m, column.data());
    std::fill(k_jy.begin(), k_jy.end(), 0.0);
    add_rows(j_y.data(), e.stiffness, m, m, k_jy.data());
    for (std::size_t r = 0; r < e.slopes; ++r) {
      const double* row = e.rim_slopes + r * m;
      add(tension * sum_of_products(row, j_y.data(), m), row, m, k_jy.data());
    }
    const double by_column = sum_of_products(column.data(), j_y.data(), m);
    const double by_elongating = sum_of_products(k.elongating, j_y.data(), m);
    add(by_column, k.elongating, m, k_jy.data());
    add(by_elongating, column.data(), m, k_jy.data());
    const double quadratic =
        sum_of_products(j_y.data(), k_jy.data(), m) - sum_of_products(total.data(), k.position, m);
    const double moment = sum_of_products(total.data(), j_y.data(), m);
    quarter(total.data(), e.nodes, beside.data());
    add(-1.0, k_jy.data(), m, beside.data());
    // places relative to the centre of the faces: the spin times the gyration, turned
    add(moment / *k.gyration, faces.data(), m, beside.data());
    add(0.5 * quadratic, k.spin, m, beside.data());
    rotate(k.elongating, cos, sin, e.nodes, turned.data());
    rotate(k.spin, cos, sin, e.nodes, turned.data() + m);
    rotate(column.data(), cos, sin, e.nodes, turned.data() + 2 * m);
    rotate(beside.data(), cos, sin, e.nodes, turned.data() + 3 * m);
    const double c2 = cos * cos - sin * sin, s2 = 2.0 * sin * cos;
    const double *a = turned.data(), *b = a + m, *c = b + m, *d = c + m;
    const std::size_t part = m * m;
    std::fill(tangent, tangent + n * n, 0.0);
    for (std::size_t i = 0; i < m; ++i) {
      const double* p = e.turning_parts + m * i;
      double* to = tangent + n * static_cast<std::size_t>(dofs[i]);
      // rows do not overlap with what they are computed from
      double* __restrict row = total.data();
      turn_row(p, part, m, c2, s2, row);
      turn_row(p + 3 * part, part, m, c2, s2, beside.data());
      add(tension, beside.data(), m, row);
      add(a[i], c, m, row);
      add(c[i], a, m, row);
      add(b[i], d, m, row);
      add(d[i], b, m, row);
      for (std::size_t j = 0; j < m; ++j) to[dofs[j]] = row[j];
    }
    tangent += n * n;
  }
}

}  // namespace swgjoint
