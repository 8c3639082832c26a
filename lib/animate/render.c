/* The scene drawn record by record. */
#include "lib/animate/render.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/drive.h"
#include "lib/base/relative_pose.h"
#include "lib/splat/reference.h"
#include "lib/splat/relight.h"
#include "lib/splat/splat.h"
#include "lib/photo/place.h"

int render_init(struct render *r, const struct render_options *opt,
                struct framesink *sink, struct error *err)
{
    const size_t size = (size_t)opt->splat.width;
    const size_t C = (size_t)opt->splat.channels;
    const bool half = opt->features && opt->half && !opt->exact;

    *r = (struct render){.opt = *opt, .sink = sink};
    if (splat_init(&r->splat, &opt->splat, err))
        return -1;
    if (opt->exact &&
        !(r->wide = malloc(size * size * (C + 2) * sizeof *r->wide)))
        return error_set(err, EX_OSERR, "no memory for %zu x %zu pixels",
                         size, size);
    if (canvas_init(&r->canvas, size, C, half, opt->splat.depth, err))
        return -1;
    if (opt->features &&
        canvas_init(&r->other, size, C, half, opt->splat.depth, err))
        return -1;
    r->canvas.places = r->other.places = opt->places;
    return 0;
}

void render_release(struct render *r)
{
    scene_release(&r->scene);
    splat_release(&r->splat);
    canvas_release(&r->canvas);
    canvas_release(&r->other);
    free(r->wide);
    texture_release(&r->texture);
}

/* The truth: no cut-offs, in double. */
static int render_exact(struct render *r, const struct splat_camera *cam,
                        struct error *err)
{
    const int size = r->opt.splat.width, channels = r->opt.splat.channels;
    const size_t pixels = (size_t)size * (size_t)size, C = (size_t)channels;
    double *alpha = r->wide + pixels * C, *depth = alpha + pixels;
    struct reference t;

    if (r->scene.g.channels < channels)
        return error_set(err, EX_DATAERR, "color has %d channels (expected "
                         "at least %d)", r->scene.g.channels, channels);
    if (reference_init(&t, &r->scene.g, cam, size, size, channels,
                       SPLAT_EXACT, r->opt.splat.branches, err))
        return -1;
    int rc = reference_forward(r->wide, alpha, depth, NULL, &t, err);

    reference_release(&t);
    for (size_t i = 0; i < pixels * C; i++)
        r->canvas.image[i] = (float)r->wide[i];
    for (size_t p = 0; p < pixels; p++) {
        r->canvas.alpha[p] = (float)alpha[p];
        if (r->canvas.depth)
            r->canvas.depth[p] = (float)depth[p];
    }
    return rc;
}

/* Whether the pictures show the photograph. */
static bool render_shows_photo(const struct render *r)
{
    return r->texture.levels && r->scene.g.uv && r->opt.splat.place;
}

/* The stream's camera: the last, or the source's own of an avatar that
 * nothing has moved; NULL: none so far. */
static const float *render_camera(const struct render *r)
{
    return r->scene.has_cam ? r->scene.cam
                            : r->scene.g.uv ? r->scene.view : NULL;
}

/* What places are relative to.  Shoulders stay before the stream's camera, also
 * where another one goes round the head. */
static void render_set_view(struct render *r, const struct splat_camera *cam)
{
    const struct scene *s = &r->scene;
    const bool blended = s->g.uv && s->has_source && s->blended_count;
    struct drive d = {.view = s->view};
    struct drive_frame f;
    const struct place_shoulders shoulders = {f.plane, s->pivot};

    memcpy(d.pivot, s->pivot, sizeof d.pivot);
    memcpy(d.source, s->source, sizeof d.source);
    if (blended)
        drive_bodies(&f, &d, render_camera(r));
    place_view_make(&r->canvas.view, s->view, cam->rt,
                    blended ? &shoulders : NULL);
    place_view_focal(&r->canvas.view, r->opt.focal);
}

/* Eq. C, and the photograph over it; for a refiner, beside it. */
static int render_fast(struct render *r, const struct splat_camera *cam,
                       struct error *err)
{
    render_set_view(r, cam);
    r->texture.grain = r->scene.grain;
    r->texture.grain_size = r->scene.grain_size;
    r->canvas.lit = r->scene.g.normal && render_camera(r);
    if (r->canvas.lit)
        relative_light(r->canvas.light, r->scene.lamp, render_camera(r));
    return canvas_draw(&r->canvas, &r->splat, cam,
                       render_shows_photo(r) ? &r->texture : NULL,
                       r->opt.features, err);
}

/* What the canvas shows, as it is written. */
static struct framesink_frame render_frame(const struct render *r,
                                           uint64_t frame, double time)
{
    const struct canvas *c = &r->canvas;
    struct framesink_frame f = {
        .width = c->size, .height = c->size, .channels = (int)c->channels,
        .color = c->image, .half = c->half, .alpha = c->alpha,
        .depth = c->depth, .frame = frame, .time = time,
        .photo = r->opt.features && render_shows_photo(r) ? c->photo : NULL};

    if (f.photo && r->opt.places) {
        f.place = c->place;
        memcpy(f.map, &c->view, sizeof f.map);
        f.grain = r->grain_due ? r->scene.grain : NULL;
        f.grain_size = r->scene.grain_size;
    }
    f.gain = f.photo && c->lit ? c->gain : NULL;
    f.tinted = f.gain && relight_tinted(c->tint);
    memcpy(f.tint, c->tint, sizeof f.tint);
    /* of the stream's camera: another one goes round head and light */
    f.rotated = r->scene.has_source && render_camera(r);
    if (f.rotated)
        relative_pose(f.turn, r->scene.source, r->scene.light,
                      render_camera(r));
    return f;
}

/* ---- on its way out ------------------------------------------------------ */

/* The thread: one frame. */
static void *async_write_run(void *arg)
{
    struct async_write *w = arg;

    w->rc = framesink_write(w->sink, &w->frame, &w->err);
    return NULL;
}

/* Start writing f; w is idle.  True: its pixels and the sink are the thread's
 * until async_write_wait.  False: no thread could be made, nothing was done. */
static bool async_write_start(struct async_write *w, struct framesink *sink,
                              const struct framesink_frame *f)
{
    *w = (struct async_write){.sink = sink, .frame = *f};
    w->busy = pthread_create(&w->thread, NULL, async_write_run, w) == 0;
    return w->busy;
}

int async_write_wait(struct async_write *w, struct error *err)
{
    if (!w->busy)
        return 0;
    pthread_join(w->thread, NULL);
    w->busy = false;
    if (w->rc)
        *err = w->err;
    return w->rc;
}

/* Send a picture on its way, and draw into the other canvas from now on. */
static int render_write(struct render *r, const struct framesink_frame *f,
                        struct error *err)
{
    const struct canvas drawn = r->canvas;

    if (async_write_wait(&r->writing, err))
        return -1;
    if (!r->opt.features || !async_write_start(&r->writing, r->sink, f))
        return framesink_write(r->sink, f, err);
    r->canvas = r->other;
    r->other = drawn;
    return 0;
}

/* A picture of the scene as it is. */
static int render_draw(struct render *r, uint64_t frame, double time,
                       struct error *err)
{
    const float *rt = r->opt.camera ? r->opt.camera : render_camera(r);

    r->pending = false;
    if (!rt)
        return error_set(err, EX_DATAERR, "no camera so far (expected cam in "
                         "GAUS or GMOV, or --camera)");
    const struct splat_camera cam =
        splat_camera_square(rt, r->opt.splat.width, r->opt.focal);
    double begun = r->opt.begin();
    int rc = r->opt.exact ? render_exact(r, &cam, err)
                          : render_fast(r, &cam, err);

    r->opt.end("splat", begun);
    if (rc)
        return rc;
    const struct framesink_frame f = render_frame(r, frame, time);

    r->grain_due = false;
    return render_write(r, &f, err);
}

static int render_flush(struct render *r, struct error *err)
{
    return r->pending ? render_draw(r, r->frame, r->time, err) : 0;
}

/* A record that moves nothing. */
static int render_pass(struct render *r, const struct record *rec,
                       struct error *err)
{
    struct stream_writer *out = framesink_stream(r->sink);

    /* from here on the sink is ours alone */
    if (async_write_wait(&r->writing, err))
        return -1;
    if (record_is(rec, RECORD_SRCI) && r->opt.splat.place &&
        texture_read_record(&r->texture, rec, err))
        return -1;
    if (record_is(rec, RECORD_CONF))
        framesink_read_conf(r->sink, rec);
    return out ? stream_copy(out, rec, err) : 0;
}

int render_record(struct render *r, const struct record *rec, struct error *err)
{
    if (record_is(rec, RECORD_GAUS) && render_flush(r, err))
        return -1;
    int change = scene_apply(&r->scene, rec, err);

    if (change < 0 || scene_to_splat(&r->splat, &r->scene,
                                     (enum scene_change)change, err))
        return -1;
    r->grain_due = r->grain_due || change == SCENE_LOADED;
    if (change == SCENE_LOADED && !record_find(rec, "cam")) {
        r->pending = true;
        r->frame = rec->frame;
        r->time = rec->time;
        return 0;
    }
    return change == SCENE_NONE ? render_pass(r, rec, err)
                                : render_draw(r, rec->frame, rec->time, err);
}

int render_finish(struct render *r, struct error *err)
{
    return render_flush(r, err) || async_write_wait(&r->writing, err) ? -1
                                                                      : 0;
}
