/* A strip of Gaussians behind the cheeks.  A dropped jaw or pursed lips draw
 * the cheeks' outline inwards, and the plane is empty where skin moves, so that
 * the background would show between cheek and neck; in life the jaw's angle
 * hardly moves.  The plane therefore keeps a strip along the photograph's
 * outline, in the photograph's colours, behind the skin but inside the jaw: it
 * stays hidden until the cheeks move, however the head turns. */
#ifndef SPID_AVATAR_CHEEK_BACK_H
#define SPID_AVATAR_CHEEK_BACK_H

#include <stddef.h>

#include "lib/avatar/branch.h"
#include "lib/avatar/source_mesh.h"
#include "lib/avatar/source_picture.h"

/* How much cell (x,y) of the mesh's maps belongs to the outline along which the
 * strip runs, 0..1. */
float cheek_back_at(const struct source_picture *picture,
                    const struct source_mesh *mesh, size_t x, size_t y);
/* back (n,n), n as in the mesh's maps: how much each cell belongs to the strip,
 * 0..1, 0 for most. */
void cheek_back_find(float *back, const struct source_picture *picture,
                     const struct source_mesh *mesh, size_t n);
/* The Gaussians of out (n*n of them, or none) whose back is over 0 become the
 * strip's: round, dense, with the photograph's colours. */
void cheek_back_set(struct branch_set *out, const float *back,
                    const struct source_picture *picture,
                    const struct source_mesh *mesh, size_t n);
/* They do not come from the decoder: their gradients become 0. */
void cheek_back_backward(struct branch_set *dout, const float *back);

#endif
