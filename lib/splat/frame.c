#include "lib/splat/frame.h"

#include <omp.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define RADIX 2048
#define BATCH 1024             /* Gaussians projected before they are counted */
#define AHEAD 16               /* rectangles fetched early */

struct frame {
    struct splat *s;
    const struct target *out;
    const struct splat_kernels *k;
    int threads;
    size_t lo[SPLAT_MAX_THREADS], count[SPLAT_MAX_THREADS];
    uint32_t least[SPLAT_MAX_THREADS], most[SPLAT_MAX_THREADS];
    int band[SPLAT_MAX_THREADS + 1];       /* tile rows of each thread */
    size_t drawn;
    bool failed;
};

static size_t min_size(size_t a, size_t b)
{
    return a < b ? a : b;
}

/* First Gaussian of thread t, a multiple of 16. */
static size_t part(size_t n, int t, int threads)
{
    return min_size(n, (n * (size_t)t / (size_t)threads + 15) / 16 * 16);
}

/* The tiles of [r->x0,r->x1) x [r->y0,r->y1) as four corners of a difference
 * table; tile_totals sums it up. */
static void count_rect(int32_t *count, const struct rect *r, int stride)
{
    int32_t *top = count + r->y0 * stride, *bottom = count + r->y1 * stride;

    top[r->x0]++;
    top[r->x1]--;
    bottom[r->x0]--;
    bottom[r->x1]++;
}

/* Append the visible of [i, end) to the thread's part of the sort input. */
static void collect(struct frame *f, int t, size_t i, size_t end)
{
    struct splat_state *st = f->s->state;
    int stride = st->view.tx + 1;
    int32_t *count = st->count + (size_t)t * (size_t)stride *
                                 (size_t)(st->view.ty + 1);
    uint64_t *out = st->sort0 + f->lo[t] + f->count[t], *at = out;
    uint32_t least = f->least[t], most = f->most[t];

    for (; i < end; i++) {
        uint32_t key = st->key[i];

        if (key == HIDDEN)
            continue;
        *at++ = (uint64_t)key << 32 | i;
        least = key < least ? key : least;
        most = key > most ? key : most;
        count_rect(count, &st->rect[i], stride);
    }
    f->count[t] += (size_t)(at - out);
    f->least[t] = least;
    f->most[t] = most;
}

static void project_part(struct frame *f, int t)
{
    struct splat_state *st = f->s->state;
    size_t n = f->s->n, end = part(n, t + 1, f->threads);
    size_t cells = (size_t)(st->view.tx + 1) * (size_t)(st->view.ty + 1);

    memset(st->count + (size_t)t * cells, 0, cells * sizeof *st->count);
    f->lo[t] = part(n, t, f->threads);
    f->count[t] = 0;
    f->least[t] = UINT32_MAX;
    f->most[t] = 0;
    for (size_t i = f->lo[t]; i < end; i += BATCH) {
        size_t stop = min_size(i + BATCH, end), a = i, b = stop;

        if (st->projected) {
            a = a > st->dirty0 ? a : st->dirty0 / 16 * 16;
            b = min_size(b, st->dirty1);
        }
        if (a < b)
            f->k->project(st, a, b, n);
        collect(f, t, i, stop);
    }
}

/* ---- sort: radix of 11 bits over (bits of z - least), stable ------------ */

static void tally(uint32_t *h, const uint64_t *in, size_t n, uint32_t least,
                  int shift)
{
    memset(h, 0, RADIX * sizeof *h);
    for (size_t i = 0; i < n; i++)
        h[((uint32_t)(in[i] >> 32) - least) >> shift & (RADIX - 1)]++;
}

/* Where this thread's first entry of each digit goes. */
static void offsets(uint32_t *at, const uint32_t *histogram, int t,
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

static void scatter(uint64_t *out, uint32_t *last, uint32_t *at,
                    const uint64_t *in, size_t n, uint32_t least, int shift)
{
    for (size_t i = 0; i < n; i++) {
        uint64_t e = in[i];
        uint32_t d = ((uint32_t)(e >> 32) - least) >> shift & (RADIX - 1);

        if (last)
            last[at[d]++] = (uint32_t)e;
        else
            out[at[d]++] = e;
    }
}

static void sort_part(struct frame *f, int t)
{
    struct splat_state *st = f->s->state;
    uint32_t least = UINT32_MAX, most = 0, at[RADIX];
    uint64_t *from = st->sort0, *to = st->sort1;
    size_t lo = f->lo[t], n = f->count[t], all = 0;

    for (int k = 0; k < f->threads; k++) {
        least = f->least[k] < least ? f->least[k] : least;
        most = f->most[k] > most ? f->most[k] : most;
        all += f->count[k];
    }
    for (int shift = 0; all; shift += 11) {
        bool last = shift == 22 || (most - least) >> (shift + 11) == 0;

        tally(st->histogram + t * RADIX, from + lo, n, least, shift);
#pragma omp barrier
        offsets(at, st->histogram, t, f->threads);
        scatter(to, last ? st->order : NULL, at, from + lo, n, least, shift);
#pragma omp barrier
        if (last)
            break;
        uint64_t *swap = from;

        from = to;
        to = swap;
        lo = all * (size_t)t / (size_t)f->threads;
        n = all * (size_t)(t + 1) / (size_t)f->threads - lo;
    }
}

/* ---- tile lists ---------------------------------------------------------- */

/* Sum the difference tables: start (and end, where filling begins) of each
 * tile's list; one spare entry between lists lets fill write ahead. */
static size_t tile_totals(struct frame *f, size_t *row_pairs)
{
    struct splat_state *st = f->s->state;
    int tx = st->view.tx, ty = st->view.ty, stride = tx + 1;
    size_t cells = (size_t)stride * (size_t)(ty + 1), sum = 0;
    int32_t *c = st->count;

    for (size_t i = 0; i < cells; i++)
        for (int t = 1; t < f->threads; t++)
            c[i] += c[(size_t)t * cells + i];
    for (int y = 0; y < ty; y++) {
        row_pairs[y] = 0;
        for (int x = 0; x < tx; x++) {
            int32_t *at = c + y * stride + x;

            at[0] += (x ? at[-1] : 0) + (y ? at[-stride] : 0) -
                     (x && y ? at[-stride - 1] : 0);
            st->start[y * tx + x] = st->end[y * tx + x] = (uint32_t)sum;
            row_pairs[y] += (size_t)at[0];
            sum += (size_t)at[0] + 1;
        }
    }
    return sum;
}

static void plan_lists(struct frame *f)
{
    struct splat_state *st = f->s->state;
    int ty = st->view.ty, y = 0;
    size_t *row = malloc(((size_t)ty + 1) * sizeof *row), done = 0;

    if (!row) {
        f->failed = true;
        return;
    }
    size_t room = tile_totals(f, row);

    f->s->pairs = room - (size_t)(st->view.tx * ty);
    if (room >= UINT32_MAX) {
        f->failed = true;
    } else if (room > st->list_room) {
        free(st->list);
        st->list_room = room + room / 8;
        st->list = malloc(st->list_room * sizeof *st->list);
        if (!st->list) {
            st->list_room = 0;
            f->failed = true;
        }
    }
    /* bands of tile rows with about the same number of pairs */
    for (int t = 0; t < f->threads; t++) {
        f->band[t] = y;
        while (y < ty && done * (size_t)f->threads <
                             f->s->pairs * (size_t)(t + 1))
            done += row[y++];
    }
    f->band[f->threads] = ty;
    free(row);
}

/* Lists of tile rows [y0,y1): every Gaussian in order, appended to each tile
 * of its rectangle.  Most touch at most 2 x 2 tiles: they are written to all
 * four ends, and only the ends that count move on (each list has a spare
 * entry), so that no branch waits for the rectangle's shape. */
static void fill(struct splat_state *st, size_t drawn, int y0, int y1)
{
    int tx = st->view.tx;
    uint32_t *end = st->end, *list = st->list;

    for (size_t k = 0; k < drawn; k++) {
        uint32_t i = st->order[k];
        struct rect r = st->rect[i];
        int a = r.y0 > y0 ? r.y0 : y0, b = r.y1 < y1 ? r.y1 : y1;

        if (k + AHEAD < drawn)
            __builtin_prefetch(&st->rect[st->order[k + AHEAD]]);
        if (r.x1 - r.x0 <= 2 && r.y1 - r.y0 <= 2 && r.y0 >= y0 &&
            r.y0 + 1 < y1 && r.x0 + 1 < tx) {
            uint32_t *e = end + r.y0 * tx + r.x0;
            uint32_t wide = r.x1 - r.x0 > 1, high = r.y1 - r.y0 > 1;

            list[e[0]++] = i;
            list[e[1]] = i;
            e[1] += wide;
            list[e[tx]] = i;
            e[tx] += high;
            list[e[tx + 1]] = i;
            e[tx + 1] += wide & high;
            continue;
        }
        for (int y = a; y < b; y++)
            for (int x = r.x0; x < r.x1; x++)
                list[end[y * tx + x]++] = i;
    }
}

static void draw_part(struct frame *f, int t)
{
    struct splat_state *st = f->s->state;
    uint32_t tiles = (uint32_t)(st->view.tx * st->view.ty);
    struct splat_work *w = (struct splat_work *)
        ((char *)st->work + (size_t)t * splat_work_size());

#pragma omp for schedule(dynamic, 1) nowait
    for (uint32_t i = 0; i < tiles; i++)
        f->k->tile(f->s, w, st->zorder[i], f->out);
}

int frame_draw(struct splat *s, const struct target *out, struct error *err)
{
    struct splat_state *st = s->state;
    struct frame f = {.s = s, .out = out, .k = splat_kernels(st->level)};

#pragma omp parallel num_threads(st->threads)
    {
        int t = omp_get_thread_num();

#pragma omp single
        f.threads = omp_get_num_threads();
        project_part(&f, t);
#pragma omp barrier
        if (t == f.threads - 1)
            plan_lists(&f);
        sort_part(&f, t);
#pragma omp single
        for (int k = 0; k < f.threads; k++)
            f.drawn += f.count[k];
        if (!f.failed) {
            fill(st, f.drawn, f.band[t], f.band[t + 1]);
#pragma omp barrier
            draw_part(&f, t);
        }
    }
    s->drawn = f.drawn;
    st->projected = !f.failed;
    st->dirty0 = SIZE_MAX;
    st->dirty1 = 0;
    if (f.failed)
        return error_set(err, EX_OSERR, "%zu (tile, Gaussian) pairs: out of "
                         "memory", s->pairs);
    return 0;
}
