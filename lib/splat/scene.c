#include "lib/splat/scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"
#include "lib/geom/bend.h"

enum { STATIC = 1, MOUTH = 2 };

void scene_release(struct scene *s)
{
    free(s->mean);
    free(s->loaded);
    free(s->scale);
    free(s->quat);
    free(s->opacity);
    free(s->bend);
    free(s->color);
    free(s->color_half);
    free(s->branch);
    memset(s, 0, sizeof *s);
}

/* A copy of n bytes; a scene without Gaussians still has its arrays. */
static void *copy(const void *p, size_t n)
{
    void *out = malloc(n + 1);
    if (out && n)
        memcpy(out, p, n);
    return out;
}

/* Required float array of `width` numbers a Gaussian, copied. */
static float *take(const struct record *rec, const char *name, size_t n,
                   size_t width, struct error *err)
{
    const size_t dims[2] = {n, width};
    const struct array *a = record_find(rec, name);

    /* a dimension of 0 would accept any size in record_get */
    if (a && n == 0 && array_count(a) != 0) {
        error_set(err, EX_DATAERR, "%s %s has %zu numbers (expected none)",
                  rec->type, name, array_count(a));
        return NULL;
    }
    const float *p = record_get(rec, name, DTYPE_F32, width > 1 ? 2 : 1,
                                dims, err);
    float *out = p ? copy(p, n * width * sizeof *p) : NULL;
    if (p && !out)
        error_set(err, EX_OSERR, "out of memory for %zu Gaussians", n);
    return out;
}

static int take_color(struct scene *s, const struct record *rec,
                      struct error *err)
{
    const struct array *a = record_find(rec, "color");

    if (!a || a->ndim != 2 || a->dim[0] != s->g.n || a->dim[1] < 1 ||
        a->dim[1] > SPLAT_MAX_CHANNELS ||
        (a->dtype != DTYPE_F32 && a->dtype != DTYPE_F16))
        return error_set(err, EX_DATAERR,
                         "GAUS color is %s (expected f16 or f32 of %zu x 1 to "
                         "%d)", a ? "of another type or shape" : "missing",
                         s->g.n, SPLAT_MAX_CHANNELS);
    void *p = copy(a->data, array_bytes(a));
    if (!p)
        return error_set(err, EX_OSERR, "out of memory for the colours");
    s->g.channels = (int)a->dim[1];
    if (a->dtype == DTYPE_F32)
        s->g.color = s->color = p;
    else
        s->g.color_half = s->color_half = p;
    return 0;
}

/* The mouth sheet moves as one block, so it must be one range. */
static int find_mouth(struct scene *s, struct error *err)
{
    s->mouth = s->mouth_count = 0;
    for (size_t i = 0; s->branch && i < s->g.n; i++) {
        if (s->branch[i] > MOUTH)
            return error_set(err, EX_DATAERR,
                             "GAUS branch is %d at index %zu (expected 0, 1 "
                             "or 2)", s->branch[i], i);
        if (s->branch[i] != MOUTH)
            continue;
        if (s->mouth_count && i != s->mouth + s->mouth_count)
            return error_set(err, EX_DATAERR,
                             "GAUS branch: the mouth's Gaussians are not one "
                             "range (index %zu)", i);
        if (!s->mouth_count++)
            s->mouth = i;
    }
    return 0;
}

static int bends(const struct scene *s, size_t i)
{
    return s->branch[i] == STATIC && s->bend[i] != 0;
}

/* The smallest range that holds every static Gaussian that bends. */
static void find_bent(struct scene *s)
{
    size_t lo = 0, hi = s->bend && s->branch ? s->g.n : 0;

    while (lo < hi && !bends(s, lo))
        lo++;
    while (hi > lo && !bends(s, hi - 1))
        hi--;
    s->bent = lo;
    s->bent_count = hi - lo;
}

static int take_camera(struct scene *s, const struct record *rec,
                       struct error *err)
{
    static const size_t dims[2] = {3, 4};
    const float *cam;

    if (!record_find(rec, "cam"))
        return 0;
    if (!(cam = record_get(rec, "cam", DTYPE_F32, 2, dims, err)))
        return -1;
    memcpy(s->cam, cam, sizeof s->cam);
    s->has_cam = 1;
    return 0;
}

/* GAUS may say how the source's camera saw the head, and in which light. */
static int take_source(struct scene *s, const struct record *rec,
                       struct error *err)
{
    static const size_t dims[2] = {3, 3}, three[1] = {3};
    const float *source, *light;

    if (!record_find(rec, "source") || !record_find(rec, "light"))
        return 0;
    if (!(source = record_get(rec, "source", DTYPE_F32, 2, dims, err)) ||
        !(light = record_get(rec, "light", DTYPE_F32, 1, three, err)))
        return -1;
    memcpy(s->light, light, sizeof s->light);
    memcpy(s->source, source, sizeof s->source);
    s->has_source = 1;
    return 0;
}

static int load(struct scene *s, const struct record *rec, struct error *err)
{
    const struct array *mean = record_find(rec, "mean");
    const struct array *branch = record_find(rec, "branch");
    struct scene next = {.has_cam = s->has_cam};

    memcpy(next.cam, s->cam, sizeof next.cam);
    if (!mean || mean->ndim != 2 || mean->dim[1] != 3)
        return error_set(err, EX_DATAERR, "GAUS has no mean of N x 3");
    size_t n = next.g.n = mean->dim[0];
    if (record_check_finite(rec, err))
        return -1;
    if (!(next.g.mean = next.mean = take(rec, "mean", n, 3, err)) ||
        !(next.loaded = take(rec, "mean", n, 3, err)) ||
        !(next.g.scale = next.scale = take(rec, "scale", n, 3, err)) ||
        !(next.g.quat = next.quat = take(rec, "quat", n, 4, err)) ||
        !(next.g.opacity = next.opacity = take(rec, "opacity", n, 1, err)) ||
        take_color(&next, rec, err) || take_camera(&next, rec, err) ||
        take_source(&next, rec, err) ||
        (record_find(rec, "bend") &&
         !(next.bend = take(rec, "bend", n, 1, err))))
        goto failed;
    if (branch) {
        if (branch->dtype != DTYPE_U8 || array_count(branch) != n) {
            error_set(err, EX_DATAERR,
                      "GAUS branch has %zu values (expected u8 of %zu)",
                      array_count(branch), n);
            goto failed;
        }
        if (!(next.branch = copy(branch->data, n))) {
            error_set(err, EX_OSERR, "out of memory for %zu Gaussians", n);
            goto failed;
        }
        next.g.branch = next.branch;
    }
    if (find_mouth(&next, err))
        goto failed;
    find_bent(&next);
    scene_release(s);
    *s = next;
    return SCENE_LOADED;
failed:
    scene_release(&next);
    return -1;
}

static int move_means(struct scene *s, const struct record *rec,
                      struct error *err)
{
    static const size_t one[1] = {1}, any[2] = {0, 3};
    const struct array *a = record_find(rec, "mean");

    s->first = s->count = 0;
    if (!a)
        return 0;
    const int32_t *first = record_get(rec, "first", DTYPE_I32, 1, one, err);
    const float *mean = record_get(rec, "mean", DTYPE_F32, 2, any, err);
    if (!first || !mean)
        return -1;
    if (*first < 0 || (size_t)*first > s->g.n ||
        a->dim[0] > s->g.n - (size_t)*first)
        return error_set(err, EX_DATAERR,
                         "GMOV moves Gaussians %d to %zu (expected within "
                         "%zu)", *first, (size_t)*first + a->dim[0], s->g.n);
    s->first = (size_t)*first;
    s->count = a->dim[0];
    memcpy(s->mean + 3 * s->first, mean, 3 * s->count * sizeof *mean);
    return 0;
}

static int move_mouth(struct scene *s, const struct record *rec,
                      struct error *err)
{
    static const size_t three[1] = {3};
    const float *shift;

    s->shifted = 0;
    if (!record_find(rec, "shift"))
        return 0;
    if (!(shift = record_get(rec, "shift", DTYPE_F32, 1, three, err)))
        return -1;
    memcpy(s->shift, shift, sizeof s->shift);
    s->shifted = 1;
    for (size_t i = 3 * s->mouth; i < 3 * (s->mouth + s->mouth_count); i++)
        s->mean[i] = s->loaded[i] + shift[i % 3];
    return 0;
}

/* Static Gaussians follow the shoulders (lib/geom/bend.h). */
static int move_shoulders(struct scene *s, const struct record *rec,
                          struct error *err)
{
    static const size_t dims[2] = {3, 4};
    const float *body;

    s->bowed = 0;
    if (!record_find(rec, "body") || !s->bent_count)
        return 0;
    if (!(body = record_get(rec, "body", DTYPE_F32, 2, dims, err)))
        return -1;
    for (size_t i = s->bent; i < s->bent + s->bent_count; i++)
        if (bends(s, i))
            bend_points(s->mean + 3 * i, s->loaded + 3 * i, s->bend + i, 1,
                        body);
    s->bowed = 1;
    return 0;
}

int scene_apply(struct scene *s, const struct record *rec, struct error *err)
{
    if (record_is(rec, "GAUS"))
        return load(s, rec, err);
    if (!record_is(rec, "GMOV"))
        return SCENE_NONE;
    if (!s->mean)
        return error_set(err, EX_DATAERR, "GMOV before any GAUS");
    if (record_check_finite(rec, err) || take_camera(s, rec, err) ||
        move_means(s, rec, err) || move_shoulders(s, rec, err) ||
        move_mouth(s, rec, err))
        return -1;
    return SCENE_MOVED;
}

int scene_to_splat(struct splat *out, const struct scene *s,
                   enum scene_change change, struct error *err)
{
    if (change == SCENE_LOADED)
        return splat_load(out, &s->g, err);
    if (change == SCENE_MOVED && s->count &&
        splat_update(out, s->mean + 3 * s->first, s->first, s->count, err))
        return -1;
    if (change == SCENE_MOVED && s->bowed &&
        splat_update(out, s->mean + 3 * s->bent, s->bent, s->bent_count, err))
        return -1;
    if (change == SCENE_MOVED && s->shifted && s->mouth_count)
        return splat_shift(out, s->shift, s->mouth, s->mouth_count, err);
    return 0;
}

void scene_rgb(float rgb[3], const struct scene *s, size_t i)
{
    size_t c = (size_t)s->g.channels;
    for (size_t k = 0; k < 3; k++) {
        size_t at = c * i + (k < c ? k : c - 1);
        rgb[k] = s->color ? s->color[at] : half_to_float(s->color_half[at]);
    }
}
