/* The tracker from frame to frame: E_m's crop follows the projected head (Eqs.
 * rot to eye); what is implausible or in doubt is a face lost, which is looked
 * for as the first one was. */
#include "lib/track/track.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/facedetect.h"
#include "lib/base/cpu.h"
#include "lib/track/find.h"
#include "lib/track/pass.h"
#include "lib/track/thumb.h"
#include "lib/track/window.h"

#define CHECK_EVERY 30         /* frames between looks for another face, */
#define CHECK_AGAIN 5          /* and after a face was found again */
#define CUT_CORRELATION 0.3    /* of thumbnails: below it is another scene */
#define CONFIDENCE_ENOUGH 0.35 /* E_m less sure than this lost its face */
#define REGAINED 12            /* such looks, CHECK_AGAIN frames apart */

int track_init(struct track *t, const struct identity *id,
               struct motion_encoder *net, const struct track_options *opt,
               struct error *err)
{
    memset(t, 0, sizeof *t);
    t->opt = *opt;
    t->head = id->head;
    oneeuro_init(&t->filter, opt->smooth);
    t->opt.no_align |= opt->still;
    t->effort.levels = opt->still ? SEARCH_LEVELS : TRACK_QUICK;
    t->input = malloc(3 * CROP_NET * CROP_NET * sizeof *t->input);
    if (!t->input)
        error_set(err, EX_OSERR, "no memory for the face crop");
    else if (landmarks_init(&t->landmarks, id, err) == 0 &&
             (t->opt.no_align || align_init(&t->align, id, err) == 0) &&
             motion_tta_init(&t->tta, net, 1, id->head, !opt->no_tta,
                             opt->across, !opt->still, err) == 0 &&
             (!net->confidence.ps || search_init(&t->search, net, err) == 0)) {
        calm_init(&t->calm, motion_encoder_rest(net), &t->landmarks);
        return 0;
    }
    track_release(t);
    return -1;
}

void track_release(struct track *t)
{
    landmarks_release(&t->landmarks);
    align_release(&t->align);
    if (!t->opt.detector)
        facedetect_close(t->detector);
    motion_tta_release(&t->tta);
    search_release(&t->search);
    free(t->input);
    mipmap_release(&t->picture);
    memset(t, 0, sizeof *t);
}

/* ---- doubts ------------------------------------------------------------- */

/* Whether another face in the picture looks more like the first frame's than
 * the one that is followed since it was found again. */
static bool track_is_other(struct track *t)
{
    const struct square q = square_out_of(t->crop, t->window, t->opt.size);
    struct square face[TRACK_FACES];
    float thumb[THUMB * THUMB];
    bool other = false;
    size_t n;

    thumb_make(thumb, t->input);
    const double similar = thumb_correlate(t->first_thumb, thumb);
    n = facedetect_find(t->detector, face, TRACK_FACES,
                        t->faces.n > 1 ? FACEDETECT_ALL : FACEDETECT_LARGEST,
                        false, &t->picture);
    for (size_t i = 0; i < n && !other; i++) {
        const struct square c = crop_from_detection(face[i]);

        if (hypot(c.x - q.x, c.y - q.y) < SEARCH_APART * q.size)
            continue;
        track_cut(t->input, t, square_into(c, t->window, t->opt.size));
        thumb_make(thumb, t->input);
        other = thumb_correlate(t->first_thumb, thumb) > similar;
    }
    track_cut(t->input, t, t->crop);    /* as it was */
    return other;
}

/* Where several faces are, or one was found again: asked now and then, whether
 * it is still the first frame's that is followed. */
static const char *track_doubtful(struct track *t)
{
    const bool doubted = t->regained || t->faces.n > 1;

    if (t->opt.has_crop || !t->detector || !doubted ||
        ++t->since_check < (t->regained ? CHECK_AGAIN : CHECK_EVERY))
        return NULL;
    t->since_check = 0;
    t->regained -= t->regained > 0;
    return track_is_other(t) ? "it is another's" : NULL;
}

/* ---- frames ----------------------------------------------------------- */

/* Align E_m's motion of the crop in t->input with earlier frames. */
static void track_align(struct track *t, struct track_result *r)
{
    const struct mipmap_level *f = t->picture.level;
    const float *seen = r->motion.crop;
    const struct square crop = {seen[0], seen[1], seen[2]};
    const struct square q = square_out_of(crop, t->window, t->opt.size);
    const double left = q.x - q.size / 2, top = q.y - q.size / 2;
    const double begun = cpu_seconds();

    if (t->opt.no_align)
        return;
    align_step(&t->align, &r->motion, t->input, crop,
               (struct align_bounds){-left / q.size, -top / q.size,
                                     ((double)f->W - left) / q.size,
                                     ((double)f->H - top) / q.size},
               t->opt.size);
    r->heads_s += cpu_seconds() - begun;
}

/* Copies of a motion point at their own expression. */
static void track_deliver(struct track *t, struct track_result *r, double time)
{
    if (!t->lost)
        oneeuro_motion(&t->filter, &r->motion, time);
    r->motion.pose.exp = r->motion.exp;
    r->lost = t->lost > 0;
}

/* The first frame's motion, of the crop that r is of. */
static void track_begin(struct track *t, struct track_result *r, double time)
{
    if (!t->opt.has_window) {
        window_about_head(&t->window, &r->motion, t->opt.size, t->opt.whole);
        t->last = r->motion;
        t->crop = (struct square){r->motion.crop[0], r->motion.crop[1],
                                  r->motion.crop[2]};
        /* settled as if this window had been given */
        if (!t->opt.has_crop)
            track_settle(t, r, t->crop, true);
    }
    align_restart(&t->align);
    track_align(t, r);
    if (!t->faces.n) {
        t->faces.n = 1;
        t->faces.crop[0] = square_out_of(t->crop, t->window, t->opt.size);
    }
    memcpy(t->first_thumb, t->thumb, sizeof t->first_thumb);
    t->started = true;
    t->regained = 0;
    t->lost = 0;                /* a live source may start several times */
    track_deliver(t, r, time);
}

int track_start(struct track *t, struct track_result *r, const struct frame *f,
                const struct track_effort *effort, struct error *err)
{
    struct square crop;

    memset(r, 0, sizeof *r);
    t->started = false;
    t->faces.n = t->faces.chosen = 0;
    if (f->width == 0 || f->height == 0)
        return 0;
    if (mipmap_take(&t->picture, f->rgb, f->width, f->height, err))
        return -1;
    /* what the search for a lost face holds is there from the start */
    if (!t->opt.still && t->search.net)
        search_take(&t->picture);
    if (!t->opt.has_crop) {
        const int found = track_find(t, r, effort ? *effort : t->effort, err);

        if (found == 1)
            track_begin(t, r, f->time);
        return found;
    }
    t->window = track_window(t, t->opt.crop);
    crop = square_into(t->opt.crop, t->window, t->opt.size);
    if (track_visible(t, crop) <= 0)
        return error_set(err, EX_DATAERR, "--crop is beyond %zux%zu",
                         f->width, f->height);
    track_encode(t, r, crop, false);
    t->crop = crop;
    t->last = r->motion;
    track_begin(t, r, f->time);
    return 1;
}

/* While the face is lost: does the last crop look unlike the frame before? */
static bool track_changed(struct track *t)
{
    float thumb[THUMB * THUMB];
    const bool had = t->has_thumb;
    double same;

    track_cut(t->input, t, t->crop);
    t->has_thumb = thumb_make(thumb, t->input) > THUMB_FLAT;
    same = thumb_correlate(t->thumb, thumb);
    memcpy(t->thumb, thumb, sizeof thumb);
    return t->has_thumb && (!had || same < CUT_CORRELATION);
}

/* No face in this frame: the last motion stays. */
static void track_deliver_lost(struct track *t, struct track_result *r,
                               double time, const char *why)
{
    r->motion = t->last;
    r->event = t->lost ? TRACK_NOTHING : TRACK_LOST;
    r->why = why;
    if (!t->lost)
        t->has_thumb = false;
    t->lost++;
    track_deliver(t, r, time);
}

/* Look for the face again; repeat the last motion when there is none. */
static void track_recover(struct track *t, struct track_result *r,
                          double time, const char *why)
{
    struct error none = {0};    /* no detector: as without one */
    int found = 0;

    /* every frame at first, then every sixth, or when something happens:
     * looking costs 30 ms and more */
    if (t->lost < 3 || t->lost % TRACK_LOOKS == 0 || track_changed(t))
        found = track_find(t, r, t->effort, &none);
    if (found != 1) {
        track_deliver_lost(t, r, time, why);
        return;
    }
    track_align(t, r);
    t->regained = REGAINED;
    if (t->lost) {
        r->event = TRACK_FOUND;
        oneeuro_reset(&t->filter);
    }
    t->lost = 0;
    track_deliver(t, r, time);
}

/* NULL, or why E_m's motion of the crop in t->input cannot be that of the head
 * that was followed: blank, another scene, implausible, another's, or doubted by
 * E_m itself. */
static const char *track_find_fault(struct track *t, struct track_result *r)
{
    float thumb[THUMB * THUMB];
    const struct square next = track_next_crop(t, &r->motion);
    const char *why;

    if (thumb_make(thumb, t->input) < THUMB_FLAT)
        return "the picture is blank there";
    if (t->has_thumb && thumb_correlate(t->thumb, thumb) < CUT_CORRELATION) {
        align_restart(&t->align);
        oneeuro_reset(&t->filter);
        r->event = TRACK_CUT;
        return "the scene changed";
    }
    why = track_implausible(t, &r->motion, next, t->crop);
    if (!why)
        why = track_doubtful(t);
    if (!why && r->confidence < CONFIDENCE_ENOUGH)
        why = "no whole, upright face is seen";
    if (why)
        return why;
    memcpy(t->thumb, thumb, sizeof thumb);
    t->has_thumb = true;
    return NULL;
}

int track_step(struct track *t, struct track_result *r, const struct frame *f,
               struct error *err)
{
    const char *why = "still no face";

    memset(r, 0, sizeof *r);
    if (mipmap_take(&t->picture, f->rgb, f->width, f->height, err))
        return -1;
    if (!t->lost) {
        track_encode(t, r, t->crop, true);
        why = t->opt.has_crop ? NULL : track_find_fault(t, r);
    }
    if (why) {
        track_recover(t, r, f->time, why);
        return 0;
    }
    track_align(t, r);
    if (!t->opt.has_crop)
        t->crop = track_next_crop(t, &r->motion);
    t->last = r->motion;
    track_deliver(t, r, f->time);
    return 0;
}
