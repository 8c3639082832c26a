/* What the pictures of a clip show: the portrait, the part of it that lies in
 * the photograph, or the whole photograph; how large, and before what
 * background. */
#ifndef SPID_ANIMATE_FRAMING_H
#define SPID_ANIMATE_FRAMING_H

#include <stdbool.h>
#include <stddef.h>

#include "formats/framesink.h"
#include "lib/animate/animate.h"
#include "lib/animate/prepare.h"

struct framing_options {
    size_t model_size;          /* what the networks see, pixels */
    long size;                  /* of the portrait; 0: the model's, and with
                                 * into_source the photograph's own */
    bool into_source, cut;
    bool background_given;      /* false: the photograph's own before a
                                 * picture, black before an identity */
    bool source_background;     /* it is the photograph's own */
};

struct framing {
    struct inset inset;
    struct animate_part part;
    struct background background;       /* the photograph's own, or none */
};

/* source_finest of such pictures; all there is where the photograph says how large
 * they are. */
size_t framing_finest(const struct framing_options *want);

/* Sizes, part and inset of opt for a source, which f points into and which
 * must stay.  EX_DATAERR when the source has no photograph for it. */
int framing_init(struct framing *f, struct animate_options *opt,
                 const struct framing_options *want,
                 const struct prepared *s, struct error *err);
/* Free what it holds; zeroed then. */
void framing_release(struct framing *f);

#endif
