/* Looking a clip through for its frame at rest (neutral.h). */
#include "lib/track/neutral.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/video.h"
#include "lib/track/driver.h"

int neutral_parse(const char *value, void *dest, struct error *err)
{
    struct neutral *n = dest;
    char *end;

    *n = (struct neutral){0};
    if (strcmp(value, "first") == 0)
        return 0;
    n->given = true;
    n->automatic = strcmp(value, "auto") == 0;
    if (n->automatic)
        return 0;
    errno = 0;
    n->frame = strtoull(value, &end, 10);
    if (*value < '0' || *value > '9' || *end || errno)
        return error_set(err, EX_USAGE, "not a frame (expected first, auto or "
                         "a number from 0)");
    return 0;
}

/* Standard input and cameras do not show the same frames twice. */
static int neutral_check(const struct neutral_clip *clip, struct error *err)
{
    for (size_t i = 0; i < clip->count; i++)
        if (strcmp(clip->path[i], "-") == 0 || video_is_camera(clip->path[i]))
            return error_set(err, EX_USAGE, "%s: --neutral reads a clip twice "
                             "(expected a file or folder)", clip->path[i]);
    return 0;
}

/* The frame among those of d; 1: found, 0: the clip has none, -1. */
static int neutral_choose(struct motion *m, const struct neutral *n,
                          struct driver *d, size_t nexp, struct error *err)
{
    struct driver_frame f;
    double min = INFINITY;
    int rc, found = 0;

    while ((rc = driver_next(d, &f, err)) > 0) {
        if (f.r.lost || (!n->automatic && f.picture.index != n->frame))
            continue;
        const double tension = relative_tension(&f.r.motion, nexp);
        if (tension < min) {
            min = tension;
            *m = f.r.motion;
            found = 1;
        }
        if (!n->automatic)
            break;
    }
    return rc < 0 ? -1 : found;
}

int neutral_find(struct motion *m, const struct neutral *n,
                 const struct neutral_clip *clip, struct error *err)
{
    struct framesource *in = NULL;
    struct track track = {0};
    struct driver d = {0};
    int rc = -1;

    if (neutral_check(clip, err))
        return -1;
    in = framesource_open(clip->path, clip->count, clip->frames, err);
    if (!in || track_init(&track, clip->id, clip->net, clip->track, err))
        goto out;
    driver_init(&d, &track, driver_read_source, in);
    if (driver_start(&d, clip->path[0], NULL, NULL, err))
        goto out;
    rc = neutral_choose(m, n, &d, clip->nexp, err);
    if (rc == 0)
        error_set(err, EX_DATAERR, "%s: no frame %llu with a face (expected "
                  "--neutral to name one)", clip->path[0],
                  (unsigned long long)n->frame);
    rc = rc > 0 ? 0 : -1;
    m->pose.exp = m->exp;
out:
    driver_release(&d);
    track_release(&track);
    framesource_close(in);
    return rc;
}
