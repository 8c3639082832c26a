/* Regions, hair, texture coordinates, lip lists and landmarks of the head. */
#include "lib/lab/head/sculpt_impl.h"

/* By the part a vertex belongs to, and on the skin by where it lies. */
static int sculpt_label_region(const struct full *m, int v)
{
    const struct half *h = m->h;
    int s = m->src[v], part = h->part[s], ring = h->ring[s];
    struct vec p = m->p[v];
    double x = fabs(p.x);

    if (part == PART_BALL)
        return REGION_EYEBALL;
    if (part == PART_EYE && ring >= 3)
        return REGION_EYELID;
    if (part == PART_MOUTH && ring > LIP_INNER)
        return REGION_INNER_MOUTH;
    if (part == PART_MOUTH && ring >= LIP_BORDER)
        return REGION_LIPS;
    if (part == PART_EAR && ring >= 2)
        return REGION_EAR;
    if (part == PART_NOSTRIL ||
        (x < 19 && p.y > -28 && p.y < 14 && p.z > 88))
        return REGION_NOSE;
    if (p.y > 35 && p.y < 50 && x > 9 && x < 54 && p.z > 60)
        return REGION_BROW;
    if (p.y < -60 - 0.9 * fmax(0, p.z) + 0.2 * x && p.z < 75)
        return REGION_NECK;
    if (p.y < -108)
        return REGION_NECK;
    return p.z > 15 && p.y < 84 ? REGION_FACE : REGION_SKIN;
}

/* Density behind a hairline that runs over the forehead, past the temples,
 * round the ears and down to the nape. */
static double sculpt_label_hair(const struct full *m, int v)
{
    struct vec p = m->p[v];
    int part = m->h->part[m->src[v]];

    if (part != PART_GRID && part != PART_CAP)
        return 0;
    double front = ramp(80, 94, p.y + 0.25 * fmax(0, fabs(p.x) - 35));
    double side = ramp(34, 20, p.z) * ramp(6, 22, p.y);
    double back = ramp(-12, -30, p.z) * ramp(-72, -52, p.y);
    return fmax(front, fmax(side, back));
}

/* A ring of the mouth as one list, both halves of it. */
static void sculpt_label_lips(int32_t *list, size_t *n, const struct full *m,
                              int ring, int last, int closed)
{
    const struct half *h = m->h;

    *n = 0;
    /* subject's left corner first, over the midline to the right */
    for (int j = last; j >= 0; j--)
        list[(*n)++] = h->mouth[ring][j];
    for (int j = 1; j <= last - closed; j++)
        list[(*n)++] = m->mirror[h->mouth[ring][j]];
}

/* ---- landmarks ----------------------------------------------------------- */

/* The vertex nearest to q among those of these parts (bits). */
static int sculpt_label_nearest(const struct full *m, struct vec q, int parts)
{
    int best = 0;

    for (int v = 1; v < m->nv; v++) {
        if (!(parts >> m->h->part[m->src[v]] & 1))
            continue;
        if (norm(sub(m->p[v], q)) < norm(sub(m->p[best], q)))
            best = v;
    }
    return best;
}

/* Left-side targets (x > 0), mm; mirrored for the right side. */
static const struct vec jaw[8] = {      /* below the ear to beside the chin */
    { 69, 22, 8 }, { 69, 0, 10 }, { 67, -20, 14 }, { 64, -38, 20 },
    { 58, -56, 32 }, { 49, -71, 46 }, { 36, -84, 62 }, { 19, -92, 74 } };
static const struct vec brow[5] = {     /* inner to outer */
    { 11, 40, 92 }, { 20, 45, 91 }, { 30, 46.5, 87 }, { 40, 44, 80 },
    { 50, 38, 68 } };

/* Landmark k at vertex v: the corner of any of its faces. */
static void sculpt_label_set(struct sculpt *s, int k, int v)
{
    for (size_t i = 0; i < s->nf; i++)
        for (int c = 0; c < 3; c++)
            if (s->f[3 * i + (size_t)c] == v) {
                s->landmark_face[k] = (int32_t)i;
                s->landmark_bary[3 * k + c] = 1;
                return;
            }
}

/* Two landmarks that mirror each other. */
static void sculpt_label_pair(struct sculpt *s, const struct full *m, int left,
                              int right, int v)
{
    sculpt_label_set(s, left, v);
    sculpt_label_set(s, right, m->mirror[v]);
}

/* The lid margin's vertex nearest to a place along the eye, t from the inner
 * corner (0) to the outer (1), upper or lower. */
static int sculpt_label_lid(const struct half *h, double t, bool upper)
{
    const int *ring = h->eye[EYE_MARGIN];
    double lo = 1e9, hi = -1e9, mid = 0, best = 1e9;
    int at = ring[0];

    for (int i = 0; i < EYE_N; i++) {
        lo = fmin(lo, h->p[ring[i]].x);
        hi = fmax(hi, h->p[ring[i]].x);
    }
    for (int i = 0; i < EYE_N; i++)
        if (h->p[ring[i]].x < lo + 1e-9 || h->p[ring[i]].x > hi - 1e-9)
            mid += h->p[ring[i]].y / 2;
    for (int i = 0; i < EYE_N; i++) {
        struct vec p = h->p[ring[i]];
        double d = fabs(p.x - mix(lo, hi, t));
        if (t > 0.01 && t < 0.99 && (p.y > mid) != upper)
            continue;
        if (d < best) {
            best = d;
            at = ring[i];
        }
    }
    return at;
}

/* The 68 points: nearest skin to places on the face, lips and lids by their
 * loops. */
static void sculpt_label_landmarks(struct sculpt *s, const struct full *m)
{
    const struct half *h = m->h;
    const int skin = 1 << PART_GRID | 1 << PART_MOUTH | 1 << PART_NOSTRIL |
                     1 << PART_EYE;
    const int *outer = h->mouth[LIP_BORDER], *inner = h->mouth[LIP_INNER];

    for (int k = 0; k < 8; k++)
        sculpt_label_pair(s, m, 16 - k, k,
                          sculpt_label_nearest(m, jaw[k], skin));
    sculpt_label_set(s, 8, sculpt_label_nearest(m, vec(0, -95, 84), skin));
    for (int k = 0; k < 5; k++)
        sculpt_label_pair(s, m, 22 + k, 21 - k,
                          sculpt_label_nearest(m, brow[k], skin));
    for (int k = 0; k < 4; k++)
        sculpt_label_set(s, 27 + k,
                         sculpt_label_nearest(
                             m, vec(0, 22 - 12.5 * k, 97 + 5.5 * k), skin));
    sculpt_label_set(s, 33, sculpt_label_nearest(m, vec(0, -24, 101), skin));
    sculpt_label_pair(s, m, 34, 32,
                      sculpt_label_nearest(m, vec(6.5, -22.5, 100), skin));
    sculpt_label_pair(s, m, 35, 31,
                      sculpt_label_nearest(m, vec(14, -20, 95), skin));
    sculpt_label_pair(s, m, 42, 39, sculpt_label_lid(h, 0, 1));
    sculpt_label_pair(s, m, 43, 38, sculpt_label_lid(h, 0.33, 1));
    sculpt_label_pair(s, m, 44, 37, sculpt_label_lid(h, 0.67, 1));
    sculpt_label_pair(s, m, 45, 36, sculpt_label_lid(h, 1, 1));
    sculpt_label_pair(s, m, 46, 41, sculpt_label_lid(h, 0.67, 0));
    sculpt_label_pair(s, m, 47, 40, sculpt_label_lid(h, 0.33, 0));
    sculpt_label_set(s, 51, outer[0]);
    sculpt_label_pair(s, m, 52, 50, outer[4]);
    sculpt_label_pair(s, m, 53, 49, outer[8]);
    sculpt_label_pair(s, m, 54, 48, outer[MOUTH_CORNER]);
    sculpt_label_pair(s, m, 55, 59, outer[MOUTH_N - 8]);
    sculpt_label_pair(s, m, 56, 58, outer[MOUTH_N - 4]);
    sculpt_label_set(s, 57, outer[MOUTH_N]);
    sculpt_label_set(s, 62, inner[0]);
    sculpt_label_pair(s, m, 63, 61, inner[6]);
    sculpt_label_pair(s, m, 64, 60, inner[MOUTH_CORNER]);
    sculpt_label_pair(s, m, 65, 67, inner[MOUTH_N - 6]);
    sculpt_label_set(s, 66, inner[MOUTH_N]);
}

int sculpt_labels(struct sculpt *s, const struct full *m)
{
    const struct half *h = m->h;

    for (int v = 0; v < m->nv; v++) {
        struct vec p = m->p[v];
        s->region[v] = sculpt_label_region(m, v);
        s->hair[v] = (float)sculpt_label_hair(m, v);
        s->uv[2 * v] = (float)(0.5 + atan2(p.x, p.z + 10) / (2 * M_PI));
        s->uv[2 * v + 1] = (float)clamp01((p.y + 170) / 320);
    }
    /* ring: left corner, upper to right corner, lower back */
    sculpt_label_lips(s->lip_inner, &s->n_lip_inner, m, LIP_INNER, MOUTH_CORNER,
                      0);
    for (int j = MOUTH_CORNER + 1; j <= MOUTH_N; j++)
        s->lip_inner[s->n_lip_inner++] = m->mirror[h->mouth[LIP_INNER][j]];
    for (int j = MOUTH_N - 1; j > MOUTH_CORNER; j--)
        s->lip_inner[s->n_lip_inner++] = h->mouth[LIP_INNER][j];
    sculpt_label_lips(s->lip_upper_outer, &s->n_lip_upper_outer, m, LIP_BORDER,
                      MOUTH_CORNER, 0);
    sculpt_label_landmarks(s, m);
    return 0;
}
