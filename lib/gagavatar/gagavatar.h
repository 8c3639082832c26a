/* GAGAvatar (Chu and Harada 2024), which SpiD builds on: one Gaussian per
 * vertex of the head and two planes of them lifted from the source picture's
 * features, refined by a StyleUNet.  Weights have the names of the public
 * checkpoint. */
#ifndef SPID_GAGAVATAR_GAGAVATAR_H
#define SPID_GAGAVATAR_GAGAVATAR_H

#include "lib/base/error.h"
#include "lib/net/backbone.h"
#include "lib/net/conv_decoder.h"
#include "lib/net/mlp_decoder.h"
#include "lib/net/refiner.h"
#include "lib/nn/params.h"

#define GAGAVATAR_SIZE 512          /* pixels of the pictures */
#define GAGAVATAR_PLANE 296         /* Gaussians of a plane's side */
#define GAGAVATAR_FEATURE 256       /* channels of the picture's features */
#define GAGAVATAR_GLOBAL 768        /* numbers of the token for all of it */
#define GAGAVATAR_CHANNELS 32       /* of a Gaussian's colour */

struct gagavatar {
    struct params *ps;
    size_t V;                       /* vertices */
    size_t base;                    /* tensor head_base (V,256) */
    struct backbone backbone;       /* base_model. */
    struct mlp_decoder vertex;      /* gs_generator_g. */
    struct conv_decoder plane[2];   /* gs_generator_l0., l1. */
    struct refiner refiner;         /* upsampler. */
};

/* Declare all tensors for a head of V vertices (FLAME: 5023). */
int gagavatar_init(struct gagavatar *g, struct params *ps, size_t V,
                   struct error *err);
void gagavatar_release(struct gagavatar *g);

#endif
