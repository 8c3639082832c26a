/* Phase B of the branches on a stream: an avatar's Gaussians, then what moves
 * in every MESH record. */
#ifndef SPID_AVATAR_MOVER_H
#define SPID_AVATAR_MOVER_H

#include <stdbool.h>

#include "lib/avatar/baked.h"
#include "lib/avatar/target_light.h"
#include "lib/head/person.h"
#include "lib/stream/stream.h"

struct mover_options {
    bool full;              /* GAUS per frame instead of GMOV */
    unsigned without;       /* enum avatar_without; not WITHOUT_DEFORM */
    struct target_light light;
};

struct mover {
    struct mover_options opt;
    const char *path;       /* the avatar's; kept, not copied */
    char head[17];          /* hash in its CONF */
    struct person person;   /* the picture that places are places of */
    struct baked baked;
    struct densify dense;   /* of the first mesh's faces */
    struct motion driver;   /* the first motion that says its light */
    struct baked_move move;
    float *means;           /* (N,3); NULL before the first mesh */
    bool sent;              /* the GAUS record */
};

/* Read the avatar.  -1 and *err when the file has none; what was read waits for
 * mover_release. */
int mover_open(struct mover *m, const char *path,
               const struct mover_options *opt, struct error *err);
/* Free what it holds; zeroed then. */
void mover_release(struct mover *m);

/* Answer a record: a MESH with the avatar's GAUS (once) and a GMOV, anything
 * else by passing it on.  -1 and *err when it is not of the avatar's head, is
 * damaged, or cannot be written. */
int mover_apply(struct mover *m, struct stream_writer *out,
                const struct record *rec, struct error *err);

#endif
