/* Records in, pictures out: the scene that a stream describes is drawn after
 * every record that moves it.  Eqs. C and G of the paper, and the photograph
 * over them (lib/photo).  spid-splat is this and an option table. */
#ifndef SPID_ANIMATE_RENDER_H
#define SPID_ANIMATE_RENDER_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include "formats/framesink.h"
#include "lib/animate/canvas.h"
#include "lib/splat/scene.h"
#include "lib/splat/types.h"
#include "lib/photo/texture.h"

struct render_options {
    struct splat_options splat; /* width = height; place, where a texture is
                                 * to be shown */
    float focal;                /* in half pictures */
    const float *camera;        /* [R|t] instead of the stream's, or NULL */
    bool exact;                 /* double precision without cut-offs */
    bool features;              /* the sink writes FEAT: pictures leave by a
                                 * thread, and photograph and pose beside */
    bool half;                  /* features in half precision */
    bool places;                /* features with the photograph's places */
    /* For --stats: a clock, and what adds the time since begun to a stage. */
    double (*begin)(void);
    void (*end)(const char *stage, double begun);
};

/* A picture leaves by a thread, so that the next one is drawn while its
 * receiver takes this one: a pipe holds a small part of it.  Zeroed: idle. */
struct async_write {
    pthread_t thread;
    bool busy;
    struct framesink *sink;
    struct framesink_frame frame;
    int rc;
    struct error err;
};
/* Wait until the picture is out; 0, or -1 and why it is not.  0 if idle. */
int async_write_wait(struct async_write *w, struct error *err);

struct render {
    struct render_options opt;
    struct framesink *sink;     /* borrowed */
    struct scene scene;
    struct splat splat;
    struct canvas canvas, other; /* drawn next; on its way out, if it can be */
    struct async_write writing;
    double *wide;               /* (N,N,C + 2) in double for exact */
    struct texture texture;     /* the photograph of SRCI; no levels: none */
    bool grain_due;             /* the next FEAT with places has the grain */
    bool pending;               /* a GAUS without camera waits: drawn with
                                 * opt.camera or from where the source was
                                 * seen unless GMOV records follow */
    uint64_t frame;             /* ... of this number and time */
    double time;
};

/* EX_USAGE for an option out of range, EX_OSERR without memory. */
int render_init(struct render *r, const struct render_options *opt,
                struct framesink *sink, struct error *err);
/* Free what it holds. */
void render_release(struct render *r);

/* Take the next record: draw what it changes, pass on what is not ours.
 * EX_DATAERR for a picture without camera and what scene_apply refuses. */
int render_record(struct render *r, const struct record *rec,
                  struct error *err);

/* Draw what still waits, and wait until it is out. */
int render_finish(struct render *r, struct error *err);

#endif
