/* Other avatar systems' checkpoints: the names stay; every tensor that their
 * networks have here must be there in its shape.  Encoders, which they have
 * none of, come from a model of ours, moved to the head in use. */
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/convert/headed.h"
#include "lib/lab/convert/table.h"
#include "lib/net/gagavatar.h"
#include "lib/net/lam.h"

/* The configuration of --config, or the public one. */
static int avatars_configure(struct avatar_config *config,
                             enum model_system system, const char *path,
                             struct error *err)
{
    const char *name = system == SYSTEM_LAM ? "lam" : "gagavatar";

    if (system == SYSTEM_LAM)
        avatar_config_lam(config);
    else
        avatar_config_gagavatar(config);
    if (path && avatar_config_load(config, path, err))
        return -1;
    if (config->system == system &&
        config->has_refiner == (system == SYSTEM_GAGAVATAR))
        return 0;
    return error_set(err, EX_CONFIG, "%s: no %s (expected \"system\": \"%s\" "
                     "and %s refiner)", path, name, name,
                     system == SYSTEM_LAM ? "no" : "a");
}

/* --encoders: theirs into the output and its configuration. */
static int avatars_encoders(struct convert *c, struct avatar_config *config,
                            struct error *err)
{
    const struct convert_options *with = c->with;
    struct headed h;
    int rc;

    if (!with->encoders)
        return 0;
    rc = headed_open(&h, with->encoders, with->from_head, with->head, err) ||
                 headed_encoders(c, &h, err)
             ? -1
             : 0;
    if (rc == 0) {
        snprintf(config->motion_net, sizeof config->motion_net, "%s",
                 h.config.motion_net);
        snprintf(config->shape_net, sizeof config->shape_net, "%s",
                 h.config.shape_net);
        snprintf(config->head_hash, sizeof config->head_hash, "%s",
                 h.config.head_hash);
    }
    headed_release(&h);
    return rc;
}

int convert_gagavatar(struct convert *c, struct error *err)
{
    const size_t any[2] = {0, 0};
    char prefix[TENSORFILE_NAME];
    struct avatar_config config;
    struct gagavatar g = {0};
    struct refiner r = {0};
    struct params ps;
    size_t i;
    int rc = -1;

    if (avatars_configure(&config, SYSTEM_GAGAVATAR, c->with->config, err))
        return -1;
    convert_prefix(prefix, c, 0, "head_base");
    i = convert_find(c, 0, prefix, "head_base", 2, any, false);
    params_init(&ps);
    if (!gagavatar_init(&g, &ps, &config, i == SIZE_MAX ? 5023
                        : tensorfile_at(c->file[0], i)->dim[0], err) &&
        !gagavatar_init_refiner(&r, &ps, &config, err))
        rc = convert_take_params(c, 0, prefix, &ps, "", "", err);
    if (rc == 0)
        rc = avatars_encoders(c, &config, err);
    headed_describe(c, &config);
    gagavatar_release(&g);
    refiner_release(&r);
    params_release(&ps);
    return rc;
}

/* What LAM's checkpoint holds beside weights, which its networks compute and
 * the head has. */
static void lam_pass_over(struct convert *c, const char *prefix)
{
    static const char *const known[] = {"pcl_embed.basis",
                                        "renderer.flame_model."};

    for (size_t i = 0; i < tensorfile_count(c->file[0]); i++) {
        const char *name = tensorfile_at(c->file[0], i)->name;

        if (strncmp(name, prefix, strlen(prefix)))
            continue;
        for (int k = 0; k < 2; k++)
            if (!strncmp(name + strlen(prefix), known[k], strlen(known[k])))
                c->used[0][i] = true;
    }
}

int convert_lam(struct convert *c, struct error *err)
{
    char prefix[TENSORFILE_NAME];
    struct avatar_config config;
    struct lam l = {0};
    struct params ps;
    int rc = -1;

    if (avatars_configure(&config, SYSTEM_LAM, c->with->config, err))
        return -1;
    convert_prefix(prefix, c, 0, "pcl_embed.mlp.weight");
    params_init(&ps);
    if (!lam_init(&l, &ps, &config, err))
        rc = convert_take_params(c, 0, prefix, &ps, "", "", err);
    lam_pass_over(c, prefix);
    if (rc == 0)
        rc = avatars_encoders(c, &config, err);
    headed_describe(c, &config);
    lam_release(&l);
    params_release(&ps);
    return rc;
}
