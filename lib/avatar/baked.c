#include "lib/avatar/baked.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"
#include "lib/avatar/branches.h"
#include "lib/record/gaussians.h"

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

static int read_vertices(struct baked *b, const struct gaus *g,
                         size_t vertices, struct error *err)
{
    if (g->vertex && g->vertices != b->dynamic)
        return error_set(err, EX_DATAERR, "GAUS vertex has %zu numbers "
                         "(expected %zu, one for each dynamic Gaussian)",
                         g->vertices, b->dynamic);
    for (size_t i = 0; i < b->dynamic; i++) {
        int32_t k = g->vertex ? g->vertex[i] : (int32_t)i;

        if (k < 0 || (vertices && (size_t)k >= vertices))
            return error_set(err, EX_DATAERR, "GAUS vertex[%zu] is %d "
                             "(expected 0 to %zu: identity and head belong "
                             "together)", i, k, vertices - 1);
        b->vertex[i] = k;
    }
    return 0;
}

/* What moves the Gaussians, where the record says it. */
static int read_motion(struct baked *b, const struct gaus *g,
                       struct error *err)
{
    if (g->lip)
        memcpy(b->lip, g->lip, sizeof b->lip);
    if (g->light)
        memcpy(b->light, g->light, sizeof b->light);
    if (!g->bend)
        return 0;
    if (!g->pivot || !g->source)
        return error_set(err, EX_DATAERR, "GAUS has bend without %s",
                         g->pivot ? "source" : "pivot");
    memcpy(b->bend, g->bend, b->N * sizeof *g->bend);
    memcpy(b->pivot, g->pivot, sizeof b->pivot);
    memcpy(b->source, g->source, sizeof b->source);
    find_bent(b);
    return 0;
}

int baked_read(struct baked *b, const struct record *rec, size_t vertices,
               struct error *err)
{
    struct gaus g;
    size_t n[3];

    memset(b, 0, sizeof *b);
    if (gaus_read(&g, rec, err))
        return -1;
    if (!g.branch)
        return error_set(err, EX_DATAERR, "GAUS has no array 'branch' "
                         "(expected u8[%zu])", g.n);
    if (count_branches(n, g.branch, g.n, err) ||
        allocate(b, g.n, g.channels, n[0], err))
        return -1;
    b->mouth = n[2];
    memcpy(b->mean, g.mean, 3 * g.n * sizeof *g.mean);
    memcpy(b->scale, g.scale, 3 * g.n * sizeof *g.scale);
    memcpy(b->quat, g.quat, 4 * g.n * sizeof *g.quat);
    memcpy(b->opacity, g.opacity, g.n * sizeof *g.opacity);
    memcpy(b->branch, g.branch, g.n);
    for (size_t i = 0; i < g.n * g.channels; i++)
        b->color[i] = g.color ? g.color[i] : half_to_float(g.color_half[i]);
    if (read_vertices(b, &g, vertices, err) || read_motion(b, &g, err)) {
        baked_release(b);
        return -1;
    }
    return 0;
}

int baked_write(struct stream_writer *w, uint64_t frame, double time,
                const struct baked *b, const float *means, const float *cam,
                struct error *err)
{
    const struct gaus g = {
        .n = b->N, .channels = b->C, .mean = means ? means : b->mean,
        .scale = b->scale, .quat = b->quat, .opacity = b->opacity,
        .color = b->color, .branch = b->branch, .vertex = b->vertex,
        .vertices = b->dynamic, .lip = b->lip, .bend = b->bend,
        .pivot = b->pivot, .source = b->source, .light = b->light, .cam = cam
    };

    return gaus_write(w, frame, time, &g, err);
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
