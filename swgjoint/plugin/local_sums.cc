#include "local_sums.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "lanes.h"

namespace swgjoint {
namespace {

// Multiplies sums of (A - i B) exp(i m c) m^d/d! by i^d.
template <class V>
SWGJOINT_INLINE void TurnBy(int d, const V& x, const V& y, V* re, V* im) {
  const V real = d % 2 ? y * -1 : x, imaginary = d % 2 ? x : y;
  const double sign = d % 4 < 2 ? 1 : -1;
  *re = real * sign;
  *im = imaginary * sign;
}

// Rounds up to whole blocks of numbers.
size_t Padded(size_t count) {
  return (count + kWideLanes - 1) / kWideLanes * kWideLanes;
}

}  // namespace

void LocalSums::Set(const double* orders, const double* errors, int count,
                    int segments) {
  std::vector<double> n(count), m(count);
  for (int k = 0; k < count; ++k) {
    n[k] = orders[2 * k];
    m[k] = orders[2 * k + 1];
  }
  const auto different = [](std::vector<double> all) {
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return all;
  };
  const std::vector<double> of_theta = different(n), of_psi = different(m);
  waves_ = 0;
  for (const double x : of_theta) top_theta_ = std::max(top_theta_, std::fabs(x));
  for (const double x : of_psi) top_psi_ = std::max(top_psi_, std::fabs(x));
  if (top_psi_ == 0 || static_cast<int>(of_theta.size()) * kPerWave > count) return;
  waves_ = static_cast<int>(of_theta.size());
  width_ = 2 * kReach / top_psi_;
  const size_t padded = Padded(of_theta.size());
  place_.resize(count);
  std::iota(place_.begin(), place_.end(), 0);
  std::stable_sort(place_.begin(), place_.end(),
                   [&](int a, int b) { return n[a] < n[b]; });
  first_.assign(1, 0);
  psi_.resize(count);
  errors_.resize(2 * static_cast<size_t>(count));
  for (int k = 0; k < count; ++k) {
    const int own = place_[k];
    if (k > 0 && n[own] != n[place_[k - 1]]) first_.push_back(k);
    psi_[k] = static_cast<int>(
        std::lower_bound(of_psi.begin(), of_psi.end(), m[own]) - of_psi.begin());
    std::copy_n(errors + 2 * own, 2, &errors_[2 * k]);
  }
  first_.push_back(count);
  n_.assign(padded, 0.0);
  std::copy(of_theta.begin(), of_theta.end(), n_.begin());
  m_.assign(Padded(of_psi.size()), 0.0);
  std::copy(of_psi.begin(), of_psi.end(), m_.begin());
  powers_.assign(of_psi.size() * kPowers, 0.0);
  for (size_t k = 0; k < of_psi.size(); ++k) {
    double power = 1;
    for (int d = 0; d < kTerms; ++d) {
      powers_[k * kPowers + d] = power;
      power *= m_[k] / (d + 1);
    }
  }
  turned_.assign(2 * m_.size(), 0.0);
  error_z_.assign(2 * kTerms * padded, 0.0);
  base_.assign(2 * padded, 0.0);
  windows_.assign(segments, Window());
  known_ = false;
}

double LocalSums::Begin(double theta, double psi) {
  const double center = Center(psi);
  if (!known_ || center != center_) {
    center_ = center;
    BuildErrorsAll();
    known_ = true;
  }
  s_ = psi - center;
  return BeginAll(theta);
}

template <class V>
SWGJOINT_INLINE double LocalSums::BeginWaves(double theta) {
  constexpr int width = sizeof(V) / sizeof(double);
  const size_t padded = n_.size();
  V sums[kWideLanes / width] = {};
  for (size_t k = 0; k < padded; k += width) {
    V n, c, s, re, im, z;
    Load(&n_[k], &n);
    CosSin(n * theta, &c, &s);
    Store(&base_[k], c);
    Store(&base_[padded + k], s);
    const double* at = &error_z_[2 * kDegree * padded + k];
    Load(at, &re);
    Load(at + padded, &im);
    for (int d = kDegree - 1; d >= 0; --d) {
      at -= 2 * padded;
      Load(at, &z);
      re = re * s_ + z;
      Load(at + padded, &z);
      im = im * s_ + z;
    }
    sums[k % kWideLanes / width] += re * c - im * s;
  }
  V sum = sums[0];
  for (int part = 1; part < kWideLanes / width; ++part) sum += sums[part];
  double error[4];
  Sums(sum, sum, sum, sum, error);
  return error[0];
}

SWGJOINT_CLONES double LocalSums::BeginAll(double theta) {
  return kHasWide ? BeginWaves<Wide>(theta) : BeginWaves<Lanes>(theta);
}

// Computes exp(i m center) and the polynomials of the kinematic error.
template <class V>
SWGJOINT_INLINE void LocalSums::BuildErrors() {
  constexpr int width = sizeof(V) / sizeof(double), vectors = kPowers / width;
  const size_t padded = n_.size(), orders = m_.size();
  for (size_t k = 0; k < orders; k += width) {
    V m, c, s;
    Load(&m_[k], &m);
    CosSin(m * center_, &c, &s);
    Store(&turned_[k], c);
    Store(&turned_[orders + k], s);
  }
  for (int wave = 0; wave < waves_; ++wave) {
    V x[vectors] = {}, y[vectors] = {};
    for (int k = first_[wave]; k < first_[wave + 1]; ++k) {
      const double a = errors_[2 * k], b = errors_[2 * k + 1];
      const double c = turned_[psi_[k]], s = turned_[orders + psi_[k]];
      const double re = a * c + b * s, im = a * s - b * c;
      for (int v = 0; v < vectors; ++v) {
        V power;
        Load(&powers_[psi_[k] * kPowers + v * width], &power);
        x[v] += power * re;
        y[v] += power * im;
      }
    }
    double all_x[kPowers], all_y[kPowers];
    for (int v = 0; v < vectors; ++v) {
      Store(all_x + v * width, x[v]);
      Store(all_y + v * width, y[v]);
    }
    for (int d = 0; d < kTerms; ++d) {
      double* to = &error_z_[2 * d * padded + wave];
      TurnBy(d, all_x[d], all_y[d], to, to + padded);
    }
  }
}

SWGJOINT_CLONES void LocalSums::BuildErrorsAll() {
  if (kHasWide) {
    BuildErrors<Wide>();
  } else {
    BuildErrors<Lanes>();
  }
}

bool LocalSums::Step(double dtheta, double dpsi) {
  // written so that NaN is too large as well
  if (!(top_theta_ * std::fabs(dtheta) <= kTurn) ||
      !(top_psi_ * std::fabs(dpsi) <= kChange)) {
    return false;
  }
  dtheta_ = dtheta;
  dpsi_ = dpsi;
  return true;
}

LocalSums::Powers LocalSums::PowersOfStep() const {
  Powers of;
  of.begin[0] = of.end[0] = 0.5;
  for (int d = 1; d < kTerms; ++d) {
    of.by[d][0] = of.by[d - 1][0] * s_;
    for (int k = 1; k <= std::min(d, kWithin); ++k) {
      of.by[d][k] = of.by[d - 1][k] * s_ + of.by[d - 1][k - 1] * dpsi_;
    }
    of.begin[d] = of.begin[d - 1] * s_;
    of.end[d] = of.end[d - 1] * (s_ + dpsi_);
  }
  return of;
}

// Computes the weights of the waves from `first` on in the sums of a step from t = 0 to
// t = 1, as many as the vectors have lanes.
template <class V>
SWGJOINT_INLINE void LocalSums::Weigh(const Powers& of, size_t first, double* to) const {
  const size_t padded = n_.size();
  V n, c0, s0, c, s, sinc;
  Load(&n_[first], &n);
  Load(&base_[first], &c0);
  Load(&base_[padded + first], &s0);
  const V x = n * dtheta_, xx = x * x;
  SincCos<1>(x, &sinc, &c);
  s = x * sinc;
  // integrals of t^k exp(i x t): the last one is a series, the others follow by
  // integration by parts
  constexpr int kSeriesTerms = 18;
  V re[kWithin + 1], im[kWithin + 1];
  V even = {}, odd = {};
  double factor[kSeriesTerms] = {1};
  for (int j = 1; j < kSeriesTerms; ++j) factor[j] = factor[j - 1] / j;
  for (int j = kSeriesTerms - 2; j >= 0; j -= 2) {
    const double sign = j % 4 ? -1 : 1;
    even = even * xx + sign * factor[j] / (j + kWithin + 1);
    odd = odd * xx + sign * factor[j + 1] / (j + kWithin + 2);
  }
  re[kWithin] = even;
  im[kWithin] = odd * x;
  for (int k = kWithin; k > 0; --k) {
    re[k - 1] = (c + x * im[k]) * (1.0 / k);
    im[k - 1] = (s - x * re[k]) * (1.0 / k);
  }
  // turned by the phases at the start
  const V c1 = c0 * c - s0 * s, s1 = s0 * c + c0 * s;
  for (int k = 0; k <= kWithin; ++k) {
    const V before = re[k];
    re[k] = before * c0 - im[k] * s0;
    im[k] = before * s0 + im[k] * c0;
  }
  V last_re = {}, last_im = {};
  for (int d = 0; d < kTerms; ++d, to += kWeights * kWideLanes) {
    V mean_re = {}, mean_im = {};
    for (int k = 0; k <= std::min(d, kWithin); ++k) {
      mean_re += re[k] * of.by[d][k];
      mean_im += im[k] * of.by[d][k];
    }
    Store(to, c0 * of.begin[d] + c1 * of.end[d]);
    Store(to + kWideLanes, s0 * of.begin[d] + s1 * of.end[d]);
    // derivative by theta, i n
    Store(to + 2 * kWideLanes, mean_im * n * -1);
    Store(to + 3 * kWideLanes, mean_re * n);
    Store(to + 4 * kWideLanes, last_re * d);
    Store(to + 5 * kWideLanes, last_im * d);
    last_re = mean_re;
    last_im = mean_im;
  }
}

// Copies the amplitudes of one segment in the order of the waves.
void LocalSums::Fill(const double* table, LaneVector* out) const {
  out->assign(place_.size() * 2 * kColumns, 0.0);
  for (size_t k = 0; k < place_.size(); ++k) {
    const int own = place_[k];
    const double* from =
        table + own / kWideLanes * 10 * kWideLanes + own % kWideLanes;
    double* to = &(*out)[k * 2 * kColumns];
    for (int p = 0; p < kError; ++p) {
      to[p] = from[2 * p * kWideLanes];
      to[kColumns + p] = from[(2 * p + 1) * kWideLanes];
    }
    to[kError] = errors_[2 * k];
    to[kColumns + kError] = errors_[2 * k + 1];
  }
}

template <class V>
SWGJOINT_INLINE void LocalSums::Build(Window* window) const {
  constexpr int width = sizeof(V) / sizeof(double);
  const size_t orders = m_.size();
  for (int part = 0; part < kColumns; part += width) {
    for (int wave = 0; wave < waves_; ++wave) {
      V x[kTerms] = {}, y[kTerms] = {};
      for (int k = first_[wave]; k < first_[wave + 1]; ++k) {
        const double* from = &window->harmonics[k * 2 * kColumns + part];
        const double* power = &powers_[psi_[k] * kPowers];
        const double c = turned_[psi_[k]], s = turned_[orders + psi_[k]];
        V a, b;
        Load(from, &a);
        Load(from + kColumns, &b);
        const V re = a * c + b * s, im = a * s - b * c;
        for (int d = 0; d < kTerms; ++d) {
          x[d] += re * power[d];
          y[d] += im * power[d];
        }
      }
      double* to = &window->z[wave * kTerms * 2 * kColumns + part];
      for (int d = 0; d < kTerms; ++d, to += 2 * kColumns) {
        V re, im;
        TurnBy(d, x[d], y[d], &re, &im);
        Store(to, re);
        Store(to + kColumns, im);
      }
    }
  }
}

SWGJOINT_CLONES void LocalSums::BuildAll(Window* window) const {
  if (kHasWide) {
    Build<Wide>(window);
  } else {
    Build<Lanes>(window);
  }
}

// The weights of a block of waves are used while they are in the fastest cache, because
// reading the polynomials of all waves already takes as long as the arithmetic.
template <class V>
SWGJOINT_INLINE void LocalSums::SumWaves(const Window& window, Totals* out) const {
  constexpr int width = sizeof(V) / sizeof(double), parts = kColumns / width;
  const Powers of = PowersOfStep();
  alignas(64) double weights[kTerms * kWeights * kWideLanes];
  // real and imaginary parts in sums that do not wait for each other
  V sum[parts][kWeights];
  for (int part = 0; part < parts; ++part) Clear(sum[part]);
  const double* block = window.z.data();
  for (int first = 0; first < waves_; first += kWideLanes) {
    const int count = std::min(kWideLanes, waves_ - first);
    for (int lane = 0; lane < kWideLanes; lane += width) {
      Weigh<V>(of, first + lane, weights + lane);
    }
    for (int part = 0; part < parts; ++part) {
      const double* z = block + part * width;
      V own[kWeights];
      std::copy_n(sum[part], kWeights, own);
      for (int wave = 0; wave < count; ++wave) {
        const double* by = weights + wave;
        SWGJOINT_ROLLED
        for (int d = 0; d < kTerms; ++d) {
          V re, im;
          Load(z, &re);
          Load(z + kColumns, &im);
          z += 2 * kColumns;
          Hide(&z);
          for (int q = 0; q < kWeights; q += 2, by += 2 * kWideLanes) {
            own[q] += re * by[0];
            own[q + 1] += im * by[kWideLanes];
          }
        }
      }
      std::copy_n(own, kWeights, sum[part]);
    }
    block += count * kTerms * 2 * kColumns;
  }
  for (int part = 0; part < parts; ++part) {
    const V* own = sum[part];
    Store(out->mean + part * width, own[0] - own[1]);
    Store(out->theta + part * width, own[2] - own[3]);
    Store(out->psi + part * width, own[4] - own[5]);
  }
}

SWGJOINT_CLONES void LocalSums::SumAll(const Window& window, Totals* out) const {
  if (kHasWide) {
    SumWaves<Wide>(window, out);
  } else {
    SumWaves<Lanes>(window, out);
  }
}

template <class V>
SWGJOINT_INLINE void LocalSums::ValueWaves(const Window& window, Totals* out) const {
  constexpr int width = sizeof(V) / sizeof(double);
  const size_t padded = n_.size();
  double power[kTerms], slope[kTerms];  // of s^d and its derivative
  power[0] = 1;
  slope[0] = 0;
  for (int d = 1; d < kTerms; ++d) {
    power[d] = power[d - 1] * s_;
    slope[d] = d * power[d - 1];
  }
  for (int part = 0; part < kColumns; part += width) {
    V mean = {}, theta = {}, psi = {};
    const double* z = window.z.data() + part;
    for (int wave = 0; wave < waves_; ++wave) {
      // even and odd powers in sums that do not wait for each other
      V re[2] = {}, im[2] = {}, by_re[2] = {}, by_im[2] = {};
      for (int d = 0; d < kTerms; ++d, z += 2 * kColumns) {
        V x, y;
        Load(z, &x);
        Load(z + kColumns, &y);
        re[d % 2] += x * power[d];
        im[d % 2] += y * power[d];
        by_re[d % 2] += x * slope[d];
        by_im[d % 2] += y * slope[d];
      }
      const double c = base_[wave], s = base_[padded + wave], n = n_[wave];
      const V x = re[0] + re[1], y = im[0] + im[1];
      mean += x * c - y * s;
      theta -= (x * s + y * c) * n;
      psi += (by_re[0] + by_re[1]) * c - (by_im[0] + by_im[1]) * s;
    }
    Store(out->mean + part, mean);
    Store(out->theta + part, theta);
    Store(out->psi + part, psi);
  }
}

SWGJOINT_CLONES void LocalSums::ValueAll(const Window& window, Totals* out) const {
  if (kHasWide) {
    ValueWaves<Wide>(window, out);
  } else {
    ValueWaves<Lanes>(window, out);
  }
}

// The polynomials of a segment near the position of the start.
LocalSums::Window& LocalSums::Near(int segment, const double* table) {
  Window& window = windows_[segment];
  if (window.known && window.center == center_) return window;
  if (!window.known) {
    Fill(table, &window.harmonics);
    window.z.assign(static_cast<size_t>(waves_) * kTerms * 2 * kColumns, 0.0);
  }
  window.center = center_;
  window.known = true;
  BuildAll(&window);
  return window;
}

void LocalSums::Sum(int segment, const double* table, Totals* out) {
  SumAll(Near(segment, table), out);
}

void LocalSums::Value(int segment, const double* table, Totals* out) {
  ValueAll(Near(segment, table), out);
}

}  // namespace swgjoint
