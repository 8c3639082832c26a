#include "lib/gagavatar/gagavatar.h"

#include <string.h>

/* ---- making ------------------------------------------------------------- */

int gagavatar_init(struct gagavatar *g, struct params *ps, size_t V,
                   struct error *err)
{
    const struct backbone_config backbone = {
        .type = BACKBONE_DINOV2, .features = GAGAVATAR_FEATURE,
        .size = GAGAVATAR_PLANE, .embed = GAGAVATAR_GLOBAL, .depth = 12,
        .heads = 12, .patch = 14, .image = 518};
    const struct refiner_config refiner = {
        .type = REFINER_STYLE_UNET, .channels = GAGAVATAR_CHANNELS,
        .multiplier = 1, .size = GAGAVATAR_SIZE};
    const struct gaussian_head on_vertex = {
        GAGAVATAR_CHANNELS, GAUSSIAN_POSITION_NONE, false, true};
    const struct gaussian_head on_plane = {
        GAGAVATAR_CHANNELS, GAUSSIAN_POSITION_DEPTH, true, false};
    const size_t base[2] = {V, 256};

    memset(g, 0, sizeof *g);
    g->ps = ps;
    g->V = V;
    g->base = params_add(ps, "head_base", 2, base, PARAM_NORMAL, 1);
    if (backbone_init(&g->backbone, ps, "base_model.", &backbone, err) ||
        mlp_decoder_init(&g->vertex, ps, "gs_generator_g.",
                         256 + GAGAVATAR_GLOBAL, 256, 128, on_vertex, err) ||
        conv_decoder_init(&g->plane[0], ps, "gs_generator_l0.",
                          GAGAVATAR_FEATURE, 128, on_plane, err) ||
        conv_decoder_init(&g->plane[1], ps, "gs_generator_l1.",
                          GAGAVATAR_FEATURE, 128, on_plane, err) ||
        refiner_init(&g->refiner, ps, "upsampler.", &refiner, err)) {
        gagavatar_release(g);
        return -1;
    }
    return 0;
}

void gagavatar_release(struct gagavatar *g)
{
    backbone_release(&g->backbone);
    mlp_decoder_release(&g->vertex);
    conv_decoder_release(&g->plane[0]);
    conv_decoder_release(&g->plane[1]);
    refiner_release(&g->refiner);
    memset(g, 0, sizeof *g);
}
