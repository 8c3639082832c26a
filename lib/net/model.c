/* Opening a model file: the configuration under the metadata key "spid", and
 * a digest that identities carry so that they meet their own model again. */
#include "lib/net/model.h"

#include <stdio.h>
#include <string.h>
#include <sysexits.h>
#include <xxhash.h>

/* m->config from the metadata of m->st. */
static int model_read_config(struct model *m, struct error *err)
{
    const char *json = st_meta(m->st, "spid");

    if (!json)
        return error_set(err, EX_CONFIG, "%s: not a SpiD model (expected the "
                         "metadata key \"spid\"; public checkpoints are "
                         "turned into models by spid-import)",
                         st_path(m->st));
    if (avatar_config_parse(&m->config, json, err))
        return error_prefix(err, "%s", st_path(m->st));
    return 0;
}

/* Chain the hashes of all tensors in the order of the file. */
static void model_read_hash(struct model *m)
{
    uint64_t h = 0;

    for (size_t i = 0; i < st_count(m->st); i++) {
        const struct st_tensor *t = st_at(m->st, i);
        uint64_t v[12] = {h, (uint64_t)t->dtype, (uint64_t)t->ndim};

        for (int k = 0; k < t->ndim; k++)
            v[3 + k] = t->dim[k];
        v[11] = XXH3_64bits(t->data, t->count * st_dtype_size(t->dtype));
        h = XXH3_64bits_withSeed(v, sizeof v,
                                 XXH3_64bits(t->name, strlen(t->name)));
    }
    snprintf(m->hash, sizeof m->hash, "%016llx", (unsigned long long)h);
}

int model_open(struct model *m, const char *path, struct error *err)
{
    memset(m, 0, sizeof *m);
    m->st = st_open(path, err);
    if (!m->st)
        return -1;
    if (model_read_config(m, err)) {
        model_close(m);
        return -1;
    }
    model_read_hash(m);
    return 0;
}

void model_close(struct model *m)
{
    st_close(m->st);
    memset(m, 0, sizeof *m);
}

const char *model_path(const struct model *m)
{
    return m->st ? st_path(m->st) : "untrained model";
}

int model_check_head(const struct avatar_config *c, const struct head *h,
                     struct error *err)
{
    if (!c->head_hash[0] || !strcmp(c->head_hash, h->hash))
        return 0;
    return error_set(err, EX_CONFIG, "model was made for head %s "
                     "(expected %s, the head in use)", c->head_hash, h->hash);
}

int model_load(struct params *ps, const struct model *m, const char *prefix,
               struct error *err)
{
    if (m->st)
        return params_load(ps, m->st, prefix, err);
    params_randomise(ps, 1);
    return 0;
}
