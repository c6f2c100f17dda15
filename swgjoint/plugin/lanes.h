// Vectors of numbers that undergo the same operations: four harmonics with their cos
// and sin, eight of a map with many harmonics, or rotor and link.
#ifndef SWGJOINT_PLUGIN_LANES_H_
#define SWGJOINT_PLUGIN_LANES_H_

#include <cstddef>
#include <cstring>
#include <new>
#include <vector>

// A function marked with SWGJOINT_CLONES is compiled several times: for processors with
// AVX-512, which have more registers, with AVX2, and for all others. The processor
// determines which version runs. The result is bit for bit the same.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && \
    defined(__GLIBC__)
#if __GNUC__ >= 12
#define SWGJOINT_WIDE_CLONES
#define SWGJOINT_CLONES \
  __attribute__((target_clones("arch=x86-64-v4", "avx2", "default")))
#else
#define SWGJOINT_CLONES __attribute__((target_clones("avx2", "default")))
#endif
#else
#define SWGJOINT_CLONES
#endif

namespace swgjoint {

constexpr int kLanes = 4, kWideLanes = 8;

// Whether the processor has vectors for eight numbers. The others add the two halves of
// such vectors one after the other, with the same bits.
#if defined(SWGJOINT_WIDE_CLONES)
const bool kHasWide = __builtin_cpu_supports("x86-64-v4");
#else
constexpr bool kHasWide = false;
#endif

#if defined(__GNUC__)
typedef double Lanes __attribute__((vector_size(8 * kLanes)));
typedef double Wide __attribute__((vector_size(8 * kWideLanes)));
typedef double Pair __attribute__((vector_size(16)));
#define SWGJOINT_INLINE inline __attribute__((always_inline))
#else
template <int N>
struct Vector {
  double v[N];
  double operator[](int i) const { return v[i]; }
  Vector& operator+=(const Vector& o) { return *this = *this + o; }
  Vector& operator-=(const Vector& o) { return *this = *this - o; }
  template <class F>
  static Vector Each(F f) {
    Vector out;
    for (int i = 0; i < N; ++i) out.v[i] = f(i);
    return out;
  }
  friend Vector operator+(const Vector& a, const Vector& b) {
    return Each([&](int i) { return a[i] + b[i]; });
  }
  friend Vector operator-(const Vector& a, const Vector& b) {
    return Each([&](int i) { return a[i] - b[i]; });
  }
  friend Vector operator*(const Vector& a, const Vector& b) {
    return Each([&](int i) { return a[i] * b[i]; });
  }
  friend Vector operator+(const Vector& a, double b) {
    return Each([&](int i) { return a[i] + b; });
  }
  friend Vector operator-(const Vector& a, double b) { return a + -b; }
  friend Vector operator*(const Vector& a, double b) {
    return Each([&](int i) { return a[i] * b; });
  }
  friend Vector operator+(double a, const Vector& b) { return b + a; }
  friend Vector operator-(double a, const Vector& b) { return b * -1 + a; }
};
typedef Vector<kLanes> Lanes;
typedef Vector<kWideLanes> Wide;
typedef Vector<2> Pair;
#define SWGJOINT_INLINE inline
#endif

// Numbers that are read in vectors: none of these crosses two lines of the cache.
template <class T>
struct LaneAllocator {
  typedef T value_type;
  static constexpr std::align_val_t kAlign{64};
  LaneAllocator() = default;
  template <class U>
  LaneAllocator(const LaneAllocator<U>&) {}
  T* allocate(size_t n) {
    return static_cast<T*>(::operator new(n * sizeof(T), kAlign));
  }
  void deallocate(T* p, size_t) { ::operator delete(p, kAlign); }
  bool operator==(const LaneAllocator&) const { return true; }
  bool operator!=(const LaneAllocator&) const { return false; }
};
typedef std::vector<double, LaneAllocator<double>> LaneVector;

#if defined(__GNUC__)
// Vectors among other numbers; the compiler would copy bytes in two halves.
typedef double LanesInMemory
    __attribute__((vector_size(8 * kLanes), aligned(8), may_alias));
typedef double WideInMemory
    __attribute__((vector_size(8 * kWideLanes), aligned(8), may_alias));
typedef double PairInMemory __attribute__((vector_size(16), aligned(8), may_alias));
SWGJOINT_INLINE void Load(const double* from, Lanes* x) {
  *x = *reinterpret_cast<const LanesInMemory*>(from);
}
SWGJOINT_INLINE void Load(const double* from, Wide* x) {
  *x = *reinterpret_cast<const WideInMemory*>(from);
}
SWGJOINT_INLINE void Load(const double* from, Pair* x) {
  *x = *reinterpret_cast<const PairInMemory*>(from);
}
SWGJOINT_INLINE void Store(double* to, const Lanes& x) {
  *reinterpret_cast<LanesInMemory*>(to) = x;
}
SWGJOINT_INLINE void Store(double* to, const Wide& x) {
  *reinterpret_cast<WideInMemory*>(to) = x;
}
SWGJOINT_INLINE void Store(double* to, const Pair& x) {
  *reinterpret_cast<PairInMemory*>(to) = x;
}
#else
template <class V>
SWGJOINT_INLINE void Load(const double* from, V* x) {
  std::memcpy(x, from, sizeof(V));
}
template <class V>
SWGJOINT_INLINE void Store(double* to, const V& x) {
  std::memcpy(to, &x, sizeof(V));
}
#endif

// For a loop over vectors that are used several times: the compiler neither sorts the
// operations of all passes by their results nor reads a vector again for each use after
// its place has been hidden. Both would take half as long again.
#if defined(__GNUC__) && !defined(__clang__)
#define SWGJOINT_ROLLED _Pragma("GCC unroll 1")
#define SWGJOINT_UNROLLED _Pragma("GCC unroll 16")
#else
#define SWGJOINT_ROLLED
#define SWGJOINT_UNROLLED
#endif
SWGJOINT_INLINE void Hide(const double** place) {
#if defined(__GNUC__)
  asm("" : "+r"(*place));
#else
  static_cast<void>(place);
#endif
}

// Sets sums in vectors to zero. With an initial value the compiler clears the array in
// memory, in every call and with vectors of twice the length, even if it keeps the sums
// in registers.
template <class V, int kCount>
SWGJOINT_INLINE void Clear(V (&sums)[kCount]) {
  const V zero = {};
  SWGJOINT_UNROLLED
  for (int k = 0; k < kCount; ++k) sums[k] = zero;
}

SWGJOINT_INLINE double Dot(const Pair& a, const Pair& b) {
  const Pair product = a * b;
  return product[0] + product[1];
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

SWGJOINT_INLINE void Sums(const Wide& a, const Wide& b, const Wide& c, const Wide& d,
                          double out[4]) {
  const Wide* all[4] = {&a, &b, &c, &d};
  Lanes sums[4];
  for (int k = 0; k < 4; ++k) {
    double lanes[kWideLanes];
    Lanes high;
    Store(lanes, *all[k]);
    Load(lanes, &sums[k]);
    Load(lanes + kLanes, &high);
    sums[k] += high;
  }
  Sums(sums[0], sums[1], sums[2], sums[3], out);
}

// Coefficients of the series of sin(x)/x and cos(x) in powers of x^2, one vector each,
// first those of sin(x)/x. They are defined elsewhere, so that the compiler reads them
// where it needs them. It would fill more vectors with constants than the processor has,
// and store them, in every call.
constexpr int kSincTerms = 7, kCosTerms = 8;
extern const double* const kSeries;

// Computes sin(x)/x and cos(x) for |x| <= 2^(kHalvings - 1).
template <int kHalvings, class V>
SWGJOINT_INLINE void SincCos(const V& x, V* sinc, V* cos) {
  // Series with a truncation error below 2^-53 for |y| <= 1/2. They are summed in pairs
  // of terms, because one term after the other would take twice as long.
  V y = x * (1.0 / (1 << kHalvings));
  const V z = y * y, z2 = z * z, z4 = z2 * z2;
  const double* at = kSeries;
  V a, b, c, d, e, f, g, h;
  Load(at, &a);
  Load(at + kWideLanes, &b);
  Load(at + 2 * kWideLanes, &c);
  Load(at + 3 * kWideLanes, &d);
  Load(at + 4 * kWideLanes, &e);
  Load(at + 5 * kWideLanes, &f);
  Load(at + 6 * kWideLanes, &g);
  *sinc = ((a + z * b) + z2 * (c + z * d)) + z4 * ((e + z * f) + z2 * g);
  at += kSincTerms * kWideLanes;
  Load(at + kWideLanes, &b);
  Load(at + 2 * kWideLanes, &c);
  Load(at + 3 * kWideLanes, &d);
  Load(at + 4 * kWideLanes, &e);
  Load(at + 5 * kWideLanes, &f);
  Load(at + 6 * kWideLanes, &g);
  Load(at + 7 * kWideLanes, &h);
  *cos = ((a + z * b) + z2 * (c + z * d)) + z4 * ((e + z * f) + z2 * (g + z * h));
  // sin(2y) = 2 sin(y) cos(y), cos(2y) = 1 - 2 sin(y)^2
  for (int k = 0; k < kHalvings; ++k) {
    const V twice = y * 2;
    const V product = *sinc * *cos;
    *cos = 1 - (twice * *sinc) * (y * *sinc);
    *sinc = product;
    y = twice;
  }
}

// Computes cos and sin of any phase.
template <class V>
SWGJOINT_INLINE void CosSin(const V& phase, V* cos, V* sin) {
  // Adding and subtracting kRound rounds to an integer. Pi is the sum of two numbers, of
  // which the first has 26 bits: its product with up to 2^27 half turns is exact. More
  // half turns lose no more than the phase itself has lost.
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52
  constexpr double kPi = 0x1.921fb5p+1, kRest = 0x1.110b4611a6263p-25;
  const V halves = (phase * 0.31830988618379069 + kRound) - kRound;
  const V rest = (phase - halves * kPi) - halves * kRest;
  // an odd number of half turns changes both signs
  const V odd = halves - ((halves * 0.5 + kRound) - kRound) * 2;
  const V sign = 1 - odd * odd * 2;
  V sinc, even;
  SincCos<2>(rest, &sinc, &even);
  *cos = sign * even;
  *sin = sign * rest * sinc;
}

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_LANES_H_
