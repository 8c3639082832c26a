/* The rasteriser's memory: two blocks, one sized by the picture and one by the
 * Gaussians, cut into arrays. */
#include "lib/splat/state.h"

#include <assert.h>
#include <stdlib.h>

#include "lib/base/isa.h"
#include "lib/base/parallel.h"
#include "lib/splat/relight.h"

#define ALIGN 64

#if defined(SPID_X86) || defined(__ARM_NEON)
#define SPLAT_FIXED16 true     /* the kernels multiply 16-bit numbers */
#else
#define SPLAT_FIXED16 false
#endif

struct splat_work *state_work(const struct splat_state *st)
{
    assert(parallel_slot() < (size_t)st->slots);
    return (struct splat_work *)((char *)st->work +
                                 parallel_slot() * st->work_size);
}

/* Take bytes of a block; with base NULL only count. */
static void *state_reserve(char *base, size_t *used, size_t bytes)
{
    void *p = base ? base + *used : NULL;

    *used += (bytes + ALIGN - 1) / ALIGN * ALIGN + ALIGN;
    return p;
}

size_t state_screen_layout(struct splat_state *st, char *base)
{
    size_t tiles = (size_t)st->view.tx * (size_t)st->view.ty, used = 0;
    size_t cells = (size_t)(st->view.tx + 1) * (size_t)(st->view.ty + 1);
    size_t T = (size_t)st->threads;
    size_t h = relight_side((size_t)st->view.height);
    size_t w = relight_side((size_t)st->view.width);

    st->start = state_reserve(base, &used, tiles * sizeof *st->start);
    st->end = state_reserve(base, &used, tiles * sizeof *st->end);
    st->zorder = state_reserve(base, &used, tiles * sizeof *st->zorder);
    st->empty = state_reserve(base, &used, tiles * sizeof *st->empty);
    st->count = state_reserve(base, &used, T * cells * sizeof *st->count);
    st->histogram = state_reserve(base, &used,
                                  T * 2048 * sizeof *st->histogram);
    st->work = state_reserve(base, &used, (size_t)st->slots * st->work_size);
    st->gain_room = state_reserve(base, &used, RELIGHT_ROOM(h, w) *
                                                   sizeof *st->gain_room);
    return used;
}

size_t state_cloud_layout(struct splat *s, char *base, size_t n)
{
    struct splat_state *st = s->state;
    size_t used = 0, row = n * sizeof(float);

    for (int k = 0; k < 3; k++) {
        st->cloud.mean[k] = state_reserve(base, &used, row);
        st->cloud.scale[k] = state_reserve(base, &used, row);
    }
    for (int k = 0; k < 4; k++)
        st->cloud.quat[k] = state_reserve(base, &used, row);
    st->cloud.top = state_reserve(base, &used, row);
    st->projection = state_reserve(base, &used, n * sizeof *st->projection);
    st->color = state_reserve(base, &used, n * sizeof *st->color);
    st->place = NULL;
    for (int k = 0; k < 2 && s->opt.place; k++) {
        st->cloud.uv[k] = state_reserve(base, &used, row);
        st->cloud.tilt[k] = state_reserve(base, &used, row);
        st->cloud.around[k] = state_reserve(base, &used, row);
    }
    if (s->opt.place) {
        st->cloud.seen = state_reserve(base, &used, row);
        st->cloud.thin = state_reserve(base, &used, row);
        for (int k = 0; k < 3; k++)
            st->cloud.normal[k] = state_reserve(base, &used, row);
        st->cloud.lit = state_reserve(base, &used, row);
        st->place = state_reserve(base, &used, n * sizeof *st->place);
    }
    st->key = state_reserve(base, &used, n * sizeof *st->key);
    for (int k = 0; k < 3; k++)
        st->fine[k] = s->opt.gradients ? state_reserve(base, &used, row) : NULL;
    st->rect = state_reserve(base, &used, n * sizeof *st->rect);
    st->sort0 = state_reserve(base, &used, n * sizeof *st->sort0);
    st->sort1 = state_reserve(base, &used, n * sizeof *st->sort1);
    st->order = state_reserve(base, &used, n * sizeof *st->order);
    st->ordered = state_reserve(base, &used, n * sizeof *st->ordered);
    st->table = NULL;
    st->fixed = NULL;
    if (st->row && s->opt.fixed16 && SPLAT_FIXED16)
        st->fixed = state_reserve(base, &used, n * 32 * sizeof *st->fixed);
    if (st->row && (!st->fixed || s->opt.gradients))
        st->table = state_reserve(base, &used, (size_t)st->row * row);
    return used;
}
