#include "hermite_ring.h"

#include <algorithm>
#include <cmath>

namespace swgjoint {
namespace {

// Force and tangent of one Gauss point with respect to (v, w), the first two derivatives
// of the position by the element parameter.
struct Point {
  double force[4];
  double tangent[4][4];
};

Point at_point(const double* v, const double* w, double h, double axial, double bending,
               double hoop, double moment, double turning) {
  Point out;
  const double square = v[0] * v[0] + v[1] * v[1], length = std::sqrt(square);
  const double by_v[2] = {w[1], -w[0]}, by_w[2] = {-v[1], v[0]};  // of v x w
  // gradients of stretch and curvature
  double s[4] = {}, k[4];
  for (int c = 0; c < 2; ++c) {
    s[c] = v[c] / (h * length);
    k[c] = (by_v[c] / h - 2.0 * turning * v[c]) / square;
    k[2 + c] = by_w[c] / (h * square);
  }
  // second derivatives of the stretch, then of the curvature
  const double twice = moment / (h * square), of_stretch = hoop / (h * length);
  const double along = 4.0 * moment * turning / square - 0.5 * of_stretch;
  double across[2];
  for (int c = 0; c < 2; ++c) {
    across[c] = along * v[c] / square - 2.0 * twice / square * by_v[c];
  }
  const double diagonal = of_stretch - 2.0 * moment * turning / square;
  const double cross[2][2] = {{0.0, twice}, {-twice, 0.0}};
  for (int c = 0; c < 4; ++c) {
    out.force[c] = hoop * s[c] + moment * k[c];
    for (int d = 0; d < 4; ++d) {
      out.tangent[c][d] = axial * s[c] * s[d] + bending * k[c] * k[d];
    }
  }
  for (int c = 0; c < 2; ++c) {
    out.tangent[c][c] += diagonal;
    for (int d = 0; d < 2; ++d) {
      out.tangent[c][d] += across[c] * v[d] + across[d] * v[c];
      const double mixed = -2.0 * twice / square * v[c] * by_w[d] + cross[c][d];
      out.tangent[c][2 + d] += mixed;
      out.tangent[2 + d][c] += mixed;
    }
  }
  return out;
}

// Position on an element and its first two derivatives, with the shape functions of the
// four coordinate pairs and their first derivatives.
struct Place {
  double r[2] = {}, v[2] = {}, w[2] = {};
  double value[4], slope[4];
};

Place evaluate(const double* q, std::size_t elements, std::size_t element, double x) {
  Place at;
  const double x2 = x * x, x3 = x2 * x;
  const double value[4] = {1 - 3 * x2 + 2 * x3, x - 2 * x2 + x3, 3 * x2 - 2 * x3,
                           x3 - x2};
  const double slope[4] = {6 * x2 - 6 * x, 1 - 4 * x + 3 * x2, 6 * x - 6 * x2,
                           3 * x2 - 2 * x};
  const double bend[4] = {12 * x - 6, 6 * x - 4, 6 - 12 * x, 6 * x - 2};
  const std::size_t next = element + 1 == elements ? 0 : element + 1;
  for (int a = 0; a < 4; ++a) {
    const double* node = q + 4 * (a < 2 ? element : next) + 2 * (a % 2);
    for (int c = 0; c < 2; ++c) {
      at.r[c] += value[a] * node[c];
      at.v[c] += slope[a] * node[c];
      at.w[c] += bend[a] * node[c];
    }
    at.value[a] = value[a];
    at.slope[a] = slope[a];
  }
  return at;
}

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1]; }

}  // namespace

void face_ring(const double* q, std::size_t elements, const double* points,
               const double* start, const std::int64_t* own, bool inside, std::size_t n,
               const FacingArrays& out) {
  constexpr int kIterations = 6;
  const auto count = static_cast<double>(elements);
  for (std::size_t k = 0; k < n; ++k) {
    const double* point = points + 2 * k;
    double place = start[k];
    std::size_t element = 0;
    double xi = 0.0;
    // an infinite place or none has no element; its results are not numbers
    const auto split = [&] {
      if (own) {
        element = static_cast<std::size_t>(own[k]);
        xi = place - static_cast<double>(own[k]);
      } else if (std::isfinite(place)) {
        const double whole = std::floor(place);
        const double turns = std::floor(whole / count);
        element = static_cast<std::size_t>(
            std::clamp(whole - count * turns, 0.0, count - 1.0));
        xi = place - whole;
      } else {
        xi = std::nan("");
      }
      return evaluate(q, elements, element, xi);
    };
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const Place at = split();
      const double rest[2] = {point[0] - at.r[0], point[1] - at.r[1]};
      const double step = dot(rest, at.v) / (dot(at.v, at.v) - dot(rest, at.w));
      place += std::clamp(step, -2.0, 2.0);
      if (std::fabs(step) < 1e-10) break;
    }
    const Place at = split();
    const double length = std::hypot(at.v[0], at.v[1]), side = inside ? -1.0 : 1.0;
    const double tangent[2] = {at.v[0] / length, at.v[1] / length};
    const double normal[2] = {side * tangent[1], -side * tangent[0]};
    const double rest[2] = {point[0] - at.r[0], point[1] - at.r[1]};
    out.place[k] = place;
    out.element[k] = static_cast<std::int64_t>(element);
    out.distance[k] = dot(rest, normal);
    out.curvature[k] = dot(normal, at.w) / (length * length);
    double* rows = out.by_ring + 24 * k;
    for (int c = 0; c < 2; ++c) {
      out.normal[2 * k + c] = normal[c];
      out.tangent[2 * k + c] = tangent[c];
      for (int a = 0; a < 4; ++a) {
        rows[2 * a + c] = -at.value[a] * normal[c];
        rows[8 + 2 * a + c] = -at.value[a] * tangent[c];
        rows[16 + 2 * a + c] = at.slope[a] / length * normal[c];
      }
    }
  }
}

void ring_forces(const RingElement& element, const double* derivatives,
                 const double* hoop, const double* moment, const double* turning,
                 std::size_t n, double* gradient, double* hessian) {
  std::fill_n(gradient, 8 * n, 0.0);
  std::fill_n(hessian, 64 * n, 0.0);
  for (std::size_t e = 0; e < n; ++e) {
    double *own = gradient + 8 * e, *matrix = hessian + 64 * e;
    for (std::size_t g = 0; g < kGauss; ++g) {
      const std::size_t at = kGauss * e + g;
      const double *v = derivatives + 4 * at, *shapes = element.shapes + 8 * g;
      const Point p =
          at_point(v, v + 2, element.step, element.stiffness[g],
                   element.stiffness[kGauss + g], hoop[at], moment[at], turning[at]);
      // coordinate c of shape function a is number 2 a + c
      for (int a = 0; a < 4; ++a) {
        double by[2][4];  // of a change of the coordinate
        for (int c = 0; c < 2; ++c) {
          own[2 * a + c] += shapes[a] * p.force[c] + shapes[4 + a] * p.force[2 + c];
          for (int d = 0; d < 4; ++d) {
            by[c][d] = shapes[a] * p.tangent[c][d] + shapes[4 + a] * p.tangent[2 + c][d];
          }
        }
        for (int c = 0; c < 2; ++c) {
          double* row = matrix + 8 * (2 * a + c);
          for (int b = 0; b < 4; ++b) {
            for (int d = 0; d < 2; ++d) {
              row[2 * b + d] += by[c][d] * shapes[b] + by[c][2 + d] * shapes[4 + b];
            }
          }
        }
      }
    }
  }
}

}  // namespace swgjoint
