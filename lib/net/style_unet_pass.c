/* StyleUNet, one pass through it and the same backwards. */
#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/net/style_unet.h"
#include "lib/nn/image.h"

#define EPS 1e-8

/* ---- forward ------------------------------------------------------------- */

/* flat (B,C*16) <-> inner (B,16,C) */
static void style_unet_flatten(float *flat, float *inner, size_t B, size_t C,
                               bool back)
{
    for (size_t n = 0; n < B; n++)
        for (size_t i = 0; i < 16; i++)
            for (size_t c = 0; c < C; c++) {
                float *a = flat + (n * C + c) * 16 + i;
                float *b = inner + (n * 16 + i) * C + c;

                if (back)
                    *b += *a;
                else
                    *a = *b;
            }
}

/* s = code rsqrt(mean(code^2) + eps), then the eight layers. */
static void style_unet_style_forward(struct style_unet *s)
{
    size_t Z = s->latent;

    style_unet_flatten(s->flat, s->inner, s->batch, style_unet_width(s, 4),
                       false);
    conv_forward(s->code, s->flat, &s->final_linear);
    for (size_t n = 0; n < s->batch; n++) {
        const float *c = s->code + n * Z;
        double sum = 0;

        for (size_t i = 0; i < Z; i++)
            sum += (double)c[i] * (double)c[i];
        double unit = 1 / sqrt(sum / (double)Z + EPS);
        for (size_t i = 0; i < Z; i++)
            s->normal[n * Z + i] = (float)((double)c[i] * unit);
    }
    for (size_t i = 0; i < 8; i++)
        conv_forward(s->style[i], i ? s->style[i - 1] : s->normal, &s->mlp[i]);
}

/* The way down, to the innermost map s->inner. */
static void style_unet_encoder_forward(const float *feat, struct style_unet *s)
{
    const float *x = feat;

    if (s->in) {
        rescale_forward(s->in, feat, &s->enlarge);
        x = s->in;
    }
    s->feat = x;
    conv_forward(s->x0, x, &s->first);
    x = s->x0;
    if (s->halve) {
        style_res_forward(x, &s->first_res);
        x = s->first_res.out;
    }
    for (size_t i = 0; i < s->levels; i++) {
        style_res_forward(x, &s->level[i].down);
        x = s->level[i].down.out;
    }
    conv_forward(s->inner, x, &s->final_conv);
}

#define CHUNK 16384              /* values that a thread takes at once */

/* y = x scale + shift, two maps of n values. */
PARALLEL(style_unet_transform, k, float *, y, const float *, x,
         const float *, scale, const float *, shift, size_t, n)
{
    const size_t end = (k + 1) * CHUNK < n ? (k + 1) * CHUNK : n;

#pragma omp simd
    for (size_t i = k * CHUNK; i < end; i++)
        y[i] = x[i] * scale[i] + shift[i];
}

/* One level up: conditions from the encoder, two style convolutions,
 * picture. */
static void style_unet_level_forward(struct style_unet *s, size_t i,
                                     const float *f, const float *x,
                                     const float *rgb)
{
    struct style_level *l = &s->level[i];
    const struct style_res *down = &s->level[s->levels - 1 - i].down;
    const float *latent = s->style[7];
    size_t n = s->batch * l->side / 2 * l->side / 2 * l->up.conv1.in;
    size_t values = s->batch * l->side * l->side * l->enlarge.out;

    memcpy(l->f, f, n * sizeof *f);
    image_add(l->f, down->out, n);
    style_res_forward(l->f, &l->up);
    style_condition_forward(l->up.out, &l->scale);
    style_condition_forward(l->up.out, &l->shift);
    style_conv_forward(x, latent, &l->enlarge);
    parallel_each(style_unet_transform, (values + CHUNK - 1) / CHUNK, 1, l->sft,
                  l->enlarge.y, l->scale.out, l->shift.out, values);
    style_conv_forward(l->sft, latent, &l->same);
    to_rgb_forward(l->same.y, latent, rgb, &l->rgb);
}

void style_unet_forward(float *image, const float *feat, struct style_unet *s)
{
    size_t C = 2 * style_unet_width(s, 4), n = s->out_size * s->out_size * 3;
    const float *constant = param_w(s->ps, s->constant);

    style_unet_encoder_forward(feat, s);
    style_unet_style_forward(s);
    for (size_t b = 0; b < s->batch; b++)
        for (size_t i = 0; i < 16; i++)
            for (size_t c = 0; c < C; c++)
                s->constants[(b * 16 + i) * C + c] = constant[c * 16 + i];
    style_conv_forward(s->constants, s->style[7], &s->conv1);
    to_rgb_forward(s->conv1.y, s->style[7], NULL, &s->rgb1);
    const float *f = s->inner, *x = s->conv1.y, *rgb = s->rgb1.rgb;
    for (size_t i = 0; i < s->levels; i++) {
        style_unet_level_forward(s, i, f, x, rgb);
        f = s->level[i].up.out;
        x = s->level[i].same.y;
        rgb = s->level[i].rgb.rgb;
    }
    act_forward(s->image, rgb, ACT_SIGMOID, s->batch * n);
    memcpy(image, s->image, s->batch * n * sizeof *image);
}

/* ---- backward ------------------------------------------------------------ */

static void style_unet_swap(float **a, float **b)
{
    float *was = *a;

    *a = *b;
    *b = was;
}

/* d(x scale + shift): dscale = d x, then d = d scale. */
PARALLEL(style_unet_transform_backward, k, float *, d, float *, dscale,
         const float *, x, const float *, scale, size_t, n)
{
    const size_t end = (k + 1) * CHUNK < n ? (k + 1) * CHUNK : n;

#pragma omp simd
    for (size_t i = k * CHUNK; i < end; i++) {
        dscale[i] = d[i] * x[i];
        d[i] *= scale[i];
    }
}

/* On entry g[0]: gradient of same.y from the next level, g[1]: of up.out from
 * the next level; drgb: of this level's picture.  On return the same for the
 * level before (its x, and f). */
static void style_unet_level_backward(struct style_unet *s, size_t i,
                                      const float *x, float *drgb,
                                      float *dprevious)
{
    struct style_level *l = &s->level[i];
    struct style_level *other = &s->level[s->levels - 1 - i];
    const float *latent = s->style[7];
    float **g = s->g;
    size_t n = s->batch * l->side * l->side * l->enlarge.out;
    size_t half = s->batch * l->side * l->side / 4 * l->up.conv1.in;

    to_rgb_backward(g[0], s->dlatent, dprevious, drgb, l->same.y, latent,
                    g[3], &l->rgb);
    style_conv_backward(g[2], s->dlatent, g[0], l->sft, latent, g[3], g[4],
                        &l->same);
    /* g2: gradient of sft = y scale + shift */
    memcpy(g[3], g[2], n * sizeof *g[3]);
    style_condition_backward(g[1], g[3], l->up.out, g[0], g[4], &l->shift);
    parallel_each(style_unet_transform_backward, (n + CHUNK - 1) / CHUNK, 1,
                  g[2], g[3], l->enlarge.y, l->scale.out, n);
    style_condition_backward(g[1], g[3], l->up.out, g[0], g[4], &l->scale);
    style_conv_backward(g[0], s->dlatent, g[2], x, latent, g[3], g[4],
                        &l->enlarge);
    style_res_backward(g[2], g[1], l->f, g[3], g[4], &l->up);
    memcpy(other->ddown, g[2], half * sizeof *g[2]);
    style_unet_swap(&g[1], &g[2]);
}

/* dlatent through the eight layers and the normalisation, to the innermost
 * map's gradient, which is added to dinner. */
static void style_unet_style_backward(float *dinner, struct style_unet *s)
{
    size_t Z = s->latent;
    float *a = s->dlatent, *b = s->dstyle;

    for (size_t i = 8; i-- > 0;) {
        conv_backward(b, a, s->style[i], i ? s->style[i - 1] : s->normal,
                      &s->mlp[i]);
        style_unet_swap(&a, &b);
    }
    for (size_t n = 0; n < s->batch; n++) {
        const float *c = s->code + n * Z;
        float *d = a + n * Z;
        double sum = 0, along = 0;

        for (size_t i = 0; i < Z; i++) {
            sum += (double)c[i] * (double)c[i];
            along += (double)c[i] * (double)d[i];
        }
        double m = sum / (double)Z + EPS, unit = 1 / sqrt(m);
        for (size_t i = 0; i < Z; i++)
            d[i] = (float)(unit * ((double)d[i] - (double)c[i] * along /
                                                      (m * (double)Z)));
    }
    conv_backward(s->dflat, a, s->code, s->flat, &s->final_linear);
    style_unet_flatten(s->dflat, dinner, s->batch, style_unet_width(s, 4),
                       true);
}

/* From the innermost map's gradient g[1] and the skips' to dfeat. */
static void style_unet_encoder_backward(float *dfeat, struct style_unet *s)
{
    float **g = s->g;
    const struct style_level *last = &s->level[s->levels - 1];
    size_t n = s->batch * 16 * style_unet_width(s, 4);

    /* g1: gradient of final_conv's output */
    conv_backward(g[0], g[1], s->inner, last->down.out, &s->final_conv);
    image_add(g[0], last->ddown, n);
    for (size_t i = s->levels; i-- > 0;) {
        struct style_level *l = &s->level[i];
        const float *x = i ? s->level[i - 1].down.out
                       : s->halve ? s->first_res.out : s->x0;

        style_res_backward(g[1], g[0], x, g[2], g[3], &l->down);
        if (i)
            image_add(g[1], s->level[i - 1].ddown,
                      style_res_size(&s->level[i - 1].down));
        style_unet_swap(&g[0], &g[1]);
    }
    if (s->halve) {
        style_res_backward(g[1], g[0], s->x0, g[2], g[3], &s->first_res);
        style_unet_swap(&g[0], &g[1]);
    }
    conv_backward(s->in && dfeat ? g[1] : dfeat, g[0], s->x0, s->feat,
                  &s->first);
    if (s->in && dfeat)
        rescale_backward(dfeat, g[1], &s->enlarge);
}

void style_unet_backward(float *dfeat, const float *dimage,
                         struct style_unet *s)
{
    size_t B = s->batch, C = 2 * style_unet_width(s, 4), L = s->levels;
    size_t top = s->out_size;
    float **g = s->g, *drgb = s->drgb[0], *dprev = s->drgb[1];

    memset(s->dlatent, 0, B * s->latent * sizeof *s->dlatent);
    act_backward_out(drgb, dimage, s->image, ACT_SIGMOID, B * top * top * 3);
    memset(g[0], 0, B * top * top * 2 * style_unet_width(s, top) * sizeof
           *g[0]);
    memset(g[1], 0, style_res_size(&s->level[L - 1].up) * sizeof *g[1]);
    for (size_t i = L; i-- > 0;) {
        style_unet_level_backward(s, i,
                                  i ? s->level[i - 1].same.y : s->conv1.y,
                                  drgb, dprev);
        style_unet_swap(&drgb, &dprev);
    }
    to_rgb_backward(g[0], s->dlatent, NULL, drgb, s->conv1.y, s->style[7],
                    g[3], &s->rgb1);
    style_conv_backward(g[2], s->dlatent, g[0], s->constants, s->style[7],
                        g[3], g[4], &s->conv1);
    float *dc = param_g(s->ps, s->constant);
    for (size_t b = 0; b < B; b++)
        for (size_t i = 0; i < 16; i++)
            for (size_t c = 0; c < C; c++)
                dc[c * 16 + i] += g[2][(b * 16 + i) * C + c];
    style_unet_style_backward(g[1], s);
    style_unet_encoder_backward(dfeat, s);
}
