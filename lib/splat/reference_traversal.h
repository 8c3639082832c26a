/* Inside the double-precision reference and its gradients (tests/reference):
 * the Gaussians of one pixel, front to back, as the rules decide (Eq. C's order
 * and cut-offs).  Not for other modules. */
#ifndef SPID_SPLAT_REFERENCE_TRAVERSAL_H
#define SPID_SPLAT_REFERENCE_TRAVERSAL_H

#include "lib/splat/reference.h"

struct traversal {
    const struct reference *scene;
    int tx, ty;                   /* list tiles across and down */
    struct reference_point *point;  /* (N) */
    size_t *start;                /* first entry of each tile's list */
    uint32_t *list;               /* Gaussians, front to back */
};

/* One Gaussian's share of one pixel. */
struct contribution {
    uint32_t i;
    bool clamped;                 /* alpha was over 0.99 */
    double alpha, falloff, T;     /* alpha; e^-sigma; T in front of it */
    double dx, dy;                /* centre minus pixel */
};

/* Project and list the Gaussians of t, which is borrowed.  EX_OSERR. */
int traversal_init(struct traversal *w, const struct reference *t,
                   struct error *err);
/* Free what it holds; zeroed then. */
void traversal_release(struct traversal *w);
/* Entries of the longest list: room for what a pixel can have. */
size_t traversal_longest(const struct traversal *w);
/* The contributions to pixel (x,y), front to back; found has room for
 * traversal_longest.  T_final is what is left of the light behind them,
 * ambiguous (or NULL) is set to 1 as reference_forward says. */
size_t traversal_pixel(struct contribution *found, double *T_final,
                       uint8_t *ambiguous, const struct traversal *w, int x,
                       int y);

#endif
