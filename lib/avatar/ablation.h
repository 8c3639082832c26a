/* The paper's ablations: what an avatar is baked without. */
#ifndef SPID_AVATAR_ABLATION_H
#define SPID_AVATAR_ABLATION_H

#include "lib/base/error.h"

enum avatar_without {
    WITHOUT_DYNAMIC = 1, WITHOUT_STATIC = 2, WITHOUT_MOUTH = 4,
    WITHOUT_INTERP = 8,     /* no midpoints: V dynamic Gaussians */
    WITHOUT_DEFORM = 16,    /* Delta U = 0: the uniform plane */
    WITHOUT_NECK = 32       /* no neck blend: shoulders turn with the head */
};

/* The bit for "dynamic", "static", "mouth", "interp", "deform" or "neck" (also
 * "bend", its name until 0.1); 0 for any other word. */
unsigned avatar_without_parse(const char *word);
/* The same for words with commas between, added to *bits; -1 and EX_USAGE
 * naming the one that is unknown. */
int avatar_without_list(unsigned *bits, const char *words,
                        struct error *err);

#endif
