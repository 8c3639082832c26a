/* Places without people: what a tracker looks at where there is no face. */
#ifndef SPID_LAB_DATA_SCENERY_H
#define SPID_LAB_DATA_SCENERY_H

#include "lib/base/names.h"
#include "lib/lab/data/data.h"

struct scenery {
    struct data_frame *frame;   /* whole pictures without landmarks */
    size_t count;
};

/* Panoramas (formats/panorama.h) as pictures of several exposures.  The caller
 * releases s, also after an error: panorama_read's, EX_OSERR. */
int scenery_read(struct scenery *s, const struct names *panoramas,
                 struct error *err);
/* Free what it holds; zeroed then. */
void scenery_release(struct scenery *s);

/* One of the pictures. */
const struct data_frame *scenery_draw(const struct scenery *s,
                                      struct random *r);

#endif
