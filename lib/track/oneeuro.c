/* The one-euro filter (Casiez et al. 2012): a low-pass whose cut-off rises
 * with speed, so that a still head does not tremble and a moving one does not
 * lag. */
#include "lib/track/oneeuro.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define TWO_PI 6.283185307179586
#define SPEED_CUTOFF 1.0        /* Hz, of the derivative */

void oneeuro_init(struct oneeuro *f, double cutoff)
{
    memset(f, 0, sizeof *f);
    f->cutoff = cutoff;
}

void oneeuro_reset(struct oneeuro *f)
{
    f->started = false;
}

/* Weight of the new sample after dt seconds of an exponential filter. */
static double oneeuro_weight(double cutoff, double dt)
{
    double r = TWO_PI * cutoff * dt;

    return r / (r + 1);
}

void oneeuro_step(struct oneeuro *f, float *x, const float *beta, size_t n,
                  double time)
{
    double dt = time - f->time;

    assert(n <= ONEEURO_MAX);
    if (f->cutoff <= 0)
        return;
    f->time = time;
    if (!f->started) {
        memcpy(f->x, x, n * sizeof *x);
        memset(f->dx, 0, sizeof f->dx);
        f->started = true;
        return;
    }
    if (!(dt > 1e-6))
        dt = 1e-6;
    for (size_t i = 0; i < n; i++) {
        double v = ((double)x[i] - f->x[i]) / dt;
        double a = oneeuro_weight(SPEED_CUTOFF, dt);
        f->dx[i] = (float)(a * v + (1 - a) * f->dx[i]);
        a = oneeuro_weight(f->cutoff + beta[i] * fabs(f->dx[i]), dt);
        f->x[i] = (float)(a * x[i] + (1 - a) * f->x[i]);
        x[i] = f->x[i];
    }
}
