/* The double-precision reference, second part: the Gaussians of a pixel front
 * to back, with the rules' cut-offs decided in double.  Lists by small tiles
 * only save the work that would come to nothing. */
#include "lib/splat/reference_traversal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define TILE 8            /* pixels, of the lists that save empty work */
#define TINY 1e-18        /* e^-sigma under which EXACT leaves a term out */

struct depth_key {
    double z;
    uint32_t i;
};

/* For qsort: by depth, ties by index. */
static int traversal_by_depth(const void *a, const void *b)
{
    const struct depth_key *p = a, *q = b;

    if (p->z != q->z)
        return p->z < q->z ? -1 : 1;
    return p->i < q->i ? -1 : p->i > q->i;
}

/* Range of list tiles along one axis that [c - r, c + r] touches. */
static void traversal_tile_range(uint16_t out[2], double c, double r, int tiles)
{
    double lo = floor((c - r - 0.5) / TILE), hi = ceil((c + r + 0.5) / TILE);

    out[0] = (uint16_t)fmin(fmax(lo, 0), tiles);
    out[1] = (uint16_t)fmin(fmax(hi, 0), tiles);
}

/* Tiles that Gaussian p of opacity o can reach, a little too many: columns
 * and rows [box[0],box[1]) [box[2],box[3]). */
static void traversal_bounds(uint16_t box[4], const struct reference_point *p,
                             double o, const struct reference *t, int tx,
                             int ty)
{
    double level = t->rules == SPLAT_EXACT
        ? -2 * log(TINY) : 2 * log(o / (t->alpha_cut * (1 - 1e-4)));

    memset(box, 0, 4 * sizeof *box);
    if (!p->front || !(level > 0))
        return;
    traversal_tile_range(box, p->x, sqrt(level * p->cov[0]), tx);
    traversal_tile_range(box + 2, p->y, sqrt(level * p->cov[2]), ty);
}

/* Tile lists in depth order: count, sum up, fill. */
static int traversal_fill_lists(struct traversal *w, const struct reference *t,
                                const struct depth_key *key, struct error *err)
{
    size_t tiles = (size_t)w->tx * (size_t)w->ty, total = 0;
    uint16_t (*box)[4] = malloc((t->n + 1) * sizeof *box);

    w->start = calloc(tiles + 2, sizeof *w->start);
    if (!box || !w->start) {
        free(box);
        return error_set(err, EX_OSERR, "out of memory");
    }
    for (int pass = 0; pass < 2; pass++) {
        for (size_t k = 0; k < t->n; k++) {
            uint32_t i = key[k].i;

            if (!pass)
                traversal_bounds(box[i], &w->point[i], t->opacity[i], t, w->tx,
                                 w->ty);
            for (size_t y = box[i][2]; y < box[i][3]; y++)
                for (size_t x = box[i][0]; x < box[i][1]; x++) {
                    size_t at = y * (size_t)w->tx + x;

                    if (pass)
                        w->list[w->start[at + 1]++] = i;
                    else
                        w->start[at + 2]++;
                }
        }
        for (size_t a = 2; !pass && a < tiles + 2; a++)
            w->start[a] = total += w->start[a];
        if (!pass && !(w->list = malloc((total + 1) * sizeof *w->list))) {
            free(box);
            return error_set(err, EX_OSERR, "out of memory");
        }
    }
    free(box);
    return 0;
}

int traversal_init(struct traversal *w, const struct reference *t,
                   struct error *err)
{
    struct depth_key *key = malloc((t->n + 1) * sizeof *key);
    int rc = -1;

    memset(w, 0, sizeof *w);
    w->scene = t;
    w->tx = (t->width + TILE - 1) / TILE;
    w->ty = (t->height + TILE - 1) / TILE;
    w->point = malloc((t->n + 1) * sizeof *w->point);
    if (!key || !w->point) {
        error_set(err, EX_OSERR, "out of memory");
        goto out;
    }
    for (size_t i = 0; i < t->n; i++) {
        reference_project(&w->point[i], t, i);
        key[i].z = w->point[i].z;
        key[i].i = (uint32_t)i;
    }
    if (t->order)
        for (size_t i = 0; i < t->n; i++)
            key[i].i = t->order[i];
    else
        qsort(key, t->n, sizeof *key, traversal_by_depth);
    rc = traversal_fill_lists(w, t, key, err);
out:
    free(key);
    if (rc)
        traversal_release(w);
    return rc;
}

void traversal_release(struct traversal *w)
{
    free(w->point);
    free(w->start);
    free(w->list);
    memset(w, 0, sizeof *w);
}

/* Entries of the list that serves pixel (x,y). */
static size_t traversal_tile(const struct traversal *w, int x, int y,
                             const uint32_t **list)
{
    size_t at = (size_t)(y / TILE) * (size_t)w->tx + (size_t)(x / TILE);

    *list = w->list + w->start[at];
    return w->start[at + 1] - w->start[at];
}

/* Could rounding have decided a < b the other way? */
static bool traversal_near(double a, double b)
{
    return fabs(a - b) <= 1e-5 * fabs(b);
}

/* Does DGR's choice of whole tiles leave this pixel to the Gaussian? */
static bool traversal_tile_has(const struct reference_point *p, int x, int y)
{
    return x / 16 >= p->tile[0] && x / 16 < p->tile[1] &&
           y / 16 >= p->tile[2] && y / 16 < p->tile[3];
}

size_t traversal_pixel(struct contribution *found, double *T_final,
                       uint8_t *ambiguous, const struct traversal *w, int x,
                       int y)
{
    const struct reference *t = w->scene;
    const uint32_t *list;
    size_t n = traversal_tile(w, x, y, &list), count = 0;
    double T = 1;

    for (size_t k = 0; k < n; k++) {
        const struct reference_point *p = &w->point[list[k]];
        struct contribution h = {.i = list[k], .T = T};

        h.dx = p->x - (x + 0.5);
        h.dy = p->y - (y + 0.5);
        double sigma = 0.5 * (p->conic[0] * h.dx * h.dx +
                              p->conic[2] * h.dy * h.dy) +
                       p->conic[1] * h.dx * h.dy;

        h.falloff = exp(-sigma);
        h.alpha = t->opacity[h.i] * h.falloff;
        if (t->rules == SPLAT_EXACT) {
            if (h.falloff < TINY)
                continue;
        } else {
            if (t->rules == SPLAT_DGR && !traversal_tile_has(p, x, y))
                continue;
            if (ambiguous && traversal_near(h.alpha, t->alpha_cut))
                *ambiguous = 1;
            if (sigma < 0 || h.alpha < t->alpha_cut)
                continue;
            h.clamped = h.alpha > 0.99;
            if (h.clamped)
                h.alpha = 0.99;
            double next = T * (1 - h.alpha);

            if (ambiguous && traversal_near(next, t->t_cut))
                *ambiguous = 1;
            if (t->rules == SPLAT_DGR ? next < t->t_cut : next <= t->t_cut)
                break;
        }
        T *= 1 - h.alpha;
        found[count++] = h;
    }
    *T_final = T;
    return count;
}

size_t traversal_longest(const struct traversal *w)
{
    size_t max = 0;

    for (size_t a = 0; a < (size_t)w->tx * (size_t)w->ty; a++)
        if (w->start[a + 1] - w->start[a] > max)
            max = w->start[a + 1] - w->start[a];
    return max;
}
