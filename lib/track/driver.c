/* Frames of a driving clip through the tracker.  Frames before the first face
 * are counted, and delivered with the first motion once it is known. */
#include "lib/track/driver.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"

void driver_init(struct driver *d, struct track *t, driver_read_fn *read,
                 void *ctx)
{
    memset(d, 0, sizeof *d);
    d->track = t;
    d->read = read;
    d->ctx = ctx;
    d->patience = DRIVER_PATIENCE;
}

void driver_release(struct driver *d)
{
    free(d->early);
    memset(d, 0, sizeof *d);
}

int driver_read_source(void *source, struct frame *f, struct error *err)
{
    return framesource_read(source, f, err);
}

/* Remember that a frame without a face was there. */
static int driver_remember(struct driver *d, const struct frame *f,
                           struct error *err)
{
    if (d->early_count == d->early_room) {
        size_t room = d->early_room ? 2 * d->early_room : 64;
        double *p = realloc(d->early, room * sizeof *p);
        if (!p)
            return error_set(err, EX_OSERR, "out of memory");
        d->early = p;
        d->early_room = room;
    }
    d->early[d->early_count++] = f->time;
    return 0;
}

/* What was tried in vain; f is the last frame. */
static enum driver_status driver_no_face(const struct driver *d,
                                         const struct frame *f,
                                         struct error *err)
{
    if (d->early_count == 0)
        error_set(err, EX_DATAERR, "no frames");
    else
        error_set(err, EX_DATAERR,
                  "no face in %zu frame%s of %zu x %zu pixels (looked for "
                  "frontal and profile faces from a twelfth of the picture "
                  "up; --crop X,Y,SIZE says where it is)", d->early_count,
                  d->early_count == 1 ? "" : "s", f->width, f->height);
    return DRIVER_NO_FACE;
}

enum driver_status driver_start(struct driver *d,
                                void (*seen)(void *, const struct frame *),
                                void *seen_ctx, struct error *err)
{
    struct frame f = {0}, last = {0};
    int rc;

    while ((rc = d->read(d->ctx, &f, err)) == 1) {
        int found = track_start(d->track, &d->found, f.rgb, f.width,
                                f.height, f.time, err);
        if (found < 0)
            return DRIVER_ERROR;
        if (found) {
            d->first = f;
            d->started = true;
            return DRIVER_STARTED;
        }
        if (seen)
            seen(seen_ctx, &f);
        if (driver_remember(d, &f, err) != 0)
            return DRIVER_ERROR;
        last = f;
        if (d->early_count == d->patience)
            return driver_no_face(d, &last, err);
    }
    if (rc < 0)
        return DRIVER_ERROR;
    return driver_no_face(d, &last, err);
}

void driver_set_relative(struct driver *d, const struct motion *source,
                         size_t nexp)
{
    relative_init(&d->rest, source, &d->found.motion, nexp);
    d->relative = true;
}

/* As the track has them: 1, 0 at the end, -1. */
static int driver_track(struct driver *d, struct driver_frame *f,
                        struct error *err)
{
    double begun;
    int rc;

    memset(f, 0, sizeof *f);
    if (d->early_next < d->early_count) {
        f->r = d->found;
        f->r.lost = true;
        f->r.crop_s = f->r.network_s = f->r.heads_s = f->r.detect_s = 0;
        f->r.motion.pose.exp = f->r.motion.exp;
        f->picture.index = d->early_next;
        f->picture.time = d->early[d->early_next++];
        return 1;
    }
    if (!d->first_given) {
        d->first_given = true;
        f->picture = d->first;
        f->r = d->found;
        f->r.motion.pose.exp = f->r.motion.exp;
        return 1;
    }
    begun = cpu_seconds();
    rc = d->read(d->ctx, &f->picture, err);
    f->decode_s = cpu_seconds() - begun;
    if (rc <= 0)
        return rc;
    if (track_step(d->track, &f->r, f->picture.rgb, f->picture.width,
                   f->picture.height, f->picture.time, err) != 0)
        return -1;
    f->r.motion.pose.exp = f->r.motion.exp;
    return 1;
}

int driver_next(struct driver *d, struct driver_frame *f, struct error *err)
{
    int rc = driver_track(d, f, err);

    if (rc == 1 && d->relative)
        relative_apply(&f->r.motion, &d->rest);
    return rc;
}
