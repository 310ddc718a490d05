/* x' = s (u - k x) with a time event at 0.35 s, for FMI 1.0: model exchange (EXCHANGE) or co-simulation. Parameters and
   start values are taken before the initialisation only, outputs are given after it, and each step begins where the last
   one ended. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fmi1Functions.h"
#define F(name) first_fmi##name

enum { U, X, DER, K, REALS };
enum { ON, SWITCH, FLAGS };
typedef struct {
    double v[REALS], time, stop;
    char flags[FLAGS], name[64];
    int initialised, steps;
    fmi1CallbackFunctions functions;
} Model;

static fmi1Status refuse(Model *m, const char *text) {
    m->functions.logger(m, m->name, fmi1Error, "error", "%s", text);
    return fmi1Error;
}
#define REFUSE(when, text) if (when) return refuse(m, text);

static Model *make(fmi1String name, fmi1String guid, fmi1CallbackFunctions functions) {
    if (strcmp(guid, "g")) return NULL;
    Model *m = functions.allocateMemory(1, sizeof(Model));
    strncpy(m->name, name, sizeof m->name - 1);
    m->functions = functions;
    m->v[K] = 1.0;
    m->flags[SWITCH] = 1;
    return m;
}
static void derive(Model *m) { m->v[DER] = m->flags[SWITCH] * (m->v[U] - m->v[K] * m->v[X]); }
static void update(Model *m) { m->flags[ON] = m->time >= 0.35 - 1e-9; }

fmi1Status F(SetReal)(Model *m, const fmi1ValueReference r[], size_t n, const double v[]) {
    for (size_t i = 0; i < n; i++) {
        REFUSE(m->initialised && r[i] != U, "only inputs are set after the initialisation")
        m->v[r[i]] = v[i];
    }
    return fmi1OK;
}
fmi1Status F(GetReal)(Model *m, const fmi1ValueReference r[], size_t n, double v[]) {
    REFUSE(!m->initialised && r[0] != K && r[0] != U, "no values before the initialisation")
    derive(m);
    for (size_t i = 0; i < n; i++) v[i] = m->v[r[i]];
    return fmi1OK;
}
fmi1Status F(SetBoolean)(Model *m, const fmi1ValueReference r[], size_t n, const fmi1Boolean v[]) {
    for (size_t i = 0; i < n; i++) m->flags[r[i]] = v[i];
    return fmi1OK;
}
fmi1Status F(GetBoolean)(Model *m, const fmi1ValueReference r[], size_t n, fmi1Boolean v[]) {
    for (size_t i = 0; i < n; i++) v[i] = m->flags[r[i]];
    return fmi1OK;
}
fmi1Status F(GetInteger)(Model *m, const fmi1ValueReference r[], size_t n, int v[]) {
    for (size_t i = 0; i < n; i++) v[i] = m->steps;
    return fmi1OK;
}
#ifdef EXCHANGE
void *F(InstantiateModel)(fmi1String name, fmi1String guid, fmi1CallbackFunctions functions, fmi1Boolean logging) {
    return make(name, guid, functions);
}
void F(FreeModelInstance)(Model *m) { m->functions.freeMemory(m); }
static fmi1Status events(Model *m, fmi1EventInfo *info) {
    memset(info, 0, sizeof *info);
    update(m);
    info->iterationConverged = 1;
    info->upcomingTimeEvent = m->time < 0.35 - 1e-9;
    info->nextEventTime = 0.35;
    return fmi1OK;
}
fmi1Status F(Initialize)(Model *m, fmi1Boolean controlled, double tolerance, fmi1EventInfo *info) {
    REFUSE(m->initialised, "initialised twice")
    m->initialised = 1;
    return events(m, info);
}
fmi1Status F(EventUpdate)(Model *m, fmi1Boolean intermediate, fmi1EventInfo *info) {
    REFUSE(!m->initialised, "an event before the initialisation")
    return events(m, info);
}
fmi1Status F(SetTime)(Model *m, double time) { m->time = time; return fmi1OK; }
fmi1Status F(SetContinuousStates)(Model *m, const double x[], size_t n) { m->v[X] = x[0]; return fmi1OK; }
fmi1Status F(GetContinuousStates)(Model *m, double x[], size_t n) { x[0] = m->v[X]; return fmi1OK; }
fmi1Status F(GetNominalContinuousStates)(Model *m, double x[], size_t n) { x[0] = 1.0; return fmi1OK; }
fmi1Status F(GetDerivatives)(Model *m, double x[], size_t n) { derive(m); x[0] = m->v[DER]; return fmi1OK; }
fmi1Status F(GetEventIndicators)(Model *m, double z[], size_t n) { return fmi1OK; }
fmi1Status F(CompletedIntegratorStep)(Model *m, fmi1Boolean *event) { *event = 0; m->steps++; return fmi1OK; }
fmi1Status F(Terminate)(Model *m) { return fmi1OK; }
#else
void *F(InstantiateSlave)(fmi1String name, fmi1String guid, fmi1String location, fmi1String mime, double timeout,
    fmi1Boolean visible, fmi1Boolean interactive, fmi1CallbackFunctions functions, fmi1Boolean logging) {
    return location && !strncmp(location, "file:///", 8) ? make(name, guid, functions) : NULL;
}
void F(FreeSlaveInstance)(Model *m) { m->functions.freeMemory(m); }
fmi1Status F(InitializeSlave)(Model *m, double start, fmi1Boolean has_stop, double stop) {
    m->initialised = 1;
    m->time = start;
    m->stop = has_stop ? stop : INFINITY;
    return fmi1OK;
}
fmi1Status F(DoStep)(Model *m, double time, double step, fmi1Boolean fresh) {
    REFUSE(fabs(time - m->time) > 1e-9 || !fresh, "the step does not begin where the last one ended")
    REFUSE(time + step > m->stop, "the step ends after the stop time")
#ifdef FAILING
    REFUSE(time > 0.45, "fuse blown")
#endif
    double gone = exp(-m->v[K] * step);
    if (m->flags[SWITCH]) m->v[X] = m->v[X] * gone + m->v[U] / m->v[K] * (1.0 - gone);
    m->time = time + step;
    m->steps++;
    update(m);
    return fmi1OK;
}
fmi1Status F(TerminateSlave)(Model *m) { return fmi1OK; }
#endif
