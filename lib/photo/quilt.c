/* Image quilting (quilt.h). */
#include "lib/photo/quilt.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Of a material's blocks those are taken that are neither the quietest nor the
 * liveliest third: an edge, a mole or a brow is not what it looks like all over. */
#define TYPICAL_FROM 0.1f
#define TYPICAL_TO 0.5f
#define ENOUGH 40       /* blocks to choose from, or they are smaller */
#define TRIES 48        /* of them for a place, and */
#define CHANCE 0.2f     /* how much worse than the best one may fit, lest one be
                         * all there is to be seen */
#define EVERY 3         /* pixels from one block to the next: odd, so that each phase
                         * of fine stripes is among them */

/* Sides of blocks, pixels. */
enum { LARGEST = 24 };
static const size_t sides[] = {LARGEST, 20, 16, 12, 8};

struct quilt_block {
    float energy;
    uint16_t x, y;
};

/* A pixel of a block's place that is covered already: its number from the block's
 * corner on, in rows of n, and what it is covered with. */
struct quilt_laid {
    size_t at;
    float out;
};

struct quilt_work {
    const struct quilt *q;
    uint8_t material;
    uint32_t noise;
    size_t side;                /* of blocks: 0 while there are none */
    size_t count;
    float *known, *square;      /* (n+1,n+1) sums up to a pixel: of the material's
                                 * pixels, of their squares; later */
    bool *done;                 /* (n,n) what is covered */
    struct quilt_block *block;  /* (count) */
    size_t room;
    struct quilt_laid laid[LARGEST * LARGEST];  /* (laid_count) where a block is
                                                 * to go */
    size_t laid_count;
};

/* A number in 0..n-1, the next of a fixed sequence. */
static size_t quilt_random(struct quilt_work *w, size_t n)
{
    w->noise = w->noise * 1664525u + 1013904223u;
    return (size_t)((uint64_t)w->noise * n >> 32);
}

/* ---- what there is ------------------------------------------------------- */

static void quilt_sum(struct quilt_work *w)
{
    const size_t n = w->q->n, row = n + 1;

    memset(w->known, 0, row * sizeof *w->known);
    memset(w->square, 0, row * sizeof *w->square);
    for (size_t y = 0; y < n; y++) {
        float known = 0, square = 0;

        w->known[(y + 1) * row] = w->square[(y + 1) * row] = 0;
        for (size_t x = 0; x < n; x++) {
            const size_t at = y * n + x, to = (y + 1) * row + x + 1;

            if (w->q->is[at] == w->material) {
                known++;
                square += w->q->from[at] * w->q->from[at];
            }
            w->known[to] = w->known[to - row] + known;
            w->square[to] = w->square[to - row] + square;
        }
    }
}

/* A sum over the block of `side` at (x,y). */
static float quilt_box(const float *sum, size_t row, size_t x, size_t y,
                       size_t side)
{
    const float *top = sum + y * row + x, *bottom = top + side * row;

    return bottom[side] - bottom[0] - top[side] + top[0];
}

/* The blocks of `side` that are of the material alone. */
static void quilt_list(struct quilt_work *w, size_t side)
{
    const size_t n = w->q->n, row = n + 1;

    w->count = 0;
    for (size_t y = 0; y + side <= n; y += EVERY)
        for (size_t x = 0; x + side <= n; x += EVERY)
            if (w->count < w->room &&
                quilt_box(w->known, row, x, y, side) == (float)(side * side))
                w->block[w->count++] = (struct quilt_block){
                    quilt_box(w->square, row, x, y, side), (uint16_t)x,
                    (uint16_t)y};
    w->side = w->count < ENOUGH ? 0 : side;
}

static int quilt_by_energy(const void *a, const void *b)
{
    const struct quilt_block *p = a, *q = b;

    if (p->energy != q->energy)
        return p->energy < q->energy ? -1 : 1;
    return p->y != q->y ? (int)p->y - q->y : (int)p->x - q->x;
}

/* ---- what there is not --------------------------------------------------- */

/* The pixels of a block at (x,y) that are to be covered, or are. */
static bool quilt_wants(const struct quilt_work *w, size_t x, size_t y)
{
    const size_t n = w->q->n;

    return x < n && y < n && w->q->want[y * n + x] == w->material;
}

/* What lies at (x,y) already. */
static void quilt_gather(struct quilt_work *w, size_t x, size_t y)
{
    const size_t n = w->q->n;

    w->laid_count = 0;
    for (size_t j = 0; j < w->side && y + j < n; j++)
        for (size_t i = 0; i < w->side && x + i < n; i++) {
            const size_t at = (y + j) * n + x + i;

            if (w->done[at])
                w->laid[w->laid_count++] = (struct quilt_laid){
                    j * n + i, w->q->out[at]};
        }
}

/* Of block b and that: the mean square of what they differ by, and how far they are
 * alike, 0..1. */
struct quilt_fit {
    float off, similarity;
};

static struct quilt_fit quilt_compare(const struct quilt_work *w,
                                      const struct quilt_block *b)
{
    const float *from = w->q->from + b->y * w->q->n + b->x;
    float own = 1e-6f, other = 1e-6f, both = 0;

    for (size_t k = 0; k < w->laid_count; k++) {
        const float p = from[w->laid[k].at], out = w->laid[k].out;

        own += p * p;
        other += out * out;
        both += p * out;
    }
    return (struct quilt_fit){(own + other - 2 * both) /
                                  (1 + (float)w->laid_count),
                              fmaxf(both / sqrtf(own * other), 0)};
}

/* Lay b down; where something lies it goes over into b from `over` pixels on, with
 * weights by which the sum is as lively as each of them. */
static void quilt_lay(struct quilt_work *w, const struct quilt_block *b,
                      size_t x, size_t y, size_t over)
{
    const size_t n = w->q->n;
    const float similarity = quilt_compare(w, b).similarity;

    for (size_t j = 0; j < w->side && y + j < n; j++)
        for (size_t i = 0; i < w->side && x + i < n; i++) {
            const size_t at = (y + j) * n + x + i;
            const float from = w->q->from[(b->y + j) * n + b->x + i];
            const float t = fminf((float)(i < j ? i : j) + 0.5f, (float)over) /
                            (float)over;
            float *to = w->q->out + at;

            if (!quilt_wants(w, x + i, y + j))
                continue;
            *to = w->done[at] ? ((1 - t) * *to + t * from) /
                                    sqrtf(1 - 2 * t * (1 - t) * (1 - similarity))
                              : from;
            w->done[at] = true;
        }
}

/* Whether a block at (x,y) would cover anything new. */
static bool quilt_lacks(const struct quilt_work *w, size_t x, size_t y)
{
    for (size_t j = 0; j < w->side; j++)
        for (size_t i = 0; i < w->side; i++)
            if (quilt_wants(w, x + i, y + j) &&
                !w->done[(y + j) * w->q->n + x + i])
                return true;
    return false;
}

/* The block that fits what lies there. */
static const struct quilt_block *quilt_choose(struct quilt_work *w)
{
    const struct quilt_block *best = w->block;
    float least = INFINITY;

    for (int t = 0; t < TRIES; t++) {
        const struct quilt_block *b = w->block + quilt_random(w, w->count);
        const float worse = 1 + CHANCE * (float)quilt_random(w, 1000) / 1000;
        const float off = worse * quilt_compare(w, b).off;

        if (off < least) {
            least = off;
            best = b;
        }
    }
    return best;
}

void quilt_cover(const struct quilt *q, uint8_t material, float *scratch)
{
    const size_t n = q->n, part = (n + 1) * (n + 1);
    struct quilt_work w = {
        .q = q, .material = material, .noise = material, .known = scratch,
        .square = scratch + part, .room = part * sizeof(float) /
                                          sizeof(struct quilt_block)
    };

    w.block = (struct quilt_block *)(void *)(scratch + 2 * part);
    quilt_sum(&w);
    for (size_t k = 0; k < sizeof sides / sizeof *sides && !w.side; k++)
        quilt_list(&w, sides[k]);
    if (!w.side)
        return;
    qsort(w.block, w.count, sizeof *w.block, quilt_by_energy);
    const size_t from = (size_t)(TYPICAL_FROM * (float)w.count);

    w.count = (size_t)(TYPICAL_TO * (float)w.count) - from;
    w.block += from;
    w.done = (bool *)scratch;
    memset(w.done, 0, n * n * sizeof *w.done);
    const size_t over = w.side / 4;
    for (size_t y = 0; y < n; y += w.side - over)
        for (size_t x = 0; x < n; x += w.side - over)
            if (quilt_lacks(&w, x, y)) {
                quilt_gather(&w, x, y);
                quilt_lay(&w, quilt_choose(&w), x, y, over);
            }
}
