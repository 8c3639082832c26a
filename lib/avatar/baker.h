/* Phase A from a model file: the avatar's networks with their trained weights,
 * which turn an identity's source picture into Gaussians: SpiD's three
 * branches, GAGAvatar's vertices and planes, or LAM's vertices. */
#ifndef SPID_AVATAR_BAKER_H
#define SPID_AVATAR_BAKER_H

#include "lib/avatar/avatar.h"
#include "lib/avatar/baked.h"
#include "lib/base/error.h"
#include "lib/net/gagavatar.h"
#include "lib/net/config.h"
#include "lib/net/lam.h"
#include "lib/net/model.h"
#include "lib/head/person.h"

struct baker {
    char hash[17];              /* of the model: see struct model */
    struct params ps;
    struct avatar_config config;
    const struct head *head;    /* borrowed */
    struct avatar avatar;       /* SYSTEM_SPID */
    struct gagavatar gagavatar; /* SYSTEM_GAGAVATAR */
    struct lam lam;             /* SYSTEM_LAM */
};

struct baker_options {
    unsigned without;           /* enum avatar_without (SpiD's) */
    size_t colors;              /* kept of each of SpiD's Gaussians; 0: all */
    enum nn_type type;
};

/* Load the avatar's weights for head h (borrowed).  The model may be closed
 * afterwards.  Errors name file, tensor, expected and found shape; EX_CONFIG
 * when the model was made for another head. */
int baker_open(struct baker *b, const struct model *m, const struct head *h,
               const struct baker_options *opt, struct error *err);
/* Free what it holds; zeroed then. */
void baker_release(struct baker *b);

/* Bake a person: fold the shape, pose the source, run the branches.  verts
 * (V,3) gets the source mesh.  LAM sets p->offset, in place of an earlier
 * one.  EX_DATAERR when the person has no picture or
 * no source motion, the picture's size is not the model's, or the identity
 * was made with another model or head. */
int baker_bake(struct baker *b, float *verts, struct person *p,
               struct error *err);
/* A copy of what the last baker_bake made, for Phase B; the caller releases it
 * (baked_release).  drawn: without SpiD's Gaussians that are never drawn
 * (baked_drop_clear). */
int baker_copy(struct baked *out, struct baker *b, bool drawn,
               struct error *err);

#endif
