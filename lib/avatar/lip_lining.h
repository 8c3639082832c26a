/* Lips behind the line where they meet, which no photograph of closed ones
 * shows, and the shade in which they leave what is behind them. */
#ifndef SPID_AVATAR_LIP_LINING_H
#define SPID_AVATAR_LIP_LINING_H

#include "lib/avatar/branch.h"
#include "lib/avatar/source_mesh.h"
#include "lib/avatar/source_picture.h"
#include "lib/base/densify.h"

/* to (3): normal n (3), bent half way to the front as far as it is a rim's, which
 * turns inward (seam, head_avatar.h): to where light comes from, for behind a rim is
 * the mouth (bent normals, Landis 2002). */
void lip_lining_bend(float to[3], const float n[3], float seam);

/* rgb (n,3): the colours found for seam (n) become those of rims, which see lips
 * where they do not see out of the mouth: darker, and redder as light goes from lip
 * to lip.  Of normals (n,3) at an angle to the front they see (1 + its cosine) / 2 of
 * the outside; white (3): what is white in the picture. */
void lip_lining_paint(float *rgb, const float *seam, const float *normals,
                      const float white[3], size_t n);

/* The share of the light before the lips that teeth get, under light l (3,
 * light.h): what comes from above falls on the upper lip instead. */
float lip_lining_share(const float l[3]);

/* on (D): how far the mesh's open lips lie on the photograph's teeth, since the
 * mesh fits to a few pixels: from the inner lips on, the picture at the
 * densified vertices, pixel (D,4), is bright and whiter than lips; or that is
 * next to it on the mesh.  0 where they are closed.  tmp: (V+D). */
void lip_lining_on_teeth(float *on, const float *pixel,
                         const struct source_mesh *mesh, const float white[3],
                         const struct densify *d, float *tmp);

/* 1 where the source's lips are closed, 0 where they are open. */
float lip_lining_closed(const struct source_mesh *mesh);

/* How much higher than the mesh's closed lips meet in the picture, head units: where
 * it is darkest, if it is anywhere.  0 of open ones. */
float lip_lining_rise(const struct source_picture *picture,
                      const struct source_mesh *mesh);

/* The mesh's Gaussians behind the lips (head_avatar.h, lining), which are not
 * drawn themselves, become a dark veil before teeth and tongue: the occlusion
 * by the lips, which it follows, so that it is deepest in a mouth that is
 * hardly open.  Where the source's lips are open its picture has that shade:
 * there the veil shows the picture, as far as the lips are where they were.
 * verts (out->n,3): the source's densified vertices. */
void lip_lining_shade(struct branch_set *out, const float *verts,
                      const struct source_mesh *mesh, const float white[3]);
/* Nothing that the decoder gave shows in the veil: its rows of dout to 0. */
void lip_lining_shade_backward(struct branch_set *dout,
                               const struct source_mesh *mesh);

#endif
