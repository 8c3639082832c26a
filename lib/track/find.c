/* Looking for a face (find.h). */
#include "lib/track/find.h"


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
 * face is found: whether it is sure of a face there, which is followed. */
static bool track_try(struct track *t, struct track_result *r, struct square q)
{
    const double size = t->opt.size;

    if (!t->started)
        t->window = track_window(t, q);
    q = square_into(q, t->window, size);
    if (!(q.x > 0 && q.y > 0 && q.x < size && q.y < size &&
          q.size > size / 32))
        return false;
    track_settle(t, r, q, false);
    return (double)r->confidence >= FOUND;
}

/* Of n of the detector's faces those that E_m is sure of, into *faces; of these
 * the one that looks most like the first frame's is chosen, or in a first frame
 * the one that was asked for. */
static void track_compare(struct track_faces *faces, struct track *t,
                          struct track_result *r, const struct square *face,
                          size_t n)
{
    double max = -2;

    *faces = (struct track_faces){.chosen = t->opt.face
                                      ? (size_t)t->opt.face - 1 : 0};
    for (size_t i = 0; i < n; i++) {
        const bool found = track_try(t, r, crop_from_detection(face[i]));
        const double similar = thumb_correlate(t->first_thumb, t->thumb);

        if (!found)
            continue;
        if (t->started && similar > max) {
            max = similar;
            faces->chosen = faces->n;
        }
        faces->crop[faces->n++] = square_out_of(t->crop, t->window,
                                                t->opt.size);
    }
}

/* t->detector, which reading takes a hundredth of a second: whether it is
 * there. */
static bool track_open_detector(struct track *t, struct error *err)
{
    struct facedetect **shared = t->opt.detector;

    if (!t->detector)
        t->detector = shared && *shared ? *shared : facedetect_open(err);
    if (shared)
        *shared = t->detector;
    return t->detector;
}

/* The detector's face, where E_m agrees: 1, 0, -1 no detector. */
static int track_detect(struct track *t, struct track_result *r,
                        enum facedetect_size size, bool certain,
                        struct error *err)
{
    const double begun = cpu_seconds();
    struct square face[TRACK_FACES];
    struct track_faces faces;

    if (!track_open_detector(t, err))
        return -1;
    const size_t n = facedetect_find(t->detector, face, TRACK_FACES, size,
                                     certain, &t->picture);
    r->detect_s += cpu_seconds() - begun;
    if (n == 1 && t->opt.face <= 1)
        return track_try(t, r, crop_from_detection(face[0]));
    track_compare(&faces, t, r, face, n);
    if (!t->started)
        t->faces = faces;
    if (faces.n > t->max_faces)
        t->max_faces = faces.n;
    return faces.chosen < faces.n && track_try(t, r, faces.crop[faces.chosen]);
}

/* Of a level's squares the one whose face E_m is surest of: whether there is
 * one, and then *best, the crop that it settled on, in picture pixels. */
static bool track_try_level(struct square *best, struct track *t,
                            struct track_result *r, size_t level)
{
    struct square q[SEARCH_BEST];
    const size_t n = search_level(q, &t->search, &t->picture, level);
    double confidence = 0;

    for (size_t i = 0; i < n; i++) {
        if (!track_try(t, r, q[i]) || (double)r->confidence < confidence)
            continue;
        confidence = (double)r->confidence;
        *best = square_out_of(t->crop, t->window, t->opt.size);
    }
    return confidence > 0;
}

/* The largest face that E_m is sure of, wherever it is. */
static bool track_search(struct track *t, struct track_result *r, size_t levels)
{
    const double begun = cpu_seconds();
    struct square best;
    bool found = false;

    if (!t->tta.net->confidence.ps)
        return false;
    for (size_t k = 0; k < levels && !found; k++)
        found = track_try_level(&best, t, r, k);
    r->detect_s += cpu_seconds() - begun;
    return found && track_try(t, r, best);
}

int track_find(struct track *t, struct track_result *r,
               struct track_effort effort, struct error *err)
{
    const struct motion last = t->last;
    const struct square crop = t->crop;
    const enum facedetect_size size = t->opt.face > 1 || t->faces.n > 1
                                          ? FACEDETECT_ALL : FACEDETECT_LARGEST;
    int found = track_detect(t, r, size, effort.certain, err);

    if (found == 0 && (t->started || t->opt.face <= 1))
        found = track_search(t, r, effort.levels);
    if (found == 0 && effort.levels > TRACK_QUICK)
        found = track_detect(t, r, FACEDETECT_SMALL, false, err);
    if (found != 1) {
        t->last = last;
        t->crop = crop;
    }
    return found;
}
