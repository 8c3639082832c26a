/* Phi_S and Phi_M (Section 3.2): from a feature image and the viewing
 * direction to one Gaussian per pixel. */
#include "lib/net/conv_decoder.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/net/harmonic.h"
#include "lib/nn/conv.h"
#include "lib/nn/image.h"

struct conv_decoder_impl {
    struct nn_plan plan;
    struct conv conv[4];
    size_t padded;               /* in + gamma, a multiple of 16 */
    float *gamma, *dgamma;       /* (B,27) */
    float *x;                    /* (B,h,w,padded) */
    float *y[3], *raw;           /* (B,h,w,width), (B,h,w,head) */
    float *grad[2], *dx;
};

int conv_decoder_init(struct conv_decoder *d, struct params *ps,
                      const char *prefix, size_t in, size_t width,
                      struct gaussian_head head, struct error *err)
{
    char name[120];

    memset(d, 0, sizeof *d);
    d->impl = calloc(1, sizeof *d->impl);
    if (!d->impl)
        return error_set(err, EX_OSERR, "out of memory");
    d->head = head;
    d->in = in;
    d->width = width;
    for (int i = 0; i < 4; i++) {
        struct conv *c = &d->impl->conv[i];

        conv_init(c, ps, nn_name(name, "%sgaussian_conv.%d", prefix, 2 * i),
                  i ? width : in + HARMONIC_OUT,
                  i < 3 ? width : gaussian_head_width(&head), i < 3 ? 3 : 1,
                  1, true);
        c->act = i < 3 ? ACT_RELU : ACT_NONE;
        ps->tensor[c->weight].gain = i < 3 ? 1.4142135f : 0.3f;
    }
    return 0;
}

int conv_decoder_plan(struct conv_decoder *d, size_t batch, size_t height,
                      size_t width, struct nn_options opt, struct error *err)
{
    struct conv_decoder_impl *im = d->impl;
    struct nn_plan *p = &im->plan;
    size_t pixels = batch * height * width, raw = gaussian_head_width(&d->head);

    nn_plan_release(p);
    nn_plan_init(p, opt);
    d->batch = batch;
    d->height = height;
    d->image_w = width;
    im->padded = (d->in + HARMONIC_OUT + 15) / 16 * 16;
    im->conv[0].in_data = im->padded;
    im->gamma = nn_plan_floats(p, batch * HARMONIC_OUT);
    im->x = nn_plan_map(p, pixels * im->padded);
    for (int i = 0; i < 4; i++) {
        float **y = i < 3 ? &im->y[i] : &im->raw;

        *y = nn_plan_map(p, pixels * (i < 3 ? d->width : raw));
        conv_plan(&im->conv[i], p, batch, height, width);
        nn_plan_recycle(p, i ? im->y[i - 1] : im->x);
    }
    if (nn_plan_backward(p)) {
        size_t most = d->width > raw ? d->width : raw;

        im->grad[0] = nn_plan_floats(p, pixels * most);
        im->grad[1] = nn_plan_floats(p, pixels * most);
        im->dx = nn_plan_floats(p, pixels * im->padded);
        im->dgamma = nn_plan_floats(p, batch * HARMONIC_OUT);
    }
    if (nn_plan_finish(p, err))
        return -1;
    conv_decoder_update(d);
    return 0;
}

void conv_decoder_update(struct conv_decoder *d)
{
    for (int i = 0; i < 4; i++)
        conv_update(&d->impl->conv[i], NULL);
}

void conv_decoder_release(struct conv_decoder *d)
{
    if (!d->impl)
        return;
    for (int i = 0; i < 4; i++)
        conv_release(&d->impl->conv[i]);
    nn_plan_release(&d->impl->plan);
    free(d->impl);
    memset(d, 0, sizeof *d);
}

float *conv_decoder_rows(size_t *stride, const struct conv_decoder *d)
{
    *stride = d->impl->padded;
    return d->impl->x;
}

void conv_decoder_forward(struct gaussian_out *out, const float *features,
                          const float *dir, const float *rgb_logit,
                          struct conv_decoder *d)
{
    struct conv_decoder_impl *im = d->impl;
    size_t N = d->height * d->image_w;

    harmonic_forward(im->gamma, dir, d->batch);
    concat_forward(im->x, features, im->gamma, d->batch * N, d->in,
                   HARMONIC_OUT, im->padded, N);
    conv_forward(im->y[0], im->x, &im->conv[0]);
    conv_forward(im->y[1], im->y[0], &im->conv[1]);
    conv_forward(im->y[2], im->y[1], &im->conv[2]);
    conv_forward(im->raw, im->y[2], &im->conv[3]);
    gaussian_head_forward(out, im->raw, rgb_logit, &d->head, d->batch, N,
                          gaussian_head_width(&d->head), d->image_w);
}

void conv_decoder_backward(float *dfeatures, float *ddir, float *drgb_logit,
                           const struct gaussian_out *dout,
                           const float *dir, const float *rgb_logit,
                           struct conv_decoder *d)
{
    struct conv_decoder_impl *im = d->impl;
    size_t N = d->height * d->image_w;
    float *a = im->grad[0], *b = im->grad[1];
    bool input = dfeatures || ddir;

    gaussian_head_backward(a, drgb_logit, dout, im->raw, rgb_logit, &d->head,
                           d->batch, N, gaussian_head_width(&d->head),
                           d->image_w);
    conv_backward(b, a, im->raw, im->y[2], &im->conv[3]);
    conv_backward(a, b, im->y[2], im->y[1], &im->conv[2]);
    conv_backward(b, a, im->y[1], im->y[0], &im->conv[1]);
    conv_backward(input ? im->dx : NULL, b, im->y[0], im->x, &im->conv[0]);
    if (!input)
        return;
    memset(im->dgamma, 0, d->batch * HARMONIC_OUT * sizeof *im->dgamma);
    concat_backward(dfeatures, ddir ? im->dgamma : NULL, im->dx, d->batch * N,
                    d->in, HARMONIC_OUT, im->padded, N);
    if (ddir) {
        memset(ddir, 0, 3 * d->batch * sizeof *ddir);
        harmonic_backward(ddir, im->dgamma, dir, d->batch);
    }
}
