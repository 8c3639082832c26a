/* More of a texture: blocks of what there is, laid side by side over what there is
 * not, each the one of some that fits what lies beside it best (Efros and
 * Freeman 2001, "Image quilting for texture synthesis and transfer"). */
#ifndef SPID_PHOTO_QUILT_H
#define SPID_PHOTO_QUILT_H

#include <stddef.h>
#include <stdint.h>

struct quilt {
    size_t n;               /* pictures are n x n */
    const float *from;      /* (n,n) the texture, of mean 0, where */
    const uint8_t *is;      /* (n,n) it is of this material, */
    const uint8_t *want;    /* (n,n) and what is to be covered with which; 0 in
                             * both: none */
    float *out;             /* (n,n) 0 where nothing is wanted, or is known */
};

/* Floats of scratch for a material. */
#define QUILT_SCRATCH(N) (3 * ((N) + 1) * ((N) + 1))

/* Cover what is wanted of a material.  Others stay, so that several may be covered
 * at once. */
void quilt_cover(const struct quilt *q, uint8_t material, float *scratch);

#endif
