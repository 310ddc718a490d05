/* What FMI 2.0 and FMI 3.0 have in common: life, order of calls, steps. A call that is refused changes nothing. */
#include "component.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const PHASE_NAMES[PHASES] = {
    "before the initialisation", "during the initialisation", "between steps", "after a failed call",
    "after the termination", "in event mode", "in continuous time"};

/* Those of the model description. */
enum { WARNINGS, ERRORS, ALL, CATEGORY_COUNT };
static const char *const CATEGORIES[CATEGORY_COUNT] = {"logStatusWarning", "logStatusError", "logAll"};
#define ONLY(category) (1u << (category))

#if defined(TRIHEDRON_UCRT_ONLY)
/* Linked with nothing but the C library that Windows has: vsnprintf is a function of its headers. */
int _fltused = 0;
int __stdcall TrihedronEntry(void *module, unsigned long reason, void *reserved);
int __stdcall TrihedronEntry(void *module, unsigned long reason, void *reserved)
{
    (void)module;
    (void)reason;
    (void)reserved;
    return 1;
}
#define FORMAT(text, format, arguments) __stdio_common_vsprintf(2, text, sizeof text, format, NULL, arguments)
#else
#define FORMAT(text, format, arguments) vsnprintf(text, sizeof text, format, arguments)
#endif

/* Log why a call is refused. A logger may take its text for a format, so there is no percent sign in it. */
int say(const Listener *listener, const char *format, ...)
{
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    FORMAT(text, format, arguments);
    va_end(arguments);
    for (char *at = text; *at; at++) {
        if (*at == '%') {
            *at = '/';
        }
    }
    if (!(listener->muted & ONLY(ERRORS))) {
        emit(listener, ERROR, CATEGORIES[ERRORS], text);
    }
    return ERROR;
}

void refuse_in_phase(Component *c, const char *call)
{
    refuse(c, "%s is not allowed %s", call, PHASE_NAMES[c->state.phase]);
}

void reset(Component *c)
{
    c->state.time = NAN; /* until the experiment is set up */
    c->state.stop = INFINITY;
    c->state.phase = INSTANTIATED;
    c->state.stale = 0;
    memcpy(c->state.memory, start_values, sizeof c->state.memory);
}

Component *create(const char *token, const Listener *listener, int exchange)
{
    const char *name = listener->name;
    if (!name || name[strspn(name, " \t\n\r")] == '\0') {
        say(listener, "instantiation: the instance has no name");
        return NULL;
    }
    if (!token || strcmp(token, MODEL_TOKEN) != 0) {
        say(listener, "instantiation: the identity is %s, this FMU's is " MODEL_TOKEN, token ? token : "missing");
        return NULL;
    }
    if (exchange && !EXCHANGE) {
        say(listener, "instantiation: this FMU is for co-simulation only");
        return NULL;
    }
    Component *c = calloc(1, sizeof *c);
    char *copy = malloc(strlen(name) + 1);
    if (!c || !copy) {
        free(c);
        free(copy);
        say(listener, "instantiation: there is not enough memory");
        return NULL;
    }
    c->mark = INSTANCE_MARK;
    c->name = strcpy(copy, name);
    c->exchange = exchange;
    c->listener = *listener;
    c->listener.name = c->name;
    reset(c);
    return c;
}

void destroy(Component *c)
{
    if (c && c->mark == INSTANCE_MARK) {
        c->mark = 0;
        free(c->name);
        free(c);
    }
}

/* Take the times of the experiment. */
int begin(Component *c, const char *call, double start, int has_stop, double stop)
{
    if (!finite_number(start)) {
        return refuse(c, "%s: the start time is not a finite number", call);
    }
    if (has_stop && !(stop >= start)) {
        return refuse(c, "%s: the stop time is before the start time", call);
    }
    c->state.time = start;
    c->state.stop = has_stop ? stop : INFINITY;
    return OK;
}

/* Bring the outputs that follow inputs, or time, up to date. */
int respond(Component *c, const char *call)
{
    c->state.stale = 0;
    if (EXCHANGE && c->exchange) {
        return catch_up(c, call);
    }
    model_respond(c->state.memory, c->state.time, 0.0);
    return OK;
}

int finish_initialisation(Component *c, const char *call)
{
    int64_t message = model_initialise(c->state.memory, c->state.time, 0.0);
    if (message != 0) {
        c->state.phase = FAILED;
        return refuse(c, "%s: %s", call, messages[message - 1]);
    }
    c->state.phase = EXCHANGE && c->exchange ? EVENTS : STEPPING;
    return c->state.phase == EVENTS ? accept_time(c, call) : respond(c, call);
}

int do_step(Component *c, const char *call, double time, double step)
{
    State *state = &c->state;
    if (!(fabs(time) < INFINITY && step > 0.0 && step < INFINITY)) {
        return refuse(c, "%s: a step of %.17g s from %.17g s is not positive", call, step, time);
    }
    /* Without a branch for steps that begin to the bit where the last one ended: nobody can predict the last bit. */
    const double tolerance = 1e-9 * (1.0 + fabs(time)) + 1e-6 * step;
    if (!(fabs(time - state->time) <= tolerance)) {
        return refuse(c, "%s: the step begins at %.17g s, the instance stands at %.17g s", call, time, state->time);
    }
    if (time + step > state->stop + tolerance) {
        return refuse(c, "%s: the step ends at %.17g s, after the stop time %.17g s", call, time + step, state->stop);
    }
    state->time = time;
    int64_t message = model_step(state->memory, time, step);
    if (message != 0) {
        state->phase = FAILED;
        return refuse(c, "%s at %.17g s: %s", call, time, messages[message - 1]);
    }
    state->time = time + step;
    return respond(c, call);
}

int set_logging(Component *c, const char *call, int logging, size_t count, const char *const *categories)
{
    /* No categories are all of them. */
    unsigned muted = logging && count ? ~0u : 0u;
    if (count && !categories) {
        return refuse(c, "%s: the array of categories is missing", call);
    }
    for (size_t i = 0; i < count; i++) {
        int k = 0;
        while (k < CATEGORY_COUNT && !(categories[i] && strcmp(categories[i], CATEGORIES[k]) == 0)) {
            k++;
        }
        if (k == CATEGORY_COUNT) {
            return refuse(c, "%s: there is no log category %s", call, categories[i] ? categories[i] : "(missing)");
        }
        muted &= k == ALL ? 0u : ~ONLY(k);
    }
    c->listener.logging = logging;
    c->listener.muted = muted;
    return OK;
}
