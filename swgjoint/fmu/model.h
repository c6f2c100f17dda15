// A drive between a rotor and a load that both turn about fixed axes, for the FMU.
#ifndef SWGJOINT_FMU_MODEL_H_
#define SWGJOINT_FMU_MODEL_H_

#include <array>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "../plugin/law.h"

namespace swgjoint {

// Value references of the variables, in both versions of FMI; see drives/fmu_variables.py.
enum Variable : unsigned {
  kTime = 0,
  kMotorTorque = 1,
  kLoadTorque = 2,
  kStates = 3,        // motor_angle, output_angle, motor_speed, output_speed
  kDerivatives = 7,   // of the states, in the same order
  kTorsion = 11,
  kTransmissionError = 12,
  kOutputTorque = 13,
  kInputTorque = 14,
  kFrictionTorque = 15,
  kParameters = 20,   // see Parameter in model.cc
  kFriction = 40,     // seven numbers of the law
  kHysteresis = 100,  // stiffness and yield torque of each element
};

class FmuModel : private Law {
 public:
  static constexpr int kOrder = 4;  // number of continuous states

  // Reads "key value" lines. Returns what is wrong, or an empty string.
  std::string Load(const std::string& text);
  const std::string& token() const { return text_.at("token"); }

  // Value of a variable by reference; returns false if there is none, or it may not be
  // set.
  bool Get(unsigned reference, double* value);
  bool Set(unsigned reference, double value);

  // Ends the initialisation: applies the parameters, which are fixed from then on.
  // Returns what is wrong, or an empty string.
  std::string Start();

  // Advances by a communication step of the scheme, with constant torques. Returns false
  // if a number is no longer finite.
  bool Step(double size);

  // For model exchange.
  void Derivatives(double out[kOrder]);
  void Complete();
  std::array<double, kOrder>& states() { return states_; }
  double& time() { return time_; }
  void Simulate(bool by_steps) { by_steps_ = by_steps; }

 private:
  Pair position() const { return Pair{states_[0], states_[1]}; }
  Pair speed() const { return Pair{states_[2], states_[3]}; }
  // Torques of the drive on rotor and load, and of friction along its rotation.
  Pair Torques(double* rubs, double* torsion);
  double* Number(unsigned reference);
  std::string Apply();

  std::map<std::string, std::string> text_;
  std::array<double, kOrder> states_ = {};
  std::array<double, 10> numbers_ = {};      // parameters
  std::array<double, 7> friction_numbers_ = {};
  std::vector<double> elements_;             // stiffness, yield torque, ..
  std::vector<double> memory_, workspace_;   // states of the law, as in the plugin
  double motor_torque_ = 0, load_torque_ = 0, time_ = 0;
  bool by_steps_ = false, started_ = false;
  Law::Step step_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_FMU_MODEL_H_
