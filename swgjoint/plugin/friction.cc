#include "friction.h"

#include <algorithm>
#include <cmath>

namespace swgjoint {
namespace {
constexpr double kRoundOff = 1e-9;
}  // namespace

bool Friction::Parse(const std::vector<double>& list) {
  if (list.size() != 9) return false;
  b_theta_ = list[0];
  b_psi_ = list[1];
  if (std::fabs(b_theta_) != 1 || (b_psi_ != 0 && std::fabs(b_psi_) != 1)) return false;
  if (!std::all_of(list.begin() + 2, list.end(), [](double x) { return x >= 0; })) {
    return false;
  }
  own_stiffness_ = list[2];
  own_damping_ = list[3];
  coulomb_ = list[4];
  static_ = list[5];
  stribeck_ = list[6];
  own_viscous_ = list[7];
  load_ = list[8];
  Scale(1);
  return stiffness_ > 0 && stribeck_ > 0 && static_ >= coulomb_;
}

double Friction::Reach(double speed, double torque) const {
  double slip = coulomb_ + load_ * std::fabs(torque);
  if (static_ > coulomb_) {
    const double x = speed / stribeck_;
    slip += (static_ - coulomb_) * std::exp(-x * x);
  }
  return slip / own_stiffness_;
}

double Friction::Torque(double x, double reach, double speed, bool slipped) const {
  // at its reach the bristle keeps slipping, even if round-off leaves it just inside;
  // in the scheme the reach is that of the middle of the step, which may be smaller
  const bool slips =
      (slipped || std::fabs(x) >= (1 - kRoundOff) * reach) && x * speed > 0;
  const double creep = slips ? 0 : damping_ * speed;
  return stiffness_ * std::clamp(x, -reach, reach) + creep + viscous_ * speed;
}

double Friction::Solve(double h, double speed, double free, double response,
                       FrictionStep* step) const {
  const double z = step->stretch, reach = step->reach;
  const double half = 0.5 * stiffness_;
  // rotation dx without friction, and its reduction per unit of friction torque
  const double d = h * (speed + 0.5 * free), k = 0.5 * h * response;
  const double m = 1 + 0.5 * response * viscous_;
  // sticking: the torque is stiffness (z + dx/2) + damping dx/h
  double offset = stiffness_ * z, rate = half + damping_ / h;
  double dx = (d - k * offset) / (m + k * rate);
  if (std::fabs(z + dx) > reach) {
    // sticking over the distance a, then slipping: the mean torque gives the exact work
    const double sign = dx > 0 ? 1 : -1, limit = stiffness_ * reach;
    const double a = reach - sign * z;
    const double creep = damping_ * a / h;
    const double b = sign * d - k * (limit + creep), c = 2 * m * k * stiffness_ * a * a;
    const double root = std::sqrt(b * b + c);
    const double way = b > 0 ? 0.5 * (b + root) / m : k * stiffness_ * a * a / (root - b);
    const double mean = sign * (limit - half * a * a / way + creep);
    dx = sign * way;
    // linear in the actual dx; the bristle must not return more energy than it has
    // stored
    rate = half;
    offset = mean - rate * dx;
    if (std::fabs(offset) > stiffness_ * std::fabs(z)) {
      offset = 0;
      rate = mean / dx;
    }
  }
  const double slope = rate + viscous_ / h;
  step->offset = offset;
  step->rate = rate;
  step->force = offset + slope * h * speed;
  step->metric = 0.5 * slope;
  return offset + slope * dx;
}

double Friction::After(const FrictionStep& step, double dx) const {
  const double z = step.stretch;
  const double end = std::clamp(z + dx, -step.reach, step.reach);
  const double work = (step.offset + step.rate * dx) * dx;
  const double most = std::sqrt(std::max(0.0, z * z + 2 * work / stiffness_));
  return std::clamp(end, -most, most);
}

}  // namespace swgjoint
