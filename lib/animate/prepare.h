/* Phase A for spid animate: a source of any kind becomes a baked avatar. */
#ifndef SPID_ANIMATE_PREPARE_H
#define SPID_ANIMATE_PREPARE_H

#include <pthread.h>
#include <stdbool.h>

#include "formats/image.h"
#include "lib/animate/pipeline.h"
#include "lib/avatar/baked.h"
#include "lib/base/densify.h"
#include "lib/avatar/baker.h"
#include "lib/avatar/prune.h"
#include "lib/net/model.h"
#include "lib/head/person.h"
#include "lib/track/source.h"
#include "lib/track/encoders.h"
#include "lib/photo/texture.h"

/* The head, loaded beside the encoders and, of one source, its picture. */
struct prepare_loading {
    pthread_t thread;
    pthread_mutex_t lock;
    bool running;               /* the thread is, and is not yet joined */
    char path[4096];
    struct error err;
    int rc;
};

/* What every clip shares: model files, loaded once. */
struct prepare {
    struct model model;
    struct prepare_loading loading;     /* of: */
    struct head head;
    struct densify dense;
    struct encoders nets;       /* E_m and E_beta */
    struct baker baker;         /* loaded by the first source that needs it */
    bool has_baker;
    enum nn_type precision;
    bool star;                  /* SpiD*: features beyond the colours are not
                                 * needed */
    bool once;                  /* one source: what bakes it goes then, and
                                 * its memory serves what follows */
    struct track_options track; /* which face of a picture, or its crop */
    struct facedetect *detector;        /* of the source's tracker and its */
    struct motion_mirror across;        /* drivers', and their E_m's mirror */
    const char *soon[2];        /* files that are opened first, or NULL: their
                                 * modules are loaded beside the head.  No
                                 * thread starts meanwhile: */
    const char *then;           /* another, whose module is loaded when what
                                 * bakes a picture has been */
};

/* One source. */
struct prepared {
    struct person person;
    struct identity id;         /* beta folded */
    struct baked baked;
    struct texture texture;     /* the photograph; no levels: none */
    struct image picture;       /* all of it, as it was read; of a stream:
                                 * none */
    double shape_s, bake_s;     /* Phase A: crop to beta; branches */
    struct source_notes notes;  /* of the picture */
};

/* Open the files of a model and its head; of one source the head is only there
 * once prepare_source has been.  The flags of p are set by the
 * caller before. */
int prepare_open(struct prepare *p, const char *model, const char *head,
                 struct error *err);
/* Free what it holds; zeroed then. */
void prepare_release(struct prepare *p);

/* What another thread may do once the face is found in a picture, or while a stream
 * is read, when E_m has nothing to do.  It may be left undone. */
struct prepare_beside {
    void *(*run)(void *ctx);
    void *ctx;
    pthread_t thread;           /* that does it, while it is */
    bool running;
};

/* From a picture (mask: path or NULL), an identity or an avatar (a stream,
 * told by its magic).  beside: NULL for nothing. */
int prepare_source(struct prepared *s, struct prepare *p, const char *path,
                   const char *mask, struct prepare_beside *beside,
                   struct error *err);
/* From s->person, whose parts were set and all else is 0: folded, baked and
 * textured.  On an error s is released. */
int prepare_person(struct prepared *s, struct prepare *p, struct error *err);
/* What a pipeline draws of it; borrowed from both. */
struct pipeline_avatar prepared_avatar(const struct prepared *s,
                                       const struct prepare *p);
/* Free what it holds; zeroed then. */
void prepared_release(struct prepared *s);

#endif
