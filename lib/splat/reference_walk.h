/* Inside the double-precision reference: the Gaussians of one pixel, front to
 * back, as the rules decide.  Not for other modules. */
#ifndef SPID_SPLAT_REFERENCE_WALK_H
#define SPID_SPLAT_REFERENCE_WALK_H

#include "lib/splat/reference.h"

struct walk {
    const struct splat_truth *truth;
    int tx, ty;                   /* list tiles across and down */
    struct splat_point *point;    /* (N) */
    size_t *start;                /* first entry of each tile's list */
    uint32_t *list;               /* Gaussians, front to back */
};

/* One Gaussian's share of one pixel. */
struct hit {
    uint32_t i;
    bool clamped;                 /* alpha was over 0.99 */
    double alpha, fall, T;        /* alpha; e^-sigma; T in front of it */
    double dx, dy;                /* centre minus pixel */
};

int walk_init(struct walk *w, const struct splat_truth *t, struct error *err);
void walk_release(struct walk *w);
size_t walk_longest(const struct walk *w);
/* Entries of the list that serves pixel (x,y). */
size_t walk_tile(const struct walk *w, int x, int y, const uint32_t **list);
/* The hits of pixel (x,y); hit has room for walk_longest. */
size_t walk_pixel(struct hit *hit, double *T_final, uint8_t *ambiguous,
                  const struct walk *w, int x, int y);

/* R (3,3) of a quaternion: normalised unless DGR. */
void splat_truth_rotation(double R[9], const double *quat,
                          enum splat_rules rules);

#endif
