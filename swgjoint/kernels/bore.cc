#include "bore.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "wide.h"

namespace swgjoint {
namespace {

// Sum over the nodes of an interval of their coordinates times the weights of a station.
Vec station_of(const Stations& stations, std::size_t i, const double* window) {
  const double *x = stations.weights + 2 * stations.width * i, *y = x + stations.width;
  Vec sum{0.0, 0.0};
  for (std::size_t j = 0; j < stations.width; ++j) {
    sum.x += x[j] * window[j];
    sum.y += y[j] * window[j];
  }
  return sum;
}

// The same sums for all stations of an interval (p,).
SWGJOINT_WIDE void stations_of(const Stations& stations, const double* window,
                               double* __restrict x, double* __restrict y) {
  const std::size_t p = stations.p;
  std::fill(x, x + p, 0.0);
  std::fill(y, y + p, 0.0);
  for (std::size_t j = 0; j < stations.width; ++j) {
    const double *along = stations.by_node + 2 * p * j, *across = along + p;
    for (std::size_t i = 0; i < p; ++i) {
      x[i] += along[i] * window[j];
      y[i] += across[i] * window[j];
    }
  }
}

}  // namespace

void bore_gaps(const Stations& stations, const Support& support, const double* nodes,
               const bool* touching, std::size_t count, double* gap, double* normal,
               double* curvature) {
  const double cos = std::cos(support.angle), sin = std::sin(support.angle);
  const std::size_t p = stations.p;
  std::vector<Vec> seen(p);
  std::vector<double> x(p), y(p);
  std::vector<Nearest> feet(p);
  for (std::size_t s = 0; s < count; ++s, nodes += 2 * stations.nodes()) {
    for (std::size_t k = 0; k < stations.intervals; ++k) {
      const double* window = nodes + 2 * k;
      const auto see = [&](Vec at) {
        return Vec{cos * at.x + sin * at.y - support.offset.x,
                   cos * at.y - sin * at.x - support.offset.y};
      };
      const auto measure = [&](std::size_t i, const Nearest& foot) {
        gap[i] = foot.gap;
        normal[2 * i] = cos * foot.normal.x - sin * foot.normal.y;
        normal[2 * i + 1] = sin * foot.normal.x + cos * foot.normal.y;
        curvature[i] = foot.curvature / (1.0 + foot.curvature * foot.gap);
      };
      feet[0] = support.outline.nearest(see(station_of(stations, p / 2, window)));
      if (feet[0].gap < support.far ||
          std::any_of(touching, touching + p, [](bool on) { return on; })) {
        stations_of(stations, window, x.data(), y.data());
        for (std::size_t i = 0; i < p; ++i) seen[i] = see({x[i], y[i]});
        support.outline.nearest(seen.data(), p, feet.data());
      } else {
        std::fill(feet.begin() + 1, feet.end(), feet[0]);
      }
      for (std::size_t i = 0; i < p; ++i) measure(i, feet[i]);
      gap += p;
      normal += 2 * p;
      curvature += p;
      touching += p;
    }
  }
}

SWGJOINT_WIDE void bore_forces(const Stations& stations, const double* spring,
                               const double* gap, const double* normal,
                               const double* curvature, const std::int64_t* into,
                               const double* sign, std::size_t count, std::size_t n,
                               double* gradient, double* tangent) {
  const std::size_t p = stations.p, width = stations.width, q = stations.count();
  const std::size_t size = 2 * stations.nodes();
  std::vector<double> force(size), matrix(size * size), along(width), across(width);
  std::vector<double> signs(size, 1.0);
  for (std::size_t s = 0; s < count; ++s) {
    if (std::any_of(spring, spring + q, [](double k) { return k != 0.0; })) {
      std::fill(force.begin(), force.end(), 0.0);
      std::fill(matrix.begin(), matrix.end(), 0.0);
      for (std::size_t i = 0; i < q; ++i) {
        if (spring[i] == 0.0) continue;
        const double *x = stations.weights + 2 * width * (i % p), *y = x + width;
        const Vec to{normal[2 * i], normal[2 * i + 1]};
        // sliding over a curved outline turns the contact force
        const double push = spring[i] * gap[i];
        const double bend = curvature ? push * curvature[i] : 0.0;
        for (std::size_t j = 0; j < width; ++j) {
          along[j] = to.x * x[j] + to.y * y[j];
          across[j] = to.x * y[j] - to.y * x[j];
        }
        const std::size_t first = 2 * (i / p);
        for (std::size_t j = 0; j < width; ++j) {
          force[first + j] += push * along[j];
          if (!tangent) continue;
          const double a = spring[i] * along[j], b = bend * across[j];
          double* __restrict row = matrix.data() + (first + j) * size + first;
          const double *one = along.data(), *other = across.data();
          for (std::size_t l = 0; l < width; ++l) row[l] += a * one[l] + b * other[l];
        }
      }
      for (std::size_t i = 0; sign && i < size; ++i) signs[i] = sign[into[i]];
      for (std::size_t i = 0; i < size; ++i) {
        const auto row = static_cast<std::size_t>(into[i]);
        gradient[row] += signs[i] * force[i];
        for (std::size_t j = 0; tangent && j < size; ++j) {
          tangent[row * n + static_cast<std::size_t>(into[j])] +=
              signs[i] * signs[j] * matrix[i * size + j];
        }
      }
    }
    spring += q;
    gap += q;
    normal += 2 * q;
    if (curvature) curvature += q;
    if (sign) sign += n;
    gradient += n;
    if (tangent) tangent += n * n;
  }
}

void bore_gaps_after(const Stations& stations, const double* gap, const double* normal,
                     const std::int64_t* into, const double* increment,
                     std::size_t count, std::size_t n, double* result) {
  std::vector<double> moved(2 * stations.nodes()), x(stations.p), y(stations.p);
  for (std::size_t s = 0; s < count; ++s, increment += n) {
    for (std::size_t j = 0; j < moved.size(); ++j) moved[j] = increment[into[j]];
    for (std::size_t k = 0; k < stations.intervals; ++k) {
      stations_of(stations, moved.data() + 2 * k, x.data(), y.data());
      for (std::size_t i = 0; i < stations.p; ++i, ++gap, normal += 2, ++result) {
        *result = *gap + x[i] * normal[0] + y[i] * normal[1];
      }
    }
  }
}

}  // namespace swgjoint
