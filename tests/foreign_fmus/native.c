/* A native FMI 2.0 co-simulation FMU, smaller than small: y = 2 u, and after t = 0.5 it stops if told to:
   1 with a message, 2 without; 3 is the message alone. */
#include <stdlib.h>
#include "fmi2Functions.h"

typedef struct {
    fmi2Real u, y;
    fmi2Integer stops;
    const fmi2CallbackFunctions *host;
} Instance;

#define NOTHING(name, ...) FMI2_Export fmi2Status name(__VA_ARGS__) { return fmi2OK; }
#define C fmi2Component c
#define VRS const fmi2ValueReference vr[], size_t n

FMI2_Export const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI2_Export const char *fmi2GetVersion(void) { return "2.0"; }
FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean log) {
    Instance *m = calloc(1, sizeof(Instance));
    m->host = host;
    return m;
}
FMI2_Export void fmi2FreeInstance(C) { free(c); }
FMI2_Export fmi2Status fmi2SetReal(C, VRS, const fmi2Real v[]) { ((Instance *)c)->u = v[0]; return fmi2OK; }
FMI2_Export fmi2Status fmi2GetReal(C, VRS, fmi2Real v[]) { v[0] = ((Instance *)c)->y; return fmi2OK; }
FMI2_Export fmi2Status fmi2SetInteger(C, VRS, const fmi2Integer v[]) {
    ((Instance *)c)->stops = v[0];
    return fmi2OK;
}
FMI2_Export fmi2Status fmi2DoStep(C, fmi2Real t, fmi2Real h, fmi2Boolean keep) {
    Instance *m = c;
    if ((m->stops == 1 || m->stops == 3) && t > 0.5)
        m->host->logger(m->host->componentEnvironment, "m", fmi2Error, "error", "%s of %d %g", "fuse", 3, 0.25);
    if ((m->stops == 1 || m->stops == 2) && t > 0.5)
        return fmi2Error;
    m->y = 2.0 * m->u;
    return fmi2OK;
}
NOTHING(fmi2SetDebugLogging, C, fmi2Boolean on, size_t n, const fmi2String categories[])
NOTHING(fmi2SetupExperiment, C, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f)
NOTHING(fmi2EnterInitializationMode, C)
NOTHING(fmi2ExitInitializationMode, C)
NOTHING(fmi2Terminate, C)
NOTHING(fmi2Reset, C)
FMI2_Export fmi2Status fmi2GetInteger(C, VRS, fmi2Integer v[]) {
    for (size_t i = 0; i < n; i++) v[i] = ((Instance *)c)->stops;
    return fmi2OK;
}
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
NOTHING(fmi2SetRealInputDerivatives, C, VRS, const fmi2Integer o[], const fmi2Real v[])
NOTHING(fmi2GetRealOutputDerivatives, C, VRS, const fmi2Integer o[], fmi2Real v[])
NOTHING(fmi2CancelStep, C)
NOTHING(fmi2GetStatus, C, const fmi2StatusKind k, fmi2Status *v)
NOTHING(fmi2GetRealStatus, C, const fmi2StatusKind k, fmi2Real *v)
NOTHING(fmi2GetIntegerStatus, C, const fmi2StatusKind k, fmi2Integer *v)
NOTHING(fmi2GetBooleanStatus, C, const fmi2StatusKind k, fmi2Boolean *v)
NOTHING(fmi2GetStringStatus, C, const fmi2StatusKind k, fmi2String *v)
