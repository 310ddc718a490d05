/* x' = u - k x with an event at 0.35 s, for FMI 2.0 and 3.0, model exchange and co-simulation (VERSION, EXCHANGE).
   Each call is accepted only in the modes in which the standard allows it; each step must begin where the last one
   ended and must not pass the stop time. The habits of exporters are macros: LATE, LOST, LIMITED, INTERNAL, FIXED,
   CLOCK, EVENTS, NOMINAL, NOT_A_NUMBER, DEADLY, DEAF, TALKING, HASTY, ENDING, PENDING, DISCARDING, READING, PRINTING, CHOOSY,
   ALLOCATING, PARTING. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#if VERSION == 2
#include "fmi2Functions.h"
#define F(name) fmi2##name
#define SET SetReal
#define GET GetReal
#define MORE
#define EXPORT FMI2_Export
typedef fmi2Component Of;
typedef fmi2Status Status;
typedef fmi2ValueReference Reference;
typedef fmi2String Text;
typedef fmi2Boolean Flag;
#else
#include "fmi3Functions.h"
#define F(name) fmi3##name
#define MORE , size_t nValues
#define EXPORT FMI3_Export
typedef fmi3Instance Of;
typedef fmi3Status Status;
typedef fmi3ValueReference Reference;
typedef fmi3String Text;
typedef fmi3Boolean Flag;
#endif

enum { INSTANTIATED = 1, INITIALISATION = 2, EVENT = 4, CONTINUOUS = 8, STEP = 16, ENDED = 32 };
enum { U, X, DER, K, D, Y, M, STEPS, TICKS, TIME, VALUES };
typedef struct {
    double v[VALUES], completed, stop;
    int mode, set_up, unsettled, ticking;
    void *environment;
    void *logger;
} Model;

static const double EVENT_AT = 0.35;

static void say(Model *m, Text text) {
    if (!m->logger) return;
#if VERSION == 2
    ((fmi2CallbackLogger)m->logger)(m->environment, "strict", fmi2Error, "error", text);
#else
    ((fmi3LogMessageCallback)m->logger)(m->environment, fmi3Error, "error", text);
#endif
}
#define ONLY(modes, call) if (!(m->mode & (modes))) { say(m, call " in a mode that does not allow it"); return 3; }
#define REFUSE(when, text) if (when) { say(m, text); return 3; }

static void derive(Model *m) {
    m->v[DER] = m->v[U] - m->v[K] * m->v[X];
#ifdef NOT_A_NUMBER
    if (m->v[TIME] > 0.5) m->v[Y] = NAN;
#endif
}
static void update(Model *m) {
    m->v[M] = m->v[TIME] >= EVENT_AT;
    m->v[Y] = m->v[D];
    m->v[TICKS] += m->ticking;
    m->ticking = m->unsettled = 0;
}
static Status set(Model *m, const Reference r[], size_t n, const double v[]) {
    for (size_t i = 0; i < n; i++) {
        int begins = r[i] == X && m->mode & (INSTANTIATED | INITIALISATION);
        REFUSE(r[i] != U && r[i] != D && r[i] != K && !begins, "a variable that cannot be set")
        REFUSE(r[i] == K && !(m->mode & (INSTANTIATED | INITIALISATION)), "a fixed parameter is set too late")
        REFUSE(r[i] == D && m->mode == CONTINUOUS, "a discrete input is set outside event mode")
#ifdef EVENTS
        REFUSE(r[i] == D && m->mode == STEP, "a discrete input is set outside event mode")
#endif
#ifdef LATE
        if (r[i] == K && m->mode == INSTANTIATED) continue;
#endif
#ifdef LOST
        if (r[i] == K) continue;
#endif
#ifdef LIMITED
        if (r[i] == K && v[i] > 1.5) { m->v[K] = 1.5; continue; }
#endif
        m->v[r[i]] = v[i];
    }
    if (m->mode == EVENT) m->unsettled = 1;
    if (m->mode & (INSTANTIATED | INITIALISATION)) m->v[Y] = m->v[D];
    return 0;
}
static Status get(Model *m, const Reference r[], size_t n, double v[]) {
    ONLY(~INSTANTIATED, "Get")
    derive(m);
    for (size_t i = 0; i < n; i++) v[i] = m->v[r[i]];
    return 0;
}
static void flow(Model *m, double length) {
    double gone = exp(-m->v[K] * length);
    m->v[X] = m->v[X] * gone + m->v[U] / m->v[K] * (1.0 - gone);
    m->v[TIME] += length;
}
static double read_start(Text resources) {
    double start = 0.0;
#ifdef READING
    /* FMI 2.0 gives a URI, FMI 3.0 a path that ends with a slash. */
    char path[4096];
    if (!resources || (VERSION == 2) != !strncmp(resources, "file:///", 8)) return NAN;
    snprintf(path, sizeof path, "%s%sstart.txt", resources + (VERSION == 2 ? 7 : 0), VERSION == 2 ? "/" : "");
    FILE *file = fopen(path, "r");
    if (!file || fscanf(file, "%lf", &start) != 1) start = NAN;
    if (file) fclose(file);
#endif
    return start;
}
static Model *make(void *logger, void *environment, Text token, Text resources, void *allocate) {
#ifdef ALLOCATING
    Model *m = ((void *(*)(size_t, size_t))allocate)(1, sizeof(Model));
#else
    Model *m = calloc(1, sizeof(Model));
#endif
    double start = read_start(resources);
#ifdef CHOOSY
    if (strcmp(token, "another")) {
        m->logger = logger, m->environment = environment;
        say(m, "it was made for another description");
        return 0;
    }
#endif
    if (isnan(start)) return 0;
    m->v[X] = start;
    m->v[K] = 1.0, m->mode = INSTANTIATED, m->logger = logger, m->environment = environment, m->stop = INFINITY;
    return m;
}
static Status begin(Model *m, double start, Flag ends, double stop) {
    m->v[TIME] = m->completed = start;
    if (ends) m->stop = stop;
    return 0;
}

EXPORT Status F(ExitInitializationMode)(Of c) {
    Model *m = c;
    ONLY(INITIALISATION, "ExitInitializationMode")
#if defined(EXCHANGE) || defined(EVENTS)
    m->mode = EVENT, m->unsettled = 1;
#else
    m->mode = STEP;
#endif
    return 0;
}
EXPORT Status F(Terminate)(Of c) {
    Model *m = c;
#ifdef PARTING
    abort();
#endif
    ONLY(EVENT | CONTINUOUS | STEP, "Terminate")
    m->mode = ENDED;
    return 0;
}
EXPORT void F(FreeInstance)(Of c) { free(c); }
EXPORT Status F(EnterEventMode)(Of c) {
    Model *m = c;
    ONLY(CONTINUOUS | STEP, "EnterEventMode")
    REFUSE(m->mode == CONTINUOUS && m->completed != m->v[TIME], "EnterEventMode before CompletedIntegratorStep")
    m->mode = EVENT, m->unsettled = 1;
    return 0;
}
#ifdef EXCHANGE
EXPORT Status F(EnterContinuousTimeMode)(Of c) {
    Model *m = c;
    ONLY(EVENT, "EnterContinuousTimeMode")
    REFUSE(m->unsettled, "EnterContinuousTimeMode before the event has come to its end")
    m->mode = CONTINUOUS;
    return 0;
}
EXPORT Status F(SetTime)(Of c, double time) {
    Model *m = c;
    ONLY(CONTINUOUS, "SetTime")
    REFUSE(time < m->completed, "SetTime goes back")
    REFUSE(time > m->stop, "SetTime beyond the stop time")
    m->v[TIME] = time;
    return 0;
}
EXPORT Status F(SetContinuousStates)(Of c, const double x[], size_t n) {
    Model *m = c;
    ONLY(CONTINUOUS, "SetContinuousStates")
    m->v[X] = x[0];
    return 0;
}
EXPORT Status F(GetContinuousStates)(Of c, double x[], size_t n) {
    Model *m = c;
    ONLY(INITIALISATION | EVENT | CONTINUOUS, "GetContinuousStates")
    x[0] = m->v[X];
    return 0;
}
EXPORT Status F(GetNominalsOfContinuousStates)(Of c, double x[], size_t n) {
    Model *m = c;
    ONLY(EVENT | CONTINUOUS, "GetNominalsOfContinuousStates")
#ifdef NOMINAL
    x[0] = NOMINAL;
#else
    x[0] = 1.0;
#endif
    return 0;
}
static Status derivatives(Model *m, double x[]) {
    ONLY(INITIALISATION | EVENT | CONTINUOUS, "GetDerivatives")
    derive(m);
    x[0] = m->v[DER];
    return 0;
}
static Status complete(Model *m) {
    ONLY(CONTINUOUS, "CompletedIntegratorStep")
    m->completed = m->v[TIME];
    m->v[STEPS] += 1.0;
    return 0;
}
#endif
static int ended(Model *m);
static Status settle(Model *m, double *next) {
    ONLY(EVENT, "the update of discrete states")
    update(m);
    *next = EVENT_AT;
    return 0;
}
static int ended(Model *m) {
#ifdef ENDING
    return m->v[TIME] > ENDING;
#else
    return 0;
#endif
}
static Status advance(Model *m, double from, double length, int early) {
#ifdef PENDING
    if (from >= 0.5) return 5;
#endif
#ifdef DISCARDING
    if (from >= 0.5) return 2;
#endif
#ifdef PRINTING
    printf("{\"rows\": 1}\n"), fflush(stdout);
    FILE *note = fopen("strict-note.txt", "w");
    if (note) fclose(note);
#endif
    ONLY(STEP, "DoStep")
    REFUSE(fabs(from - m->v[TIME]) > 1e-12, "DoStep does not begin where the last step ended")
    REFUSE(from + length > m->stop, "DoStep beyond the stop time")
#ifdef FIXED
    REFUSE(fabs(length - 0.1) > 1e-12, "DoStep with another step than 0.1 s")
#endif
#ifdef INTERNAL
    REFUSE(fabs(length / 0.05 - round(length / 0.05)) > 1e-9, "DoStep with no multiple of 0.05 s")
#endif
#ifdef DEADLY
    if (from >= 0.5) abort();
#endif
#ifdef DEAF
    REFUSE(from >= 0.5, "it will not go on")
#endif
#ifdef TALKING
    /* Write to every pipe of the process. */
    if (from >= 0.5)
        for (int file = 3; file < 64; file++)
            if (write(file, "nonsense", 8) < 0) continue;
#endif
    double end = from + length;
#ifdef EVENTS
    if (early && from < EVENT_AT && EVENT_AT <= end) {
        flow(m, EVENT_AT - from);
        m->v[TIME] = EVENT_AT;
        return 0;
    }
#endif
    flow(m, length);
    m->v[TIME] = end;
    m->v[STEPS] += 1.0;
#ifndef EVENTS
    update(m);
#endif
    return 0;
}

#if VERSION == 2
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT Of fmi2Instantiate(Text name, fmi2Type type, Text token, Text resources, const fmi2CallbackFunctions *host,
                          Flag visible, Flag log) {
    return make((void *)host->logger, host->componentEnvironment, token, resources, (void *)host->allocateMemory);
}
EXPORT Status fmi2SetDebugLogging(Of c, Flag on, size_t n, const Text categories[]) { return 0; }
EXPORT Status fmi2SetupExperiment(Of c, Flag tolerates, double tolerance, double start, Flag ends, double stop) {
    Model *m = c;
    ONLY(INSTANTIATED, "SetupExperiment")
    m->set_up = 1;
    return begin(m, start, ends, stop);
}
EXPORT Status fmi2EnterInitializationMode(Of c) {
    Model *m = c;
    ONLY(INSTANTIATED, "EnterInitializationMode")
    REFUSE(!m->set_up, "EnterInitializationMode before SetupExperiment")
    m->mode = INITIALISATION;
    return 0;
}
EXPORT Status fmi2SetReal(Of c, const Reference r[], size_t n, const double v[]) { return set(c, r, n, v); }
EXPORT Status fmi2GetReal(Of c, const Reference r[], size_t n, double v[]) { return get(c, r, n, v); }
#ifdef EXCHANGE
EXPORT Status fmi2GetDerivatives(Of c, double x[], size_t n) { return derivatives(c, x); }
EXPORT Status fmi2GetEventIndicators(Of c, double z[], size_t n) { return 0; }
EXPORT Status fmi2NewDiscreteStates(Of c, fmi2EventInfo *info) {
    Model *m = c;
    memset(info, 0, sizeof *info);
    Status status = settle(m, &info->nextEventTime);
    info->nextEventTimeDefined = m->v[TIME] < EVENT_AT;
    info->terminateSimulation = ended(m);
    return status;
}
EXPORT Status fmi2CompletedIntegratorStep(Of c, Flag keep, Flag *event, Flag *terminate) {
    *event = 0;
    Status status = complete(c);
    *terminate = ended(c);
    return status;
}
#else
EXPORT Status fmi2DoStep(Of c, double from, double length, Flag final) {
    Status status = advance(c, from, length, 0);
    return ended(c) ? 2 : status;
}
EXPORT Status fmi2GetBooleanStatus(Of c, const fmi2StatusKind kind, Flag *value) { *value = ended(c); return 0; }
EXPORT Status fmi2GetRealStatus(Of c, const fmi2StatusKind kind, double *value) {
    *value = ((Model *)c)->v[TIME];
    return 0;
}
#endif
#else
EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT Of fmi3InstantiateModelExchange(Text name, Text token, Text path, Flag visible, Flag log,
                                       fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger) {
    return make((void *)logger, environment, token, path, (void *)calloc);
}
EXPORT Of fmi3InstantiateCoSimulation(Text name, Text token, Text path, Flag visible, Flag log, Flag events,
                                      Flag early, const Reference r[], size_t n, fmi3InstanceEnvironment environment,
                                      fmi3LogMessageCallback logger, fmi3IntermediateUpdateCallback update) {
    return make((void *)logger, environment, token, path, (void *)calloc);
}
EXPORT Status fmi3SetDebugLogging(Of c, Flag on, size_t n, const Text categories[]) { return 0; }
EXPORT Status fmi3EnterInitializationMode(Of c, Flag tolerates, double tolerance, double start, Flag ends,
                                          double stop) {
    Model *m = c;
    ONLY(INSTANTIATED, "EnterInitializationMode")
    m->mode = INITIALISATION;
    return begin(m, start, ends, stop);
}
EXPORT Status fmi3SetFloat64(Of c, const Reference r[], size_t n, const double v[], size_t k) {
    return set(c, r, n, v);
}
EXPORT Status fmi3GetFloat64(Of c, const Reference r[], size_t n, double v[], size_t k) { return get(c, r, n, v); }
EXPORT Status fmi3UpdateDiscreteStates(Of c, Flag *again, Flag *terminate, Flag *nominals, Flag *values,
                                       Flag *defined, double *next) {
    Model *m = c;
    *again = *nominals = *values = 0;
    Status status = settle(m, next);
    *terminate = ended(m);
    *defined = m->v[TIME] < EVENT_AT;
    return status;
}
EXPORT Status fmi3SetClock(Of c, const Reference r[], size_t n, const fmi3Clock values[]) {
    Model *m = c;
    ONLY(EVENT, "SetClock")
    m->ticking = values[0], m->unsettled = 1;
    return 0;
}
#ifdef EXCHANGE
EXPORT Status fmi3GetContinuousStateDerivatives(Of c, double x[], size_t n) { return derivatives(c, x); }
EXPORT Status fmi3GetEventIndicators(Of c, double z[], size_t n) { return 0; }
EXPORT Status fmi3CompletedIntegratorStep(Of c, Flag keep, Flag *event, Flag *terminate) {
    *event = 0;
    Status status = complete(c);
    *terminate = ended(c);
    return status;
}
#else
EXPORT Status fmi3EnterStepMode(Of c) {
    Model *m = c;
    ONLY(EVENT, "EnterStepMode")
    REFUSE(m->unsettled, "EnterStepMode before the event has come to its end")
    m->mode = STEP;
    return 0;
}
EXPORT Status fmi3DoStep(Of c, double from, double length, Flag final, Flag *event, Flag *terminate, Flag *early,
                         double *reached) {
    Model *m = c;
    *event = *terminate = *early = 0;
    Status status = advance(m, from, length, 1);
#ifdef HASTY
    m->v[TIME] -= 0.5 * length, *early = 1;
#endif
    *reached = m->v[TIME];
    *terminate = ended(m);
#ifdef EVENTS
    *event = m->v[TIME] == EVENT_AT;
    *early = m->v[TIME] < from + length;
#endif
    return status;
}
#endif
#endif
