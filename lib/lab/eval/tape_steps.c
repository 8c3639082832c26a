/* The steps, one kind after the other. */
#include "lib/lab/eval/tape_steps.h"

#include "lib/base/parallel.h"
#include "lib/lab/eval/max_pool.h"

/* ---- norms ----------------------------------------------------------------- */

static void tape_norm_plan(struct tape_step *s, struct nn_plan *p)
{
    batch_norm_plan(s->layer, p, s->batch * s->h * s->w);
}

static void tape_norm_forward(struct tape_step *s)
{
    batch_norm_forward(s->out, s->of[0]->x, NULL, s->layer);
}

static void tape_norm_backward(float *to, struct tape_step *s, int k)
{
    batch_norm_backward(to, s->d, s->of[k]->x, s->layer);
}

int tape_norm(struct tape *t, int of, const char *name, float eps,
              enum nn_act act)
{
    static const struct tape_op op = {
        sizeof(struct batch_norm), 0, false, tape_norm_plan,
        tape_norm_forward, tape_norm_backward, NULL
    };
    const int map = TAPE_STEP(t, &op, of);
    struct batch_norm *n = t->map[map]->layer;

    batch_norm_init(n, t->ps, name, tape_channels(t, of), eps);
    t->ps->tensor[n->weight].frozen = t->ps->tensor[n->bias].frozen = true;
    n->act = act;
    return map;
}

/* ---- pooling ---------------------------------------------------------------- */

struct tape_pool {
    struct max_pool pool;
    size_t before;
    bool cut;
};

static void tape_pool_plan(struct tape_step *s, struct nn_plan *p)
{
    struct tape_pool *l = s->layer;

    max_pool_plan(&l->pool, p, s->batch, s->h, s->w, s->channels,
                  l->before, l->cut);
    s->h = l->pool.oh;
    s->w = l->pool.ow;
}

static void tape_pool_forward(struct tape_step *s)
{
    struct tape_pool *l = s->layer;

    max_pool_forward(s->out, s->of[0]->x, &l->pool);
}

static void tape_pool_backward(float *to, struct tape_step *s, int k)
{
    const struct tape_pool *l = s->layer;

    (void)k;
    max_pool_backward(to, s->d, &l->pool);
}

int tape_pool(struct tape *t, int of, size_t before, bool cut)
{
    static const struct tape_op op = {
        sizeof(struct tape_pool), 0, false, tape_pool_plan,
        tape_pool_forward, tape_pool_backward, NULL
    };
    const int map = TAPE_STEP(t, &op, of);
    struct tape_pool *l = t->map[map]->layer;

    *l = (struct tape_pool){.before = before, .cut = cut};
    return map;
}

/* ---- half and twice ----------------------------------------------------------- */

/* One pixel of y. */
PARALLEL(tape_sum_part, r, const float *, x, float *, y, size_t, w, size_t, C,
         float, scale)
{
    const float *a = x + (r / w * 4 * w + r % w * 2) * C;
    const float *b = a + 2 * w * C;

    for (size_t c = 0; c < C; c++)
        y[r * C + c] = scale * (a[c] + a[C + c] + b[c] + b[C + c]);
}

/* y, as large as `half` = scale * the sums of 2x2 pixels of x. */
static void tape_sum(float *y, const float *x, const struct tape_step *half,
                     float scale)
{
    parallel_each(tape_sum_part, half->batch * half->h * half->w, 1, x, y,
                  half->w, half->channels, scale);
}

/* One pixel of y. */
PARALLEL(tape_spread_part, r, const float *, x, float *, y, size_t, w,
         size_t, C, float, scale)
{
    const float *a = x + (r / (4 * w) * w + r % (2 * w) / 2) * C;

    for (size_t c = 0; c < C; c++)
        y[r * C + c] = scale * a[c];
}

/* y = scale * x, which is as large as `half`, each pixel four times. */
static void tape_spread(float *y, const float *x, const struct tape_step *half,
                        float scale)
{
    parallel_each(tape_spread_part, 4 * half->batch * half->h * half->w, 1, x,
                  y, half->w, half->channels, scale);
}

static void tape_halve_plan(struct tape_step *s, struct nn_plan *p)
{
    (void)p;
    s->h /= 2;
    s->w /= 2;
}

static void tape_halve_forward(struct tape_step *s)
{
    tape_sum(s->out, s->of[0]->x, s, 0.25f);
}

static void tape_halve_backward(float *to, struct tape_step *s, int k)
{
    (void)k;
    tape_spread(to, s->d, s, 0.25f);
}

int tape_halve(struct tape *t, int of)
{
    static const struct tape_op op = {
        0, 0, false, tape_halve_plan, tape_halve_forward,
        tape_halve_backward, NULL
    };

    return TAPE_STEP(t, &op, of);
}

static void tape_double_plan(struct tape_step *s, struct nn_plan *p)
{
    (void)p;
    s->h *= 2;
    s->w *= 2;
}

static void tape_double_forward(struct tape_step *s)
{
    tape_spread(s->out, s->of[0]->x, s->of[0], 1);
}

static void tape_double_backward(float *to, struct tape_step *s, int k)
{
    tape_sum(to, s->d, s->of[k], 1);
}

int tape_double(struct tape *t, int of)
{
    static const struct tape_op op = {
        0, 0, false, tape_double_plan, tape_double_forward,
        tape_double_backward, NULL
    };

    return TAPE_STEP(t, &op, of);
}

/* ---- prelu ---------------------------------------------------------------------- */

struct tape_prelu {
    struct params *ps;
    size_t slope;               /* tensor (channels) */
};

/* One pixel of y. */
PARALLEL(tape_prelu_part, r, const float *, x, const float *, from, float *, y,
         const float *, slope, size_t, C)
{
    for (size_t c = r * C; c < (r + 1) * C; c++)
        y[c] = x[c] < 0 ? from[c] * slope[c - r * C] : from[c];
}

/* y = x, or x's gradient from y's, times the slopes where x is negative. */
static void tape_lean(float *y, const float *from, const struct tape_step *s)
{
    const struct tape_prelu *l = s->layer;

    parallel_each(tape_prelu_part, s->batch * s->h * s->w, 1, s->of[0]->x, from,
                  y, param_w(l->ps, l->slope), s->channels);
}

static void tape_prelu_forward(struct tape_step *s)
{
    tape_lean(s->out, s->of[0]->x, s);
}

static void tape_prelu_backward(float *to, struct tape_step *s, int k)
{
    (void)k;
    tape_lean(to, s->d, s);
}

int tape_prelu(struct tape *t, int of, const char *name)
{
    static const struct tape_op op = {
        sizeof(struct tape_prelu), 0, false, NULL, tape_prelu_forward,
        tape_prelu_backward, NULL
    };
    const size_t C = tape_channels(t, of);
    const int map = TAPE_STEP(t, &op, of);
    struct tape_prelu *l = t->map[map]->layer;

    l->ps = t->ps;
    l->slope = params_add(t->ps, name, 1, &C, PARAM_ZERO, 0);
    t->ps->tensor[l->slope].frozen = true;
    return map;
}
