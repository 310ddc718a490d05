/* An FMI 3.0 co-simulation FMU with an input and an output of two elements of each numeric type: out = in after a
   step. `sum` adds up the steps; after t = 0.5 it stops if told to. Value references: input 2 n + 1, output 2 n + 2. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fmi3Functions.h"

typedef union {
    fmi3Float64 f64[2]; fmi3Float32 f32[2]; fmi3Int8 i8[2]; fmi3UInt8 u8[2]; fmi3Int16 i16[2]; fmi3UInt16 u16[2];
    fmi3Int32 i32[2]; fmi3UInt32 u32[2]; fmi3Int64 i64[2]; fmi3UInt64 u64[2]; fmi3Boolean b[2];
} Pair;

typedef struct {
    Pair values[24];
    double stops, sum, time;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Instance;

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event, fmi3Boolean early, const fmi3ValueReference required[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    Instance *m = calloc(1, sizeof(Instance));
    m->environment = environment;
    m->log = log;
    return m;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
const char *fmi3GetVersion(void) { return "3.0"; }

#define ACCESS(Type, c_type)                                                                                           \
    fmi3Status fmi3Set##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const c_type v[], size_t nv)     \
    {                                                                                                                  \
        Instance *m = c;                                                                                               \
        for (size_t i = 0; i < n; i++) {                                                                               \
            if (vr[i] == 50) {                                                                                         \
                m->stops = (double)v[i];                                                                               \
                return fmi3OK;                                                                                         \
            }                                                                                                          \
            if (nv != 2 * n)                                                                                           \
                return fmi3Error;                                                                                      \
            memcpy(&m->values[vr[i]], &v[2 * i], 2 * sizeof(c_type));                                                  \
        }                                                                                                              \
        return fmi3OK;                                                                                                 \
    }                                                                                                                  \
    fmi3Status fmi3Get##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, c_type v[], size_t nv)           \
    {                                                                                                                  \
        Instance *m = c;                                                                                               \
        size_t at = 0;                                                                                                 \
        if (sizeof(c_type) == 8 && m->stops == 5.0 && m->time > 0.5)                                                   \
            return fmi3Discard;                                                                                        \
        for (size_t i = 0; i < n; i++) {                                                                               \
            if (vr[i] == 51) {                                                                                         \
                v[at++] = (c_type)m->sum;                                                                              \
                continue;                                                                                              \
            }                                                                                                          \
            memcpy(&v[at], &m->values[vr[i]], 2 * sizeof(c_type));                                                     \
            at += 2;                                                                                                   \
        }                                                                                                              \
        return at == nv ? fmi3OK : fmi3Error;                                                                          \
    }

ACCESS(Float64, fmi3Float64)
ACCESS(Float32, fmi3Float32)
ACCESS(Int8, fmi3Int8)
ACCESS(UInt8, fmi3UInt8)
ACCESS(Int16, fmi3Int16)
ACCESS(UInt16, fmi3UInt16)
ACCESS(Int32, fmi3Int32)
ACCESS(UInt32, fmi3UInt32)
ACCESS(Int64, fmi3Int64)
ACCESS(UInt64, fmi3UInt64)
ACCESS(Boolean, fmi3Boolean)

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean prior, fmi3Boolean *event,
    fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    Instance *m = c;
    *event = *terminate = *early = fmi3False;
    *last = m->time = time + step;
    for (int n = 0; n < 11; n++)
        m->values[2 * n + 2] = m->values[2 * n + 1];
    m->sum += step;
    if (time < 0.5)
        return fmi3OK;
    if (m->stops == 1.0) {
        m->log(m->environment, fmi3Error, "logStatusError", "fuse blown: 100%s");
        return fmi3Error;
    }
    if (m->stops == 2.0)
        *terminate = fmi3True;
    if (m->stops == 3.0)
        *early = fmi3True;
    if (m->stops == 4.0)
        m->sum = NAN;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 start, fmi3Boolean d,
    fmi3Float64 stop) { return fmi3OK; }
#define NOTHING(name) fmi3Status name(fmi3Instance c) { return fmi3OK; }
NOTHING(fmi3ExitInitializationMode)
NOTHING(fmi3Terminate)
NOTHING(fmi3Reset)
