/* Single directions of a head; landmarks, lips and normals of a posed one. */
#include "lib/head/head.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec3.h"
#include "lib/head/arkit.h"

void head_direction(float *out, const struct head *h, const float *dirs,
                    size_t n, size_t k)
{
    for (size_t b = 0; b * HEAD_BLOCK < h->V; b++) {
        const float *block = dirs + (b * n + k) * 3 * HEAD_BLOCK;
        const size_t rest = h->V - b * HEAD_BLOCK;

        for (size_t i = 0; i < HEAD_BLOCK && i < rest; i++, out += 3)
            for (size_t c = 0; c < 3; c++)
                out[c] = block[c * HEAD_BLOCK + i];
    }
}

/* Whether expression direction k moves nothing. */
static bool measure_direction_is_zero(const struct head *h, size_t k)
{
    for (size_t b = 0; b < h->blocks; b++) {
        const float *d = h->exp_dirs + (b * h->nexp + k) * 3 * HEAD_BLOCK;

        for (size_t i = 0; i < 3 * HEAD_BLOCK; i++)
            if (d[i] != 0)
                return 0;
    }
    return 1;
}

bool head_has_arkit(const struct head *h)
{
    if (h->nexp < ARKIT_COUNT)
        return 0;
    for (size_t k = 0; k < ARKIT_COUNT; k++)
        if (measure_direction_is_zero(h, k) != arkit_is_rig((int)k))
            return 0;
    return 1;
}

float head_jaw_share(const struct head *h, size_t v)
{
    /* of sin in R - I of a turn about x */
    const size_t column = 9 * (JOINT_JAW - 1) + 7;
    const float *x = h->v_template + 3 * v;
    const float *jaw = h->joint_template + 3 * JOINT_JAW;
    const float *d = h->pose_dirs +
                     (v / HEAD_BLOCK * HEAD_POSE_DIRS + column) * 3 *
                     HEAD_BLOCK + v % HEAD_BLOCK;
    float arm = hypotf(x[1] - jaw[1], x[2] - jaw[2]);

    if (!h->jaw_shape)
        return h->weights[HEAD_JOINTS * v + JOINT_JAW];
    return fminf(1, hypotf(d[HEAD_BLOCK], d[2 * HEAD_BLOCK]) /
                    fmaxf(arm, 0.01f * h->scale));
}

void head_landmarks(float *lmk, const struct head *h, const float *verts)
{
    for (int i = 0; i < HEAD_LANDMARKS; i++) {
        const int32_t *f = h->f + 3 * (size_t)h->landmark_faces[i];
        const float *w = h->landmark_bary + 3 * i;

        for (int c = 0; c < 3; c++)
            lmk[3 * i + c] = w[0] * verts[3 * (size_t)f[0] + c] +
                             w[1] * verts[3 * (size_t)f[1] + c] +
                             w[2] * verts[3 * (size_t)f[2] + c];
    }
}

void head_landmarks_backward(float *dverts, const float *dlmk,
                             const struct head *h)
{
    for (int i = 0; i < HEAD_LANDMARKS; i++) {
        const int32_t *f = h->f + 3 * (size_t)h->landmark_faces[i];

        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++)
                dverts[3 * (size_t)f[k] + c] +=
                    h->landmark_bary[3 * i + k] * dlmk[3 * i + c];
    }
}

void head_centroid(float c[3], const int32_t *list, size_t n,
                   const float *verts)
{
    double sum[3] = {0};

    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < 3; k++)
            sum[k] += verts[3 * (size_t)list[i] + k];
    for (int k = 0; k < 3; k++)
        c[k] = n ? (float)(sum[k] / (double)n) : 0;
}

void head_centroid_backward(float *dverts, const float dc[3],
                            const int32_t *list, size_t n)
{
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < 3; k++)
            dverts[3 * (size_t)list[i] + k] += dc[k] / (float)n;
}

/* Whether vertex v lies where a chin does: below the lips, in front, within
 * 12 mm of the middle. */
static int measure_is_chin(const struct head *h, size_t v, const float lip[3])
{
    const float *x = h->v_template + 3 * v, mm = 1e-3f * h->scale;
    const float *jaw = h->joint_template + 3 * JOINT_JAW;

    return fabsf(x[0]) < 12 * mm && x[1] < lip[1] - 22 * mm &&
           x[2] > 0.5f * (jaw[2] + lip[2]);
}

void head_find_chin(struct head *h)
{
    float lip[3], max = 0;

    h->nchin = 0;
    head_centroid(lip, h->lip_inner, h->nlip_inner, h->v_template);
    for (size_t v = 0; v < h->V; v++)
        if (measure_is_chin(h, v, lip))
            max = fmaxf(max, head_jaw_share(h, v));
    for (size_t v = 0; v < h->V && h->nchin < HEAD_CHIN && max > 0.5f; v++)
        if (measure_is_chin(h, v, lip) && head_jaw_share(h, v) > 0.95f * max)
            h->chin[h->nchin++] = (int32_t)v;
}

/* Range of coordinate c over a list of vertices. */
static float measure_range(const int32_t *list, size_t n, const float *verts,
                           int c)
{
    float lo = INFINITY, hi = -INFINITY;

    for (size_t i = 0; i < n; i++) {
        lo = fminf(lo, verts[3 * (size_t)list[i] + c]);
        hi = fmaxf(hi, verts[3 * (size_t)list[i] + c]);
    }
    return n ? hi - lo : 0;
}

void head_mouth(struct head_mouth *m, const struct head *h,
                const float *verts)
{
    double up = 0, down = 0;
    size_t nup = 0, ndown = 0;

    memset(m, 0, sizeof *m);
    if (h->nlip_inner == 0)
        return;
    head_centroid(m->centre, h->lip_inner, h->nlip_inner, verts);
    float half = 0.25f * measure_range(h->lip_inner, h->nlip_inner, verts, 0);
    for (size_t i = 0; i < h->nlip_inner; i++) {
        const float *v = verts + 3 * (size_t)h->lip_inner[i];
        float x = v[0] - m->centre[0], y = v[1] - m->centre[1];

        m->radius = fmaxf(m->radius, fmaxf(fabsf(x), fabsf(y)));
        /* the opening, away from the corners where the lips meet */
        if (fabsf(x) > half)
            continue;
        if (y > 0) {
            up += y;
            nup++;
        } else {
            down += y;
            ndown++;
        }
    }
    m->gap = (float)((nup ? up / (double)nup : 0) -
                     (ndown ? down / (double)ndown : 0));
    m->bowl = measure_range(h->lip_inner, h->nlip_inner, verts, 2);
    head_centroid(m->chin, h->chin, h->nchin, verts);
    m->lip = measure_range(h->lip_upper_outer, h->nlip_upper_outer, verts, 2);
}

void head_normals(float *normals, const struct head *h, const float *verts)
{
    memset(normals, 0, 3 * h->V * sizeof *normals);
    for (size_t i = 0; i < h->F; i++) {
        const int32_t *f = h->f + 3 * i;
        const float *a = verts + 3 * (size_t)f[0];
        const float *b = verts + 3 * (size_t)f[1];
        const float *c = verts + 3 * (size_t)f[2];
        float u[3], v[3], n[3];

        sub3(u, b, a);
        sub3(v, c, a);
        cross3(n, u, v);
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                normals[3 * (size_t)f[j] + k] += n[k];
    }
    for (size_t v = 0; v < h->V; v++) {
        float *n = normals + 3 * v;
        float len = length3(n);

        for (int k = 0; k < 3; k++)
            n[k] = len > 1e-20f ? n[k] / len : 0;
    }
}
