#include "lib/avatar/baked.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"
#include "lib/avatar/branches.h"

static int allocate(struct baked *b, size_t N, size_t C, size_t dynamic,
                    struct error *err)
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
    b->bend = b->opacity + N;
    b->color = b->bend + N;
    memset(b->bend, 0, N * sizeof *b->bend);
    memcpy(b->source, avatar_upright, sizeof b->source);
    return 0;
}

/* The smallest range that holds every static Gaussian that bends. */
static void find_bent(struct baked *b)
{
    size_t lo = b->dynamic, hi = b->N - b->mouth;

    while (lo < hi && b->bend[lo] == 0)
        lo++;
    while (hi > lo && b->bend[hi - 1] == 0)
        hi--;
    b->first = lo;
    b->bent = hi - lo;
}

int baked_from_avatar(struct baked *b, const struct avatar *a,
                      struct error *err)
{
    const struct gaussians *g = &a->set;
    size_t N = g->n, C = (size_t)g->channels;

    if (allocate(b, N, C, a->first[BRANCH_STATIC], err))
        return -1;
    b->mouth = N - a->first[BRANCH_MOUTH];
    memcpy(b->mean, g->mean, 3 * N * sizeof *b->mean);
    memcpy(b->scale, g->scale, 3 * N * sizeof *b->scale);
    memcpy(b->quat, g->quat, 4 * N * sizeof *b->quat);
    memcpy(b->opacity, g->opacity, N * sizeof *b->opacity);
    memcpy(b->color, g->color, N * C * sizeof *b->color);
    memcpy(b->branch, g->branch, N);
    memcpy(b->lip, a->mouth.centre, sizeof b->lip);
    memcpy(b->bend, a->scratch->bend, N * sizeof *b->bend);
    memcpy(b->pivot, a->bend.pivot, sizeof b->pivot);
    for (int i = 0; i < 9; i++)
        b->source[i] = a->scratch->cam[4 * (i / 3) + i % 3];
    memcpy(b->light, a->light, sizeof b->light);
    find_bent(b);
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
static int count_branches(size_t n[3], const uint8_t *branch, size_t N,
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

static int read_vertices(struct baked *b, const struct record *rec,
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

/* The optional arrays that say how it bends. */
static int read_bending(struct baked *b, const struct record *rec,
                        struct error *err)
{
    const size_t N[1] = {b->N}, three[1] = {3}, nine[2] = {3, 3};
    const float *bend, *pivot, *source;

    if (!record_find(rec, "bend"))
        return 0;
    if (!(bend = record_get(rec, "bend", DTYPE_F32, 1, N, err)) ||
        !(pivot = record_get(rec, "pivot", DTYPE_F32, 1, three, err)) ||
        !(source = record_get(rec, "source", DTYPE_F32, 2, nine, err)))
        return -1;
    memcpy(b->bend, bend, b->N * sizeof *bend);
    memcpy(b->pivot, pivot, sizeof b->pivot);
    memcpy(b->source, source, sizeof b->source);
    find_bent(b);
    return 0;
}

static int read_light(struct baked *b, const struct record *rec,
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
        record_check_finite(rec, err) || count_branches(n, branch, N, err) ||
        allocate(b, N, color->dim[1], n[0], err))
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
    if (read_vertices(b, rec, vertices, err) ||
        read_bending(b, rec, err) || read_light(b, rec, err)) {
        baked_release(b);
        return -1;
    }
    return 0;
}

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
        array_make("bend", DTYPE_F32, b->bend, 1, N, 0, 0, 0),
        array_make("pivot", DTYPE_F32, b->pivot, 1, 3, 0, 0, 0),
        array_make("source", DTYPE_F32, b->source, 2, 3, 3, 0, 0),
        array_make("light", DTYPE_F32, b->light, 1, 3, 0, 0, 0),
        array_make("cam", DTYPE_F32, cam, 2, 3, 4, 0, 0)
    };

    return stream_write(w, "GAUS", frame, time, a, cam ? 13 : 12, err);
}

/* ---- leaving out ------------------------------------------------------- */

static void keep_rows(float *x, size_t width, const uint8_t *keep, size_t N)
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

    keep_rows(b->mean, 3, keep, b->N);
    keep_rows(b->scale, 3, keep, b->N);
    keep_rows(b->quat, 4, keep, b->N);
    keep_rows(b->opacity, 1, keep, b->N);
    keep_rows(b->bend, 1, keep, b->N);
    keep_rows(b->color, b->C, keep, b->N);
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
    find_bent(b);
}

void baked_straighten(struct baked *b)
{
    memset(b->bend, 0, b->N * sizeof *b->bend);
    find_bent(b);
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
    m->bent = malloc((3 * b->bent + 1) * sizeof *m->bent);
    if (m->mean && m->bent)
        return 0;
    baked_move_release(m);
    return error_set(err, EX_OSERR, "no memory for %zu Gaussians", b->N);
}

void baked_move_release(struct baked_move *m)
{
    free(m->mean);
    free(m->bent);
    memset(m, 0, sizeof *m);
}

void baked_drive(struct baked_move *m, const struct baked *b,
                 const struct densify *d, const float *verts,
                 const float lip[3], float gap, float closed,
                 const float cam[12])
{
    size_t V = d->V;

    /* mu_k = densified driven vertex, bent below the chin */
    for (size_t i = 0; i < b->dynamic; i++) {
        size_t k = (size_t)b->vertex[i];

        if (k < V) {
            memcpy(m->mean + 3 * i, verts + 3 * k, 3 * sizeof *verts);
            continue;
        }
        const float *p = verts + 3 * (size_t)d->edge[2 * (k - V)];
        const float *q = verts + 3 * (size_t)d->edge[2 * (k - V) + 1];
        for (int c = 0; c < 3; c++)
            m->mean[3 * i + c] = 0.5f * (p[c] + q[c]);
    }
    bend_body(m->body, b->pivot, avatar_upright, cam);
    bend_points(m->mean, m->mean, b->bend, b->dynamic, m->body);
    bend_body(m->body, b->pivot, b->source, cam);
    turn_since(m->turn, b->source, b->light, cam);
    /* mu = g - l_s + l_d + q; a hidden sheet goes 1000 units behind */
    for (int c = 0; c < 3; c++)
        m->shift[c] = gap < closed ? -1000 * cam[8 + c] : lip[c] - b->lip[c];
}

int baked_move_scene(struct splat *s, struct baked_move *m,
                     const struct baked *b, struct error *err)
{
    bend_points(m->bent, b->mean + 3 * b->first, b->bend + b->first, b->bent,
                m->body);
    if (splat_update(s, m->mean, 0, b->dynamic, err) ||
        (b->bent && splat_update(s, m->bent, b->first, b->bent, err)) ||
        (b->mouth && splat_shift(s, m->shift, b->N - b->mouth, b->mouth,
                                 err)))
        return -1;
    return 0;
}

void baked_means(float *means, const struct baked *b,
                 const struct baked_move *m)
{
    size_t at = b->dynamic, mouth = b->N - b->mouth;

    memcpy(means, m->mean, 3 * at * sizeof *means);
    bend_points(means + 3 * at, b->mean + 3 * at, b->bend + at, mouth - at,
                m->body);
    for (size_t i = mouth; i < b->N; i++)
        for (size_t c = 0; c < 3; c++)
            means[3 * i + c] = b->mean[3 * i + c] + m->shift[c];
}
