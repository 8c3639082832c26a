/* Guesses beyond the photograph, joined to it (Perez et al. 2003, "Poisson
 * image editing"): what a layer is off by at the picture's edge is spread over
 * the margin, from coarser cells the farther it is (Farbman et al. 2011,
 * "Convolution pyramids"). */
#include "lib/photo/margin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/photo/pyramid.h"

#define SIDE_MAX 512            /* cells across at most: the networks' pixels */
#define REST 0.01f              /* of a cell: what coarser cells count for it */
#define REACH 64                /* cells from the edge to where guesses hold: a
                                 * cell of the pyramid that is as wide has as
                                 * much of its own guess as it gets from REST */

enum layer { LAYER_ALPHA, LAYER_BACK, LAYER_PERSON, LAYERS };
enum { OFF = 4 };               /* floats of a cell: how much is seen, and the
                                 * sums of what three channels are off by */

struct margin {
    struct matting *m;
    size_t side;                /* cells across, a power of two */
    float *cell[LAYERS];        /* (side,side,OFF), and coarser ones */
};

static size_t margin_cell(const struct margin *g, size_t x, size_t y)
{
    const size_t n = g->m->n, side = g->side;

    return y * side / n * side + x * side / n;
}

/* Channels of pixel i: of the person's, without the background if that shows
 * through. */
static void margin_value(float to[3], const struct matting *m,
                         enum layer layer, size_t i, bool through)
{
    const float a = m->alpha[i] / 255.f;

    for (size_t c = 0; c < 3; c++) {
        const float rgb = m->rgb[3 * i + c], back = m->back[3 * i + c];

        to[c] = layer == LAYER_ALPHA ? m->alpha[i] : layer == LAYER_BACK ? back
                : !through || a == 0 ? rgb
                : fminf(255, fmaxf(0, (rgb - (1 - a) * back) / a));
    }
}

/* The first pixel beyond the picture from i on, or end. */
static size_t margin_next(const struct matting *m, size_t i, size_t end)
{
    while (i < end && extent_has(&m->inside, i % m->n, i / m->n))
        i += m->inside.x[1] - i % m->n;
    return i < end ? i : end;
}

/* Pixel i of the picture, and the one beyond it, j: how far that is off. */
static void margin_meet(struct margin *g, enum layer layer, size_t i, size_t j)
{
    const struct matting *m = g->m;
    const float a = m->alpha[i] / 255.f;
    const float w = layer == LAYER_ALPHA ? 1 : layer == LAYER_BACK ? 1 - a : a;
    float *to = g->cell[layer] + OFF * margin_cell(g, i % m->n, i / m->n);
    float seen[3], guess[3];

    margin_value(seen, m, layer, i, true);
    margin_value(guess, m, layer, j, false);
    to[0] += w;
    for (int c = 0; c < 3; c++)
        to[1 + c] += w * (seen[c] - guess[c]);
}

/* What a layer's cells are off by where the picture's rim says it. */
PARALLEL(margin_gather, layer, struct margin *, g)
{
    const struct matting *m = g->m;
    const size_t n = m->n;
    float *cell = g->cell[layer];

    memset(cell, 0, g->side * g->side * OFF * sizeof *cell);
    for (size_t j = margin_next(m, 0, n * n); j < n * n;
         j = margin_next(m, j + 1, n * n)) {
        const size_t x = j % n, y = j / n;

        cell[OFF * margin_cell(g, x, y)] += REST / (REACH * REACH);
        if (y > 0 && extent_has(&m->inside, x, y - 1))
            margin_meet(g, (enum layer)layer, j - n, j);
        if (x > 0 && extent_has(&m->inside, x - 1, y))
            margin_meet(g, (enum layer)layer, j - 1, j);
        if (extent_has(&m->inside, x + 1, y))
            margin_meet(g, (enum layer)layer, j + 1, j);
        if (extent_has(&m->inside, x, y + 1))
            margin_meet(g, (enum layer)layer, j + n, j);
    }
}

/* Row y of means from sums. */
PARALLEL(margin_divide, y, float *, cell, size_t, side)
{
    for (size_t i = y * side; i < (y + 1) * side; i++)
        for (int c = 1; c < OFF; c++)
            cell[OFF * i + (size_t)c] /= cell[OFF * i];
}

/* What every cell of a layer is off by: in the margin as the cells about it. */
static void margin_spread(float *cell, size_t side)
{
    static const float none[OFF] = {1, 0, 0, 0};

    pyramid_pool(cell, side, OFF, REST, none);
    parallel_each(margin_divide, side, 8, cell, side);
}

/* Row y of a layer. */
static void margin_add(const struct margin *g, enum layer layer, size_t y)
{
    struct matting *m = g->m;
    const size_t n = m->n, s = g->side, end = (y + 1) * n;
    uint8_t *to = layer == LAYER_ALPHA  ? m->alpha
                  : layer == LAYER_BACK ? m->back
                                        : m->rgb;
    const size_t channels = layer == LAYER_ALPHA ? 1 : 3;
    float tx, ty;
    const size_t v = pyramid_between(&ty, y, n, s);

    for (size_t i = margin_next(m, y * n, end); i < end;
         i = margin_next(m, i + 1, end)) {
        const size_t x = i - y * n;
        const size_t u = pyramid_between(&tx, x, n, s);
        const float *a = g->cell[layer] + OFF * (v * s + u) + 1;
        const float *b = a + OFF * s;

        for (size_t c = 0; c < channels; c++) {
            uint8_t *at = to + channels * i + c;
            const float up = a[c] + tx * (a[c + OFF] - a[c]);
            const float low = b[c] + tx * (b[c + OFF] - b[c]);
            const float value = *at + up + ty * (low - up) + 0.5f;

            *at = (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
        }
    }
}

/* Row y: the layers, and in rgb both together. */
PARALLEL(margin_row, y, const struct margin *, g)
{
    struct matting *m = g->m;
    const size_t end = (y + 1) * m->n;

    for (int layer = 0; layer < LAYERS; layer++)
        margin_add(g, layer, y);
    for (size_t i = margin_next(m, y * m->n, end); i < end;
         i = margin_next(m, i + 1, end)) {
        const unsigned a = m->alpha[i];

        for (size_t c = 3 * i; c < 3 * i + 3; c++)
            m->rgb[c] = (uint8_t)((a * m->rgb[c] + (255 - a) * m->back[c]) /
                                  255);
    }
}

int margin_fill(struct matting *m, struct error *err)
{
    struct margin g = {.m = m, .side = 2};

    if (margin_next(m, 0, m->n * m->n) == m->n * m->n)
        return 0;
    while (2 * g.side <= m->n && g.side < SIDE_MAX)
        g.side *= 2;
    const size_t floats = pyramid_floats(g.side, OFF);
    float *cells = malloc(LAYERS * floats * sizeof *cells);

    if (!cells)
        return error_set(err, EX_OSERR, "no memory beyond the photograph");
    for (size_t layer = 0; layer < LAYERS; layer++)
        g.cell[layer] = cells + layer * floats;
    parallel_each(margin_gather, LAYERS, 1, &g);
    for (size_t layer = 0; layer < LAYERS; layer++)
        margin_spread(g.cell[layer], g.side);
    parallel_each(margin_row, m->n, 1, &g);
    free(cells);
    return 0;
}
