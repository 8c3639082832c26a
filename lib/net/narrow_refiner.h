/* The refiner that ships: works on S/4 .. S/16, adds to the coarse picture.
 * StyleUNet's ideas in small: an encoder whose maps condition the decoder
 * (feature transforms), a global style, and the picture grown from coarse to
 * fine.  With turns, what the maps make of the decoder depends on how the head
 * has turned: the light stays where it is.  About 0.85 GMAC at 512 with width
 * 32, 0.64 with a photograph.
 *
 * With a photograph (lib/photo), what it shows of every pixel enters beside
 * the features, and at a quarter of the size comes out how far it is doubted
 * and brightened: the field of texture_compose.  What is added to the picture
 * has that size then, too, since the photograph has the details: left to each
 * pixel, it learned a grid of dots.  Behind lib/net/refiner.h. */
#ifndef SPID_NET_NARROW_REFINER_H
#define SPID_NET_NARROW_REFINER_H

#include "lib/base/relative_pose.h"
#include "lib/net/narrow_end.h"
#include "lib/nn/conv.h"
#include "lib/nn/fused_stem.h"
#include "lib/nn/graph.h"
#include "lib/nn/rescale.h"
#include "lib/nn/squeeze_excite.h"
#include "lib/nn/conditional_conv.h"

/* A step of the way up: grown to twice the size, conditioned on the map of that
 * size of the way down, and drawn. */
struct narrow_step {
    size_t width;                 /* its channels */
    struct conv up;
    struct rescale grow;
    struct conv condition, body;
    struct conditional_conv conditional;    /* of condition, when turns */
    /* activations, in the order of the forward pass, and gradients */
    float *c, *r, *t, *y, *z;
    float *dc, *dt, *dy, *dz, *de;          /* de: of the way down's map */
};

struct narrow_refiner {
    struct nn_plan plan;
    struct params *ps;
    size_t channels, width, batch, h, w;
    struct conv stem0, stem1;     /* 2x2 stride 2, twice: S -> S/4 */
    struct conv down1, down2;     /* 3x3 stride 2: S/8, S/16 */
    struct conv mid;
    struct squeeze_excite style;
    struct narrow_step step[2];   /* to S/4, to S/8 */
    struct conv rgb;
    struct conv photo0, photo1, field;      /* when photos */
    struct fused_stem stem;       /* stem0 in inference, where it fits */
    struct narrow_end end;        /* rgb and field, the same */
    bool fused, turns, photos;
    const float *photo;           /* (B,h,w,5) of the frame, when photos */
    float turn[RELATIVE_POSE_SIZE];     /* when turns */
    float dturn[RELATIVE_POSE_SIZE];
    const float *feat;
    /* activations, in the order of the forward pass */
    float *f0, *p0, *e0, *e1, *e2, *m, *ms, *d, *tint, *k;
    /* gradients */
    float *de2, *dm, *df, *dd, *dp, *dtint, *dk;
};

#define NARROW_REFINER_PHOTO 5  /* numbers of a pixel of the photograph */
#define NARROW_REFINER_FIELD 4  /* numbers of the field */
/* With a photograph, the most that is added to a colour or subtracted.  Where
 * confidence in the photograph is low (what a turned head uncovers, the rims of
 * what has moved), the refiner has little to go by and would draw dark lines
 * along white shoulders. */
#define NARROW_REFINER_MAX 0.03f

/* Declare the tensors; turns: the conditions depend on the relative pose;
 * photos: there is a photograph. */
void narrow_refiner_init(struct narrow_refiner *r, struct params *ps,
                         const char *prefix, size_t channels, size_t width,
                         bool turns, bool photos);
/* Feature images of h x w pixels, multiples of 32. */
int narrow_refiner_plan(struct narrow_refiner *r, size_t batch, size_t h,
                        size_t w, struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void narrow_refiner_release(struct narrow_refiner *r);
/* rgb (B,h,w,3) from feat (B,h,w,channels), not clamped; with photos also from
 * r->photo, which must be set, and r->k (B,h/4,w/4,4) is the field; it adds no
 * more than NARROW_REFINER_MAX then. */
void narrow_refiner_forward(float *rgb, const float *feat,
                            struct narrow_refiner *r);
/* The same from half floats, or from a part of a larger image: the view's
 * rows may be further apart.  Only where narrow_refiner_views says so. */
void narrow_refiner_forward_view(float *rgb, const struct feature_view *feat,
                                 struct narrow_refiner *r);
/* Whether narrow_refiner_forward_view may be called. */
bool narrow_refiner_views(const struct narrow_refiner *r);
/* The turn from now on; nothing else needs an update. */
void narrow_refiner_turn(struct narrow_refiner *r,
                         const float turn[RELATIVE_POSE_SIZE]);
/* Writes dfeat and dphoto (or NULL: no) and r->dturn, given the gradients of
 * rgb and of the field (NULL without photos). */
void narrow_refiner_backward(float *dfeat, float *dphoto, const float *drgb,
                             const float *dfield, struct narrow_refiner *r);

/* The same as a graph, of h x w pixels: "features" (1,h,w,channels), with turns
 * "turn" (6), with photos "photo" (1,h,w,5), to "rgb" (1,h,w,3) and, with
 * photos, "field" (1,h/4,w/4,4). */
void narrow_refiner_graph(struct graph *g, size_t h, size_t w,
                          const struct narrow_refiner *r);

#endif
