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

/* What is known of the colours of a person's skin, hair or cloth: how many vertices
 * show it, and means and variances of their brightness (log) and shares of red and
 * green. */
enum { MATERIAL_FEATURES = 3 };
struct material_colors {
    float total, mean[MATERIAL_FEATURES], variance[MATERIAL_FEATURES];
    float log_variance[MATERIAL_FEATURES];   /* for each pixel, not taken each time */
};

/* colors (MATERIALS): a person's own, from where all people have each (EM, steps of
 * it): of what is seen, how far each vertex is where it is (held), which says more
 * than how far its colour is trusted.  chance (MATERIALS,V+E): scratch. */
void material_learn(struct material_colors *colors, float *chance,
                    const struct white_point_colors *seen, const float *held,
                    const struct head_avatar *a, const struct densify *d);

/* odds (MATERIALS): how much better than skin each explains a colour; 1 where too
 * little of it, or of skin, is seen. */
void material_odds(float odds[MATERIALS], const float rgb[3],
                   const struct material_colors *colors);

/* A chance that is no nearer to 0 or 1 than what is known of it. */
float material_limited(float chance);

/* The shares by Bayes' rule, from log likelihoods (HEAD_STYLES) of the ways to wear
 * hair by what is beside the mesh (relief_likelihood), how far each vertex is seen (V,
 * 0..1) and the odds there (V,MATERIALS). */
struct material_share material_find(const float *likelihood, const float *seen,
                                    const float *odds,
                                    const struct head_avatar *a);

/* The shares of the person whom a photograph shows, and the odds (V+E,MATERIALS)
 * there by the person's colours. */
struct material_share material_person(float *odds,
                                      const struct material_colors *colors,
                                      const float *likelihood,
                                      const struct white_point_colors *seen,
                                      const float *held,
                                      const struct head_avatar *a,
                                      const struct densify *d);

/* The material of the points that a photograph shows: chance (MATERIALS,V+E) by
 * the shares, trust (MATERIALS,V+E) in what is seen as each material's colour, colors
 * (MATERIALS) of the person.  The rest as material_person has it. */
void material_layers(struct material_colors *colors, float *trust, float *chance,
                     float *odds, const float *likelihood,
                     const struct white_point_colors *seen, const float *held,
                     const struct head_avatar *a, const struct densify *d);

#endif
