// The law of one drive between a rotor and a link, without an engine: torques at a
// state, and one step of the scheme for the integrator discrete. README.md has the
// formulas. The engine plugin and the FMU use it.
#ifndef SWGJOINT_PLUGIN_LAW_H_
#define SWGJOINT_PLUGIN_LAW_H_

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "drive_map.h"
#include "friction.h"
#include "hysteresis.h"
#include "lanes.h"

namespace swgjoint {

class Law {
 public:
  static constexpr int kAccelerations = 2;  // states before those of the hysteresis
  // States of the bristle: the rotation at which it is relaxed, and whether this is
  // known (otherwise 0) and the bristle slipped in the last step of the scheme.
  static constexpr int kBristle = 2;
  static constexpr double kKnown = 1, kSlipped = 2;

  // Results of Predict or Evaluate that Finish needs, within one step.
  struct Step {
    bool scheme = false, gradient = false;
    Pair v = {}, weight = {};          // speeds, accelerations due to unit torques
    double force = 0, metric = 0;      // along g, and p
    double torsion = 0, rotation = 0;  // at the start of step
    DriveValue value;
    FrictionStep friction;
  };

  // Reads the attributes of a drive, as text(key) or null, except `friction`. Returns
  // what is wrong, or an empty string.
  template <class Text>
  std::string Read(const Text& text) {
    std::string error;
    if (!map_.Parse({text("ratio"), text("orders"), text("knots"), text("potential"),
                     text("end_stiffness"), text("kinematic_error")},
                    &error)) {
      return error;
    }
    if (!Scalar(text("damping"), 0, kLargest, &damping_)) {
      return "attribute 'damping' is not one number >= 0";
    }
    if (!Scalar(text("numerical_damping"), 0, 1, &numerical_damping_)) {
      return "attribute 'numerical_damping' is not in 0..1";
    }
    const char* contact = text("contact_damping");
    if (contact && *contact && !Scalar(contact, 0, kLargest, &contact_damping_)) {
      return "attribute 'contact_damping' is not one number >= 0";
    }
    double passes;
    if (!Scalar(text("passes"), 1, 20, &passes) || passes != std::rint(passes)) {
      return "attribute 'passes' is not an integer in 1..20";
    }
    passes_ = static_cast<int>(passes);
    const char* fault = hysteresis_.Parse(text("hysteresis"), text("yield_curve"));
    return fault ? fault : "";
  }

  // Number of states: accelerations due to all other forces, hysteresis, friction.
  int states() const {
    return kAccelerations + static_cast<int>(hysteresis_.states()) +
           (friction_ ? kBristle : 0);
  }

 protected:
  static constexpr double kLargest = 1e10;  // mjMAXVAL
  static constexpr double kLeastLosses = 1e-6;  // keeps the bristle stiffness above zero

  // Reads one number in low..high; returns false if the text is invalid.
  static bool Scalar(const char* text, double low, double high, double* out) {
    std::vector<double> list;
    if (!ParseNumbers(text, &list)) return false;
    if (list.size() != 1 || list[0] < low || list[0] > high) return false;
    *out = list[0];
    return true;
  }

  // Applies the deviations of a specimen from its map, see README.md.
  void Deviate(const double by[5]) {
    map_.Vary(1 + by[0], 1 + by[1], by[2], by[3]);
    losses_ = std::max(1 + by[4], kLeastLosses);  // keeps NaN, which a caller detects
    if (friction_) friction_->Scale(losses_);
  }

  // Rotation (or speed) of the wave generator relative to the flexspline, from positions
  // (or velocities) of rotor and link.
  double Rotation(const Pair& q) const { return Dot(friction_->b(), q); }

  // States of the friction bristle, and yield torsions in the last step or null.
  double* Bristle(double* state) const {
    return state + kAccelerations + hysteresis_.size();
  }
  double* Limit(double* state) const {
    if (!hysteresis_.varies()) return nullptr;
    return Bristle(state) + (friction_ ? kBristle : 0);
  }

  // Torques at a state: value, with hysteresis, and the friction along b.
  void Evaluate(const Pair& q, const Pair& v, double* state, DriveValue* value,
                double* rubs) {
    map_.Gradient(q[0], q[1], value);
    hysteresis_.Place(map_.torsion(), state + kAccelerations, nullptr);
    hysteresis_.Slip(0, losses_, value);
    *rubs = 0;
    if (friction_) {
      const double* bristle = Bristle(state);
      const double speed = Rotation(v);
      const double x = bristle[1] != 0 ? Rotation(q) - bristle[0] : 0;
      const double reach = friction_->Reach(speed, value->torque);
      *rubs = friction_->Torque(x, reach, speed, bristle[1] == kSlipped);
    }
  }

  // Predicts a step of rotor and link from the positions x and the speeds v, and
  // evaluates the discrete gradient over it. `weight` are the accelerations due to unit
  // torques. The force is linear in the velocity change, M + h^2 p g g' (+ friction).
  void Predict(double h, const Pair& x, const Pair& v, const Pair& weight,
               double damping, double* state, Step* step) {
    Start(h, x, v, weight, damping, state, step);
    for (int pass = 0; pass < passes_; ++pass) {
      SumHarmonics(step);
      FinishSecant(step);
      Solve(pass, step);
    }
  }

  // The parts of Predict: its start, and in each pass the discrete gradient over the
  // predicted change of the positions and the velocity change that follows from it.
  SWGJOINT_INLINE void Start(double h, const Pair& x, const Pair& v,
                             const Pair& weight, double damping, double* state,
                             Step* step) {
    map_.Begin(x[0], x[1]);
    hysteresis_.Place(map_.torsion(), state + kAccelerations, Limit(state));
    trial_.h = h;
    trial_.damping = damping;
    trial_.other = Pair{state[0], state[1]};
    trial_.dv = Pair{0, 0};
    trial_.dx = v * h;
    if (friction_) {
      const double* rest = Bristle(state);
      trial_.speed = Rotation(v);
      step->rotation = Rotation(x);
      trial_.turned = rest[1] != 0 ? step->rotation - rest[0] : 0;
    }
    step->v = v;
    step->weight = weight;
    step->torsion = map_.torsion();
  }

  SWGJOINT_INLINE void SumHarmonics(Step* step) {
    map_.SumHarmonics(trial_.dx[0], trial_.dx[1], &step->value);
  }

  SWGJOINT_INLINE void FinishSecant(Step* step) {
    map_.FinishSecant(trial_.dx[0], trial_.dx[1], &step->value);
  }

  SWGJOINT_INLINE void Solve(int pass, Step* step) {
    DriveValue& g = step->value;
    const double h = trial_.h, damping = trial_.damping;
    const Pair v = step->v, weight = step->weight, dv = trial_.dv;
    if (hysteresis_.size()) hysteresis_.Slip(Dot(g.g, trial_.dx), losses_, &g);
    const double k = std::max(0.0, 0.5 * (g.stiffness_begin + g.stiffness_end));
    const double w = Dot(g.g * g.g, weight);
    const double ka = h * h * w * k;
    const double nu = numerical_damping_ * ka * ka / (16 + ka * ka);
    const double rate = Dot(g.g, v);
    // the last factor of every product is the one that takes longest to compute
    const double force =
        (g.torque + damping * rate - 0.5 * h * Dot(g.g, dv) * g.slope) +
        h * rate * k * nu;
    const double p = (0.5 * damping / h + 0.5 * g.slope) + 0.75 * k * nu;
    step->force = force;
    step->metric = p;
    if (pass + 1 == passes_ && !friction_) return;
    const Pair free = trial_.other - weight * g.e;
    const double change = (h * Dot(g.g, free) - h * w * force) / (1 + h * h * w * p);
    Pair after = free * h - weight * g.g * h * (force + h * p * change);
    if (friction_) {
      FrictionStep& rub = step->friction;
      rub.reach = friction_->Reach(trial_.speed + 0.5 * Rotation(dv), g.torque);
      rub.stretch = std::clamp(trial_.turned, -rub.reach, rub.reach);
      // response of rotor and link to friction, (M + h^2 p g g')^-1 b
      const Pair b = friction_->b();
      const double along = h * h * p * Dot(weight * b, g.g) / (1 + h * h * w * p);
      const Pair answer = weight * (b - g.g * along) * h;
      after -= answer * friction_->Solve(h, trial_.speed, Rotation(after),
                                         Rotation(answer), &rub);
    }
    trial_.dv = after;
    trial_.dx = v * h + after * (0.5 * h);
  }

  // After a step to q and v: stores the acceleration due to all other forces, and where
  // the hysteresis elements and the friction bristle are relaxed.
  void Finish(double h, const Pair& q, const Pair& v, Step* step, double* state) {
    state[0] = state[1] = 0;
    // The torsion at the end of a step determines where each element is relaxed. In the
    // scheme, it follows from the linearised change of the torsion. With other
    // integrators, intermediate stages are ignored.
    double *rest = state + kAccelerations, *bristle = Bristle(state);
    if (hysteresis_.size() && (step->scheme || step->gradient)) {
      double* limit = Limit(state);
      if (step->gradient && limit) {
        DriveValue value;
        map_.Gradient(q[0], q[1], &value);
        hysteresis_.Load(value.torque);
        step->torsion = map_.torsion();
      } else if (step->gradient) {
        map_.Begin(q[0], q[1]);
        step->torsion = map_.torsion();
      }
      hysteresis_.Relax(step->torsion, step->scheme ? limit : nullptr, rest);
      if (step->scheme) {
        const Pair mean = step->v + (v - step->v) * 0.5;
        hysteresis_.Settle(h * Dot(step->value.g, mean), rest);
      }
      if (limit) hysteresis_.Store(limit);
    }
    if (friction_ && step->gradient) {
      const double x = Rotation(q);
      DriveValue value;
      map_.Gradient(q[0], q[1], &value);
      hysteresis_.Place(map_.torsion(), rest, nullptr);
      hysteresis_.Slip(0, losses_, &value);
      const double reach = friction_->Reach(Rotation(v), value.torque);
      bristle[0] = bristle[1] != 0 ? std::clamp(bristle[0], x - reach, x + reach) : x;
      bristle[1] = kKnown;
    }
    if (!step->scheme) return;
    const DriveValue& g = step->value;
    const Pair dv = v - step->v;
    Pair torque = g.g * (step->force + h * step->metric * Dot(g.g, dv)) + g.e;
    if (friction_) {
      const FrictionStep& rub = step->friction;
      const double change = Rotation(dv);
      torque += friction_->b() * (rub.force + h * rub.metric * change);
      const double dx = h * (Rotation(step->v) + 0.5 * change);
      bristle[0] = step->rotation + dx - friction_->After(rub, dx);
      bristle[1] = std::fabs(rub.stretch + dx) > rub.reach ? kSlipped : kKnown;
    }
    Store(state, dv * (1 / h) + step->weight * torque);
  }

  // Data of a prediction: time step, damping, accelerations by all other forces,
  // predicted changes of velocities and positions, and along the friction the speed and
  // the stretch of the bristle before it slips.
  struct Trial {
    double h = 0, damping = 0;
    Pair other = {}, dv = {}, dx = {};
    double speed = 0, turned = 0;
  };

  DriveMap map_;
  Trial trial_;
  double damping_ = 0, contact_damping_ = 0, numerical_damping_ = 0;
  int passes_ = 0;  // evaluations of the map per step
  Hysteresis hysteresis_;
  double losses_ = 1;  // scale of hysteresis and friction
  std::optional<Friction> friction_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_LAW_H_
