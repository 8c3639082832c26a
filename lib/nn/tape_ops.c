/* The kinds of steps that most networks have, one after the other. */
#include <string.h>
#include <sysexits.h>

#include "lib/nn/image.h"
#include "lib/nn/tape.h"

/* ---- convolutions and linear layers --------------------------------------- */

struct tape_conv {
    struct conv conv;
    struct batch_norm norm;     /* folded in, or nothing */
};

static void tape_conv_plan(struct tape_step *s, struct nn_plan *p)
{
    struct conv *c = s->layer;
    const struct tape_step *x = s->of[s->reads - 1];

    c->no_din = x->constant;
    c->half_in = x->half && conv_halves(p);
    c->half_out = s->half && conv_halves(p);
    if (c->ps->tensor[c->weight].ndim == 2) {
        linear_plan(c, p, s->batch * s->h * s->w);
        return;
    }
    conv_plan(c, p, s->batch, x->h, x->w);
    s->h = c->oh;
    s->w = c->ow;
}

static void tape_conv_forward(struct tape_step *s)
{
    struct conv *c = s->layer;

    if (c->add && s->out != s->of[0]->x)
        memcpy(s->out, s->of[0]->x, tape_count(s) * sizeof *s->out);
    conv_forward(s->out, s->of[s->reads - 1]->x, c);
}

/* The convolution's backward leaves its sum's gradient in s->d. */
static void tape_conv_backward(float *to, struct tape_step *s, int k)
{
    struct conv *c = s->layer;

    if (k == s->reads - 1)
        conv_backward(to, s->d, s->x, s->of[k]->x, c);
    else
        memcpy(to, s->d, tape_count(s) * sizeof *to);
}

static int tape_conv_graph(struct graph *g, const int *in,
                           const struct tape_step *s)
{
    const struct conv *c = s->layer;

    if (c->norm)
        graph_fail(g, EX_CONFIG, "a norm that is folded has no ONNX form here");
    if (s->reads == 2)
        return graph_conv_add(g, in[0], in[1], c);
    return c->ps->tensor[c->weight].ndim == 2 ? graph_linear(g, in[0], c)
                                              : graph_conv(g, in[0], c);
}

static const struct tape_op conv_op = {
    sizeof(struct tape_conv), 0, true, tape_conv_plan, tape_conv_forward,
    tape_conv_backward, tape_conv_graph
};
static const struct tape_op conv_onto_op = {
    sizeof(struct tape_conv), 1, true, tape_conv_plan, tape_conv_forward,
    tape_conv_backward, tape_conv_graph
};

struct conv *tape_layer(struct tape *t, int map)
{
    return t->map[map]->layer;
}

/* Steps on so many maps that are the layer c; its tensors learn or not. */
static int tape_conv_step(struct tape *t, const struct tape_op *op,
                          const int *of, int n, const struct conv *c)
{
    const int map = tape_step(t, op, of, n);

    *tape_layer(t, map) = *c;
    t->ps->tensor[c->weight].frozen = t->frozen;
    if (c->bias != NN_NONE)
        t->ps->tensor[c->bias].frozen = t->frozen;
    t->map[map]->channels = c->out;
    return map;
}

int tape_declared(struct tape *t, int of, const struct conv *c)
{
    return tape_conv_step(t, &conv_op, &of, 1, c);
}

int tape_conv(struct tape *t, int of, const char *name, size_t out,
              size_t kernel, bool bias)
{
    struct conv c;

    conv_init(&c, t->ps, name, tape_channels(t, of), out, kernel, 1, bias);
    return tape_declared(t, of, &c);
}

int tape_conv_onto(struct tape *t, int onto, int of, const char *name,
                   size_t out, size_t kernel, bool bias)
{
    struct conv c;

    conv_init(&c, t->ps, name, tape_channels(t, of), out, kernel, 1, bias);
    c.add = true;
    return tape_conv_step(t, &conv_onto_op, (int[]){onto, of}, 2, &c);
}

int tape_linear(struct tape *t, int of, const char *name, size_t out)
{
    struct conv c;

    linear_init(&c, t->ps, name, tape_channels(t, of), out);
    return tape_declared(t, of, &c);
}

void tape_halve_map(struct tape *t, int map)
{
    t->map[map]->half = true;
}

void tape_fold_norm(struct tape *t, int map, const char *name, float eps)
{
    struct tape_conv *l = t->map[map]->layer;
    struct batch_norm *n = &l->norm;

    batch_norm_init(n, t->ps, name, tape_channels(t, map), eps);
    t->ps->tensor[n->weight].frozen = t->frozen;
    t->ps->tensor[n->bias].frozen = t->frozen;
    l->conv.norm = n;
}

/* ---- channels of two maps ------------------------------------------------- */

static void tape_concat_forward(struct tape_step *s)
{
    const struct tape_step *a = s->of[0], *b = s->of[1];

    concat_forward(s->out, a->x, b->x, s->batch * s->h * s->w, a->channels,
                   b->channels, s->channels, 1);
}

static void tape_concat_backward(float *to, struct tape_step *s, int k)
{
    concat_take(to, s->d, s->batch * s->h * s->w,
                k ? s->of[0]->channels : 0, s->of[k]->channels, s->channels);
}

static int tape_concat_graph(struct graph *g, const int *in,
                             const struct tape_step *s)
{
    (void)s;
    return graph_concat(g, in[0], in[1]);
}

static const struct tape_op concat_op = {
    0, 0, false, NULL, tape_concat_forward, tape_concat_backward,
    tape_concat_graph
};

int tape_concat(struct tape *t, int a, int b)
{
    const int map = TAPE_STEP(t, &concat_op, a, b);

    t->map[map]->channels = tape_channels(t, a) + tape_channels(t, b);
    return map;
}

/* ---- activations ----------------------------------------------------------- */

static void tape_act_forward(struct tape_step *s)
{
    const enum nn_act *act = s->layer;

    act_forward(s->out, s->of[0]->x, *act, tape_count(s));
}

static void tape_act_backward(float *to, struct tape_step *s, int k)
{
    const enum nn_act *act = s->layer;

    (void)k;
    act_backward_out(to, s->d, s->x, *act, tape_count(s));
}

static int tape_act_graph(struct graph *g, const int *in,
                          const struct tape_step *s)
{
    const enum nn_act *act = s->layer;

    return graph_act(g, in[0], *act);
}

static const struct tape_op act_op = {
    sizeof(enum nn_act), 1, false, NULL, tape_act_forward, tape_act_backward,
    tape_act_graph
};

int tape_act(struct tape *t, int of, enum nn_act act)
{
    const int map = TAPE_STEP(t, &act_op, of);

    *(enum nn_act *)t->map[map]->layer = act;
    return map;
}

/* ---- products with a number ------------------------------------------------- */

static void tape_scale_to(float *y, const float *x, const struct tape_step *s)
{
    const float *times = s->layer;

    for (size_t i = 0; i < tape_count(s); i++)
        y[i] = x[i] * *times;
}

static void tape_scale_forward(struct tape_step *s)
{
    tape_scale_to(s->out, s->of[0]->x, s);
}

static void tape_scale_backward(float *to, struct tape_step *s, int k)
{
    (void)k;
    tape_scale_to(to, s->d, s);
}

static int tape_scale_graph(struct graph *g, const int *in,
                            const struct tape_step *s)
{
    const float *times = s->layer;

    return GRAPH_NODE(g, "Mul", in[0], graph_real(g, *times));
}

static const struct tape_op scale_op = {
    sizeof(float), 1, false, NULL, tape_scale_forward, tape_scale_backward,
    tape_scale_graph
};

int tape_scale(struct tape *t, int of, float times)
{
    const int map = TAPE_STEP(t, &scale_op, of);

    *(float *)t->map[map]->layer = times;
    return map;
}

/* ---- sums ------------------------------------------------------------------ */

static void tape_add_forward(struct tape_step *s)
{
    const enum nn_act *act = s->layer;

    if (s->out != s->of[0]->x)
        memcpy(s->out, s->of[0]->x, tape_count(s) * sizeof *s->out);
    image_add(s->out, s->of[1]->x, tape_count(s));
    if (*act != ACT_NONE)
        act_forward(s->out, s->out, *act, tape_count(s));
}


static int tape_add_graph(struct graph *g, const int *in,
                          const struct tape_step *s)
{
    const enum nn_act *act = s->layer;

    return graph_act(g, GRAPH_NODE(g, "Add", in[0], in[1]), *act);
}

static const struct tape_op add_op = {
    sizeof(enum nn_act), 1, false, NULL, tape_add_forward,
    tape_act_backward, tape_add_graph
};

int tape_add(struct tape *t, int a, int b, enum nn_act act)
{
    const int map = TAPE_STEP(t, &add_op, a, b);

    *(enum nn_act *)t->map[map]->layer = act;
    return map;
}

/* ---- other sizes ------------------------------------------------------------ */

struct tape_rescale {
    struct rescale rescale;
    enum rescale_mode mode;
    size_t h, w;
};

static void tape_rescale_plan(struct tape_step *s, struct nn_plan *p)
{
    struct tape_rescale *l = s->layer;

    rescale_plan(&l->rescale, p, l->mode, s->batch, s->h, s->w, l->h, l->w,
                 s->channels);
    s->h = l->h;
    s->w = l->w;
}

static void tape_rescale_forward(struct tape_step *s)
{
    struct tape_rescale *l = s->layer;

    rescale_forward(s->out, s->of[0]->x, &l->rescale);
}

static void tape_rescale_backward(float *to, struct tape_step *s, int k)
{
    struct tape_rescale *l = s->layer;

    (void)k;
    rescale_backward(to, s->d, &l->rescale);
}

/* Of a bilinear one. */
static int tape_rescale_graph(struct graph *g, const int *in,
                              const struct tape_step *s)
{
    const struct tape_rescale *l = s->layer;

    return graph_resize(g, in[0], s->channels, l->h, l->w);
}

static const struct tape_op rescale_op = {
    sizeof(struct tape_rescale), 0, false, tape_rescale_plan,
    tape_rescale_forward, tape_rescale_backward, tape_rescale_graph
};

int tape_rescale(struct tape *t, int of, enum rescale_mode mode, size_t h,
                 size_t w)
{
    const int map = TAPE_STEP(t, &rescale_op, of);
    struct tape_rescale *l = t->map[map]->layer;

    *l = (struct tape_rescale){.mode = mode, .h = h, .w = w};
    return map;
}

/* ---- one pixel of all values ------------------------------------------------ */

static void tape_flatten_plan(struct tape_step *s, struct nn_plan *p)
{
    (void)p;
    s->h = s->w = 1;
}

/* y (columns,rows) of x (rows,columns), turned, of each of `batch`. */
static void tape_turn(float *y, const float *x, size_t batch, size_t rows,
                      size_t columns)
{
    const size_t n = rows * columns;

    for (size_t i = 0; i < batch * n; i++)
        y[i / n * n + i % columns * rows + i % n / columns] = x[i];
}

static void tape_flatten_forward(struct tape_step *s)
{
    const struct tape_step *a = s->of[0];

    tape_turn(s->out, a->x, a->batch, a->h * a->w, a->channels);
}

static void tape_flatten_backward(float *to, struct tape_step *s, int k)
{
    const struct tape_step *a = s->of[k];

    tape_turn(to, s->d, a->batch, a->channels, a->h * a->w);
}

static const struct tape_op flatten_op = {
    0, 0, false, tape_flatten_plan, tape_flatten_forward,
    tape_flatten_backward, NULL
};

int tape_flatten(struct tape *t, int of, size_t pixels)
{
    const int map = TAPE_STEP(t, &flatten_op, of);

    t->map[map]->channels *= pixels;
    return map;
}

/* ---- channels as pixels ------------------------------------------------------ */

static void tape_to_space_plan(struct tape_step *s, struct nn_plan *p)
{
    const size_t *factor = s->layer;

    (void)p;
    s->h *= *factor;
    s->w *= *factor;
}

static void tape_to_space_forward(struct tape_step *s)
{
    const struct tape_step *a = s->of[0];
    const size_t *factor = s->layer;

    depth_to_space(s->out, a->x, a->batch, a->h, a->w, s->channels, *factor);
}

static void tape_to_space_backward(float *to, struct tape_step *s, int k)
{
    const size_t *factor = s->layer;

    (void)k;
    space_to_depth(to, s->d, s->batch, s->h, s->w, s->channels, *factor);
}

static int tape_to_space_graph(struct graph *g, const int *in,
                               const struct tape_step *s)
{
    const size_t *factor = s->layer;

    return graph_to_space(g, in[0], *factor);
}

static const struct tape_op to_space_op = {
    sizeof(size_t), 0, false, tape_to_space_plan, tape_to_space_forward,
    tape_to_space_backward, tape_to_space_graph
};

int tape_to_space(struct tape *t, int of, size_t factor)
{
    const int map = TAPE_STEP(t, &to_space_op, of);

    *(size_t *)t->map[map]->layer = factor;
    t->map[map]->channels /= factor * factor;
    return map;
}
