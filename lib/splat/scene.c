/* GAUS and GMOV records as a set of Gaussians: checked copies of the arrays,
 * moved as lib/base/drive.h says. */
#include "lib/splat/scene.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/drive.h"
#include "lib/base/neck_blend.h"
#include "lib/stream/records.h"
#include "lib/splat/splat.h"

enum { STATIC = 1, MOUTH = 2 };

void scene_release(struct scene *s)
{
    free(s->mean);
    free(s->block);
    memset(s, 0, sizeof *s);
}

/* The mouth moves as one block, so its Gaussians must be one range. */
static int scene_find_mouth(struct scene *s, struct error *err)
{
    s->mouth = s->mouth_count = 0;
    for (size_t i = 0; s->g.branch && i < s->g.n; i++) {
        if (s->g.branch[i] > MOUTH)
            return error_set(err, EX_DATAERR,
                             "GAUS branch is %d at index %zu (expected 0, 1 "
                             "or 2)", s->g.branch[i], i);
        if (s->g.branch[i] != MOUTH)
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

/* Every Gaussian of the mouth has its row of jaw. */
static int scene_check_jaw(const struct scene *s, const struct gaus *g,
                           struct error *err)
{
    if (!g->jaw || g->jaws == s->mouth_count)
        return 0;
    return error_set(err, EX_DATAERR, "GAUS jaw has %zu rows (expected %zu, "
                     "one for each of the mouth's)", g->jaws,
                     s->mouth_count);
}

/* Only static Gaussians follow the shoulders; a scene that does not say which
 * they are has none. */
static void scene_find_blended(struct scene *s)
{
    size_t n = s->neck && s->g.branch ? s->g.n : 0;

    for (size_t i = 0; i < n; i++)
        if (s->g.branch[i] != STATIC)
            s->neck[i] = 0;
    neck_blend_range(&s->blended, &s->blended_count, s->neck, 0, n);
}

/* What GAUS says of camera, light and shoulders. */
static void scene_take_frame(struct scene *s, const struct gaus *g)
{
    if (g->cam) {
        memcpy(s->cam, g->cam, sizeof s->cam);
        s->has_cam = 1;
    }
    if (g->source && g->light) {
        memcpy(s->source, g->source, sizeof s->source);
        memcpy(s->light, g->light, sizeof s->light);
        relative_lamp(s->lamp, s->source, s->light);
        s->has_source = 1;
    }
    if (s->has_source && g->lamp)
        memcpy(s->lamp, g->lamp, sizeof s->lamp);
    if (g->pivot)
        memcpy(s->pivot, g->pivot, sizeof s->pivot);
    if (g->view)
        memcpy(s->view, g->view, sizeof s->view);
}

/* g's Gaussians, in s->block; what moves or is changed gets memory of its own. */
static int scene_take(struct scene *s, const struct gaus *g, struct error *err)
{
    const size_t n = g->n;

    if (g->channels > SPLAT_MAX_CHANNELS)
        return error_set(err, EX_DATAERR, "GAUS color has %zu channels "
                         "(expected 1 to %d)", g->channels,
                         SPLAT_MAX_CHANNELS);
    s->mean = malloc((4 * n + 1) * sizeof *s->mean);
    if (!s->mean)
        return error_set(err, EX_OSERR, "out of memory for %zu Gaussians", n);
    memcpy(s->mean, g->mean, 3 * n * sizeof *s->mean);
    s->neck = g->bend ? s->mean + 3 * n : NULL;
    if (s->neck)
        memcpy(s->neck, g->bend, n * sizeof *s->neck);
    scene_take_frame(s, g);
    s->loaded = g->mean;
    s->jaw = g->jaw;
    s->grain = g->grain;
    s->grain_size = g->grain_size;
    s->g = (struct gaussians){
        .n = n, .channels = (int)g->channels, .mean = s->mean,
        .scale = g->scale, .quat = g->quat, .opacity = g->opacity,
        .color = g->color, .color_half = g->color_half, .branch = g->branch,
        .uv = g->uv, .seen = g->seen, .reach = g->view ? g->reach : NULL,
        .source_mean = g->view && g->reach ? g->mean : NULL,
        .tilt = g->view ? g->tilt : NULL, .around = g->around,
        .normal = s->has_source ? g->normal : NULL,
        .light = {s->light[0], s->light[1], s->light[2]}
    };
    return 0;
}

/* A GAUS record in place of all the scene holds but its camera. */
static int scene_load(struct scene *s, const struct record *rec,
                      struct error *err)
{
    struct scene next = {.has_cam = s->has_cam};
    struct record kept;
    struct gaus g;

    memcpy(next.cam, s->cam, sizeof next.cam);
    next.block = record_keep(&kept, rec, err);
    if (!next.block || gaus_read(&g, &kept, err) ||
        scene_take(&next, &g, err) || scene_find_mouth(&next, err) ||
        scene_check_jaw(&next, &g, err)) {
        scene_release(&next);
        return -1;
    }
    scene_find_blended(&next);
    scene_release(s);
    *s = next;
    return SCENE_LOADED;
}

/* The centres that GMOV brings as they are. */
static int scene_move_means(struct scene *s, const struct gmov *m,
                            struct error *err)
{
    s->first = s->count = 0;
    if (!m->mean)
        return 0;
    if (*m->first < 0 || (size_t)*m->first > s->g.n ||
        m->count > s->g.n - (size_t)*m->first)
        return error_set(err, EX_DATAERR,
                         "GMOV moves Gaussians %d to %zu (expected within "
                         "%zu)", *m->first, (size_t)*m->first + m->count,
                         s->g.n);
    s->first = (size_t)*m->first;
    s->count = m->count;
    memcpy(s->mean + 3 * s->first, m->mean, 3 * s->count * sizeof *m->mean);
    return 0;
}

/* How the scene moves beyond what GMOV brings whole. */
static struct drive scene_drive(const struct scene *s)
{
    return (struct drive){
        .mouth = s->mouth, .mouth_count = s->mouth_count, .mean = s->loaded,
        .weight = s->neck, .jaw = s->jaw
    };
}

/* The mouth goes by l_d - l_s as a whole, or with the chin. */
static void scene_move_mouth(struct scene *s, const struct gmov *m)
{
    const struct drive d = scene_drive(s);
    struct drive_frame f = {.from = {0}};

    s->mouth_moved = m->shift || (m->chin && s->jaw);
    if (!s->mouth_moved)
        return;
    if (m->shift)
        memcpy(f.to, m->shift, sizeof f.to);
    if (m->chin)
        memcpy(f.chin, m->chin, sizeof f.chin);
    drive_mouth(s->mean + 3 * s->mouth, &d, &f);
}

/* Static Gaussians follow the shoulders. */
static void scene_move_shoulders(struct scene *s, const struct gmov *m)
{
    const struct drive d = scene_drive(s);
    struct drive_frame f;

    s->neck_moved = m->body && s->blended_count;
    if (!s->neck_moved)
        return;
    memcpy(f.plane, m->body, sizeof f.plane);
    for (size_t i = s->blended; i < s->blended + s->blended_count; i++)
        if (s->neck[i] != 0)    /* others may have moved otherwise */
            drive_static(s->mean + 3 * i, &d, &f, i, 1);
}

/* A GMOV record. */
static int scene_move(struct scene *s, const struct record *rec,
                      struct error *err)
{
    struct gmov m;

    if (!s->mean)
        return error_set(err, EX_DATAERR, "GMOV before any GAUS");
    if (gmov_read(&m, rec, err) || scene_move_means(s, &m, err))
        return -1;
    if (m.cam) {
        memcpy(s->cam, m.cam, sizeof s->cam);
        s->has_cam = 1;
    }
    scene_move_shoulders(s, &m);
    scene_move_mouth(s, &m);
    return SCENE_MOVED;
}

/* GAUS replaces all, GMOV moves; other records are nobody's business here. */
int scene_apply(struct scene *s, const struct record *rec, struct error *err)
{
    if (record_is(rec, RECORD_GAUS))
        return scene_load(s, rec, err);
    return record_is(rec, RECORD_GMOV) ? scene_move(s, rec, err) : SCENE_NONE;
}

/* Ranges that moved, in the order that scene_apply applied them. */
int scene_to_splat(struct splat *out, const struct scene *s,
                   enum scene_change change, struct error *err)
{
    if (change == SCENE_LOADED)
        return splat_load(out, &s->g, err);
    if (change == SCENE_MOVED && s->count &&
        splat_update(out, s->mean + 3 * s->first, s->first, s->count, err))
        return -1;
    if (change == SCENE_MOVED && s->neck_moved &&
        splat_update(out, s->mean + 3 * s->blended, s->blended,
                     s->blended_count, err))
        return -1;
    if (change == SCENE_MOVED && s->mouth_moved && s->mouth_count)
        return splat_update(out, s->mean + 3 * s->mouth, s->mouth,
                            s->mouth_count, err);
    return 0;
}
