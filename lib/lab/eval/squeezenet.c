/* SqueezeNet 1.0's features, forward and back to the picture. */
#include "lib/lab/eval/squeezenet.h"

#include <string.h>
#include <sysexits.h>

#include "lib/nn/image.h"

#define FIRST 96                  /* channels of the first convolution */

/* The fire modules: the index in "features.N", channels squeezed to, channels
 * of each expansion, and whether a pool goes before. */
static const struct {
    size_t index, squeeze, expand;
    bool pooled;
} squeezenet_fires[SQUEEZENET_FIRES] = {
    { 3, 16, 64, true },   { 4, 16, 64, false },  { 5, 32, 128, false },
    { 7, 32, 128, true },  { 8, 48, 192, false }, { 9, 48, 192, false },
    { 10, 64, 256, false }, { 12, 64, 256, true }
};

/* One convolution with ReLU, frozen. */
static void squeezenet_conv(struct conv *c, struct params *ps,
                            const char *name, size_t in, size_t out,
                            size_t kernel)
{
    conv_init(c, ps, name, in, out, kernel, 1, true);
    c->act = ACT_RELU;
    ps->tensor[c->weight].frozen = ps->tensor[c->bias].frozen = true;
}

void squeezenet_init(struct squeezenet *s, struct params *ps)
{
    char name[120];
    size_t in = FIRST;

    memset(s, 0, sizeof *s);
    s->ps = ps;
    squeezenet_conv(&s->first, ps, "features.0", 3, FIRST, 7);
    s->first.stride = 2;
    s->first.pad = CONV_NONE;
    for (size_t i = 0; i < SQUEEZENET_FIRES; i++) {
        struct squeezenet_fire *f = &s->fire[i];
        size_t at = squeezenet_fires[i].index;
        size_t few = squeezenet_fires[i].squeeze;
        size_t out = squeezenet_fires[i].expand;

        f->pooled = squeezenet_fires[i].pooled;
        squeezenet_conv(&f->squeeze, ps,
                        nn_name(name, "features.%zu.squeeze", at),
                        in, few, 1);
        squeezenet_conv(&f->expand1, ps,
                        nn_name(name, "features.%zu.expand1x1", at),
                        few, out, 1);
        squeezenet_conv(&f->expand3, ps,
                        nn_name(name, "features.%zu.expand3x3", at),
                        few, out, 3);
        in = 2 * out;
    }
}

/* A fire module on maps (h,w), which become the pooled ones. */
static void squeezenet_fire_plan(struct squeezenet_fire *f, struct nn_plan *p,
                                 size_t *h, size_t *w)
{
    size_t in = f->squeeze.in, half = f->expand1.out;

    if (f->pooled) {
        max_pool_plan(&f->pool, p, 1, *h, *w, in, true);
        *h = f->pool.oh;
        *w = f->pool.ow;
        f->x = nn_plan_floats(p, *h * *w * in);
    }
    f->h = *h;
    f->w = *w;
    f->s = nn_plan_floats(p, *h * *w * f->squeeze.out);
    f->e1 = nn_plan_floats(p, *h * *w * half);
    f->e3 = nn_plan_floats(p, *h * *w * half);
    f->out = nn_plan_floats(p, *h * *w * 2 * half);
    conv_plan(&f->squeeze, p, 1, *h, *w);
    conv_plan(&f->expand1, p, 1, *h, *w);
    conv_plan(&f->expand3, p, 1, *h, *w);
}

int squeezenet_plan(struct squeezenet *s, size_t height, size_t width,
                    struct nn_options opt, struct error *err)
{
    struct nn_plan *p = &s->plan;

    if (height < SQUEEZENET_MIN || width < SQUEEZENET_MIN)
        return error_set(err, EX_DATAERR, "SqueezeNet on %zux%zu pixels "
                         "(expected %d or more)", width, height,
                         SQUEEZENET_MIN);
    nn_plan_release(p);
    nn_plan_init(p, opt);
    s->height = height;
    s->width = width;
    conv_plan(&s->first, p, 1, height, width);
    size_t h = s->first.oh, w = s->first.ow, max = h * w * FIRST;
    s->relu1 = nn_plan_floats(p, max);
    for (size_t i = 0; i < SQUEEZENET_FIRES; i++) {
        struct squeezenet_fire *f = &s->fire[i];

        squeezenet_fire_plan(f, p, &h, &w);
        size_t n = h * w * 2 * f->expand1.out;
        max = n > max ? n : max;
    }
    for (size_t i = 0; i < 4 && nn_plan_backward(p); i++)
        s->g[i] = nn_plan_floats(p, max);
    return nn_plan_finish(p, err);
}

void squeezenet_release(struct squeezenet *s)
{
    nn_plan_release(&s->plan);
    memset(s, 0, sizeof *s);
}

const float *squeezenet_layer(size_t shape[4], const struct squeezenet *s,
                              enum squeezenet_layer layer)
{
    const struct squeezenet_fire *f = &s->fire[layer ? layer - 1 : 0];

    shape[0] = 1;
    shape[1] = layer ? f->h : s->first.oh;
    shape[2] = layer ? f->w : s->first.ow;
    shape[3] = layer ? 2 * f->expand1.out : FIRST;
    return layer ? f->out : s->relu1;
}

/* What fire module i reads: the layer before or its pool. */
static const float *squeezenet_input(const struct squeezenet *s, size_t i)
{
    if (s->fire[i].pooled)
        return s->fire[i].x;
    return i ? s->fire[i - 1].out : s->relu1;
}

void squeezenet_forward(const float *rgb, struct squeezenet *s)
{
    s->rgb = rgb;
    conv_forward(s->relu1, rgb, &s->first);
    for (size_t i = 0; i < SQUEEZENET_FIRES; i++) {
        struct squeezenet_fire *f = &s->fire[i];
        size_t half = f->expand1.out;

        if (f->pooled)
            max_pool_forward(f->x, i ? s->fire[i - 1].out : s->relu1,
                             &f->pool);
        conv_forward(f->s, squeezenet_input(s, i), &f->squeeze);
        conv_forward(f->e1, f->s, &f->expand1);
        conv_forward(f->e3, f->s, &f->expand3);
        concat_forward(f->out, f->e1, f->e3, f->h * f->w, half, half, 2 * half,
                       1);
    }
}

/* From g[0], the gradient of fire module i's output, to g[0], that of the
 * layer before. */
static void squeezenet_fire_backward(float *g[4], size_t i,
                                     struct squeezenet *s)
{
    struct squeezenet_fire *f = &s->fire[i];
    size_t rows = f->h * f->w, half = f->expand1.out;

    concat_take(g[1], g[0], rows, 0, half, 2 * half);
    concat_take(g[2], g[0], rows, half, half, 2 * half);
    conv_backward(g[3], g[1], f->e1, f->s, &f->expand1);
    conv_backward(g[1], g[2], f->e3, f->s, &f->expand3);
    image_add(g[3], g[1], rows * f->squeeze.out);
    conv_backward(g[f->pooled ? 1 : 0], g[3], f->s, squeezenet_input(s, i),
                  &f->squeeze);
    if (f->pooled)
        max_pool_backward(g[0], g[1], &f->pool);
}

void squeezenet_backward(float *drgb,
                         const float *const dlayer[SQUEEZENET_LAYERS],
                         struct squeezenet *s)
{
    float **g = s->g;
    bool begun = false;           /* g[0] holds something */
    size_t shape[4];

    for (size_t layer = SQUEEZENET_LAYERS; layer-- > 0;) {
        squeezenet_layer(shape, s, (enum squeezenet_layer)layer);
        size_t n = shape[0] * shape[1] * shape[2] * shape[3];

        if (dlayer[layer] && begun)
            image_add(g[0], dlayer[layer], n);
        else if (dlayer[layer])
            memcpy(g[0], dlayer[layer], n * sizeof *g[0]);
        begun = begun || dlayer[layer];
        if (begun && layer)
            squeezenet_fire_backward(g, layer - 1, s);
    }
    if (begun)
        conv_backward(drgb, g[0], s->relu1, s->rgb, &s->first);
    else
        memset(drgb, 0, s->height * s->width * 3 * sizeof *drgb);
}
