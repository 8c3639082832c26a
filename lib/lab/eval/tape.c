/* The steps, one kind after the other: sizes, forward, backward. */
#include "lib/lab/eval/tape.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/image.h"

/* ---- declaring ------------------------------------------------------------ */

void tape_init(struct tape *t, struct params *ps, size_t channels)
{
    *t = (struct tape){.ps = ps, .count = 1, .picture.channels = channels};
    t->map[0] = &t->picture;
}

void tape_release(struct tape *t)
{
    nn_plan_release(&t->plan);
    arena_release(&t->memory);
    memset(t, 0, sizeof *t);
}

/* One more step on maps a and b, which may be -1.  Without memory, of which
 * tape_plan tells, it is the picture. */
static struct tape_step *tape_step(struct tape *t, enum tape_kind kind, int a,
                                   int b)
{
    struct tape_step *s = arena_take(&t->memory, 1, sizeof *s);

    if (!s || t->count == TAPE_MAPS) {
        t->memory.failed = true;
        return &t->picture;
    }
    t->map[t->count++] = s;
    *s = (struct tape_step){
        .kind = kind, .of = {t->map[a], b < 0 ? NULL : t->map[b]},
        .channels = t->map[a]->channels
    };
    return s;
}

int tape_conv(struct tape *t, int of, const char *name, size_t out,
              size_t kernel, bool bias)
{
    struct tape_step *s = tape_step(t, TAPE_CONV, of, -1);
    struct conv *c = &s->conv;

    conv_init(c, t->ps, name, s->channels, out, kernel, 1, bias);
    t->ps->tensor[c->weight].frozen = true;
    if (bias)
        t->ps->tensor[c->bias].frozen = true;
    s->channels = out;
    return t->count - 1;
}

struct conv *tape_layer(struct tape *t, int map)
{
    return &t->map[map]->conv;
}

static void tape_norm_init(struct tape *t, struct batch_norm *n,
                           const char *name, size_t channels, float eps)
{
    batch_norm_init(n, t->ps, name, channels, eps);
    t->ps->tensor[n->weight].frozen = t->ps->tensor[n->bias].frozen = true;
}

void tape_fold_norm(struct tape *t, int map, const char *name, float eps)
{
    struct tape_step *s = t->map[map];

    tape_norm_init(t, &s->norm, name, s->channels, eps);
    s->conv.norm = &s->norm;
}

int tape_norm(struct tape *t, int of, const char *name, float eps,
              enum nn_act act)
{
    struct tape_step *s = tape_step(t, TAPE_NORM, of, -1);

    tape_norm_init(t, &s->norm, name, s->channels, eps);
    s->norm.act = act;
    return t->count - 1;
}

int tape_pool(struct tape *t, int of, size_t before, bool cut)
{
    struct tape_step *s = tape_step(t, TAPE_POOL, of, -1);

    s->before = before;
    s->cut = cut;
    return t->count - 1;
}

int tape_concat(struct tape *t, int a, int b)
{
    tape_step(t, TAPE_CONCAT, a, b)->channels += t->map[b]->channels;
    return t->count - 1;
}

int tape_add(struct tape *t, int a, int b, enum nn_act act)
{
    tape_step(t, TAPE_ADD, a, b)->act = act;
    return t->count - 1;
}

int tape_halve(struct tape *t, int of)
{
    tape_step(t, TAPE_HALVE, of, -1);
    return t->count - 1;
}

int tape_double(struct tape *t, int of)
{
    tape_step(t, TAPE_DOUBLE, of, -1);
    return t->count - 1;
}

int tape_prelu(struct tape *t, int of, const char *name)
{
    struct tape_step *s = tape_step(t, TAPE_PRELU, of, -1);

    s->slope = params_add(t->ps, name, 1, &s->channels, PARAM_ZERO, 0);
    t->ps->tensor[s->slope].frozen = true;
    return t->count - 1;
}

int tape_linear(struct tape *t, int of, size_t h, size_t w, const char *name,
                size_t out)
{
    struct tape_step *s;

    tape_step(t, TAPE_FLATTEN, of, -1)->channels *= h * w;
    s = tape_step(t, TAPE_CONV, t->count - 1, -1);
    linear_init(&s->conv, t->ps, name, s->channels, out);
    t->ps->tensor[s->conv.weight].frozen = true;
    t->ps->tensor[s->conv.bias].frozen = true;
    s->channels = out;
    return t->count - 1;
}

void tape_keep(struct tape *t, int map)
{
    t->map[map]->kept = true;
}

/* ---- planning ------------------------------------------------------------- */

static size_t tape_count(const struct tape_step *s)
{
    return s->h * s->w * s->channels;
}

/* Its size, from those of what it reads. */
static void tape_plan_step(struct tape_step *s, struct nn_plan *p)
{
    const struct tape_step *a = s->of[0];

    s->h = a->h;
    s->w = a->w;
    switch (s->kind) {
    case TAPE_CONV:
        conv_plan(&s->conv, p, 1, a->h, a->w);
        s->h = s->conv.oh;
        s->w = s->conv.ow;
        break;
    case TAPE_NORM:
        batch_norm_plan(&s->norm, p, a->h * a->w);
        break;
    case TAPE_POOL:
        max_pool_plan(&s->pool, p, 1, a->h, a->w, a->channels, s->before,
                      s->cut);
        s->h = s->pool.oh;
        s->w = s->pool.ow;
        break;
    case TAPE_HALVE:
        s->h /= 2;
        s->w /= 2;
        break;
    case TAPE_DOUBLE:
        s->h *= 2;
        s->w *= 2;
        break;
    case TAPE_FLATTEN:
        s->h = s->w = 1;
        break;
    case TAPE_PICTURE: case TAPE_CONCAT: case TAPE_ADD: case TAPE_PRELU:
        break;
    }
    s->x = s->out = nn_plan_map(p, tape_count(s));
    if (nn_plan_backward(p))
        s->d = nn_plan_floats(p, tape_count(s));
}

int tape_plan(struct tape *t, size_t h, size_t w, struct nn_options opt,
              struct error *err)
{
    size_t max = h * w * t->picture.channels;

    nn_plan_release(&t->plan);
    nn_plan_init(&t->plan, opt);
    if (arena_check(&t->memory, "a network", err))
        return -1;
    t->picture.h = h;
    t->picture.w = w;
    for (int i = 1; i < t->count; i++)
        for (int k = 0; k < 2 && t->map[i]->of[k]; k++)
            t->map[i]->of[k]->last = i;
    for (int i = 1; i < t->count; i++) {
        tape_plan_step(t->map[i], &t->plan);
        for (int k = 0; k < 2 && t->map[i]->of[k]; k++) {
            struct tape_step *a = t->map[i]->of[k];

            if (a->last == i && !a->kept && a != &t->picture)
                nn_plan_recycle(&t->plan, a->out);
        }
        max = tape_count(t->map[i]) > max ? tape_count(t->map[i]) : max;
    }
    if (nn_plan_backward(&t->plan))
        t->part = nn_plan_floats(&t->plan, max);
    return nn_plan_finish(&t->plan, err);
}

/* ---- half, twice, prelu, flat --------------------------------------------- */

/* One pixel of y. */
PARALLEL(tape_pool_sum_part, r, const float *, x, float *, y, size_t, w,
         size_t, C, float, scale)
{
    const float *a = x + (r / w * 4 * w + r % w * 2) * C;
    const float *b = a + 2 * w * C;

    for (size_t c = 0; c < C; c++)
        y[r * C + c] = scale * (a[c] + a[C + c] + b[c] + b[C + c]);
}

/* y (h,w,C) = scale * the sums of 2x2 pixels of x (2h,2w,C). */
static void tape_pool_sum(float *y, const float *x, size_t h, size_t w,
                          size_t C, float scale)
{
    parallel_each(tape_pool_sum_part, h * w, 1, x, y, w, C, scale);
}

/* One pixel of y. */
PARALLEL(tape_spread_part, r, const float *, x, float *, y, size_t, w,
         size_t, C, float, scale)
{
    const float *a = x + (r / (4 * w) * w + r % (2 * w) / 2) * C;

    for (size_t c = 0; c < C; c++)
        y[r * C + c] = scale * a[c];
}

/* y (2h,2w,C) = scale * x (h,w,C), each pixel four times. */
static void tape_spread(float *y, const float *x, size_t h, size_t w, size_t C,
                        float scale)
{
    parallel_each(tape_spread_part, 4 * h * w, 1, x, y, w, C, scale);
}

/* One pixel of y. */
PARALLEL(tape_prelu_part, r, const float *, x, const float *, from, float *, y,
         const float *, slope, size_t, C)
{
    for (size_t c = r * C; c < (r + 1) * C; c++)
        y[c] = x[c] < 0 ? from[c] * slope[c - r * C] : from[c];
}

/* y = x, or x's gradient from y's, times the slopes where x is negative. */
static void tape_lean(float *y, const float *from, const struct tape *t,
                      const struct tape_step *s)
{
    parallel_each(tape_prelu_part, s->h * s->w, 1, s->of[0]->x, from, y,
                  param_w(t->ps, s->slope), s->channels);
}

/* y (columns,rows) = x (rows,columns), turned. */
static void tape_turn(float *y, const float *x, size_t rows, size_t columns)
{
    for (size_t i = 0; i < rows * columns; i++)
        y[i % columns * rows + i / columns] = x[i];
}

/* ---- forward -------------------------------------------------------------- */

static void tape_forward_step(const struct tape *t, struct tape_step *s)
{
    const struct tape_step *a = s->of[0], *b = s->of[1];

    switch (s->kind) {
    case TAPE_CONV:
        conv_forward(s->out, a->x, &s->conv);
        break;
    case TAPE_NORM:
        batch_norm_forward(s->out, a->x, NULL, &s->norm);
        break;
    case TAPE_POOL:
        max_pool_forward(s->out, a->x, &s->pool);
        break;
    case TAPE_CONCAT:
        concat_forward(s->out, a->x, b->x, s->h * s->w, a->channels,
                       b->channels, s->channels, 1);
        break;
    case TAPE_ADD:
        memcpy(s->out, a->x, tape_count(s) * sizeof *s->out);
        image_add(s->out, b->x, tape_count(s));
        act_forward(s->out, s->out, s->act, tape_count(s));
        break;
    case TAPE_HALVE:
        tape_pool_sum(s->out, a->x, s->h, s->w, s->channels, 0.25f);
        break;
    case TAPE_DOUBLE:
        tape_spread(s->out, a->x, a->h, a->w, s->channels, 1);
        break;
    case TAPE_PRELU:
        tape_lean(s->out, a->x, t, s);
        break;
    case TAPE_FLATTEN:
        tape_turn(s->out, a->x, a->h * a->w, a->channels);
        break;
    case TAPE_PICTURE:
        break;
    }
}

void tape_forward(const float *picture, struct tape *t)
{
    t->picture.x = picture;
    for (int i = 1; i < t->count; i++)
        tape_forward_step(t, t->map[i]);
}

const float *tape_map(size_t shape[4], const struct tape *t, int map)
{
    const struct tape_step *s = t->map[map];

    if (shape) {
        shape[0] = 1;
        shape[1] = s->h;
        shape[2] = s->w;
        shape[3] = s->channels;
    }
    return s->x;
}

/* ---- backward ------------------------------------------------------------- */

/* to = what of s's gradient is that of the k-th map it reads. */
static void tape_backward_step(float *to, const struct tape *t,
                               struct tape_step *s, int k)
{
    const struct tape_step *a = s->of[k];

    switch (s->kind) {
    case TAPE_CONV:
        conv_backward(to, s->d, s->x, a->x, &s->conv);
        break;
    case TAPE_NORM:
        batch_norm_backward(to, s->d, a->x, &s->norm);
        break;
    case TAPE_POOL:
        max_pool_backward(to, s->d, &s->pool);
        break;
    case TAPE_CONCAT:
        concat_take(to, s->d, s->h * s->w, k ? s->of[0]->channels : 0,
                    a->channels, s->channels);
        break;
    case TAPE_ADD:
        act_backward_out(to, s->d, s->x, s->act, tape_count(s));
        break;
    case TAPE_HALVE:
        tape_spread(to, s->d, s->h, s->w, s->channels, 0.25f);
        break;
    case TAPE_DOUBLE:
        tape_pool_sum(to, s->d, a->h, a->w, s->channels, 1);
        break;
    case TAPE_PRELU:
        tape_lean(to, s->d, t, s);
        break;
    case TAPE_FLATTEN:
        tape_turn(to, s->d, a->channels, a->h * a->w);
        break;
    case TAPE_PICTURE:
        break;
    }
}

void tape_backward(float *dpicture, const struct tape_seed *seed, size_t n,
                   struct tape *t)
{
    for (int i = 0; i < t->count; i++)
        t->map[i]->begun = false;
    t->picture.d = dpicture;
    for (size_t i = 0; i < n; i++) {
        struct tape_step *s = t->map[seed[i].map];

        s->begun = seed[i].d != NULL;
        if (s->begun)
            memcpy(s->d, seed[i].d, tape_count(s) * sizeof *s->d);
    }
    for (int i = t->count - 1; i > 0; i--) {
        struct tape_step *s = t->map[i];

        for (int k = 0; s->begun && k < 2 && s->of[k]; k++) {
            struct tape_step *a = s->of[k];

            tape_backward_step(a->begun ? t->part : a->d, t, s, k);
            if (a->begun)
                image_add(a->d, t->part, tape_count(a));
            a->begun = true;
        }
    }
    if (!t->picture.begun)
        memset(dpicture, 0, tape_count(&t->picture) * sizeof *dpicture);
}
