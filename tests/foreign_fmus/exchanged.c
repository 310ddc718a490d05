/* An FMU of FMI 2.0 for model exchange only: x' = u - x, counts in n how often x rises above 0.5, and from 0.35 s on
   m = 1. After 0.2 s it is `way`: 1 gives no derivatives, 2 gives NaN, 3 dies, 4 has an event without end. */
#include <math.h>
#include <stdlib.h>
#include "fmi2Functions.h"

typedef struct {
    fmi2Real t, v[4], dx;
    fmi2Integer way;
    int above, event;
} Instance;
enum { U, X, N, M };

#define C fmi2Component c
#define VRS const fmi2ValueReference vr[], size_t n
#define DO(name, does, ...) FMI2_Export fmi2Status name(__VA_ARGS__) { Instance *m = c; does; return fmi2OK; }
#define NOTHING(name, ...) FMI2_Export fmi2Status name(__VA_ARGS__) { return fmi2OK; }
FMI2_Export const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI2_Export const char *fmi2GetVersion(void) { return "2.0"; }
FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean log) {
    return type == fmi2ModelExchange ? calloc(1, sizeof(Instance)) : NULL;
}
FMI2_Export void fmi2FreeInstance(C) { free(c); }
DO(fmi2SetReal, { if (!m->event && m->t > 0.0) return fmi2Error; for (size_t i = 0; i < n; i++) m->v[vr[i]] = v[i]; },
   C, VRS, const fmi2Real v[])
DO(fmi2GetReal, for (size_t i = 0; i < n; i++) v[i] = m->v[vr[i]], C, VRS, fmi2Real v[])
DO(fmi2SetInteger, m->way = v[0], C, VRS, const fmi2Integer v[])
DO(fmi2SetTime, m->t = t, C, fmi2Real t)
DO(fmi2SetContinuousStates, m->v[X] = x[0], C, const fmi2Real x[], size_t n)
DO(fmi2GetContinuousStates, x[0] = m->v[X], C, fmi2Real x[], size_t n)
DO(fmi2GetNominalsOfContinuousStates, x[0] = 1.0, C, fmi2Real x[], size_t n)
DO(fmi2GetEventIndicators, z[0] = m->v[X] - 0.5, C, fmi2Real z[], size_t n)
DO(fmi2GetDerivatives, {
    if (m->way == 1 && m->t > 0.2) return fmi2Error;
    if (m->way == 3 && m->t > 0.2) abort();
    x[0] = m->way == 2 && m->t > 0.2 ? NAN : m->v[U] - m->v[X];
}, C, fmi2Real x[], size_t n)
DO(fmi2EnterEventMode, m->event = 1, C)
DO(fmi2EnterContinuousTimeMode, m->event = 0, C)
DO(fmi2ExitInitializationMode, m->event = 1, C)
DO(fmi2NewDiscreteStates, {
    int above = m->v[X] >= 0.5;
    m->v[N] += above && !m->above;
    m->above = above;
    m->v[M] = m->t >= 0.35;
    info->newDiscreteStatesNeeded = m->way == 4 && m->t > 0.2;
    info->terminateSimulation = info->nominalsOfContinuousStatesChanged = info->valuesOfContinuousStatesChanged = 0;
    info->nextEventTimeDefined = m->t < 0.35;
    info->nextEventTime = 0.35;
}, C, fmi2EventInfo *info)
DO(fmi2CompletedIntegratorStep, *event = *terminate = 0, C, fmi2Boolean keep, fmi2Boolean *event, fmi2Boolean *terminate)
NOTHING(fmi2SetDebugLogging, C, fmi2Boolean on, size_t n, const fmi2String categories[])
NOTHING(fmi2SetupExperiment, C, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f)
NOTHING(fmi2EnterInitializationMode, C)
NOTHING(fmi2Terminate, C)
