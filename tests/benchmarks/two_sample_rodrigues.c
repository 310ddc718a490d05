/* Update (22) and the product with the attitude, operation by operation as the kernels have them. */
#include <math.h>

static void multiply(const double *p, const double *q, double *r)
{
    const double w = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3];
    const double x = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2];
    const double y = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1];
    const double z = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0];
    r[0] = w;
    r[1] = x;
    r[2] = y;
    r[3] = z;
}

static double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void turn(const double *a, const double *b, double *turned)
{
    const double first = 0.25 + dot(a, a) / 48.0, second = 0.25 + dot(b, b) / 48.0, sixth = 1.0 / 6.0;
    turned[1] = first * a[0] + second * b[0] + sixth * (a[1] * b[2] - a[2] * b[1]);
    turned[2] = first * a[1] + second * b[1] + sixth * (a[2] * b[0] - a[0] * b[2]);
    turned[3] = first * a[2] + second * b[2] + sixth * (a[0] * b[1] - a[1] * b[0]);
    const double square = dot(turned + 1, turned + 1);
    const double scale = 1.0 / (1.0 + square);
    turned[0] = (1.0 - square) * scale;
    for (int i = 1; i < 4; i++)
        turned[i] = 2.0 * scale * turned[i];
}

static void normalise(double *q)
{
    const double scale = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++)
        q[i] = q[i] * scale;
}

/* `serial`: an update begins when the last one has ended, as behind calls. Else the processor overlaps them. */
void run(const double *increments, long steps, int renormalise, int serial, double *attitudes)
{
    double attitude[4] = {1.0, 0.0, 0.0, 0.0}, sample[6];
    for (long k = 0; k < steps; k++) {
        double turned[4];
        const double *taken = increments + 6 * k;
        if (serial) {
            for (int i = 0; i < 6; i++)
                sample[i] = taken[i] + 0.0 * attitude[0];
            taken = sample;
        }
        turn(taken, taken + 3, turned);
        multiply(attitude, turned, attitude);
        if (renormalise)
            normalise(attitude);
        for (int i = 0; i < 4; i++)
            attitudes[4 * k + i] = attitude[i];
    }
}
