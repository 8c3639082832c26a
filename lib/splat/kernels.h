/* Inside the rasteriser: the kernels that each instruction set provides, and
 * which one to take.  Not for other modules. */
#ifndef SPID_SPLAT_KERNELS_H
#define SPID_SPLAT_KERNELS_H

#include "lib/splat/state.h"

struct splat_work;

/* One table per instruction set. */
struct splat_kernels {
    /* Project Gaussians first .. last - 1 (first a multiple of PAD). */
    void (*project)(struct splat_state *s, size_t first, size_t last);
    /* Draw tile number t (of row-major order). */
    void (*tile)(const struct splat *s, struct splat_work *w, uint32_t t,
                 const struct target *out);
    /* Gradients of tile t's pixels into the pair records. */
    void (*tile_backward)(const struct splat *s, struct splat_work *w,
                          uint32_t t,
                          const struct splat_picture_gradients *d);
    /* From screen to parameters for Gaussians first .. last - 1. */
    void (*gaussian_backward)(const struct splat *s, size_t first,
                              size_t last, const struct splat_gradients *g,
                              double *rt);
    /* Bytes of one thread's struct splat_work. */
    size_t (*work_size)(void);
};

/* The table of that instruction set. */
const struct splat_kernels *splat_kernels(enum cpu_level level);

#endif
