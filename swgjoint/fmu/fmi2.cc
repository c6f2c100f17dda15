// Functions of FMI 2.0 for model exchange and co-simulation.
#include <cstdlib>
#include <cstring>

#include "fmi/fmi2Functions.h"
#include "instance.h"

using swgjoint::FmuModel;
using swgjoint::Instance;

namespace {

Instance* Of(fmi2Component c) { return static_cast<Instance*>(c); }
fmi2Status Status(bool ok) { return ok ? fmi2OK : fmi2Error; }

// Path of a URI with the scheme file, or the text itself.
std::string PathOf(const char* location) {
  std::string text = location ? location : "";
  for (const char* start : {"file://localhost", "file://", "file:"}) {
    if (text.rfind(start, 0) == 0) {
      text.erase(0, std::strlen(start));
      break;
    }
  }
  std::string path;
  for (size_t k = 0; k < text.size(); ++k) {
    if (text[k] == '%' && k + 2 < text.size()) {
      path += static_cast<char>(std::strtol(text.substr(k + 1, 2).c_str(), nullptr, 16));
      k += 2;
    } else {
      path += text[k];
    }
  }
  return path;
}

}  // namespace

const char* fmi2GetTypesPlatform() { return fmi2TypesPlatform; }
const char* fmi2GetVersion() { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component, fmi2Boolean, size_t, const fmi2String[]) {
  return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                              fmi2String location,
                              const fmi2CallbackFunctions* functions, fmi2Boolean,
                              fmi2Boolean) {
  const std::string own = name ? name : "";
  const auto logger = functions ? functions->logger : nullptr;
  void* environment = functions ? functions->componentEnvironment : nullptr;
  const auto tell = [=](const std::string& text) {
    if (!logger) return;
    logger(environment, own.c_str(), fmi2Error, "logStatusError", "%s", text.c_str());
  };
  return Instance::Make(PathOf(location), guid, type == fmi2CoSimulation, tell).release();
}

void fmi2FreeInstance(fmi2Component c) { delete Of(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean, fmi2Real, fmi2Real start,
                               fmi2Boolean, fmi2Real) {
  Of(c)->model.time() = start;
  return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return Status(Of(c)->Start()); }
fmi2Status fmi2Terminate(fmi2Component) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) {
  Of(c)->model = Of(c)->fresh;
  return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                       fmi2Real value[]) {
  return Status(Of(c)->Get(vr, n, value));
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                       const fmi2Real value[]) {
  return Status(Of(c)->Set(vr, n, value));
}

// there are no variables of other types
#define SWGJOINT_NO_VARIABLES(Type)                                                  \
  fmi2Status fmi2Get##Type(fmi2Component, const fmi2ValueReference[], size_t n,      \
                           fmi2##Type[]) {                                           \
    return Status(n == 0);                                                           \
  }                                                                                  \
  fmi2Status fmi2Set##Type(fmi2Component, const fmi2ValueReference[], size_t n,      \
                           const fmi2##Type[]) {                                     \
    return Status(n == 0);                                                           \
  }
SWGJOINT_NO_VARIABLES(Integer)
SWGJOINT_NO_VARIABLES(Boolean)
SWGJOINT_NO_VARIABLES(String)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate* state) {
  if (*state) {
    *static_cast<FmuModel*>(*state) = Of(c)->model;
  } else {
    *state = new FmuModel(Of(c)->model);
  }
  return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  Of(c)->model = *static_cast<FmuModel*>(state);
  return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component, fmi2FMUstate* state) {
  delete static_cast<FmuModel*>(*state);
  *state = nullptr;
  return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component, fmi2FMUstate, size_t*) {
  return fmi2Error;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component, fmi2FMUstate, fmi2Byte[], size_t) {
  return fmi2Error;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component, const fmi2Byte[], size_t,
                                   fmi2FMUstate*) {
  return fmi2Error;
}
fmi2Status fmi2GetDirectionalDerivative(fmi2Component, const fmi2ValueReference[], size_t,
                                        const fmi2ValueReference[], size_t,
                                        const fmi2Real[], fmi2Real[]) {
  return fmi2Error;
}

// Model exchange; there are no events.
fmi2Status fmi2EnterEventMode(fmi2Component) { return fmi2OK; }
fmi2Status fmi2NewDiscreteStates(fmi2Component, fmi2EventInfo* info) {
  *info = fmi2EventInfo();
  return fmi2OK;
}
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component) { return fmi2OK; }
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean, fmi2Boolean* event,
                                       fmi2Boolean* terminate) {
  Of(c)->model.Complete();
  *event = *terminate = fmi2False;
  return fmi2OK;
}
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
  Of(c)->model.time() = time;
  return fmi2OK;
}
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
  if (n != FmuModel::kOrder) return fmi2Error;
  std::copy(x, x + n, Of(c)->model.states().begin());
  return fmi2OK;
}
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
  if (n != FmuModel::kOrder) return fmi2Error;
  std::copy_n(Of(c)->model.states().begin(), n, x);
  return fmi2OK;
}
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real out[], size_t n) {
  if (n != FmuModel::kOrder) return fmi2Error;
  Of(c)->model.Derivatives(out);
  return fmi2OK;
}
fmi2Status fmi2GetEventIndicators(fmi2Component, fmi2Real[], size_t n) {
  return Status(n == 0);
}
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component, fmi2Real out[], size_t n) {
  std::fill(out, out + n, 1.0);
  return Status(n == FmuModel::kOrder);
}

// Co-simulation.
fmi2Status fmi2SetRealInputDerivatives(fmi2Component, const fmi2ValueReference[], size_t n,
                                       const fmi2Integer[], const fmi2Real[]) {
  return Status(n == 0);
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component, const fmi2ValueReference[],
                                        size_t n, const fmi2Integer[], fmi2Real[]) {
  return Status(n == 0);
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean) {
  return Status(Of(c)->Step(time, size));
}
fmi2Status fmi2CancelStep(fmi2Component) { return fmi2Error; }
fmi2Status fmi2GetStatus(fmi2Component, const fmi2StatusKind, fmi2Status*) {
  return fmi2Discard;
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real* value) {
  if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = Of(c)->model.time();
  return fmi2OK;
}
fmi2Status fmi2GetIntegerStatus(fmi2Component, const fmi2StatusKind, fmi2Integer*) {
  return fmi2Discard;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component, const fmi2StatusKind, fmi2Boolean* value) {
  *value = fmi2False;
  return fmi2OK;
}
fmi2Status fmi2GetStringStatus(fmi2Component, const fmi2StatusKind, fmi2String*) {
  return fmi2Discard;
}
