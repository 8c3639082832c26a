/* What the three branches share: views of the set, the prior that is added to
 * a decoder's logits after its sigmoids, and helpers for initial weights. */
#include "lib/avatar/branch.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"

#define LOGIT_LIMIT 0.02f

/* ---- the Gaussians ----------------------------------------------------- */

struct branch_set branch_slice(const struct branch_set *s, size_t first,
                               size_t n)
{
    return (struct branch_set){
        .n = n, .channels = s->channels, .mean = s->mean + 3 * first,
        .scale = s->scale + 3 * first, .quat = s->quat + 4 * first,
        .opacity = s->opacity + first,
        .color = s->color + s->channels * first,
        .neck = s->neck ? s->neck + first : NULL,
        .seen = s->seen ? s->seen + first : NULL
    };
}

void branch_clear(struct branch_set *s)
{
    memset(s->mean, 0, 3 * s->n * sizeof *s->mean);
    memset(s->scale, 0, 3 * s->n * sizeof *s->scale);
    memset(s->quat, 0, 4 * s->n * sizeof *s->quat);
    memset(s->opacity, 0, s->n * sizeof *s->opacity);
    memset(s->color, 0, s->n * s->channels * sizeof *s->color);
    if (s->neck)
        memset(s->neck, 0, s->n * sizeof *s->neck);
}

/* ---- sigmoids with a shift --------------------------------------------- */

/* x e^s / (1 - x + x e^s), the same without the logarithm. */
float attribute_shift(float x, float s)
{
    float e = expf(s), y = x * e / (1 - x + x * e);

    return y < 1 ? y : 1;       /* rounding may pass 1 */
}

/* dy/dx = e^s / (1 - x + x e^s)^2. */
float attribute_shift_backward(float dy, float x, float s)
{
    float e = expf(s), d = 1 - x + x * e;

    return dy * e / (d * d);
}

/* The limits keep it finite. */
float attribute_logit(float x)
{
    x = fminf(fmaxf(x, LOGIT_LIMIT), 1 - LOGIT_LIMIT);
    return logf(x / (1 - x));
}

float attribute_logit_backward(float dy, float x)
{
    if (x <= LOGIT_LIMIT || x >= 1 - LOGIT_LIMIT)
        return 0;
    return dy / (x * (1 - x));
}

/* ---- the prior --------------------------------------------------------- */

struct gaussian_out branch_decoder_out(const struct branch_set *out,
                                       const struct branch_prior *p,
                                       float *position)
{
    return (struct gaussian_out){
        .color = out->color, .opacity = p->opacity, .scale = p->scale,
        .quat = out->quat, .position = position
    };
}

struct gaussian_out branch_attributes(const struct branch_set *s,
                                      float *position)
{
    return (struct gaussian_out){
        .color = s->color, .opacity = s->opacity, .scale = s->scale,
        .quat = s->quat, .position = position
    };
}

PARALLEL(branch_prior_forward_part, i, struct branch_set *, out,
         const struct branch_prior *, p)
{
    out->opacity[i] =
        p->visible[i] * attribute_shift(p->opacity[i], p->opacity_shift[i]);
    for (size_t c = 3 * i; c < 3 * i + 3; c++)
        out->scale[c] =
            p->scale_max[i] *
            attribute_shift(p->scale[c] / BRANCH_SCALE_MAX, p->scale_shift[i]);
}

/* opacity = visible shift(o), scale = max shift(s / max). */
void branch_prior_forward(struct branch_set *out, const struct branch_prior *p,
                          bool used)
{
    if (!used) {
        memcpy(out->opacity, p->opacity, out->n * sizeof *out->opacity);
        memcpy(out->scale, p->scale, 3 * out->n * sizeof *out->scale);
        return;
    }

    parallel_each(branch_prior_forward_part, out->n, 1, out, p);
}

PARALLEL(branch_prior_backward_part, i, const struct branch_prior *, p,
         float *, dvisible, struct branch_set *, dout)
{
    float x = p->opacity[i], shift = p->opacity_shift[i];

    /* opacity = visible shift(x) */
    dvisible[i] = dout->opacity[i] * attribute_shift(x, shift);
    dout->opacity[i] =
        attribute_shift_backward(dout->opacity[i] * p->visible[i], x, shift);
    for (size_t c = 3 * i; c < 3 * i + 3; c++)
        dout->scale[c] = attribute_shift_backward(
            dout->scale[c] * p->scale_max[i] / BRANCH_SCALE_MAX,
            p->scale[c] / BRANCH_SCALE_MAX, p->scale_shift[i]);
}

/* Reverse of branch_prior_forward, in place. */
void branch_prior_backward(struct branch_set *dout, float *dvisible,
                           const struct branch_prior *p, bool used)
{
    const size_t n = used ? dout->n : 0;

    parallel_each(branch_prior_backward_part, n, 1, p, dvisible, dout);
}

/* ---- steps and colours ------------------------------------------------- */

float branch_ramp(float x, float lo, float hi)
{
    float t = fminf(fmaxf((x - lo) / (hi - lo), 0), 1);

    return t * t * (3 - 2 * t);
}

float branch_mean_color(float rgb[3], const float *rgba, const float *weight,
                        size_t n, float min)
{
    float sum = 0;

    memset(rgb, 0, 3 * sizeof *rgb);
    for (size_t i = 0; i < n; i++) {
        const float *p = rgba + 4 * i;

        if (!(weight[i] > 0) || p[0] + p[1] + p[2] < 3 * min)
            continue;
        sum += weight[i];
        for (int c = 0; c < 3; c++)
            rgb[c] += weight[i] * p[c];
    }
    for (int c = 0; c < 3; c++)
        rgb[c] /= fmaxf(sum, 1e-6f);
    return sum;
}

float branch_likeness(const float rgb[3], const float like[3])
{
    const float a = rgb[0] + rgb[1] + rgb[2] + 1e-3f;
    const float b = like[0] + like[1] + like[2] + 1e-3f;
    float off = 0;

    for (int c = 0; c < 3; c++)
        off += fabsf(rgb[c] / a - like[c] / b);
    return (1 - branch_ramp(off, 0.05f, 0.1f)) * branch_ramp(a / b, 0.3f, 0.5f);
}

/* ---- initial weights --------------------------------------------------- */

void branch_scale_tensor(struct params *ps, const char *name, float factor)
{
    size_t t = params_find(ps, name);

    if (t == (size_t)-1)
        return;
    float *w = param_w(ps, t);
    for (size_t i = 0; i < ps->tensor[t].count; i++)
        w[i] *= factor;
}

void branch_set_bias(struct params *ps, const char *name, size_t first,
                     size_t n, float value)
{
    size_t t = params_find(ps, name);

    if (t == (size_t)-1 || first + n > ps->tensor[t].count)
        return;
    for (size_t i = first; i < first + n; i++)
        param_w(ps, t)[i] = value;
}

float branch_scale_bias(float spacing, bool prior)
{
    return prior ? 0 : attribute_logit(BRANCH_OVERLAP * spacing /
                                       BRANCH_SCALE_MAX);
}
