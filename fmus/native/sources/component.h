/* A component behind FMI: its memory, its table of variables, the order in which it may be called. */
#ifndef COMPONENT_H
#define COMPONENT_H

#include <stddef.h>
#include <stdint.h>

#include "model.h"

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility push(hidden)
#endif

enum { OK = 0, WARNING = 1, DISCARD = 2, ERROR = 3 };

typedef enum { REAL, INTEGER, BOOLEAN, ENUMERATION } Type;
typedef enum { PARAMETER, INPUT, OUTPUT } Causality;

/* What a value reference stands for; reference 0 is the time, reference i is variables[i - 1]. */
typedef struct {
    const char *name;
    Type type;
    Causality causality;
    int fixed;
    size_t place; /* of its first element in the memory */
    size_t size;  /* elements; 1 for a scalar */
    double lower;
    double upper;
} Variable;

/* How many elements a value reference has: in FMI 2.0 each is one. */
#if FMI_VERSION == 2
#define ELEMENTS(reference) ((void)(reference), (size_t)1)
#else
#define ELEMENTS(reference) (variables[(reference) - 1].size)
#endif

/* Of model.c, made from the component's table and kernels. */
extern const Variable variables[];
extern const uint32_t reals[]; /* by value reference: four times the place of a real variable, + 2 of an input, + 1 */
extern const double start_values[];
extern const char *const messages[];
int64_t model_initialise(double *memory, double time, double step);
int64_t model_step(double *memory, double time, double step);
void model_respond(double *memory, double time, double step);
double model_next_event(double *memory, double time);
/* Carries a derivative of the memory through the initialisation, where it is not over, and the response. */
int64_t model_differentiate(double *memory, double *dot, double time, int initialising);

/* EVENTS and FLOWING, event mode and continuous time, are phases of model exchange, STEPPING of co-simulation. */
enum { INSTANTIATED, INITIALISING, STEPPING, FAILED, TERMINATED, EVENTS, FLOWING, PHASES };
#define IN(phase) (1u << (phase))
#define ANY_PHASE (IN(PHASES) - 1u)
#define RUNNING (IN(STEPPING) | IN(EVENTS) | IN(FLOWING))
#define INITIALISED (IN(INITIALISING) | RUNNING | IN(FAILED) | IN(TERMINATED))
#define SETTABLE (IN(INSTANTIATED) | IN(INITIALISING) | RUNNING)

/* Everything that decides what comes next: one block of eight-byte words without gaps. */
typedef struct {
    double time;
    double stop;
    int64_t phase;
    int64_t stale; /* outputs that follow the inputs, or time, at once wait for their kernel */
    double memory[MEMORY_SIZE];
#if EXCHANGE
    double reached;           /* time that was accepted last */
    double announced;         /* time of the next event */
    double base[MEMORY_SIZE]; /* the memory at the time that was accepted last */
#endif
} State;

/* A state outside its instance, as it is handed out and as it is serialised. */
typedef struct {
    char mark[8];
    uint64_t model;
    uint64_t size;
    uint64_t check;
    State state;
} Record;

/* Whom an instance tells why it refuses. */
typedef struct {
    const char *name;
    void *environment;
    void (*logger)(void);
    int logging;
    unsigned muted; /* a bit for each category of messages that is not told */
} Listener;

typedef struct {
    Listener listener;
    uint64_t mark; /* of a live instance */
    char *name;
    int exchange; /* whether it was made for model exchange */
    State state;
    double preview[MEMORY_SIZE];
#if DERIVATIVES
    double dot[MEMORY_SIZE];
#endif
} Component;

#define INSTANCE_MARK 0x314d4f4348495254ull /* "TRIHCOM1" */

/* How the values of a call are laid out. */
typedef enum { DOUBLES, INTS, INT64S, BOOLS } Layout;

/* Of fmi2.c or fmi3.c: hand a finished text to the logger of the environment. */
void emit(const Listener *listener, int status, const char *category, const char *text);

/* NaN and infinity fail it. */
static inline int finite_number(double x)
{
    return x - x == 0.0;
}

int say(const Listener *listener, const char *format, ...);
#define refuse(c, ...) say(&((Component *)(c))->listener, __VA_ARGS__)
void refuse_in_phase(Component *c, const char *call);

/* Whether a call is one of a live instance and allowed in its phase. */
static inline int may(Component *c, const char *call, unsigned phases)
{
    if (!c || c->mark != INSTANCE_MARK) {
        return 0;
    }
    if (!(phases & IN(c->state.phase))) {
        refuse_in_phase(c, call);
        return 0;
    }
    return 1;
}

Component *create(const char *token, const Listener *listener, int exchange);
void destroy(Component *c);
void reset(Component *c);
int respond(Component *c, const char *call);
int begin(Component *c, const char *call, double start, int has_stop, double stop);
int finish_initialisation(Component *c, const char *call);
int do_step(Component *c, const char *call, double time, double step);
int set_values(Component *c, const char *call, Type type, Layout layout, const uint32_t *references, size_t count,
               const void *values, size_t value_count);
int get_values(Component *c, const char *call, Type type, Layout layout, const uint32_t *references, size_t count,
               void *values, size_t value_count);

/* The calls of every step, real inputs set and real variables read, without a way round; all else as it comes. */
static inline int set_reals(Component *c, const char *call, const uint32_t *references, size_t count,
                            const double *values, size_t value_count)
{
    size_t total = 0;
    for (size_t i = 0; i < count; i++) {
        if (!references || references[i] > VARIABLE_COUNT || !(reals[references[i]] & 2u)) {
            return set_values(c, call, REAL, DOUBLES, references, count, values, value_count);
        }
        total += ELEMENTS(references[i]);
    }
    if (!values || total != value_count) {
        return set_values(c, call, REAL, DOUBLES, references, count, values, value_count);
    }
    for (size_t i = 0; i < count; i++) {
        double *place = c->state.memory + (reals[references[i]] >> 2);
        for (size_t k = 0; k < ELEMENTS(references[i]); k++) {
            place[k] = *values++;
        }
    }
    c->state.stale |= c->state.phase == STEPPING;
    return OK;
}

static inline int get_reals(Component *c, const char *call, const uint32_t *references, size_t count, double *values,
                            size_t value_count)
{
    size_t at = 0, i = 0;
    if (c->state.phase == STEPPING && !c->state.stale && references && values) {
        while (i < count && references[i] <= VARIABLE_COUNT && reals[references[i]] &&
               (FMI_VERSION == 2 || at + ELEMENTS(references[i]) <= value_count)) {
            const double *place = c->state.memory + (reals[references[i]] >> 2);
            for (size_t k = 0; k < ELEMENTS(references[i]); k++) {
                values[at++] = place[k];
            }
            i++;
        }
        if (i == count && at == value_count) {
            return OK;
        }
    }
    return get_values(c, call, REAL, DOUBLES, references, count, values, value_count);
}

int differentiate(Component *c, const char *call, const uint32_t *unknowns, size_t unknown_count,
                  const uint32_t *knowns, size_t known_count, const double *seed, size_t seed_count,
                  double *sensitivity, size_t sensitivity_count);
int catch_up(Component *c, const char *call);
int accept_time(Component *c, const char *call);
int set_time(Component *c, const char *call, double time);
int update_events(Component *c, const char *call, int *defined, double *time);
int complete_step(Component *c, const char *call, int *enter_events);
int change_phase(Component *c, const char *call, int64_t phase);
int no_states(Component *c, const char *call, size_t count);
int set_logging(Component *c, const char *call, int logging, size_t count, const char *const *categories);
int save(Component *c, const char *call, void **record);
int restore(Component *c, const char *call, const void *record);
int discard(Component *c, const char *call, void **record);
int serialised_size(Component *c, const char *call, const void *record, size_t *size);
int serialise(Component *c, const char *call, const void *record, void *bytes, size_t size);
int deserialise(Component *c, const char *call, const void *bytes, size_t size, void **record);

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility pop
#endif

#endif
