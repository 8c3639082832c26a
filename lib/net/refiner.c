/* Eq. SR by either of two refiners. */
#include "lib/net/refiner.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/net/narrow_refiner.h"
#include "lib/net/style_unet.h"

struct refiner_impl {
    struct narrow_refiner narrow;
    struct style_unet unet;
};

/* Which of the two it is. */
static bool refiner_is_narrow(const struct refiner *r)
{
    return r->config.type == REFINER_NARROW;
}

int refiner_init(struct refiner *r, struct params *ps, const char *prefix,
                 const struct refiner_config *config, struct error *err)
{
    memset(r, 0, sizeof *r);
    if (config->type == REFINER_NARROW &&
        (config->width < 8 || config->width % 8 || config->channels < 3))
        return error_set(err, EX_CONFIG, "refiner width %zu for %zu channels "
                         "(expected a multiple of 8, and 3 channels or more)",
                         config->width, config->channels);
    r->impl = calloc(1, sizeof *r->impl);
    if (!r->impl)
        return error_set(err, EX_OSERR, "out of memory");
    r->config = *config;
    if (!refiner_is_narrow(r))
        return style_unet_init(&r->impl->unet, ps, prefix, config->channels,
                               config->size, config->size, config->multiplier,
                               err);
    narrow_refiner_init(&r->impl->narrow, ps, prefix, config->channels,
                        config->width, config->turn, config->photo);
    return 0;
}

int refiner_plan(struct refiner *r, size_t batch, size_t height, size_t width,
                 struct nn_options opt, struct error *err)
{
    r->batch = batch;
    r->height = height;
    r->width = width;
    if (refiner_is_narrow(r))
        return narrow_refiner_plan(&r->impl->narrow, batch, height, width,
                                   opt, err);
    if (height != r->config.size || width != r->config.size)
        return error_set(err, EX_DATAERR, "the refiner cannot take %zux%zu "
                         "pixels (expected %zux%zu)", width, height,
                         r->config.size, r->config.size);
    return style_unet_plan(&r->impl->unet, batch, opt, err);
}

void refiner_release(struct refiner *r)
{
    if (!r->impl)
        return;
    if (refiner_is_narrow(r))
        narrow_refiner_release(&r->impl->narrow);
    else
        style_unet_release(&r->impl->unet);
    free(r->impl);
    memset(r, 0, sizeof *r);
}

void refiner_turn(struct refiner *r, const float turn[RELATIVE_POSE_SIZE])
{
    if (refiner_is_narrow(r))
        narrow_refiner_turn(&r->impl->narrow, turn);
}

void refiner_photo(struct refiner *r, const float *photo)
{
    r->impl->narrow.photo = photo;
}

const float *refiner_field(const struct refiner *r)
{
    return r->impl->narrow.k;
}

void refiner_forward(float *rgb, const float *feat, struct refiner *r)
{
    if (refiner_is_narrow(r))
        narrow_refiner_forward(rgb, feat, &r->impl->narrow);
    else
        style_unet_forward(rgb, feat, &r->impl->unet);
}

bool refiner_views(const struct refiner *r)
{
    return refiner_is_narrow(r) && narrow_refiner_views(&r->impl->narrow);
}

void refiner_forward_view(float *rgb, const struct feature_view *feat,
                          struct refiner *r)
{
    narrow_refiner_forward_view(rgb, feat, &r->impl->narrow);
}

bool refiner_repeats(const struct refiner *r)
{
    return refiner_views(r) && r->impl->narrow.end.joint.u;
}

void refiner_pick(float *rgb, const struct feature_view *feat,
                  struct refiner *r)
{
    fused_stem_pick(rgb, feat, &r->impl->narrow.stem);
}

bool refiner_repeat(float *rgb, const struct feature_view *feat,
                    struct refiner *r)
{
    struct narrow_refiner *n = &r->impl->narrow;

    return narrow_end_repeat(rgb, n->k, &n->end, feat->alpha,
                             feat->stride / n->channels);
}

void refiner_backward(const struct refiner_gradients *g, const float *drgb,
                      const float *dfield, struct refiner *r)
{
    if (refiner_is_narrow(r))
        narrow_refiner_backward(g->feat, g->photo, drgb, dfield,
                                &r->impl->narrow);
    else
        style_unet_backward(g->feat, drgb, &r->impl->unet);
    if (g->turn)        /* zero where nothing receives it */
        memcpy(g->turn, r->impl->narrow.dturn, sizeof r->impl->narrow.dturn);
}

/* ---- as a graph ---------------------------------------------------------- */

void refiner_graph(struct graph *g, size_t h, size_t w,
                   const struct refiner *r)
{
    if (refiner_is_narrow(r))
        narrow_refiner_graph(g, h, w, &r->impl->narrow);
    else
        graph_fail(g, EX_CONFIG, "the StyleUNet has no ONNX form here "
                   "(expected the narrow refiner)");
}
