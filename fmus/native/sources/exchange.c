/* Model exchange without continuous states: from the last accepted time the model takes one step to wherever time is
   set, with the inputs that stood when that was accepted; trial times change nothing. */
#include "component.h"

#include <math.h>
#include <string.h>

#if EXCHANGE

/* The outputs at the time that was set; what was set of inputs and parameters since stays. */
int catch_up(Component *c, const char *call)
{
    State *s = &c->state;
    memcpy(c->preview, s->base, sizeof c->preview);
    int64_t message = s->time > s->reached ? model_step(c->preview, s->reached, s->time - s->reached) : 0;
    if (message != 0) {
        s->phase = FAILED;
        return refuse(c, "%s at %.17g s: %s", call, s->time, messages[message - 1]);
    }
    for (size_t i = 0; i < VARIABLE_COUNT; i++) {
        const Variable *v = &variables[i];
        if (v->causality != OUTPUT) {
            memcpy(c->preview + v->place, s->memory + v->place, v->size * sizeof(double));
        }
    }
    memcpy(s->memory, c->preview, sizeof s->memory);
    return OK;
}

/* The time of the next event as things stand; infinite where there is none. */
static double next_event(Component *c)
{
    memcpy(c->preview, c->state.base, sizeof c->preview);
    /* Commands are heard at the beginning of a step, whatever its length. */
    if (model_step(c->preview, c->state.time, 1.0) != 0) {
        return INFINITY;
    }
    double time = model_next_event(c->preview, c->state.time);
    return time < 1e300 ? time : INFINITY;
}

/* The time that was reached is the one from which it goes on. */
int accept_time(Component *c, const char *call)
{
    State *s = &c->state;
    if (s->stale && respond(c, call) != OK) {
        return ERROR;
    }
    memcpy(s->base, s->memory, sizeof s->base);
    s->reached = s->time;
    return OK;
}

int set_time(Component *c, const char *call, double time)
{
    State *s = &c->state;
    if (!finite_number(time) || time < s->reached - 1e-9 * (1.0 + fabs(time))) {
        return refuse(c, "%s: %.17g s is before %.17g s, which was accepted", call, time, s->reached);
    }
    s->time = time < s->reached ? s->reached : time;
    s->stale = 1;
    return OK;
}

int update_events(Component *c, const char *call, int *defined, double *time)
{
    if (!defined || !time) {
        return refuse(c, "%s: there is no place for what it returns", call);
    }
    if (accept_time(c, call) != OK) {
        return ERROR;
    }
    c->state.announced = next_event(c);
    *defined = c->state.announced < INFINITY;
    *time = *defined ? c->state.announced : 0.0;
    return OK;
}

int complete_step(Component *c, const char *call, int *enter_events)
{
    if (!enter_events) {
        return refuse(c, "%s: there is no place for what it returns", call);
    }
    if (accept_time(c, call) != OK) {
        return ERROR;
    }
    /* A command that came without an event brings other events; one that is due is known. */
    *enter_events = c->state.announced > c->state.time && next_event(c) != c->state.announced;
    return OK;
}

#else

int catch_up(Component *c, const char *call)
{
    return refuse(c, "%s: this FMU is for co-simulation only", call);
}

int accept_time(Component *c, const char *call)
{
    return catch_up(c, call);
}

int set_time(Component *c, const char *call, double time)
{
    (void)time;
    return catch_up(c, call);
}

int update_events(Component *c, const char *call, int *defined, double *time)
{
    (void)defined;
    (void)time;
    return catch_up(c, call);
}

int complete_step(Component *c, const char *call, int *enter_events)
{
    (void)enter_events;
    return catch_up(c, call);
}

#endif

int change_phase(Component *c, const char *call, int64_t phase)
{
    if (accept_time(c, call) != OK) {
        return ERROR;
    }
    c->state.phase = phase;
    return OK;
}

int no_states(Component *c, const char *call, size_t count)
{
    return count ? refuse(c, "%s: there are no continuous states and no event indicators", call) : OK;
}
