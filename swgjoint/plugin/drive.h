// The engine plugin swgjoint.drive: one drive between a rotor and a link hinge.
#ifndef SWGJOINT_PLUGIN_DRIVE_H_
#define SWGJOINT_PLUGIN_DRIVE_H_

#include <mujoco/mujoco.h>

#include <initializer_list>
#include <memory>
#include <optional>
#include <vector>

#include "drive_map.h"
#include "friction.h"

namespace swgjoint {

class Drive {
 public:
  // Reads the attributes of an instance; null after mju_warning on a bad one.
  static std::unique_ptr<Drive> Create(const mjModel* m, int instance);

  // Adds the force and, for the discrete integrator, hands its linearisation over.
  void Compute(const mjModel* m, mjData* d, int instance);

  // After the step: keeps the acceleration that all other forces caused, and where
  // the elements of the hysteresis and the bristle of the friction are relaxed. A
  // state that is not finite becomes 0.
  void Advance(const mjModel* m, mjData* d, int instance);

  void Forget() { step_ = Step(); }

  // Takes over what Advance needs of a step that the drive of another mjData began. That
  // one may be of another model, so its map, addresses and parameters stay there.
  void Continue(const Drive& other) { step_ = other.step_; }

  static void RegisterPlugin();

 private:
  // What Compute found and Advance needs, within one step.
  struct Step {
    bool scheme = false, gradient = false;
    mjtNum v_rotor = 0, v_link = 0, w_rotor = 0, w_link = 0;  // velocity, 1/inertia
    mjtNum force = 0, metric = 0;                             // lam, p
    mjtNum torsion = 0, rotation = 0;                         // begin of the step
    DriveValue value;
    FrictionStep friction;
  };

  // Bounds within which the integration was tested, where the model states them; 0: any.
  struct Region {
    mjtNum step[3] = {0, 0, 0};  // discrete, RK4, other integrators
    mjtNum phase = 0;            // of the highest order in a step
    static Region Find(const mjModel* m);
  };

  void Watch(const mjModel* m, const mjData* d, int instance, int scheme);
  void AddGradient(const mjModel* m, mjData* d, int instance);
  void AddScheme(const mjModel* m, mjData* d, int instance);
  mjtNum Damping(const mjModel* m, const mjData* d) const;
  mjtNum Response(const mjModel* m, const mjData* d, int dof);
  void AdvanceState(const mjModel* m, const mjData* d, mjtNum* state);
  bool Diverges(mjData* d, std::initializer_list<mjtNum> numbers) const;
  void Place(const mjtNum* rest);
  void Slip(mjtNum change, DriveValue* value) const;
  bool FindFriction(const mjModel* m, const char* text, int rotor, int link);
  mjtNum Rotation(const mjtNum* q) const;
  void Vary(const mjModel* m);

  DriveMap map_;
  mjtNum damping_ = 0, contact_damping_ = 0, numerical_damping_ = 0;
  int passes_ = 0;
  int tendon_ = -1, entry_rotor_ = -1, entry_link_ = -1;  // tendon, entries of ten_J
  int q_rotor_ = -1, q_link_ = -1, v_rotor_ = -1, v_link_ = -1;  // addresses
  // Jenkin elements: stiffness, torsion from rest to slip, torsion from rest now
  std::vector<mjtNum> stiffness_, reach_, stretch_;
  std::vector<mjtNum> column_;  // of L^-T, room for Response
  mjtNum losses_ = 1;  // scale of hysteresis and friction
  std::optional<Friction> friction_;
  int friction_tendon_ = -1;  // carries its part of the metric
  Region region_;
  Step step_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_DRIVE_H_
