#include "lib/track/encoders.h"

#include <stdio.h>
#include <string.h>
#include <sysexits.h>
#include <xxhash.h>

int model_config(struct avatar_config *c, const struct safetensors *st,
                 struct error *err)
{
    const char *json = st_meta(st, "spid");

    if (!json)
        return error_set(err, EX_CONFIG, "%s: not a SpiD model (expected the "
                         "metadata key \"spid\"; public checkpoints are "
                         "turned into models by spid-import)", st_path(st));
    if (avatar_config_parse(c, json, err) != 0)
        return error_prefix(err, "%s", st_path(st));
    return 0;
}

void model_hash(char hash[17], const struct safetensors *st)
{
    uint64_t h = 0;

    for (size_t i = 0; i < st_count(st); i++) {
        const struct st_tensor *t = st_at(st, i);
        uint64_t v[12] = {h, (uint64_t)t->dtype, (uint64_t)t->ndim};
        for (int k = 0; k < t->ndim; k++)
            v[3 + k] = t->dim[k];
        v[11] = XXH3_64bits(t->data, t->count * st_dtype_size(t->dtype));
        h = XXH3_64bits_withSeed(v, sizeof v,
                                 XXH3_64bits(t->name, strlen(t->name)));
    }
    snprintf(hash, 17, "%016llx", (unsigned long long)h);
}

static int declare(struct encoders *e, bool with_shape, struct error *err)
{
    if (motion_encoder_init(&e->motion, &e->ps, "motion.",
                            e->config.motion_net, err) != 0)
        return -1;
    if (with_shape && shape_encoder_init(&e->shape, &e->ps, "shape.",
                                         e->config.shape_net, err) != 0)
        return -1;
    e->has_shape = with_shape;
    return params_allocate(&e->ps, err);
}

int encoders_open(struct encoders *e, const char *path, bool with_shape,
                  enum nn_type type, struct error *err)
{
    const struct nn_options opt = {NN_INFER, type};
    struct safetensors *st;
    int rc = -1;

    memset(e, 0, sizeof *e);
    params_init(&e->ps);
    st = st_open(path, err);
    if (!st)
        return -1;
    if (model_config(&e->config, st, err) == 0
        && declare(e, with_shape, err) == 0
        && params_load(&e->ps, st, "", err) == 0
        && motion_encoder_plan(&e->motion, 1, opt, err) == 0
        && (!with_shape || shape_encoder_plan(&e->shape, 1, opt, err) == 0))
        rc = 0;
    model_hash(e->model_hash, st);
    st_close(st);
    if (rc != 0)
        encoders_release(e);
    return rc;
}

void encoders_release(struct encoders *e)
{
    motion_encoder_release(&e->motion);
    shape_encoder_release(&e->shape);
    params_release(&e->ps);
    memset(e, 0, sizeof *e);
}
