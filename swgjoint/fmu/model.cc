#include "model.h"

#include <charconv>
#include <sstream>

namespace swgjoint {
namespace {

// Parameters from kParameters on, with the bounds of their values.
enum Parameter {
  kRotorInertia,
  kLoadInertia,
  kDamping,
  kNumericalDamping,
  kLargestStep,
  kDeviations,  // five numbers, see README.md of the plugin
};
struct Bound {
  const char* name;
  double low, high;
  bool above;  // whether the value must exceed low
};
constexpr double kMost = 1e10;
constexpr Bound kBounds[] = {
    {"rotor_inertia", 0, kMost, true},        {"load_inertia", 0, kMost, true},
    {"damping", 0, kMost, false},             {"numerical_damping", 0, 1, false},
    {"internal_step", 1e-7, kMost, false},        {"stiffness_deviation", -1, kMost, true},
    {"error_deviation", -kMost, kMost, false}, {"motor_angle_shift", -kMost, kMost, false},
    {"output_angle_shift", -kMost, kMost, false}, {"loss_deviation", -1, kMost, true}};
constexpr unsigned kRatio = kParameters + 10;
constexpr double kLeastMetric = 1e-9;  // as in the plugin, where the engine needs it

// All digits, with a decimal point whatever the locale of the simulator.
std::string Exact(double value) {
  char text[40];
  char* end = std::to_chars(text, text + sizeof text, value).ptr;
  return std::string(text, end) + " ";
}

}  // namespace

std::string FmuModel::Load(const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const size_t blank = line.find(' ');
    if (blank != std::string::npos) {
      text_[line.substr(0, blank)] = line.substr(blank + 1);
    }
  }
  const auto find = [&](const char* key) -> const char* {
    const auto found = text_.find(key);
    return found == text_.end() ? nullptr : found->second.c_str();
  };
  const std::string fault = Read(find);
  if (!fault.empty()) return fault;
  std::vector<double> list;
  if (!ParseNumbers(find("parameters"), &list) || list.size() != numbers_.size()) {
    return "the resource has no parameters";
  }
  std::copy(list.begin(), list.end(), numbers_.begin());
  if (find("friction")) {
    Friction law;
    if (!ParseNumbers(find("friction"), &list) || !law.Parse(list)) {
      return "attribute 'friction' is not valid";
    }
    std::copy(list.begin() + 2, list.end(), friction_numbers_.begin());
    friction_ = law;
  }
  // elements whose yield torque depends on the load have no numbers of their own
  if (find("hysteresis") && !find("yield_curve")) {
    ParseNumbers(find("hysteresis"), &elements_);
  }
  return text_.count("token") ? "" : "the resource has no token";
}

double* FmuModel::Number(unsigned reference) {
  const auto in = [&](unsigned first, size_t count) {
    return reference >= first && reference < first + count;
  };
  if (reference == kMotorTorque) return &motor_torque_;
  if (reference == kLoadTorque) return &load_torque_;
  if (in(kStates, states_.size())) return &states_[reference - kStates];
  if (in(kParameters, numbers_.size())) return &numbers_[reference - kParameters];
  if (friction_ && in(kFriction, friction_numbers_.size())) {
    return &friction_numbers_[reference - kFriction];
  }
  if (in(kHysteresis, elements_.size())) return &elements_[reference - kHysteresis];
  return nullptr;
}

bool FmuModel::Set(unsigned reference, double value) {
  // parameters are fixed; co-simulation computes the states itself
  const bool fixed = started_ && reference >= kStates;
  double* number = Number(reference);
  if (!number || fixed || !std::isfinite(value)) return false;
  *number = value;
  return true;
}

bool FmuModel::Get(unsigned reference, double* value) {
  if (const double* number = Number(reference)) {
    *value = *number;
    return true;
  }
  if (reference == kTime || reference == kRatio) {
    *value = reference == kTime ? time_ : map_.ratio();
    return true;
  }
  if (reference < kDerivatives || reference > kFrictionTorque) return false;
  if (!started_ && !Apply().empty()) return false;
  double rubs, torsion;
  if (reference < kTorsion) {
    double rates[kOrder];
    Derivatives(rates);
    *value = rates[reference - kDerivatives];
    return true;
  }
  const Pair torque = Torques(&rubs, &torsion);
  switch (reference) {
    case kTorsion: *value = torsion; break;
    case kTransmissionError: *value = states_[1] - states_[0] / map_.ratio(); break;
    case kOutputTorque: *value = torque[1]; break;
    case kInputTorque: *value = torque[0]; break;
    default: *value = rubs;
  }
  return true;
}

std::string FmuModel::Start() {
  const std::string fault = Apply();
  started_ = fault.empty();
  return fault;
}

// Applies the parameters and forgets the history.
std::string FmuModel::Apply() {
  for (size_t k = 0; k < numbers_.size(); ++k) {
    const Bound& bound = kBounds[k];
    const double x = numbers_[k];
    if (x < bound.low || x > bound.high || (bound.above && x == bound.low)) {
      return std::string(bound.name) + " = " + Exact(x) + "is out of range";
    }
  }
  if (friction_) {
    const Pair b = friction_->b();
    std::vector<double> list = {b[0], b[1]};
    list.insert(list.end(), friction_numbers_.begin(), friction_numbers_.end());
    Friction law;
    if (!law.Parse(list)) return "friction: a number is out of range";
    friction_ = law;
  }
  if (!elements_.empty()) {
    std::string list;
    for (double number : elements_) list += Exact(number);
    if (const char* fault = hysteresis_.Parse(list.c_str(), nullptr)) return fault;
  }
  damping_ = numbers_[kDamping];
  numerical_damping_ = numbers_[kNumericalDamping];
  Deviate(&numbers_[kDeviations]);
  memory_.assign(Law::states(), 0.0);
  step_ = Law::Step();
  return "";
}

Pair FmuModel::Torques(double* rubs, double* torsion) {
  workspace_ = memory_;
  const Pair q = position(), v = speed();
  if (by_steps_ && Limit(workspace_.data())) {
    // in the scheme, the slip of the last step is not yet in the memory
    map_.Begin(q[0], q[1]);
    const double* limit = Limit(workspace_.data());
    double* rest = workspace_.data() + kAccelerations;
    for (size_t j = 0; j < hysteresis_.size(); ++j) {
      if (limit[j] <= 0) continue;
      rest[j] = std::clamp(rest[j], map_.torsion() - limit[j],
                           map_.torsion() + limit[j]);
    }
  }
  DriveValue value;
  Evaluate(q, v, workspace_.data(), &value, rubs);
  *torsion = map_.torsion();
  const double force = value.torque + damping_ * Dot(value.g, v);
  Pair torque = (value.g * force + value.e) * -1;
  if (friction_) torque += friction_->b() * -*rubs;
  return torque;
}

void FmuModel::Derivatives(double out[kOrder]) {
  double rubs, torsion;
  const Pair torque = Torques(&rubs, &torsion);
  out[0] = states_[2];
  out[1] = states_[3];
  out[2] = (motor_torque_ + torque[0]) / numbers_[kRotorInertia];
  out[3] = (load_torque_ + torque[1]) / numbers_[kLoadInertia];
}

void FmuModel::Complete() {
  step_.gradient = true;
  Finish(1, position(), speed(), &step_, memory_.data());
}

bool FmuModel::Step(double size) {
  const double count = std::ceil(size / numbers_[kLargestStep] * (1 - 1e-12));
  const double n = std::max(1.0, count), h = size / n;
  const Pair weight = {1 / numbers_[kRotorInertia], 1 / numbers_[kLoadInertia]};
  const Pair applied = {motor_torque_, load_torque_};
  for (double k = 0; k < n; ++k) {
    const Pair x = position(), v = speed();
    Predict(h, x, v, weight, damping_, memory_.data(), &step_);
    const DriveValue& g = step_.value;
    const double p = step_.metric = std::max(step_.metric, kLeastMetric);
    // (M + h^2 (p g g' + p_b b b')) dv = h f
    Pair force = applied - (g.g * step_.force + g.e);
    double a = 1 / weight[0] + h * h * p * g.g[0] * g.g[0];
    double b = h * h * p * g.g[0] * g.g[1];
    double c = 1 / weight[1] + h * h * p * g.g[1] * g.g[1];
    if (friction_) {
      const Pair along = friction_->b();
      const double q = step_.friction.metric;
      force -= along * step_.friction.force;
      a += h * h * q * along[0] * along[0];
      b += h * h * q * along[0] * along[1];
      c += h * h * q * along[1] * along[1];
    }
    const double det = a * c - b * b;
    const Pair dv = Pair{c * force[0] - b * force[1], a * force[1] - b * force[0]} *
                    (h / det);
    const Pair end = v + dv, to = x + (v + end) * (0.5 * h);
    states_ = {to[0], to[1], end[0], end[1]};
    for (double number : states_) {
      if (!std::isfinite(number)) return false;
    }
    step_.scheme = true;
    Finish(h, to, end, &step_, memory_.data());
  }
  time_ += size;
  return true;
}

}  // namespace swgjoint
