/* Who is in a portrait: the prior of its matte (matting.h). */
#ifndef SPID_PHOTO_MATTE_H
#define SPID_PHOTO_MATTE_H

#include <stdbool.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/net/matte_net.h"
#include "lib/photo/matting.h"

/* m->alpha, confidence and back (and rgb beyond the picture) of the portrait m->rgb.
 * What is the person's is told by the network, if there is one and it sees
 * somebody where the head is, and else by the head's outline, and is decided by
 * the colours.  Somebody else, whom background parts from the head, is no part
 * of it.  known: m->alpha is given in the picture, and found beyond its edges.
 *  head (MATTE_SIDE,MATTE_SIDE): 255 where the projected head lands.
 * *seen: whether the network told. */
int matte_find(struct matting *m, bool *seen, const uint8_t *head,
               struct matte_net *net, bool known, struct error *err);

/* out (MATTE_SIDE,MATTE_SIDE): at every place the least of prior (likewise) on
 * the best path there from the head (255; reconstruction by dilation, Vincent
 * 1993): what only background joins to the head is as unlikely as that
 * background. */
void matte_connect(float *out, const float *prior, const uint8_t *head);

#endif
