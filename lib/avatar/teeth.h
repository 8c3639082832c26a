/* A mouth's inside where no picture shows it: the template avatar's teeth with
 * gums, and what is behind them (lib/head/head_avatar.h), as a grid of Gaussians
 * in place of the mouth branch's flat one. */
#ifndef SPID_AVATAR_TEETH_H
#define SPID_AVATAR_TEETH_H

#include <stddef.h>

#include "lib/head/head.h"

/* A cell of the grid; lengths in head units. */
struct teeth_cell {
    float mean[3];      /* at the source's pose */
    float scale[3], quat[4];
    float color[3];     /* under white light, 0..1 */
    float jaw[3];       /* how it goes with the chin (lib/base/drive.h): the
                         * lower teeth all the way, the upper hardly */
    enum mouth_layer layer;
};

/* cells (K,K): the upper rows of the grid are the upper teeth from their edges
 * up, the next the lower teeth from their edges down, the others the back from
 * the palate down.  rest: the mouth of the person's face at rest; chin: where
 * the source's is; h has the jaw's hinge.  lift: how much shorter the upper
 * crowns are than the generic ones, head units. */
void teeth_make(struct teeth_cell *cells, const struct head *h,
                const struct head_mouth *rest, const float chin[3],
                float lift, size_t K);

/* The lift of upper teeth that the source shows by `likeness` (K,K) of each cell,
 * 0..1: by what it shows in the middle below the generic edge, 0 where it shows
 * no teeth there. */
float teeth_lift(const struct teeth_cell *cells, const float *likeness,
                 size_t K);

/* light, by which the cells' colours were multiplied, becomes that of the upper
 * teeth in the picture, up to twice as bright, where it shows K K / 32 cells of
 * them; from half of that down it stays.  pixel (K,K,4): the picture at each
 * cell. */
void teeth_light(float light[3], const struct teeth_cell *cells,
                 const float *likeness, const float *pixel, size_t K);

/* Whether the upper teeth (or, of the back, the teeth) hide a cell from the
 * front, as the source has them. */
int teeth_hidden(const struct teeth_cell *cells, size_t K, size_t k);

#endif
