/* Lips: eight authored loops from the skin over the vermilion into the mouth.
 * Each has a profile point on the midline and one at the corner; between them
 * it follows the dental arch. */
#include "lib/lab/head/sculpt_impl.h"

struct loop {
    double uy, uz;            /* upper, midline */
    double ly, lz;            /* lower, midline */
    double cx, cy, cz;        /* corner */
    double ubow, upow, lpow;  /* cupid's bow (mm), how height falls off */
};

static const struct loop loops[MOUTH_RINGS + 1] = {
    [3] = { -33.4, 96.0, -58.8, 89.4, 31.0, -45.8, 78.6, 0.5, 1.9, 2.2 },
    [LIP_SKIN] = { -35.7, 97.0, -56.2, 91.2, 28.6, -45.6, 80.2, 0.8, 1.7, 2.1 },
    [LIP_BORDER] =
          { -37.4, 97.8, -54.5, 93.0, 27.2, -45.4, 81.2, 1.0, 1.6, 2.0 },
    [6] = { -40.3, 98.3, -51.4, 95.4, 26.4, -45.3, 81.4, 0.5, 1.6, 2.0 },
    [7] = { -43.2, 97.4, -48.2, 96.2, 25.8, -45.2, 81.4, -0.3, 1.7, 1.9 },
    [8] = { -44.7, 95.2, -45.9, 94.9, 25.3, -45.1, 81.2, -0.5, 1.8, 1.8 },
    [LIP_INNER] =
          { -44.9, 92.5, -45.4, 92.3, 24.8, -45.1, 80.7, -0.4, 1.8, 1.8 },
    [10] = { -42.8, 88.0, -47.6, 87.6, 24.2, -45.1, 78.6, 0, 1.6, 1.6 },
    [11] = { -38.5, 86.0, -52.0, 85.5, 23.6, -45.2, 76.6, 0, 1.5, 1.5 },
};

/* A point of a lip loop: height and depth as functions of how far out it
 * is. */
static struct vec lips_loop_point(const struct loop *l, int j)
{
    bool upper = j <= MOUTH_CORNER;
    double s = (double)(upper ? j : MOUTH_N - j) / MOUTH_CORNER;
    double t = 0.55 * sin(s * M_PI / 2) + 0.45 * s;      /* x over width */
    double x = l->cx * t;
    double fall = 1 - pow(t, upper ? l->upow : l->lpow);
    double y = l->cy + ((upper ? l->uy : l->ly) - l->cy) * fall;
    double z = l->cz + ((upper ? l->uz : l->lz) - l->cz) * (1 - t * t);

    if (upper) {   /* two peaks beside the philtrum */
        double a = (x - 6) / 4.5;
        y += l->ubow * (exp(-a * a) - exp(-36 / 20.25) * (1 - fall));
    }
    return vec(x, y, z);
}

void sculpt_lips(struct half *h)
{
    for (int k = 3; k <= MOUTH_RINGS; k++)
        for (int j = 0; j <= MOUTH_N; j++) {
            int v = h->mouth[k][j];
            h->p[v] = lips_loop_point(&loops[k], j);
            h->hold[v] = k == 3 ? 0.6 : 1;
            h->snap[v] = 0;
        }
    for (int k = 1; k < 3; k++)
        for (int j = 0; j <= MOUTH_N; j++) {
            int v = h->mouth[k][j];
            h->p[v] = lerp(h->p[h->mouth[0][j]], h->p[h->mouth[3][j]],
                           k / 3.0);
            h->snap[v] = k == 1 ? 0.7 : 0.3;
        }
}
