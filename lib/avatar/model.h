/* A model file's avatar networks and its head, ready to bake. */
#ifndef SPID_AVATAR_MODEL_H
#define SPID_AVATAR_MODEL_H

#include "lib/avatar/avatar.h"
#include "lib/avatar/records.h"
#include "lib/base/error.h"
#include "lib/head/lbs.h"

struct avatar_model {
    struct avatar_config config;
    char hash[17];              /* as CONF's "model_hash" */
    struct params ps;
    struct avatar avatar;
};

/* Load config and weights from model file `path` for head h (borrowed);
 * `without` is enum avatar_without.  Errors name file, tensor, expected and
 * found shape; EX_CONFIG when the model was made for another head. */
int avatar_model_open(struct avatar_model *m, const char *path,
                      const struct head *h, unsigned without,
                      enum nn_type type, struct error *err);
void avatar_model_release(struct avatar_model *m);

/* Bake a person: fold the shape, pose the source, run the branches.  verts
 * (V,3) gets the source mesh.  EX_DATAERR when the person has no picture or
 * no source motion, the picture's size is not the model's, or the identity
 * was made with another model or head. */
int avatar_model_bake(struct avatar_model *m, float *verts,
                      const struct person *p, struct error *err);

#endif
