/* FAN, forward and back to the picture. */
#include "lib/lab/train/fan.h"

#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/nn/image.h"

#define EPS 1e-5f

/* ---- sizes and tensors -------------------------------------------------- */

int fan_size(size_t *stacks, size_t *width, const struct safetensors *st,
             struct error *err)
{
    const struct st_tensor *t = NULL;
    char name[40];

    for (*stacks = 0; *stacks < FAN_STACKS; ++*stacks) {
        snprintf(name, sizeof name, "m%zu.b1_4.bn1.weight", *stacks);
        if (!st_find(st, name))
            break;
        t = st_find(st, name);
    }
    if (!t || t->ndim != 1 || !t->dim[0] || t->dim[0] % 16 ||
        t->dim[0] > FAN_WIDTH_MAX)
        return error_set(err, EX_DATAERR, "%s: no m0.b1_4.bn1.weight of a "
                         "multiple of 16 (expected a face alignment network, "
                         "spid-import --as fan)", st_path(st));
    *width = t->dim[0];
    return 0;
}

/* Its weights do not learn. */
static void fan_freeze_norm(struct batch_norm *n)
{
    n->ps->tensor[n->weight].frozen = n->ps->tensor[n->bias].frozen = true;
}

/* norm, relu and a convolution without bias, none of which learns. */
static void fan_step_init(struct fan_step *s, struct params *ps,
                          const char *norm, const char *conv, size_t in,
                          size_t out, size_t kernel)
{
    batch_norm_init(&s->norm, ps, norm, in, EPS);
    s->norm.act = ACT_RELU;
    fan_freeze_norm(&s->norm);
    conv_init(&s->conv, ps, conv, in, out, kernel, 1, false);
    ps->tensor[s->conv.weight].frozen = true;
}

/* Of a half, a quarter and a quarter of the channels that it gives. */
static void fan_block_init(struct fan_block *b, struct params *ps,
                           const char *name, size_t in, size_t out)
{
    const size_t wide[4] = {in, out / 2, out / 4, out / 4};
    char norm[120], conv[120];

    b->out = out;
    b->widens = in != out;
    for (size_t i = 0; i < 3; i++)
        fan_step_init(&b->step[i], ps, nn_name(norm, "%s.bn%zu", name, i + 1),
                      nn_name(conv, "%s.conv%zu", name, i + 1), wide[i],
                      wide[i + 1], 3);
    if (b->widens)
        fan_step_init(&b->wide, ps, nn_name(norm, "%s.downsample.0", name),
                      nn_name(conv, "%s.downsample.2", name), in, out, 1);
}

/* A 1x1 convolution with bias. */
static void fan_mix_init(struct conv *c, struct params *ps, const char *name,
                         size_t stack, size_t in, size_t out)
{
    char buf[120];

    conv_init(c, ps, nn_name(buf, "%s%zu", name, stack), in, out, 1, 1, true);
    ps->tensor[c->weight].frozen = ps->tensor[c->bias].frozen = true;
}

/* The k-th hourglass and what follows it; the last one hands nothing on. */
static void fan_stack_init(struct fan *f, size_t k)
{
    struct fan_stack *s = &f->stack[k];
    struct fan_hourglass *h = &s->hourglass;
    struct params *ps = f->ps;
    size_t W = f->width;
    char name[120];

    for (size_t i = 0; i < FAN_LEVELS; i++) {
        size_t at = FAN_LEVELS - i;      /* theirs count from inside */

        fan_block_init(&h->outer[i], ps,
                       nn_name(name, "m%zu.b1_%zu", k, at), W, W);
        fan_block_init(&h->down[i], ps, nn_name(name, "m%zu.b2_%zu", k, at),
                       W, W);
        fan_block_init(&h->back[i], ps, nn_name(name, "m%zu.b3_%zu", k, at),
                       W, W);
    }
    fan_block_init(&h->inner, ps, nn_name(name, "m%zu.b2_plus_1", k), W, W);
    fan_block_init(&s->top, ps, nn_name(name, "top_m_%zu", k), W, W);
    fan_mix_init(&s->last, ps, "conv_last", k, W, W);
    s->last.act = ACT_RELU;
    batch_norm_init(&s->end, ps, nn_name(name, "bn_end%zu", k), W, EPS);
    s->last.norm = &s->end;
    fan_freeze_norm(&s->end);
    fan_mix_init(&s->maps, ps, "l", k, W, FAN_LANDMARKS);
    if (k + 1 == f->stacks)
        return;
    fan_mix_init(&s->again, ps, "bl", k, W, W);
    fan_mix_init(&s->found, ps, "al", k, FAN_LANDMARKS, W);
    s->again.add = s->found.add = true;
}

void fan_init(struct fan *f, struct params *ps, size_t stacks, size_t width)
{
    memset(f, 0, sizeof *f);
    f->ps = ps;
    f->stacks = stacks;
    f->width = width;
    conv_init(&f->stem, ps, "conv1", 3, width / 4, 7, 2, true);
    ps->tensor[f->stem.weight].frozen = ps->tensor[f->stem.bias].frozen = true;
    f->stem.act = ACT_RELU;
    batch_norm_init(&f->stem_norm, ps, "bn1", width / 4, EPS);
    f->stem.norm = &f->stem_norm;
    fan_freeze_norm(&f->stem_norm);
    fan_block_init(&f->block[0], ps, "conv2", width / 4, width / 2);
    fan_block_init(&f->block[1], ps, "conv3", width / 2, width / 2);
    fan_block_init(&f->block[2], ps, "conv4", width / 2, width);
    for (size_t k = 0; k < stacks; k++)
        fan_stack_init(f, k);
}

/* ---- planning ----------------------------------------------------------- */

/* On maps of side x side pixels, as all of these. */
static void fan_step_plan(struct fan_step *s, struct nn_plan *p, size_t side)
{
    size_t rows = side * side;

    batch_norm_plan(&s->norm, p, rows);
    conv_plan(&s->conv, p, 1, side, side);
    s->a = nn_plan_floats(p, rows * s->conv.in);
    s->y = nn_plan_floats(p, rows * s->conv.out);
}

static void fan_block_plan(struct fan_block *b, struct nn_plan *p, size_t side)
{
    b->rows = side * side;
    for (size_t i = 0; i < 3; i++)
        fan_step_plan(&b->step[i], p, side);
    if (b->widens)
        fan_step_plan(&b->wide, p, side);
    b->y = nn_plan_floats(p, b->rows * b->out);
}

static void fan_stack_plan(struct fan *f, size_t k, size_t side)
{
    struct fan_stack *s = &f->stack[k];
    struct fan_hourglass *h = &s->hourglass;
    struct nn_plan *p = &f->plan;
    size_t n = side * side;

    for (size_t i = 0; i < FAN_LEVELS; i++) {
        size_t at = side >> i, inside = at / 2;

        fan_block_plan(&h->outer[i], p, at);
        fan_block_plan(&h->down[i], p, inside);
        fan_block_plan(&h->back[i], p, inside);
        h->half[i] = nn_plan_floats(p, inside * inside * f->width);
        h->y[i] = nn_plan_floats(p, at * at * f->width);
    }
    fan_block_plan(&h->inner, p, side >> FAN_LEVELS);
    fan_block_plan(&s->top, p, side);
    conv_plan(&s->last, p, 1, side, side);
    conv_plan(&s->maps, p, 1, side, side);
    s->features = nn_plan_floats(p, n * f->width);
    s->heat = nn_plan_floats(p, n * FAN_LANDMARKS);
    if (k + 1 == f->stacks)
        return;
    conv_plan(&s->again, p, 1, side, side);
    conv_plan(&s->found, p, 1, side, side);
    s->next = nn_plan_floats(p, n * f->width);
}

int fan_plan(struct fan *f, size_t side, struct nn_options opt,
             struct error *err)
{
    struct nn_plan *p = &f->plan;
    size_t half = side / 2, quarter = side / 4, W = f->width;

    if (!side || side % FAN_MULTIPLE)
        return error_set(err, EX_DATAERR, "face alignment on %zu pixels "
                         "(expected a multiple of %d)", side, FAN_MULTIPLE);
    nn_plan_release(p);
    nn_plan_init(p, opt);
    f->side = side;
    conv_plan(&f->stem, p, 1, side, side);
    f->first = nn_plan_floats(p, half * half * W / 4);
    fan_block_plan(&f->block[0], p, half);
    f->half = nn_plan_floats(p, quarter * quarter * W / 2);
    fan_block_plan(&f->block[1], p, quarter);
    fan_block_plan(&f->block[2], p, quarter);
    for (size_t k = 0; k < f->stacks; k++)
        fan_stack_plan(f, k, quarter);
    for (size_t i = 0; i < sizeof f->g / sizeof *f->g; i++)
        f->g[i] = nn_plan_floats(p, half * half * W / 2);
    for (size_t i = 0; i < FAN_LEVELS && nn_plan_backward(p); i++)
        f->low[i] = nn_plan_floats(p, (quarter >> i) * (quarter >> i) / 4 * W);
    return nn_plan_finish(p, err);
}

void fan_release(struct fan *f)
{
    nn_plan_release(&f->plan);
    memset(f, 0, sizeof *f);
}

/* ---- half and twice ----------------------------------------------------- */

/* One row. */
PARALLEL(fan_pool_sum_part, r, const float *, x, float *, y, size_t, n,
         size_t, C, float, scale)
{
    const float *a = x + (r / n * 4 * n + r % n * 2) * C;
    const float *b = a + 2 * n * C;

    for (size_t c = 0; c < C; c++)
        y[r * C + c] = scale * (a[c] + a[C + c] + b[c] + b[C + c]);
}

/* y (n,n,C) = scale * the sums of 2x2 pixels of x (2n,2n,C). */
static void fan_pool_sum(float *y, const float *x, size_t n, size_t C,
                         float scale)
{
    parallel_each(fan_pool_sum_part, n * n, 1, x, y, n, C, scale);
}

/* One row. */
PARALLEL(fan_upsample_add_part, r, const float *, x, float *, y, size_t, n,
         size_t, C, float, scale)
{
    const float *a = x + (r / (4 * n) * n + r % (2 * n) / 2) * C;

    for (size_t c = 0; c < C; c++)
        y[r * C + c] += scale * a[c];
}

/* y (2n,2n,C) += scale * x (n,n,C), each pixel four times. */
static void fan_upsample_add(float *y, const float *x, size_t n, size_t C,
                             float scale)
{
    parallel_each(fan_upsample_add_part, 4 * n * n, 1, x, y, n, C, scale);
}

/* ---- forward ------------------------------------------------------------ */

static const float *fan_step_forward(const float *x, struct fan_step *s)
{
    batch_norm_forward(s->a, x, NULL, &s->norm);
    conv_forward(s->y, s->a, &s->conv);
    return s->y;
}

/* Returns b->y; pair, of half its channels, is scratch. */
static const float *fan_block_forward(const float *x, struct fan_block *b,
                                      float *pair)
{
    struct fan_step *s = b->step;
    size_t half = b->out / 2, rows = b->rows;

    b->x = x;
    fan_step_forward(x, &s[0]);
    fan_step_forward(s[0].y, &s[1]);
    fan_step_forward(s[1].y, &s[2]);
    concat_forward(pair, s[1].y, s[2].y, rows, half / 2, half / 2, half, 1);
    concat_forward(b->y, s[0].y, pair, rows, half, half, b->out, 1);
    image_add(b->y, b->widens ? fan_step_forward(x, &b->wide) : x,
              rows * b->out);
    return b->y;
}

/* Level i and what is inside it, on maps of n x n pixels. */
static const float *fan_level_forward(const float *x, struct fan *f,
                                      struct fan_hourglass *h, size_t i,
                                      size_t n)
{
    size_t C = f->width;
    const float *inside;

    fan_pool_sum(h->half[i], x, n / 2, C, 0.25f);
    inside = fan_block_forward(h->half[i], &h->down[i], f->g[0]);
    inside = i + 1 < FAN_LEVELS
                 ? fan_level_forward(inside, f, h, i + 1, n / 2)
                 : fan_block_forward(inside, &h->inner, f->g[0]);
    inside = fan_block_forward(inside, &h->back[i], f->g[0]);
    memcpy(h->y[i], fan_block_forward(x, &h->outer[i], f->g[0]),
           n * n * C * sizeof *x);
    fan_upsample_add(h->y[i], inside, n / 2, C, 1);
    return h->y[i];
}

/* What the next stack sees, or the last one's heat maps. */
static const float *fan_stack_forward(const float *x, struct fan *f, size_t k)
{
    struct fan_stack *s = &f->stack[k];
    size_t n = f->side / 4;
    const float *y = fan_level_forward(x, f, &s->hourglass, 0, n);

    conv_forward(s->features, fan_block_forward(y, &s->top, f->g[0]),
                 &s->last);
    conv_forward(s->heat, s->features, &s->maps);
    if (!s->next)
        return s->heat;
    memcpy(s->next, x, n * n * f->width * sizeof *x);
    conv_forward(s->next, s->features, &s->again);      /* both add */
    conv_forward(s->next, s->heat, &s->found);
    return s->next;
}

const float *fan_forward(const float *rgb, struct fan *f)
{
    const float *x;

    f->rgb = rgb;
    conv_forward(f->first, rgb, &f->stem);
    x = fan_block_forward(f->first, &f->block[0], f->g[0]);
    fan_pool_sum(f->half, x, f->side / 4, f->width / 2, 0.25f);
    x = fan_block_forward(f->half, &f->block[1], f->g[0]);
    x = fan_block_forward(x, &f->block[2], f->g[0]);
    for (size_t k = 0; k < f->stacks; k++)
        x = fan_stack_forward(x, f, k);
    return x;
}

/* ---- backward ----------------------------------------------------------- */

/* dx is written; da is scratch. */
static void fan_step_backward(float *dx, float *dy, const float *x,
                              struct fan_step *s, float *da)
{
    conv_backward(da, dy, s->y, s->a, &s->conv);
    batch_norm_backward(dx, da, x, &s->norm);
}

/* dx is written, from dy, which stays; f's g[0..2] are scratch. */
static void fan_block_backward(float *dx, float *dy, struct fan_block *b,
                               struct fan *f)
{
    struct fan_step *s = b->step;
    size_t C = b->out, rows = b->rows;
    float *part = f->g[0], *da = f->g[1], *more = f->g[2];

    concat_take(part, dy, rows, C / 4 * 3, C / 4, C);
    fan_step_backward(more, part, s[1].y, &s[2], da);
    concat_take(part, dy, rows, C / 2, C / 4, C);
    image_add(part, more, rows * C / 4);
    fan_step_backward(more, part, s[0].y, &s[1], da);
    concat_take(part, dy, rows, 0, C / 2, C);
    image_add(part, more, rows * C / 2);
    fan_step_backward(dx, part, b->x, &s[0], da);
    if (b->widens)
        fan_step_backward(more, dy, b->x, &b->wide, da);
    image_add(dx, b->widens ? more : dy, rows * s[0].conv.in);
}

/* d (n,n,C) is replaced: the gradient of the level's output by its input's. */
static void fan_level_backward(float *d, struct fan *f,
                               struct fan_hourglass *h, size_t i, size_t n)
{
    size_t C = f->width, inside = n / 2;
    size_t bytes = inside * inside * C * sizeof *d;
    float *low = f->low[i], *t = f->g[3];

    fan_pool_sum(t, d, inside, C, 1);
    fan_block_backward(low, t, &h->back[i], f);
    if (i + 1 < FAN_LEVELS) {
        fan_level_backward(low, f, h, i + 1, inside);
    } else {
        memcpy(t, low, bytes);
        fan_block_backward(low, t, &h->inner, f);
    }
    fan_block_backward(t, low, &h->down[i], f);
    memcpy(low, t, bytes);
    fan_block_backward(t, d, &h->outer[i], f);
    memcpy(d, t, n * n * C * sizeof *d);
    fan_upsample_add(d, low, inside, C, 0.25f);
}

/* From the gradients of the next stack's x (d; for the last stack zeros) and
 * of the heat maps to that of x, in d's place. */
static void fan_stack_backward(float *d, float *dheat, struct fan *f, size_t k)
{
    struct fan_stack *s = &f->stack[k];
    size_t n = f->side / 4, count = n * n * f->width;
    const float *top = s->top.y;
    float *t = f->g[3], *dx = f->g[5];

    if (s->next) {
        conv_backward(dheat, d, s->next, s->heat, &s->found);
        conv_backward(dx, d, s->next, s->features, &s->again);
    } else {
        memset(dx, 0, count * sizeof *dx);
    }
    conv_backward(t, dheat, s->heat, s->features, &s->maps);
    image_add(dx, t, count);
    conv_backward(t, dx, s->features, top, &s->last);
    fan_block_backward(dx, t, &s->top, f);
    fan_level_backward(dx, f, &s->hourglass, 0, n);
    image_add(d, dx, count);
}

void fan_backward(float *drgb, float *dheat, struct fan *f)
{
    size_t n = f->side / 4, W = f->width;
    float *d = f->g[4], *t = f->g[3];

    memset(d, 0, n * n * W * sizeof *d);
    for (size_t k = f->stacks; k-- > 0;)
        fan_stack_backward(d, dheat, f, k);
    fan_block_backward(t, d, &f->block[2], f);
    fan_block_backward(d, t, &f->block[1], f);
    memset(t, 0, 4 * n * n * W / 2 * sizeof *t);
    fan_upsample_add(t, d, n, W / 2, 0.25f);
    fan_block_backward(d, t, &f->block[0], f);
    conv_backward(drgb, d, f->first, f->rgb, &f->stem);
}
