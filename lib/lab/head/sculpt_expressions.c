/* The 100 expression directions: what a face does by name first, then smooth
 * modes of the face. */
#include "lib/lab/head/sculpt_field.h"

#include <stdlib.h>
#include <string.h>

enum { DIRS = SCULPT_SHAPES + SCULPT_EXPRESSIONS, MOST = 6 };

struct action {
    const char *name;           /* of the row, for who reads the table */
    enum half_side side;
    struct pull pull[MOST];
};

#define SMILE \
    { { { 27, -45, 82 }, { 5.5, 5.5, -3.5 }, 10, LIP_BOTH }, \
      { { 16, -42, 94 }, { 2.0, 1.5, -1.5 }, 9, LIP_BOTH }, \
      { { 44, -18, 76 }, { 2.5, 4.0, 3.0 }, 15, LIP_BOTH }, \
      { { 32, 12, 82 }, { 0, 1.2, 0.5 }, 8, LIP_BOTH } }
#define STRETCH \
    { { { 27, -46, 82 }, { 6, -1.5, -4 }, 12, LIP_BOTH }, \
      { { 48, -48, 60 }, { 1.5, -1, 0 }, 18, LIP_BOTH } }
#define BROW_UP \
    { { { 40, 43, 80 }, { 0, 6, 0 }, 12, LIP_BOTH }, \
      { { 20, 46, 90 }, { 0, 4, 0 }, 11, LIP_BOTH }, \
      { { 30, 34, 82 }, { 0, 2, 0 }, 7, LIP_BOTH } }
#define SNEER \
    { { { 14, -20, 97 }, { 1, 3.5, 0 }, 8, LIP_BOTH }, \
      { { 13, -38, 97 }, { 0.5, 4, 0 }, 8, LIP_UPPER }, \
      { { 10, 4, 98 }, { -1, 1.5, 0 }, 8, LIP_BOTH } }
#define SQUINT \
    { { { 32, 13, 82 }, { 0, 3.5, 1 }, 9, LIP_BOTH }, \
      { { 46, 18, 72 }, { -1, 1.5, 0.5 }, 10, LIP_BOTH } }

static const struct action named[] = {
    { "smile left", SIDE_LEFT, SMILE },
    { "smile right", SIDE_RIGHT, SMILE },
    { "frown", SIDE_BOTH,
      { { { 27, -46, 82 }, { 0, -6, -1 }, 11, LIP_BOTH },
        { { 30, -62, 78 }, { 0, -2, 0 }, 12, LIP_BOTH } } },
    { "pucker", SIDE_BOTH,
      { { { 26, -45, 82 }, { -8, 0, 6 }, 9, LIP_BOTH },
        { { 10, -45, 96 }, { -2, 0, 5 }, 10, LIP_BOTH } } },
    { "funnel", SIDE_BOTH,
      { { { 25, -45, 83 }, { -5, 0, 4 }, 9, LIP_BOTH },
        { { 0, -40, 98 }, { 0, 2.2, 2.5 }, 10, LIP_UPPER },
        { { 0, -51, 95 }, { 0, -3, 2.5 }, 10, LIP_LOWER } } },
    { "brow up left", SIDE_LEFT, BROW_UP },
    { "brow up right", SIDE_RIGHT, BROW_UP },
    { "brow down", SIDE_BOTH,
      { { { 18, 42, 91 }, { -3, -5, 1 }, 11, LIP_BOTH },
        { { 38, 43, 81 }, { -1, -3, 0 }, 12, LIP_BOTH } } },
    { "brow inner up", SIDE_BOTH,
      { { { 14, 44, 91 }, { -1, 6, 0 }, 10, LIP_BOTH },
        { { 44, 42, 76 }, { 0, -1.5, 0 }, 11, LIP_BOTH } } },
    { "cheek puff", SIDE_BOTH,
      { { { 46, -42, 68 }, { 5, 0, 5 }, 16, LIP_BOTH } } },
    { "cheek suck", SIDE_BOTH,
      { { { 46, -38, 66 }, { -4.5, 0, -3 }, 15, LIP_BOTH } } },
    { "nostril flare", SIDE_BOTH,
      { { { 15, -19, 97 }, { 2.6, 0.6, 0 }, 6, LIP_BOTH } } },
    { "sneer left", SIDE_LEFT, SNEER },
    { "sneer right", SIDE_RIGHT, SNEER },
    { "lip press", SIDE_BOTH,
      { { { 0, -41, 98 }, { 0, -1.5, -2 }, 12, LIP_UPPER },
        { { 0, -50, 95 }, { 0, 1.2, -2 }, 12, LIP_LOWER } } },
    { "upper lip raise", SIDE_BOTH,
      { { { 8, -40, 98 }, { 0, 4, 0.5 }, 11, LIP_UPPER } } },
    { "lower lip depress", SIDE_BOTH,
      { { { 8, -50, 95 }, { 0, -5, 0.5 }, 11, LIP_LOWER } } },
    { "lower lip bite", SIDE_BOTH,
      { { { 0, -51, 95 }, { 0, 0.5, -5 }, 12, LIP_LOWER } } },
    { "chin raise", SIDE_BOTH,
      { { { 0, -76, 93 }, { 0, 4, 2 }, 12, LIP_BOTH },
        { { 0, -52, 95 }, { 0, 1.5, 2.5 }, 10, LIP_LOWER },
        { { 0, -42, 97 }, { 0, 1.5, 1 }, 10, LIP_UPPER } } },
    { "stretch left", SIDE_LEFT, STRETCH },
    { "stretch right", SIDE_RIGHT, STRETCH },
    { "squint left", SIDE_LEFT, SQUINT },
    { "squint right", SIDE_RIGHT, SQUINT },
    { "mouth to the left", SIDE_LEFT,
      { { { 0, -46, 94 }, { 6, 0, -0.5 }, 22, LIP_BOTH } } },
    { "jaw forward", SIDE_LEFT,
      { { { 0, -75, 88 }, { 0, 0, 5 }, 26, LIP_LOWER } } },
    { "wide eyes", SIDE_BOTH,
      { { { 31, 36, 81 }, { 0, 2.2, 0 }, 7, LIP_BOTH },
        { { 32, 14, 81 }, { 0, -1, 0 }, 7, LIP_BOTH } } },
    { "upper lip out", SIDE_BOTH,
      { { { 0, -40, 98 }, { 0, 0.5, 3.5 }, 12, LIP_UPPER } } },
    { "lower lip out", SIDE_BOTH,
      { { { 0, -51, 95 }, { 0, -0.5, 3.5 }, 12, LIP_LOWER } } },
};
enum { NAMED = sizeof named / sizeof *named };

static void expression_store(float *dirs, size_t k,
                             const struct vec *d, size_t nv)
{
    for (size_t v = 0; v < nv; v++) {
        dirs[(3 * v) * DIRS + k] = (float)(1e-3 * d[v].x);
        dirs[(3 * v + 1) * DIRS + k] = (float)(1e-3 * d[v].y);
        dirs[(3 * v + 2) * DIRS + k] = (float)(1e-3 * d[v].z);
    }
}

/* The mobile face: 1 at mouth and brows, 0 at cranium, ears, eyes. */
static double expression_face_mobility(const struct full *m, int v)
{
    struct vec p = m->p[v], e = EYE_CENTRE;
    int part = m->h->part[m->src[v]];

    e.x *= m->side[v] < 0 ? -1 : 1;
    if (part == PART_BALL || part == PART_EAR)
        return 0;
    return ramp(35, 60, p.z) * ramp(70, 50, p.y) * ramp(-105, -85, p.y) *
           ramp(14, 26, norm(sub(p, e)));
}

int sculpt_expressions(struct sculpt *s, const struct full *m)
{
    struct vec *d = malloc((size_t)m->nv * sizeof *d);

    if (!d)
        return -1;
    for (size_t k = 0; k < SCULPT_EXPRESSIONS; k++) {
        memset(d, 0, (size_t)m->nv * sizeof *d);
        if (k < NAMED) {
            for (int i = 0; i < MOST; i++)
                if (named[k].pull[i].reach > 0)
                    field_pull(d, m, &named[k].pull[i], named[k].side, 1);
            expression_store(s->shapedirs, SCULPT_SHAPES + k, d,
                             s->nv);
            continue;
        }
        field_wave(d, m, 1000 + k, 90 - 0.6 * (double)(k - NAMED), k % 3 == 2);
        for (int v = 0; v < m->nv; v++)
            d[v] = mul(d[v], expression_face_mobility(m, v));
        field_store(s->shapedirs, DIRS, SCULPT_SHAPES, SCULPT_SHAPES + k, d,
                    s->nv, 1.6 / (1 + 0.02 * (double)(k - NAMED)));
    }
    free(d);
    return 0;
}
