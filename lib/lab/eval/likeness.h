/* Is it the same person?  ArcFace similarity: the cosine between embeddings of
 * two faces, each aligned by five points as the network was trained.  Faces
 * are found and followed by the model's own encoder (lib/track). */
#ifndef SPID_LAB_EVAL_LIKENESS_H
#define SPID_LAB_EVAL_LIKENESS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/lab/eval/iresnet.h"
#include "lib/track/encoders.h"
#include "lib/track/track.h"

#define LIKENESS_CLIPS 2        /* followed side by side */

struct likeness {
    struct iresnet net;
    bool has_tracker;           /* else only aligned faces are understood */
    struct encoders encoders;
    double size;                /* S of their portrait window */
    struct identity id;         /* the mean head */
    struct track track[LIKENESS_CLIPS];
    bool open[LIKENESS_CLIPS], following[LIKENESS_CLIPS];
    float *face;                /* (112,112,3) */
    float *code[LIKENESS_CLIPS], *source;       /* embeddings */
    bool has_source;
};

/* Weights of an iresnet; model and head (may be NULL) find faces.  head is
 * borrowed, the model may be closed afterwards. */
int likeness_init(struct likeness *l, const char *weights,
                  const struct model *model, const struct head *head,
                  struct error *err);
/* Free what it holds; zeroed then. */
void likeness_release(struct likeness *l);

/* Forget the clips; source (may be NULL) is a picture of the person that
 * results are compared with. */
int likeness_start(struct likeness *l, const char *source, struct error *err);

/* Embed frame [H,W,3] of clip k.  A picture of 112 x 112 is taken as an
 * aligned face.  1; 0: no face; -1 and *err. */
int likeness_embed(struct likeness *l, int k, const uint8_t *rgb, size_t W,
                   size_t H, double time, struct error *err);

/* Cosine of clip 1 with clip 0, and with the source (NaN without one), after
 * both frames were embedded. */
double likeness_pair(const struct likeness *l);
/* Of clip 1 with the source; NaN without one. */
double likeness_source(const struct likeness *l);

#endif
