/* Eq. SR: from the splatted feature image to the final picture.  Two kinds:
 * "narrow", which ships (works at a quarter of the size, added to the coarse
 * RGB), and "style_unet" (GAGAvatar's layout, lib/net/style_unet.h). */
#ifndef SPID_NET_REFINER_H
#define SPID_NET_REFINER_H

#include "lib/base/relative_pose.h"
#include "lib/nn/fused_stem.h"
#include "lib/nn/graph.h"
#include "lib/nn/nn.h"
#include "lib/nn/params.h"

enum refiner_type { REFINER_NARROW, REFINER_STYLE_UNET };

struct refiner_config {
    enum refiner_type type;
    size_t channels;     /* of the feature image, 32 */
    size_t width;        /* NARROW: channels at a quarter of the size, 32 */
    float multiplier;    /* STYLE_UNET: of every width, 1 in the paper */
    bool turn;           /* NARROW: is told how the head has turned */
    bool photo;          /* NARROW: is shown the photograph */
    size_t size;         /* STYLE_UNET: pixels of a side, a power of two; its
                          * number of levels follows from it */
};

struct refiner_impl;

struct refiner {
    struct refiner_config config;
    size_t batch, height, width;
    struct refiner_impl *impl;
};

/* Declare a refiner of this kind; EX_CONFIG on sizes that do not go
 * together. */
int refiner_init(struct refiner *r, struct params *ps, const char *prefix,
                 const struct refiner_config *config, struct error *err);
/* NARROW: height and width multiples of 32.  STYLE_UNET: config's size. */
int refiner_plan(struct refiner *r, size_t batch, size_t height, size_t width,
                 struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void refiner_release(struct refiner *r);

/* How the head has turned since the source (lib/base/relative_pose.h), for all
 * forwards from now on; at first zero.  Without config.turn it makes no
 * difference. */
void refiner_turn(struct refiner *r, const float turn[RELATIVE_POSE_SIZE]);

/* What the photograph shows, photo (B,H,W,5) as texture_lookup has it, for all
 * forwards from now on; borrowed, and it must stay until the backward.  Must
 * be set where config.photo is, and makes no difference elsewhere. */
void refiner_photo(struct refiner *r, const float *photo);
/* What the last forward says of the photograph: the field (B,H/4,W/4,4) of
 * texture_compose, or NULL without config.photo. */
const float *refiner_field(const struct refiner *r);

/* rgb (B,H,W,3) from feat (B,H,W,channels), whose first three channels are
 * the coarse RGB.  NARROW is not clamped (a trainer wants the gradient; a
 * writer clamps); STYLE_UNET ends in a sigmoid.  feat must stay as it is
 * until the backward. */
void refiner_forward(float *rgb, const float *feat, struct refiner *r);
/* The same from half floats, or from a part of a larger image, without a copy:
 * a NARROW refiner planned with NN_INFER, where refiner_views says so. */
void refiner_forward_view(float *rgb, const struct feature_view *feat,
                          struct refiner *r);
/* Whether refiner_forward_view may be called. */
bool refiner_views(const struct refiner *r);
/* Whether what one view was refined by can be added to the next: a NARROW
 * refiner not planned in NN_F32. */
bool refiner_repeats(const struct refiner *r);
/* rgb (B,H,W,3): the view's coarse RGB. */
void refiner_pick(float *rgb, const struct feature_view *feat,
                  struct refiner *r);
/* rgb, a view's coarse RGB, += what the last forward added to its own; the field
 * is that one's.  false, and nothing done, where the view's alpha shows a place
 * that was empty then. */
bool refiner_repeat(float *rgb, const struct feature_view *feat,
                    struct refiner *r);
/* Gradients of a refiner's inputs, written unless NULL. */
struct refiner_gradients {
    float *feat;        /* (B,H,W,channels) */
    float *turn;        /* (RELATIVE_POSE_SIZE) */
    float *photo;       /* (B,H,W,5), with config.photo */
};

/* From drgb (B,H,W,3) and, with config.photo, dfield (B,H/4,W/4,4). */
void refiner_backward(const struct refiner_gradients *g, const float *drgb,
                      const float *dfield, struct refiner *r);

/* The same as a graph for h x w pixels (narrow_refiner_graph); NARROW only, the
 * graph remembers that otherwise. */
void refiner_graph(struct graph *g, size_t h, size_t w,
                   const struct refiner *r);

#endif
