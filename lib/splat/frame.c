/* One frame on all threads, step by step: project what has moved, sort by depth
 * (stable radix sort, or a merge into the last frame's order), count and fill
 * each tile's list, draw the tiles in Z order.  Every step cuts its work the
 * same way for any number of threads as far as results go. */
#include "lib/splat/state.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/splat/kernels.h"

#define RADIX 2048
#define BATCH 1024             /* Gaussians projected, then collected */
#define AHEAD 16               /* rectangles fetched early */
#define SPARE 16               /* list entries, a cache line */
#define TILES 8                /* neighbours in Z order drawn by one thread:
                                * they share Gaussians */

struct drawing {
    struct splat *s;
    const struct target *out;
    const struct splat_kernels *k;
    int threads;               /* shares of every step but drawing */
    size_t first, last;        /* Gaussians that have moved */
    uint64_t *from, *to;       /* the sort's, of this pass ... */
    int shift;                 /* ... over the bits from here on */
    bool shared;               /* ... in equal shares, not as collected */
    size_t lo[SPLAT_MAX_THREADS], count[SPLAT_MAX_THREADS];
    uint32_t min[SPLAT_MAX_THREADS], max[SPLAT_MAX_THREADS];
    size_t room;               /* of the tile lists */
    bool failed;
    bool kept;                 /* the last frame is still in the pictures */
    double clock;              /* when the last phase ended */
};

/* Note what has passed since the last phase. */
static void frame_note_phase(struct drawing *f, enum splat_phase p)
{
    const double now = cpu_seconds();

    f->s->ms[p] = 1e3 * (now - f->clock);
    f->clock = now;
}

static size_t frame_min_size(size_t a, size_t b)
{
    return a < b ? a : b;
}

/* ---- projection ---------------------------------------------------------- */

/* Append the visible of [i, end) to the thread's part of the sort input. */
static void frame_collect(struct drawing *f, int t, size_t i, size_t end)
{
    struct splat_state *st = f->s->state;
    uint64_t *out = st->sort0 + f->lo[t] + f->count[t], *at = out;
    uint32_t min = f->min[t], max = f->max[t];

    for (; i < end; i++) {
        uint32_t key = st->key[i];

        *at = (uint64_t)key << 32 | i;
        if (key == HIDDEN)
            continue;
        at++;
        min = key < min ? key : min;
        max = key > max ? key : max;
    }
    f->count[t] += (size_t)(at - out);
    f->min[t] = min;
    f->max[t] = max;
}

/* Project share t of what moved, and collect it. */
static void frame_project(void *ctx, size_t share)
{
    struct drawing *f = ctx;
    struct splat_state *st = f->s->state;
    const int t = (int)share;
    const size_t first = f->first, last = f->last;
    size_t n = last - first;
    size_t i = first + state_share(n, t, f->threads) / PAD * PAD;
    size_t end = t + 1 == f->threads ? last
        : first + state_share(n, t + 1, f->threads) / PAD * PAD;

    f->lo[t] = i - first;
    f->count[t] = 0;
    f->min[t] = UINT32_MAX;
    f->max[t] = 0;
    for (; i < end; i += BATCH) {
        size_t stop = frame_min_size(i + BATCH, end);

        f->k->project(st, i, stop);
        frame_collect(f, t, i, stop);
    }
}

/* ---- sort: radix of 11 bits over (bits of z - min), stable ------------ */

/* How many keys have each value of the digit at shift. */
static void frame_histogram(uint32_t *h, const uint64_t *in, size_t n,
                            uint32_t min, int shift)
{
    memset(h, 0, RADIX * sizeof *h);
    for (size_t i = 0; i < n; i++)
        h[((uint32_t)(in[i] >> 32) - min) >> shift & (RADIX - 1)]++;
}

/* Where this thread's first entry of each digit goes. */
static void frame_offsets(uint32_t *at, const uint32_t *histogram, int t,
                          int threads)
{
    uint32_t sum = 0;

    for (int d = 0; d < RADIX; d++)
        for (int k = 0; k < threads; k++) {
            if (k == t)
                at[d] = sum;
            sum += histogram[k * RADIX + d];
        }
}

/* Entries to where their digit goes; equal digits keep their order. */
static void frame_scatter(uint64_t *out, uint32_t *at, const uint64_t *in,
                          size_t n, uint32_t min, int shift)
{
    for (size_t i = 0; i < n; i++) {
        uint64_t e = in[i];

        out[at[((uint32_t)(e >> 32) - min) >> shift & (RADIX - 1)]++] = e;
    }
}

/* Gaussians on the screen, of all threads. */
static size_t frame_collected(const struct drawing *f)
{
    size_t all = 0;

    for (int k = 0; k < f->threads; k++)
        all += f->count[k];
    return all;
}

/* Entries [*lo, *lo + n) are share t of this pass; returns n. */
static size_t frame_share(size_t *lo, const struct drawing *f, int t)
{
    const size_t all = frame_collected(f);

    *lo = f->shared ? state_share(all, t, f->threads) : f->lo[t];
    return f->shared ? state_share(all, t + 1, f->threads) - *lo : f->count[t];
}

/* Share t of a pass: its digits. */
static void frame_count_digits(void *ctx, size_t t)
{
    struct drawing *f = ctx;
    size_t lo, n = frame_share(&lo, f, (int)t);

    frame_histogram(f->s->state->histogram + t * RADIX, f->from + lo, n,
                    f->min[0], f->shift);
}

/* Share t of a pass, to where it goes. */
static void frame_move(void *ctx, size_t t)
{
    struct drawing *f = ctx;
    size_t lo, n = frame_share(&lo, f, (int)t);
    uint32_t at[RADIX];

    frame_offsets(at, f->s->state->histogram, (int)t, f->threads);
    frame_scatter(f->to, at, f->from + lo, n, f->min[0], f->shift);
}

/* Sort what was collected; returns where it is, sort0 or sort1. */
static uint64_t *frame_sort(struct drawing *f)
{
    struct splat_state *st = f->s->state;
    const size_t shares = (size_t)f->threads;
    uint32_t max = 0;

    for (int k = 0; k < f->threads; k++) {
        f->min[0] = f->min[k] < f->min[0] ? f->min[k] : f->min[0];
        max = f->max[k] > max ? f->max[k] : max;
    }
    f->from = st->sort0;
    f->to = st->sort1;
    f->shared = false;
    for (f->shift = 0; frame_collected(f); f->shift += 11) {
        uint64_t *swap = f->from;

        parallel_for(shares, 1, frame_count_digits, f);
        parallel_for(shares, 1, frame_move, f);
        f->from = f->to;
        f->to = swap;
        f->shared = true;
        if (f->shift == 22 || (max - f->min[0]) >> (f->shift + 11) == 0)
            break;
    }
    return f->from;
}

/* ---- sort from the last frame's order ------------------------------------ */

/* The last order without the Gaussians [first, last) and the sorted ones of
 * these, merged.  Entries are different numbers, so any way of merging gives
 * the same order. */
static size_t frame_merge(uint64_t *out, const uint64_t *old, size_t n,
                          const uint64_t *fresh, size_t fresh_n, size_t first,
                          size_t last)
{
    uint64_t *at = out;
    uint64_t next = fresh_n ? *fresh : UINT64_MAX;

    for (size_t k = 0; k < n; k++) {
        uint64_t e = old[k];
        uint32_t i = (uint32_t)e;

        while (next < e) {
            *at++ = next;
            next = --fresh_n ? *++fresh : UINT64_MAX;
        }
        *at = e;
        at += i < first || i >= last;
    }
    if (fresh_n)
        memcpy(at, fresh, fresh_n * sizeof *fresh);
    return (size_t)(at - out) + fresh_n;
}

/* ---- depths that are one float ------------------------------------------- */

/* For qsort_r: by what float has lost of z, then by number. */
static int frame_by_tail(const void *a, const void *b, void *tail)
{
    uint32_t i = (uint32_t)*(const uint64_t *)a;
    uint32_t j = (uint32_t)*(const uint64_t *)b;
    const float *z = tail;

    return z[i] != z[j] ? (z[i] < z[j] ? -1 : 1) : i < j ? -1 : i > j;
}

/* Order Gaussians of the same float depth by what float has lost of it. */
static void frame_sort_ties(struct splat_state *st, size_t n)
{
    uint64_t *e = st->order;

    for (size_t k = 0, next; k < n; k = next) {
        for (next = k + 1; next < n && e[next] >> 32 == e[k] >> 32;)
            next++;
        if (next > k + 1)
            qsort_r(e + k, next - k, sizeof *e, frame_by_tail, st->fine[2]);
    }
}

/* ---- tile lists ---------------------------------------------------------- */

/* Count the tiles of share t of the order: each rectangle [x0,x1)
 * x [y0,y1) as four corners of a difference table, then the table summed up.
 * The rectangles are copied in order, for fill. */
static void frame_count_tiles(void *ctx, size_t share)
{
    struct drawing *f = ctx;
    struct splat_state *st = f->s->state;
    const int t = (int)share;
    size_t end = state_share(f->s->drawn, t + 1, f->threads);
    int tx = st->view.tx, ty = st->view.ty, stride = tx + 1;
    size_t cells = (size_t)stride * (size_t)(ty + 1);
    int32_t *c = st->count + (size_t)t * cells;

    memset(c, 0, cells * sizeof *c);
    for (size_t k = state_share(f->s->drawn, t, f->threads); k < end; k++) {
        struct rect r = st->rect[(uint32_t)st->order[k]];

        if (k + AHEAD < end)
            __builtin_prefetch(&st->rect[(uint32_t)st->order[k + AHEAD]]);
        st->ordered[k] = r;
        c[r.y0 * stride + r.x0]++;
        c[r.y0 * stride + r.x1]--;
        c[r.y1 * stride + r.x0]--;
        c[r.y1 * stride + r.x1]++;
    }
    for (int y = 0; y < ty; y++)
        for (int x = 0; x < tx; x++) {
            int32_t *at = c + y * stride + x;

            at[0] += (x ? at[-1] : 0) + (y ? at[-stride] : 0) -
                     (x && y ? at[-stride - 1] : 0);
        }
}

/* Start and end of each tile's list, and where each thread fills in (over its
 * counts). */
static void frame_plan_lists(struct drawing *f)
{
    struct splat_state *st = f->s->state;
    int tx = st->view.tx, ty = st->view.ty, stride = tx + 1;
    size_t cells = (size_t)stride * (size_t)(ty + 1), sum = 0;

    for (int y = 0; y < ty; y++)
        for (int x = 0; x < tx; x++) {
            st->start[y * tx + x] = (uint32_t)sum;
            for (int t = 0; t < f->threads; t++) {
                int32_t *at = st->count + (size_t)t * cells + y * stride + x;
                int32_t own = *at;

                *at = (int32_t)sum;
                sum += (size_t)own;
            }
            st->end[y * tx + x] = (uint32_t)sum;
        }
    f->s->pairs = f->room = sum;
    sum += SPARE * (size_t)f->threads;
    if (sum >= INT32_MAX) {
        f->failed = true;
    } else if (sum > st->list_room) {
        free(st->list);
        f->s->bytes -= st->list_room * sizeof *st->list;
        st->list_room = sum + sum / 8;
        f->s->bytes += st->list_room * sizeof *st->list;
        st->list = malloc(st->list_room * sizeof *st->list);
        if (!st->list) {
            st->list_room = 0;
            f->failed = true;
        }
    }
}

/* Append share t of the order to the lists of its tiles.  Most
 * Gaussians touch at most 2 x 2 tiles: four are written, those that do not
 * count to a spare place, so that no branch waits for the rectangle's
 * shape. */
static void frame_fill_lists(void *ctx, size_t share)
{
    struct drawing *f = ctx;
    struct splat_state *st = f->s->state;
    const int t = (int)share;
    size_t cells = (size_t)(st->view.tx + 1) * (size_t)(st->view.ty + 1);
    size_t last = state_share(f->s->drawn, t + 1, f->threads);
    int stride = st->view.tx + 1;
    int32_t *end = st->count + (size_t)t * cells;
    int32_t spare = (int32_t)(f->room + SPARE * (size_t)t);
    uint32_t *list = st->list;

    for (size_t k = state_share(f->s->drawn, t, f->threads); k < last; k++) {
        uint32_t i = (uint32_t)st->order[k];
        struct rect r = st->ordered[k];

        if (r.x1 - r.x0 <= 2 && r.y1 - r.y0 <= 2) {
            int32_t *e = end + r.y0 * stride + r.x0;
            int32_t wide = r.x1 - r.x0 > 1, high = r.y1 - r.y0 > 1;

            list[e[0]++] = i;
            list[spare ^ ((spare ^ e[1]) & -wide)] = i;
            e[1] += wide;
            e += stride;
            list[spare ^ ((spare ^ e[0]) & -high)] = i;
            e[0] += high;
            list[spare ^ ((spare ^ e[1]) & -(wide & high))] = i;
            e[1] += wide & high;
            continue;
        }
        for (int y = r.y0; y < r.y1; y++)
            for (int x = r.x0; x < r.x1; x++)
                list[end[y * stride + x]++] = i;
    }
}

/* ---- a frame ------------------------------------------------------------- */

/* Whether the tile is empty in the pictures, and has to be. */
static bool frame_tile_stays(const struct drawing *f, uint32_t t)
{
    struct splat_state *st = f->s->state;
    const bool was = st->empty[t];

    st->empty[t] = st->start[t] == st->end[t];
    return f->kept && was && st->empty[t];
}

/* Draw run k of neighbouring tiles. */
static void frame_draw_tiles(void *ctx, size_t k)
{
    struct drawing *f = ctx;
    struct splat_state *st = f->s->state;
    const uint32_t tiles = (uint32_t)(st->view.tx * st->view.ty);
    struct splat_work *w = state_work(st);

    for (uint32_t i = (uint32_t)k * TILES; i < tiles && i < (k + 1) * TILES;
         i++)
        if (!frame_tile_stays(f, st->zorder[i]))
            f->k->tile(f->s, w, st->zorder[i], f->out);
}

/* The sorted become the order: all of it, or merged into the last frame's. */
static void frame_keep_order(struct drawing *f, uint64_t *sorted)
{
    struct splat_state *st = f->s->state;
    const bool some = f->last - f->first < f->s->n;
    uint64_t **own = sorted == st->sort0 ? &st->sort0 : &st->sort1;
    uint64_t *other = sorted == st->sort0 ? st->sort1 : st->sort0;

    f->s->drawn = some ? frame_merge(other, st->order, f->s->drawn, sorted,
                                     frame_collected(f), f->first, f->last)
                       : frame_collected(f);
    /* the buffer of the order is taken out of the sort's two */
    uint64_t **to = other == st->sort0 ? &st->sort0 : &st->sort1;
    uint64_t *old = st->order;

    st->order = some ? other : sorted;
    *(some ? to : own) = old;
    if (st->fine[2])
        frame_sort_ties(st, f->s->drawn);
}

/* Gaussians to sorted lists.  With all Gaussians in place but those of
 * [first, last), only these are projected and sorted, and merged into the
 * order of the last frame. */
static void frame_make_lists(struct drawing *f)
{
    const size_t shares = (size_t)f->threads;

    parallel_for(shares, 1, frame_project, f);
    frame_note_phase(f, SPLAT_PROJECT);
    frame_keep_order(f, frame_sort(f));
    frame_note_phase(f, SPLAT_SORT);
    parallel_for(shares, 1, frame_count_tiles, f);
    frame_plan_lists(f);
    if (!f->failed)
        parallel_for(shares, 1, frame_fill_lists, f);
    frame_note_phase(f, SPLAT_BIN);
}

/* All steps; those whose input has not changed are left out. */
int frame_draw(struct splat *s, const struct target *out, struct error *err)
{
    struct splat_state *st = s->state;
    struct drawing f = {.s = s, .out = out, .k = splat_kernels(st->level),
                        .threads = st->threads, .last = s->n,
                        .clock = cpu_seconds()};
    const size_t tiles = (size_t)(st->view.tx * st->view.ty);

    if (st->projected) {
        f.first = frame_min_size(st->dirty0 / PAD * PAD, s->n);
        f.last = st->dirty1;
    }
    f.kept = s->opt.kept && !s->opt.gradients && !out->background &&
             !memcmp(&st->drawn_to, out, sizeof *out);
    memset(s->ms, 0, sizeof s->ms);
    if (f.first < f.last || !st->projected)
        frame_make_lists(&f);
    if (!f.failed)
        parallel_for((tiles + TILES - 1) / TILES, 1, frame_draw_tiles, &f);
    frame_note_phase(&f, SPLAT_DRAW);
    st->projected = !f.failed;
    st->drawn_to = f.failed ? (struct target){0} : *out;
    st->dirty0 = SIZE_MAX;
    st->dirty1 = 0;
    if (f.failed)
        return error_set(err, EX_OSERR, "%zu (tile, Gaussian) pairs: out of "
                         "memory", s->pairs);
    return 0;
}
