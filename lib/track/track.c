/* The tracker: E_m on a crop that follows the projected head (Eqs. rot to
 * eye), with a detector for the start, for doubts and after a loss. */
#include "lib/track/track.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/facedetect.h"
#include "lib/base/cpu.h"
#include "lib/base/camera.h"
#include "lib/net/motion_code.h"
#include "lib/track/smooth.h"
#include "lib/track/thumb.h"
#include "lib/track/window.h"

#define FIRST_PASSES 4         /* network runs for the first crop, and so many */
#define LAST_PASSES 12         /* while each moves it by less than DRIFTS of the */
#define DRIFTS 0.9             /* one before, until it moves by SETTLED of its */
#define SETTLED 5e-4           /* side: a quarter of a pixel from where any start
                                * leads */
#define CHECK_EVERY 30         /* frames between looks by the detector */
#define CHECK_AGAIN 5          /* and after one that failed */
#define CUT_CORRELATION 0.3    /* of thumbnails: below it is another scene */
#define CONFIDENCE_ENOUGH 0.35       /* E_m less sure than this lost its face */
#define CONFIDENCE_FOUND 0.82        /* and than this has found none: of the faces in
                                * tests/bench/README.md 95 % are above 0.84 at
                                * every turn, panoramas without one below 0.81 */
#define FLAT_DEVIATION 0.01    /* a crop with less contrast shows nothing */
#define JUMP 0.5               /* of the crop's side: heads move less a frame */
#define GROWTH 1.6             /* factor of its side, likewise */
#define BEHIND (-0.2)          /* cosine of a head's turn: its back is shown */
#define FRONTAL 0.85           /* from here on the detector finds faces */
#define VISIBLE 0.4            /* least share of the crop in the picture */
#define UNLIKE 0.6             /* correlation with the first frame's face from
                                * which on another one's is looked for; one
                                * person's is 0.62 to 1 in the shared clips,
                                * another's 0.2 to 0.6 */
#define REGAINED 12            /* such looks, CHECK_AGAIN frames apart */
#define SAME_FACE 0.5          /* of the crop's side: nearer, faces are one */
#define DOUBTS 3               /* failed checks until the face is lost */

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
    if (landmarks_init(&t->landmarks, id, err) != 0)
        return -1;
    if (!t->opt.no_align && align_init(&t->align, id, err) != 0) {
        track_release(t);
        return -1;
    }
    t->input = malloc(3 * CROP_NET * CROP_NET * sizeof *t->input);
    if (!t->input)
        error_set(err, EX_OSERR, "no memory for the face crop");
    else if (motion_tta_init(&t->tta, net, 1, id->head, !opt->no_tta,
                             !opt->still, err) == 0 &&
             (!net->confidence.ps || search_init(&t->search, net, err) == 0))
        return 0;
    track_release(t);
    return -1;
}

void track_release(struct track *t)
{
    landmarks_release(&t->landmarks);
    align_release(&t->align);
    facedetect_close(t->detector);
    motion_tta_release(&t->tta);
    search_release(&t->search);
    free(t->input);
    free(t->half);
    memset(t, 0, sizeof *t);
}

/* ---- what the network says -------------------------------------------- */

void track_decode(struct motion *m, const float out[MOTION_OUT],
                  struct square crop, double size)
{
    memset(m, 0, sizeof *m);
    motion_code_decode(m->R, m->t, &m->pose, out, crop, size);
    memcpy(m->exp, out + MOTION_EXP, (MOTION_JAW - MOTION_EXP) * sizeof *out);
    m->pose.exp = NULL;         /* a copy would point at the original's */
    m->crop[0] = (float)crop.x;
    m->crop[1] = (float)crop.y;
    m->crop[2] = (float)crop.size;
}

void track_project(float *uv, struct track *t, const struct motion *m)
{
    float lmk[3 * HEAD_LANDMARKS], cam[12];
    struct head_motion pose = m->pose;

    pose.exp = m->exp;
    landmarks_pose(lmk, &t->landmarks, &pose);
    camera_make(cam, m->R, m->t);
    camera_project(uv, NULL, cam, (float)t->opt.size, lmk, HEAD_LANDMARKS);
}

/* Align E_m's motion of the crop in t->input with earlier frames. */
static void track_align(struct track *t, struct track_result *r,
                        const struct frame *f)
{
    const float *seen = r->motion.crop;
    const struct square crop = {seen[0], seen[1], seen[2]};
    const struct square q = square_out_of(crop, t->window, t->opt.size);
    const double left = q.x - q.size / 2, top = q.y - q.size / 2;
    const double begun = cpu_seconds();

    if (t->opt.no_align)
        return;
    align_step(&t->align, &r->motion, t->input, crop,
               (struct align_bounds){-left / q.size, -top / q.size,
                                     ((double)f->width - left) / q.size,
                                     ((double)f->height - top) / q.size},
               t->opt.size);
    r->heads_s += cpu_seconds() - begun;
}

/* The crop that the projected head asks for. */
static struct square track_next_crop(struct track *t, const struct motion *m)
{
    float uv[2 * HEAD_LANDMARKS];

    track_project(uv, t, m);
    return crop_from_landmarks(uv, HEAD_LANDMARKS);
}

/* The paper's line: motion of the picture in one crop; follows: it is that of
 * the last crop's face a frame later. */
static int track_encode(struct track *t, struct track_result *r,
                        const struct frame *f, struct square crop,
                        bool follows, struct error *err)
{
    float out[MOTION_OUT];
    double t0 = cpu_seconds(), t1, t2;

    if (track_cut(t->input, t, f, crop, err) != 0)
        return -1;
    t1 = cpu_seconds();
    (follows ? motion_tta_follow : motion_tta_forward)(out, &t->tta, t->input);
    r->confidence = motion_tta_confidence(&t->tta, 0);
    t2 = cpu_seconds();
    track_decode(&r->motion, out, crop, t->opt.size);
    r->crop_s += t1 - t0;
    r->network_s += t2 - t1;
    r->heads_s += cpu_seconds() - t2;
    return 0;
}

/* ---- plausibility ------------------------------------------------------- */

/* Area of the crop that lies inside the picture, as a fraction. */
static double track_visible(const struct track *t, struct square crop,
                            const struct frame *f)
{
    struct square q = square_out_of(crop, t->window, t->opt.size);
    const double half = q.size / 2;
    double w = fmin(q.x + half, (double)f->width) - fmax(q.x - half, 0);
    double h = fmin(q.y + half, (double)f->height) - fmax(q.y - half, 0);

    return w > 0 && h > 0 ? w * h / (q.size * q.size) : 0;
}

/* NULL, or why this cannot be the head that the last frame had. */
static const char *track_implausible(const struct track *t,
                                     const struct motion *m,
                                     struct square next, struct square used,
                                     const struct frame *f)
{
    double move = hypot(next.x - used.x, next.y - used.y);

    if (!isfinite(next.x) || !isfinite(next.y) || !isfinite(next.size)
        || !(m->t[2] > 1))
        return "no sensible position";
    if (move > JUMP * used.size)
        return "it jumped";
    if (next.size > GROWTH * used.size || next.size < used.size / GROWTH)
        return "its size jumped";
    if (-m->R[8] < BEHIND)
        return "it turned away";
    if (track_visible(t, next, f) < VISIBLE)
        return "it left the picture";
    return NULL;
}

/* Whether another face in the picture looks more like the first frame's than
 * the one that is followed since it was found again. */
static bool track_is_other(struct track *t, const struct frame *f)
{
    const struct square q = square_out_of(t->crop, t->window, t->opt.size);
    struct square face[TRACK_FACES];
    float thumb[THUMB * THUMB];
    bool other = false;
    size_t n;

    thumb_make(thumb, t->input);
    const double similar = thumb_correlate(t->first_thumb, thumb);
    n = facedetect_find(t->detector, face, TRACK_FACES, t->faces.n > 1, false,
                        f);
    for (size_t i = 0; i < n && !other; i++) {
        const struct square c = crop_from_detection(face[i]);

        if (hypot(c.x - q.x, c.y - q.y) < SAME_FACE * q.size ||
            track_cut(t->input, t, f, square_into(c, t->window, t->opt.size),
                      NULL))
            continue;
        thumb_make(thumb, t->input);
        other = thumb_correlate(t->first_thumb, thumb) > similar;
    }
    track_cut(t->input, t, f, t->crop, NULL);   /* as it was */
    return other;
}

/* Whether the detector, asked now and then, still sees a face where a frontal
 * one is claimed. */
static const char *track_doubtful(struct track *t, const struct motion *m,
                                  const struct frame *f)
{
    struct square q;

    if (t->opt.has_crop || !t->detector
        || ++t->since_check < (t->regained ? CHECK_AGAIN : CHECK_EVERY))
        return NULL;
    t->since_check = 0;
    t->regained -= t->regained > 0;
    if ((t->regained || t->faces.n > 1) && track_is_other(t, f))
        return "it is another's";
    if (-m->R[8] < FRONTAL)
        return NULL;
    q = square_out_of(t->crop, t->window, t->opt.size);
    if (facedetect_confirm(t->detector, f, q)) {
        t->misses = 0;
        return NULL;
    }
    t->since_check = CHECK_EVERY - CHECK_AGAIN;
    return ++t->misses >= DOUBTS ? "no face where it was" : NULL;
}

/* ---- detection -------------------------------------------------------- */

/* Run the network on a first guess (window pixels) until its own projection
 * agrees; a projection far from the guess is not followed. */
static int track_refine_crop(struct track *t, struct track_result *r,
                             const struct frame *f, struct square guess,
                             struct error *err)
{
    struct square crop = guess, next;
    double before = INFINITY, step;

    for (int i = 0; i < LAST_PASSES; i++) {
        if (track_encode(t, r, f, crop, false, err) != 0)
            return -1;
        next = track_next_crop(t, &r->motion);
        if (track_implausible(t, &r->motion, next, guess, f))
            break;
        step = (hypot(next.x - crop.x, next.y - crop.y)
                + fabs(next.size - crop.size)) / crop.size;
        if (step < SETTLED || (i >= FIRST_PASSES && step > DRIFTS * before))
            break;
        before = step;
        crop = next;
    }
    t->crop = crop;
    t->last = r->motion;
    t->has_thumb = thumb_make(t->thumb, t->input) > FLAT_DEVIATION;
    t->since_check = t->misses = 0;
    return 0;
}

/* The window that a crop is looked for in before it is known where the head
 * is. */
static struct square track_window(const struct track *t, struct square crop)
{
    return t->opt.has_window ? t->opt.window : window_from_crop(crop);
}

/* E_m about a square of the picture, which sets the window before the first
 * face is found: 1, it is sure of a face there, which is followed; 0; -1. */
static int track_try(struct track *t, struct track_result *r,
                     const struct frame *f, struct square q,
                     struct error *err)
{
    const double size = t->opt.size;

    if (!t->started)
        t->window = track_window(t, q);
    q = square_into(q, t->window, size);
    if (!(q.x > 0 && q.y > 0 && q.x < size && q.y < size &&
          q.size > size / 32))
        return 0;
    if (track_refine_crop(t, r, f, q, err) != 0)
        return -1;
    return (double)r->confidence >= CONFIDENCE_FOUND;
}

/* Of n of the detector's faces those that E_m is sure of, into *faces; of these
 * the one that looks most like the first frame's is chosen, or in a first frame
 * the one that was asked for.  0; -1. */
static int track_compare(struct track_faces *faces, struct track *t,
                         struct track_result *r, const struct square *face,
                         size_t n, const struct frame *f, struct error *err)
{
    double max = -2;

    *faces = (struct track_faces){.chosen = t->opt.face
                                      ? (size_t)t->opt.face - 1 : 0};
    for (size_t i = 0; i < n; i++) {
        const int found = track_try(t, r, f, crop_from_detection(face[i]),
                                    err);
        const double similar = thumb_correlate(t->first_thumb, t->thumb);

        if (found < 0)
            return -1;
        if (!found)
            continue;
        if (t->started && similar > max) {
            max = similar;
            faces->chosen = faces->n;
        }
        faces->crop[faces->n++] = square_out_of(t->crop, t->window,
                                                t->opt.size);
    }
    return 0;
}

/* The detector's face, where E_m agrees: 1, 0, -1 no detector. */
static int track_detect(struct track *t, struct track_result *r,
                        const struct frame *f, bool certain,
                        struct error *err)
{
    const double begun = cpu_seconds();
    const bool all = t->opt.face > 1 || t->faces.n > 1;
    struct square face[TRACK_FACES];
    struct track_faces faces;

    if (!t->detector && !(t->detector = facedetect_open(err)))
        return -1;
    const size_t n = facedetect_find(t->detector, face, TRACK_FACES, all,
                                     certain, f);
    r->detect_s += cpu_seconds() - begun;
    if (n == 1 && t->opt.face <= 1)
        return track_try(t, r, f, crop_from_detection(face[0]), err);
    if (track_compare(&faces, t, r, face, n, f, err))
        return -1;
    if (!t->started)
        t->faces = faces;
    if (faces.n > t->max_faces)
        t->max_faces = faces.n;
    return faces.chosen < faces.n
               ? track_try(t, r, f, faces.crop[faces.chosen], err)
               : 0;
}

/* Of a level's squares the one whose face E_m is surest of: 1, then *best is
 * the crop that it settled on, in picture pixels; 0; -1. */
static int track_try_level(struct track *t, struct track_result *r,
                           struct square *best, const struct frame *f,
                           size_t level, struct error *err)
{
    struct square q[SEARCH_BEST];
    const size_t n = search_level(q, &t->search, level);
    double confidence = 0;

    for (size_t i = 0; i < n; i++) {
        const int found = track_try(t, r, f, q[i], err);
        if (found < 0)
            return -1;
        if (!found || (double)r->confidence < confidence)
            continue;
        confidence = (double)r->confidence;
        *best = square_out_of(t->crop, t->window, t->opt.size);
    }
    return confidence > 0;
}

/* The largest face that E_m is sure of, wherever it is: 1, 0, -1. */
static int track_search(struct track *t, struct track_result *r,
                        const struct frame *f, size_t levels,
                        struct error *err)
{
    const double begun = cpu_seconds();
    struct square best;
    int found = 0;

    if (!t->tta.net->confidence.ps || !levels)
        return 0;
    if (search_take(&t->search, f, err))
        return -1;
    for (size_t k = 0; k < levels && !found; k++)
        found = track_try_level(t, r, &best, f, k, err);
    r->detect_s += cpu_seconds() - begun;
    return found == 1 ? track_try(t, r, f, best, err) : found;
}

/* A face: the detector's, which is fast, or wherever E_m is sure of one.  1,
 * and it is followed; then the window is fixed.  0, t is as it was; -1. */
static int track_find(struct track *t, struct track_result *r,
                      const struct frame *f, struct track_effort effort,
                      struct error *err)
{
    const struct motion last = t->last;
    const struct square crop = t->crop;
    int found = track_detect(t, r, f, effort.certain, err);

    if (found == 0 && (t->started || t->opt.face <= 1))
        found = track_search(t, r, f, effort.levels, err);
    if (found != 1) {
        t->last = last;
        t->crop = crop;
    }
    return found;
}

/* ---- frames ----------------------------------------------------------- */

/* Copies of a motion point at their own expression. */
static void track_deliver(struct track *t, struct track_result *r, double time)
{
    if (!t->lost)
        smooth_motion(&t->filter, &r->motion, time);
    r->motion.pose.exp = r->motion.exp;
    r->lost = t->lost > 0;
}

/* The first frame's motion, of the crop that r is of. */
static int track_begin(struct track *t, struct track_result *r,
                       const struct frame *f, struct error *err)
{
    if (!t->opt.has_window) {
        window_about_head(&t->window, &r->motion, t->opt.size, t->opt.whole);
        t->last = r->motion;
        t->crop = (struct square){r->motion.crop[0], r->motion.crop[1],
                                  r->motion.crop[2]};
        /* settled as if this window had been given */
        if (!t->opt.has_crop && track_refine_crop(t, r, f, t->crop, err))
            return -1;
    }
    align_restart(&t->align);
    track_align(t, r, f);
    if (!t->faces.n) {
        t->faces.n = 1;
        t->faces.crop[0] = square_out_of(t->crop, t->window, t->opt.size);
    }
    memcpy(t->first_thumb, t->thumb, sizeof t->first_thumb);
    t->started = true;
    t->regained = 0;
    t->lost = 0;                /* a live source may start several times */
    track_deliver(t, r, f->time);
    return 1;
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
    /* what the search for a lost face holds is there from the start */
    if (!t->opt.still && t->search.net && search_take(&t->search, f, err))
        return -1;
    if (!t->opt.has_crop) {
        const int found = track_find(t, r, f, effort ? *effort : t->effort,
                                     err);
        return found == 1 ? track_begin(t, r, f, err) : found;
    }
    t->window = track_window(t, t->opt.crop);
    crop = square_into(t->opt.crop, t->window, t->opt.size);
    if (track_visible(t, crop, f) <= 0)
        return error_set(err, EX_DATAERR, "--crop is beyond %zux%zu",
                         f->width, f->height);
    if (track_encode(t, r, f, crop, false, err) != 0)
        return -1;
    t->crop = crop;
    t->last = r->motion;
    return track_begin(t, r, f, err);
}

/* While the face is lost: does the last crop look unlike the frame before? */
static bool track_changed(struct track *t, const struct frame *f)
{
    float thumb[THUMB * THUMB];
    const bool had = t->has_thumb;
    double same;

    if (track_cut(t->input, t, f, t->crop, NULL) != 0)
        return false;
    t->has_thumb = thumb_make(thumb, t->input) > FLAT_DEVIATION;
    same = thumb_correlate(t->thumb, thumb);
    memcpy(t->thumb, thumb, sizeof thumb);
    return t->has_thumb && (!had || same < CUT_CORRELATION);
}

/* No face in this frame: the last motion stays. */
static void track_deliver_lost(struct track *t, struct track_result *r,
                               const struct frame *f, const char *why)
{
    r->motion = t->last;
    r->event = t->lost ? TRACK_NOTHING : TRACK_LOST;
    r->why = why;
    if (!t->lost)
        t->has_thumb = false;
    t->lost++;
    track_deliver(t, r, f->time);
}

/* Look for the face again; repeat the last motion when there is none. */
static int track_recover(struct track *t, struct track_result *r,
                         const struct frame *f, const char *why,
                         struct error *err)
{
    struct error none = {0};
    int found = 0;

    /* every frame at first, then every sixth, or when something happens:
     * looking costs 30 ms and more */
    if (t->lost < 3 || t->lost % TRACK_LOOKS == 0 || track_changed(t, f))
        found = track_find(t, r, f, t->effort, &none);
    if (found < 0 && none.code == EX_OSERR) {
        *err = none;
        return -1;
    }
    if (found != 1) {
        track_deliver_lost(t, r, f, why);
        return 0;
    }
    track_align(t, r, f);
    t->regained = REGAINED;
    if (t->lost) {
        r->event = TRACK_FOUND;
        oneeuro_reset(&t->filter);
    }
    t->lost = 0;
    track_deliver(t, r, f->time);
    return 0;
}

/* NULL, or why E_m's motion of the crop in t->input cannot be that of the head
 * that was followed: blank, another scene, implausible, doubted by the detector
 * or by E_m itself. */
static const char *track_find_fault(struct track *t,
                                    const struct track_result *r,
                                    const struct frame *f)
{
    float thumb[THUMB * THUMB];
    const struct square next = track_next_crop(t, &r->motion);
    const char *why;

    if (thumb_make(thumb, t->input) < FLAT_DEVIATION)
        return "the picture is blank there";
    if (t->has_thumb && thumb_correlate(t->thumb, thumb) < CUT_CORRELATION) {
        align_restart(&t->align);
        return "the scene changed";
    }
    if (thumb_correlate(t->first_thumb, thumb) < UNLIKE && !t->regained)
        t->regained = REGAINED;
    why = track_implausible(t, &r->motion, next, t->crop, f);
    if (!why)
        why = track_doubtful(t, &r->motion, f);
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
    const char *why;

    memset(r, 0, sizeof *r);
    if (t->lost)
        return track_recover(t, r, f, "still no face", err);
    if (track_encode(t, r, f, t->crop, true, err) != 0)
        return -1;
    if (!t->opt.has_crop && (why = track_find_fault(t, r, f)))
        return track_recover(t, r, f, why, err);
    track_align(t, r, f);
    if (!t->opt.has_crop)
        t->crop = track_next_crop(t, &r->motion);
    t->last = r->motion;
    track_deliver(t, r, f->time);
    return 0;
}
