#include "motions.h"

#include <algorithm>

namespace swgjoint {

namespace {

// Coefficients of the smooth step and its derivatives, highest power first. The lowest
// powers, whose coefficients are zero, are only multiplied.
constexpr double kStep[] = {70, -315, 540, -420, 126};
constexpr double kSlope[] = {630, -2520, 3780, -2520, 630};
constexpr double kBend[] = {5040, -17640, 22680, -12600, 2520};

double evaluate(const double (&coefficients)[5], double x, int zeros) {
  double value = coefficients[0];
  for (int k = 1; k < 5; ++k) value = value * x + coefficients[k];
  for (int k = 0; k < zeros; ++k) value *= x;
  return value;
}

struct Motion {
  double position, velocity, acceleration;
};

Motion step_at(const Step& step, double time) {
  // without a delay the difference is the time itself
  const double x = (time - step.delay - step.hold) / step.duration;
  if (x <= 0.0) return {0.0, 0.0, 0.0};
  if (x >= 1.0) return {1.0, 0.0, 0.0};
  return {evaluate(kStep, x, 5), evaluate(kSlope, x, 4) / step.duration,
          evaluate(kBend, x, 3) / step.square};
}

}  // namespace

void grow_oscillation(const double* sin, const double* cos, std::size_t count,
                      std::size_t n, const double* weight, const double* omega,
                      double offset, const double* ramp, const double* slope,
                      const double* bend, double* result) {
  double *q = result, *v = result + n, *a = result + 2 * n;
  // sums over the sines: q, v and a of the oscillation without its growth
  for (std::size_t k = 0; k < count; ++k) {
    const double w = weight[k], o = omega[k], square = -(o * o);
    const double *s = sin + k * n, *c = cos + k * n;
    if (k == 0) {
      for (std::size_t j = 0; j < n; ++j) {
        const double value = s[j] * w;
        q[j] = value;
        v[j] = c[j] * w * o;
        a[j] = value * square;
      }
      continue;
    }
    for (std::size_t j = 0; j < n; ++j) {
      const double value = s[j] * w;
      q[j] += value;
      v[j] += c[j] * w * o;
      a[j] += value * square;
    }
  }
  for (std::size_t j = 0; j < n; ++j) {
    const double y = q[j] - offset, y1 = v[j], y2 = a[j];
    q[j] = ramp[j] * y;
    v[j] = slope[j] * y + ramp[j] * y1;
    a[j] = bend[j] * y + 2.0 * slope[j] * y1 + ramp[j] * y2;
  }
}

void move_back(const double* time, std::size_t n, const Step& there, const Step& back,
               double* result) {
  for (std::size_t j = 0; j < n; ++j) {
    const Motion a = step_at(there, time[j]), b = step_at(back, time[j]);
    result[j] = a.position - 0.5 * b.position;
    result[n + j] = a.velocity - 0.5 * b.velocity;
    result[2 * n + j] = a.acceleration - 0.5 * b.acceleration;
  }
}

void write_plan(const double* position, const double* velocity,
                const double* acceleration, std::size_t m, double load,
                const double* ramp, double inertia, std::size_t n, double* result) {
  const std::size_t first = n - m;
  for (std::size_t j = 0; j < n; ++j) {
    double* row = result + 5 * j;
    const bool moves = j >= first;
    row[0] = moves ? position[j - first] : 0.0;
    row[1] = moves ? velocity[j - first] : 0.0;
    row[2] = moves ? acceleration[j - first] : 0.0;
    row[3] = load * ramp[j];
    row[4] = row[3] + inertia * row[2];
  }
}

}  // namespace swgjoint
