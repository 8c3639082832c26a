/* Looking for a face (find.h). */
#include "lib/track/find.h"

#include <math.h>

#include "formats/facedetect.h"
#include "lib/base/cpu.h"
#include "lib/track/pass.h"

#define FOUND 0.82              /* E_m less sure than this has found none: of
                                 * the faces in tests/bench/README.md 95 % are
                                 * above 0.84 at every turn, panoramas without
                                 * one below 0.81 */

struct square track_window(const struct track *t, struct square crop)
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
    if (track_settle(t, r, f, q, err) != 0)
        return -1;
    return (double)r->confidence >= FOUND;
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

int track_find(struct track *t, struct track_result *r, const struct frame *f,
               struct track_effort effort, struct error *err)
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
