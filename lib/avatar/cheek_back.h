/* What stands behind the cheeks.  A dropped jaw or pursed lips draw the
 * cheeks' outline in, and the plane is empty where skin moves: the wall behind
 * the person would show between cheek and neck, where in life the jaw's angle
 * hardly moves.  So the plane keeps a strip along the outline that the
 * photograph has, as the photograph shows it, behind the skin but inside the
 * jaw: nobody sees it while the cheeks are where they were, however the head
 * turns. */
#ifndef SPID_AVATAR_CHEEK_BACK_H
#define SPID_AVATAR_CHEEK_BACK_H

#include <stddef.h>

#include "lib/avatar/branch.h"
#include "lib/avatar/source_mesh.h"
#include "lib/avatar/source_picture.h"

/* How far cell (x,y) of the mesh's maps is of the outline along which the strip
 * runs, 0..1. */
float cheek_back_at(const struct source_picture *picture,
                    const struct source_mesh *mesh, size_t x, size_t y);
/* back (n,n), n the mesh's: how far each cell belongs to it, 0..1, 0 for
 * most. */
void cheek_back_find(float *back, const struct source_picture *picture,
                     const struct source_mesh *mesh, size_t n);
/* The Gaussians of cells with a back become the strip's: round, dense, the
 * photograph's.  out has n*n, or none. */
void cheek_back_set(struct branch_set *out, const float *back,
                    const struct source_picture *picture,
                    const struct source_mesh *mesh, size_t n);
/* Those are no decoder's: their gradients become 0. */
void cheek_back_backward(struct branch_set *dout, const float *back);

#endif
