/* Inside the kernels: the next CHUNK entries of a tile's list, laid out for
 * the blocks that will read them.  Included by *_tmpl.c only. */
#ifndef SPID_SPLAT_CHUNK_H
#define SPID_SPLAT_CHUNK_H

#include "lib/base/simd_shuffle.h"
#include "lib/splat/state.h"

#define BLOCKS 16              /* of 4 x 4 pixels, row by row, each of */
#define PARTS (16 / VEC)       /* slices: vectors of pixels, ... */
#define SLICES (BLOCKS * PARTS)
#define COLUMNS (VEC / 4)      /* ... of 4, 2 or 1 columns, ... */
#define ACROSS (4 * PARTS)     /* ... so many in a row */
#define ALL_ALIVE ((1u << VEC) - 1)
#define COLUMN (CHUNK + 48)    /* floats between columns of the chunk */
#define AHEAD 32               /* entries whose records are fetched early */

/* Columns of an entry, the first of which are summed up.  q = high - (root x -
 * shift)^2, shift = BASE + TILT y, high = TOP - FALLOFF (y - ROW)^2, x and y
 * about the tile's centre. */
enum { COLOR = 0, DEPTH = 3, PLACE = 4, SUMS = 8,
       BASE = SUMS, TILT, ROW, FALLOFF, TOP, ROOT, COLUMNS_OF_ENTRY = 16 };

/* One thread's scratch. */
struct splat_work {
    float entry[COLUMN][COLUMNS_OF_ENTRY]; /* a line of the cache each */
    uint32_t index[COLUMN];                /* Gaussian of each entry */
    uint32_t list[BLOCKS][COLUMN];         /* entries that reach a block */
    uint32_t count[BLOCKS];
    uint32_t alive[SLICES];                /* pixels still taking light */
    float T[SLICES][VEC];
    float sum[SUMS][SLICES][VEC];          /* of entries' columns */
    float weight[COLUMN][PARTS][VEC];      /* of one block's entries */
    float row[COLUMN][VEC];                /* of one slice's product, and */
    uint32_t used[COLUMN];                 /* the Gaussian of each row */
    float wide[SLICES * VEC][SPLAT_MAX_CHANNELS];
    float g[SLICES][SPLAT_MAX_CHANNELS][VEC];  /* dL/dcolor, backward */
    float remaining[SLICES][VEC];          /* backward: light still behind */
    float g_place[SLICES][SPLAT_PLACE_CHANNELS][VEC];  /* backward: dL/dplace */
    float color_dot_grad[COLUMN][VEC];     /* backward: color . g */
    float pair[COLUMN][16];                /* backward: sums of each entry
                                            * about the tile's centre */
    float grad_color[SLICES][VEC][16];     /* backward, up to 4 channels: at
                                            * pixel p, number 4 c + 0..3 is
                                            * dL/dcolor of c */
    float center[2][COLUMN];               /* x, y about the tile's centre */
    uint32_t pair_of[COLUMN];              /* backward: pair of each entry */
    float dcolor[COLUMN][SPLAT_MAX_CHANNELS];
};

/* A slice is four rows of pixels; lane p is the pixel in column p / 4 and row
 * p % 4.  Slices lie row by row, so that arrays (SLICES, VEC) are the same at
 * every width: by four rows, column, row. */
#define PIXEL_X(p) ((p) >> 2)
#define PIXEL_Y(p) ((p) & 3)

/* Fetch the lines of an array that are needed in a while.  Inline as all that
 * only fetches: the compiler drops calls of what it takes to do nothing. */
VEC_INLINE void chunk_fetch(const void *array, size_t bytes)
{
    const char *line = array;

    for (size_t k = 0; k < bytes; k += 64)
        __builtin_prefetch(line + k, 1);
    __builtin_prefetch(line + bytes - 1, 1);
}

/* Fetch what a Gaussian's entry is made of, and its colours. */
VEC_INLINE void chunk_fetch_entry(const struct splat_state *s, size_t i)
{
    __builtin_prefetch(&s->projection[i]);
    if (s->fixed)
        __builtin_prefetch(s->fixed + SPLAT_MAX_CHANNELS * i);
    else if (s->row)
        chunk_fetch(s->table + (size_t)s->row * i,
                    (size_t)s->row * sizeof(float));
    else
        __builtin_prefetch(&s->color[i]);
    if (s->place)
        __builtin_prefetch(&s->place[i]);
}

/* Columns of slice b's pixels, about the tile's centre. */
VEC_INLINE vf chunk_slice_x(int b)
{
    static const float column[16] = {0, 0, 0, 0, 1, 1, 1, 1,
                                     2, 2, 2, 2, 3, 3, 3, 3};

    return vf_load(column) +
           vf_set((float)(COLUMNS * (b % ACROSS)) - 7.5f);
}

/* The geometry of VEC list entries by column: g[k] = field k. */
VEC_INLINE void chunk_gather(vf g[8], const struct projected_gaussian *record,
                             const uint32_t *list)
{
    const float *r[VEC];

    for (int k = 0; k < VEC; k++)
        r[k] = (const float *)&record[list[k]];
    vf_columns(g, r, 2);
}

/* Whether any pixel of a block still takes light. */
VEC_INLINE bool chunk_alive(const struct splat_work *w, int block)
{
    uint32_t any = 0;

    for (int k = 0; k < PARTS; k++)
        any |= w->alive[PARTS * block + k];
    return any != 0;
}

/* Which of VEC Gaussians reach which blocks; the entries are appended to
 * the blocks' lists.  In a row of blocks the ellipse q >= cut spans the
 * columns from its leftmost to its rightmost point, or where the row's edge
 * cuts it.  The ellipse is taken a little too large, so that rounding loses
 * none. */
VEC_INLINE void chunk_cull(struct splat_work *w, const vf g[8], vf u, vf v,
                           uint32_t at, uint32_t valid, float cut)
{
    vf room = vf_fma(g[FTOP] - vf_set(cut), vf_set(1.003f), vf_set(0.01f));
    vf peak = g[FSX] * g[FWIDE], tiny = vf_set(1e-20f);
    vf half = vf_set(1) / vf_max(g[FROOT], tiny), slack = vf_set(2e-3f);
    vm here = vm_from_bits(valid);

    /* unrolled where there are registers for it */
#ifdef ISA_AVX512
#pragma GCC unroll 4
#else
#pragma GCC unroll 1
#endif
    for (int y = 0; y < 4; y++) {
        vf first = vf_set(4 * (float)y - 7.5f) - v, last = first + vf_set(3);
        vf right = vf_clamp(peak, first, last);
        vf left = vf_clamp(-peak, first, last);
        vf r2 = vf_fnma(g[FFALLOFF] * right, right, room);
        vf l2 = vf_fnma(g[FFALLOFF] * left, left, room);
        vf hi = vf_fma(g[FSY], right, u) + slack, lo = vf_fma(g[FSY], left, u);

        hi = vf_fma(half, vf_sqrt_above(vf_max(r2, tiny)), hi);
        lo = vf_fnma(half, vf_sqrt_above(vf_max(l2, tiny)), lo - slack);
        vm some = vf_gt_and(here, r2, vf_set(0));
#ifdef ISA_AVX512
#pragma GCC unroll 4
#else
#pragma GCC unroll 1
#endif
        for (int x = 0; x < 4; x++) {
            int b = 4 * y + x;

            if (!chunk_alive(w, b))
                continue;
            vf edge = vf_set(4 * (float)x - 7.5f);
            vm in = vf_gt_and(vf_gt_and(some, hi, edge), edge + vf_set(3), lo);

            w->count[b] += vm_list(w->list[b] + w->count[b], in, at);
        }
    }
}

/* Numbers BASE to ROOT of VEC entries from e on, of centres (u,v) about the
 * tile's. */
VEC_INLINE void chunk_put_shapes(struct splat_work *w, uint32_t e,
                                 const vf g[8], vf u, vf v)
{
    vf row[2][4] = {{g[FROOT] * vf_fnma(g[FSY], v, u), g[FROOT] * g[FSY], v,
                     g[FFALLOFF]},
                    {g[FTOP], g[FROOT], g[FTOP], g[FROOT]}};

#pragma GCC unroll 2
    for (int half = 0; half < 2; half++) {
        vf_transpose_quads(row[half]);
#pragma GCC unroll 4
        for (uint32_t k = 0; k < 4; k++)
            vf_put_quads(w->entry[e + k] + BASE + 4 * half,
                         4 * COLUMNS_OF_ENTRY, row[half][k]);
    }
}

/* Lay out n <= CHUNK entries for the tile centred on (cx, cy).  depth: the
 * fourth colour is camera z, which is the key. */
static __attribute__((noinline)) void
chunk_build(struct splat_work *w, const struct splat_state *s,
            const uint32_t *list, uint32_t n, float cx, float cy, bool depth)
{
    for (int b = 0; b < BLOCKS; b++)
        w->count[b] = 0;
    for (uint32_t k = 0; k < AHEAD && k < n; k++)
        chunk_fetch_entry(s, list[k]);
    for (uint32_t k = 0; k < n; k += VEC)  /* lists have room behind them */
        memcpy(w->index + k, list + k, VEC * sizeof *list);
    for (uint32_t k = 0; k < VEC; k++)      /* entry n and on: nothing */
        w->index[n + k] = list[0];
    for (uint32_t i = 0; i < n; i += VEC) {
        uint32_t left = n - i < VEC ? n - i : VEC;
        vf g[8];

        for (uint32_t k = 0; k < VEC && i + AHEAD + k < n; k++)
            chunk_fetch_entry(s, w->index[i + AHEAD + k]);
        chunk_gather(g, s->projection, w->index + i);
        vf u = g[FX] - vf_set(cx), v = g[FY] - vf_set(cy);

        if (s->fine[0]) {
            u += vf_gather(s->fine[0], vi_load(w->index + i));
            v += vf_gather(s->fine[1], vi_load(w->index + i));
            vf_store(w->center[0] + i, u);
            vf_store(w->center[1] + i, v);
        }
        chunk_put_shapes(w, i, g, u, v);
        for (uint32_t k = 0; k < left; k++) {
            uint32_t one = w->index[i + k];

            memcpy(w->entry[i + k], s->color[one], sizeof s->color[0]);
            if (s->place)
                memcpy(w->entry[i + k] + PLACE, s->place[one],
                       sizeof s->place[0]);
            if (depth)
                memcpy(&w->entry[i + k][DEPTH], &s->key[one], sizeof(float));
        }
        chunk_cull(w, g, u, v, i, (1u << left) - 1, s->view.cut);
    }
    /* lists end with entries that add nothing, for loops that take four */
    memset(w->entry[CHUNK], 0, sizeof w->entry[0]);
    w->entry[CHUNK][TOP] = -1e30f;
    w->index[CHUNK] = list[0];
    for (int b = 0; b < BLOCKS; b++)
        for (uint32_t k = 0; k < 4; k++)
            w->list[b][w->count[b] + k] = CHUNK;
}

/* Coefficients of 2^f on [-1/2, 1/2], by degree, fitted for the smallest
 * relative error: 2: 1.7e-3, 3: 7.5e-5, 4: 2.6e-6, 5: 7.5e-8 (float's own
 * rounding). */
static const float exp2_table[6][6] = {
    [2] = {1.00044314f, 0.703448041f, 0.238428941f},
    [3] = {0.999928073f, 0.693260986f, 0.242611128f, 0.0551716698f},
    [4] = {0.999999261f, 0.693121815f, 0.240247448f, 0.0559178612f,
           0.00957010199f},
    [5] = {1.00000007f, 0.693146967f, 0.240221197f, 0.0555071327f,
           0.00967554143f, 0.00132764721f}};

#ifdef ISA_AVX512
/* Four values take each step side by side: the processor looks only a few
 * dozen instructions ahead, too few to find the second value's steps behind
 * all of the first's.  With sixteen registers there is no room for it. */
#define ABREAST(v) \
    __asm__ volatile("" : "+v"((v)[0]), "+v"((v)[1]), "+v"((v)[2]), \
                     "+v"((v)[3]))
/* What has been stored is loaded, part by part: the compiler would rather take
 * the vectors apart by shuffles, of which the processor does one a cycle. */
#define FROM_MEMORY(v) __asm__ volatile("" : "+m"(v))
#else
#define ABREAST(v) (void)(v)
#define FROM_MEMORY(v) (void)(v)
#endif

/* q[k] becomes 2^q[k], for q in about [-100, 0]. */
VEC_INLINE void vf_exp2_four(vf q[4], const int degree)
{
    const float *c = exp2_table[degree];
    const float magic = 12582912.0f;         /* 1.5 * 2^23: rounds */
    vf t[4], f[4], p[4];

#define FOUR _Pragma("GCC unroll 4") for (int k = 0; k < 4; k++)
    FOUR t[k] = q[k] + magic;
    ABREAST(t);
    FOUR f[k] = t[k] - magic;
    ABREAST(f);
    FOUR f[k] = q[k] - f[k];
    ABREAST(f);
    FOUR p[k] = vf_fma(vf_set(c[degree]), f[k], vf_set(c[degree - 1]));
    ABREAST(p);
    FOUR t[k] = (vf)((vu)t[k] << 23);    /* unsigned: drops bits */
    ABREAST(t);
#pragma GCC unroll 4
    for (int d = degree - 2; d >= 0; d--) {
        FOUR p[k] = vf_fma(p[k], f[k], vf_set(c[d]));
        ABREAST(p);
    }
    FOUR q[k] = (vf)((vu)p[k] + (vu)t[k]);
}

/* q of entries 0 .. 4 / parts - 1 at the pixels of `parts` slices each, from
 * slice b on, whose columns are x. */
VEC_INLINE void chunk_exponents(vf q[4], const struct splat_work *w,
                                const uint32_t *entry, int b, const vf *x,
                                const int parts)
{
    static const float row[16] = {0, 1, 2, 3, 0, 1, 2, 3,
                                  0, 1, 2, 3, 0, 1, 2, 3};
    const vf y = vf_load(row) + vf_set(4 * (float)(b / ACROSS) - 7.5f);
    vf shift[4], high[4];

#pragma GCC unroll 4
    for (int k = 0; k < 4 / parts; k++) {
        const float *e = w->entry[entry[k]];
        vf dy = y - vf_set(e[ROW]);

        shift[k] = vf_fma(y, vf_set(e[TILT]), vf_set(e[BASE]));
        high[k] = vf_fnma(vf_set(e[FALLOFF]) * dy, dy, vf_set(e[TOP]));
    }
    FOUR q[k] = vf_fma(x[k % parts], vf_set(w->entry[entry[k / parts]][ROOT]),
                       -shift[k / parts]);
    ABREAST(q);
    FOUR q[k] = vf_fnma(q[k], q[k], high[k / parts]);
    ABREAST(q);
}

/* Their alphas, also before the clamp, and where they are not cut off. */
VEC_INLINE void chunk_alphas(vf alpha[4], vm on[4], vf free[4],
                             const struct splat_work *w, const uint32_t *entry,
                             int b, const vf *x, vf cut, const int degree,
                             const int parts)
{
    chunk_exponents(free, w, entry, b, x, parts);
    FOUR on[k] = vf_ge(free[k], cut);
    vf_exp2_four(free, degree);
    FOUR alpha[k] = vf_min_positive(free[k], vf_set(0.99f));
    ABREAST(alpha);
}

#endif
