#include "lib/net/refiner.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/net/narrow_refiner.h"

struct refiner_impl {
    struct narrow_refiner narrow;
};

int refiner_init(struct refiner *r, struct params *ps, const char *prefix,
                 const struct refiner_config *config, struct error *err)
{
    memset(r, 0, sizeof *r);
    if (config->type == REFINER_NARROW &&
        (config->width < 8 || config->width % 8 || config->channels < 3))
        return error_set(err, EX_CONFIG, "refiner width %zu for %zu channels "
                         "(expected a multiple of 8, and 3 channels or more)",
                         config->width, config->channels);
    if (config->type != REFINER_NARROW)
        return error_set(err, EX_CONFIG, "unknown refiner");
    r->impl = calloc(1, sizeof *r->impl);
    if (!r->impl)
        return error_set(err, EX_OSERR, "out of memory");
    r->config = *config;
    narrow_refiner_init(&r->impl->narrow, ps, prefix, config->channels,
                        config->width);
    return 0;
}

int refiner_plan(struct refiner *r, size_t batch, size_t height, size_t width,
                 struct nn_options opt, struct error *err)
{
    r->batch = batch;
    r->height = height;
    r->width = width;
    return narrow_refiner_plan(&r->impl->narrow, batch, height, width, opt,
                               err);
}

void refiner_update(struct refiner *r)
{
    narrow_refiner_update(&r->impl->narrow);
}

void refiner_release(struct refiner *r)
{
    if (!r->impl)
        return;
    narrow_refiner_release(&r->impl->narrow);
    free(r->impl);
    memset(r, 0, sizeof *r);
}

void refiner_forward(float *rgb, const float *feat, struct refiner *r)
{
    narrow_refiner_forward(rgb, feat, &r->impl->narrow);
}

void refiner_backward(float *dfeat, const float *drgb, struct refiner *r)
{
    narrow_refiner_backward(dfeat, drgb, &r->impl->narrow);
}
