// Vectors of four harmonics that undergo the same operations, and their cos and sin.
#ifndef SWGJOINT_PLUGIN_LANES_H_
#define SWGJOINT_PLUGIN_LANES_H_

#include <cstring>

// A function marked with SWGJOINT_CLONES is compiled twice, with and without AVX2; the
// processor determines which version runs. The result is bit for bit the same.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && \
    defined(__GLIBC__)
#define SWGJOINT_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define SWGJOINT_CLONES
#endif

namespace swgjoint {

constexpr int kLanes = 4;

#if defined(__GNUC__)
typedef double Lanes __attribute__((vector_size(8 * kLanes)));
#define SWGJOINT_INLINE inline __attribute__((always_inline))
#else
struct Lanes {
  double v[kLanes];
  double operator[](int i) const { return v[i]; }
  Lanes& operator+=(const Lanes& o) { return *this = *this + o; }
  template <class F>
  static Lanes Each(F f) { return {{f(0), f(1), f(2), f(3)}}; }
  friend Lanes operator+(const Lanes& a, const Lanes& b) {
    return Each([&](int i) { return a[i] + b[i]; });
  }
  friend Lanes operator-(const Lanes& a, const Lanes& b) {
    return Each([&](int i) { return a[i] - b[i]; });
  }
  friend Lanes operator*(const Lanes& a, const Lanes& b) {
    return Each([&](int i) { return a[i] * b[i]; });
  }
  friend Lanes operator+(const Lanes& a, double b) {
    return Each([&](int i) { return a[i] + b; });
  }
  friend Lanes operator-(const Lanes& a, double b) { return a + -b; }
  friend Lanes operator*(const Lanes& a, double b) {
    return Each([&](int i) { return a[i] * b; });
  }
  friend Lanes operator+(double a, const Lanes& b) { return b + a; }
  friend Lanes operator-(double a, const Lanes& b) { return b * -1 + a; }
};
#define SWGJOINT_INLINE inline
#endif

SWGJOINT_INLINE void Load(const double* from, Lanes* x) {
  std::memcpy(x, from, sizeof(Lanes));
}
SWGJOINT_INLINE void Store(double* to, const Lanes& x) {
  std::memcpy(to, &x, sizeof(Lanes));
}

// Sum of the lanes of each of the four vectors.
SWGJOINT_INLINE void Sums(const Lanes& a, const Lanes& b, const Lanes& c,
                          const Lanes& d, double out[4]) {
#if defined(__GNUC__) && !defined(__clang__)
  typedef long long Index __attribute__((vector_size(sizeof(Lanes))));
  const Lanes ab = __builtin_shuffle(a, b, Index{0, 4, 2, 6}) +
                   __builtin_shuffle(a, b, Index{1, 5, 3, 7});
  const Lanes cd = __builtin_shuffle(c, d, Index{0, 4, 2, 6}) +
                   __builtin_shuffle(c, d, Index{1, 5, 3, 7});
  Store(out, __builtin_shuffle(ab, cd, Index{0, 1, 4, 5}) +
                 __builtin_shuffle(ab, cd, Index{2, 3, 6, 7}));
#else
  const Lanes* all[4] = {&a, &b, &c, &d};
  for (int k = 0; k < 4; ++k) {
    const Lanes& x = *all[k];
    out[k] = (x[0] + x[1]) + (x[2] + x[3]);
  }
#endif
}

// Computes sin(x)/x and cos(x) for |x| <= 2^(kHalvings - 2).
template <int kHalvings>
SWGJOINT_INLINE void SincCos(const Lanes& x, Lanes* sinc, Lanes* cos) {
  // Series with a truncation error below 2^-53 for |y| <= 1/4. They are summed in pairs
  // of terms, because one term after the other would take twice as long.
  Lanes y = x * (1.0 / (1 << kHalvings));
  const Lanes z = y * y, z2 = z * z, z4 = z2 * z2;
  *sinc = ((1 + z * (-1. / 6)) + z2 * (1. / 120 + z * (-1. / 5040))) +
          z4 * (1. / 362880 + z * (-1. / 39916800));
  *cos = ((1 + z * (-1. / 2)) + z2 * (1. / 24 + z * (-1. / 720))) +
         z4 * ((1. / 40320 + z * (-1. / 3628800)) + z2 * (1. / 479001600));
  // sin(2y) = 2 sin(y) cos(y), cos(2y) = 1 - 2 sin(y)^2
  for (int k = 0; k < kHalvings; ++k) {
    const Lanes sin = y * *sinc;
    *sinc = *sinc * *cos;
    *cos = 1 - sin * sin * 2;
    y = y * 2;
  }
}

// Computes cos and sin of any phase.
SWGJOINT_INLINE void CosSin(const Lanes& phase, Lanes* cos, Lanes* sin) {
  // Adding and subtracting kRound rounds to an integer. 2 pi is the sum of three
  // numbers; products of the first two (26 bits each) with up to 2^27 turns are exact.
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52
  constexpr double kTurn[3] = {0x1.921fb5p+2, 0x1.110b46p-24, 0x1.1a62633145c07p-52};
  const Lanes turns = (phase * 0.15915494309189535 + kRound) - kRound;
  const Lanes rest =
      ((phase - turns * kTurn[0]) - turns * kTurn[1]) - turns * kTurn[2];
  Lanes sinc;
  SincCos<4>(rest, &sinc, cos);
  *sin = rest * sinc;
}

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_LANES_H_
