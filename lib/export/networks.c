/* Every network of a model as a file of its own. */
#include "lib/export/networks.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

static const struct {
    const char *name, *about;
} networks_table[NETWORK_COUNT] = {
    {"motion", "SpiD's E_m: motion of the face in a crop (224 x 224, RGB 0 to "
               "1): rotation 6, translation 3, expression 100, jaw 3, lids 2, "
               "eyes 6"},
    {"shape", "SpiD's E_beta: 300 shape coefficients of the face in a crop"},
    {"matte", "SpiD's matte network: how much of a pixel is the person"},
    {"backbone", "SpiD's features of the source picture"},
    {"plane", "SpiD's Phi_init: how far the static plane's cells move"},
    {"static", "SpiD's Phi_S: Gaussians of the static plane"},
    {"dynamic", "SpiD's Phi_D: Gaussians of the head mesh"},
    {"mouth", "SpiD's Phi_M: Gaussians of the mouth's inside"},
    {"refiner", "SpiD's refiner: the final picture from splatted features"},
};

int networks_open(struct networks *n, const struct model *m,
                  const struct head *head, struct error *err)
{
    const struct avatar_config *c = &m->config;
    const char *prefix = avatar_config_refiner(c);

    memset(n, 0, sizeof *n);
    n->has_refiner = c->has_refiner;
    if (encoders_open(&n->encoders, m, true, NN_F32, err))
        return -1;
    if (avatar_init(&n->avatar, &n->avatar_ps, c, head, err) ||
        params_allocate(&n->avatar_ps, err) ||
        model_load(&n->avatar_ps, m, "", err) ||
        (n->has_refiner &&
         (refiner_init(&n->refiner, &n->refiner_ps, prefix, &c->refiner,
                       err) ||
          params_allocate(&n->refiner_ps, err) ||
          model_load(&n->refiner_ps, m, prefix, err)))) {
        error_prefix(err, "%s", model_path(m));
        networks_release(n);
        return -1;
    }
    return 0;
}

void networks_release(struct networks *n)
{
    encoders_release(&n->encoders);
    avatar_release(&n->avatar);
    refiner_release(&n->refiner);
    params_release(&n->avatar_ps);
    params_release(&n->refiner_ps);
    memset(n, 0, sizeof *n);
}

const char *networks_name(enum network which)
{
    return networks_table[which].name;
}

/* Whether the model has it. */
static bool networks_have(const struct networks *n, enum network which)
{
    return which == NETWORK_MATTE     ? n->encoders.has_matte
           : which == NETWORK_PLANE   ? n->avatar.config.init_width > 0
           : which == NETWORK_REFINER ? n->has_refiner
                                      : true;
}

int networks_graph(struct graph *g, const struct networks *n,
                   enum network which, struct error *err)
{
    const struct avatar *a = &n->avatar;
    const struct avatar_config *c = &a->config;

    graph_init(g, networks_table[which].name, networks_table[which].about);
    switch (which) {
    case NETWORK_MOTION:
        motion_encoder_graph(g, &n->encoders.motion);
        break;
    case NETWORK_SHAPE:
        shape_encoder_graph(g, &n->encoders.shape);
        break;
    case NETWORK_MATTE:
        matte_net_graph(g, &n->encoders.matte);
        break;
    case NETWORK_BACKBONE:
        backbone_graph(g, c->size, &a->backbone);
        break;
    case NETWORK_PLANE:
        plane_init_graph(g, c->plane, &a->plane.init);
        break;
    case NETWORK_STATIC:
        conv_decoder_graph(g, c->plane, &a->plane.decoder);
        break;
    case NETWORK_DYNAMIC:
        mlp_decoder_graph(g, a->dynamic.count, &a->dynamic.decoder);
        break;
    case NETWORK_MOUTH:
        conv_decoder_graph(g, c->mouth, &a->mouth.decoder);
        break;
    default:
        refiner_graph(g, c->size, c->size, &n->refiner);
    }
    if (!g->err.code)
        return 0;
    *err = g->err;
    return error_prefix(err, "network %s", networks_table[which].name);
}

static int networks_write_one(const char *dir, const struct networks *n,
                              enum network which, struct error *err)
{
    char path[4096];
    struct graph g;
    int rc = networks_graph(&g, n, which, err);

    snprintf(path, sizeof path, "%s/%s.onnx", dir,
             networks_table[which].name);
    if (rc == 0)
        rc = onnx_write(path, &g.file, err);
    graph_release(&g);
    return rc;
}

int networks_write(const char *dir, const struct networks *n,
                   struct error *err)
{
    int rc = 0;

    if (mkdir(dir, 0777) && errno != EEXIST)
        return error_set(err, EX_CANTCREAT, "%s: cannot create: %s", dir,
                         strerror(errno));
    for (int i = 0; i < NETWORK_COUNT && rc == 0; i++)
        if (networks_have(n, (enum network)i))
            rc = networks_write_one(dir, n, (enum network)i, err);
    return rc;
}
