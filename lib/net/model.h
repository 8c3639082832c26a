/* A model file: the trained weights of one avatar system as safetensors, its
 * configuration in the metadata.  Programs open it once; encoders, branches
 * and refiner declare their tensors from `config` and fill them from here. */
#ifndef SPID_NET_MODEL_H
#define SPID_NET_MODEL_H

#include "formats/safetensors.h"
#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/net/config.h"
#include "lib/nn/params.h"

struct model {
    struct safetensors *st;     /* the open file; NULL: none, and weights are
                                 * drawn from a fixed seed */
    struct avatar_config config;
    char hash[17];              /* of names, shapes and bytes of all tensors,
                                 * hex: CONF's "model_hash" */
};

/* Open a model file and read its configuration.  EX_CONFIG naming the file
 * when it is no SpiD model.  On failure nothing is left open. */
int model_open(struct model *m, const char *path, struct error *err);
/* Closes the file; a struct model of zeros is allowed. */
void model_close(struct model *m);

/* The file's name, for messages. */
const char *model_path(const struct model *m);

/* EX_CONFIG when the configuration names another head than h. */
int model_check_head(const struct avatar_config *c, const struct head *h,
                     struct error *err);

/* Fill those tensors of ps whose names begin with prefix ("": all of them)
 * from the file; errors name file, tensor, expected and found shape. */
int model_load(struct params *ps, const struct model *m, const char *prefix,
               struct error *err);

#endif
