/* A vehicle in the plane for co-simulation by FMI 2.0: an actuator with a lag drives a mass against drag.
 *
 *   f' = (m u - f) / lag,  v' = (f - drag |v| v) / m,  x' = v     in each of two coordinates; f = m u without a lag
 *
 * u is held over a communication step, as FMI has it without input derivatives. Heun's method, steps of 0.1 ms.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { U = 0, X = 2, V = 4, F = 6, MASS = 8, DRAG, LAG, X0, VARIABLES = X0 + 2 };

typedef struct {
  fmi2Real value[VARIABLES];
} Vehicle;

static void rates(const fmi2Real value[], const fmi2Real state[], fmi2Real rate[]) {
  const fmi2Real m = value[MASS];
  for (int l = 0; l < 2; ++l) {
    const fmi2Real x_rate = state[2 + l];
    const fmi2Real force = value[LAG] > 0.0 ? state[4 + l] : m * value[U + l];
    rate[l] = x_rate;
    rate[2 + l] = (force - value[DRAG] * fabs(x_rate) * x_rate) / m;
    rate[4 + l] = value[LAG] > 0.0 ? (m * value[U + l] - state[4 + l]) / value[LAG] : 0.0;
  }
}

static void start(Vehicle* vehicle) {
  static const fmi2Real values[VARIABLES] = {[MASS] = 2.0, [DRAG] = 0.8, [LAG] = 0.02, [X + 1] = -8.0, [X0 + 1] = -8.0};
  memcpy(vehicle->value, values, sizeof values);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions* functions, fmi2Boolean visible, fmi2Boolean logging) {
  (void)name, (void)guid, (void)resources, (void)functions, (void)visible, (void)logging;
  Vehicle* vehicle = type == fmi2CoSimulation ? malloc(sizeof *vehicle) : NULL;
  if (vehicle) start(vehicle);
  return vehicle;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2Reset(fmi2Component c) {
  start(c);
  return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
  Vehicle* vehicle = c;
  for (size_t k = 0; k < n; ++k) {
    if (vr[k] >= VARIABLES) return fmi2Error;
    vehicle->value[vr[k]] = value[k];
    if (vr[k] >= X0) vehicle->value[X + vr[k] - X0] = value[k];
  }
  return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
  const Vehicle* vehicle = c;
  for (size_t k = 0; k < n; ++k) {
    if (vr[k] >= VARIABLES) return fmi2Error;
    value[k] = vehicle->value[vr[k]];
  }
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean no_set) {
  (void)time, (void)no_set;
  fmi2Real* value = ((Vehicle*)c)->value;
  const int steps = (int)ceil(h / 1e-4 - 1e-9);
  const fmi2Real dt = h / steps;
  fmi2Real first[6], second[6], state[6];
  for (int k = 0; k < steps; ++k) {
    rates(value, value + X, first);
    for (int j = 0; j < 6; ++j) state[j] = value[X + j] + dt * first[j];
    rates(value, state, second);
    for (int j = 0; j < 6; ++j) value[X + j] += 0.5 * dt * (first[j] + second[j]);
  }
  return fmi2OK;
}

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char* fmi2GetVersion(void) { return fmi2Version; }

/* What there is nothing to do for, and what a vehicle does not have. */
#define EMPTY(name, ...) \
  fmi2Status name(fmi2Component c, ##__VA_ARGS__) { return (void)c, fmi2OK; }
#define ABSENT(name, ...) \
  fmi2Status name(fmi2Component c, ##__VA_ARGS__) { return (void)c, fmi2Error; }
#pragma GCC diagnostic ignored "-Wunused-parameter"

EMPTY(fmi2SetDebugLogging, fmi2Boolean on, size_t n, const fmi2String categories[])
EMPTY(fmi2SetupExperiment, fmi2Boolean a, fmi2Real b, fmi2Real begin, fmi2Boolean d, fmi2Real end)
EMPTY(fmi2EnterInitializationMode)
EMPTY(fmi2ExitInitializationMode)
EMPTY(fmi2Terminate)
ABSENT(fmi2GetInteger, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
ABSENT(fmi2GetBoolean, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
ABSENT(fmi2GetString, const fmi2ValueReference vr[], size_t n, fmi2String value[])
ABSENT(fmi2SetInteger, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
ABSENT(fmi2SetBoolean, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
ABSENT(fmi2SetString, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
ABSENT(fmi2GetFMUstate, fmi2FMUstate* state)
ABSENT(fmi2SetFMUstate, fmi2FMUstate state)
ABSENT(fmi2FreeFMUstate, fmi2FMUstate* state)
ABSENT(fmi2SerializedFMUstateSize, fmi2FMUstate state, size_t* size)
ABSENT(fmi2SerializeFMUstate, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
ABSENT(fmi2DeSerializeFMUstate, const fmi2Byte bytes[], size_t size, fmi2FMUstate* state)
ABSENT(fmi2GetDirectionalDerivative, const fmi2ValueReference u[], size_t n, const fmi2ValueReference k[], size_t m,
       const fmi2Real dk[], fmi2Real du[])
ABSENT(fmi2SetRealInputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer o[], const fmi2Real v[])
ABSENT(fmi2GetRealOutputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer o[], fmi2Real v[])
ABSENT(fmi2CancelStep)
ABSENT(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status* value)
ABSENT(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real* value)
ABSENT(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer* value)
ABSENT(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean* value)
ABSENT(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String* value)
