/* The last hand on the mean head: places that are evened out, and small
 * touches.  It runs after directions, lids and weights were taken from the
 * unfinished surface, moves nothing by more than a few millimetres, and
 * leaves lips, lid margins and eyeballs alone. */
#include "lib/lab/head/sculpt_impl.h"

#include <stdlib.h>
#include <string.h>

/* Even out skin around c (radii r) towards its neighbours' mean, rounds
 * times.  Left half; what lies near the midline is smoothed across it. */
static const struct smooth {
    const char *name;
    double c[3], r[3];
    int rounds;
} smooths[] = {
    { "zygomatic arch", { 60, 13, 30 }, { 16, 15, 36 }, 24 },
    { "outer corner of the eye", { 50, 22, 62 }, { 9, 10, 13 }, 12 },
    { "lower lid", { 33, 10, 75 }, { 17, 6, 16 }, 5 },
    { "throat", { 8, -112, 42 }, { 22, 18, 18 }, 30 },
    { "chin", { 0, -86, 86 }, { 12, 16, 14 }, 5 },
    { "glabella", { 0, 42, 88 }, { 14, 14, 14 }, 5 },
    { "below the ear", { 64, -26, -8 }, { 14, 14, 20 }, 8 },
};

/* Move skin around c (radii r) by `out` mm along its normal and by v. */
static const struct touch {
    const char *name;
    double c[3], r[3], out, v[3];
} touches[] = {
    { "tear trough", { 31, 10.5, 76 }, { 13, 4.5, 14 }, 1.5, { 0 } },
    { "jaw edge, front", { 32, -82, 56 }, { 12, 9, 15 }, 1.6, { 0 } },
    { "jaw edge, middle", { 46, -67, 30 }, { 12, 10, 15 }, 2.4, { 0 } },
    { "jaw angle", { 56, -50, 8 }, { 12, 11, 13 }, 2.6, { 0 } },
    { "under the jaw, front", { 24, -99, 46 }, { 14, 8, 16 }, -2.0, { 0 } },
    { "under the jaw, middle", { 42, -85, 20 }, { 14, 9, 16 }, -3.0, { 0 } },
    { "below the jaw angle", { 53, -72, -10 }, { 14, 11, 15 }, -3.0, { 0 } },
    { "cheekbone", { 53, -1, 50 }, { 14, 8, 18 }, 1.4, { 0 } },
    { "hollow of the cheek", { 52, -27, 42 }, { 14, 11, 20 }, -1.4, { 0 } },
    { "parietal", { 46, 108, -8 }, { 34, 28, 55 }, 2.8, { 0 } },
    { "apex", { 0, 142, -15 }, { 36, 18, 45 }, -1.6, { 0 } },
    { "side of the neck", { 58, -108, -20 }, { 14, 26, 45 }, -2.0, { 0 } },
    { "nape", { 0, -72, -84 }, { 44, 26, 18 }, -2.8, { 0 } },
    { "rim of the nostril", { 7, -15, 103.5 }, { 5, 4, 4 }, 0,
      { 0, -1.8, 0 } },
};

/* exp(-|(p - c) / r|^2) */
static double sculpt_finish_bell(struct vec p, const double *c, const double *r)
{
    double x = (p.x - c[0]) / r[0], y = (p.y - c[1]) / r[1],
           z = (p.z - c[2]) / r[2];

    return exp(-(x * x + y * y + z * z));
}

/* Lips, lid margins and the ear's relief are authored to the point. */
static double sculpt_finish_freedom(const struct half *h, int v)
{
    int k = h->ring[v];

    switch (h->part[v]) {
    case PART_BALL: return 0;
    case PART_EYE: return k < 4 ? 1 : k == 4 ? 0.6 : k == 5 ? 0.3 : 0;
    case PART_MOUTH: return k < 3 ? 1 : 0;
    case PART_EAR: return 0;
    case PART_NOSTRIL: return 0;
    default: return 1;
    }
}

/* Vertices move to the mean of their neighbours, as far as they are not
 * held. */
static void sculpt_finish_even_out(struct half *h, struct vec *next,
                                   const int (*nbr)[2], size_t links,
                                   const struct smooth *t)
{
    double *weight = malloc((size_t)h->nv * sizeof *weight);

    for (int n = 0; weight && n < t->rounds; n++) {
        memset(next, 0, (size_t)h->nv * sizeof *next);
        memset(weight, 0, (size_t)h->nv * sizeof *weight);
        for (size_t i = 0; i < links; i++) {
            int a = nbr[i][0], b = nbr[i][1];
            double w = h->seam[a] && !h->seam[b] ? 2 : 1;
            next[a] = add(next[a], mul(h->p[b], w));
            weight[a] += w;
        }
        for (int v = 0; v < h->nv; v++) {
            double w = 0.5 * sculpt_finish_freedom(h, v)
                       * sculpt_finish_bell(h->p[v], t->c, t->r);
            if (weight[v] <= 0 || (h->part[v] == PART_GRID && !h->row[v]))
                continue;
            h->p[v] = lerp(h->p[v], mul(next[v], 1 / weight[v]), w);
            if (h->seam[v])
                h->p[v].x = 0;
        }
    }
    free(weight);
}

/* The nostrils' walls rise from their rims. */
static void sculpt_finish_nostrils(struct half *h)
{
    static const double up[NOS_RINGS + 1] = { 0, 2.0, 5.0, 8.0 };
    struct vec middle = vec(0, 0, 0);

    for (int i = 0; i < NOS_N; i++)
        middle = add(middle, mul(h->p[h->nostril[0][i]], 1.0 / NOS_N));
    for (int k = 1; k <= NOS_RINGS; k++)
        for (int i = 0; i < NOS_N; i++) {
            struct vec rim = h->p[h->nostril[0][i]];
            struct vec q = lerp(rim, middle, 0.14 * k);
            h->p[h->nostril[k][i]] = add(q, vec(0.1 * up[k], up[k],
                                                -0.45 * up[k]));
        }
    h->p[h->nostril_fill[1][1]] =
        add(middle, vec(0.9, up[NOS_RINGS] + 0.5, -0.5 * up[NOS_RINGS]));
}

int sculpt_finish(struct half *h)
{
    int (*nbr)[2] = malloc(8 * HALF_QUADS * sizeof *nbr);
    struct vec *next = malloc(HALF_VERTS * sizeof *next);
    size_t links = 0;

    if (!nbr || !next) {
        free(nbr);
        free(next);
        return -1;
    }
    for (int q = 0; q < h->nq; q++)     /* each edge of a quad, both ways */
        for (int i = 0, n = h->quad[q][3] < 0 ? 3 : 4; i < n; i++)
            for (int way = 0; way < 2; way++, links++) {
                nbr[links][way] = h->quad[q][i];
                nbr[links][!way] = h->quad[q][(i + 1) % n];
            }
    for (size_t i = 0; i < sizeof smooths / sizeof *smooths; i++)
        sculpt_finish_even_out(h, next, (const int (*)[2])nbr, links,
                               &smooths[i]);
    for (int v = 0; v < h->nv; v++) {
        double out = 0;
        struct vec d = vec(0, 0, 0);
        for (size_t i = 0; i < sizeof touches / sizeof *touches; i++) {
            const struct touch *t = &touches[i];
            double w = sculpt_finish_bell(h->p[v], t->c, t->r);
            out += w * t->out;
            d = add(d, vec(w * t->v[0], w * t->v[1], w * t->v[2]));
        }
        d = add(d, mul(unit(sculpt_surface_normal(h->p[v])), out));
        if (h->seam[v])
            d.x = 0;
        if (h->part[v] == PART_GRID && h->row[v] == 0)
            d.y = 0;
        next[v] = mul(d, sculpt_finish_freedom(h, v));
    }
    for (int v = 0; v < h->nv; v++)
        h->p[v] = add(h->p[v], next[v]);
    sculpt_finish_nostrils(h);
    free(nbr);
    free(next);
    return 0;
}
