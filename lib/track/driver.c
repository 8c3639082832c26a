/* Frames of a driving clip through the tracker.  Frames before the first face
 * are counted, and delivered with the first motion once it is known. */
#include "lib/track/driver.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/base/list.h"
#include "lib/track/rotated.h"
#include "lib/track/take.h"

void driver_init(struct driver *d, struct track *t, driver_read_fn *read,
                 void *ctx)
{
    memset(d, 0, sizeof *d);
    d->track = t;
    d->read = read;
    d->ctx = ctx;
}

void driver_init_records(struct driver *d, struct stream_reader *records,
                         size_t nexp)
{
    memset(d, 0, sizeof *d);
    d->records = records;
    d->nexp = nexp;
}

void driver_init_take(struct driver *d, struct livelink *take, size_t nexp)
{
    memset(d, 0, sizeof *d);
    d->take = take;
    d->nexp = nexp;
}

/* The next row: 1; 0 at the end; -1. */
static int driver_read_take(struct driver *d, struct driver_frame *f,
                            struct error *err)
{
    struct livelink_frame row;
    int rc = livelink_read(d->take, &row, err);

    memset(f, 0, sizeof *f);
    if (rc <= 0)
        return rc;
    f->picture.index = d->rows++;
    f->picture.time = row.time;
    f->r.lost = row.held;
    take_to_motion(&f->r.motion, d->nexp, row.value);
    return 1;
}

/* The next MOTN record: 1; 0 when there is none; -1. */
static int driver_read_record(struct driver *d, struct driver_frame *f,
                              struct error *err)
{
    struct record rec;
    int rc;

    memset(f, 0, sizeof *f);
    while ((rc = stream_read(d->records, &rec, err)) == 1) {
        if (!record_is(&rec, RECORD_MOTN)) {
            if (d->pass)
                d->pass(d->ctx, &rec);
            continue;
        }
        f->picture.index = rec.frame;
        f->picture.time = rec.time;
        return motion_read(&f->r.motion, &rec, d->nexp, err)
                   ? stream_blame(d->records, &rec, err) : 1;
    }
    return rc;
}

/* The next motion that is there already. */
static int driver_read_motion(struct driver *d, struct driver_frame *f,
                              struct error *err)
{
    return d->take ? driver_read_take(d, f, err)
                   : driver_read_record(d, f, err);
}

/* The first of them. */
static int driver_start_motions(struct driver *d, struct error *err)
{
    struct driver_frame f;
    int rc = driver_read_motion(d, &f, err);

    if (rc == 0)                /* a take says it itself */
        error_set(err, EX_DATAERR, "%s: no MOTN records",
                  stream_name(d->records));
    if (rc != 1)
        return -1;
    d->first = f.picture;
    d->found = f.r;
    return 0;
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
    double *time = list_add(&d->early, &d->early_count, &d->early_room,
                            sizeof *time, err);

    if (!time)
        return -1;
    *time = f->time;
    return 0;
}

/* A face in a frame: 1, 0, -1.  In the first one lying faces are looked for,
 * too: people hold cameras sideways and upside down.  The detector looks at all
 * others, E_m at some, as after a loss. */
static int driver_find(struct driver *d, const struct frame *f,
                       struct error *err)
{
    const struct track_effort detector = {.levels = 0};

    if (!d->early_count && !d->live)
        return rotated_start(d->track, &d->found, &d->lying, f, err);
    return track_start(d->track, &d->found, f,
                       d->early_count % TRACK_LOOKS ? &detector : NULL, err);
}

/* What was tried in vain. */
static void driver_no_face(const struct driver *d, struct error *err)
{
    const struct frame *f = &d->first;

    if (d->live && f->width)
        error_set(err, EX_DATAERR, "no face before the end");
    else if (d->early_count == 0)
        error_set(err, EX_DATAERR, "no frames");
    else if (d->track->opt.face > 1)
        error_set(err, EX_DATAERR, "%zu face%s seen in %zu frame%s of %zu "
                  "x %zu pixels (expected %ld)", d->track->max_faces,
                  plural(d->track->max_faces), d->early_count,
                  plural(d->early_count), f->width, f->height,
                  d->track->opt.face);
    else if (d->lying)
        error_set(err, EX_DATAERR, "no upright face in %zu frame%s (the first "
                  "shows one when it is turned by %d degrees clockwise: turn "
                  "the clip)", d->early_count, plural(d->early_count),
                  90 * d->lying);
    else
        error_set(err, EX_DATAERR,
                  "no face in %zu frame%s of %zu x %zu pixels (looked for "
                  "upright faces from a twelfth of the picture up; "
                  "spid-motion --crop X,Y,SIZE says where it is)", d->early_count,
                  plural(d->early_count), f->width, f->height);
}

/* Of the face that was found, where it is asked for. */
static int driver_find_light(struct driver *d, struct error *err)
{
    struct motion *m = &d->found.motion;
    const struct square q = {m->crop[0], m->crop[1], m->crop[2]};

    return d->light ? light_of_crop(m, d->light, q, track_crop, d->track, err)
                    : 0;
}

int driver_start(struct driver *d, const char *name,
                 void (*seen)(void *, const struct frame *), void *seen_ctx,
                 struct error *err)
{
    int found = 0;

    if (d->records || d->take)
        return driver_start_motions(d, err);
    while (!found && !d->lying && d->early_count < DRIVER_PATIENCE) {
        struct frame f;
        const int rc = d->read(d->ctx, &f, err);

        if (rc < 0)
            return -1;
        if (rc == 0)
            break;
        d->first = f;
        found = driver_find(d, &f, err);
        if (found)
            break;
        if (seen)
            seen(seen_ctx, &f);
        if (!d->live && driver_remember(d, &f, err))
            return -1;
    }
    if (found > 0)
        return driver_find_light(d, err);
    if (found == 0)
        driver_no_face(d, err);
    return error_prefix(err, "%s", name);
}

void driver_set_relative(struct driver *d, const struct motion *source,
                         const struct motion *neutral, size_t nexp)
{
    struct motion calm = neutral ? *neutral : d->found.motion;

    if (d->track)
        calm_face(&calm, &d->track->calm);
    relative_init(&d->rest, source, &calm, nexp);
    d->relative = true;
}

/* One frame of a live source, which may have started again with another size
 * or another view: then the face is looked for as in a first frame, and the
 * last motion held. */
static int driver_follow(struct driver *d, struct driver_frame *f,
                         struct error *err)
{
    const struct frame *p = &f->picture;
    const bool first = p->restart && !d->faceless;
    int found;

    if (!p->restart && !d->faceless)
        return track_step(d->track, &f->r, p, err);
    found = track_start(d->track, &f->r, p, NULL, err);
    if (found < 0)
        return -1;
    d->faceless = !found;
    f->r.lost = !found;
    f->r.event = found ? TRACK_FOUND : first ? TRACK_LOST : TRACK_NOTHING;
    f->r.why = "the source has started again";
    if (!found)
        f->r.motion = d->last;
    return 0;
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
        d->last = f->r.motion;
        return 1;
    }
    if (d->records || d->take)
        return driver_read_motion(d, f, err);
    begun = cpu_seconds();
    rc = d->read(d->ctx, &f->picture, err);
    f->decode_s = cpu_seconds() - begun;
    if (rc <= 0)
        return rc;
    if (driver_follow(d, f, err) != 0)
        return -1;
    d->last = f->r.motion;
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
