/* What the head's vertices look like, from its landmarks and regions. */
#include "lib/lab/people/actor.h"

#include <math.h>

#include "lib/lab/people/noise.h"
#include "lib/lab/people/vec.h"

/* exp(-(d / size)^2) of the distance from p to point c, squashed in z. */
static float paint_blob(const float p[3], const float c[3], float size)
{
    float x = p[0] - c[0], y = p[1] - c[1], z = 0.5f * (p[2] - c[2]);

    return expf(-(x * x + y * y + z * z) / (size * size));
}

/* Distance from p to the polyline through landmarks first..last. */
static float paint_line_distance(const struct actor *a, const float p[3],
                                 int first, int last)
{
    float best = 9;

    for (int i = first; i < last; i++) {
        float e[3], d[3];
        sub3(e, a->lmk[i + 1], a->lmk[i]);
        sub3(d, p, a->lmk[i]);
        float t = clampf(dot3(d, e) / (dot3(e, e) + 1e-9f), 0, 1);
        mad3(d, d, e, -t);
        float l = length3(d);
        best = l < best ? l : best;
    }
    return best;
}

/* Where a beard grows: below the cheek line, round the mouth, to the throat;
 * not on the lips. */
static float paint_beard_at(const struct actor *a, const float p[3])
{
    const float *ear = a->lmk[p[0] > 0 ? 15 : 1], *chin = a->lmk[8];
    const float *corner = a->lmk[p[0] > 0 ? 54 : 48], *nose = a->lmk[33];
    float side = clampf((fabsf(p[0]) - fabsf(corner[0]))
                        / (fabsf(ear[0]) - fabsf(corner[0])), 0, 1);
    float top = lerpf(corner[1] + 0.02f, ear[1], side * side);
    float b = ramp(top + 0.03f, top - 0.05f, p[1]);
    float throat = chin[1] - 0.16f;

    b *= ramp(throat, throat + 0.1f, p[1]);
    b *= ramp(ear[2] - 0.16f, ear[2] - 0.02f, p[2]);
    /* the upper lip, up to the nose */
    float lip = ramp(fabsf(corner[0]) * 1.35f, fabsf(corner[0]), fabsf(p[0]))
                * ramp(nose[1], nose[1] - 0.03f, p[1])
                * ramp(corner[1] - 0.02f, corner[1], p[1]);
    return fmaxf(b, lip) * ramp(0.0f, 0.05f, p[2] - ear[2] + 0.1f);
}

/* Shares of lip, brow, hair, beard and red that a place of the head has. */
static void paint_vertex(struct actor *a, size_t i, const float normal[3])
{
    const float *p = a->neutral + 3 * i;
    const struct head *h = a->head;
    int region = h->region ? h->region[i] : REGION_FACE;
    struct paint *q = &a->paint[i];

    copy3(q->c, p);
    float cheek = 0, socket = 0, brow = 9;
    for (int s = 0; s < 2; s++) {
        float c[3], e[3];
        lerp3(c, a->lmk[s ? 46 : 41], a->lmk[s ? 54 : 48], 0.45f);
        c[0] *= 1.25f;
        cheek += paint_blob(p, c, 0.15f);
        lerp3(e, a->lmk[s ? 42 : 36], a->lmk[s ? 45 : 39], 0.5f);
        e[1] -= 0.025f;
        socket += paint_blob(p, e, 0.10f);
        float d = paint_line_distance(a, p, s ? 22 : 17, s ? 26 : 21);
        brow = d < brow ? d : brow;
    }
    float nose = paint_blob(p, a->lmk[30], 0.09f),
          mouth = paint_blob(p, a->mouth, 0.14f);
    float chin = paint_blob(p, a->lmk[8], 0.12f);
    bool front = region != REGION_NECK && region != REGION_EYEBALL;
    q->k[PAINT_RED] = front ? 0.42f * cheek + 0.5f * nose + 0.25f * mouth
                              + 0.15f * chin : 0.05f;
    if (region == REGION_EAR)
        q->k[PAINT_RED] = 0.55f;
    if (region == REGION_EYELID)
        q->k[PAINT_RED] += 0.2f;
    q->k[PAINT_DARK] = front ? 0.45f * clampf(socket, 0, 1) : 0;
    q->k[PAINT_LIP] = region == REGION_LIPS;
    q->k[PAINT_BEARD] = front || region == REGION_NECK ? paint_beard_at(a, p)
                                                       : 0;
    if (region == REGION_LIPS || region == REGION_EAR)
        q->k[PAINT_BEARD] = 0;
    q->k[PAINT_BROW] = ramp(0.032f, 0.012f, brow);
    float top = ramp(a->lmk[27][1], a->lmk[27][1] + 0.12f, p[1])
                * ramp(0, 0.3f, p[2]);
    q->k[PAINT_OIL] = clampf(0.8f * nose + 0.7f * top + 0.3f * cheek, 0, 1);
    float density = h->hair ? h->hair[i] : 0;
    q->k[PAINT_HAIR] = density;
    /* light from below is kept off by the shoulders, in the nostrils by all */
    float under = clampf(-normal[1], 0, 1) * ramp(a->lmk[8][1] + 0.15f,
                                                  a->lmk[8][1] - 0.1f, p[1]);
    q->k[PAINT_SHUT] = clampf(0.45f * under, 0, 0.9f);
}

static int paint_label_of(int region)
{
    switch (region) {
    case REGION_LIPS: return LABEL_LIP;
    case REGION_EYEBALL: return LABEL_EYE;
    case REGION_EAR: return LABEL_EAR;
    case REGION_NECK: return LABEL_NECK;
    case REGION_NOSE: return LABEL_NOSE;
    case REGION_INNER_MOUTH: return LABEL_MOUTH;
    default: return LABEL_SKIN;
    }
}

/* Receding hair leaves the forehead and the crown; everyone's hairline has
 * its own edge. */
static void paint_thin_hair(struct actor *a)
{
    const struct hair_look *h = &a->look.hair;

    for (size_t i = 0; i < a->head->V; i++) {
        struct paint *q = &a->paint[i];
        float n = noise_sum(q->c[0] * 9 + a->look.skin.shift[0],
                            q->c[1] * 9, q->c[2] * 9, 2);
        q->k[PAINT_HAIR] = clampf(q->k[PAINT_HAIR] * (1 + 0.35f * n), 0, 1);
        if (h->style == HAIR_RECEDING) {
            float top = ramp(0.35f, 0.75f, (q->c[1] - a->skull[1])
                                           / a->skull_radius[1]);
            float front = ramp(-0.4f, 0.5f, q->c[2] / a->skull_radius[2]);
            q->k[PAINT_HAIR] *= 1 - fmaxf(top, 0.9f * front) * 0.95f;
        }
    }
}

void paint_head(struct actor *a)
{
    const struct head *h = a->head;

    for (size_t i = 0; i < h->V; i++) {
        float n[3] = { 0, 0, 1 }, d[3];
        sub3(d, a->neutral + 3 * i, a->skull);
        copy3(n, d);
        unit3(n);
        paint_vertex(a, i, n);
    }
    paint_thin_hair(a);
    for (size_t f = 0; f < h->F; f++) {
        int count[16] = { 0 }, region = 0;
        for (int k = 0; k < 3; k++) {
            int r = h->region ? h->region[h->f[3 * f + (size_t)k]] : 1;
            r = r < 0 || r > 15 ? 0 : r;
            if (k == 0 || ++count[r] > 1)
                region = r;
            count[r] += k == 0;
        }
        int32_t v = h->f[3 * f];
        int ball = h->weights[5 * v + JOINT_EYE_LEFT] > 0.99f
                   || h->weights[5 * v + JOINT_EYE_RIGHT] > 0.99f;
        a->label[f] = (uint8_t)(ball ? LABEL_EYE : paint_label_of(region));
        a->material[f] = ball ? MATERIAL_EYE
                         : region == REGION_INNER_MOUTH ? MATERIAL_MOUTH
                                                        : MATERIAL_SKIN;
        if (a->label[f] == LABEL_SKIN && a->paint[v].k[PAINT_HAIR] > 0.4f
            && a->look.hair.style != HAIR_SHAVED)
            a->label[f] = LABEL_HAIR;
    }
}
