#include "lib/net/backbone.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/net/small_backbone.h"

struct backbone_impl {
    struct small_backbone small;
};

int backbone_init(struct backbone *b, struct params *ps, const char *prefix,
                  const struct backbone_config *config, struct error *err)
{
    memset(b, 0, sizeof *b);
    if (config->type != BACKBONE_SMALL)
        return error_set(err, EX_CONFIG, "unknown backbone");
    if (!config->width || !config->features || !config->size)
        return error_set(err, EX_CONFIG, "backbone of width %zu, %zu features,"
                         " size %zu (expected numbers above 0)",
                         config->width, config->features, config->size);
    b->impl = calloc(1, sizeof *b->impl);
    if (!b->impl)
        return error_set(err, EX_OSERR, "out of memory");
    b->config = *config;
    small_backbone_init(&b->impl->small, ps, prefix, config->features,
                        config->size, config->width);
    return 0;
}

int backbone_plan(struct backbone *b, size_t batch, size_t input,
                  struct nn_options opt, struct error *err)
{
    b->batch = batch;
    b->input = input;
    return small_backbone_plan(&b->impl->small, batch, input, opt, err);
}

void backbone_update(struct backbone *b)
{
    small_backbone_update(&b->impl->small);
}

void backbone_release(struct backbone *b)
{
    if (!b->impl)
        return;
    small_backbone_release(&b->impl->small);
    free(b->impl);
    memset(b, 0, sizeof *b);
}

void backbone_forward(float *features, const float *rgb, struct backbone *b)
{
    small_backbone_forward(features, rgb, &b->impl->small);
}

void backbone_backward(const float *dfeatures, struct backbone *b)
{
    small_backbone_backward(dfeatures, &b->impl->small);
}
