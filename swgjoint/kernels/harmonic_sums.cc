#include "harmonic_sums.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "wide.h"

namespace swgjoint {

namespace {

constexpr std::size_t kEight = 8;

#if defined(__GNUC__)
// eight harmonics; processors without such vectors process them in parts
typedef double Eight __attribute__((vector_size(64), aligned(8), may_alias));
SWGJOINT_INLINE void load(const double* from, Eight* x) {
  *x = *reinterpret_cast<const Eight*>(from);
}
#else
struct Eight {
  double v[kEight];
  double operator[](std::size_t k) const { return v[k]; }
};
template <class F>
SWGJOINT_INLINE Eight each(F f) {
  Eight x;
  for (std::size_t k = 0; k < kEight; ++k) x.v[k] = f(k);
  return x;
}
SWGJOINT_INLINE Eight operator+(const Eight& a, const Eight& b) {
  return each([&](std::size_t k) { return a.v[k] + b.v[k]; });
}
SWGJOINT_INLINE Eight operator-(const Eight& a, const Eight& b) {
  return each([&](std::size_t k) { return a.v[k] - b.v[k]; });
}
SWGJOINT_INLINE Eight operator*(const Eight& a, const Eight& b) {
  return each([&](std::size_t k) { return a.v[k] * b.v[k]; });
}
SWGJOINT_INLINE Eight operator*(double a, const Eight& b) {
  return each([&](std::size_t k) { return a * b.v[k]; });
}
SWGJOINT_INLINE Eight& operator+=(Eight& a, const Eight& b) { return a = a + b; }
SWGJOINT_INLINE void load(const double* from, Eight* x) {
  std::copy(from, from + kEight, x->v);
}
#endif

SWGJOINT_INLINE double sum(const Eight& x) {
  return ((x[0] + x[4]) + (x[1] + x[5])) + ((x[2] + x[6]) + (x[3] + x[7]));
}

// Powers exp(i n angle) for integers n, whose real and imaginary parts are interleaved.
// Repeated squares lose about n units of round-off, like the product of n and the angle.
void powers(double angle, const std::vector<double>& numbers, double* out) {
  double squares[64][2];
  squares[0][0] = std::cos(angle);
  squares[0][1] = std::sin(angle);
  int known = 1;
  for (const double number : numbers) {
    double c = 1.0, s = 0.0;
    auto rest = static_cast<std::uint64_t>(std::abs(number));
    for (int bit = 0; rest; ++bit, rest >>= 1) {
      if (bit == known) {
        const double *last = squares[known - 1];
        squares[known][0] = last[0] * last[0] - last[1] * last[1];
        squares[known][1] = 2.0 * last[0] * last[1];
        ++known;
      }
      if (!(rest & 1)) continue;
      const double *by = squares[bit], before = c;
      c = before * by[0] - s * by[1];
      s = before * by[1] + s * by[0];
    }
    *out++ = c;
    *out++ = number < 0.0 ? -s : s;
  }
}

// Cosines and sines of the phases of harmonics that share one power of exp(i theta).
SWGJOINT_WIDE void multiply(const double* row, const double* powers,
                            const std::uint32_t* place, std::size_t count, double* cos,
                            double* sin) {
  const double c = row[0], s = row[1];
  for (std::size_t k = 0; k < count; ++k) {
    const double* by = powers + place[k];
    const double by_c = by[0], by_s = by[1];
    cos[k] = c * by_c - s * by_s;
    sin[k] = s * by_c + c * by_s;
  }
}

// Kinematic error and its derivatives from cosines and sines of the phases.
SWGJOINT_WIDE void add_errors(const double* cos, const double* sin,
                              const double* shared, std::size_t groups, double* out) {
  Eight error = {}, theta = {}, psi = {};
  for (std::size_t g = 0; g < groups; ++g, cos += kEight, sin += kEight) {
    Eight c, s, a, b, p, q;
    load(cos, &c);
    load(sin, &s);
    load(shared, &a);
    load(shared + kEight, &b);
    load(shared + 2 * kEight, &p);
    load(shared + 3 * kEight, &q);
    shared += 4 * kEight;
    error += a * c + b * s;
    const Eight slope = b * c - a * s;
    theta += slope * p;
    psi += slope * q;
  }
  out[0] = sum(error);
  out[1] = sum(theta);
  out[2] = sum(psi);
}

// Derivatives of the potential at the distance d from the origin of its polynomials.
SWGJOINT_WIDE void add_powers(const double* cos, const double* sin,
                              const double* shared, const double* table, double d,
                              std::size_t groups, double* out) {
  Eight w1 = {}, w2 = {}, w3 = {}, w4 = {}, theta = {}, psi = {};
  for (std::size_t g = 0; g < groups; ++g, cos += kEight, sin += kEight) {
    Eight c, s, a[5], b[5], p, q;
    load(cos, &c);
    load(sin, &s);
    for (std::size_t k = 0; k < 5; ++k) {
      load(table + 2 * k * kEight, &a[k]);
      load(table + (2 * k + 1) * kEight, &b[k]);
    }
    load(shared + 2 * kEight, &p);
    load(shared + 3 * kEight, &q);
    table += 10 * kEight;
    shared += 4 * kEight;
    w1 += a[1] * c + b[1] * s;
    w2 += a[2] * c + b[2] * s;
    w3 += a[3] * c + b[3] * s;
    w4 += a[4] * c + b[4] * s;
    const Eight va = a[0] + d * (a[1] + d * (a[2] + d * (a[3] + d * a[4])));
    const Eight vb = b[0] + d * (b[1] + d * (b[2] + d * (b[3] + d * b[4])));
    const Eight by_phase = vb * c - va * s;
    theta += by_phase * p;
    psi += by_phase * q;
  }
  const double c1 = sum(w1), c2 = sum(w2), c3 = sum(w3), c4 = sum(w4);
  out[0] = c1 + d * (2 * c2 + d * (3 * c3 + d * 4 * c4));
  out[1] = 2 * c2 + d * (6 * c3 + d * 12 * c4);
  out[2] = sum(theta);
  out[3] = sum(psi);
}

}  // namespace

HarmonicSums::HarmonicSums(const Pieces& map, const WaveNumbers& waves,
                           const double* amplitudes, const std::int64_t* orders,
                           double ratio)
    : map_(map),
      ratio_(ratio),
      groups_((map.harmonics + kGroup - 1) / kGroup),
      theta_(waves.theta, waves.theta + waves.count_theta),
      psi_(waves.psi, waves.psi + waves.count_psi),
      order_(map.harmonics),
      first_(waves.count_theta + 1, map.harmonics),
      place_(map.harmonics),
      shared_(groups_ * kShared, 0.0),
      tables_(map.intervals + 2),
      made_(new std::once_flag[map.intervals + 2]) {
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  const auto row = [&](std::size_t k) { return waves.which[2 * k]; };
  std::stable_sort(order_.begin(), order_.end(),
                   [&](std::size_t a, std::size_t b) { return row(a) < row(b); });
  for (std::size_t k = map.harmonics; k-- > 0;) {
    const std::size_t own = order_[k];
    first_[static_cast<std::size_t>(row(own))] = k;
    place_[k] = static_cast<std::uint32_t>(2 * waves.which[2 * own + 1]);
    double* to = &shared_[k / kGroup * kShared + k % kGroup];
    to[0] = amplitudes[2 * own];
    to[kGroup] = amplitudes[2 * own + 1];
    to[2 * kGroup] = static_cast<double>(orders[2 * own]);
    to[3 * kGroup] = static_cast<double>(orders[2 * own + 1]);
  }
  // a number of waves that no harmonic has begins where the next one does
  for (std::size_t r = waves.count_theta; r-- > 0;) {
    first_[r] = std::min(first_[r], first_[r + 1]);
  }
  std::vector<double> sorted, errors;
  for (const std::size_t own : order_) {
    for (std::size_t i = 0; i < 2; ++i) {
      sorted.push_back(static_cast<double>(orders[2 * own + i]));
      errors.push_back(amplitudes[2 * own + i]);
    }
  }
  waves_.Set(sorted.data(), errors.data(), static_cast<int>(map.harmonics),
             static_cast<int>(map.intervals) + 2);
}

const double* HarmonicSums::table(std::size_t segment) const {
  std::call_once(made_[segment], [&] { fill(segment); });
  return tables_[segment].data();
}

// Segment 0 is the parabola below the knots, the last one that above them.
void HarmonicSums::fill(std::size_t segment) const {
  const std::size_t m = map_.intervals;
  std::vector<double>& made = tables_[segment];
  made.assign(groups_ * kPowers, 0.0);
  const bool inside = segment >= 1 && segment <= m;
  const std::size_t j = inside ? segment - 1 : segment == 0 ? 0 : m - 1;
  const double d = segment == 0 ? 0.0 : map_.knots[m] - map_.knots[m - 1];
  for (std::size_t k = 0; k < map_.harmonics; ++k) {
    double* to = &made[k / kGroup * kPowers + k % kGroup];
    for (std::size_t i = 0; i < 2; ++i) {
      const std::size_t own = 2 * order_[k] + i;
      const double* f = map_.powers + (own * m + j) * 5;
      double power[5] = {f[0], f[1], f[2], f[3], f[4]};
      if (!inside) {
        power[0] = f[0] + d * (f[1] + d * (f[2] + d * (f[3] + d * f[4])));
        power[1] = f[1] + d * (2 * f[2] + d * (3 * f[3] + d * 4 * f[4]));
        power[2] = 0.5 * map_.ends[2 * own + (segment == 0 ? 0 : 1)];
        power[3] = power[4] = 0.0;
      }
      for (std::size_t p = 0; p < 5; ++p) to[(2 * p + i) * kGroup] = power[p];
    }
  }
}

// Whether enough states in sequence are near each of the positions.
bool HarmonicSums::slow(const double* psi, std::size_t n) const {
  if (!waves_.used()) return false;
  std::size_t places = 1;
  for (std::size_t k = 1; k < n; ++k) {
    places += waves_.Center(psi[k]) != waves_.Center(psi[k - 1]);
  }
  return n >= kFew * places;
}

void HarmonicSums::find_segment(double torsion, std::size_t* segment,
                                double* origin) const {
  const std::size_t m = map_.intervals;
  const double x = torsion, low = map_.knots[0], high = map_.knots[m];
  const double inside = x < low ? low : x > high ? high : x;
  const double* above = std::upper_bound(map_.knots, map_.knots + m + 1, inside);
  *segment = std::min(static_cast<std::size_t>(above - map_.knots), m);
  *origin = map_.knots[*segment > 0 ? *segment - 1 : 0];
  if (x < low) {
    *segment = 0;
    *origin = low;
  } else if (x > high) {
    *segment = m + 1;
    *origin = high;
  }
}

void HarmonicSums::evaluate_waves(const double* theta, const double* psi, std::size_t n,
                                  double* result) const {
  const std::lock_guard<std::mutex> alone(one_);
  constexpr int e = LocalSums::kError;
  for (std::size_t at = 0; at < n; ++at) {
    const double x = theta[at] / ratio_ + waves_.Begin(theta[at], psi[at]) - psi[at];
    std::size_t segment;
    double origin;
    find_segment(x, &segment, &origin);
    const double d = x - origin;
    LocalSums::Totals sums;
    waves_.Value(static_cast<int>(segment), table(segment), &sums);
    const double* w = sums.mean;
    const auto value = [d](const double* v) {
      return v[0] + d * (v[1] + d * (v[2] + d * (v[3] + d * v[4])));
    };
    result[at] = x;
    result[n + at] = sums.theta[e];
    result[2 * n + at] = sums.psi[e];
    result[3 * n + at] = w[1] + d * (2 * w[2] + d * (3 * w[3] + d * 4 * w[4]));
    result[4 * n + at] = 2 * w[2] + d * (6 * w[3] + d * 12 * w[4]);
    result[5 * n + at] = value(sums.theta);
    result[6 * n + at] = value(sums.psi);
  }
}

void HarmonicSums::evaluate(const double* theta, const double* psi, std::size_t n,
                            double* result) const {
  if (slow(psi, n)) return evaluate_waves(theta, psi, n, result);
  const std::size_t size = groups_ * kGroup;
  std::vector<double> phases(2 * size, 0.0), waves(2 * (theta_.size() + psi_.size()));
  double *cos = phases.data(), *sin = cos + size;
  double *about_theta = waves.data(), *about_psi = about_theta + 2 * theta_.size();
  for (std::size_t at = 0; at < n; ++at) {
    powers(theta[at], theta_, about_theta);
    powers(psi[at], psi_, about_psi);
    for (std::size_t r = 0; r < theta_.size(); ++r) {
      const std::size_t k = first_[r];
      multiply(about_theta + 2 * r, about_psi, place_.data() + k, first_[r + 1] - k, cos + k,
               sin + k);
    }
    double error[3], force[4];
    add_errors(cos, sin, shared_.data(), groups_, error);
    const double x = theta[at] / ratio_ + error[0] - psi[at];
    std::size_t segment;
    double origin;
    find_segment(x, &segment, &origin);
    add_powers(cos, sin, shared_.data(), table(segment), x - origin, groups_, force);
    result[at] = x;
    result[n + at] = error[1];
    result[2 * n + at] = error[2];
    for (std::size_t k = 0; k < 4; ++k) result[(3 + k) * n + at] = force[k];
  }
}

}  // namespace swgjoint
