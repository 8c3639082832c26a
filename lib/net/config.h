/* The configuration of a model: JSON under the metadata key "spid" of
 * model.safetensors; every size of the networks and branches follows from it.
 *
 *   {"version":1, "system":"spid", "size":512, "focal":12, "plane":296,
 *    "mouth":32, "channels":32, "feature":256, "head_hash":"0123456789abcdef",
 *    "motion":{"net":"mobilenetv3_small_100"},
 *    "shape":{"net":"tf_mobilenetv3_large_minimal_100"},
 *    "backbone":{"type":"small","width":16} or
 *               {"type":"dinov2","embed":768,"depth":12,"heads":12,
 *                "patch":14,"image":518},
 *    "init":{"width":64}, "static":{"width":128},
 *    "dynamic":{"width":256,"head":128,"vertex":256},
 *    "mouth_decoder":{"width":128}, "transformer":{"layers":10,"heads":16},
 *    "rgb_skip":false, "public_quirks":false, "without":"nothing",
 *    "refiner":{"type":"narrow","width":32,"turn":true,"photo":false} or
 *              {"type":"style_unet","multiplier":1} or null}
 *
 * Keys left out take the paper's values (rgb_skip and public_quirks: false;
 * refiner: none).  "system":"gagavatar" is the public system that SpiD builds
 * on (lib/net): "plane" is both its planes, "static" their decoders,
 * "dynamic" the vertices'; "mouth" and "init" mean nothing there.  Of "lam"
 * (lib/net/lam.h) "transformer", "dynamic" (its width, and the decoder's as
 * "head"), "feature" and "backbone" (with "registers") are all.  Keys of other
 * producers are ignored. */
#ifndef SPID_NET_CONFIG_H
#define SPID_NET_CONFIG_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"
#include "lib/net/backbone.h"
#include "lib/net/refiner.h"

enum model_system { SYSTEM_SPID, SYSTEM_GAGAVATAR, SYSTEM_LAM };

struct avatar_config {
    enum model_system system;
    size_t size;            /* S: picture, pixels */
    size_t plane;           /* n: static grid, n x n */
    size_t mouth;           /* K: mouth sheet, K x K */
    size_t channels;        /* of a Gaussian's colour; first three RGB */
    size_t feature;         /* C_f */
    char head_hash[17];     /* "" fits any head */
    char motion_net[64], shape_net[64];
    struct backbone_config backbone;
    size_t init_width;      /* Phi_init; 0: the plane is even */
    size_t static_width;    /* Phi_S */
    size_t dynamic_width, dynamic_hidden;   /* Phi_D */
    size_t vertex_width;    /* h_k */
    size_t mouth_width;     /* Phi_M */
    size_t transformer_layers, transformer_heads;   /* SYSTEM_LAM */
    bool rgb_skip;          /* see avatar.h */
    bool public_quirks;     /* the public base code's slips, for its weights */
    unsigned without;       /* the part it was trained without: 0 for none,
                             * else 1 + its bit's number, see below */
    bool has_refiner;
    struct refiner_config refiner;
};

/* The paper's configuration: 108,658 Gaussians on a 5023-vertex head. */
void avatar_config_paper(struct avatar_config *c);
/* GAGAvatar's, with its public code's slips. */
void avatar_config_gagavatar(struct avatar_config *c);
/* LAM's (lam-20k). */
void avatar_config_lam(struct avatar_config *c);
/* The small one that ships. */
void avatar_config_shipped(struct avatar_config *c);

/* From JSON text.  EX_CONFIG naming the key, its value and what would do. */
int avatar_config_parse(struct avatar_config *c, const char *json,
                        struct error *err);
/* From a file: a configuration, or spid-train's, which has one under
 * "model".  Errors name the file. */
int avatar_config_load(struct avatar_config *c, const char *path,
                       struct error *err);
/* The parts' names, behind "nothing" in the order of the bits of enum
 * avatar_without (lib/avatar/branch.h); NULL behind the last. */
extern const char *const avatar_config_parts[];
/* What it was trained without, as such a bit, or 0. */
unsigned avatar_config_without(const struct avatar_config *c);
/* What the names of the refiner's tensors begin with. */
const char *avatar_config_refiner(const struct avatar_config *c);
/* As JSON, one line; the caller frees.  NULL when memory is short. */
char *avatar_config_print(const struct avatar_config *c);

#endif
