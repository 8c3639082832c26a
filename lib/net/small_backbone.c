/* The shipped backbone: a small encoder-decoder with skips (U-Net, Ronneberger
 * et al. 2015). */
#include "lib/net/small_backbone.h"

#include <math.h>
#include <sysexits.h>

#include "lib/nn/image.h"

#define L 5
#define GAIN ((float)M_SQRT2)
#define MEAN 0.45f               /* of photographs' values: becomes 0, */
#define SPREAD 4.0f              /* and their spread about 1 */

/* ---- its own step: blocks of 2x2 pixels, about 0 ------------------------------ */

static void small_backbone_fold_plan(struct tape_step *s, struct nn_plan *p)
{
    (void)p;
    s->h /= 2;
    s->w /= 2;
}

static void small_backbone_fold(struct tape_step *s)
{
    space_to_depth(s->out, s->of[0]->x, s->batch, 2 * s->h, 2 * s->w, 3, 2);
    for (size_t i = 0; i < tape_count(s); i++)
        s->out[i] = (s->out[i] - MEAN) * SPREAD;
}

static int small_backbone_fold_graph(struct graph *g, const int *in,
                                     const struct tape_step *s)
{
    int x = GRAPH_NODE(g, "Sub", in[0], graph_real(g, MEAN));

    (void)s;
    x = GRAPH_NODE(g, "Mul", x, graph_real(g, SPREAD));
    return graph_to_depth(g, x, 2);
}

static const struct tape_op fold_op = {
    0, 0, false, small_backbone_fold_plan, small_backbone_fold, NULL,
    small_backbone_fold_graph
};

/* ---- the network ---------------------------------------------------------------- */

/* A step that is a 3x3 convolution: its act and its weights' gain. */
static int small_backbone_set(struct tape *t, int map, size_t stride,
                              enum nn_act act, float gain)
{
    struct conv *c = tape_layer(t, map);

    c->stride = stride;
    c->act = act;
    t->ps->tensor[c->weight].gain = gain;
    return map;
}

void small_backbone_init(struct small_backbone *s, struct params *ps,
                         const char *prefix, size_t features, size_t size,
                         size_t width)
{
    static const size_t times[L] = { 2, 3, 6, 8, 8 };
    size_t side[L], n = size;
    struct tape *t = &s->tape;
    char name[120];
    int skip[L];

    s->size = size;
    tape_init(t, ps, 3, false);
    int x = tape_rescale(t, 0, RESCALE_ANTIALIAS, 2 * size, 2 * size);
    x = TAPE_STEP(t, &fold_op, x);
    tape_constant(t, x);
    t->map[x]->channels = 12;
    for (size_t i = 0; i < L; i++) {
        const size_t C = times[i] * width;

        side[i] = n = i ? (n + 1) / 2 : n;
        nn_name(name, "%sdown.%zu", prefix, i);
        x = small_backbone_set(t, tape_conv(t, x, name, C, 3, true), i ? 2 : 1,
                               ACT_RELU, GAIN);
        nn_name(name, "%ssame.%zu", prefix, i);
        if (i)
            x = small_backbone_set(t, tape_conv_onto(t, x, x, name, C, 3, true),
                                   1, ACT_RELU, 0.5f);
        skip[i] = x;
    }
    for (size_t i = L - 1; i-- > 0;) {
        x = tape_rescale(t, x, RESCALE_BILINEAR, side[i], side[i]);
        x = tape_add(t, x, skip[i], ACT_NONE);
        nn_name(name, "%sup.%zu", prefix, i);
        x = tape_conv(t, x, name, i ? times[i - 1] * width : features, 3, true);
        small_backbone_set(t, x, 1, i ? ACT_RELU : ACT_NONE, i ? GAIN : 1);
    }
}

int small_backbone_plan(struct small_backbone *s, size_t batch, size_t input,
                        struct nn_options opt, struct error *err)
{
    return tape_plan(&s->tape, batch, input, input, opt, err);
}

void small_backbone_release(struct small_backbone *s)
{
    tape_release(&s->tape);
}

/* ---- as a graph ---------------------------------------------------------- */

int small_backbone_graph(struct graph *g, int picture, size_t input,
                         const struct small_backbone *s)
{
    const size_t side = 2 * s->size;
    int x = graph_maps(g, picture);

    if (input > side)
        graph_fail(g, EX_CONFIG, "a backbone that shrinks its picture has no "
                   "ONNX form here");
    if (input != side)
        x = graph_resize(g, x, 3, side, side);
    return tape_graph(g, x, 1, s->tape.count - 1, &s->tape);
}
