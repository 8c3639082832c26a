/* A plain talking-head video as training records: faces found and tracked,
 * window cut, person matted, landmarks from the mesh, a first guess of motion
 * and shape by the encoders: estimates of what spid-synth writes as truth. */
#ifndef SPID_LAB_DATA_CLIP_H
#define SPID_LAB_DATA_CLIP_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/net/model.h"
#include "lib/stream/stream.h"
#include "lib/track/encoders.h"
#include "lib/track/track.h"

struct clip_options {
    size_t frames;              /* to keep, spread over the clip */
    size_t min_frames;          /* a clip with fewer good ones is bad */
    double min_face;            /* pixels of the video: smaller is not good */
    struct track_options track; /* size of the window */
};

struct clip_report {
    size_t read, tried, kept;   /* frames of the video; looked at; written */
    double face;                /* side of the face crop, pixels of the video:
                                 * mean of those kept */
    double outlined;            /* share of those kept whose outline was found
                                 * by colours, not guessed as a disc */
    double score;               /* 0 to 1: found x (outlined + 1)/2 x
                                 * min(1, face / 256) */
};

struct clip {
    const struct head *head;    /* borrowed, with model and nets */
    const struct model *model;
    struct encoders *nets;
    struct clip_options opt;
};

/* The clip at path as SHAP, then MOTN (with lmk) and IMAG (with mask) for each
 * frame kept, into w.  The window is that of the first face and stays; the
 * shape is the mean over the frames.  0; 1 when the clip is bad (*err says
 * why; nothing but CONF has been written); -1.  *r is filled in any case. */
int clip_prepare(struct stream_writer *w, struct clip_report *r,
                 const struct clip *c, const char *path, struct error *err);

#endif
