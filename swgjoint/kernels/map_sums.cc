#include "map_sums.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace swgjoint {

namespace {

// Sum in the order of numpy: eight interleaved sums in blocks of up to 128 values.
double add(const double* v, std::size_t n) {
  if (n < 8) {
    double sum = 0.0;
    for (std::size_t k = 0; k < n; ++k) sum += v[k];
    return sum;
  }
  if (n > 128) {
    std::size_t half = n / 2;
    half -= half % 8;
    return add(v, half) + add(v + half, n - half);
  }
  double r[8];
  std::copy(v, v + 8, r);
  std::size_t k = 8;
  for (; k + 8 <= n; k += 8)
    for (std::size_t i = 0; i < 8; ++i) r[i] += v[k + i];
  double sum = ((r[0] + r[1]) + (r[2] + r[3])) + ((r[4] + r[5]) + (r[6] + r[7]));
  for (; k < n; ++k) sum += v[k];
  return sum;
}

// Kinematic error and its derivatives from cosines and sines, n doubles apart.
void add_errors(const double* cos, const double* sin, std::size_t h,
                const double* amplitudes, const std::int64_t* orders, double* terms,
                double* result, std::size_t n) {
  double *error = terms, *theta = error + h, *psi = theta + h;
  for (std::size_t k = 0; k < h; ++k) {
    const double a = amplitudes[2 * k], b = amplitudes[2 * k + 1];
    const double slope = b * cos[k] - a * sin[k];
    error[k] = a * cos[k] + b * sin[k];
    theta[k] = slope * static_cast<double>(orders[2 * k]);
    psi[k] = slope * static_cast<double>(orders[2 * k + 1]);
  }
  result[0] = add(error, h);
  result[n] = add(theta, h);
  result[2 * n] = add(psi, h);
}

}  // namespace

void error_sums(const double* phases, std::size_t n, std::size_t h,
                const double* amplitudes, const std::int64_t* orders, double* cos,
                double* sin, double* result) {
  std::vector<double> terms(3 * h);
  for (std::size_t p = 0; p < n; ++p) {
    const double* phase = phases + p * h;
    double *c = cos + p * h, *s = sin + p * h;
    for (std::size_t k = 0; k < h; ++k) {
      c[k] = std::cos(phase[k]);
      s[k] = std::sin(phase[k]);
    }
    add_errors(c, s, h, amplitudes, orders, terms.data(), result + p, n);
  }
}

void potential_sums(const Pieces& map, const double* torsion, std::size_t n,
                    const double* cos, const double* sin, const std::int64_t* orders,
                    Rows rows, double* result) {
  const std::size_t h = map.harmonics, m = map.intervals;
  std::vector<double> terms(4 * h);
  double *first = terms.data(), *second = first + h, *theta = second + h;
  double* psi = theta + h;
  const double low = map.knots[0], high = map.knots[m];
  for (std::size_t p = 0; p < n; ++p) {
    const double x = torsion[p], inside = x < low ? low : x > high ? high : x;
    const auto after = std::upper_bound(map.knots, map.knots + m + 1, inside);
    const auto above = static_cast<std::size_t>(after - map.knots);
    const std::size_t j = std::min(above > 0 ? above - 1 : 0, m - 1);
    const double d = inside - map.knots[j], out = x - inside;
    const double *c = cos + p * h, *s = sin + p * h;
    for (std::size_t k = 0; k < h; ++k) {
      double v0[2], v1[2], v2[2];
      for (std::size_t i = 0; i < 2; ++i) {
        const double* f = map.powers + ((2 * k + i) * m + j) * 5;
        const double end = map.ends[2 * (2 * k + i) + (out < 0.0 ? 0 : 1)];
        v2[i] = 2 * f[2] + d * (6 * f[3] + d * 12 * f[4]);
        v1[i] = f[1] + d * (2 * f[2] + d * (3 * f[3] + d * 4 * f[4]));
        v0[i] = f[0] + d * (f[1] + d * (f[2] + d * (f[3] + d * f[4])));
        if (out != 0.0) {
          v0[i] = v0[i] + out * (v1[i] + 0.5 * out * end);
          v1[i] = v1[i] + out * end;
          v2[i] = end;
        }
      }
      first[k] = v1[0] * c[k] + v1[1] * s[k];
      second[k] = v2[0] * c[k] + v2[1] * s[k];
      const double by_phase = v0[1] * c[k] - v0[0] * s[k];
      theta[k] = by_phase * static_cast<double>(orders[2 * k]);
      psi[k] = by_phase * static_cast<double>(orders[2 * k + 1]);
    }
    if (rows.torque) result[p] = add(first, h);
    if (rows.stiffness) result[n + p] = add(second, h);
    if (rows.by_phase) {
      result[2 * n + p] = add(theta, h);
      result[3 * n + p] = add(psi, h);
    }
  }
}

void stretches(const double* torsion, const double* reach, std::size_t n,
               double* result) {
  double rest = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const double x = torsion[k];
    rest = std::min(std::max(rest, x - reach[k]), x + reach[k]);
    result[k] = x - rest;
  }
}

void yield_torsions(const Yields& elements, const double* elastic, std::size_t n,
                    double* reach, double* slope) {
  const std::size_t count = elements.count;
  for (std::size_t p = 0; p < n; ++p) {
    const double x = std::abs(elastic[p]);
    for (std::size_t e = 0; e < count; ++e) {
      const auto begin = static_cast<std::size_t>(elements.first[e]);
      const auto end = static_cast<std::size_t>(elements.first[e + 1]);
      const double *at = elements.at, *f = elements.yields;
      std::size_t j = begin;  // last point that is not above the torque
      while (j + 1 < end && at[j + 1] <= x) ++j;
      double yield = f[j], rate = 0.0;
      if (j + 1 < end) {
        rate = (f[j + 1] - f[j]) / (at[j + 1] - at[j]);
        yield = rate * (x - at[j]) + f[j];
      }
      reach[p * count + e] = yield / elements.stiffness[e];
      slope[p * count + e] = rate;
    }
  }
}

}  // namespace swgjoint
