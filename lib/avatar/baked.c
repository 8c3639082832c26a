/* Baked avatars: copies of what Phase A made, as GAUS records, and moved in
 * Phase B by lib/geom/drive.h. */
#include "lib/avatar/baked.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/safetensors.h"
#include "lib/geom/neck_blend.h"

/* N Gaussians of C colours, the first `dynamic` on the mesh; no neck blend. */
static int baked_allocate(struct baked *b, size_t N, size_t C,
                          size_t dynamic, struct error *err)
{
    memset(b, 0, sizeof *b);
    b->N = N;
    b->C = C;
    b->dynamic = dynamic;
    b->block = malloc((N * (12 + C) + 1) * sizeof *b->block);
    b->branch = malloc(N + 1);
    b->vertex = malloc((dynamic + 1) * sizeof *b->vertex);
    if (!b->block || !b->branch || !b->vertex) {
        baked_release(b);
        return error_set(err, EX_OSERR, "no memory for %zu Gaussians", N);
    }
    b->mean = b->block;
    b->scale = b->mean + 3 * N;
    b->quat = b->scale + 3 * N;
    b->opacity = b->quat + 4 * N;
    b->neck = b->opacity + N;
    b->color = b->neck + N;
    memset(b->neck, 0, N * sizeof *b->neck);
    memcpy(b->source, neck_blend_upright, sizeof b->source);
    return 0;
}

/* The range of the static Gaussians that the neck blend moves. */
static void baked_find_blended(struct baked *b)
{
    neck_blend_range(&b->first, &b->blended, b->neck, b->dynamic,
                     b->N - b->mouth);
}

int baked_from_avatar(struct baked *b, const struct avatar *a,
                      struct error *err)
{
    const struct gaussians *g = &a->set;
    size_t N = g->n, C = (size_t)g->channels;

    if (baked_allocate(b, N, C, a->first[BRANCH_STATIC], err))
        return -1;
    b->mouth = N - a->first[BRANCH_MOUTH];
    memcpy(b->mean, g->mean, 3 * N * sizeof *b->mean);
    memcpy(b->scale, g->scale, 3 * N * sizeof *b->scale);
    memcpy(b->quat, g->quat, 4 * N * sizeof *b->quat);
    memcpy(b->opacity, g->opacity, N * sizeof *b->opacity);
    memcpy(b->color, g->color, N * C * sizeof *b->color);
    memcpy(b->branch, g->branch, N);
    memcpy(b->lip, a->mouth.lips.centre, sizeof b->lip);
    memcpy(b->neck, a->drive.weight, N * sizeof *b->neck);
    memcpy(b->pivot, a->drive.pivot, sizeof b->pivot);
    memcpy(b->source, a->drive.source, sizeof b->source);
    memcpy(b->light, a->light, sizeof b->light);
    baked_find_blended(b);
    for (size_t i = 0; i < b->dynamic; i++)
        b->vertex[i] = (int32_t)i;
    return 0;
}

void baked_release(struct baked *b)
{
    free(b->block);
    free(b->branch);
    free(b->vertex);
    memset(b, 0, sizeof *b);
}

struct gaussians baked_set(const struct baked *b)
{
    return (struct gaussians){
        .n = b->N, .channels = (int)b->C, .mean = b->mean, .scale = b->scale,
        .quat = b->quat, .opacity = b->opacity, .color = b->color,
        .branch = b->branch
    };
}

/* ---- records ----------------------------------------------------------- */

/* Branches in order 0, 1, 2; counts the first and the last. */
static int baked_count(size_t n[3], const uint8_t *branch, size_t N,
                       struct error *err)
{
    n[0] = n[1] = n[2] = 0;
    for (size_t i = 0; i < N; i++) {
        if (branch[i] > 2 || (i && branch[i] < branch[i - 1]))
            return error_set(err, EX_DATAERR, "GAUS branch[%zu] is %d after "
                             "%d (expected 0, 1, 2 in this order)", i,
                             branch[i], i ? branch[i - 1] : 0);
        n[branch[i]]++;
    }
    return 0;
}

/* The optional array that says which vertex each dynamic Gaussian is on. */
static int baked_read_vertices(struct baked *b, const struct record *rec,
                               size_t vertices, struct error *err)
{
    size_t dims[1] = {b->dynamic};
    const int32_t *v = NULL;

    if (record_find(rec, "vertex")) {
        v = record_get(rec, "vertex", DTYPE_I32, 1, dims, err);
        if (!v)
            return -1;
    }
    for (size_t i = 0; i < b->dynamic; i++) {
        int32_t k = v ? v[i] : (int32_t)i;

        if (k < 0 || (vertices && (size_t)k >= vertices))
            return error_set(err, EX_DATAERR, "GAUS vertex[%zu] is %d "
                             "(expected 0 to %zu: identity and head belong "
                             "together)", i, k, vertices - 1);
        b->vertex[i] = k;
    }
    return 0;
}

/* The optional arrays of the neck blend. */
static int baked_read_neck(struct baked *b, const struct record *rec,
                           struct error *err)
{
    const size_t N[1] = {b->N}, three[1] = {3}, nine[2] = {3, 3};
    const float *weight, *pivot, *source;

    if (!record_find(rec, "bend"))
        return 0;
    if (!(weight = record_get(rec, "bend", DTYPE_F32, 1, N, err)) ||
        !(pivot = record_get(rec, "pivot", DTYPE_F32, 1, three, err)) ||
        !(source = record_get(rec, "source", DTYPE_F32, 2, nine, err)))
        return -1;
    memcpy(b->neck, weight, b->N * sizeof *weight);
    memcpy(b->pivot, pivot, sizeof b->pivot);
    memcpy(b->source, source, sizeof b->source);
    baked_find_blended(b);
    return 0;
}

/* The optional light on the source. */
static int baked_read_light(struct baked *b, const struct record *rec,
                            struct error *err)
{
    const size_t three[1] = {3};
    const float *light;

    if (!record_find(rec, "light"))
        return 0;
    if (!(light = record_get(rec, "light", DTYPE_F32, 1, three, err)))
        return -1;
    memcpy(b->light, light, sizeof b->light);
    return 0;
}

/* Required arrays with their shapes, then what is optional; colours may be
 * half precision. */
int baked_read(struct baked *b, const struct record *rec, size_t vertices,
               struct error *err)
{
    size_t any[2] = {0, 3}, n[3];
    const float *mean = record_get(rec, "mean", DTYPE_F32, 2, any, err);

    memset(b, 0, sizeof *b);
    if (!mean)
        return -1;
    size_t N = record_find(rec, "mean")->dim[0];
    size_t d3[2] = {N, 3}, d4[2] = {N, 4}, d1[1] = {N}, dc[2] = {N, 0};
    const float *scale = record_get(rec, "scale", DTYPE_F32, 2, d3, err);
    const float *quat = scale ? record_get(rec, "quat", DTYPE_F32, 2, d4, err)
                              : NULL;
    const float *opacity = quat ? record_get(rec, "opacity", DTYPE_F32, 1, d1,
                                             err) : NULL;
    const uint8_t *branch = opacity ? record_get(rec, "branch", DTYPE_U8, 1,
                                                 d1, err) : NULL;
    const struct array *color = record_find(rec, "color");
    int half = color && color->dtype == DTYPE_F16;
    if (!branch || !record_get(rec, "color", half ? DTYPE_F16 : DTYPE_F32, 2,
                               dc, err) ||
        record_check_finite(rec, err) || baked_count(n, branch, N, err) ||
        baked_allocate(b, N, color->dim[1], n[0], err))
        return -1;
    b->mouth = n[2];
    memcpy(b->mean, mean, 3 * N * sizeof *mean);
    memcpy(b->scale, scale, 3 * N * sizeof *scale);
    memcpy(b->quat, quat, 4 * N * sizeof *quat);
    memcpy(b->opacity, opacity, N * sizeof *opacity);
    memcpy(b->branch, branch, N);
    for (size_t i = 0; half && i < N * b->C; i++)
        b->color[i] = half_to_float(((const uint16_t *)color->data)[i]);
    if (!half)
        memcpy(b->color, color->data, N * b->C * sizeof *b->color);
    const struct array *lip = record_find(rec, "lip");
    if (lip && lip->dtype == DTYPE_F32 && array_count(lip) == 3)
        memcpy(b->lip, lip->data, sizeof b->lip);
    if (baked_read_vertices(b, rec, vertices, err) ||
        baked_read_neck(b, rec, err) || baked_read_light(b, rec, err)) {
        baked_release(b);
        return -1;
    }
    return 0;
}

/* Arrays in the order of spid-stream(5). */
int baked_write(struct stream_writer *w, uint64_t frame, double time,
                const struct baked *b, const float *means, const float *cam,
                struct error *err)
{
    size_t N = b->N;
    struct array a[13] = {
        array_make("mean", DTYPE_F32, means ? means : b->mean, 2, N, 3, 0, 0),
        array_make("scale", DTYPE_F32, b->scale, 2, N, 3, 0, 0),
        array_make("quat", DTYPE_F32, b->quat, 2, N, 4, 0, 0),
        array_make("opacity", DTYPE_F32, b->opacity, 1, N, 0, 0, 0),
        array_make("color", DTYPE_F32, b->color, 2, N, b->C, 0, 0),
        array_make("branch", DTYPE_U8, b->branch, 1, N, 0, 0, 0),
        array_make("lip", DTYPE_F32, b->lip, 1, 3, 0, 0, 0),
        array_make("vertex", DTYPE_I32, b->vertex, 1, b->dynamic, 0, 0, 0),
        array_make("bend", DTYPE_F32, b->neck, 1, N, 0, 0, 0),
        array_make("pivot", DTYPE_F32, b->pivot, 1, 3, 0, 0, 0),
        array_make("source", DTYPE_F32, b->source, 2, 3, 3, 0, 0),
        array_make("light", DTYPE_F32, b->light, 1, 3, 0, 0, 0),
        array_make("cam", DTYPE_F32, cam, 2, 3, 4, 0, 0)
    };

    return stream_write(w, "GAUS", frame, time, a, cam ? 13 : 12, err);
}

/* ---- leaving out ------------------------------------------------------- */

/* Rows of x (N,width) with keep[i], moved to the front in order. */
static void baked_keep_rows(float *x, size_t width, const uint8_t *keep,
                            size_t N)
{
    size_t out = 0;

    for (size_t i = 0; i < N; i++)
        if (keep[i]) {
            memmove(x + out * width, x + i * width, width * sizeof *x);
            out++;
        }
}

void baked_keep(struct baked *b, const uint8_t *keep)
{
    size_t out = 0, dynamic = 0, mouth = 0;

    baked_keep_rows(b->mean, 3, keep, b->N);
    baked_keep_rows(b->scale, 3, keep, b->N);
    baked_keep_rows(b->quat, 4, keep, b->N);
    baked_keep_rows(b->opacity, 1, keep, b->N);
    baked_keep_rows(b->neck, 1, keep, b->N);
    baked_keep_rows(b->color, b->C, keep, b->N);
    for (size_t i = 0; i < b->N; i++) {
        if (!keep[i])
            continue;
        b->branch[out++] = b->branch[i];
        if (i < b->dynamic)
            b->vertex[dynamic++] = b->vertex[i];
        mouth += i >= b->N - b->mouth;
    }
    b->N = out;
    b->dynamic = dynamic;
    b->mouth = mouth;
    baked_find_blended(b);
}

void baked_drop_neck(struct baked *b)
{
    memset(b->neck, 0, b->N * sizeof *b->neck);
    baked_find_blended(b);
}

size_t baked_drop_clear(struct baked *b)
{
    uint8_t *keep = malloc(b->N + 1);
    size_t before = b->N;

    for (size_t i = 0; keep && i < b->N; i++)
        keep[i] = b->opacity[i] >= 1.0f / 255;
    if (keep)
        baked_keep(b, keep);
    free(keep);
    return before - b->N;
}

/* ---- Phase B ----------------------------------------------------------- */

int baked_move_init(struct baked_move *m, const struct baked *b,
                    struct error *err)
{
    memset(m, 0, sizeof *m);
    m->mean = malloc((3 * b->dynamic + 1) * sizeof *m->mean);
    m->blended = malloc((3 * b->blended + 1) * sizeof *m->blended);
    if (m->mean && m->blended)
        return 0;
    baked_move_release(m);
    return error_set(err, EX_OSERR, "no memory for %zu Gaussians", b->N);
}

void baked_move_release(struct baked_move *m)
{
    free(m->mean);
    free(m->blended);
    memset(m, 0, sizeof *m);
}

/* How b moves. */
static struct drive baked_how(const struct baked *b)
{
    struct drive d = {
        .dynamic = b->dynamic, .mouth = b->N - b->mouth,
        .mouth_count = b->mouth, .vertex = b->vertex, .mean = b->mean,
        .weight = b->neck
    };

    memcpy(d.pivot, b->pivot, sizeof d.pivot);
    memcpy(d.source, b->source, sizeof d.source);
    return d;
}

/* What moves of b in one frame, but for static centres: only a renderer or
 * baked_means wants those. */
void baked_drive(struct baked_move *m, const struct baked *b,
                 const struct densify *mesh, const float *verts,
                 const float lip[3], float gap, float closed,
                 const float cam[12])
{
    const struct drive d = baked_how(b);

    drive_bodies(&m->frame, &d, cam);
    drive_dynamic(m->mean, m->mean, &d, &m->frame, mesh, verts);
    relative_pose(m->relative_pose, b->source, b->light, cam);
    /* a hidden mouth goes 1000 units behind */
    for (int c = 0; c < 3; c++)
        m->frame.to[c] = gap < closed ? -1000 * cam[8 + c]
                                      : lip[c] - b->lip[c];
}

/* Only what moved goes to the renderer. */
int baked_move_scene(struct splat *s, struct baked_move *m,
                     const struct baked *b, struct error *err)
{
    const struct drive d = baked_how(b);

    drive_static(m->blended, &d, &m->frame, b->first, b->blended);
    if (splat_update(s, m->mean, 0, b->dynamic, err) ||
        (b->blended &&
         splat_update(s, m->blended, b->first, b->blended, err)) ||
        (b->mouth && splat_shift(s, m->frame.to, b->N - b->mouth, b->mouth,
                                 err)))
        return -1;
    return 0;
}

void baked_means(float *means, const struct baked *b,
                 const struct baked_move *m)
{
    const struct drive d = baked_how(b);

    memcpy(means, m->mean, 3 * b->dynamic * sizeof *means);
    drive_static(means + 3 * b->dynamic, &d, &m->frame, b->dynamic,
                 b->N - b->mouth - b->dynamic);
    drive_mouth(means + 3 * (b->N - b->mouth), &d, &m->frame);
}
