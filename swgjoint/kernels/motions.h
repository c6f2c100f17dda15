// Motions and plans of the environments.
//
// The compiled twins of Oscillation.sample and Move.sample in swgjoint/envs/references.py
// and of TrackingCore.sample in swgjoint/envs/joint_tracking.py, which explain them. The
// results have the same bits, because every operation and its order are the same.

#ifndef SWGJOINT_KERNELS_MOTIONS_H_
#define SWGJOINT_KERNELS_MOTIONS_H_

#include <cstddef>

namespace swgjoint {

// A sum of sines that grows from rest. sin, cos: (count, n) at their phases; weight,
// omega: (count); ramp, slope, bend: (n), the growth and its derivatives; result: (3, n),
// position, velocity and acceleration.
void grow_oscillation(const double* sin, const double* cos, std::size_t count,
                      std::size_t n, const double* weight, const double* omega,
                      double offset, const double* ramp, const double* slope,
                      const double* bend, double* result);

// A smooth step over a time, from delay on.
struct Step {
  double delay;     // [s], subtracted from the time after the hold
  double hold;      // [s]
  double duration;  // [s]
  double square;    // of the duration [s^2]
};

// A step minus half of another one. time: (n); result: (3, n).
void move_back(const double* time, std::size_t n, const Step& there, const Step& back,
               double* result);

// Plan of a joint: position, velocity, acceleration, load torque and known torque.
// position, velocity, acceleration: (m), m <= n, those of the last instants; ramp: (n);
// result: (n, 5).
void write_plan(const double* position, const double* velocity,
                const double* acceleration, std::size_t m, double load,
                const double* ramp, double inertia, std::size_t n, double* result);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_MOTIONS_H_
