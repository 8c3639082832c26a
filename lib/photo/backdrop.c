/* The background behind a person: patches of what is seen of it, put where they
 * continue it best (Wexler et al. 2007, with the search of Barnes et al. 2009),
 * in cells; then the picture's own pixels from there, with what they are off by
 * at the edge of the hole taken out (as in Perez et al. 2003), once in these
 * cells, by light alone, and once in fine ones, so that no outline is seen. */
#include "lib/photo/backdrop.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/base/quad.h"
#include "lib/photo/pyramid.h"

#define SIDE 64                 /* cells across */
#define CELLS (SIDE * SIDE)
/* Half and twice of both by tests/bench/backdrop.py: tests/bench/README.md, "Behind
 * a head that moves". */
#define FINE 256                /* cells across at the hole's edge */
#define STILL 0.001f            /* share of such a cell that counts as it is: the
                                 * edge is not followed on and on */
#define REACH 2                 /* cells to each side of a patch's middle */
#define PATCH (2 * REACH + 1)
#define ROUNDS 12               /* of searching and voting */
#define DOUBT 0.02f             /* how much colours count that nobody has seen:
                                 * the means of what is about them */
#define ALIKE 16.0f             /* square of levels that patches of one thing
                                 * in another light differ by */
#define SEEN 0.9f               /* share of a cell that makes it seen */
#define COPIED 0.02f            /* how much a copy counts as it is: light is followed
                                 * for 1 / sqrt(COPIED) cells, not on and on */
#define SWEEPS (SIDE / 2)       /* of relaxation: twice and four times change nothing */
#define OVER 1.9f               /* about 2 / (1 + sin(pi / SIDE)), the fastest */

typedef int32_t v4i __attribute__((vector_size(16)));

struct backdrop {
    quad colour[CELLS];         /* 1 and the colour, 0..255, also in the hole */
    quad off[CELLS];            /* 0 and what a copy is brighter by */
    quad seam[2][CELLS];        /* to the cell on the right and below, weighted */
    quad sum[CELLS * 4 / 3 + 1]; /* of such, weighted, for pyramid_pool */
    float known[CELLS];         /* how much of a cell is seen, 0..1 */
    float trust[CELLS];         /* how much its colour counts: that, and in the
                                 * hole more from round to round */
    int32_t from[CELLS];        /* the cell that this is like, -1: itself; */
    int32_t shift[CELLS][2];    /* and how far that is, pixels across and down */
    int32_t source[CELLS];      /* cells whose patch is seen: */
    uint32_t sources;           /* so many */
    uint8_t is_source[CELLS];
    uint32_t noise;
    quad edge[FINE * FINE * 4 / 3 + 1]; /* weights of what is seen beside the
                                 * hole, and what is brighter there, weighted */
};

/* A number in 0..n-1, the next of a fixed sequence. */
static int32_t backdrop_random(struct backdrop *b, uint32_t n)
{
    b->noise = b->noise * 1664525u + 1013904223u;
    return (int32_t)((uint64_t)b->noise * n >> 32);
}

/* ---- what is seen ------------------------------------------------------- */

/* The pixels of n along an axis that are cell i's of `side`, from and to. */
static void backdrop_extent(size_t x[2], size_t i, size_t n, size_t side)
{
    x[0] = (i * n + side - 1) / side;
    x[1] = ((i + 1) * n + side - 1) / side;
}

/* 1 and the background's colour at pixel j. */
static quad backdrop_colour(const struct matting *m, size_t j)
{
    const uint8_t *back = m->back + 3 * j;

    return __builtin_convertvector(
        ((v4i){1, back[0], back[1], back[2]}), quad);
}

/* How far pixel j is surely background: not above 0 beyond the picture. */
static float backdrop_seen(const struct matting *m, size_t j)
{
    return (float)((MATTING_BACK - m->alpha[j]) * m->confidence[j]) /
           (MATTING_BACK * 255);
}

/* Cell i from its pixels. */
PARALLEL(backdrop_gather_part, i, struct backdrop *, b,
         const struct matting *, m)
{
    size_t x[2], y[2];
    quad sum = {0};

    backdrop_extent(x, i % SIDE, m->n, SIDE);
    backdrop_extent(y, i / SIDE, m->n, SIDE);
    for (size_t v = y[0]; v < y[1]; v++)
        for (size_t u = x[0]; u < x[1]; u++)
            sum += fmaxf(backdrop_seen(m, v * m->n + u), 0) *
                   backdrop_colour(m, v * m->n + u);
    b->sum[i] = sum;
    if (sum[0] > 0)
        b->trust[i] = b->known[i] =
            sum[0] / (float)((x[1] - x[0]) * (y[1] - y[0]));
}

/* The cells' colours from those of the pixels that are mostly background; where
 * there are none, of the cells about them. */
static void backdrop_gather(struct backdrop *b, const struct matting *m)
{
    static const float any[4] = {1, 128, 128, 128};
    const size_t n = m->n;
    const float pixels = (float)(n * n) / CELLS;

    parallel_each(backdrop_gather_part, CELLS, SIDE, b, m);
    pyramid_pool((float *)b->sum, SIDE, 4, 0.01f * pixels, any);
    for (size_t i = 0; i < CELLS; i++)
        b->colour[i] = b->sum[i] / b->sum[i][0];
}

/* The least that is seen of a cell within `reach` of cell i; 0 beyond the
 * picture, or `outside`. */
static float backdrop_min(const struct backdrop *b, int i, int reach,
                            float outside)
{
    float min = 1;

    for (int v = i / SIDE - reach; v <= i / SIDE + reach; v++)
        for (int u = i % SIDE - reach; u <= i % SIDE + reach; u++)
            min = fminf(min, u < 0 || u >= SIDE || v < 0 || v >= SIDE
                                     ? outside : b->known[v * SIDE + u]);
    return min;
}

/* Whose patch is seen; and the cells of the hole, with those beside it that
 * tell how well it is filled, as any of them to begin with. */
static void backdrop_start(struct backdrop *b)
{
    for (int i = 0; i < CELLS; i++)
        if (backdrop_min(b, i, REACH, 0) >= SEEN) {
            b->is_source[i] = 1;
            b->source[b->sources++] = i;
        }
    for (int i = 0; i < CELLS; i++)
        b->from[i] = b->sources && backdrop_min(b, i, 1, 1) < SEEN
                         ? b->source[backdrop_random(b, b->sources)] : -1;
}

/* ---- the search --------------------------------------------------------- */

/* The square of what light, which multiplies colours, can make of a difference d
 * between colours whose mean is c. */
static inline float backdrop_light(quad d, quad c)
{
    const quad both = d * c, own = c * c;
    const float along = both[1] + both[2] + both[3];

    return along * along / (own[1] + own[2] + own[3] + 1);
}

/* How unlike the patch about cell i is to that about cell `from`, each cell counting
 * by its weight and `least`: the mean square, without the light's if that may differ.
 */
static inline float backdrop_unlike(const struct backdrop *b, int i, int from,
                                    const float *weight, float least, bool lit)
{
    const int x = i % SIDE, y = i / SIDE;
    quad mean = {0}, square = {0};
    float all = 0;

    for (int v = -REACH; v <= REACH; v++)
        for (int u = -REACH; u <= REACH; u++) {
            if (x + u < 0 || x + u >= SIDE || y + v < 0 || y + v >= SIDE)
                continue;
            const int at = v * SIDE + u;
            const quad d = b->colour[i + at] - b->colour[from + at];
            const float w = weight[i + at] + least;

            all += w;
            mean += w * d;
            square += w * d * d;
        }
    return (square[1] + square[2] + square[3]) / all -
           (lit ? backdrop_light(mean / all,
                                (b->colour[i] + b->colour[from]) / 2) : 0);
}

/* That, as far as cell i's patch is known. */
static float backdrop_distance(const struct backdrop *b, int i, int from)
{
    return backdrop_unlike(b, i, from, b->trust, DOUBT, false);
}

/* Cell i takes after cell `from` if that is seen and suits it as well. */
static void backdrop_try(struct backdrop *b, int i, int from, float *distance)
{
    if (from < 0 || from >= CELLS || !b->is_source[from])
        return;
    const float d = backdrop_distance(b, i, from);

    if (d <= *distance) {
        *distance = d;
        b->from[i] = from;
    }
}

/* One pass over the hole, `by` 1 or -1: what suits a cell's neighbour, moved,
 * may suit the cell, and so may others about it and anywhere. */
static void backdrop_search(struct backdrop *b, int by)
{
    for (int k = 0; k < CELLS; k++) {
        const int i = by > 0 ? k : CELLS - 1 - k;
        float d;

        if (b->from[i] < 0)
            continue;
        d = backdrop_distance(b, i, b->from[i]);
        backdrop_try(b, i, b->source[backdrop_random(b, b->sources)], &d);
        for (uint32_t r = SIDE / 4; r > 0; r /= 2) {
            const int u = backdrop_random(b, 2 * r + 1) - (int)r;
            const int v = backdrop_random(b, 2 * r + 1) - (int)r;

            backdrop_try(b, i, b->from[i] + v * SIDE + u, &d);
        }
        for (int step = by; abs(step) <= SIDE; step *= SIDE) {
            const int beside = i - step;

            if (beside >= 0 && beside < CELLS && b->from[beside] >= 0)
                backdrop_try(b, i, b->from[beside] + step, &d);
        }
    }
}

/* The hole's colours: the mean of what the patches over each cell say, each
 * counting as its middle does. */
static void backdrop_vote(struct backdrop *b)
{
    memset(b->sum, 0, sizeof b->sum);
    for (int i = 0; i < CELLS; i++)
        for (int v = -REACH; v <= REACH && b->from[i] >= 0; v++)
            for (int u = -REACH; u <= REACH; u++) {
                const int x = i % SIDE + u, y = i / SIDE + v;
                const float trust = b->trust[i] + DOUBT;

                if (x < 0 || x >= SIDE || y < 0 || y >= SIDE)
                    continue;
                b->sum[y * SIDE + x] +=
                    trust * b->colour[b->from[i] + v * SIDE + u];
            }
    for (int i = 0; i < CELLS; i++) {
        const float all = b->sum[i][0], share = all / (PATCH * PATCH);

        if (b->known[i] < SEEN && all > 0)
            b->colour[i] = b->sum[i] / all;
        b->trust[i] = share > b->trust[i] ? share : b->trust[i];
    }
}

/* What cell i's copy has to be brighter by than that of the cell `step` on, beside
 * it, for either to go on as the other: 1 and that, times how far light may be all
 * that differs; 0 where one of them is no copy. */
static quad backdrop_seam(const struct backdrop *b, int i, int step)
{
    const int from = b->from[i], next = b->from[i + step];

    if (from < 0 || next < 0)
        return (quad){0};
    const quad here = b->colour[next - step] - b->colour[from];
    const quad there = b->colour[next] - b->colour[from + step];
    const quad mean = (here + there) / 2, both = mean + (quad){1};
    const quad square = (here * here + there * there) / 2;
    const float unlike = square[1] + square[2] + square[3] -
                         backdrop_light(mean, (b->colour[from] + b->colour[next]) /
                                                  2);

    return both / (1 + fmaxf(unlike, 0) / ALIKE);
}

/* Cell i's `off` by those beside it, the seams to them and, beside the hole, what
 * is seen (b->sum). */
static void backdrop_relax(struct backdrop *b, int i)
{
    static const int step[2] = {1, SIDE};
    quad sum = b->sum[i];

    for (int q = 0; q < 2; q++) {
        const quad on = b->seam[q][i];
        const quad back = i < step[q] ? (quad){0} : b->seam[q][i - step[q]];

        if (on[0] > 0)
            sum += on + on[0] * b->off[i + step[q]];
        if (back[0] > 0)
            sum += (quad){2 * back[0]} - back + back[0] * b->off[i - step[q]];
    }
    if (sum[0] > 0)
        b->off[i] += OVER * (sum / sum[0] - (quad){1} - b->off[i]);
}

/* How far each cell's copy is from it in a picture of n by n pixels, and what
 * it has to be brighter by: as the cells beside the hole, which are seen, differ
 * from what would be copied there, each as far as the light may be all that
 * differs; in the hole so that neighbours meet (a screened Poisson equation by
 * successive over-relaxation). */
static void backdrop_compare(struct backdrop *b, int n)
{
    for (int i = 0; i < CELLS; i++) {
        const bool beside = b->from[i] >= 0 && b->known[i] >= SEEN;
        const int from = b->from[i] < 0 ? i : b->from[i];
        const float w = beside ? 1 / (1 + backdrop_unlike(b, i, from, b->known,
                                                          0, true) / ALIKE) : 0;

        b->sum[i] = w * (b->colour[i] - b->colour[from] + (quad){1}) + (quad){COPIED};
        b->shift[i][0] = (from % SIDE - i % SIDE) * n / SIDE;
        b->shift[i][1] = (from / SIDE - i / SIDE) * n / SIDE;
    }
    for (int i = 0; i < CELLS; i++) {
        b->seam[0][i] = i % SIDE < SIDE - 1 ? backdrop_seam(b, i, 1) : (quad){0};
        b->seam[1][i] = i < CELLS - SIDE ? backdrop_seam(b, i, SIDE) : (quad){0};
    }
    for (int sweep = 0; sweep < SWEEPS; sweep++)
        for (int i = 0; i < CELLS; i++)
            if (b->from[i] >= 0)
                backdrop_relax(b, i);
}

/* ---- at the picture's size ---------------------------------------------- */

/* Whether the background of pixel (x,y) is not known. */
static bool backdrop_hidden(const struct matting *m, size_t x, size_t y)
{
    return !extent_has(&m->inside, x, y) || m->alpha[y * m->n + x] > MATTING_BACK;
}

/* 1 and pixel (x,y), hidden, as cell i says: what that copies there or, where
 * there is nothing to copy, its colour. */
static quad backdrop_copy(const struct matting *m, const struct backdrop *b,
                          int i, int x, int y)
{
    const int u = x + b->shift[i][0], v = y + b->shift[i][1];
    const int from = b->from[i] < 0 ? i : b->from[i];
    const size_t copy = (size_t)(v * (int)m->n + u);
    const bool seen = b->from[i] >= 0 &&
                      !backdrop_hidden(m, (size_t)u, (size_t)v);

    return (seen ? backdrop_colour(m, copy) : b->colour[from]) + b->off[i];
}

/* 1 and pixel (x,y) as if hidden: the mean of what the four cells about it say. */
static quad backdrop_filled(const struct matting *m, const struct backdrop *b,
                            size_t x, size_t y)
{
    float t[2][2];
    quad sum = {0};
    const size_t u = pyramid_between(&t[0][1], x, m->n, SIDE);
    const size_t v = pyramid_between(&t[1][1], y, m->n, SIDE);

    t[0][0] = 1 - t[0][1];
    t[1][0] = 1 - t[1][1];
    for (size_t q = 0; q < 4; q++) {
        const int i = (int)((v + q / 2) * SIDE + u + q % 2);
        const float w = t[0][q % 2] * t[1][q / 2];

        if (w >= 0.001f)
            sum += w * backdrop_copy(m, b, i, (int)x, (int)y);
    }
    return sum / sum[0];
}

/* Whether the middle of fine cell (u,v) or of one about it is hidden. */
static bool backdrop_beside(const struct matting *m, size_t u, size_t v)
{
    for (size_t y = v - (v > 0); y <= v + 1 && y < FINE; y++)
        for (size_t x = u - (u > 0); x <= u + 1 && x < FINE; x++)
            if (backdrop_hidden(m, (2 * x + 1) * m->n / (2 * FINE),
                                (2 * y + 1) * m->n / (2 * FINE)))
                return true;
    return false;
}

/* Fine cell i: what is seen beside the hole less what would be copied there, as
 * far as that is more than things that are alike differ by. */
PARALLEL(backdrop_edge_part, i, struct backdrop *, b, const struct matting *, m)
{
    const size_t n = m->n;
    size_t x[2], y[2];
    quad sum = {STILL * (float)(n * n) / (FINE * FINE)};

    b->edge[i] = sum;
    if (!backdrop_beside(m, i % FINE, i / FINE))
        return;
    backdrop_extent(x, i % FINE, n, FINE);
    backdrop_extent(y, i / FINE, n, FINE);
    for (size_t v = y[0]; v < y[1]; v++)
        for (size_t u = x[0]; u < x[1]; u++) {
            const float w = backdrop_seen(m, v * n + u);

            if (w > 0)
                sum += w * (backdrop_colour(m, v * n + u) + (quad){1} -
                            backdrop_filled(m, b, u, v));
        }
    const quad square = sum * sum;
    const float off = square[1] + square[2] + square[3];
    const float share = off / (off + ALIKE * square[0]);

    b->edge[i] = sum * (quad){1, share, share, share};
}

/* 0 and what is to be added at pixel (x,y), hidden, so that no edge is seen. */
static quad backdrop_correct(const struct matting *m, const struct backdrop *b,
                             size_t x, size_t y)
{
    float tx, ty;
    const size_t u = pyramid_between(&tx, x, m->n, FINE);
    const quad *a = b->edge + pyramid_between(&ty, y, m->n, FINE) * FINE + u;
    const quad sum = (1 - ty) * ((1 - tx) * a[0] + tx * a[1]) +
                     ty * ((1 - tx) * a[FINE] + tx * a[FINE + 1]);

    return sum / sum[0] - (quad){1};
}

/* A hidden pixel. */
static void backdrop_pixel(uint8_t *out, const struct matting *m,
                           const struct backdrop *b, size_t x, size_t y)
{
    const quad sum = backdrop_filled(m, b, x, y) + backdrop_correct(m, b, x, y) +
                     0.5f;

    for (int c = 0; c < 3; c++) {
        const float value = sum[1 + c];

        out[c] = (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
    }
}

/* One row. */
PARALLEL(backdrop_fill_part, y, struct matting *, m, struct backdrop *, b)
{
    for (size_t x = 0; x < m->n; x++)
        if (backdrop_hidden(m, x, y))
            backdrop_pixel(m->back + 3 * (y * m->n + x), m, b, x, y);
}

/* The least coverage, 0..255, by which a colour and a person of some colour
 * before such a background, channels 0..255, can be the same. */
static int backdrop_min_alpha(int rgb, int back)
{
    const int off = abs(rgb - back), room = rgb < back ? back : 255 - back;

    return off ? (255 * off + room - 1) / room : 0;
}

/* One row: pixels that the background cannot have a part in are the person's. */
PARALLEL(backdrop_cover_part, y, struct matting *, m)
{
    for (size_t x = 0; x < m->n; x++) {
        const size_t i = y * m->n + x;

        if (m->alpha[i] <= MATTING_BACK || m->alpha[i] == 255 ||
            !extent_has(&m->inside, x, y))
            continue;
        for (size_t c = 3 * i; c < 3 * i + 3; c++) {
            const int min = backdrop_min_alpha(m->rgb[c], m->back[c]);

            m->alpha[i] = (uint8_t)(m->alpha[i] < min ? min : m->alpha[i]);
        }
    }
}

int backdrop_fill(struct matting *m, struct error *err)
{
    static const float none[4] = {1};
    const size_t n = m->n;
    struct backdrop *b = calloc(1, sizeof *b);

    if (!b)
        return error_set(err, EX_OSERR, "no memory for the background");
    backdrop_gather(b, m);
    backdrop_start(b);
    for (int round = 0; round < ROUNDS && b->sources; round++) {
        backdrop_search(b, round % 2 ? -1 : 1);
        backdrop_vote(b);
    }
    backdrop_compare(b, (int)n);
    parallel_each(backdrop_edge_part, FINE * FINE, FINE, b, m);
    pyramid_pool((float *)b->edge, FINE, 4, STILL, none);
    parallel_each(backdrop_fill_part, n, 1, m, b);
    parallel_each(backdrop_cover_part, n, 1, m);
    free(b);
    return 0;
}

/* p's background, found as if it was the matte alone that is known. */
static int backdrop_find(uint8_t *back, const struct person *p,
                         struct error *err)
{
    const size_t n = p->size * p->size;
    uint8_t *copy = malloc(5 * n);
    struct matting m = {p->size, {{0, p->size}, {0, p->size}}, copy,
                        copy + 3 * n, copy + 4 * n, back};
    int rc;

    if (!copy)
        return error_set(err, EX_OSERR, "no memory for the background");
    memcpy(copy, p->rgb, 3 * n);
    memcpy(m.alpha, p->matte, n);
    rc = matting_solve(&m, NULL, 0, true, err);
    free(copy);
    return rc;
}

int backdrop_of_person(struct background *bg, const struct person *p,
                       struct error *err)
{
    const size_t n = 3 * p->size * p->size;
    uint8_t *back = malloc(n);
    int rc = back ? 0 : error_set(err, EX_OSERR, "no memory for the picture");

    if (rc == 0 && p->back)
        memcpy(back, p->back, n);
    else if (rc == 0)
        rc = backdrop_find(back, p, err);
    if (rc) {
        free(back);
        return rc;
    }
    background_release(bg);
    bg->rgb = back;
    bg->width = bg->height = p->size;
    return 0;
}
