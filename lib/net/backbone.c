/* The source picture's features (Section 3.2) by either of two backbones. */
#include "lib/net/backbone.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/net/dino_base.h"
#include "lib/net/small_backbone.h"

struct backbone_impl {
    struct small_backbone small;
    struct dino_base dino;
};

/* Which of the two it is. */
static bool backbone_is_small(const struct backbone *b)
{
    return b->config.type == BACKBONE_SMALL;
}

int backbone_init(struct backbone *b, struct params *ps, const char *prefix,
                  const struct backbone_config *config, struct error *err)
{
    memset(b, 0, sizeof *b);
    if (!config->features || !config->size ||
        (config->type == BACKBONE_SMALL && !config->width))
        return error_set(err, EX_CONFIG, "backbone of width %zu, %zu features,"
                         " size %zu (expected numbers above 0)",
                         config->width, config->features, config->size);
    b->impl = calloc(1, sizeof *b->impl);
    if (!b->impl)
        return error_set(err, EX_OSERR, "out of memory");
    b->config = *config;
    if (backbone_is_small(b)) {
        small_backbone_init(&b->impl->small, ps, prefix, config->features,
                            config->size, config->width);
        return 0;
    }
    struct dinov2_config vit = {
        .embed = config->embed, .depth = config->depth, .heads = config->heads,
        .patch = config->patch, .grid = DINOV2_GRID, .last = DINO_LEVELS
    };
    if (!config->patch || config->image % config->patch || !config->image)
        return error_set(err, EX_CONFIG, "backbone image %zu, patch %zu "
                         "(expected a multiple)", config->image,
                         config->patch);
    return dino_base_init(&b->impl->dino, ps, prefix, &vit, config->image,
                          config->image, config->size, config->features, err);
}

int backbone_plan(struct backbone *b, size_t batch, size_t input,
                  struct nn_options opt, struct error *err)
{
    b->batch = batch;
    b->input = input;
    if (backbone_is_small(b))
        return small_backbone_plan(&b->impl->small, batch, input, opt, err);
    return dino_base_plan(&b->impl->dino, batch, input, input, opt, err);
}

void backbone_release(struct backbone *b)
{
    if (!b->impl)
        return;
    if (backbone_is_small(b))
        small_backbone_release(&b->impl->small);
    else
        dino_base_release(&b->impl->dino);
    free(b->impl);
    memset(b, 0, sizeof *b);
}

/* Either is a list of steps. */
static struct tape *backbone_tape(struct backbone *b)
{
    return backbone_is_small(b) ? &b->impl->small.tape : &b->impl->dino.tape;
}

void backbone_forward(float *features, const float *rgb, struct backbone *b)
{
    tape_forward(features, rgb, backbone_tape(b));
}

void backbone_token(float *token, const struct backbone *b)
{
    const struct dinov2 *vit = &b->impl->dino.vit;
    const size_t E = vit->config.embed;
    const float *last = dinov2_tokens(vit, DINO_LEVELS - 1);

    for (size_t n = 0; n < b->batch; n++)
        memcpy(token + n * E, last + (n * vit->tokens + 1) * E,
               E * sizeof *token);
}

const struct dino_base *backbone_dino(const struct backbone *b)
{
    return backbone_is_small(b) ? NULL : &b->impl->dino;
}

void backbone_backward(const float *dfeatures, struct backbone *b)
{
    struct tape *t = backbone_tape(b);

    tape_backward(NULL, &(struct tape_seed){t->count - 1, dfeatures}, 1, t);
}

/* ---- as a graph ---------------------------------------------------------- */

void backbone_graph(struct graph *g, size_t input, const struct backbone *b)
{
    const size_t n = b->config.size;

    if (!backbone_is_small(b)) {
        graph_fail(g, EX_CONFIG, "the DINOv2 backbone has no ONNX form here "
                   "(expected the small one)");
        return;
    }
    int picture = GRAPH_INPUT(g, "picture", 1, input, input, 3);
    int x = small_backbone_graph(g, picture, input, &b->impl->small);
    GRAPH_OUTPUT(g, graph_rows(g, x), "features", 1, n, n,
                 b->config.features);
}
