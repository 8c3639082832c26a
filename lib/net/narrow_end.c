/* The narrow refiner's last layers: tiles that are seen, and two convolutions
 * as one. */
#include "lib/net/narrow_end.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"

#define CELL NARROW_END_CELL
#define COLORS NARROW_END_COLORS
#define TILE WINOGRAD_TILE

/* ---- one correction for a place ------------------------------------------ */

void narrow_end_spread(float *colors, const float *tint, float max, size_t n)
{
    for (; n; n--, tint += 3) {
        float within[3];

        for (int c = 0; c < 3; c++)
            within[c] = fmaxf(-max, fminf(tint[c], max));
        for (int i = 0; i < CELL * CELL; i++, colors += 3)
            memcpy(colors, within, sizeof within);
    }
}

void narrow_end_spread_backward(float *dtint, const float *dcolors,
                                const float *tint, float max, size_t n)
{
    memset(dtint, 0, 3 * n * sizeof *dtint);
    for (size_t i = 0; i < COLORS * n; i++) {
        const size_t at = i / COLORS * 3 + i % 3;

        if (fabsf(tint[at]) < max)
            dtint[at] += dcolors[i];
    }
}

/* ---- two layers as one --------------------------------------------------- */

/* Both layers' weights, one after the other's. */
static void narrow_end_update(void *end)
{
    struct narrow_end *e = end;
    const struct conv *layer[2] = {e->rgb, e->field};
    size_t at = 0;

    for (int i = 0; i < 2 && layer[i]; i++) {
        const struct conv *c = layer[i];

        memcpy(e->weight + at * c->in * 9, param_w(c->ps, c->weight),
               c->out * c->in * 9 * sizeof *e->weight);
        memcpy(e->bias + at, param_w(c->ps, c->bias),
               c->out * sizeof *e->bias);
        at += c->out;
    }
    winograd_update(&e->joint, e->weight, e->bias);
}

void narrow_end_plan(struct narrow_end *e, struct conv *rgb,
                     struct conv *field, float max, struct nn_plan *p)
{
    const size_t out = rgb->out + (field ? field->out : 0);
    const size_t cells = rgb->h * rgb->w;
    struct conv both = *rgb;

    *e = (struct narrow_end){.rgb = rgb, .field = field, .max = max};
    if (p->err.code || nn_plan_type(p) == NN_F32 || rgb->in % 16 ||
        rgb->h % TILE || rgb->w % TILE)
        return;
    both.out = (out + 15) / 16 * 16;
    winograd_plan(&e->joint, &both, p);
    nn_plan_layer(p, (struct nn_layer){e, narrow_end_update, NULL});
    e->weight = nn_plan_floats(p, both.out * both.in * 9);
    e->bias = nn_plan_floats(p, both.out);
    e->map = nn_plan_floats(p, rgb->batch * cells * both.out);
    e->cell = nn_plan_bytes(p, cells);
    e->tile = nn_plan_bytes(p, 2 * cells / (TILE * TILE));
    for (int i = 0; i < 2; i++)
        e->list[i] = nn_plan_bytes(p, cells / (TILE * TILE) *
                                      sizeof **e->list);
}

/* ---- what is seen -------------------------------------------------------- */

/* Whether one of the cell's pixels is covered: bits of numbers that are not
 * negative. */
static bool narrow_end_covered(const float *alpha, size_t stride)
{
    uint64_t bits = 0;

    for (size_t y = 0; y < CELL; y++, alpha += stride) {
        uint64_t row[CELL / 2];

        memcpy(row, alpha, sizeof row);
        bits |= row[0] | row[1];
    }
    return bits << 1 != 0;
}

/* Tiles with a cell that a covered pixel's field is made of: its own and
 * those about it. */
static void narrow_end_mark_cell(uint8_t *tile, const struct narrow_end *e,
                                 size_t y, size_t x)
{
    const size_t h = e->rgb->h, w = e->rgb->w, across = w / TILE;
    const size_t y0 = (y ? y - 1 : 0) / TILE, x0 = (x ? x - 1 : 0) / TILE;
    const size_t y1 = (y + 1 < h ? y + 1 : y) / TILE;
    const size_t x1 = (x + 1 < w ? x + 1 : x) / TILE;

    tile[y0 * across + x0] = tile[y0 * across + x1] = 1;
    tile[y1 * across + x0] = tile[y1 * across + x1] = 1;
}

/* e->cell, and the tiles that its cells want. */
static void narrow_end_mark(uint8_t *tile, struct narrow_end *e,
                            const float *alpha, size_t stride)
{
    const size_t h = e->rgb->h, w = e->rgb->w;

    memset(tile, 0, h / TILE * (w / TILE));
    for (size_t y = 0; y < h; y++)
        for (size_t x = 0; x < w; x++) {
            e->cell[y * w + x] = narrow_end_covered(
                alpha + CELL * (y * stride + x), stride);
            if (e->cell[y * w + x])
                narrow_end_mark_cell(tile, e, y, x);
        }
}

/* Each tile that is wanted wants the eight about it of the layer before. */
static void narrow_end_dilate(uint8_t *before, const uint8_t *tile,
                              size_t high, size_t across)
{
    for (size_t y = 0; y < high; y++)
        for (size_t x = 0; x < across; x++) {
            uint8_t any = 0;

            for (size_t v = y ? y - 1 : 0; v <= y + 1 && v < high; v++)
                for (size_t u = x ? x - 1 : 0; u <= x + 1 && u < across; u++)
                    any |= tile[v * across + u];
            before[y * across + x] = any;
        }
}

static size_t narrow_end_list(uint32_t *list, const uint8_t *tile, size_t n)
{
    size_t count = 0;

    for (size_t i = 0; i < n; i++)
        if (tile[i])
            list[count++] = (uint32_t)i;
    return count;
}

void narrow_end_set_coverage(struct narrow_end *e, struct conv *before,
                             const float *alpha, size_t stride)
{
    struct winograd *g = conv_winograd(before);

    if (!e->joint.u)
        return;
    e->some = alpha && e->joint.batch == 1;
    e->joint.list = NULL;
    if (g)
        g->list = NULL;
    if (!e->some)
        return;
    const size_t h = e->rgb->h, w = e->rgb->w, across = w / TILE;
    const size_t tiles = h / TILE * across;

    narrow_end_mark(e->tile, e, alpha, stride);
    e->joint.listed = narrow_end_list(e->list[0], e->tile, tiles);
    e->joint.list = e->list[0];
    if (!g)
        return;
    narrow_end_dilate(e->tile + tiles, e->tile, h / TILE, across);
    g->listed = narrow_end_list(e->list[1], e->tile + tiles, tiles);
    g->list = e->list[1];
}

/* ---- running ------------------------------------------------------------- */

/* rgb (4,4,3), rows `line` floats apart, += a cell's numbers. */
static void narrow_end_add(float *rgb, size_t line, const float *cell)
{
    for (size_t y = 0; y < CELL; y++, rgb += line, cell += 3 * CELL)
        for (size_t i = 0; i < 3 * CELL; i++)
            rgb[i] += cell[i];
}

/* One row. */
PARALLEL(narrow_end_forward_part, y, struct narrow_end *, e, float *, field,
         float *, rgb, size_t, w, size_t, out, size_t, said, size_t, own,
         size_t, line)
{
    for (size_t x = 0; x < w; x++) {
        const float *cell = e->map + (y * w + x) * out;

        if (said)
            memcpy(field + (y * w + x) * said, cell + own,
                   said * sizeof *field);
        if (e->some && !e->cell[y * w + x])
            continue;
        float colors[COLORS];

        if (own == 3)
            narrow_end_spread(colors, cell, e->max, 1);
        narrow_end_add(rgb + y * CELL * line + x * 3 * CELL, line,
                       own == 3 ? colors : cell);
    }
}

/* e->map into the picture and the field. */
static void narrow_end_put(float *rgb, float *field, struct narrow_end *e)
{
    const size_t w = e->rgb->w, rows = e->joint.batch * e->rgb->h;
    const size_t out = e->joint.out, own = e->rgb->out, line = 3 * CELL * w;
    const size_t said = e->field ? e->field->out : 0;

    parallel_each(narrow_end_forward_part, rows, 1, e, field, rgb, w, out, said,
                  own, line);
}

void narrow_end_forward(float *rgb, float *field, const float *before,
                        struct narrow_end *e)
{
    winograd_forward(e->map, before, &e->joint);
    narrow_end_put(rgb, field, e);
}

bool narrow_end_repeat(float *rgb, float *field, struct narrow_end *e,
                       const float *alpha, size_t stride)
{
    const size_t tiles = e->rgb->h / TILE * (e->rgb->w / TILE);
    uint8_t *wanted = e->tile + tiles;

    if (!e->some || !alpha)
        return false;
    narrow_end_mark(wanted, e, alpha, stride);
    for (size_t i = 0; i < tiles; i++)
        if (wanted[i] && !e->tile[i])
            return false;
    narrow_end_put(rgb, field, e);
    return true;
}
