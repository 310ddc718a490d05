/* Values in and out, by value reference: all are checked before the first is written. */
#include "component.h"

#include <stdbool.h>
#include <string.h>

/* Refuse missing arrays, references that nothing has, another type's, and a wrong number of values. */
static int check_call(Component *c, const char *call, Type type, Layout layout, const uint32_t *references,
                      size_t count, const void *values, size_t value_count)
{
    size_t total = 0;
    if (count == 0 && value_count == 0) {
        return OK;
    }
    if (!references || !values) {
        return refuse(c, "%s: the array of %s is missing", call, references ? "values" : "value references");
    }
    for (size_t i = 0; i < count; i++) {
        if (references[i] > VARIABLE_COUNT) {
            return refuse(c, "%s: there is no value reference %lu", call, (unsigned long)references[i]);
        }
        Type own = references[i] ? variables[references[i] - 1].type : REAL;
        /* FMI 2.0 passes enumerations as integers. */
        if (own != type && !(own == ENUMERATION && type == INTEGER && layout == INTS && FMI_VERSION == 2)) {
            return refuse(c, "%s: %s is of another type", call, references[i] ? variables[references[i] - 1].name : "time");
        }
        total += references[i] ? variables[references[i] - 1].size : 1;
    }
    if (total != value_count) {
        return refuse(c, "%s: %lu values are given for %lu elements", call, (unsigned long)value_count,
                      (unsigned long)total);
    }
    return OK;
}

static double value_at(Layout layout, const void *values, size_t i)
{
    switch (layout) {
    case DOUBLES:
        return ((const double *)values)[i];
    case INTS:
        return ((const int *)values)[i];
    case INT64S:
        return (double)((const int64_t *)values)[i];
    default:
        return ((const bool *)values)[i] ? 1.0 : 0.0;
    }
}

static void put(Layout layout, void *values, size_t i, double value)
{
    switch (layout) {
    case DOUBLES:
        ((double *)values)[i] = value;
        break;
    case INTS:
        ((int *)values)[i] = (int)value;
        break;
    case INT64S:
        ((int64_t *)values)[i] = (int64_t)value;
        break;
    default:
        ((bool *)values)[i] = value != 0.0;
    }
}

static int check_set(Component *c, const char *call, const Variable *v, Layout layout, const void *values, size_t at)
{
    if (v->causality == OUTPUT) {
        return refuse(c, "%s: %s cannot be set: it is neither a parameter nor an input", call, v->name);
    }
    if (v->causality == INPUT) {
        return OK;
    }
    if (v->fixed && IN(c->state.phase) & RUNNING) {
        return refuse(c, "%s: %s is fixed: it cannot be set after initialisation", call, v->name);
    }
    if (c->state.phase == FLOWING) {
        return refuse(c, "%s: %s cannot be set in continuous time", call, v->name);
    }
    for (size_t i = 0; i < v->size; i++) {
        double value = value_at(layout, values, at + i);
        if (!finite_number(value)) {
            return refuse(c, "%s: %s is set to what is not a finite number", call, v->name);
        }
        if (value < v->lower || value > v->upper) {
            return refuse(c, "%s: %s = %.17g is outside [%.17g, %.17g]", call, v->name, value, v->lower, v->upper);
        }
    }
    return OK;
}

int set_values(Component *c, const char *call, Type type, Layout layout, const uint32_t *references, size_t count,
               const void *values, size_t value_count)
{
    if (check_call(c, call, type, layout, references, count, values, value_count) != OK) {
        return ERROR;
    }
    for (size_t i = 0, at = 0; i < count; i++) {
        if (references[i] == 0) {
            return refuse(c, "%s: time cannot be set: it is neither a parameter nor an input", call);
        }
        const Variable *v = &variables[references[i] - 1];
        if (check_set(c, call, v, layout, values, at) != OK) {
            return ERROR;
        }
        at += v->size;
    }
    for (size_t i = 0, at = 0; i < count; i++) {
        const Variable *v = &variables[references[i] - 1];
        for (size_t k = 0; k < v->size; k++) {
            double value = value_at(layout, values, at++);
            c->state.memory[v->place + k] = v->type == BOOLEAN ? (value != 0.0) : value;
        }
    }
    c->state.stale |= c->state.phase == STEPPING;
    return OK;
}

int get_values(Component *c, const char *call, Type type, Layout layout, const uint32_t *references, size_t count,
               void *values, size_t value_count)
{
    if (check_call(c, call, type, layout, references, count, values, value_count) != OK) {
        return ERROR;
    }
    const double *memory = c->state.memory;
    if (c->state.stale && respond(c, call) != OK) {
        return ERROR;
    }
    if (c->state.phase == INITIALISING) {
        /* What the outputs would be if the initialisation ended now, tried on a copy. */
        for (size_t i = 0; i < count; i++) {
            if (references[i] && variables[references[i] - 1].causality == OUTPUT) {
                memcpy(c->preview, c->state.memory, sizeof c->preview);
                int64_t message = model_initialise(c->preview, c->state.time, 0.0);
                if (message != 0) {
                    return refuse(c, "%s: %s", call, messages[message - 1]);
                }
                model_respond(c->preview, c->state.time, 0.0);
                memory = c->preview;
                break;
            }
        }
    }
    for (size_t i = 0, at = 0; i < count; i++) {
        if (references[i] == 0) {
            put(layout, values, at++, c->state.time);
            continue;
        }
        const Variable *v = &variables[references[i] - 1];
        for (size_t k = 0; k < v->size; k++) {
            put(layout, values, at++, memory[v->place + k]);
        }
    }
    return OK;
}

/* The derivative of outputs along a direction of inputs and parameters, as the instance stands; nothing is changed. */
int differentiate(Component *c, const char *call, const uint32_t *unknowns, size_t unknown_count,
                  const uint32_t *knowns, size_t known_count, const double *seed, size_t seed_count,
                  double *sensitivity, size_t sensitivity_count)
{
#if DERIVATIVES
    if (check_call(c, call, REAL, DOUBLES, unknowns, unknown_count, sensitivity, sensitivity_count) != OK ||
        check_call(c, call, REAL, DOUBLES, knowns, known_count, seed, seed_count) != OK) {
        return ERROR;
    }
    for (size_t i = 0; i < unknown_count; i++) {
        if (!unknowns[i] || variables[unknowns[i] - 1].causality != OUTPUT) {
            return refuse(c, "%s: an unknown is no output", call);
        }
    }
    memset(c->dot, 0, sizeof c->dot);
    for (size_t i = 0, at = 0; i < known_count; i++) {
        if (!knowns[i] || variables[knowns[i] - 1].causality == OUTPUT) {
            return refuse(c, "%s: a known is neither an input nor a parameter", call);
        }
        const Variable *v = &variables[knowns[i] - 1];
        for (size_t k = 0; k < v->size; k++) {
            c->dot[v->place + k] += seed[at++];
        }
    }
    memcpy(c->preview, c->state.memory, sizeof c->preview);
    int64_t message = model_differentiate(c->preview, c->dot, c->state.time, c->state.phase == INITIALISING);
    if (message != 0) {
        return refuse(c, "%s: %s", call, messages[message - 1]);
    }
    for (size_t i = 0, at = 0; i < unknown_count; i++) {
        const Variable *v = &variables[unknowns[i] - 1];
        for (size_t k = 0; k < v->size; k++) {
            sensitivity[at++] = c->dot[v->place + k];
        }
    }
    return OK;
#else
    (void)unknowns;
    (void)unknown_count;
    (void)knowns;
    (void)known_count;
    (void)seed;
    (void)seed_count;
    (void)sensitivity;
    (void)sensitivity_count;
    return refuse(c, "%s: the FMU does not provide it", call);
#endif
}
