#include "drive.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace swgjoint {
namespace {

constexpr char kName[] = "swgjoint.drive";
constexpr const char* kAttributes[] = {
    "ratio",           "orders",  "knots",             "potential", "end_stiffness",
    "kinematic_error", "damping", "numerical_damping", "passes", "hysteresis",
    "friction",        "contact_damping", "yield_curve"};
constexpr int kCount = sizeof(kAttributes) / sizeof(kAttributes[0]);
constexpr int kDeviations = 5;  // number of user values of a tendon
// Largest cubic coefficient of the friction tendon, which is identified by so small a
// value. The length of this tendon is a rotation of many turns, not a torsion; its
// spring force must nevertheless be negligible. Models are written with 1e-19, because
// MuJoCo writes smaller numbers than 1e-20 to XML as 0; older models have 1e-30.
constexpr mjtNum kFrictionCubic = 1e-18;
// Torque that triggers mjWARN_BADQACC at inertias up to 1e10 kg m^2.
constexpr mjtNum kDiverged = mjMAXVAL * mjMAXVAL;
// Custom numeric with the bounds of the integration region, see joint/watch.py.
constexpr char kRegion[] = "swgjoint_region";

// Drive of an instance.
Drive* Get(const mjData* d, int instance) {
  return reinterpret_cast<Drive*>(d->plugin_data[instance]);
}

// Warns that an instance is invalid, and returns null.
std::unique_ptr<Drive> Refuse(const mjModel* m, int instance, const std::string& why) {
  const char* name = mj_id2name(m, mjOBJ_PLUGIN, instance);
  mju_warning("%s instance '%s': %s", kName, name ? name : "", why.c_str());
  return nullptr;
}

// Texts of all attributes of an instance. The model holds them one after the other, in
// the order of kAttributes. Those of a map with thousands of harmonics are long, so they
// are searched once, and not once per attribute as by mj_getPluginConfig.
class Attributes {
 public:
  Attributes(const mjModel* m, int instance) {
    const char* next = m->plugin_attr + m->plugin_attradr[instance];
    for (const char*& text : texts_) {
      text = next;
      next += std::strlen(next) + 1;
    }
  }

  // Text of an attribute, empty if the instance does not have it; null for other keys.
  const char* operator()(const char* key) const {
    for (int k = 0; k < kCount; ++k) {
      if (!std::strcmp(kAttributes[k], key)) return texts_[k];
    }
    return nullptr;
  }

 private:
  const char* texts_[kCount];
};

// Number of states of an instance in plugin_state.
int CountStates(const mjModel* m, int instance) {
  const Attributes text(m, instance);
  Hysteresis hysteresis;
  // Create rejects an invalid attribute
  if (hysteresis.Parse(text("hysteresis"), text("yield_curve"))) {
    return Law::kAccelerations;
  }
  const char* friction = text("friction");
  return Law::kAccelerations + static_cast<int>(hysteresis.states()) +
         (friction && *friction ? Law::kBristle : 0);
}

// Sets the length of a tendon such that its cubic spring has the tangent stiffness p.
// The length is never 0, because the engine would omit a stiffness of 0 from its
// metric. Returns the tangent stiffness after rounding.
mjtNum SetTangent(const mjModel* m, mjData* d, int tendon, mjtNum p) {
  const mjtNum a = m->tendon_stiffness[tendon];
  const mjtNum c = m->tendon_stiffnesspoly[mjNPOLY * tendon + 1];
  const mjtNum length = std::max(1e-12, std::sqrt(std::max(0.0, (p - a) / (3 * c))));
  d->ten_length[tendon] = length;
  return a + 3 * c * length * length;
}

// Force of a tendon's cubic spring, which the engine has applied.
mjtNum NativeForce(const mjModel* m, const mjData* d, int tendon) {
  const mjtNum x = d->ten_length[tendon];
  return x * (m->tendon_stiffness[tendon] +
              x * x * m->tendon_stiffnesspoly[mjNPOLY * tendon + 1]);
}

// Whether this is the first warning about a bound for a model signature and step size.
bool First(uint64_t model, mjtNum step, int bound) {
  static std::mutex mutex;
  static std::set<std::tuple<uint64_t, mjtNum, int>> warned;
  const std::lock_guard<std::mutex> lock(mutex);
  return warned.emplace(model, step, bound).second;
}

}  // namespace

Drive::Region Drive::Region::Find(const mjModel* m) {
  Region found;
  for (int n = 0; n < m->nnumeric; ++n) {
    const char* name = mj_id2name(m, mjOBJ_NUMERIC, n);
    // the attachment of the model may have added a prefix to the name
    if (!name || !std::strstr(name, kRegion) || m->numeric_size[n] != 4) continue;
    const mjtNum* bound = m->numeric_data + m->numeric_adr[n];
    for (int k = 0; k < 3; ++k) {
      if (bound[k] <= 0) continue;
      found.step[k] = found.step[k] > 0 ? std::min(found.step[k], bound[k]) : bound[k];
    }
    found.phase = bound[3];
  }
  return found;
}

// Warns once per model and step size when the integration region is left.
void Drive::Watch(const mjModel* m, const mjData* d, int instance, int scheme) {
  const mjtNum h = m->opt.timestep, limit = region_.step[scheme];
  if (limit <= 0 && region_.phase <= 0) return;
  const mjtNum speed = std::fabs(d->qvel[v_rotor_]);
  const mjtNum phase = h * map_.top_order() * speed;
  const bool turns = scheme == 0 && region_.phase > 0 && phase > region_.phase;
  const bool steps = limit > 0 && h > limit * (1 + 1e-9);
  if (!steps && !turns) return;
  const mjtNum most = region_.phase;
  (steps ? region_.step[scheme] : region_.phase) = 0;  // no second warning
  if (!First(m->signature, h, steps ? scheme : 3)) return;
  const char* name = mj_id2name(m, mjOBJ_PLUGIN, instance);
  if (steps) {
    mju_warning("%s '%s': a step of %.4g ms is outside the region of its integration;"
                " a step of %.4g ms would do%s", kName, name ? name : "", 1e3 * h,
                1e3 * limit, scheme == 2 ? ", or integrator discrete" : "");
  } else {
    mju_warning("%s '%s': at %.4g rad/s the rotor turns a harmonic of order %.4g by"
                " %.3g rad in a step of %.4g ms, more than %.3g; a step of %.4g ms would"
                " do, or max_input_speed when attaching leaves it out", kName,
                name ? name : "", speed, map_.top_order(), phase, 1e3 * h, most,
                1e3 * h * most / phase);
  }
}

std::unique_ptr<Drive> Drive::Create(const mjModel* m, int instance) {
  auto drive = std::make_unique<Drive>();
  const Attributes text(m, instance);
  const std::string fault = drive->Read(text);
  if (!fault.empty()) return Refuse(m, instance, fault);

  // When a model is attached, names get a prefix but config strings do not. The tendon
  // is therefore found by the name of the instance, which it shares.
  const char* name = mj_id2name(m, mjOBJ_PLUGIN, instance);
  const int t = name ? mj_name2id(m, mjOBJ_TENDON, name) : -1;
  if (t < 0) return Refuse(m, instance, "no tendon has the name of the instance");
  const int wrap = m->tendon_adr[t];
  if (m->tendon_num[t] != 2 || m->wrap_type[wrap] != mjWRAP_JOINT ||
      m->wrap_type[wrap + 1] != mjWRAP_JOINT) {
    return Refuse(m, instance, "its tendon does not join a rotor and a link joint");
  }
  const int rotor = m->wrap_objid[wrap], link = m->wrap_objid[wrap + 1];
  // XML keeps only six digits of a coefficient, so that it is compared but not used
  if (m->jnt_type[rotor] != mjJNT_HINGE || m->jnt_type[link] != mjJNT_HINGE ||
      std::fabs(m->wrap_prm[wrap] * drive->map_.ratio() - 1) > 1e-5 ||
      m->wrap_prm[wrap + 1] != -1) {
    return Refuse(m, instance, "its tendon is not rotor hinge/ratio - link hinge");
  }
  if (m->tendon_damping[t] != 0 || m->tendon_armature[t] != 0 ||
      m->tendon_stiffness[t] <= 0 || m->tendon_stiffnesspoly[mjNPOLY * t] != 0 ||
      m->tendon_stiffnesspoly[mjNPOLY * t + 1] <= 0 ||
      m->tendon_lengthspring[2 * t] != 0 || m->tendon_lengthspring[2 * t + 1] != 0) {
    return Refuse(m, instance,
                  "its tendon needs stiffness 'a 0 c' with a, c > 0, springlength 0, "
                  "no damping, no armature");
  }
  drive->tendon_ = t;
  drive->q_rotor_ = m->jnt_qposadr[rotor];
  drive->q_link_ = m->jnt_qposadr[link];
  drive->v_rotor_ = m->jnt_dofadr[rotor];
  drive->v_link_ = m->jnt_dofadr[link];
  const int dofs = m->M_rownnz[drive->v_rotor_], others = m->M_rownnz[drive->v_link_];
  drive->column_.resize(2 * std::max(dofs, others));
  const int* ancestor = m->M_colind + m->M_rowadr[drive->v_rotor_];
  drive->siblings_ = dofs == others &&
                     std::equal(ancestor, ancestor + dofs - 1,
                                m->M_colind + m->M_rowadr[drive->v_link_]);
  const int row = m->ten_J_rowadr[t];
  for (int j = row; j < row + m->ten_J_rownnz[t]; ++j) {
    if (m->ten_J_colind[j] == drive->v_rotor_) drive->entry_rotor_ = j;
    if (m->ten_J_colind[j] == drive->v_link_) drive->entry_link_ = j;
  }
  if (drive->entry_rotor_ < 0 || drive->entry_link_ < 0) {
    return Refuse(m, instance, "its joints are missing in the tendon's Jacobian");
  }
  const char* friction = text("friction");
  if (friction && *friction && !drive->FindFriction(m, friction, rotor, link)) {
    return Refuse(m, instance,
                  "attribute 'friction' is not nine numbers 'b_theta b_psi stiffness "
                  "damping coulomb static stribeck_speed viscous load', or no tendon "
                  "with these b and stiffness 'a 0 1e-19' carries it");
  }
  int before = 0;
  for (int n = 0; n < instance; ++n) before += m->plugin[n] == m->plugin[instance];
  drive->leads_ = before % kGroup == 0;
  drive->region_ = Region::Find(m);
  return drive;
}

// Finds the tendon that carries the friction term of the metric. It has the same joints
// with coefficients b and the small cubic coefficient; its name may change when a model
// is attached.
bool Drive::FindFriction(const mjModel* m, const char* text, int rotor, int link) {
  std::vector<double> list;
  Friction friction;
  if (!ParseNumbers(text, &list) || !friction.Parse(list)) return false;
  const int size = friction.b()[1] == 0 ? 1 : 2;
  for (int t = 0; t < m->ntendon; ++t) {
    const int wrap = m->tendon_adr[t];
    const mjtNum cubic = m->tendon_stiffnesspoly[mjNPOLY * t + 1];
    if (m->tendon_num[t] != size || m->wrap_type[wrap] != mjWRAP_JOINT ||
        m->wrap_objid[wrap] != rotor || m->wrap_prm[wrap] != friction.b()[0] ||
        m->tendon_stiffness[t] <= 0 || m->tendon_damping[t] != 0 ||
        cubic <= 0 || cubic > kFrictionCubic) {
      continue;
    }
    if (size == 2 && (m->wrap_objid[wrap + 1] != link ||
                      m->wrap_prm[wrap + 1] != friction.b()[1])) {
      continue;
    }
    friction_ = friction;
    friction_tendon_ = t;
  }
  return friction_.has_value();
}

void Drive::AddTorque(mjData* d, const Pair& torque) const {
  d->qfrc_passive[v_rotor_] += torque[0];
  d->qfrc_passive[v_link_] += torque[1];
}

// Applies the deviations of this drive from its map, which are user data of its tendon.
// Zeros, or no user data, mean no deviation. The data are read in every step, so that
// the simulations of a batch may differ.
void Drive::Vary(const mjModel* m) {
  if (m->nuser_tendon < kDeviations) return;
  const mjtNum* by = m->tendon_user + tendon_ * m->nuser_tendon;
  Deviate(by);
}

void Drive::Compute(const mjModel* m, mjData* d, int instance) {
  step_.scheme = step_.gradient = false;
  // if springs are disabled, the engine also omits the tendon from its metric
  if (m->opt.disableflags & mjDSBL_SPRING) return;

  // remove the spring force of the tendon that the engine applied
  const mjtNum native = NativeForce(m, d, tendon_);
  AddTorque(d, Pair{d->ten_J[entry_rotor_], d->ten_J[entry_link_]} * native);
  if (friction_) {
    AddTorque(d, friction_->b() * NativeForce(m, d, friction_tendon_));
  }

  // the solver PGS ignores the tendon term of the metric
  if (m->opt.integrator == mjINT_DISCRETE && m->opt.solver != mjSOL_PGS) {
    Watch(m, d, instance, 0);
    AddScheme(m, d, instance);
  } else {
    Watch(m, d, instance, m->opt.integrator == mjINT_RK4 ? 1 : 2);
    AddGradient(m, d, instance);
  }
}

// Whether a torque or stiffness of a step is not finite or is excessively large, which
// invalid user data or an invalid state may cause. The engine's solver would treat such
// a force as zero, and the whole model would coast without a warning. The rotor
// therefore gets a torque at which the engine reports divergence and resets, as it does
// after any other divergence. The step does not change the history of the drive.
bool Drive::Diverges(mjData* d, std::initializer_list<mjtNum> numbers) const {
  bool bounded = true;
  for (mjtNum x : numbers) bounded &= std::fabs(x) <= kDiverged;  // false for NaN
  if (bounded) return false;
  d->qfrc_passive[v_rotor_] = kDiverged;
  d->qfrc_passive[v_link_] = 0;
  return true;
}

// Acceleration of each of two dofs due to a unit torque on it, with all other dofs
// free. These are their entries on the diagonal of M^-1. With M = L' D L and the unit
// vector e of a dof, an entry is the sum of (L^-T e)^2/D over the dof and its
// ancestors. The dofs must have the same ancestors.
Pair Drive::Response(const mjModel* m, const mjData* d, int dof, int other) {
  const int ancestors = m->M_rownnz[dof] - 1;
  const int* ancestor = m->M_colind + m->M_rowadr[dof];
  const mjtNum* first = d->qLD + m->M_rowadr[dof];
  const mjtNum* second = d->qLD + m->M_rowadr[other];
  mjtNum* column = column_.data();  // L^-T e of both dofs, in pairs
  for (int b = 0; b < ancestors; ++b) Store(column + 2 * b, Pair{-first[b], -second[b]});
  Pair sum = {d->qLDiagInv[dof], d->qLDiagInv[other]};
  for (int a = ancestors - 1; a >= 0; --a) {
    // the ancestors of an ancestor are the preceding entries
    const int j = ancestor[a];
    const mjtNum* factor = d->qLD + m->M_rowadr[j];
    Pair x, y;
    Load(column + 2 * a, &x);
    sum += x * x * d->qLDiagInv[j];
    for (int b = 0; b < a; ++b) {
      Load(column + 2 * b, &y);
      Store(column + 2 * b, y - x * factor[b]);
    }
  }
  return sum;
}

// Accelerations of rotor and link due to a unit torque on each, see above.
Pair Drive::Responses(const mjModel* m, const mjData* d) {
  if (siblings_) return Response(m, d, v_rotor_, v_link_);
  return Pair{Response(m, d, v_rotor_, v_rotor_)[0],
              Response(m, d, v_link_, v_link_)[0]};
}

// Adds the torques at the current state: gradient of the potential, hysteresis, damping
// and friction.
void Drive::AddGradient(const mjModel* m, mjData* d, int instance) {
  const Pair q = {d->qpos[q_rotor_], d->qpos[q_link_]};
  const Pair v = {d->qvel[v_rotor_], d->qvel[v_link_]};
  Vary(m);
  DriveValue value;
  mjtNum rubs;
  Evaluate(q, v, d->plugin_state + m->plugin_stateadr[instance], &value, &rubs);
  const mjtNum damping = m->opt.disableflags & mjDSBL_DAMPER ? 0 : damping_;
  const mjtNum force = value.torque + damping * Dot(value.g, v);
  if (Diverges(d, {force, value.g[0], value.g[1], value.e[0], value.e[1], rubs})) {
    return;
  }
  if (friction_) AddTorque(d, friction_->b() * -rubs);
  AddTorque(d, (value.g * force + value.e) * -1);
  step_.gradient = true;
}

// Damping along the torsion in a step of the scheme [N m s/rad]. The engine moves a
// link out of a contact or a joint limit along a prescribed path, regardless of the
// torque. This adds energy to the torsion of a drive without losses; contact_damping
// dissipates that energy.
mjtNum Drive::Damping(const mjModel* m, const mjData* d) const {
  const mjtNum own = m->opt.disableflags & mjDSBL_DAMPER ? 0 : damping_;
  // the engine makes the constraint rows of the step before the passive stage
  const bool touches = d->nefc > d->ne + d->nf;
  return touches ? std::max(own, contact_damping_) : own;
}

// Predicts the steps of this drive and of the following ones of its group. The drives
// pass each part of the prediction one after the other: none waits for another, so that
// the processor works on several of them at the same time.
SWGJOINT_CLONES void Drive::PredictGroup(const mjModel* m, mjData* d, int instance) {
  Drive* group[kGroup];
  int members = 0, size = 0, passes = 0;
  for (int n = instance; n < m->nplugin && members < kGroup; ++n) {
    if (m->plugin[n] != m->plugin[instance]) continue;
    ++members;
    Drive* drive = Get(d, n);
    drive->Begin(m, d, n);
    if (drive->map_.many()) {
      // the table is in the cache from one pass to the next
      for (int pass = 0; pass < drive->passes_; ++pass) {
        drive->SumHarmonics(&drive->step_);
        drive->FinishSecant(&drive->step_);
        drive->Solve(pass, &drive->step_);
      }
      continue;
    }
    group[size++] = drive;
    passes = std::max(passes, drive->passes_);
  }
  for (int pass = 0; pass < passes; ++pass) {
    for (int k = 0; k < size; ++k) {
      if (pass < group[k]->passes_) group[k]->SumHarmonics(&group[k]->step_);
    }
    for (int k = 0; k < size; ++k) {
      if (pass >= group[k]->passes_) continue;
      group[k]->FinishSecant(&group[k]->step_);
      group[k]->Solve(pass, &group[k]->step_);
    }
  }
}

// Begins the prediction of a step.
void Drive::Begin(const mjModel* m, mjData* d, int instance) {
  const mjtNum h = m->opt.timestep;
  const Pair v = {d->qvel[v_rotor_], d->qvel[v_link_]};
  Vary(m);
  // the scheme is a midpoint rule for the positions of half a step earlier
  const Pair x = Pair{d->qpos[q_rotor_], d->qpos[q_link_]} - v * (0.5 * h);
  Start(h, x, v, Responses(m, d), Damping(m, d),
        d->plugin_state + m->plugin_stateadr[instance], &step_);
  predicted_ = true;
}

// Predicts the step of rotor and link and evaluates the discrete gradient over it. The
// engine adds the part that is linear in the velocity change through its metric
// M + h^2 p g g'. It builds this metric after this stage, from ten_J (the direction g)
// and from the tangent stiffness of the tendon's cubic spring at ten_length (p).
void Drive::AddScheme(const mjModel* m, mjData* d, int instance) {
  // the engine computes the instances in their order, so the first one of a group makes
  // the predictions anew
  if (leads_ || !predicted_) PredictGroup(m, d, instance);
  predicted_ = false;
  const mjtNum h = m->opt.timestep;
  const DriveValue& g = step_.value;
  const FrictionStep& rub = step_.friction;
  const mjtNum force = step_.force;
  mjtNum p = step_.metric;

  if (Diverges(d, {force, p, g.g[0], g.g[1], g.e[0], g.e[1], rub.force, rub.metric})) {
    return;
  }
  p = SetTangent(m, d, tendon_, p);
  // cancel the force -h p times the tendon velocity, which the engine adds along g
  const mjtNum shift = h * p * d->ten_velocity[tendon_];
  d->ten_J[entry_rotor_] = g.g[0];
  d->ten_J[entry_link_] = g.g[1];
  AddTorque(d, (g.g * (force - shift) + g.e) * -1);
  if (friction_) {
    // the same for friction along b, through the second term of the metric
    step_.friction.metric = SetTangent(m, d, friction_tendon_, rub.metric);
    const mjtNum rubs = rub.force - h * rub.metric * d->ten_velocity[friction_tendon_];
    AddTorque(d, friction_->b() * -rubs);
  }

  step_.scheme = true;
  step_.metric = p;
}

void Drive::Advance(const mjModel* m, mjData* d, int instance) {
  Vary(m);  // a copied mjData may complete a step that it has not begun
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  const Pair q = {d->qpos[q_rotor_], d->qpos[q_link_]};
  const Pair v = {d->qvel[v_rotor_], d->qvel[v_link_]};
  Finish(m->opt.timestep, q, v, &step_, state);
  std::replace_if(
      state, state + m->plugin_statenum[instance],
      [](mjtNum x) { return !std::isfinite(x); }, 0.0);
}

void Drive::RegisterPlugin() {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = kName;
  plugin.capabilityflags |= mjPLUGIN_PASSIVE;
  plugin.nattribute = kCount;
  plugin.attributes = kAttributes;
  plugin.nstate = CountStates;
  plugin.init = +[](const mjModel* m, mjData* d, int instance) {
    auto drive = Drive::Create(m, instance);
    if (!drive) return -1;
    d->plugin_data[instance] = reinterpret_cast<uintptr_t>(drive.release());
    return 0;
  };
  plugin.destroy = +[](mjData* d, int instance) {
    delete Get(d, instance);
    d->plugin_data[instance] = 0;
  };
  plugin.copy = +[](mjData* dest, const mjModel* m, const mjData* src, int instance) {
    // a copy made between Compute and Advance must have the data that Advance needs
    const Drive* from = Get(src, instance);
    if (dest == src || !from) return;
    if (!Get(dest, instance) || Get(dest, instance) == from) {
      // new data; Create may reject a model that was edited after compilation
      auto drive = Drive::Create(m, instance);
      if (!drive) drive = std::make_unique<Drive>(*from);
      dest->plugin_data[instance] = reinterpret_cast<uintptr_t>(drive.release());
    }
    Get(dest, instance)->Continue(*from);
  };
  plugin.reset = +[](const mjModel* m, mjtNum* state, void* data, int instance) {
    mju_zero(state, m->plugin_statenum[instance]);
    if (data) static_cast<Drive*>(data)->Forget();
  };
  plugin.compute = +[](const mjModel* m, mjData* d, int instance, int) {
    Get(d, instance)->Compute(m, d, instance);
  };
  plugin.advance = +[](const mjModel* m, mjData* d, int instance) {
    Get(d, instance)->Advance(m, d, instance);
  };
  mjp_registerPlugin(&plugin);
}

}  // namespace swgjoint
