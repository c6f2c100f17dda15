// Engine plugin swgjoint.drive: one drive between a rotor hinge and a link hinge.
#ifndef SWGJOINT_PLUGIN_DRIVE_H_
#define SWGJOINT_PLUGIN_DRIVE_H_

#include <mujoco/mujoco.h>

#include <initializer_list>
#include <memory>
#include <vector>

#include "law.h"

namespace swgjoint {

class Drive : private Law {
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
  void Forget() {
    step_ = Step();
    predicted_ = false;
  }

  // Copies the data that Advance needs to complete a step that the drive of another
  // mjData has begun. That drive may belong to another model; its map, addresses and
  // parameters are therefore not copied.
  void Continue(const Drive& other) {
    step_ = other.step_;
    predicted_ = false;
    hysteresis_.Continue(other.hysteresis_);
  }

  static void RegisterPlugin();

 private:
  static constexpr int kGroup = 8;  // number of drives that are predicted together

  // Bounds of the region in which the integration was tested, if the model states them;
  // 0 means no bound.
  struct Region {
    mjtNum step[3] = {0, 0, 0};  // discrete, RK4, other integrators
    mjtNum phase = 0;            // phase change of the highest order per step
    static Region Find(const mjModel* m);
  };

  void Watch(const mjModel* m, const mjData* d, int instance, int scheme);
  void AddGradient(const mjModel* m, mjData* d, int instance);
  void PredictGroup(const mjModel* m, mjData* d, int instance);
  void Begin(const mjModel* m, mjData* d, int instance);
  void AddScheme(const mjModel* m, mjData* d, int instance);
  mjtNum Damping(const mjModel* m, const mjData* d) const;
  Pair Response(const mjModel* m, const mjData* d, int dof, int other);
  Pair Responses(const mjModel* m, const mjData* d);
  bool Diverges(mjData* d, std::initializer_list<mjtNum> numbers) const;
  bool FindFriction(const mjModel* m, const char* text, int rotor, int link);
  void AddTorque(mjData* d, const Pair& torque) const;
  void Vary(const mjModel* m);

  int tendon_ = -1, entry_rotor_ = -1, entry_link_ = -1;  // tendon, indices in ten_J
  int q_rotor_ = -1, q_link_ = -1, v_rotor_ = -1, v_link_ = -1;  // addresses
  bool siblings_ = false;       // whether rotor and link have the same ancestors
  std::vector<mjtNum> column_;  // workspace of Response: two columns of L^-T
  int friction_tendon_ = -1;  // tendon of the friction term of the metric
  bool leads_ = false;      // whether it is the first one of a group
  bool predicted_ = false;  // whether the step of this call has been predicted
  Region region_;
  Step step_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_DRIVE_H_
