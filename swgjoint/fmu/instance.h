// An instance of the FMU, for both versions of FMI.
#ifndef SWGJOINT_FMU_INSTANCE_H_
#define SWGJOINT_FMU_INSTANCE_H_

#include <fstream>
#include <functional>
#include <memory>
#include <sstream>
#include <string>

#include "model.h"

namespace swgjoint {

struct Instance {
  FmuModel model, fresh;  // the model, and as it was before any value was set
  std::function<void(const std::string&)> tell;
  bool by_steps = false;

  // Reads `folder`/drive.txt. If it is missing, invalid, or of another FMU, tells why
  // and returns null.
  static std::unique_ptr<Instance> Make(
      const std::string& folder, const char* token, bool by_steps,
      const std::function<void(const std::string&)>& tell) {
    auto made = std::make_unique<Instance>();
    made->tell = tell;
    made->by_steps = by_steps;
    std::ifstream file(folder + "/drive.txt");
    std::stringstream text;
    text << file.rdbuf();
    std::string fault = file ? made->fresh.Load(text.str()) : "cannot be read";
    if (fault.empty() && (!token || made->fresh.token() != token)) {
      fault = "belongs to another FMU";
    }
    if (!fault.empty()) {
      tell(folder + "/drive.txt: " + fault);
      return nullptr;
    }
    made->fresh.Simulate(by_steps);
    made->model = made->fresh;
    return made;
  }

  bool Start() {
    const std::string fault = model.Start();
    if (!fault.empty()) tell(fault);
    return fault.empty();
  }

  bool Get(const unsigned* reference, size_t count, double* value) {
    for (size_t k = 0; k < count; ++k) {
      if (!model.Get(reference[k], value + k)) {
        tell("no value of variable " + std::to_string(reference[k]));
        return false;
      }
    }
    return true;
  }

  bool Set(const unsigned* reference, size_t count, const double* value) {
    for (size_t k = 0; k < count; ++k) {
      if (!model.Set(reference[k], value[k])) {
        tell("variable " + std::to_string(reference[k]) + " cannot be set to " +
             std::to_string(value[k]) + " now");
        return false;
      }
    }
    return true;
  }

  bool Step(double time, double size) {
    if (!(size > 0) || !by_steps) {
      tell("a communication step must be > 0");
      return false;
    }
    model.time() = time;
    if (model.Step(size)) return true;
    tell("the motion diverged");
    return false;
  }
};

}  // namespace swgjoint

#endif  // SWGJOINT_FMU_INSTANCE_H_
