/* The one-euro filter (Casiez et al. 2012): a low-pass whose cut-off rises
 * with speed, so that a still head does not tremble and a moving one does not
 * lag. */
#include "lib/track/oneeuro.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "lib/base/rotation.h"
#include "lib/net/motion_code.h"
#include "lib/net/motion_encoder.h"

#define SPEED_CUTOFF 1.0        /* Hz, of the derivative */
#define DEPTH_SCALE 10          /* depth is known less well than x and y */

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
    double r = 2 * M_PI * cutoff * dt;

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

void oneeuro_motion(struct oneeuro *filter, struct motion *m, double time)
{
    static const size_t end[6] = {MOTION_TRANS, MOTION_EXP, MOTION_JAW,
                                  MOTION_LID, MOTION_EYE, MOTION_OUT};
    static const float speed[6] = {2, 4, 0.7f, 1.5f, 6, 2};     /* beta, Hz */
    const size_t exp = MOTION_JAW - MOTION_EXP;
    const bool first = !filter->started;
    float x[MOTION_OUT], beta[MOTION_OUT];

    if (filter->cutoff <= 0)
        return;
    for (size_t i = 0, k = 0; i < MOTION_OUT; i++) {
        k += i == end[k];
        beta[i] = speed[k];
    }
    rotation_to_6d(x + MOTION_ROT, m->R);
    memcpy(x + MOTION_TRANS, m->t, sizeof m->t);
    x[MOTION_TRANS + 2] /= DEPTH_SCALE;
    memcpy(x + MOTION_EXP, m->exp, exp * sizeof *x);
    memcpy(x + MOTION_JAW, m->pose.jaw, sizeof m->pose.jaw);
    memcpy(x + MOTION_LID, m->pose.lid, sizeof m->pose.lid);
    memcpy(x + MOTION_EYE, m->pose.eye, sizeof m->pose.eye);
    oneeuro_step(filter, x, beta, MOTION_OUT, time);
    if (first)
        return;                        /* as it is, to the bit */
    motion_code_rotation(m->R, x + MOTION_ROT);
    memcpy(m->t, x + MOTION_TRANS, sizeof m->t);
    m->t[2] *= DEPTH_SCALE;
    memcpy(m->exp, x + MOTION_EXP, exp * sizeof *x);
    memcpy(m->pose.jaw, x + MOTION_JAW, sizeof m->pose.jaw);
    memcpy(m->pose.lid, x + MOTION_LID, sizeof m->pose.lid);
    memcpy(m->pose.eye, x + MOTION_EYE, sizeof m->pose.eye);
}
