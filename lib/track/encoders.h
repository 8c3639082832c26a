/* E_m and E_beta of a model file, ready to run on one face crop. */
#ifndef SPID_TRACK_ENCODERS_H
#define SPID_TRACK_ENCODERS_H

#include <stdbool.h>

#include "formats/safetensors.h"
#include "lib/avatar/config.h"
#include "lib/base/error.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/shape_encoder.h"
#include "lib/nn/params.h"

struct encoders {
    struct avatar_config config;
    char model_hash[17];        /* of the file: see model_hash */
    struct params ps;
    struct motion_encoder motion;
    struct shape_encoder shape;
    bool has_shape;
};

/* The configuration of an open model file (metadata "spid"); errors name the
 * file. */
int model_config(struct avatar_config *c, const struct safetensors *st,
                 struct error *err);
/* Hex hash of a model file's tensors (names, shapes, bytes): what CONF's
 * "model_hash" holds. */
void model_hash(char hash[17], const struct safetensors *st);

/* Load from a model file: the motion encoder, and the shape encoder when
 * with_shape.  Errors name file, tensor, expected and found shape. */
int encoders_open(struct encoders *e, const char *path, bool with_shape,
                  enum nn_type type, struct error *err);
void encoders_release(struct encoders *e);

#endif
