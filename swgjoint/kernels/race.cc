#include "race.h"

#include <algorithm>
#include <cmath>

#include "vec.h"

namespace swgjoint {

namespace {

constexpr int kSteps = 6;         // of Newton's method for the foot of a perpendicular
constexpr double kNear = 1e-10;   // step after which it ends, in elements
constexpr std::size_t kOwn = 10;  // coordinates of a contact: the node and an element

// Position on an element and its derivatives by the parameter, with their shape functions.
struct Place {
  double value[4], slope[4];
  Vec r, v, w;
};

Vec combine(const double* shape, const Vec* nodal) {
  Vec sum{0.0, 0.0};
  for (int i = 0; i < 4; ++i) {
    sum.x += shape[i] * nodal[i].x;
    sum.y += shape[i] * nodal[i].y;
  }
  return sum;
}

Place evaluate(const Vec* nodal, double xi) {
  const double x2 = xi * xi, x3 = x2 * xi;
  Place at{{1.0 - 3.0 * x2 + 2.0 * x3, xi - 2.0 * x2 + x3, 3.0 * x2 - 2.0 * x3, x3 - x2},
           {6.0 * x2 - 6.0 * xi, 1.0 - 4.0 * xi + 3.0 * x2, 6.0 * xi - 6.0 * x2,
            3.0 * x2 - 2.0 * xi},
           {},
           {},
           {}};
  const double bend[4] = {12.0 * xi - 6.0, 6.0 * xi - 4.0, 6.0 - 12.0 * xi,
                          6.0 * xi - 2.0};
  at.r = combine(at.value, nodal);
  at.v = combine(at.slope, nodal);
  at.w = combine(bend, nodal);
  return at;
}

// Place of the foot of the perpendicular from a point
Place foot(const Vec* nodal, Vec point, double xi) {
  for (int k = 0; k < kSteps; ++k) {
    const Place at = evaluate(nodal, xi);
    const Vec rest = point - at.r;
    const double step = dot(rest, at.v) / (dot(at.v, at.v) - dot(rest, at.w));
    xi += std::clamp(step, -2.0, 2.0);
    if (std::abs(step) < kNear) break;
  }
  return evaluate(nodal, xi);
}

}  // namespace

void race_contact(const Race& race, const double* q, const double* points,
                  const bool* touching, std::size_t count, double* gap, double* normal,
                  double* rows, double* gradient, double* hessian) {
  const std::size_t n = race.width(), bore = 2 * race.nodes;
  std::fill_n(rows, count * race.nodes * n, 0.0);
  for (std::size_t s = 0; s < count; ++s) {
    for (std::size_t j = 0; j < race.nodes; ++j) {
      const std::size_t c = s * race.nodes + j;
      const auto whole = static_cast<std::size_t>(std::max(race.places[j], 0.0));
      const std::size_t first = std::min(whole, race.per_sector - 1);
      const std::size_t element = s * race.per_sector + first;
      const double* begin = q + 4 * element;
      const double* end = q + 4 * ((element + 1) % race.elements);
      const Vec nodal[4] = {
          {begin[0], begin[1]}, {begin[2], begin[3]}, {end[0], end[1]}, {end[2], end[3]}};
      const Vec point{points[2 * c], points[2 * c + 1]};
      const Place at = foot(nodal, point, race.places[j] - static_cast<double>(first));
      const double length = size(at.v);
      const Vec tangent{at.v.x / length, at.v.y / length}, out{tangent.y, -tangent.x};
      const double distance = dot(point - at.r, out);
      gap[c] = distance - race.half_thickness;
      normal[2 * c] = out.x;
      normal[2 * c + 1] = out.y;

      // derivatives of u_n, u_t and beta, see swgjoint/fe/rings/facing.py
      double by[3][kOwn] = {{out.x, out.y}, {tangent.x, tangent.y}, {}};
      for (std::size_t i = 0; i < 4; ++i) {
        const double value = at.value[i], slope = at.slope[i] / length;
        by[0][2 + 2 * i] = -value * out.x;
        by[0][3 + 2 * i] = -value * out.y;
        by[1][2 + 2 * i] = -value * tangent.x;
        by[1][3 + 2 * i] = -value * tangent.y;
        by[2][2 + 2 * i] = slope * out.x;
        by[2][3 + 2 * i] = slope * out.y;
      }
      std::size_t dofs[kOwn] = {2 * j, 2 * j + 1};
      for (std::size_t i = 0; i < 8; ++i) dofs[2 + i] = bore + 4 * first + i;
      double* own = rows + c * n;
      for (std::size_t i = 0; i < kOwn; ++i) own[dofs[i]] = by[0][i];
      if (!touching[c]) continue;

      // k dg dg - F d2g
      const double k = race.press[j], force = -k * gap[c];
      const double kappa = dot(out, at.w) / (length * length);
      const double pushed = force / (1.0 - distance * kappa);
      double* slope = gradient + s * n;
      double* tangents = hessian + s * n * n;
      for (std::size_t a = 0; a < kOwn; ++a) {
        slope[dofs[a]] -= force * by[0][a];
        const double u = k * by[0][a];
        const double t = pushed * (kappa * by[1][a] + by[2][a]);
        const double beta = pushed * (by[1][a] + distance * by[2][a]);
        double* row = tangents + dofs[a] * n;
        for (std::size_t b = 0; b < kOwn; ++b) {
          row[dofs[b]] += u * by[0][b] + t * by[1][b] + beta * by[2][b];
        }
      }
    }
  }
}

}  // namespace swgjoint
