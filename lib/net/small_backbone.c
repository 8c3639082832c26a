/* The shipped backbone: a small encoder-decoder with skips (U-Net, Ronneberger
 * et al. 2015). */
#include "lib/net/small_backbone.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/nn/image.h"

#define L SMALL_LEVELS
#define GAIN ((float)M_SQRT2)

/* One 3x3 convolution with ReLU, "<prefix><what>.<i>.*". */
static void small_backbone_declare(struct conv *c, struct params *ps,
                                   const char *prefix, const char *what,
                                   size_t i, size_t in, size_t out,
                                   size_t stride, float gain)
{
    char name[120];

    conv_init(c, ps, nn_name(name, "%s%s.%zu", prefix, what, i), in, out, 3,
              stride, true);
    c->act = ACT_RELU;
    ps->tensor[c->weight].gain = gain;
}

void small_backbone_init(struct small_backbone *s, struct params *ps,
                         const char *prefix, size_t features, size_t size,
                         size_t width)
{
    static const size_t times[L] = { 2, 3, 6, 8, 8 };

    memset(s, 0, sizeof *s);
    s->features = features;
    s->size = size;
    for (size_t i = 0; i < L; i++) {
        s->channels[i] = times[i] * width;
        small_backbone_declare(&s->down[i], ps, prefix, "down", i,
                               i ? s->channels[i - 1] : 12, s->channels[i],
                               i ? 2 : 1, GAIN);
        if (i) {
            small_backbone_declare(&s->same[i], ps, prefix, "same", i,
                                   s->channels[i], s->channels[i], 1, 0.5f);
            s->same[i].add = true;
        }
    }
    for (size_t i = L - 1; i-- > 0;)
        small_backbone_declare(&s->up[i], ps, prefix, "up", i, s->channels[i],
                               i ? s->channels[i - 1] : features, 1,
                               i ? GAIN : 1);
    s->up[0].act = ACT_NONE;
    s->down[0].no_din = true;
}

/* The maps and layers of the way down and of the way up. */
static void small_backbone_plan_levels(struct small_backbone *s)
{
    struct nn_plan *p = &s->plan;
    size_t B = s->batch, n = s->size;

    for (size_t i = 0; i < L; i++) {
        size_t in = n;

        n = i ? (n + 1) / 2 : n;
        s->side[i] = n;
        s->a[i] = nn_plan_map(p, B * n * n * s->channels[i]);
        conv_plan(&s->down[i], p, B, in, in);
        s->b[i] = s->a[i];
        if (!i) {
            nn_plan_recycle(p, s->x);
            continue;
        }
        s->b[i] = nn_plan_map(p, B * n * n * s->channels[i]);
        conv_plan(&s->same[i], p, B, n, n);
        nn_plan_recycle(p, s->a[i]);
    }
    s->v[L - 1] = s->b[L - 1];
    for (size_t i = L - 1; i-- > 0;) {
        n = s->side[i];
        rescale_plan(&s->grow[i], p, RESCALE_BILINEAR, B, s->side[i + 1],
                     s->side[i + 1], n, n, s->channels[i]);
        s->u[i] = nn_plan_map(p, B * n * n * s->channels[i]);
        nn_plan_recycle(p, s->v[i + 1]);
        nn_plan_recycle(p, s->b[i]);
        s->v[i] = i ? nn_plan_map(p, B * n * n * s->channels[i - 1]) : NULL;
        conv_plan(&s->up[i], p, B, n, n);
        nn_plan_recycle(p, s->u[i]);
    }
}

int small_backbone_plan(struct small_backbone *s, size_t batch, size_t input,
                        struct nn_options opt, struct error *err)
{
    struct nn_plan *p = &s->plan;
    size_t n = s->size;

    nn_plan_release(p);
    nn_plan_init(p, opt);
    s->batch = batch;
    s->input = input;
    rescale_plan(&s->enlarge, p, RESCALE_ANTIALIAS, batch, input, input, 2 * n,
                 2 * n, 3);
    s->large = nn_plan_map(p, batch * 4 * n * n * 3);
    s->x = nn_plan_map(p, batch * n * n * 12);
    nn_plan_recycle(p, s->large);
    small_backbone_plan_levels(s);
    for (size_t i = 0; i < L && nn_plan_backward(p); i++) {
        size_t area = batch * s->side[i] * s->side[i];

        s->da[i] = nn_plan_floats(p, area * s->channels[i]);
        s->db[i] = nn_plan_floats(p, area * s->channels[i]);
        s->dv[i] = nn_plan_floats(p, area * (i ? s->channels[i - 1]
                                               : s->features));
    }
    return nn_plan_finish(p, err);
}

void small_backbone_release(struct small_backbone *s)
{
    nn_plan_release(&s->plan);
    memset(s, 0, sizeof *s);
}

/* Values of level i's map. */
static size_t small_backbone_level_size(const struct small_backbone *s,
                                        size_t i)
{
    return s->batch * s->side[i] * s->side[i] * s->channels[i];
}

void small_backbone_forward(float *features, const float *rgb,
                            struct small_backbone *s)
{
    const size_t n = 2 * s->size;

    rescale_forward(s->large, rgb, &s->enlarge);
    space_to_depth(s->x, s->large, s->batch, n, n, 3, 2);
    for (size_t i = 0; i < 3 * s->batch * n * n; i++)
        s->x[i] = (s->x[i] - 0.45f) * 4.0f;     /* photographs' mean to 0 */
    conv_forward(s->a[0], s->x, &s->down[0]);
    for (size_t i = 1; i < L; i++) {
        conv_forward(s->a[i], s->b[i - 1], &s->down[i]);
        memcpy(s->b[i], s->a[i],
               small_backbone_level_size(s, i) * sizeof(float));
        conv_forward(s->b[i], s->a[i], &s->same[i]);   /* relu(a + conv a) */
    }
    for (size_t i = L - 1; i-- > 0;) {
        rescale_forward(s->u[i], s->v[i + 1], &s->grow[i]);
        image_add(s->u[i], s->b[i], small_backbone_level_size(s, i));
        conv_forward(i ? s->v[i] : features, s->u[i], &s->up[i]);
    }
}

/* Backwards through the two loops of the forward: db[i] collects the skip's
 * gradient first, then the next level's. */
void small_backbone_backward(const float *dfeatures, struct small_backbone *s)
{
    size_t n = s->batch * s->size * s->size * s->features;

    memcpy(s->dv[0], dfeatures, n * sizeof *dfeatures);
    for (size_t i = 0; i + 1 < L; i++) {
        /* u = b[i] + grow(v[i+1]); v[i] = conv u */
        conv_backward(s->db[i], s->dv[i], s->v[i], s->u[i], &s->up[i]);
        rescale_backward(i + 2 < L ? s->dv[i + 1] : s->db[i + 1], s->db[i],
                         &s->grow[i]);
    }
    for (size_t i = L - 1; i > 0; i--) {
        /* b = relu(a + conv a): db becomes the gradient before the relu */
        conv_backward(s->da[i], s->db[i], s->b[i], s->a[i], &s->same[i]);
        image_add(s->da[i], s->db[i], small_backbone_level_size(s, i));
        float *below = i > 1 ? s->da[i - 1] : s->da[0];
        conv_backward(below, s->da[i], s->a[i], s->b[i - 1], &s->down[i]);
        image_add(s->db[i - 1], below, small_backbone_level_size(s, i - 1));
    }
    conv_backward(NULL, s->db[0], s->a[0], s->x, &s->down[0]);
}

/* ---- as a graph ---------------------------------------------------------- */

int small_backbone_graph(struct graph *g, int picture, size_t input,
                         const struct small_backbone *s)
{
    size_t n = s->size, side[L];
    int x = graph_maps(g, picture), b[L];

    if (input > 2 * n)
        graph_fail(g, EX_CONFIG, "a backbone that shrinks its picture has no "
                   "ONNX form here");
    if (input != 2 * n)
        x = graph_resize(g, x, 3, 2 * n, 2 * n);
    x = GRAPH_NODE(g, "Sub", x, graph_real(g, 0.45f));
    x = GRAPH_NODE(g, "Mul", x, graph_real(g, 4));
    x = graph_to_depth(g, x, 2);
    for (size_t i = 0; i < L; i++) {
        n = i ? (n + 1) / 2 : n;
        side[i] = n;
        x = graph_conv(g, x, &s->down[i]);
        b[i] = x = i ? graph_conv_add(g, x, x, &s->same[i]) : x;
    }
    for (size_t i = L - 1; i-- > 0;) {
        x = graph_resize(g, x, s->channels[i], side[i], side[i]);
        x = graph_conv(g, GRAPH_NODE(g, "Add", x, b[i]), &s->up[i]);
    }
    return x;
}
