/* Packing: what a browser unpacks in lib/export/web/archive.js. */
#include "lib/export/page_pack.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void page_pack_release(struct pack *k)
{
    for (size_t i = 0; i < k->count; i++)
        free(k->owned[i]);
}

void *page_pack_add(struct pack *k, const char *name, enum st_dtype dtype,
                    size_t d0, size_t d1, const void *data)
{
    const size_t count = d0 * (d1 ? d1 : 1);
    const size_t bytes = count * st_dtype_size(dtype), i = k->count;
    void *copy = k->failed || i == PACK_MAX ? NULL : malloc(bytes + 1);

    if (!copy) {
        k->failed = true;
        return NULL;
    }
    if (data)
        memcpy(copy, data, bytes);
    snprintf(k->name[i], sizeof k->name[i], "%s", name);
    k->owned[i] = copy;
    k->tensor[i] = (struct st_tensor){
        .name = k->name[i], .dtype = dtype, .ndim = d1 ? 2 : 1,
        .dim = {d0, d1}, .count = count, .data = copy};
    k->count++;
    return copy;
}

/* Ends of what 16 bits will tell apart; 0 has a number of its own, so that
 * what does not move stays where it is. */
static void page_pack_range(float range[2], const float *x, size_t n,
                            size_t stride)
{
    float lo = n ? x[0] : 0, hi = lo;

    for (size_t i = 0; i < n; i++) {
        lo = fminf(lo, x[i * stride]);
        hi = fmaxf(hi, x[i * stride]);
    }
    if (lo < 0 && hi > 0) {
        hi = fmaxf(-lo, hi);
        lo = -hi;
    }
    range[0] = lo;
    range[1] = hi;
}

void page_pack_columns(struct pack *k, const char *name, const float *x,
                       size_t n, size_t stride, size_t K)
{
    char range_name[24];

    snprintf(range_name, sizeof range_name, "%s.range", name);
    uint16_t *to = page_pack_add(k, name, ST_U16, K, n, NULL);
    float *range = page_pack_add(k, range_name, ST_F32, K, 2, NULL);
    if (!to || !range)
        return;
    for (size_t c = 0; c < K; c++) {
        float *r = range + 2 * c;

        page_pack_range(r, x + c, n, stride);
        double step = r[1] > r[0] ? 65534 / ((double)r[1] - r[0]) : 0;
        for (size_t i = 0; i < n; i++)
            to[c * n + i] = (uint16_t)lrint((x[i * stride + c] - r[0]) *
                                            step);
    }
}

/* Directions of the head's posing layout, each a row: name (K,3V). */
static void page_pack_directions(struct pack *k, const char *name,
                                 const struct head *h, const float *dirs,
                                 size_t K)
{
    char range_name[24];
    float *row = malloc((3 * h->V + 1) * sizeof *row);

    snprintf(range_name, sizeof range_name, "%s.range", name);
    uint16_t *to = page_pack_add(k, name, ST_U16, K, 3 * h->V, NULL);
    float *range = page_pack_add(k, range_name, ST_F32, K, 2, NULL);
    k->failed |= !row;
    for (size_t d = 0; to && range && row && d < K; d++) {
        float *r = range + 2 * d;

        head_direction(row, h, dirs, K, d);
        page_pack_range(r, row, 3 * h->V, 1);
        double step = r[1] > r[0] ? 65534 / ((double)r[1] - r[0]) : 0;
        for (size_t i = 0; i < 3 * h->V; i++)
            to[3 * h->V * d + i] = (uint16_t)lrint((row[i] - r[0]) * step);
    }
    free(row);
}

void page_pack_picture(struct pack *k, const char *name, const uint8_t *pixel,
                       size_t S, size_t channels)
{
    uint8_t *to = page_pack_add(k, name, ST_U8, S, S * channels, NULL);

    for (size_t y = 0; to && y < S; y++)
        for (size_t x = 0; x < S * channels; x++) {
            const uint8_t *p = pixel + y * S * channels + x;

            to[y * S * channels + x] =
                (uint8_t)(x < channels ? *p : *p - p[-(ptrdiff_t)channels]);
        }
}

/* Skinning weights of the posing layout, a column for each joint. */
static void page_pack_skin(struct pack *k, const char *name,
                           const struct head *h)
{
    float *w = malloc((HEAD_JOINTS * h->V + 1) * sizeof *w);

    k->failed |= !w;
    for (size_t v = 0; w && v < h->V; v++)
        for (size_t j = 0; j < HEAD_JOINTS; j++)
            w[HEAD_JOINTS * v + j] =
                h->skin[(v / HEAD_BLOCK * HEAD_JOINTS + j) * HEAD_BLOCK +
                        v % HEAD_BLOCK];
    if (w)
        page_pack_columns(k, name, w, h->V, HEAD_JOINTS, HEAD_JOINTS);
    free(w);
}

void page_pack_head(struct pack *k, const struct identity *id)
{
    const struct head *h = id->head;
    float joints[3 * HEAD_JOINTS];

    for (int i = 0; i < 3 * HEAD_JOINTS; i++)
        joints[i] = (float)id->joints[i];
    page_pack_directions(k, "shaped", h, id->shaped, 1);
    page_pack_directions(k, "lids", h, id->lids, 2);
    page_pack_directions(k, "exp_dirs", h, h->exp_dirs, h->nexp);
    page_pack_directions(k, "pose_dirs", h, h->pose_dirs,
                         HEAD_POSE_DIRS);
    page_pack_skin(k, "weights", h);
    page_pack_add(k, "joints", ST_F32, HEAD_JOINTS, 3, joints);
    page_pack_add(k, "joint_exp", ST_F32, h->nexp, 3 * HEAD_JOINTS,
                  h->joint_exp);
    page_pack_add(k, "parents", ST_I32, HEAD_JOINTS, 0, h->parents);
}
