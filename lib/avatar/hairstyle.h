/* Where a person has hair.  People wear it in a few ways (head_avatar.h's
 * styles), and what a photograph shows of the scalp, ears and cheeks says in
 * which: so hair behind the ears and at the nape is known from the front. */
#ifndef SPID_AVATAR_HAIRSTYLE_H
#define SPID_AVATAR_HAIRSTYLE_H

#include "lib/avatar/white_point.h"
#include "lib/base/densify.h"
#include "lib/head/head.h"
#include "lib/head/head_avatar.h"

/* hair (V+E): the chance of it at each point of d, by the styles' shares. */
void hairstyle_expect(float *hair, const float share[HAIR_STYLES],
                      const struct head_avatar *a, const struct densify *d);

/* How much more a colour speaks for skin than for hair beside the face's mean, as
 * the chance of skin where either is as likely: logistic regression on hue and
 * brightness. */
float hairstyle_likeness(const float rgb[3], const float face[3],
                         const struct head_avatar *a);

/* share: the styles' by Bayes' rule, from how far each vertex is seen (V, 0..1)
 * and how like skin that is (V, 0..1). */
void hairstyle_find(float share[HAIR_STYLES], const float *seen,
                    const float *like, const struct head_avatar *a);

/* How likely a point is hair that has it with chance `hair` and is so like
 * skin. */
float hairstyle_posterior(float hair, float like);

/* What a photograph shows as two layers, of V + E points. */
struct hairstyle_layers {
    float *skin;        /* how far what is seen is trusted as skin's colour, */
    float *strands;     /* and as hair's */
    float *hair;        /* the chance of hair */
};

/* From what is seen, of it how far each point is where it is (held), which says
 * more than how far its colour is trusted.  Where no face is seen hair's chances
 * stay.  What the neck shows of cloth is neither skin nor hair. */
void hairstyle_layers(const struct hairstyle_layers *to,
                      const struct white_point_colors *seen, const float *held,
                      const struct head *h, const struct densify *d);

#endif
