/* The 300 identity directions: named proportions first, then smooth surface
 * modes of falling wavelength. */
#include "lib/lab/head/sculpt_field.h"

#include <stdlib.h>
#include <string.h>

enum { DIRS = SCULPT_SHAPES + SCULPT_EXPRESSIONS, MOST = 4 };

/* A proportion: pulls on both halves, or a stretch of the whole head. */
struct proportion {
    const char *name;           /* of the row, for who reads the table */
    struct vec stretch;         /* mm per mm from (0, 0, 0) */
    struct pull pull[MOST];
};

static const struct proportion named[] = {
    { "size", { .04, .04, .04 }, { { { 0, 0, 0 }, { 0, 0, 0 }, 0, 0 } } },
    { "wide", { .07, -.01, 0 }, { { { 0, 0, 0 }, { 0, 0, 0 }, 0, 0 } } },
    { "long", { 0, .07, 0 }, { { { 0, 0, 0 }, { 0, 0, 0 }, 0, 0 } } },
    /* no "deep": size, wide and long already span every stretch */
    { "temples", { 0, 0, 0 },
      { { { 62, 48, 45 }, { 5, 0, 0 }, 26, 0 } } },
    { "jaw width", { 0, 0, 0 },
      { { { 60, -52, 25 }, { 6, 0, 0 }, 30, 0 } } },
    { "jaw length", { 0, 0, 0 },
      { { { 0, -90, 75 }, { 0, -6, 1 }, 34, 0 },
        { { 45, -65, 45 }, { 0, -4, 0 }, 28, 0 } } },
    { "chin", { 0, 0, 0 },
      { { { 0, -84, 90 }, { 0, 0, 6 }, 20, 0 } } },
    { "chin width", { 0, 0, 0 },
      { { { 20, -84, 78 }, { 5, 0, 0 }, 15, 0 } } },
    { "nose length", { 0, 0, 0 },
      { { { 0, -12, 110 }, { 0, -4, 2 }, 14, 0 } } },
    { "nose tip", { 0, 0, 0 },
      { { { 0, -8, 114 }, { 0, 1, 5 }, 12, 0 } } },
    { "nose width", { 0, 0, 0 },
      { { { 16, -18, 98 }, { 4, 0, 0 }, 10, 0 } } },
    { "nose bridge", { 0, 0, 0 },
      { { { 0, 12, 101 }, { 0, 0, 4 }, 12, 0 } } },
    { "brow ridge", { 0, 0, 0 },
      { { { 22, 40, 90 }, { 0, -1, 4 }, 17, 0 } } },
    { "forehead", { 0, 0, 0 },
      { { { 0, 75, 85 }, { 0, 2, 6 }, 30, 0 } } },
    { "cheekbones", { 0, 0, 0 },
      { { { 55, 0, 60 }, { 4, 0, 2 }, 20, 0 } } },
    { "cheeks", { 0, 0, 0 },
      { { { 50, -40, 55 }, { 6, 0, 2 }, 24, 0 } } },
    { "eye spacing", { 0, 0, 0 },
      { { { 31.5, 25, 80 }, { 3, 0, 0 }, 24, 0 } } },
    { "eye height", { 0, 0, 0 },
      { { { 31.5, 27, 80 }, { 0, 4, 0 }, 24, 0 } } },
    { "mouth width", { 0, 0, 0 },
      { { { 26, -45, 82 }, { 4, 0, -1 }, 13, 0 } } },
    { "upper lip", { 0, 0, 0 },
      { { { 0, -39, 98 }, { 0, 0, 3 }, 13, LIP_UPPER } } },
    { "lower lip", { 0, 0, 0 },
      { { { 0, -52, 95 }, { 0, 0, 3 }, 13, LIP_LOWER } } },
    { "mouth height", { 0, 0, 0 },
      { { { 0, -46, 92 }, { 0, 4, 0 }, 22, 0 } } },
    { "ears out", { 0, 0, 0 },
      { { { 82, 10, -2 }, { 6, 0, 0 }, 18, 0 } } },
    { "ear size", { 0, 0, 0 },
      { { { 80, 36, -8 }, { 1, 5, 0 }, 14, 0 },
        { { 78, -16, 0 }, { 0, -4, 0 }, 12, 0 } } },
    { "crown", { 0, 0, 0 },
      { { { 0, 130, -10 }, { 0, 8, 0 }, 50, 0 } } },
    { "back of the head", { 0, 0, 0 },
      { { { 0, 30, -95 }, { 0, 0, -8 }, 48, 0 } } },
    { "neck width", { 0, 0, 0 },
      { { { 52, -120, -10 }, { 8, 0, 2 }, 38, 0 } } },
    { "nose to one side", { 0, 0, 0 },
      { { { 0, -8, 110 }, { 3, 0, 0 }, 13, 0 } } },
    { "jaw to one side", { 0, 0, 0 },
      { { { 0, -85, 75 }, { 4, 0, 0 }, 30, 0 } } },
};
enum { NAMED = sizeof named / sizeof *named };

/* A named direction: stretching, and pulls at places of the face. */
static void shape_proportion(struct vec *d, const struct full *m,
                             const struct proportion *p)
{
    int lopsided = p - named >= NAMED - 2;

    for (int v = 0; v < m->nv; v++) {
        struct vec q = m->p[v];
        d[v] = vec(q.x * p->stretch.x, q.y * p->stretch.y,
                   q.z * p->stretch.z);
    }
    for (int k = 0; k < MOST; k++)
        if (p->pull[k].reach > 0)
            field_pull(d, m, &p->pull[k], lopsided ? SIDE_LEFT : SIDE_BOTH,
                       1);
}

/* How far the most moved point of direction k goes, mm. */
static double shape_extent(size_t k, double wave)
{
    return k < NAMED ? (k < 3 ? 5.5 : 3.2) : 1.7 * wave * wave / (170. * 170);
}

int sculpt_shapes(struct sculpt *s, const struct full *m)
{
    struct vec *d = malloc((size_t)m->nv * sizeof *d);

    if (!d)
        return -1;
    for (size_t k = 0; k < SCULPT_SHAPES; k++) {
        double wave = 34 + 136 * exp(-(double)(k - NAMED) / 110);
        memset(d, 0, (size_t)m->nv * sizeof *d);
        if (k < NAMED)
            shape_proportion(d, m, &named[k]);
        else
            field_wave(d, m, k, wave, k % 5 == 4);
        field_settle_eyes(d, m);
        field_store(s->shapedirs, DIRS, 0, k, d, s->nv, shape_extent(k, wave));
    }
    free(d);
    return field_sort(s->shapedirs, DIRS, 0, SCULPT_SHAPES, s->nv);
}
