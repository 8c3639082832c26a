/* What lies behind the teeth, as one sheet from the palate over the throat and
 * the tongue's back to its tip and the floor under it.  Its section along the
 * middle, widths and heights of sides are measured on gums and tongue of the
 * mean ICT scan; colours are ours, darkened by how little of the light that
 * comes in between the lips gets there. */
#ifndef SPID_LAB_HEAD_CAVITY_H
#define SPID_LAB_HEAD_CAVITY_H

/* A place on the sheet; lengths in mm from the inner lips' centroid at rest. */
struct cavity_place {
    float at[3];        /* x to the left, y up, z to the front */
    float share;        /* of the jaw's way: 0 the palate, 1 the tongue */
    float color[3];     /* where light before the lips is white, 0..1 */
};

/* The place at u (-1..1 across, 0 the middle) and v (0 the palate behind the
 * upper teeth, 1 the floor under the tongue's tip).  No place is nearer to the
 * arch of the teeth (crowns.h) than they are thick. */
void cavity_place(struct cavity_place *p, float u, float v);

/* Size (3), mm, and turn (4, w first) of a flat Gaussian there that leaves no
 * hole to its neighbours at u +- du and v +- dv, nor in an open mouth. */
void cavity_cover(float scale[3], float quat[4], float u, float v, float du,
                  float dv);

/* How bright sRGB is `depth` mm behind the lips, where it is 1 before them: the
 * form factor R^2 / (R^2 + depth^2) of a disc, the opening, for what faces it
 * on its axis, to the power of 1/2.2. */
float cavity_light(float depth);

#endif
