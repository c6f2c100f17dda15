// Engine plugin swgjoint.drive: one drive between a rotor hinge and a link hinge.
#ifndef SWGJOINT_PLUGIN_DRIVE_H_
#define SWGJOINT_PLUGIN_DRIVE_H_

#include <mujoco/mujoco.h>

#include <initializer_list>
#include <memory>
#include <optional>
#include <vector>

#include "drive_map.h"
#include "friction.h"
#include "hysteresis.h"
#include "lanes.h"

namespace swgjoint {

class Drive {
 public:
  // Reads the attributes of an instance. If one of them is invalid, calls mju_warning
  // and returns null.
  static std::unique_ptr<Drive> Create(const mjModel* m, int instance);

  // Adds the torques of the drive and, for the integrator discrete, passes their
  // linearisation to the engine.
  void Compute(const mjModel* m, mjData* d, int instance);

  // After the step: stores the acceleration due to all other forces, and where the
  // hysteresis elements and the friction bristle are relaxed. A state that is not
  // finite becomes 0.
  void Advance(const mjModel* m, mjData* d, int instance);

  // Discards the data of a step that has begun.
  void Forget() { step_ = Step(); }

  // Copies the data that Advance needs to complete a step that the drive of another
  // mjData has begun. That drive may belong to another model; its map, addresses and
  // parameters are therefore not copied.
  void Continue(const Drive& other) {
    step_ = other.step_;
    hysteresis_.Continue(other.hysteresis_);
  }

  static void RegisterPlugin();

 private:
  // Results of Compute that Advance needs, within one step.
  struct Step {
    bool scheme = false, gradient = false;
    Pair v = {}, weight = {};                                 // speeds, Responses
    mjtNum force = 0, metric = 0;                             // along g, and p
    mjtNum torsion = 0, rotation = 0;                         // at the start of step
    DriveValue value;
    FrictionStep friction;
  };

  // Bounds of the region in which the integration was tested, if the model states them;
  // 0 means no bound.
  struct Region {
    mjtNum step[3] = {0, 0, 0};  // discrete, RK4, other integrators
    mjtNum phase = 0;            // phase change of the highest order per step
    static Region Find(const mjModel* m);
  };

  void Watch(const mjModel* m, const mjData* d, int instance, int scheme);
  void AddGradient(const mjModel* m, mjData* d, int instance);
  void AddScheme(const mjModel* m, mjData* d, int instance);
  mjtNum Damping(const mjModel* m, const mjData* d) const;
  Pair Response(const mjModel* m, const mjData* d, int dof, int other);
  Pair Responses(const mjModel* m, const mjData* d);
  void AdvanceState(const mjModel* m, const mjData* d, mjtNum* state);
  bool Diverges(mjData* d, std::initializer_list<mjtNum> numbers) const;
  // States of the friction bristle, and yield torsions in the last step or null.
  mjtNum* Bristle(mjtNum* state) const;
  mjtNum* Limit(mjtNum* state) const;
  bool FindFriction(const mjModel* m, const char* text, int rotor, int link);
  mjtNum Rotation(const Pair& q) const;
  void AddTorque(mjData* d, const Pair& torque) const;
  void Vary(const mjModel* m);

  DriveMap map_;
  mjtNum damping_ = 0, contact_damping_ = 0, numerical_damping_ = 0;
  int passes_ = 0;  // evaluations of the map per step
  int tendon_ = -1, entry_rotor_ = -1, entry_link_ = -1;  // tendon, indices in ten_J
  int q_rotor_ = -1, q_link_ = -1, v_rotor_ = -1, v_link_ = -1;  // addresses
  Hysteresis hysteresis_;
  bool siblings_ = false;       // whether rotor and link have the same ancestors
  std::vector<mjtNum> column_;  // workspace of Response: two columns of L^-T
  mjtNum losses_ = 1;  // scale of hysteresis and friction
  std::optional<Friction> friction_;
  int friction_tendon_ = -1;  // tendon of the friction term of the metric
  Region region_;
  Step step_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_DRIVE_H_
