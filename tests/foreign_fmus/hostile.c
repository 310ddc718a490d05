/* An FMU of FMI 2.0 whose name in the scenario says in which of its calls it misbehaves, and how: "crash_DoStep".
   Otherwise it passes its inputs on, of each type one; y = u / 2 + t. In its calls of the run it does it late: in the
   third step of 0.1 s. */
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "fmi2FunctionTypes.h"

typedef struct {
    double u, y, time;
    int k, mark;
    char text[64], way[16], call[32];
} Instance;

static void *for_ever(void *nothing)
{
    for (;;)
        sleep(1);
    return nothing;
}

static void write_to_all(const char *bytes, size_t count, int times)
{
    for (int file = 3; file < 20; file++)
        for (int i = 0; i < times; i++)
            if (write(file, bytes, count) < 0)
                break;
}

static fmi2Status behave(Instance *m, const char *call, double now, double from)
{
    pthread_t thread;
    if (strcmp(m->call, call) != 0 || now < from)
        return fmi2OK;
    if (strcmp(m->way, "error") == 0)
        return fmi2Error;
    if (strcmp(m->way, "fatal") == 0)
        return fmi2Fatal;
    if (strcmp(m->way, "discard") == 0)
        return fmi2Discard;
    if (strcmp(m->way, "exit") == 0)
        exit(0);
    if (strcmp(m->way, "crash") == 0)
        raise(SIGSEGV);
    if (strcmp(m->way, "abort") == 0) {
        fprintf(stderr, "the valve is stuck\n");
        abort();
    }
    if (strcmp(m->way, "hang") == 0)
        for_ever(NULL);
    if (strcmp(m->way, "nan") == 0)
        m->y = NAN;
    if (strcmp(m->way, "chdir") == 0 && chdir("/") != 0)
        return fmi2Error;
    if (strcmp(m->way, "printf") == 0) {
        printf("{\"schema\": \"nonsense\"}\n");
        fflush(stdout);
    }
    /* Our pipe is among the first files: bytes that are no reply, the head of a long one, one of values too short, two. */
    if (strcmp(m->way, "garbage") == 0)
        write_to_all("\xdb\xff\xff\xff\x7f{[garbage", 14, 100);
    if (strcmp(m->way, "long") == 0)
        write_to_all("\0\0\0\0\0\1\0\0", 8, 1);
    if (strcmp(m->way, "short") == 0)
        write_to_all("\030\0\0\0\0\0\0\0[[[0,[]],[0,[]]],[],\"\"]  ", 32, 1);
    if (strcmp(m->way, "deep") == 0) {
        write_to_all("\0\0\1\0\0\0\0\0", 8, 1);
        write_to_all("[[[[[[[[", 8, 8192);
    }
    if (strcmp(m->way, "truncate") == 0 && truncate("../progress", 0) != 0)
        return fmi2Error;
    if (strcmp(m->way, "fork") == 0)
        for (int i = 0; i < 3; i++)
            if (fork() == 0)
                for_ever(NULL);
    /* A child holds the pipe while we end. */
    if (strcmp(m->way, "forkexit") == 0) {
        if (fork() == 0)
            for_ever(NULL);
        exit(0);
    }
    if (strcmp(m->way, "memory") == 0)
        for (int i = 0; i < 100000; i++)
            if (malloc(1 << 28) == NULL)
                return fmi2Error;
    if (strcmp(m->way, "control") == 0) {
        fprintf(stderr, "\033[2J\033]0;owned\007 \xff\xe2\x80\xae stuck\n");
        abort();
    }
    if (strcmp(m->way, "threads") == 0)
        for (int i = 0; i < 4; i++)
            pthread_create(&thread, NULL, for_ever, NULL);
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    Instance *m = calloc(1, sizeof(Instance));
    sscanf(name, "%15[a-z]_%31s", m->way, m->call);
    return behave(m, "Instantiate", 0, 0) > fmi2Warning ? NULL : m;
}
void fmi2FreeInstance(fmi2Component c) { behave(c, "FreeInstance", 0, 0); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean b, fmi2Real d, fmi2Real start, fmi2Boolean e, fmi2Real f)
{
    return behave(c, "SetupExperiment", 0, 0);
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return behave(c, "EnterInitializationMode", 0, 0); }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return behave(c, "ExitInitializationMode", 0, 0); }
fmi2Status fmi2Terminate(fmi2Component c) { return behave(c, "Terminate", 0, 0); }

#define ACCESS(Type, c_type, field)                                                                                    \
    fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n, const c_type v[])               \
    {                                                                                                                  \
        Instance *m = c;                                                                                               \
        m->field = v[0];                                                                                               \
        return behave(m, "Set" #Type, m->time, 0.15);                                                                  \
    }                                                                                                                  \
    fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n, c_type v[])                     \
    {                                                                                                                  \
        Instance *m = c;                                                                                               \
        fmi2Status status = behave(m, "Get" #Type, m->time, 0.25);                                                     \
        v[0] = sizeof(c_type) == 8 ? m->y : m->field;                                                                  \
        return status;                                                                                                 \
    }
ACCESS(Real, fmi2Real, u)
ACCESS(Integer, fmi2Integer, k)
ACCESS(Boolean, fmi2Boolean, mark)

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String v[])
{
    Instance *m = c;
    snprintf(m->text, sizeof m->text, "%s", v[0]);
    return behave(m, "SetString", m->time, 0.15);
}
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String v[])
{
    Instance *m = c;
    v[0] = m->text;
    return behave(m, "GetString", m->time, 0.25);
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean final)
{
    Instance *m = c;
    m->time = t + h;
    m->y = m->u / 2 + m->time;
    return behave(m, "DoStep", t, 0.15);
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    Instance *m = c;
    fmi2Status status = behave(m, "GetFMUstate", m->time, 0.25);
    if (*state == NULL)
        *state = malloc(sizeof(Instance));
    memcpy(*state, m, sizeof(Instance));
    return status;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    Instance *m = c;
    fmi2Status status = behave(m, "SetFMUstate", m->time, 0.25);
    memcpy(m, state, sizeof(Instance));
    return status;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    Instance *m = c;
    fmi2Status status = behave(m, "FreeFMUstate", m->time, 0.25);
    free(*state);
    *state = NULL;
    return status;
}

/* Nobody calls these; an importer looks whether they are there. */
#define NOTHING(name) fmi2Status name(void) { return fmi2Error; }
NOTHING(fmi2GetTypesPlatform)
NOTHING(fmi2GetVersion)
NOTHING(fmi2SetDebugLogging)
NOTHING(fmi2Reset)
NOTHING(fmi2SerializedFMUstateSize)
NOTHING(fmi2SerializeFMUstate)
NOTHING(fmi2DeSerializeFMUstate)
NOTHING(fmi2GetDirectionalDerivative)
NOTHING(fmi2SetRealInputDerivatives)
NOTHING(fmi2GetRealOutputDerivatives)
NOTHING(fmi2CancelStep)
NOTHING(fmi2GetStatus)
NOTHING(fmi2GetRealStatus)
NOTHING(fmi2GetIntegerStatus)
NOTHING(fmi2GetBooleanStatus)
NOTHING(fmi2GetStringStatus)
