// Functions of FMI 3.0 for model exchange and co-simulation.
#include "fmi/fmi3Functions.h"
#include "instance.h"

using swgjoint::FmuModel;
using swgjoint::Instance;

namespace {

Instance* Of(fmi3Instance c) { return static_cast<Instance*>(c); }
fmi3Status Status(bool ok) { return ok ? fmi3OK : fmi3Error; }

fmi3Instance Make(fmi3String token, fmi3String path, bool by_steps,
                  fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
  const auto tell = [=](const std::string& text) {
    if (log) log(environment, fmi3Error, "logStatusError", text.c_str());
  };
  return Instance::Make(path ? path : "", token, by_steps, tell).release();
}

}  // namespace

const char* fmi3GetVersion() { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance, fmi3Boolean, size_t, const fmi3String[]) {
  return fmi3OK;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String, fmi3String token, fmi3String path,
                                          fmi3Boolean, fmi3Boolean,
                                          fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
  return Make(token, path, false, environment, log);
}
fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String, fmi3String token, fmi3String path, fmi3Boolean, fmi3Boolean, fmi3Boolean,
    fmi3Boolean, const fmi3ValueReference[], size_t, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback) {
  return Make(token, path, true, environment, log);
}
fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean, fmi3InstanceEnvironment,
    fmi3LogMessageCallback, fmi3ClockUpdateCallback, fmi3LockPreemptionCallback,
    fmi3UnlockPreemptionCallback) {
  return nullptr;
}
void fmi3FreeInstance(fmi3Instance c) { delete Of(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean, fmi3Float64,
                                       fmi3Float64 start, fmi3Boolean, fmi3Float64) {
  Of(c)->model.time() = start;
  return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return Status(Of(c)->Start()); }
fmi3Status fmi3EnterEventMode(fmi3Instance) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance) { return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance c) {
  Of(c)->model = Of(c)->fresh;
  return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                          fmi3Float64 values[], size_t count) {
  return Status(n == count && Of(c)->Get(vr, n, values));
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                          const fmi3Float64 values[], size_t count) {
  return Status(n == count && Of(c)->Set(vr, n, values));
}

// there are no variables of other types
#define SWGJOINT_NO_VARIABLES(Type)                                                  \
  fmi3Status fmi3Get##Type(fmi3Instance, const fmi3ValueReference[], size_t n,       \
                           fmi3##Type[], size_t) {                                   \
    return Status(n == 0);                                                           \
  }                                                                                  \
  fmi3Status fmi3Set##Type(fmi3Instance, const fmi3ValueReference[], size_t n,       \
                           const fmi3##Type[], size_t) {                             \
    return Status(n == 0);                                                           \
  }
SWGJOINT_NO_VARIABLES(Float32)
SWGJOINT_NO_VARIABLES(Int8)
SWGJOINT_NO_VARIABLES(UInt8)
SWGJOINT_NO_VARIABLES(Int16)
SWGJOINT_NO_VARIABLES(UInt16)
SWGJOINT_NO_VARIABLES(Int32)
SWGJOINT_NO_VARIABLES(UInt32)
SWGJOINT_NO_VARIABLES(Int64)
SWGJOINT_NO_VARIABLES(UInt64)
SWGJOINT_NO_VARIABLES(Boolean)
SWGJOINT_NO_VARIABLES(String)
fmi3Status fmi3GetBinary(fmi3Instance, const fmi3ValueReference[], size_t n, size_t[],
                         fmi3Binary[], size_t) {
  return Status(n == 0);
}
fmi3Status fmi3SetBinary(fmi3Instance, const fmi3ValueReference[], size_t n,
                         const size_t[], const fmi3Binary[], size_t) {
  return Status(n == 0);
}
fmi3Status fmi3GetClock(fmi3Instance, const fmi3ValueReference[], size_t n, fmi3Clock[]) {
  return Status(n == 0);
}
fmi3Status fmi3SetClock(fmi3Instance, const fmi3ValueReference[], size_t n,
                        const fmi3Clock[]) {
  return Status(n == 0);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance, fmi3ValueReference,
                                               size_t*) {
  return fmi3Error;
}
fmi3Status fmi3GetVariableDependencies(fmi3Instance, fmi3ValueReference, size_t[],
                                       fmi3ValueReference[], size_t[],
                                       fmi3DependencyKind[], size_t) {
  return fmi3Error;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState* state) {
  if (*state) {
    *static_cast<FmuModel*>(*state) = Of(c)->model;
  } else {
    *state = new FmuModel(Of(c)->model);
  }
  return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  Of(c)->model = *static_cast<FmuModel*>(state);
  return fmi3OK;
}
fmi3Status fmi3FreeFMUState(fmi3Instance, fmi3FMUState* state) {
  delete static_cast<FmuModel*>(*state);
  *state = nullptr;
  return fmi3OK;
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance, fmi3FMUState, size_t*) {
  return fmi3Error;
}
fmi3Status fmi3SerializeFMUState(fmi3Instance, fmi3FMUState, fmi3Byte[], size_t) {
  return fmi3Error;
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance, const fmi3Byte[], size_t,
                                   fmi3FMUState*) {
  return fmi3Error;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance, const fmi3ValueReference[], size_t,
                                        const fmi3ValueReference[], size_t,
                                        const fmi3Float64[], size_t, fmi3Float64[],
                                        size_t) {
  return fmi3Error;
}
fmi3Status fmi3GetAdjointDerivative(fmi3Instance, const fmi3ValueReference[], size_t,
                                    const fmi3ValueReference[], size_t,
                                    const fmi3Float64[], size_t, fmi3Float64[], size_t) {
  return fmi3Error;
}
fmi3Status fmi3EnterConfigurationMode(fmi3Instance) { return fmi3OK; }
fmi3Status fmi3ExitConfigurationMode(fmi3Instance) { return fmi3OK; }

// there are no clocks
fmi3Status fmi3GetIntervalDecimal(fmi3Instance, const fmi3ValueReference[], size_t,
                                  fmi3Float64[], fmi3IntervalQualifier[]) {
  return fmi3Error;
}
fmi3Status fmi3GetIntervalFraction(fmi3Instance, const fmi3ValueReference[], size_t,
                                   fmi3UInt64[], fmi3UInt64[], fmi3IntervalQualifier[]) {
  return fmi3Error;
}
fmi3Status fmi3GetShiftDecimal(fmi3Instance, const fmi3ValueReference[], size_t,
                               fmi3Float64[]) {
  return fmi3Error;
}
fmi3Status fmi3GetShiftFraction(fmi3Instance, const fmi3ValueReference[], size_t,
                                fmi3UInt64[], fmi3UInt64[]) {
  return fmi3Error;
}
fmi3Status fmi3SetIntervalDecimal(fmi3Instance, const fmi3ValueReference[], size_t,
                                  const fmi3Float64[]) {
  return fmi3Error;
}
fmi3Status fmi3SetIntervalFraction(fmi3Instance, const fmi3ValueReference[], size_t,
                                   const fmi3UInt64[], const fmi3UInt64[]) {
  return fmi3Error;
}
fmi3Status fmi3SetShiftDecimal(fmi3Instance, const fmi3ValueReference[], size_t,
                               const fmi3Float64[]) {
  return fmi3Error;
}
fmi3Status fmi3SetShiftFraction(fmi3Instance, const fmi3ValueReference[], size_t,
                                const fmi3UInt64[], const fmi3UInt64[]) {
  return fmi3Error;
}

// Model exchange; there are no events.
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance) { return fmi3OK; }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance, fmi3Boolean* update,
                                    fmi3Boolean* terminate, fmi3Boolean* nominals,
                                    fmi3Boolean* values, fmi3Boolean* next,
                                    fmi3Float64* time) {
  for (fmi3Boolean* flag : {update, terminate, nominals, values, next}) {
    if (flag) *flag = fmi3False;
  }
  if (time) *time = 0;
  return fmi3OK;
}
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance) { return fmi3OK; }
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean, fmi3Boolean* event,
                                       fmi3Boolean* terminate) {
  Of(c)->model.Complete();
  *event = *terminate = fmi3False;
  return fmi3OK;
}
fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
  Of(c)->model.time() = time;
  return fmi3OK;
}
fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) {
  if (n != FmuModel::kOrder) return fmi3Error;
  std::copy(x, x + n, Of(c)->model.states().begin());
  return fmi3OK;
}
fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
  if (n != FmuModel::kOrder) return fmi3Error;
  std::copy_n(Of(c)->model.states().begin(), n, x);
  return fmi3OK;
}
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 out[],
                                             size_t n) {
  if (n != FmuModel::kOrder) return fmi3Error;
  Of(c)->model.Derivatives(out);
  return fmi3OK;
}
fmi3Status fmi3GetEventIndicators(fmi3Instance, fmi3Float64[], size_t n) {
  return Status(n == 0);
}
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance, fmi3Float64 out[], size_t n) {
  std::fill(out, out + n, 1.0);
  return Status(n == FmuModel::kOrder);
}
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance, size_t* n) {
  *n = 0;
  return fmi3OK;
}
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance, size_t* n) {
  *n = FmuModel::kOrder;
  return fmi3OK;
}

// Co-simulation.
fmi3Status fmi3EnterStepMode(fmi3Instance) { return fmi3OK; }
fmi3Status fmi3GetOutputDerivatives(fmi3Instance, const fmi3ValueReference[], size_t n,
                                    const fmi3Int32[], fmi3Float64[], size_t) {
  return Status(n == 0);
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 size, fmi3Boolean,
                      fmi3Boolean* event, fmi3Boolean* terminate, fmi3Boolean* early,
                      fmi3Float64* last) {
  for (fmi3Boolean* flag : {event, terminate, early}) {
    if (flag) *flag = fmi3False;
  }
  const bool ok = Of(c)->Step(time, size);
  if (last) *last = Of(c)->model.time();
  return Status(ok);
}
fmi3Status fmi3ActivateModelPartition(fmi3Instance, fmi3ValueReference, fmi3Float64) {
  return fmi3Error;
}
