/* Behind the lips: a dark bowl hung on the inner lip ring, two arches of
 * teeth with gums, and a tongue. */
#include "lib/lab/people/actor.h"

#include <math.h>

#include "lib/lab/people/vec.h"

#define ARCH 25                 /* columns of an arch */
#define ARCH_ROWS 6
#define TONGUE 9

/* A grid of vertices [rows][cols] as two triangles a cell. */
static void mouth_grid_faces(struct actor *a, size_t v0, size_t f0, int rows,
                             int cols, enum material material,
                             enum synth_label l)
{
    size_t f = f0;

    for (int r = 0; r + 1 < rows; r++)
        for (int c = 0; c + 1 < cols; c++) {
            int32_t p = (int32_t)v0 + r * cols + c, q = p + cols;
            int32_t quad[6] = { p, q, p + 1, p + 1, q, q + 1 };
            for (int k = 0; k < 6; k++)
                a->faces[3 * f + (size_t)k] = quad[k];
            for (int k = 0; k < 2; k++, f++) {
                a->material[f] = (uint8_t)material;
                a->label[f] = (uint8_t)l;
            }
        }
}

/* Half the width of the neutral inner lips. */
static float mouth_half(const struct actor *a)
{
    float w = 0;

    for (size_t i = 0; i < a->head->nlip_inner; i++) {
        float x = a->neutral[3 * a->head->lip_inner[i]] - a->mouth[0];
        w = fmaxf(w, fabsf(x));
    }
    return w;
}

/* One arch: enamel from the edge up, then gum.  up is +1 for the upper. */
static int mouth_arch_build(struct actor *a, float up, enum anchor anchor,
                            struct error *err)
{
    size_t v0, f0, nv = ARCH * ARCH_ROWS;
    float w = mouth_half(a) * 1.02f, *m = a->mouth;
    float edge = up > 0 ? 0.022f : 0.0f, tall = up > 0 ? 0.060f : 0.045f;

    if (actor_grow(a, nv, 2 * (ARCH - 1) * (ARCH_ROWS - 1), &v0, &f0, err))
        return -1;
    for (int r = 0; r < ARCH_ROWS; r++)
        for (int c = 0; c < ARCH; c++) {
            size_t i = v0 + (size_t)(r * ARCH + c);
            float s = 2 * (float)c / (ARCH - 1) - 1, t = (float)r / 4;
            float *p = a->neutral + 3 * i;
            float cusp = 0.004f * fabsf(sinf(8.5f * s * 3.1415927f));
            p[0] = m[0] + up * s * w * (up > 0 ? 1 : 0.92f);
            p[1] = m[1] + up * (-edge + tall * t + (r ? 0 : cusp)
                                + 0.012f * s * s);
            p[2] = m[2] - 0.055f - (up > 0 ? 0 : 0.012f) - 0.11f * s * s
                   - 0.006f * t;
            copy3(a->paint[i].c, p);
            a->anchor[i] = (uint8_t)anchor;
            a->paint[i].k[PAINT_SHUT] = clampf(0.02f + 0.6f * s * s, 0, 0.9f);
            /* which is tooth, which is gum, is told by the row */
            a->paint[i].k[PAINT_LIP] = r >= 4;
            float cell = s * 4.25f - floorf(s * 4.25f);
            a->paint[i].k[PAINT_DARK] = cell < 0.13f ? 0.4f : 0;
        }
    mouth_grid_faces(a, v0, f0, ARCH_ROWS, ARCH, MATERIAL_TEETH, LABEL_TEETH);
    for (size_t f = f0 + 2 * 4 * (ARCH - 1); f < a->nf; f++) {
        a->material[f] = MATERIAL_MOUTH;
        a->label[f] = LABEL_MOUTH;
    }
    return 0;
}

/* A patch behind the lower teeth, carried by the jaw. */
static int mouth_tongue_build(struct actor *a, struct error *err)
{
    size_t v0, f0;
    float w = mouth_half(a) * 0.62f, *m = a->mouth;

    if (actor_grow(a, TONGUE * TONGUE, 2 * (TONGUE - 1) * (TONGUE - 1), &v0,
                   &f0, err))
        return -1;
    for (int r = 0; r < TONGUE; r++)
        for (int c = 0; c < TONGUE; c++) {
            size_t i = v0 + (size_t)(r * TONGUE + c);
            float s = 2 * (float)c / (TONGUE - 1) - 1;
            float t = (float)r / (TONGUE - 1), *p = a->neutral + 3 * i;
            float round = sqrtf(fmaxf(1 - 0.85f * s * s, 0));
            p[0] = m[0] - s * w * (0.75f + 0.25f * sinf(2.5f * t));
            p[1] = m[1] - 0.055f + 0.05f * sinf(3.0f * (1 - t)) * round
                   - 0.012f * expf(-40 * s * s);
            p[2] = m[2] - 0.10f - 0.26f * (1 - t) - 0.05f * s * s;
            copy3(a->paint[i].c, p);
            a->anchor[i] = ANCHOR_JAW;
            a->paint[i].k[PAINT_SHUT] = clampf(0.3f + 0.6f * (1 - t), 0, 1);
            a->paint[i].k[PAINT_LIP] = 2;       /* the tongue's colour */
        }
    mouth_grid_faces(a, v0, f0, TONGUE, TONGUE, MATERIAL_MOUTH, LABEL_MOUTH);
    return 0;
}

/* Rows of the bowl behind the ring: width and height over the ring's, and
 * depth.  Cheeks fall away behind the corners of a wide mouth, so that only
 * the height grows. */
static const float bowl_shrink[4][2] = {
    { 1.0f, 1.25f }, { 0.95f, 1.35f }, { 0.8f, 1.0f }, { 0.2f, 0.2f }
};
static const float bowl_depth[4] = { 0.09f, 0.22f, 0.36f, 0.42f };

void mouth_pose(float *verts, const struct actor *a)
{
    size_t n = a->head->nlip_inner;
    float centre[3] = { 0, 0, 0 };

    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < 3; k++)
            centre[k] += verts[3 * a->head->lip_inner[i] + k] / (float)n;
    for (size_t r = 0; r < 4; r++)
        for (size_t i = 0; i < n; i++) {
            const float *q = verts + 3 * a->head->lip_inner[i];
            float *p = verts + 3 * (a->bowl + r * n + i);
            for (int k = 0; k < 2; k++)
                p[k] = centre[k] + (q[k] - centre[k]) * bowl_shrink[r][k];
            p[2] = q[2] - bowl_depth[r];
        }
}

/* Four rings from the inner lips backwards. */
static int mouth_bowl_build(struct actor *a, struct error *err)
{
    size_t n = a->head->nlip_inner, v0, f0;

    if (n < 3)
        return 0;
    if (actor_grow(a, 4 * n, 8 * n, &v0, &f0, err))
        return -1;
    mouth_pose(a->neutral, a);
    for (size_t v = v0; v < v0 + 4 * n; v++) {
        copy3(a->paint[v].c, a->neutral + 3 * v);
        a->paint[v].k[PAINT_SHUT] = 0.45f + 0.15f * (float)((v - v0) / n);
    }
    size_t f = f0;
    for (size_t r = 0; r < 4; r++)
        for (size_t i = 0; i < n; i++) {
            size_t j = (i + 1) % n;
            int32_t p = r ? (int32_t)(v0 + (r - 1) * n + i)
                          : a->head->lip_inner[i];
            int32_t q = r ? (int32_t)(v0 + (r - 1) * n + j)
                          : a->head->lip_inner[j];
            int32_t s = (int32_t)(v0 + r * n + i);
            int32_t t = (int32_t)(v0 + r * n + j);
            int32_t quad[6] = { p, q, s, q, t, s };
            for (int k = 0; k < 6; k++)
                a->faces[3 * f + (size_t)k] = quad[k];
            for (int k = 0; k < 2; k++, f++) {
                a->material[f] = MATERIAL_INNER;
                a->label[f] = LABEL_MOUTH;
            }
        }
    return 0;
}

int mouth_build(struct actor *a, struct error *err)
{
    a->bowl = a->nv;
    if (mouth_bowl_build(a, err) || mouth_arch_build(a, 1, ANCHOR_HEAD, err)
        || mouth_arch_build(a, -1, ANCHOR_JAW, err))
        return -1;
    return mouth_tongue_build(a, err);
}
