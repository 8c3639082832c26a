/* A fit as training data: the records that spid-train reads (SHAP, MOTN,
 * IMAG), with the pictures that the labels are of. */
#ifndef SPID_LAB_FIT_FIT_RECORDS_H
#define SPID_LAB_FIT_FIT_RECORDS_H

#include <stdbool.h>
#include <stddef.h>

#include "formats/framesource.h"
#include "lib/base/error.h"
#include "lib/lab/fit/face_fit.h"
#include "lib/lab/fit/portrait.h"
#include "lib/lab/fit/reenact.h"
#include "lib/stream/stream.h"

struct fit_records {
    const struct head *head;        /* borrowed, as are fit and base */
    const struct face_fit *fit;
    const char *base;               /* folder of the labels' names */
    size_t size;                    /* of the pictures */
    struct stream_writer *out;
    struct portrait portrait;
    struct identity id;             /* of the person being written, */
    bool named;                     /* whose SHAP is */
    float *verts;                   /* (V,3) */
    struct framesource *in;         /* the clip being read, */
    const char *file;               /* called so */
    struct frame frame;
    uint64_t written;               /* frames so far */
    struct reenact *reenact;        /* borrowed, set by the caller, or NULL */
    size_t acts;                    /* pictures of each photograph by it */
    bool plain;                     /* set by the caller: only pictures before
                                     * a plain wall */
    size_t every;                   /* likewise: of a clip's frames that are
                                     * labelled only each so-manieth; 0 as 1 */
    size_t clip, place;             /* of the last frame: where in which */
};

/* Create the stream and write CONF. */
int fit_records_open(struct fit_records *r, const char *path,
                     const struct head *head, const struct face_fit *fit,
                     const char *base, size_t size, struct error *err);
/* Frame k of the fit, in order; whoever is written here is with all frames.
 * SHAP before a person's first; MOTN with the landmarks of our head and the
 * face crop; IMAG with rgb, mask and the person alone.  Up to four frames of a
 * person are followed by r->acts pictures of them as avatars. */
int fit_records_write(struct fit_records *r, size_t k, struct error *err);
/* Finish the stream, or give it up unless `whole`; -1 then, and *err is left
 * as it was. */
int fit_records_close(struct fit_records *r, bool whole, struct error *err);

#endif
