/* The state of an instance, handed out, taken back, written as bytes: always the whole of it. */
#include "component.h"

#include <stdlib.h>
#include <string.h>

static const char STATE_MARK[8] = {'T', 'R', 'I', 'H', 'S', 'T', 'A', '1'};

/* FNV-1a, word by word. */
static uint64_t check_of(const State *state)
{
    uint64_t hash = 14695981039346656037ull;
    for (size_t i = 0; i < sizeof *state; i += sizeof(uint64_t)) {
        uint64_t word;
        memcpy(&word, (const char *)state + i, sizeof word);
        hash = (hash ^ word) * 1099511628211ull;
        hash ^= hash >> 32;
    }
    return hash;
}

static void write_record(Record *record, const State *state)
{
    memcpy(record->mark, STATE_MARK, sizeof STATE_MARK);
    record->model = MODEL_HASH;
    record->size = sizeof(State);
    record->check = check_of(state);
    record->state = *state;
}

/* Whether this is the whole state of a component of this kind and version. */
static int check_record(Component *c, const char *call, const Record *record)
{
    if (!record) {
        return refuse(c, "%s: the state is missing", call);
    }
    if (memcmp(record->mark, STATE_MARK, sizeof STATE_MARK) != 0) {
        return refuse(c, "%s: this is not a state of a Trihedron component", call);
    }
    if (record->model != MODEL_HASH || record->size != sizeof(State)) {
        return refuse(c, "%s: the state is one of another component, or of another version of it", call);
    }
    if (record->check != check_of(&record->state)) {
        return refuse(c, "%s: the state is damaged", call);
    }
    if (record->state.phase < 0 || record->state.phase >= PHASES) {
        return refuse(c, "%s: the state is damaged", call);
    }
    return OK;
}

int save(Component *c, const char *call, void **record)
{
    if (!record) {
        return refuse(c, "%s: there is no place for the state", call);
    }
    if (*record && check_record(c, call, *record) != OK) {
        return ERROR;
    }
    Record *saved = *record ? *record : malloc(sizeof *saved);
    if (!saved) {
        return refuse(c, "%s: there is not enough memory", call);
    }
    write_record(saved, &c->state);
    *record = saved;
    return OK;
}

int restore(Component *c, const char *call, const void *record)
{
    if (check_record(c, call, record) != OK) {
        return ERROR;
    }
    const State *state = &((const Record *)record)->state;
    if (IN(state->phase) & RUNNING && (state->phase == STEPPING) == (c->exchange != 0)) {
        return refuse(c, "%s: the state is one of the other kind: co-simulation or model exchange", call);
    }
    c->state = *state;
    return OK;
}

int discard(Component *c, const char *call, void **record)
{
    if (!record || !*record) {
        return OK;
    }
    if (check_record(c, call, *record) != OK) {
        return ERROR;
    }
    memset(*record, 0, sizeof(Record));
    free(*record);
    *record = NULL;
    return OK;
}

int serialised_size(Component *c, const char *call, const void *record, size_t *size)
{
    if (!size) {
        return refuse(c, "%s: there is no place for the size", call);
    }
    if (check_record(c, call, record) != OK) {
        return ERROR;
    }
    *size = sizeof(Record);
    return OK;
}

int serialise(Component *c, const char *call, const void *record, void *bytes, size_t size)
{
    if (check_record(c, call, record) != OK) {
        return ERROR;
    }
    if (!bytes || size != sizeof(Record)) {
        return refuse(c, "%s: the state takes %lu bytes, %lu are given", call, (unsigned long)sizeof(Record),
                      (unsigned long)(bytes ? size : 0));
    }
    memcpy(bytes, record, sizeof(Record));
    return OK;
}

int deserialise(Component *c, const char *call, const void *bytes, size_t size, void **record)
{
    if (!record) {
        return refuse(c, "%s: there is no place for the state", call);
    }
    if (!bytes || size != sizeof(Record)) {
        return refuse(c, "%s: the state takes %lu bytes, %lu are given", call, (unsigned long)sizeof(Record),
                      (unsigned long)(bytes ? size : 0));
    }
    Record *read = malloc(sizeof *read);
    if (!read) {
        return refuse(c, "%s: there is not enough memory", call);
    }
    memcpy(read, bytes, sizeof *read);
    if (check_record(c, call, read) != OK) {
        free(read);
        return ERROR;
    }
    *record = read;
    return OK;
}
