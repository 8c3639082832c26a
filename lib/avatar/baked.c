/* Baked avatars: copies of what Phase A made, as GAUS records, and moved in
 * Phase B by lib/base/drive.h. */
#include "lib/avatar/baked.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"
#include "lib/base/neck_blend.h"
#include "lib/base/slices.h"
#include "lib/stream/records.h"
#include "lib/splat/splat.h"

#define ARRAYS 13

/* All of b's floats. */
static void baked_arrays(struct slice to[ARRAYS], struct baked *b)
{
    const size_t N = b->N;
    const struct slice all[ARRAYS] = {
        {&b->mean, 3 * N, false}, {&b->scale, 3 * N, false},
        {&b->quat, 4 * N, false}, {&b->opacity, N, false},
        {&b->neck, N, false}, {&b->uv, 2 * N, false}, {&b->seen, N, false},
        {&b->reach, N, false}, {&b->tilt, 2 * N, false},
        {&b->normal, 3 * N, false}, {&b->around, 2 * N, false},
        {&b->jaw, 3 * N, false}, {&b->color, b->C * N, false}
    };

    memcpy(to, all, sizeof all);
}

/* N Gaussians of C colours, the first `dynamic` on the mesh; all zero. */
static int baked_allocate(struct baked *b, size_t N, size_t C,
                          size_t dynamic, struct error *err)
{
    struct slice array[ARRAYS];

    *b = (struct baked){.N = N, .C = C, .dynamic = dynamic};
    baked_arrays(array, b);
    b->branch = malloc(N + 1);
    b->vertex = malloc((dynamic + 1) * sizeof *b->vertex);
    if (!b->branch || !b->vertex ||
        slices_allocate(&b->block, array, ARRAYS, false, err)) {
        baked_release(b);
        return error_set(err, EX_OSERR, "no memory for %zu Gaussians", N);
    }
    memcpy(b->source, neck_blend_upright, sizeof b->source);
    return 0;
}

/* The range of the static Gaussians that the neck blend moves. */
static void baked_find_blended(struct baked *b)
{
    neck_blend_range(&b->first, &b->blended, b->neck, b->dynamic,
                     b->N - b->mouth);
}

/* How many of [from, to) are kept; keep NULL: all. */
static size_t baked_count_kept(const uint8_t *keep, size_t from, size_t to)
{
    size_t n = 0;

    for (size_t i = from; keep && i < to; i++)
        n += keep[i] != 0;
    return keep ? n : to - from;
}

/* Rows of x (N,width) with keep[i], or all of them (NULL), one after another
 * to `to`, which may be x. */
static void baked_keep_rows(float *to, const float *x, size_t width,
                            const uint8_t *keep, size_t N)
{
    if (!keep) {
        memcpy(to, x, N * width * sizeof *x);
        return;
    }
    for (size_t i = 0; i < N; i++)
        if (keep[i]) {
            memmove(to, x + i * width, width * sizeof *x);
            to += width;
        }
}

int baked_from_set(struct baked *b, const struct gaussians *g, size_t dynamic,
                   const uint8_t *keep, struct error *err)
{
    const size_t N = g->n, C = (size_t)g->channels;
    size_t out = 0;

    if (baked_allocate(b, baked_count_kept(keep, 0, N), C,
                       baked_count_kept(keep, 0, dynamic), err))
        return -1;
    baked_keep_rows(b->mean, g->mean, 3, keep, N);
    baked_keep_rows(b->scale, g->scale, 3, keep, N);
    baked_keep_rows(b->quat, g->quat, 4, keep, N);
    baked_keep_rows(b->opacity, g->opacity, 1, keep, N);
    baked_keep_rows(b->color, g->color, C, keep, N);
    for (size_t i = 0; i < N; i++) {
        if (keep && !keep[i])
            continue;
        b->branch[out] = g->branch[i];
        if (i < dynamic)
            b->vertex[out] = (int32_t)i;
        out++;
    }
    return 0;
}

/* The Gaussians that the rules may draw: opacity of 1/255 and more. */
static uint8_t *baked_find_drawn(const float *opacity, size_t N)
{
    uint8_t *keep = malloc(N + 1);

    for (size_t i = 0; keep && i < N; i++)
        keep[i] = opacity[i] >= 1.0f / 255;
    return keep;
}

/* Motion and places of a's Gaussians that are kept. */
static void baked_copy_motion(struct baked *b, const struct avatar *a,
                              const uint8_t *keep)
{
    const size_t N = a->set.n, mouth = a->first[BRANCH_MOUTH];

    b->mouth = baked_count_kept(keep, mouth, N);
    memcpy(b->lip, a->mouth.lips.centre, sizeof b->lip);
    b->has_jaw = a->drive.jaw != NULL;
    if (b->has_jaw)
        baked_keep_rows(b->jaw + 3 * (b->N - b->mouth), a->drive.jaw, 3,
                        keep ? keep + mouth : NULL, N - mouth);
    memcpy(b->chin, a->mouth.lips.chin, sizeof b->chin);
    baked_keep_rows(b->neck, a->drive.weight, 1, keep, N);
    memcpy(b->pivot, a->drive.pivot, sizeof b->pivot);
    memcpy(b->source, a->drive.source, sizeof b->source);
    memcpy(b->light, a->light, sizeof b->light);
    baked_keep_light(b);
    if (a->config.rgb_skip) {
        baked_keep_rows(b->uv, a->uv, 2, keep, N);
        baked_keep_rows(b->seen, a->all.seen, 1, keep, N);
        baked_keep_rows(b->reach, a->reach, 1, keep, N);
        baked_keep_rows(b->tilt, a->tilt, 2, keep, N);
        baked_keep_rows(b->normal, a->normal, 3, keep, N);
        if (a->grain.size)
            baked_keep_rows(b->around, a->grain.around, 2, keep, N);
        memcpy(b->view, a->source.cam, sizeof b->view);
    }
    baked_find_blended(b);
}

/* A copy of a grain (size,size). */
static int baked_copy_grain(struct baked *b, const uint8_t *grain, size_t size,
                            struct error *err)
{
    b->grain = malloc(size * size);
    if (!b->grain) {
        baked_release(b);
        return error_set(err, EX_OSERR, "no memory for a grain of %zu pixels",
                         size);
    }
    b->grain_size = size;
    memcpy(b->grain, grain, size * size);
    return 0;
}

int baked_from_avatar(struct baked *b, const struct avatar *a, bool drawn,
                      struct error *err)
{
    const size_t N = a->set.n;
    uint8_t *keep = drawn ? baked_find_drawn(a->set.opacity, N) : NULL;
    int rc = drawn && !keep
        ? error_set(err, EX_OSERR, "no memory for %zu Gaussians", N)
        : baked_from_set(b, &a->set, a->first[BRANCH_STATIC], keep, err);

    if (rc == 0)
        baked_copy_motion(b, a, keep);
    if (rc == 0 && a->grain.size)
        rc = baked_copy_grain(b, a->grain.picture, a->grain.size, err);
    free(keep);
    return rc;
}

void baked_release(struct baked *b)
{
    free(b->block);
    free(b->branch);
    free(b->vertex);
    free(b->grain);
    memset(b, 0, sizeof *b);
}

bool baked_is_lit(const struct baked *b)
{
    return b->light[0] != 0 || b->light[1] != 0 || b->light[2] != 0;
}

void baked_keep_light(struct baked *b)
{
    relative_lamp(b->lamp, b->source, b->light);
}

bool baked_has_places(const struct baked *b)
{
    return b->view[11] > 0;
}

struct gaussians baked_set(const struct baked *b)
{
    return (struct gaussians){
        .n = b->N, .channels = (int)b->C, .mean = b->mean, .scale = b->scale,
        .quat = b->quat, .opacity = b->opacity, .color = b->color,
        .branch = b->branch, .uv = b->uv, .seen = b->seen,
        .reach = b->reach, .tilt = b->tilt,
        .around = b->grain ? b->around : NULL,
        .normal = baked_is_lit(b) ? b->normal : NULL,
        .light = {b->light[0], b->light[1], b->light[2]}
    };
}

/* The mouth's rows of jaw, where it has them. */
static const float *baked_jaw(const struct baked *b)
{
    return b->has_jaw ? b->jaw + 3 * (b->N - b->mouth) : NULL;
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

/* Which vertex each dynamic Gaussian is on; in order when g does not say. */
static int baked_read_vertices(struct baked *b, const struct gaus *g,
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
static int baked_read_motion(struct baked *b, const struct gaus *g,
                             struct error *err)
{
    if (g->lip)
        memcpy(b->lip, g->lip, sizeof b->lip);
    b->has_jaw = g->jaw != NULL;
    if (g->jaw && g->jaws != b->mouth)
        return error_set(err, EX_DATAERR, "GAUS jaw has %zu rows (expected "
                         "%zu, one for each of the mouth's)", g->jaws,
                         b->mouth);
    if (g->jaw) {
        memcpy(b->jaw + 3 * (b->N - b->mouth), g->jaw,
               3 * b->mouth * sizeof *b->jaw);
        memcpy(b->chin, g->chin, sizeof b->chin);
    }
    if (g->light && g->normal) {
        memcpy(b->light, g->light, sizeof b->light);
        memcpy(b->normal, g->normal, 3 * b->N * sizeof *g->normal);
    }
    if (g->source)
        memcpy(b->source, g->source, sizeof b->source);
    baked_keep_light(b);
    if (g->lamp)
        memcpy(b->lamp, g->lamp, sizeof b->lamp);
    if (!g->bend)
        return 0;
    if (!g->pivot || !g->source)
        return error_set(err, EX_DATAERR, "GAUS has bend without %s",
                         g->pivot ? "source" : "pivot");
    memcpy(b->neck, g->bend, b->N * sizeof *g->bend);
    memcpy(b->pivot, g->pivot, sizeof b->pivot);
    baked_find_blended(b);
    return 0;
}

/* Copies of what the record has; colours may be half precision. */
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
    if (baked_count(n, g.branch, g.n, err) ||
        baked_allocate(b, g.n, g.channels, n[0], err))
        return -1;
    b->mouth = n[2];
    memcpy(b->mean, g.mean, 3 * g.n * sizeof *g.mean);
    memcpy(b->scale, g.scale, 3 * g.n * sizeof *g.scale);
    memcpy(b->quat, g.quat, 4 * g.n * sizeof *g.quat);
    memcpy(b->opacity, g.opacity, g.n * sizeof *g.opacity);
    memcpy(b->branch, g.branch, g.n);
    for (size_t i = 0; i < g.n * g.channels; i++)
        b->color[i] = g.color ? g.color[i] : half_to_float(g.color_half[i]);
    if (g.view) {
        memcpy(b->uv, g.uv, 2 * g.n * sizeof *g.uv);
        memcpy(b->seen, g.seen, g.n * sizeof *g.seen);
        memcpy(b->view, g.view, sizeof b->view);
        if (g.reach)
            memcpy(b->reach, g.reach, g.n * sizeof *g.reach);
        if (g.tilt)
            memcpy(b->tilt, g.tilt, 2 * g.n * sizeof *g.tilt);
        if (g.around)
            memcpy(b->around, g.around, 2 * g.n * sizeof *g.around);
        if (g.around && baked_copy_grain(b, g.grain, g.grain_size, err))
            return -1;
    }
    if (baked_read_vertices(b, &g, vertices, err) ||
        baked_read_motion(b, &g, err)) {
        baked_release(b);
        return -1;
    }
    return 0;
}

/* *seen (N, freed by the caller): how far the photograph still shows Gaussians
 * that moved to means. */
static int baked_seen(float **seen, const struct baked *b, const float *means,
                      struct error *err)
{
    *seen = malloc((b->N + 1) * sizeof **seen);
    if (!*seen)
        return error_set(err, EX_OSERR, "no memory for %zu Gaussians", b->N);
    for (size_t i = 0; i < b->N; i++)
        (*seen)[i] = gaussian_seen(b->seen[i], b->reach[i], b->mean + 3 * i,
                                   means + 3 * i);
    return 0;
}

int baked_write(struct stream_writer *w, uint64_t frame, double time,
                const struct baked *b, const float *means, const float *cam,
                struct error *err)
{
    struct gaus g = {
        .n = b->N, .channels = b->C, .mean = means ? means : b->mean,
        .scale = b->scale, .quat = b->quat, .opacity = b->opacity,
        .color = b->color, .branch = b->branch, .vertex = b->vertex,
        .vertices = b->dynamic, .lip = b->lip, .bend = b->neck,
        .pivot = b->pivot, .source = b->source, .light = b->light, .cam = cam,
        .uv = b->uv, .seen = b->seen, .view = b->view, .reach = b->reach,
        .tilt = b->tilt, .normal = b->normal,
        .around = b->grain ? b->around : NULL, .grain = b->grain,
        .grain_size = b->grain_size
    };
    float *left = NULL, own[LAMP_SIZE];

    relative_lamp(own, b->source, b->light);
    if (memcmp(own, b->lamp, sizeof own))
        g.lamp = b->lamp;
    if (b->has_jaw) {
        g.jaw = baked_jaw(b);
        g.jaws = b->mouth;
        g.chin = b->chin;
    }
    if (means && baked_seen(&left, b, means, err))
        return -1;
    if (means) {
        g.seen = left;
        g.reach = NULL;
    }
    if (!baked_has_places(b)) {
        g.uv = g.seen = g.view = g.reach = g.tilt = g.around = NULL;
        g.grain = NULL;
    }
    if (!baked_is_lit(b))
        g.normal = NULL;
    int rc = gaus_write(w, frame, time, &g, err);
    free(left);
    return rc;
}

/* ---- leaving out ------------------------------------------------------- */

void baked_keep(struct baked *b, const uint8_t *keep)
{
    struct slice array[ARRAYS];
    size_t out = 0, dynamic = 0, mouth = 0;

    baked_arrays(array, b);
    for (size_t k = 0; k < ARRAYS && b->N; k++) {
        float *x = *(float **)array[k].at;

        baked_keep_rows(x, x, array[k].n / b->N, keep, b->N);
    }
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
    uint8_t *keep = baked_find_drawn(b->opacity, b->N);
    size_t before = b->N;

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
    m->mouth = malloc((3 * b->mouth + 1) * sizeof *m->mouth);
    if (m->mean && m->blended && m->mouth)
        return 0;
    baked_move_release(m);
    return error_set(err, EX_OSERR, "no memory for %zu Gaussians", b->N);
}

void baked_move_release(struct baked_move *m)
{
    free(m->mean);
    free(m->blended);
    free(m->mouth);
    memset(m, 0, sizeof *m);
}

/* b as lib/base/drive.h moves it; views of b's arrays. */
static struct drive baked_drive_of(const struct baked *b)
{
    struct drive d = {
        .dynamic = b->dynamic, .mouth = b->N - b->mouth,
        .mouth_count = b->mouth, .vertex = b->vertex, .mean = b->mean,
        .weight = b->neck, .jaw = baked_jaw(b),
        .view = baked_has_places(b) ? b->view : NULL
    };

    memcpy(d.pivot, b->pivot, sizeof d.pivot);
    memcpy(d.source, b->source, sizeof d.source);
    return d;
}

/* What moves of b in one frame, but for static centres: only a renderer or
 * baked_means wants those. */
void baked_drive(struct baked_move *m, const struct baked *b,
                 const struct densify *mesh, const float *verts,
                 const float lip[3], const float *chin, float gap,
                 const float cam[12])
{
    const struct drive d = baked_drive_of(b);

    drive_bodies(&m->frame, &d, cam);
    drive_dynamic(m->mean, m->mean, &d, &m->frame, mesh, verts);
    relative_pose(m->relative_pose, b->source, b->light, cam);
    /* a hidden mouth goes 1000 head units behind the camera */
    for (int c = 0; c < 3; c++) {
        m->frame.to[c] = gap < BAKED_CLOSED ? -1000 * cam[8 + c]
                         : b->has_jaw ? 0 : lip[c] - b->lip[c];
        m->frame.chin[c] = chin ? chin[c] - b->chin[c] : 0;
    }
}

/* Only what moved goes to the renderer. */
int baked_move_scene(struct splat *s, struct baked_move *m,
                     const struct baked *b, struct error *err)
{
    const struct drive d = baked_drive_of(b);

    drive_static(m->blended, &d, &m->frame, b->first, b->blended);
    drive_mouth(m->mouth, &d, &m->frame);
    if (splat_update(s, m->mean, 0, b->dynamic, err) ||
        (b->blended &&
         splat_update(s, m->blended, b->first, b->blended, err)) ||
        (b->mouth && splat_update(s, m->mouth, b->N - b->mouth, b->mouth,
                                  err)))
        return -1;
    return 0;
}

void baked_means(float *means, const struct baked *b,
                 const struct baked_move *m)
{
    const struct drive d = baked_drive_of(b);

    memcpy(means, m->mean, 3 * b->dynamic * sizeof *means);
    drive_static(means + 3 * b->dynamic, &d, &m->frame, b->dynamic,
                 b->N - b->mouth - b->dynamic);
    drive_mouth(means + 3 * (b->N - b->mouth), &d, &m->frame);
}
