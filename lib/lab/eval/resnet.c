/* ResNet-50, a level at a time. */
#include "lib/lab/eval/resnet.h"

#include <string.h>

#define STEM ((size_t)64)
#define WIDEN ((size_t)4)       /* channels of a block over those within */

/* First block of a level, and the one behind its last. */
static const int first[RESNET_LEVELS + 1] = {0, 0, 3, 7, 13, RESNET_BLOCKS};

/* ---- tensors ------------------------------------------------------------ */

/* A convolution without bias, its norm folded in. */
static void resnet_conv_init(struct conv *c, struct batch_norm *norm,
                             struct params *ps, const char *conv_name,
                             const char *norm_name, size_t in, size_t out,
                             size_t kernel, size_t stride)
{
    conv_init(c, ps, conv_name, in, out, kernel, stride, false);
    batch_norm_init(norm, ps, norm_name, out, NORM_EPS);
    c->norm = norm;
    c->act = ACT_RELU;
}

/* Block i of a level; name is its own. */
static void resnet_block_init(struct resnet_block *b, struct params *ps,
                              const char *name, int level, int i)
{
    const size_t narrow = STEM << (level - 1), wide = WIDEN * narrow;
    const size_t in = i ? wide : level == 1 ? STEM : wide / 2;
    const size_t stride = i || level == 1 ? 1 : 2;
    char conv[120], norm[120];

    for (int k = 0; k < 3; k++)
        resnet_conv_init(&b->conv[k], &b->norm[k], ps,
                         nn_name(conv, "%s.conv%d", name, k + 1),
                         nn_name(norm, "%s.bn%d", name, k + 1),
                         k ? narrow : in, k == 2 ? wide : narrow,
                         k == 1 ? 3 : 1, k == 1 ? stride : 1);
    b->conv[2].add = true;
    if (i)
        return;
    resnet_conv_init(&b->down, &b->norm_down, ps,
                     nn_name(conv, "%s.downsample.0", name),
                     nn_name(norm, "%s.downsample.1", name), in, wide, 1,
                     stride);
    b->down.act = ACT_NONE;
}

void resnet_init(struct resnet *n, struct params *ps, const char *at)
{
    char name[120], norm[120];

    resnet_conv_init(&n->stem, &n->norm, ps, nn_name(name, "%sconv1", at),
                     nn_name(norm, "%sbn1", at), 3, STEM, 7, 2);
    for (int level = 1; level < RESNET_LEVELS; level++)
        for (int b = first[level]; b < first[level + 1]; b++)
            resnet_block_init(&n->block[b], ps,
                              nn_name(name, "%slayer%d.%d", at, level,
                                      b - first[level]),
                              level, b - first[level]);
}

/* ---- planning ----------------------------------------------------------- */

/* The maximum of 3 x 3 around every second pixel: of relu's output, zeros
 * before it are as good as nothing there. */
static void resnet_plan_pool(struct resnet *n, struct nn_plan *p)
{
    const size_t h = n->level[0].h + 1, w = n->level[0].w + 1;

    max_pool_plan(&n->pool, p, 1, h, w, STEM, true);
    n->padded = nn_plan_floats(p, h * w * STEM);
    n->pooled = nn_plan_map(p, n->pool.oh * n->pool.ow * STEM);
}

/* The blocks of a level, from maps of h x w. */
static void resnet_plan_blocks(struct resnet *n, int level, struct nn_plan *p,
                               size_t h, size_t w)
{
    struct resnet_level *l = &n->level[level];
    struct resnet_block *b = &n->block[first[level]];

    conv_plan(&b->down, p, 1, h, w);
    *l = (struct resnet_level){.h = b->down.oh, .w = b->down.ow,
                               .channels = b->down.out};
    l->map = nn_plan_map(p, l->h * l->w * l->channels);
    for (int k = 0; k < 2; k++)
        l->narrow[k] = nn_plan_map(p, (k ? l->h * l->w : h * w) *
                                          b->conv[0].out);
    for (int i = first[level]; i < first[level + 1]; i++, b++) {
        conv_plan(&b->conv[0], p, 1, h, w);
        conv_plan(&b->conv[1], p, 1, h, w);
        h = l->h;
        w = l->w;
        conv_plan(&b->conv[2], p, 1, h, w);
    }
    nn_plan_recycle(p, l->narrow[0]);
    nn_plan_recycle(p, l->narrow[1]);
}

void resnet_plan(struct resnet *n, int level, struct nn_plan *p, size_t H,
                 size_t W)
{
    const struct resnet_level *last = n->level + level - 1;

    if (level == 0) {
        conv_plan(&n->stem, p, 1, H, W);
        n->level[0] = (struct resnet_level){.h = n->stem.oh, .w = n->stem.ow,
                                            .channels = STEM};
        n->level[0].map = nn_plan_map(p, n->stem.oh * n->stem.ow * STEM);
    } else if (level == 1) {
        resnet_plan_pool(n, p);
        resnet_plan_blocks(n, level, p, n->pool.oh, n->pool.ow);
        nn_plan_recycle(p, n->pooled);
    } else {
        resnet_plan_blocks(n, level, p, last->h, last->w);
    }
}

/* ---- forward ------------------------------------------------------------ */

/* The stem's map to n->pooled. */
static void resnet_pool(struct resnet *n)
{
    const struct resnet_level *l = &n->level[0];
    const size_t row = l->w * STEM;

    for (size_t y = 0; y < l->h; y++)
        memcpy(n->padded + ((y + 1) * (l->w + 1) + 1) * STEM, l->map + y * row,
               row * sizeof *l->map);
    max_pool_forward(n->pooled, n->padded, &n->pool);
}

void resnet_forward(struct resnet *n, int level, const float *rgb)
{
    const struct resnet_level *l = &n->level[level];
    const float *in = level > 1 ? l[-1].map : n->pooled;

    if (level == 0) {
        conv_forward(l->map, rgb, &n->stem);
        return;
    }
    if (level == 1)
        resnet_pool(n);
    conv_forward(l->map, in, &n->block[first[level]].down);
    for (int i = first[level]; i < first[level + 1]; i++) {
        conv_forward(l->narrow[0], in, &n->block[i].conv[0]);
        conv_forward(l->narrow[1], l->narrow[0], &n->block[i].conv[1]);
        conv_forward(l->map, l->narrow[1], &n->block[i].conv[2]);
        in = l->map;
    }
}
