/* A person beyond the edges of their photograph.  Each edge is a line of
 * pixels, and what lies beyond it is that line again, moved along itself by an
 * outline (widening, falling, a dome) and blurred with the distance. */
#include "lib/photo/beyond.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#define BEYOND_WIDENS 0.25      /* of a body, to each side, by row below */
#define BEYOND_FALLS 0.5        /* of shoulders, by column to the side */
#define BEYOND_DOME 0.35        /* a dome's height, in widths of the cut */
#define BEYOND_SIDE 0.12        /* of a head's cut is hair, at each end */
#define BEYOND_BLUR 0.25        /* reach of the mean, by distance */

/* The picture's part of the window: columns x[0] to x[1], rows y[0] to y[1],
 * the ends not included. */
struct beyond_rectangle {
    size_t x[2], y[2];
};

/* One edge of the picture, as steps in pixels of the window. */
struct beyond_edge {
    size_t first;               /* the pixel at its start, a line within the
                                 * picture's last: that may be a dark rim */
    ptrdiff_t along, outward;
    size_t length;              /* pixels along */
    size_t depth;               /* lines beyond it, to the window's border */
};

/* Part of an edge where the person leaves the picture: [begin, end). */
struct beyond_run {
    size_t begin, end;
};

/* Pixel i of the edge's line. */
static size_t beyond_at(const struct beyond_edge *e, size_t i)
{
    return (size_t)((ptrdiff_t)e->first + (ptrdiff_t)i * e->along);
}

/* The pixel d lines beyond the picture (from 1) at i along it. */
static size_t beyond_outside(const struct beyond_edge *e, size_t i, size_t d)
{
    return (size_t)((ptrdiff_t)beyond_at(e, i) +
                    (ptrdiff_t)(d + 1) * e->outward);
}

/* The matte of the edge's line between its pixels, 0 to 255. */
static double beyond_matte(const struct beyond_edge *e, const struct person *p,
                           double at)
{
    if (!(at >= 0 && at <= (double)(e->length - 1)))
        return 0;
    const size_t i = (size_t)at, j = i + 1 < e->length ? i + 1 : i;
    const double t = at - (double)i;

    return (1 - t) * p->matte[beyond_at(e, i)] + t * p->matte[beyond_at(e, j)];
}

/* The person's mean colour on the edge's line, `reach` pixels to both sides. */
static void beyond_colour(double colour[3], const struct beyond_edge *e,
                          const struct person *p, double at, double reach)
{
    const double last = (double)(e->length - 1);
    const size_t lo = (size_t)fmax(round(at - reach), 0);
    const size_t hi = (size_t)fmin(round(at + reach), last);
    double weight = 1e-9;

    memset(colour, 0, 3 * sizeof *colour);
    for (size_t i = lo; i <= hi; i++) {
        const size_t q = beyond_at(e, i);

        weight += p->matte[q];
        for (size_t c = 0; c < 3; c++)
            colour[c] += p->matte[q] * (double)p->rgb[3 * q + c];
    }
    for (size_t c = 0; c < 3; c++)
        colour[c] /= weight;
}

/* The next run of the person from *r's end on; false when there is none. */
static bool beyond_next_run(struct beyond_run *r, const struct beyond_edge *e,
                            const struct person *p)
{
    size_t i = r->end;

    while (i < e->length && p->matte[beyond_at(e, i)] < 128)
        i++;
    r->begin = i;
    while (i < e->length && p->matte[beyond_at(e, i)] >= 128)
        i++;
    r->end = i;
    return r->begin < r->end;
}

/* Pixel (i,d) beyond the edge is what its line has at `at`, with `share` of
 * another colour. */
static void beyond_put(struct person *p, const struct beyond_edge *e, size_t i,
                       size_t d, double at, const double *other, double share)
{
    const size_t q = beyond_outside(e, i, d);
    const double m = beyond_matte(e, p, at) / 255;
    double colour[3];

    if (m <= 0)
        return;
    beyond_colour(colour, e, p, at, BEYOND_BLUR * (double)d);
    for (size_t c = 0; c < 3; c++) {
        const double person = (1 - share) * colour[c] + share * other[c];
        const double back = p->back[3 * q + c];

        p->rgb[3 * q + c] = (uint8_t)lrint(m * person + (1 - m) * back);
    }
    p->matte[q] = (uint8_t)lrint(255 * m);
}

/* A body below the picture: as wide as it left it, and widening. */
static void beyond_body(struct person *p, const struct beyond_edge *e)
{
    struct beyond_run r = {0, 0}, all = {e->length, 0};

    while (beyond_next_run(&r, e, p)) {
        all.begin = r.begin < all.begin ? r.begin : all.begin;
        all.end = r.end;
    }
    if (!(all.begin < all.end))
        return;
    const double middle = 0.5 * (double)(all.begin + all.end - 1);
    const double width = (double)(all.end - all.begin);

    for (size_t d = 1; d <= e->depth; d++) {
        const double wider = width + 2 * BEYOND_WIDENS * (double)d;

        for (size_t i = 0; i < e->length; i++) {
            const double at = middle + ((double)i - middle) * width / wider;

            beyond_put(p, e, i, d, at, (double[3]){0}, 0);
        }
    }
}

/* Shoulders beside the picture: their outline falls. */
static void beyond_shoulder(struct person *p, const struct beyond_edge *e,
                            struct beyond_run r)
{
    for (size_t d = 1; d <= e->depth; d++)
        for (size_t i = r.begin; i < e->length; i++) {
            const double at = (double)i - BEYOND_FALLS * (double)d;

            if (at > (double)r.begin - 2)
                beyond_put(p, e, i, d, at, (double[3]){0}, 0);
        }
}

/* What the ends of a run have: beside a cut forehead that is the hair. */
static void beyond_sides(double colour[3], const struct person *p,
                         const struct beyond_edge *e, struct beyond_run r)
{
    const double width = (double)(r.end - r.begin), reach = BEYOND_SIDE * width;
    double end[2][3];

    beyond_colour(end[0], e, p, (double)r.begin + 0.5 * reach, 0.5 * reach);
    beyond_colour(end[1], e, p, (double)r.end - 1 - 0.5 * reach, 0.5 * reach);
    for (size_t c = 0; c < 3; c++)
        colour[c] = 0.5 * (end[0][c] + end[1][c]);
}

/* A head that the edge cuts: half an ellipse, which turns into `other` by its
 * middle (NULL: keeps the edge's colours). */
static void beyond_dome(struct person *p, const struct beyond_edge *e,
                        struct beyond_run r, const double *other)
{
    const double middle = 0.5 * (double)(r.begin + r.end - 1);
    const double height = BEYOND_DOME * (double)(r.end - r.begin);
    const double half = 0.5 * (double)(r.end - r.begin) + 1;

    for (size_t d = 1; d <= e->depth && (double)d < height; d++) {
        const double t = (double)d / height, narrow = sqrt(1 - t * t);
        const double share = other ? fmin(2 * t, 1) : 0;

        for (size_t i = r.begin; i < r.end; i++) {
            const double from = ((double)i - middle) / narrow;

            if (fabs(from) < half)
                beyond_put(p, e, i, d, middle + from,
                           other ? other : (double[3]){0}, share);
        }
    }
}

/* To a side: runs that leave the picture below too are shoulders. */
static void beyond_extend_side(struct person *p, const struct beyond_edge *e)
{
    struct beyond_run r = {0, 0};

    while (beyond_next_run(&r, e, p))
        if (r.end == e->length)
            beyond_shoulder(p, e, r);
        else
            beyond_dome(p, e, r, NULL);
}

/* Above the picture: heads. */
static void beyond_above(struct person *p, const struct beyond_edge *e)
{
    struct beyond_run r = {0, 0};
    double hair[3];

    while (beyond_next_run(&r, e, p)) {
        beyond_sides(hair, p, e, r);
        beyond_dome(p, e, r, hair);
    }
}

/* The picture's rectangle; false where the window shows less than two lines
 * of it. */
static bool beyond_rectangle(struct beyond_rectangle *q, const uint8_t *inside,
                             size_t n)
{
    *q = (struct beyond_rectangle){{n, 0}, {n, 0}};
    for (size_t y = 0; y < n; y++) {
        const uint8_t *row = inside + y * n, *x = memchr(row, 255, n);

        if (!x)
            continue;
        q->y[0] = y < q->y[0] ? y : q->y[0];
        q->y[1] = y + 1;
        q->x[0] = (size_t)(x - row);
        q->x[1] = q->x[0];
        while (q->x[1] < n && row[q->x[1]])
            q->x[1]++;
    }
    return q->x[0] + 1 < q->x[1] && q->y[0] + 1 < q->y[1];
}

/* Outside of the picture there is the background alone. */
static void beyond_empty(struct person *p, const uint8_t *inside)
{
    for (size_t i = 0; i < p->size * p->size; i++) {
        if (inside[i])
            continue;
        p->matte[i] = 0;
        memcpy(p->rgb + 3 * i, p->back + 3 * i, 3);
    }
}

void beyond_continue(struct person *p, const uint8_t *inside)
{
    const size_t n = p->size;
    const ptrdiff_t row = (ptrdiff_t)n;
    struct beyond_rectangle q;

    beyond_empty(p, inside);
    if (!beyond_rectangle(&q, inside, n))
        return;
    const size_t rows = q.y[1] - q.y[0], top = q.y[0] * n;

    /* the sides first: the lines below and above go across the window */
    const struct beyond_edge left = {top + q.x[0] + 1, row, -1, rows, q.x[0]};
    const struct beyond_edge right = {top + q.x[1] - 2, row, 1, rows,
                                      n - q.x[1]};
    const struct beyond_edge above = {top + n, 1, -row, n, q.y[0]};
    const struct beyond_edge below = {(q.y[1] - 2) * n, 1, row, n,
                                      n - q.y[1]};

    beyond_extend_side(p, &left);
    beyond_extend_side(p, &right);
    beyond_above(p, &above);
    beyond_body(p, &below);
}
