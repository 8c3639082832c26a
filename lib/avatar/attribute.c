/* Starting values: what is added to a decoder's logits, after the fact. */
#include "lib/avatar/branches.h"

#include <math.h>

#define LOGIT_LIMIT 0.02f

float attribute_shift(float x, float s)
{
    float e = expf(s), y = x * e / (1 - x + x * e);

    return y < 1 ? y : 1;       /* rounding may pass 1 */
}

float attribute_shift_backward(float dy, float x, float s)
{
    float e = expf(s), d = 1 - x + x * e;

    return dy * e / (d * d);
}

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

void branch_shift(struct avatar *a, size_t i0, size_t i1)
{
    struct avatar_scratch *s = a->scratch;

    for (size_t i = i0; i < i1; i++) {
        if (!a->config.rgb_skip) {
            s->opacity[i] = s->opacity_raw[i];
            for (size_t c = 3 * i; c < 3 * i + 3; c++)
                s->scale[c] = s->scale_raw[c];
            continue;
        }
        s->opacity[i] = s->matte[i] * attribute_shift(s->opacity_raw[i],
                                                      s->opacity_shift[i]);
        for (size_t c = 3 * i; c < 3 * i + 3; c++)
            s->scale[c] = BRANCH_SCALE_MAX *
                          attribute_shift(s->scale_raw[c] / BRANCH_SCALE_MAX,
                                          s->scale_shift[i]);
    }
}

void branch_shift_backward(struct avatar *a, float *dmatte, size_t i0,
                           size_t i1)
{
    struct avatar_scratch *s = a->scratch;

    for (size_t i = i0; i < i1 && a->config.rgb_skip; i++) {
        float x = s->opacity_raw[i], shift = s->opacity_shift[i];

        /* opacity = matte shift(x) */
        if (dmatte)
            dmatte[i - i0] = s->dopacity[i] * attribute_shift(x, shift);
        s->dopacity[i] = attribute_shift_backward(s->dopacity[i] *
                                                  s->matte[i], x, shift);
        for (size_t c = 3 * i; c < 3 * i + 3; c++)
            s->dscale[c] = attribute_shift_backward(
                s->dscale[c], s->scale_raw[c] / BRANCH_SCALE_MAX,
                s->scale_shift[i]);
    }
}

struct gaussian_out branch_out(struct avatar *a, enum avatar_branch b)
{
    struct avatar_scratch *s = a->scratch;
    size_t i = a->first[b];
    float *position[BRANCH_COUNT] = {NULL, s->p_raw, s->q};

    return (struct gaussian_out){
        .color = s->color + i * a->config.channels,
        .opacity = s->opacity_raw + i, .scale = s->scale_raw + 3 * i,
        .quat = s->quat + 4 * i, .position = position[b]
    };
}

struct gaussian_out branch_dout(struct avatar *a, enum avatar_branch b)
{
    struct avatar_scratch *s = a->scratch;
    size_t i = a->first[b];
    float *position[BRANCH_COUNT] = {NULL, s->dp, s->dq};

    return (struct gaussian_out){
        .color = s->dcolor + i * a->config.channels,
        .opacity = s->dopacity + i, .scale = s->dscale + 3 * i,
        .quat = s->dquat + 4 * i, .position = position[b]
    };
}
