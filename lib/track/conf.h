/* The CONF record of the programs that begin a stream, and squares as people
 * type them. */
#ifndef SPID_TRACK_CONF_H
#define SPID_TRACK_CONF_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/base/crop.h"
#include "lib/head/head.h"
#include "lib/net/model.h"
#include "lib/stream/stream.h"

struct conf {
    const char *producer;           /* "spid-motion" */
    const struct head *head;
    const struct model *model;      /* NULL: the stream is of no network */
    size_t size;                    /* pixels of the camera's picture; 0: the
                                     * model's, or 512 */
    int fps_num, fps_den;           /* frames a second; 0: left out, or */
    double rate;                    /* as one number */
    const char *sound;              /* the clip that has some, or NULL; */
    double sound_start;             /* ... its time of frame 0, seconds */
    const long *seed;               /* NULL: left out */
    const struct square *window;    /* picture pixels; NULL: left out */
    size_t width, height;           /* of the picture */
};

/* Write CONF: {"producer","version","units":"head","scale","camera":{"size",
 * "focal"},"fps":[n,d] or rate,"sound":{"clip","start"},"picture":[w,h],
 * "window":[x,y,size],"seed","head_hash","model_hash"}. */
int conf_write(struct stream_writer *w, const struct conf *c,
               struct error *err);

/* "X,Y,SIZE": centre and side in pixels, side 1 to 100000.  dest is a struct
 * square. */
int square_parse(const char *value, void *dest, struct error *err);

#endif
