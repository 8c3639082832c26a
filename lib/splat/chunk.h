/* Inside the kernels: the next CHUNK entries of a tile's list, laid out for
 * the blocks that will read them.  Included by *_tmpl.c only. */
#ifndef SPID_SPLAT_CHUNK_H
#define SPID_SPLAT_CHUNK_H

#include "lib/splat/state.h"
#include "lib/splat/vec.h"

#define BLOCKS 16
#define COLUMN (CHUNK + 48)    /* floats between columns of the chunk */
#define AHEAD 32               /* entries whose records are fetched early */

/* Columns of a chunk. */
enum { ROOT, RED, GREEN, BLUE, FOURTH, COLUMNS };

/* One thread's scratch. */
struct splat_work {
    /* for each of the tile's rows: q = high - (root x - shift)^2 */
    float high[CHUNK + 1][TILE], shift[CHUNK + 1][TILE];
    float chunk[COLUMNS][COLUMN];
    uint32_t index[COLUMN];                /* Gaussian of each entry */
    uint32_t list[BLOCKS][COLUMN];         /* entries that reach a block */
    uint32_t count[BLOCKS];
    uint32_t alive[BLOCKS];                /* pixels still taking light */
    float T[BLOCKS][VEC];
    float color[BLOCKS][4][VEC];
    float weight[COLUMN + 2][VEC];         /* of one block, wide path */
    uint32_t used[COLUMN + 2];             /* Gaussian of each weight row */
    float depth[BLOCKS][VEC], weight_sum[BLOCKS][VEC];
    float wide[BLOCKS * VEC][SPLAT_MAX_CHANNELS];
    float g[BLOCKS][SPLAT_MAX_CHANNELS][VEC];  /* dL/dcolor, backward */
    float rest[BLOCKS][VEC];               /* backward: light still behind */
    float worth[COLUMN][VEC];              /* backward: color . g */
    float pair[COLUMN][VEC];               /* backward: sums of each entry */
    float dcolor[COLUMN][SPLAT_MAX_CHANNELS];
};

/* Lane p of a block is the pixel in column p / 4 and row p % 4. */
#define PIXEL_X(p) ((p) >> 2)
#define PIXEL_Y(p) ((p) & 3)

/* Columns of block b's pixels, about the tile's centre. */
VEC_INLINE vf block_x(int b)
{
    vf x = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};

    return x + vf_set(4 * (float)(b & 3) - 7.5f);
}

/* Sixteen list entries by column: r[k] = field k of struct record. */
VEC_INLINE void gather(vf r[16], const struct record *record,
                       const uint32_t *list)
{
#pragma GCC unroll 16
    for (uint32_t k = 0; k < VEC; k++)
        r[k] = vf_load((const float *)&record[list[k]]);
    vf_transpose(r);
}

/* Least of a x^2 + b x y + c y^2 over the block, for sixteen Gaussians.  The
 * minimum is on an edge that faces the centre: try the nearer vertical and the
 * nearer horizontal one. */
struct edges {
    vf fixed[4];               /* distance to the nearer edge, 0 inside */
    vf free[4];                /* where the other coordinate would stop */
    vf own[4], mixed[4];       /* a e^2 and b e */
};

VEC_INLINE void edge_init(struct edges *e, vf u, vf other, vf slope, vf own,
                          vf mixed)
{
    for (int k = 0; k < 4; k++) {
        vf lo = vf_set(-7.5f + 4 * (float)k), hi = lo + vf_set(3);
        vf d = vf_clamp(u, lo, hi) - u;

        e->fixed[k] = d;
        e->free[k] = vf_fma(slope, d, other);
        e->own[k] = own * d * d;
        e->mixed[k] = mixed * d;
    }
}

VEC_INLINE vf edge_value(const struct edges *e, int k, vf center, vf curve,
                         int other)
{
    vf lo = vf_set(-7.5f + 4 * (float)other), hi = lo + vf_set(3);
    vf d = vf_clamp(e->free[k], lo, hi) - center;

    return vf_fma(vf_fma(curve, d, e->mixed[k]), d, e->own[k]);
}

/* Which of sixteen Gaussians reach which blocks; the entries are appended to
 * the blocks' lists. */
VEC_INLINE void sieve(struct splat_work *w, const vf r[16], vf ux, vf uy,
                      uint32_t at, uint32_t valid, float cut)
{
    struct edges ex, ey;
    vf room = r[5] - vf_set(cut - 1e-3f);
    vi entry = vi_iota() + vi_set((int32_t)at);
    vm here = vm_from_bits(valid);

    edge_init(&ex, ux, uy, r[6], r[2], r[3]);
    edge_init(&ey, uy, ux, r[7], r[4], r[3]);
    /* unrolled where sixteen lanes are one register */
#ifdef ISA_AVX512
#pragma GCC unroll 4
#else
#pragma GCC unroll 1
#endif
    for (int y = 0; y < 4; y++)
#ifdef ISA_AVX512
#pragma GCC unroll 4
#else
#pragma GCC unroll 1
#endif
        for (int x = 0; x < 4; x++) {
            int b = 4 * y + x;

            if (!w->alive[b])
                continue;
            vf least = vf_min(edge_value(&ex, x, uy, r[4], y),
                              edge_value(&ey, y, ux, r[2], x));
            vm hit = vf_gt_and(here, room, least);

            w->count[b] += vi_compress(w->list[b] + w->count[b], hit, entry);
        }
}

/* high and shift of one entry for the tile centred on (cx, cy). */
VEC_INLINE void rows_build(struct splat_work *w, uint32_t e,
                           const struct record *r, float cx, vf row)
{
    vf dy = row - vf_set(r->y), x = vf_set(r->x - cx), root = vf_set(r->root);

    vf_store(w->high[e], vf_fnma(vf_set(r->fall) * dy, dy, vf_set(r->top)));
    vf_store(w->shift[e], vf_fma(vf_set(r->sy), dy, x) * root);
}

/* Lay out n <= CHUNK entries for the tile centred on (cx, cy).  fourth:
 * record.z stands for colour 3. */
static __attribute__((noinline)) void
chunk_build(struct splat_work *w, const struct splat_state *s,
            const uint32_t *list, uint32_t n, float cx, float cy, bool fourth)
{
    const vf row = {-7.5f, -6.5f, -5.5f, -4.5f, -3.5f, -2.5f, -1.5f, -0.5f,
                    0.5f, 1.5f, 2.5f, 3.5f, 4.5f, 5.5f, 6.5f, 7.5f};
    vf y = row + vf_set(cy);

    for (int b = 0; b < BLOCKS; b++)
        w->count[b] = 0;
    memcpy(w->index, list, n * sizeof *list);
    for (uint32_t k = 0; k < AHEAD && k < n; k++)
        __builtin_prefetch(&s->record[list[k]]);
    for (uint32_t k = 0; k < VEC; k++)      /* entry n and on: nothing */
        w->index[n + k] = list[0];
    for (uint32_t i = 0; i < n; i += VEC) {
        uint32_t left = n - i;
        float *out = &w->chunk[0][i];
        vf r[16];

        for (uint32_t k = 0; k < VEC && i + AHEAD + k < n; k++)
            __builtin_prefetch(&s->record[w->index[i + AHEAD + k]]);
        for (uint32_t k = 0; k < VEC && k < left; k++)
            rows_build(w, i + k, &s->record[w->index[i + k]], cx, y);
        gather(r, s->record, w->index + i);
        vf_store(out + ROOT * COLUMN, r[10]);
        vf_store(out + RED * COLUMN, r[12]);
        vf_store(out + GREEN * COLUMN, r[13]);
        vf_store(out + BLUE * COLUMN, r[14]);
        vf_store(out + FOURTH * COLUMN, fourth ? r[8] : r[15]);
        sieve(w, r, r[0] - vf_set(cx), r[1] - vf_set(cy), i,
              left < VEC ? (1u << left) - 1 : 0xffff, s->view.cut);
    }
    /* lists end with entries that add nothing, for loops that take four */
    vf_store(w->high[CHUNK], vf_set(-1e30f));
    vf_store(w->shift[CHUNK], vf_set(0));
    for (int k = 0; k < COLUMNS; k++)
        w->chunk[k][CHUNK] = 0;
    for (int b = 0; b < BLOCKS; b++)
        vi_store(w->list[b] + w->count[b], vi_set(CHUNK));
}

/* q of entry e at block b's pixels; x of block_x(b). */
VEC_INLINE vf exponent(const struct splat_work *w, uint32_t e, int b, vf x)
{
    vf d = vf_fma(x, vf_set(w->chunk[ROOT][e]),
                  -vf_repeat(w->shift[e] + 4 * (b >> 2)));

    return vf_fnma(d, d, vf_repeat(w->high[e] + 4 * (b >> 2)));
}

/* alpha of one entry at the block's pixels, 0 where it is cut off. */
VEC_INLINE vf alpha_of(vf q, vf cut, const int degree)
{
    vf alpha = vf_min(vf_exp2(q, degree), vf_set(0.99f));

    return vf_keep(vf_ge(q, cut), alpha);
}

#endif
