/* What the head's surface is made of where: skin, hair or cloth.  People wear hair
 * and cloth in a few ways (head_avatar.h's styles), and what a photograph shows of
 * scalp, ears, cheeks and neck says in which: so hair at the nape and the collar's
 * other side are known from the front. */
#ifndef SPID_AVATAR_MATERIAL_H
#define SPID_AVATAR_MATERIAL_H

#include "lib/avatar/white_point.h"
#include "lib/base/densify.h"
#include "lib/head/head.h"
#include "lib/head/head_avatar.h"

enum material { MATERIAL_SKIN, MATERIAL_HAIR, MATERIAL_CLOTH, MATERIALS };

/* How likely the styles are, of a person or of all (material_all). */
struct material_share {
    float hair[HEAD_STYLES], cloth[HEAD_STYLES];
};
struct material_share material_all(const struct head_avatar *a);

/* chance (MATERIALS,V+E): of each material at each point of d, by the styles'
 * shares; they sum to 1. */
void material_expect(float *chance, const struct material_share *share,
                     const struct head_avatar *a, const struct densify *d);

/* odds (MATERIALS): how much better than skin each explains a colour beside the
 * face's mean: logistic regression on hue and brightness. */
void material_odds(float odds[MATERIALS], const float rgb[3],
                   const float face[3], const struct head_avatar *a);

/* The shares by Bayes' rule, from how far each vertex is seen (V, 0..1) and the
 * odds there (V,MATERIALS). */
struct material_share material_find(const float *seen, const float *odds,
                                    const struct head_avatar *a);

/* The material of the points that a photograph shows: chance (MATERIALS,V+E)
 * by what is seen, of it how far each point is where it is (held), which says more
 * than how far its colour is trusted; and trust (MATERIALS,V+E) in what is seen
 * as each material's colour.  Where no face is seen the chances stay.  tmp
 * (MATERIALS,V+E). */
void material_layers(float *trust, float *chance, float *tmp,
                     const struct white_point_colors *seen, const float *held,
                     const struct head *h, const struct densify *d);

#endif
