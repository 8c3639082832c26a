/* From frames to motion (Phase B's first half): which crop the motion encoder
 * sees, what its output means, and what happens when the face is lost.  The
 * crop of a frame comes from the last frame's projected head; the detector is
 * used at the start, after a loss, and where several faces are.  spid-motion, spid-shape and
 * spid animate all call this, so that they see the same. */
#ifndef SPID_TRACK_TRACK_H
#define SPID_TRACK_TRACK_H

#include <stdbool.h>
#include <stddef.h>

#include "formats/framesource.h"
#include "lib/base/error.h"
#include "lib/base/crop.h"
#include "lib/base/mipmap.h"
#include "lib/head/lbs.h"
#include "lib/net/motion_encoder.h"
#include "lib/head/motion.h"
#include "lib/track/align.h"
#include "lib/track/calm.h"
#include "lib/track/landmarks.h"
#include "lib/track/oneeuro.h"
#include "lib/track/search.h"
#include "lib/track/thumb.h"
#include "lib/track/tta.h"

struct facedetect;

struct track_options {
    double size;                /* S of the portrait window: 512 */
    size_t finest;              /* pixels along a photograph's window that are
                                 * kept at most; 0: PERSON_MAX */
    long face;                  /* which, the largest is 1; 0: that one */
    bool has_crop, has_window;
    struct square crop;         /* fixed face crop, picture pixels */
    struct square window;       /* portrait window, picture pixels */
    double smooth;              /* one-euro cut-off, Hz; 0: off */
    bool whole;                 /* a window that is found lies on whole
                                 * pixels */
    bool no_tta;                /* E_m on the crop alone, not its mirror
                                 * image, too */
    bool no_align;              /* motions as E_m says them, not aligned with
                                 * keyframes (align.h) */
    bool still;                 /* a photograph: E_m keeps its precision
                                 * (tta.h), and there is nothing to align it
                                 * with */
    struct facedetect **detector;       /* shared by trackers that look one
                                 * after another, NULL until one of them needs
                                 * it; or NULL: their own */
    struct motion_mirror *across;       /* shared likewise by those of one head:
                                 * not known until one of them needs it */
};

enum track_event {
    TRACK_NOTHING,
    TRACK_LOST,                 /* this frame is the first without a face */
    TRACK_FOUND,                /* and the first with one again */
    TRACK_CUT                   /* one at once, in another scene */
};

/* What a frame gave. */
struct track_result {
    struct motion motion;       /* held when lost; crop is the one used */
    bool lost;
    float confidence;                 /* of E_m, 0 to 1, that the crop shows a face
                                 * in place; 1 from models that do not say */
    enum track_event event;
    const char *why;            /* of TRACK_LOST */
    double crop_s, network_s, heads_s, detect_s;    /* seconds spent */
};

/* How hard a face is looked for. */
struct track_effort {
    bool certain;               /* by the detector only such as are surely
                                 * upright */
    size_t levels;              /* of search.h's by E_m, where the detector sees
                                 * none */
};
#define TRACK_QUICK 4           /* levels in a clip, large faces alone; in a
                                 * photograph all of them */
#define TRACK_LOOKS 6           /* frames without a face from one search by E_m,
                                 * which takes a second, to the next */

/* The faces of a first frame that E_m is sure of, the largest first, as crops in
 * picture pixels.  One that was looked for in other ways is alone. */
#define TRACK_FACES 8
struct track_faces {
    size_t n, chosen;
    struct square crop[TRACK_FACES];
};

struct track {
    struct track_options opt;
    const struct head *head;
    struct motion_tta tta;
    struct landmarks landmarks;
    struct calm calm;           /* what is its face at rest */
    struct align align;         /* when opt asks for it */
    struct facedetect *detector;        /* NULL until it is needed; its own
                                         * unless opt has one */
    struct square window;               /* picture pixels */
    struct square crop;                 /* next one, window pixels */
    struct track_faces faces;
    size_t max_faces;                  /* of the pictures that were tried */
    struct track_effort effort;         /* unless told another one */
    bool started, has_thumb;
    size_t lost;                        /* frames without a face since; 0: it
                                         * is followed */
    int regained;                       /* looks until a face that was found
                                         * again is taken for the same one's */
    size_t since_check;                 /* frames */
    struct motion last;                 /* as the network said it */
    struct oneeuro filter;
    float thumb[THUMB * THUMB];
    float first_thumb[THUMB * THUMB];   /* the first frame's face */
    float *input;                       /* (224,224,3) */
    float said[MOTION_OUT];             /* what E_m said of it last */
    struct search search;               /* for where else a face is */
    struct mipmap picture;              /* the frame at hand */
};

/* id: the head the landmarks are projected of (the mean head when nobody is
 * known); borrowed, like net, which must be planned for a batch of 1. */
int track_init(struct track *t, const struct identity *id,
               struct motion_encoder *net, const struct track_options *opt,
               struct error *err);
/* Free what it holds; zeroed then. */
void track_release(struct track *t);

/* Find the face in a first frame and fix the portrait window; effort: NULL for
 * t's own.  1: found, *r filled; 0: no face (try the next frame); -1: an error,
 * such as no detector installed, or EX_DATAERR: a crop given shows nothing of
 * it. */
int track_start(struct track *t, struct track_result *r, const struct frame *f,
                const struct track_effort *effort, struct error *err);

/* The next frame, after track_start has found one.  0; -1 only when memory is
 * short: a frame larger than the ones before. */
int track_step(struct track *t, struct track_result *r, const struct frame *f,
               struct error *err);

/* out (224,224,3) = a crop (window pixels) of the frame that was started or
 * stepped to last and is still there, as the networks see it. */
void track_cut(float *out, struct track *t, struct square crop);
/* The same as a tta_crop_fn, whose ctx is the tracker; never fails. */
int track_crop(void *track, float *rgb, struct square crop, struct error *err);

/* Motion from one row of the encoder's output and the crop it saw: 6D to R
 * (always a rotation: motion_code.h says how), t' to t.  m->pose.exp is left
 * NULL. */
void track_decode(struct motion *m, const float out[MOTION_OUT],
                  struct square crop, double size);

/* The landmarks of a motion in window pixels, (68,2). */
void track_project(float *uv, struct track *t, const struct motion *m);

#endif
