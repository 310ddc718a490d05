/* An FMU of FMI 2.0 that can interpolate its input: x' = u, integrated exactly for an input that is linear in a step. */
#include <stdlib.h>
#include "fmi2Functions.h"

typedef struct {
    fmi2Real u, x, slope;
} Instance;

#define C fmi2Component c
#define VRS const fmi2ValueReference vr[], size_t n
#define DO(name, does, ...) FMI2_Export fmi2Status name(__VA_ARGS__) { Instance *m = c; does; return fmi2OK; }
#define NOTHING(name, ...) FMI2_Export fmi2Status name(__VA_ARGS__) { return fmi2OK; }
FMI2_Export const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI2_Export const char *fmi2GetVersion(void) { return "2.0"; }
FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean log) {
    return calloc(1, sizeof(Instance));
}
FMI2_Export void fmi2FreeInstance(C) { free(c); }
DO(fmi2SetReal, { m->u = v[0]; m->slope = 0.0; }, C, VRS, const fmi2Real v[])
DO(fmi2GetReal, v[0] = m->x, C, VRS, fmi2Real v[])
DO(fmi2SetRealInputDerivatives, { if (n != 1 || vr[0] != 0 || o[0] != 1) return fmi2Error; m->slope = v[0]; },
   C, VRS, const fmi2Integer o[], const fmi2Real v[])
DO(fmi2DoStep, m->x += h * (m->u + 0.5 * h * m->slope), C, fmi2Real t, fmi2Real h, fmi2Boolean keep)
NOTHING(fmi2SetDebugLogging, C, fmi2Boolean on, size_t n, const fmi2String categories[])
NOTHING(fmi2SetupExperiment, C, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f)
NOTHING(fmi2EnterInitializationMode, C)
NOTHING(fmi2ExitInitializationMode, C)
NOTHING(fmi2Terminate, C)
NOTHING(fmi2Reset, C)
NOTHING(fmi2GetInteger, C, VRS, fmi2Integer v[])
NOTHING(fmi2GetBoolean, C, VRS, fmi2Boolean v[])
NOTHING(fmi2GetString, C, VRS, fmi2String v[])
NOTHING(fmi2SetBoolean, C, VRS, const fmi2Boolean v[])
NOTHING(fmi2SetString, C, VRS, const fmi2String v[])
NOTHING(fmi2GetFMUstate, C, fmi2FMUstate *s)
NOTHING(fmi2SetFMUstate, C, fmi2FMUstate s)
NOTHING(fmi2FreeFMUstate, C, fmi2FMUstate *s)
NOTHING(fmi2SerializedFMUstateSize, C, fmi2FMUstate s, size_t *n)
NOTHING(fmi2SerializeFMUstate, C, fmi2FMUstate s, fmi2Byte b[], size_t n)
NOTHING(fmi2DeSerializeFMUstate, C, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
NOTHING(fmi2GetDirectionalDerivative, C, VRS, const fmi2ValueReference k[], size_t m, const fmi2Real a[], fmi2Real b[])
NOTHING(fmi2GetRealOutputDerivatives, C, VRS, const fmi2Integer o[], fmi2Real v[])
NOTHING(fmi2CancelStep, C)
NOTHING(fmi2GetStatus, C, const fmi2StatusKind k, fmi2Status *v)
NOTHING(fmi2GetRealStatus, C, const fmi2StatusKind k, fmi2Real *v)
NOTHING(fmi2GetIntegerStatus, C, const fmi2StatusKind k, fmi2Integer *v)
NOTHING(fmi2GetBooleanStatus, C, const fmi2StatusKind k, fmi2Boolean *v)
NOTHING(fmi2GetStringStatus, C, const fmi2StatusKind k, fmi2String *v)
NOTHING(fmi2SetInteger, C, VRS, const fmi2Integer v[])
