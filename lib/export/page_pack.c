/* Packing: what a browser unpacks in lib/export/web/archive.js. */
#include "lib/export/page_pack.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

void *page_pack_add(struct pack *k, const char *name, enum st_dtype dtype,
                    size_t d0, size_t d1, const void *data)
{
    const size_t count = d0 * (d1 ? d1 : 1);
    const char *own = arena_text(&k->memory, name);
    void *copy = arena_take(&k->memory, count, st_dtype_size(dtype));

    if (!own || !copy)
        return NULL;
    assert(k->count < PACK_MAX);
    if (data)
        memcpy(copy, data, count * st_dtype_size(dtype));
    k->tensor[k->count++] = (struct st_tensor){
        .name = own, .dtype = dtype, .ndim = d1 ? 2 : 1, .dim = {d0, d1},
        .count = count, .data = copy};
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

/* Room for K rows of n numbers in 16 bits, and for their ranges. */
static bool page_pack_open(uint16_t **to, float **range, struct pack *k,
                           const char *name, size_t K, size_t n)
{
    char range_name[24];

    snprintf(range_name, sizeof range_name, "%s.range", name);
    *to = page_pack_add(k, name, ST_U16, K, n, NULL);
    *range = page_pack_add(k, range_name, ST_F32, K, 2, NULL);
    return *to && *range;
}

/* One of the rows. */
static void page_pack_row(uint16_t *to, float r[2], const float *x, size_t n,
                          size_t stride)
{
    page_pack_range(r, x, n, stride);
    const double step = r[1] > r[0] ? 65534 / ((double)r[1] - r[0]) : 0;

    for (size_t i = 0; i < n; i++)
        to[i] = (uint16_t)lrint((x[i * stride] - r[0]) * step);
}

void page_pack_columns(struct pack *k, const char *name, const float *x,
                       size_t n, size_t stride, size_t K)
{
    uint16_t *to;
    float *range;

    if (!page_pack_open(&to, &range, k, name, K, n))
        return;
    for (size_t c = 0; c < K; c++)
        page_pack_row(to + c * n, range + 2 * c, x + c, n, stride);
}

/* Directions of the head's posing layout, each a row: name (K,3V). */
static void page_pack_directions(struct pack *k, const char *name,
                                 const struct head *h, const float *dirs,
                                 size_t K)
{
    const size_t n = 3 * h->V;
    float *row = arena_take(&k->memory, n, sizeof *row), *range;
    uint16_t *to;

    if (!page_pack_open(&to, &range, k, name, K, n) || !row)
        return;
    for (size_t d = 0; d < K; d++) {
        head_direction(row, h, dirs, K, d);
        page_pack_row(to + n * d, range + 2 * d, row, n, 1);
    }
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
    float *w = arena_take(&k->memory, HEAD_JOINTS * h->V, sizeof *w);

    if (!w)
        return;
    for (size_t v = 0; v < h->V; v++)
        for (size_t j = 0; j < HEAD_JOINTS; j++)
            w[HEAD_JOINTS * v + j] =
                h->skin[(v / HEAD_BLOCK * HEAD_JOINTS + j) * HEAD_BLOCK +
                        v % HEAD_BLOCK];
    page_pack_columns(k, name, w, h->V, HEAD_JOINTS, HEAD_JOINTS);
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
