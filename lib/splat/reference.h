/* Eq. C in double precision, plainly: the truth that kernels are held
 * against, and what spid-splat --exact draws. */
#ifndef SPID_SPLAT_REFERENCE_H
#define SPID_SPLAT_REFERENCE_H

#include "lib/splat/types.h"

/* Everything in double, so that finite differences make sense. */
struct reference {
    int width, height, channels;
    enum splat_rules rules;
    double near, alpha_cut, t_cut;
    size_t n;
    double *mean, *scale, *quat, *opacity, *color;   /* owned; (N,3) (N,3)
                                                      * (N,4) (N) (N,C) */
    double rt[12], fx, fy, cx, cy;
    double background[SPLAT_MAX_CHANNELS + SPLAT_PLACE_CHANNELS];
    uint32_t *order;       /* NULL, or (N): drawn in this order, not by depth
                            * (finite differences); owned by the caller */
};

/* Copy and widen g and cam; branches as in splat_options.  Defaults of the
 * rules: near 0.01 (DGR 0.2), alpha_cut 1/255, t_cut 1e-4. */
int reference_init(struct reference *t, const struct gaussians *g,
                   const struct splat_camera *cam, int width, int height,
                   int channels, enum splat_rules rules,
                   unsigned branches, struct error *err);
/* Free what it holds; zeroed then. */
void reference_release(struct reference *t);

/* One Gaussian on the screen. */
struct reference_point {
    bool front;            /* z > near */
    double x, y, z;        /* centre in pixels, camera depth */
    double cov3[6];        /* xx xy xz yy yz zz of R S S R^T, world */
    double cov[3];         /* xx xy yy, pixels^2, with the 0.3 */
    double conic[3];       /* its inverse: A, B, C */
    double det, det_sharp; /* determinant of cov with and without the 0.3 */
    int tile[4];           /* DGR: columns and rows [x0,x1) [y0,y1) */
};
/* Gaussian i of t. */
void reference_project(struct reference_point *p, const struct reference *t,
                       size_t i);

/* R (3,3) of a quaternion w,x,y,z: normalised unless DGR. */
void reference_rotation(double R[9], const double *quat,
                        enum splat_rules rules);

/* Draw.  image (H,W,C), alpha and depth (H,W) or NULL; ambiguous u8 (H,W) or
 * NULL: 1 where a cut-off is within 1e-5 relative of being decided the other
 * way.  Under EXACT a term with e^-sigma below
 * 1e-18 is left out. */
int reference_forward(double *image, double *alpha, double *depth,
                      uint8_t *ambiguous, const struct reference *t,
                      struct error *err);

#endif
