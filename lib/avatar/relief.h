/* How far hair stands off the head.  The mesh is bald, and hair that a photograph shows
 * beside it would be the plane's: a comb before a cap, once the head turns.  So the
 * mesh rises on its outline until it meets that of the hair, and less and less away
 * from there.  People who wear their hair alike wear it about as far off the head
 * (head_avatar.h's styles), so that the side which is hidden rises by what people of
 * scans have there, as far as it would not have been seen.  A neck's width no shape
 * knows, since the scans end above it: where the mesh's is beyond the person, it is
 * drawn in, or a spur of it would stand beside the neck of a head that turns. */
#ifndef SPID_AVATAR_RELIEF_H
#define SPID_AVATAR_RELIEF_H

#include "lib/avatar/material.h"
#include "lib/avatar/source_mesh.h"
#include "lib/avatar/source_picture.h"

/* likelihood (HEAD_STYLES), log: how likely it is in each way to wear hair that hair is
 * where the picture has it beside the bare mesh, by the person's colours
 * (MATERIALS). */
void relief_likelihood(float *likelihood, const struct material_colors *colors,
                       const struct source_picture *picture,
                       const struct source_mesh *mesh);

/* relief (V), head units along the normals: what is expected of the styles. */
void relief_expect(float *relief, const struct material_share *share,
                   const struct head_avatar *a);

/* The same of the styles that a picture of the person speaks for: what is seen of the
 * mesh, how far it is where it is (held), and what is beside it. */
struct relief_work {
    struct material_colors *colors; /* (MATERIALS) out: the person's */
    float *likelihood;  /* (HEAD_STYLES) out */
    float *chance;      /* (MATERIALS,V+E) out: by those styles */
    float *odds;        /* (MATERIALS,V+E) scratch */
};
void relief_find(float *relief, const struct relief_work *work,
                 const struct white_point_colors *seen, const float *held,
                 const struct source_picture *picture,
                 const struct source_mesh *mesh, const struct densify *d);

/* No more of it than a picture could have hidden: as far as a vertex is behind
 * what it shows (front (V), 0: wholly), within the person and behind the mesh. */
void relief_limit(float *relief, const float *front,
                  const struct source_picture *picture,
                  const struct source_mesh *mesh);

/* The heights where that is hair's (hair (V): its chance) which differ least from
 * relief as it comes, and from each other in how far they do, so that the mesh's
 * outline (rim (V): how far a vertex lies there) meets that of the hair by its colours
 * (MATERIALS): a screened Poisson equation on the mesh.  Likewise, below 0, those with
 * which the neck's outline is within the person.  scratch (4,V). */
void relief_meet(float *relief, const float *rim, const float *hair,
                 const struct material_colors *colors,
                 const struct source_picture *picture,
                 const struct source_mesh *mesh, const struct densify *d,
                 float *scratch);

/* offset (V,3), head frame: hair hangs over its relief as a membrane, without the
 * ears' shape and without steps where it ends.  tmp (V,3). */
void relief_drape(float *offset, float *tmp, const float *relief,
                  const struct source_mesh *mesh, const struct densify *d);

#endif
