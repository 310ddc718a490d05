/* A host in C: increments into an FMU of FMI 2.0, a step, the attitude out of it, sample after sample. */
#include <stddef.h>

typedef int (*Set)(void *, const unsigned *, size_t, const double *);
typedef int (*Get)(void *, const unsigned *, size_t, double *);
typedef int (*Step)(void *, double, double, int);

int run(void *instance, Set set, Step step, Get get, unsigned first_input, unsigned first_output, double period,
        const double *increments, long samples, double *attitudes)
{
    const unsigned in[3] = {first_input, first_input + 1, first_input + 2};
    const unsigned out[4] = {first_output, first_output + 1, first_output + 2, first_output + 3};
    for (long k = 0; k < samples; k++) {
        if (set(instance, in, 3, increments + 3 * k) || step(instance, (double)k * period, period, 1) ||
            get(instance, out, 4, attitudes + 4 * k)) {
            return 1;
        }
    }
    return 0;
}
