#include "drive.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace swgjoint {
namespace {

constexpr char kName[] = "swgjoint.drive";
constexpr const char* kAttributes[] = {
    "ratio",           "orders",  "knots",             "potential", "end_stiffness",
    "kinematic_error", "damping", "numerical_damping", "passes", "hysteresis"};
constexpr int kAccelerations = 2;  // states before those of the hysteresis
constexpr size_t kMaxElements = 64;

Drive* Get(const mjData* d, int instance) {
  return reinterpret_cast<Drive*>(d->plugin_data[instance]);
}

std::unique_ptr<Drive> Refuse(const mjModel* m, int instance, const std::string& why) {
  const char* name = mj_id2name(m, mjOBJ_PLUGIN, instance);
  mju_warning("%s instance '%s': %s", kName, name ? name : "", why.c_str());
  return nullptr;
}

bool Scalar(const mjModel* m, int instance, const char* key, mjtNum low, mjtNum high,
            mjtNum* out) {
  std::vector<double> list;
  if (!ParseNumbers(mj_getPluginConfig(m, instance, key), &list)) return false;
  if (list.size() != 1 || list[0] < low || list[0] > high) return false;
  *out = list[0];
  return true;
}

// Stiffness and yield torque of every Jenkin element; an absent attribute has none.
bool Elements(const mjModel* m, int instance, std::vector<double>* list) {
  const char* text = mj_getPluginConfig(m, instance, "hysteresis");
  list->clear();
  if (!text || !*text) return true;
  if (!ParseNumbers(text, list) || list->size() % 2 ||
      list->size() > 2 * kMaxElements) {
    return false;
  }
  return std::all_of(list->begin(), list->end(), [](double x) { return x > 0; });
}

int CountStates(const mjModel* m, int instance) {
  std::vector<double> list;
  // a bad attribute is refused when the instance is made
  if (!Elements(m, instance, &list)) return kAccelerations;
  return kAccelerations + static_cast<int>(list.size() / 2);
}

}  // namespace

std::unique_ptr<Drive> Drive::Create(const mjModel* m, int instance) {
  auto drive = std::make_unique<Drive>();
  const auto text = [&](const char* key) {
    return mj_getPluginConfig(m, instance, key);
  };
  std::string error;
  if (!drive->map_.Parse({text("ratio"), text("orders"), text("knots"),
                          text("potential"), text("end_stiffness"),
                          text("kinematic_error")},
                         &error)) {
    return Refuse(m, instance, error);
  }
  if (!Scalar(m, instance, "damping", 0, mjMAXVAL, &drive->damping_)) {
    return Refuse(m, instance, "attribute 'damping' is not one number >= 0");
  }
  if (!Scalar(m, instance, "numerical_damping", 0, 1, &drive->numerical_damping_)) {
    return Refuse(m, instance, "attribute 'numerical_damping' is not in 0..1");
  }
  mjtNum passes;
  if (!Scalar(m, instance, "passes", 1, 20, &passes) || passes != std::rint(passes)) {
    return Refuse(m, instance, "attribute 'passes' is not an integer in 1..20");
  }
  drive->passes_ = static_cast<int>(passes);
  std::vector<double> elements;
  if (!Elements(m, instance, &elements)) {
    return Refuse(m, instance,
                  "attribute 'hysteresis' is not up to 64 pairs of numbers > 0");
  }
  for (size_t j = 0; j < elements.size(); j += 2) {
    drive->stiffness_.push_back(elements[j]);
    drive->reach_.push_back(elements[j + 1] / elements[j]);
  }
  drive->stretch_.assign(drive->reach_.size(), 0.0);

  // config strings get no prefix when a model is attached, names do: the tendon
  // has the name of the instance
  const char* name = mj_id2name(m, mjOBJ_PLUGIN, instance);
  const int t = name ? mj_name2id(m, mjOBJ_TENDON, name) : -1;
  if (t < 0) return Refuse(m, instance, "no tendon has the name of the instance");
  const int wrap = m->tendon_adr[t];
  if (m->tendon_num[t] != 2 || m->wrap_type[wrap] != mjWRAP_JOINT ||
      m->wrap_type[wrap + 1] != mjWRAP_JOINT) {
    return Refuse(m, instance, "its tendon does not join a rotor and a link joint");
  }
  const int rotor = m->wrap_objid[wrap], link = m->wrap_objid[wrap + 1];
  // XML keeps six digits of a coefficient; nothing below is computed from it
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
  const int row = m->ten_J_rowadr[t];
  for (int j = row; j < row + m->ten_J_rownnz[t]; ++j) {
    if (m->ten_J_colind[j] == drive->v_rotor_) drive->entry_rotor_ = j;
    if (m->ten_J_colind[j] == drive->v_link_) drive->entry_link_ = j;
  }
  if (drive->entry_rotor_ < 0 || drive->entry_link_ < 0) {
    return Refuse(m, instance, "its joints are missing in the tendon's Jacobian");
  }
  return drive;
}

void Drive::Compute(const mjModel* m, mjData* d, int instance) {
  step_.scheme = step_.gradient = false;
  // without springs the engine leaves the tendon out of its metric, too
  if (m->opt.disableflags & mjDSBL_SPRING) return;

  // take the native spring of the tendon out again, as the engine applied it
  const mjtNum x = d->ten_length[tendon_];
  const mjtNum native = x * (m->tendon_stiffness[tendon_] +
                             x * x * m->tendon_stiffnesspoly[mjNPOLY * tendon_ + 1]);
  d->qfrc_passive[v_rotor_] += native * d->ten_J[entry_rotor_];
  d->qfrc_passive[v_link_] += native * d->ten_J[entry_link_];

  // PGS solves without the tendon part of the metric
  if (m->opt.integrator == mjINT_DISCRETE && m->opt.solver != mjSOL_PGS) {
    AddScheme(m, d, instance);
  } else {
    AddGradient(m, d, instance);
  }
}

// Stretch of every element at the torsion where the map begins: it slips to reach it.
void Drive::Place(const mjtNum* rest) {
  for (size_t j = 0; j < reach_.size(); ++j) {
    stretch_[j] = std::clamp(map_.torsion() - rest[j], -reach_[j], reach_[j]);
  }
}

// Adds the elements over a change of the torsion: the mean of their torque along it,
// so that their work is exact, and how that mean grows with the change. An element
// sticks for the part f of the way.
void Drive::Slip(mjtNum change, DriveValue* value) const {
  for (size_t j = 0; j < reach_.size(); ++j) {
    const mjtNum k = stiffness_[j], begin = stretch_[j], free = begin + change;
    const mjtNum end = std::clamp(free, -reach_[j], reach_[j]);
    const mjtNum f = end == free ? 1 : (end - begin) / change;
    value->torque += k * (0.5 * (begin + end) * f + end * (1 - f));
    value->slope += 0.5 * k * f * f;
    value->stiffness_begin += k * f;
    value->stiffness_end += k * f;
  }
}

void Drive::AddGradient(const mjModel* m, mjData* d, int instance) {
  DriveValue value;
  map_.Gradient(d->qpos[q_rotor_], d->qpos[q_link_], &value);
  Place(d->plugin_state + m->plugin_stateadr[instance] + kAccelerations);
  Slip(0, &value);
  step_.gradient = true;
  const mjtNum damping = m->opt.disableflags & mjDSBL_DAMPER ? 0 : damping_;
  const mjtNum rate =
      value.g_theta * d->qvel[v_rotor_] + value.g_psi * d->qvel[v_link_];
  const mjtNum force = value.torque + damping * rate;
  d->qfrc_passive[v_rotor_] -= force * value.g_theta + value.e_theta;
  d->qfrc_passive[v_link_] -= force * value.g_psi + value.e_psi;
}

// Predicts the step of the pair, takes the discrete gradient over it and hands the
// rest, linear in the velocity step, to the engine: its metric M + h^2 p g g' is
// built after this stage from ten_J (the direction g) and from the tangent of the
// tendon's cubic spring at ten_length (the stiffness p).
void Drive::AddScheme(const mjModel* m, mjData* d, int instance) {
  const mjtNum h = m->opt.timestep;
  const mjtNum vm = d->qvel[v_rotor_], vl = d->qvel[v_link_];
  const mjtNum wm = d->qLDiagInv[v_rotor_], wl = d->qLDiagInv[v_link_];
  const mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  const mjtNum damping = m->opt.disableflags & mjDSBL_DAMPER ? 0 : damping_;

  // the scheme is a midpoint rule in positions half a step back
  map_.Begin(d->qpos[q_rotor_] - 0.5 * h * vm, d->qpos[q_link_] - 0.5 * h * vl);
  Place(state + kAccelerations);
  DriveValue& g = step_.value;
  mjtNum dm = 0, dl = 0, force = 0, p = 0;
  for (int pass = 0; pass < passes_; ++pass) {
    const mjtNum xm = h * (vm + 0.5 * dm), xl = h * (vl + 0.5 * dl);
    map_.Secant(xm, xl, &g);
    Slip(g.g_theta * xm + g.g_psi * xl, &g);
    const mjtNum k = std::max(0.0, 0.5 * (g.stiffness_begin + g.stiffness_end));
    const mjtNum w = g.g_theta * g.g_theta * wm + g.g_psi * g.g_psi * wl;
    const mjtNum ka = h * h * k * w;
    const mjtNum nu = numerical_damping_ * ka * ka / (16 + ka * ka);
    const mjtNum rate = g.g_theta * vm + g.g_psi * vl;
    const mjtNum predicted = g.g_theta * dm + g.g_psi * dl;
    force = g.torque - 0.5 * h * g.slope * predicted + (nu * k * h + damping) * rate;
    p = 0.5 * g.slope + 0.75 * nu * k + 0.5 * damping / h;
    if (pass + 1 == passes_) break;
    const mjtNum am = state[0] - wm * g.e_theta, al = state[1] - wl * g.e_psi;
    const mjtNum change = h * (g.g_theta * am + g.g_psi * al - w * force) /
                          (1 + h * h * w * p);
    const mjtNum f = force + h * p * change;
    dm = h * (am - wm * g.g_theta * f);
    dl = h * (al - wl * g.g_psi * f);
  }

  // length at which the cubic spring has the tangent p; 0 would leave the metric
  const mjtNum a = m->tendon_stiffness[tendon_];
  const mjtNum c = m->tendon_stiffnesspoly[mjNPOLY * tendon_ + 1];
  const mjtNum length = std::max(1e-12, std::sqrt(std::max(0.0, (p - a) / (3 * c))));
  p = a + 3 * c * length * length;

  // the engine will add -h p times the tendon's velocity along g: cancel it
  const mjtNum shift = h * p * d->ten_velocity[tendon_];
  d->ten_length[tendon_] = length;
  d->ten_J[entry_rotor_] = g.g_theta;
  d->ten_J[entry_link_] = g.g_psi;
  d->qfrc_passive[v_rotor_] -= (force - shift) * g.g_theta + g.e_theta;
  d->qfrc_passive[v_link_] -= (force - shift) * g.g_psi + g.e_psi;

  step_.scheme = true;
  step_.v_rotor = vm;
  step_.v_link = vl;
  step_.w_rotor = wm;
  step_.w_link = wl;
  step_.force = force;
  step_.metric = p;
  step_.torsion = map_.torsion();
}

void Drive::Advance(const mjModel* m, mjData* d, int instance) {
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  state[0] = state[1] = 0;
  // one path from the last torsion: its end decides where an element is relaxed. The
  // end of a step of the scheme is the beginning of the next and counts then; stages
  // of other integrators do not count at all.
  if (!reach_.empty() && (step_.scheme || step_.gradient)) {
    if (step_.gradient) {
      map_.Begin(d->qpos[q_rotor_], d->qpos[q_link_]);
      step_.torsion = map_.torsion();
    }
    mjtNum* rest = state + kAccelerations;
    for (size_t j = 0; j < reach_.size(); ++j) {
      rest[j] =
          std::clamp(rest[j], step_.torsion - reach_[j], step_.torsion + reach_[j]);
    }
  }
  if (!step_.scheme) return;
  const mjtNum h = m->opt.timestep;
  const DriveValue& g = step_.value;
  const mjtNum dm = d->qvel[v_rotor_] - step_.v_rotor;
  const mjtNum dl = d->qvel[v_link_] - step_.v_link;
  const mjtNum f = step_.force + h * step_.metric * (g.g_theta * dm + g.g_psi * dl);
  state[0] = dm / h + step_.w_rotor * (g.g_theta * f + g.e_theta);
  state[1] = dl / h + step_.w_link * (g.g_psi * f + g.e_psi);
}

void Drive::RegisterPlugin() {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = kName;
  plugin.capabilityflags |= mjPLUGIN_PASSIVE;
  plugin.nattribute = sizeof(kAttributes) / sizeof(kAttributes[0]);
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
  plugin.copy = +[](mjData* dest, const mjModel*, const mjData* src, int instance) {
    // a copy between the two halves of a step must carry what Advance needs
    if (dest == src || !Get(src, instance)) return;
    if (Get(dest, instance) && Get(dest, instance) != Get(src, instance)) {
      *Get(dest, instance) = *Get(src, instance);
    } else {
      dest->plugin_data[instance] =
          reinterpret_cast<uintptr_t>(new Drive(*Get(src, instance)));
    }
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
