/* MobileNetV3 (Howard et al. 2019) from a table of rows: inverted residual
 * blocks, norms folded into the weights for inference. */
#include "lib/net/mobilenet.h"

#include <string.h>
#include <sysexits.h>

#include "lib/nn/depthwise.h"
#include "lib/nn/squeeze_excite.h"

/* One block as the table describes it; stage 255 ends the table.  expand 0 is
 * a depthwise-separable block, kernel 0 the last 1x1. */
struct mobilenet_row {
    unsigned char stage, kernel, stride;
    bool hs, se;                  /* hardswish instead of ReLU */
    unsigned short expand, out;
};

static const struct mobilenet_row small_100[] = {
    { 0, 3, 2, false, true, 0, 16 },
    { 1, 3, 2, false, false, 72, 24 }, { 1, 3, 1, false, false, 88, 24 },
    { 2, 5, 2, true, true, 96, 40 }, { 2, 5, 1, true, true, 240, 40 },
    { 2, 5, 1, true, true, 240, 40 },
    { 3, 5, 1, true, true, 120, 48 }, { 3, 5, 1, true, true, 144, 48 },
    { 4, 5, 2, true, true, 288, 96 }, { 4, 5, 1, true, true, 576, 96 },
    { 4, 5, 1, true, true, 576, 96 },
    { 5, 0, 1, true, false, 0, 576 }, { .stage = 255 }
};

static const struct mobilenet_row small_minimal[] = {
    { 0, 3, 2, false, false, 0, 16 },
    { 1, 3, 2, false, false, 72, 24 }, { 1, 3, 1, false, false, 88, 24 },
    { 2, 3, 2, false, false, 96, 40 }, { 2, 3, 1, false, false, 240, 40 },
    { 2, 3, 1, false, false, 240, 40 },
    { 3, 3, 1, false, false, 120, 48 }, { 3, 3, 1, false, false, 144, 48 },
    { 4, 3, 2, false, false, 288, 96 }, { 4, 3, 1, false, false, 576, 96 },
    { 4, 3, 1, false, false, 576, 96 },
    { 5, 0, 1, false, false, 0, 576 }, { .stage = 255 }
};

static const struct mobilenet_row large_minimal[] = {
    { 0, 3, 1, false, false, 0, 16 },
    { 1, 3, 2, false, false, 64, 24 }, { 1, 3, 1, false, false, 72, 24 },
    { 2, 3, 2, false, false, 72, 40 }, { 2, 3, 1, false, false, 120, 40 },
    { 2, 3, 1, false, false, 120, 40 },
    { 3, 3, 2, false, false, 240, 80 }, { 3, 3, 1, false, false, 200, 80 },
    { 3, 3, 1, false, false, 184, 80 }, { 3, 3, 1, false, false, 184, 80 },
    { 4, 3, 1, false, false, 480, 112 }, { 4, 3, 1, false, false, 672, 112 },
    { 5, 3, 2, false, false, 672, 160 }, { 5, 3, 1, false, false, 960, 160 },
    { 5, 3, 1, false, false, 960, 160 },
    { 6, 0, 1, false, false, 0, 960 }, { .stage = 255 }
};

static const struct mobilenet_variant {
    const char *name;
    const struct mobilenet_row *rows;
    double width;                 /* multiplies the table's channels */
    bool stem_hs, same;           /* SAME padding, eps 1e-3: the tf ones */
    signed char stage[5];         /* after which stage golden 01 looks */
} variants[] = {
    { "mobilenetv3_small_100", small_100, 1, true, false,
      { -1, 0, 1, 3, 5 } },
    { "mobilenetv3_small_150", small_100, 1.5, true, false,
      { -1, 0, 1, 3, 5 } },
    { "tf_mobilenetv3_small_minimal_100", small_minimal, 1, false, true,
      { -1, 0, 1, 3, 5 } },
    { "tf_mobilenetv3_large_minimal_100", large_minimal, 1, false, true,
      { 0, 1, 2, 4, 6 } },
};

/* ---- its steps: a convolution, its batch norm, its activation ------------- */

/* It may be added to what a second map holds, the block's input. */
struct mobilenet_unit {
    bool depthwise;
    struct conv conv;
    struct depthwise dw;
    struct batch_norm bn;
    enum nn_act act;
    float *z;                     /* before norm and activation; NULL: these
                                   * are folded in */
};

static void mobilenet_unit_plan(struct tape_step *s, struct nn_plan *p)
{
    struct mobilenet_unit *u = s->layer;
    const bool fold = !nn_plan_backward(p);

    u->conv.act = u->dw.act = fold ? u->act : ACT_NONE;
    u->conv.norm = u->dw.norm = fold ? &u->bn : NULL;
    u->conv.add = fold && s->reads == 2;
    if (u->depthwise)
        depthwise_plan(&u->dw, p, s->batch, s->h, s->w);
    else
        conv_plan(&u->conv, p, s->batch, s->h, s->w);
    s->h = u->depthwise ? u->dw.oh : u->conv.oh;
    s->w = u->depthwise ? u->dw.ow : u->conv.ow;
    u->z = fold ? NULL : nn_plan_map(p, tape_count(s));
    if (!fold)
        batch_norm_plan(&u->bn, p, s->batch * s->h * s->w);
}

static void mobilenet_unit_forward(struct tape_step *s)
{
    struct mobilenet_unit *u = s->layer;
    const float *x = s->of[0]->x, *onto = s->reads == 2 ? s->of[1]->x : NULL;
    float *z = u->z ? u->z : s->out;

    if (onto && !u->z && s->out != onto)
        memcpy(s->out, onto, tape_count(s) * sizeof *onto);
    if (u->depthwise)
        depthwise_forward(z, x, &u->dw);
    else
        conv_forward(z, x, &u->conv);
    if (u->z)
        batch_norm_forward(s->out, z, onto, &u->bn);
}

static void mobilenet_unit_backward(float *to, struct tape_step *s, int k)
{
    struct mobilenet_unit *u = s->layer;

    if (k == 1) {
        memcpy(to, s->d, tape_count(s) * sizeof *to);
        return;
    }
    batch_norm_backward(s->d, s->d, u->z, &u->bn);
    if (u->depthwise)
        depthwise_backward(to, s->d, s->of[0]->x, &u->dw);
    else
        conv_backward(to, s->d, u->z, s->of[0]->x, &u->conv);
}

static int mobilenet_unit_graph(struct graph *g, const int *in,
                                const struct tape_step *s)
{
    const struct mobilenet_unit *u = s->layer;
    struct conv plain = u->conv;
    int x;

    plain.act = ACT_NONE;         /* a plan may have moved the norm's there */
    x = u->depthwise ? graph_depthwise(g, in[0], &u->dw)
                     : graph_conv(g, in[0], &plain);
    x = graph_batch_norm(g, x, &u->bn);
    return s->reads == 2 ? GRAPH_NODE(g, "Add", x, in[1]) : x;
}

static const struct tape_op unit_op = {
    sizeof(struct mobilenet_unit), 0, true, mobilenet_unit_plan,
    mobilenet_unit_forward, mobilenet_unit_backward, mobilenet_unit_graph
};
static const struct tape_op unit_onto_op = {
    sizeof(struct mobilenet_unit), 2, true, mobilenet_unit_plan,
    mobilenet_unit_forward, mobilenet_unit_backward, mobilenet_unit_graph
};

/* ---- squeeze and excite, and the mean -------------------------------------- */

static void mobilenet_squeeze_plan(struct tape_step *s, struct nn_plan *p)
{
    squeeze_excite_plan(s->layer, p, s->batch, s->h * s->w);
}

static void mobilenet_squeeze(struct tape_step *s)
{
    squeeze_excite_forward(s->out, s->of[0]->x, s->layer);
}

static void mobilenet_squeeze_backward(float *to, struct tape_step *s, int k)
{
    squeeze_excite_backward(to, s->d, s->of[k]->x, s->layer);
}

static int mobilenet_squeeze_graph(struct graph *g, const int *in,
                                   const struct tape_step *s)
{
    return graph_squeeze_excite(g, in[0], s->layer);
}

static const struct tape_op squeeze_op = {
    sizeof(struct squeeze_excite), 1, true, mobilenet_squeeze_plan,
    mobilenet_squeeze, mobilenet_squeeze_backward, mobilenet_squeeze_graph
};

struct mobilenet_mean {
    float *part;
};

static void mobilenet_mean_plan(struct tape_step *s, struct nn_plan *p)
{
    struct mobilenet_mean *l = s->layer;

    s->h = s->w = 1;
    l->part = nn_plan_floats(p, NN_PARTS * tape_count(s));
}

static void mobilenet_mean(struct tape_step *s)
{
    const struct mobilenet_mean *l = s->layer;
    const struct tape_step *a = s->of[0];

    spatial_mean_forward(s->out, l->part, a->x, a->batch, a->h * a->w,
                         a->channels);
}

static void mobilenet_mean_backward(float *to, struct tape_step *s, int k)
{
    const struct tape_step *a = s->of[k];

    spatial_mean_backward(to, s->d, a->batch, a->h * a->w, a->channels);
}

static int mobilenet_mean_graph(struct graph *g, const int *in,
                                const struct tape_step *s)
{
    (void)s;
    return graph_mean(g, in[0]);
}

static const struct tape_op mean_op = {
    sizeof(struct mobilenet_mean), 0, false, mobilenet_mean_plan,
    mobilenet_mean, mobilenet_mean_backward, mobilenet_mean_graph
};

/* ---- declaring --------------------------------------------------------------- */

/* What all units of a network share, and where the next block's tensors are. */
struct mobilenet_place {
    struct tape *tape;
    const struct mobilenet_variant *v;
    char at[120];
};

/* A unit on x, added to `onto` (-1: to nothing): a convolution named conv, its
 * norm named bn. */
static int mobilenet_unit(const struct mobilenet_place *m, int x, int onto,
                          const char *conv, const char *bn, size_t out,
                          size_t kernel, size_t stride, enum nn_act act,
                          bool depthwise)
{
    const enum conv_pad pad = m->v->same ? CONV_SAME : CONV_HALF;
    struct tape *t = m->tape;
    const size_t in = tape_channels(t, x);
    const int map = onto < 0 ? TAPE_STEP(t, &unit_op, x)
                             : TAPE_STEP(t, &unit_onto_op, x, onto);
    struct mobilenet_unit *u = t->map[map]->layer;
    char name[120];

    u->depthwise = depthwise;
    u->act = act;
    nn_name(name, "%s%s", m->at, conv);
    if (depthwise)
        depthwise_init(&u->dw, t->ps, name, out, kernel, stride);
    else
        conv_init(&u->conv, t->ps, name, in, out, kernel, stride, false);
    u->conv.pad = u->dw.pad = pad;
    nn_name(name, "%s%s", m->at, bn);
    batch_norm_init(&u->bn, t->ps, name, out, m->v->same ? 1e-3f : NORM_EPS);
    u->bn.act = act;
    t->map[map]->channels = out;
    return map;
}

/* The multiple of 8 next to C, never less than nine tenths of it. */
static size_t mobilenet_channels(double C)
{
    size_t n = (size_t)(C + 4) / 8 * 8;

    n = n < 8 ? 8 : n;
    return (double)n < 0.9 * C ? n + 8 : n;
}

/* Expansion, depthwise, squeeze and excite, projection.  base: the table's
 * channels before this row. */
static int mobilenet_block(const struct mobilenet_place *m, int x,
                           const struct mobilenet_row *r, size_t base)
{
    struct tape *t = m->tape;
    const enum nn_act act = r->hs ? ACT_HARDSWISH : ACT_RELU;
    const size_t out = mobilenet_channels(r->out * m->v->width);
    const size_t in = tape_channels(t, x);
    size_t mid = r->expand ? mobilenet_channels((double)(in * r->expand) /
                                                (double)base)
                           : in;
    const int onto = r->stride == 1 && in == out ? x : -1;
    char name[120];

    if (r->kernel == 0)
        return mobilenet_unit(m, x, -1, "conv", "bn1", out, 1, 1, act, false);
    if (r->expand)
        x = mobilenet_unit(m, x, -1, "conv_pw", "bn1", mid, 1, 1, act, false);
    x = mobilenet_unit(m, x, -1, "conv_dw", r->expand ? "bn2" : "bn1", mid,
                       r->kernel, r->stride, act, true);
    if (r->se) {
        x = TAPE_STEP(t, &squeeze_op, x);
        squeeze_excite_init(t->map[x]->layer, t->ps,
                            nn_name(name, "%sse", m->at), mid,
                            mobilenet_channels((double)(mid / 4)));
    }
    return mobilenet_unit(m, x, onto, r->expand ? "conv_pwl" : "conv_pw",
                          r->expand ? "bn3" : "bn2", out, 1, 1, ACT_NONE,
                          false);
}

/* The variant of that name; NULL: none. */
static const struct mobilenet_variant *mobilenet_find(const char *name)
{
    for (size_t i = 0; i < sizeof variants / sizeof *variants; i++)
        if (!strcmp(variants[i].name, name))
            return &variants[i];
    return NULL;
}

int mobilenet_init(struct mobilenet *m, struct params *ps, const char *prefix,
                   const char *variant, struct error *err)
{
    const struct mobilenet_variant *v = mobilenet_find(variant);
    struct mobilenet_place place = {.tape = &m->tape, .v = v};
    size_t base = 16, index = 0;

    memset(m, 0, sizeof *m);
    if (!v)
        return error_set(err, EX_CONFIG, "unknown network '%s' (expected "
                         "mobilenetv3_small_100, mobilenetv3_small_150, "
                         "tf_mobilenetv3_small_minimal_100 or "
                         "tf_mobilenetv3_large_minimal_100)",
                         variant);
    m->variant = v->name;
    tape_init(&m->tape, ps, 3, false);
    nn_name(place.at, "%s", prefix);
    int x = mobilenet_unit(&place, 0, -1, "conv_stem", "bn1",
                           mobilenet_channels(base * v->width), 3, 2,
                           v->stem_hs ? ACT_HARDSWISH : ACT_RELU, false);
    for (int i = 0; i < 5; i++)
        m->stage[i] = x;
    for (const struct mobilenet_row *r = v->rows; r->stage != 255; r++) {
        index = r > v->rows && r->stage == r[-1].stage ? index + 1 : 0;
        nn_name(place.at, "%sblocks.%d.%zu.", prefix, r->stage, index);
        x = mobilenet_block(&place, x, r, base);
        base = r->out;
        for (int i = 0; i < 5; i++)
            if (r->stage <= v->stage[i])
                m->stage[i] = x;
    }
    m->features = tape_channels(&m->tape, x);
    TAPE_STEP(&m->tape, &mean_op, x);
    return 0;
}

void mobilenet_release(struct mobilenet *m)
{
    tape_release(&m->tape);
    memset(m, 0, sizeof *m);
}

/* ---- use ----------------------------------------------------------------------- */

int mobilenet_plan(struct mobilenet *m, size_t batch, size_t height,
                   size_t width, struct nn_options opt, struct error *err)
{
    return tape_plan(&m->tape, batch, height, width, opt, err);
}

void mobilenet_forward(float *pooled, const float *rgb, struct mobilenet *m)
{
    tape_forward(pooled, rgb, &m->tape);
}

void mobilenet_backward(float *drgb, const float *dpooled,
                        struct mobilenet *m)
{
    tape_backward(drgb, &(struct tape_seed){m->tape.count - 1, dpooled}, 1,
                  &m->tape);
}

int mobilenet_graph(struct graph *g, int picture, const struct mobilenet *m)
{
    return tape_graph(g, graph_maps(g, picture), 0, m->tape.count - 1,
                      &m->tape);
}
