/* GAGAvatar's checkpoint: the names stay; every tensor that its networks have
 * here must be there in its shape.  Encoders, which it has none of, come from
 * a model of ours, moved to the head in use. */
#include "lib/net/gagavatar.h"

#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/convert/headed.h"
#include "lib/lab/convert/table.h"

/* The configuration of --config, or the public one. */
static int gagavatar_configure(struct avatar_config *config, const char *path,
                               struct error *err)
{
    avatar_config_gagavatar(config);
    if (path && avatar_config_load(config, path, err))
        return -1;
    if (config->system == SYSTEM_GAGAVATAR && config->has_refiner)
        return 0;
    return error_set(err, EX_CONFIG, "%s: no gagavatar (expected \"system\": "
                     "\"gagavatar\" and a refiner)", path);
}

/* --encoders: theirs into the output and its configuration. */
static int gagavatar_encoders(struct convert *c, struct avatar_config *config,
                              const struct convert_options *o,
                              struct error *err)
{
    struct headed h;
    int rc;

    if (!o->encoders)
        return 0;
    rc = headed_open(&h, o->encoders, o->from_head, o->head, err) ||
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

int convert_gagavatar(struct convert *c, const struct convert_options *o,
                      struct error *err)
{
    const size_t any[2] = {0, 0};
    char prefix[TENSORFILE_NAME];
    struct avatar_config config;
    struct gagavatar g = {0};
    struct refiner r = {0};
    struct params ps;
    size_t i;
    int rc = -1;

    if (gagavatar_configure(&config, o->config, err))
        return -1;
    convert_prefix(prefix, c, 0, "head_base");
    i = convert_find(c, 0, prefix, "head_base", 2, any, false);
    params_init(&ps);
    if (!gagavatar_init(&g, &ps, &config, i == SIZE_MAX ? 5023
                        : tensorfile_at(c->file[0], i)->dim[0], err) &&
        !gagavatar_init_refiner(&r, &ps, &config, err))
        rc = convert_take_params(c, 0, prefix, &ps, "", "", err);
    if (rc == 0)
        rc = gagavatar_encoders(c, &config, o, err);
    headed_describe(c, &config);
    gagavatar_release(&g);
    refiner_release(&r);
    params_release(&ps);
    return rc;
}
