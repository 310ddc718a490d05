/* Update (22) behind the calls of FMI 2.0 for one instance, without any check: what sample by sample costs at least. */
#include <stddef.h>
#include <string.h>

#include "two_sample_rodrigues.c"

static double increments[2][3], attitude[4] = {1.0, 0.0, 0.0, 0.0};
static int taken;

int set_real(void *instance, const unsigned *references, size_t count, const double *values)
{
    for (size_t i = 0; i < count; i++)
        increments[taken][references[i] & 3] = values[i];
    return 0;
}

int do_step(void *instance, double time, double step, int final)
{
    taken = !taken;
    if (taken)
        return 0;
    double turned[4];
    turn(increments[0], increments[1], turned);
    multiply(attitude, turned, attitude);
    normalise(attitude);
    return 0;
}

int get_real(void *instance, const unsigned *references, size_t count, double *values)
{
    for (size_t i = 0; i < count; i++)
        values[i] = attitude[references[i] & 3];
    return 0;
}
