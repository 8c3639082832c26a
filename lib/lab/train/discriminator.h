/* A patch discriminator of the face (Isola et al. 2017, PatchGAN): strided
 * convolutions with leaky ReLU and no normalisation say of every patch of a
 * picture whether it is a photograph (above 0) or drawn (below).  It learns by
 * the hinge loss (Lim and Ye 2017) with the gradient penalty on true pictures
 * R1 (Mescheder et al. 2018); a picture is drawn so as to be taken for true.
 *
 * Its tensors are its own: the loop gives them an Adam of their own and keeps
 * them in the checkpoint, and no model file has them.  Everything is float, the
 * same bits for any number of threads. */
#ifndef SPID_LAB_TRAIN_DISCRIMINATOR_H
#define SPID_LAB_TRAIN_DISCRIMINATOR_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/lab/data/box.h"
#include "lib/nn/conv.h"

#define DISCRIMINATOR_LAYERS 4

struct discriminator {
    struct params ps;               /* with gradients */
    struct nn_plan plan;
    size_t image;                   /* pixels a side of the pictures, */
    size_t side;                    /* and of the window it looks at */
    size_t patches;
    struct conv layer[DISCRIMINATOR_LAYERS];
    struct conv tangent[DISCRIMINATOR_LAYERS];  /* the same weights without
                                     * bias and slope */
    float *x[DISCRIMINATOR_LAYERS + 1]; /* the window, -1..1, and each layer's
                                     * output; the last are the verdicts */
    float *g[DISCRIMINATOR_LAYERS + 1]; /* their gradients; after a backward,
                                     * those before the slope */
    float *t[DISCRIMINATOR_LAYERS];     /* a tangent of the window, carried
                                     * through the linearised network */
};

/* For square pictures of `image` pixels a side, 32 or more, with random
 * weights by the seed.  Nothing is left allocated on an error. */
int discriminator_init(struct discriminator *d, size_t image, uint64_t seed,
                       struct error *err);
/* Free what it holds; zeroed then. */
void discriminator_release(struct discriminator *d);

/* weight * -mean verdict on what picture b (image,image,3), 0..1, shows about
 * the face; adds weight times the gradient to db.  d learns nothing.  An empty
 * face: 0. */
double discriminator_fool(float *db, const float *b, const struct box *face,
                          double weight, struct discriminator *d);

/* What d has to learn, times scale, in the order of the log. */
enum discriminator_term { DISCRIMINATOR_HINGE, DISCRIMINATOR_PENALTY,
                          DISCRIMINATOR_TERMS };
extern const char *const discriminator_term_name[DISCRIMINATOR_TERMS];

/* Of a drawn picture b and the true one a (image,image,3), 0..1: terms are
 * added, times scale, and the gradients to d->ps.g likewise:
 *   hinge    mean over patches of max(0, 1 - D(a)) + max(0, 1 + D(b))
 *   penalty  gamma / 2 |d sum D(a) / d a|^2 / patches, a as D sees it, -1..1
 * An empty face adds nothing. */
void discriminator_learn(double terms[DISCRIMINATOR_TERMS], const float *b,
                         const float *a, const struct box *face, double gamma,
                         double scale, struct discriminator *d);

#endif
