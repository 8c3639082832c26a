/* Elementwise work on feature images, NHWC. */
#ifndef SPID_NN_IMAGE_H
#define SPID_NN_IMAGE_H

#include <stddef.h>
#include <stdint.h>

/* y += x, n values. */
void image_add(float *y, const float *x, size_t n);

/* y <- x as bfloat16, rounded to nearest even. */
void image_to_bf16(uint16_t *y, const float *x, size_t n);

/* Spatial feature transform: y (rows,C) = x (one + s) + t, st (rows,2C) holds
 * s then t; one is 0 or 1.  dx may be dy. */
void sft_forward(float *y, const float *x, const float *st, float one,
                 size_t rows, size_t C);
/* dx (rows,C) and dst (rows,2C) from dy; dx may be dy. */
void sft_backward(float *dx, float *dst, const float *dy, const float *x,
                  const float *st, float one, size_t rows, size_t C);

/* out (rows,C) = [a (rows,A), b (rows / group,Bc), 0]: one row of b for every
 * `group` rows (the pixels of an image).  a NULL: its part is there. */
void concat_forward(float *out, const float *a, const float *b, size_t rows,
                    size_t A, size_t Bc, size_t C, size_t group);
/* da (rows,A) written, or NULL; db (rows / group,Bc) added to, or NULL. */
void concat_backward(float *da, float *db, const float *dout, size_t rows,
                     size_t A, size_t Bc, size_t C, size_t group);

/* part (rows,n) = channels [at,at + n) of dout (rows,C). */
void concat_take(float *part, const float *dout, size_t rows, size_t at,
                 size_t n, size_t C);

/* out (B,h/f,w/f,f*f*C): out[..][(dy f + dx) C + c], from in (B,h,w,C). */
void space_to_depth(float *out, const float *in, size_t B, size_t h, size_t w,
                    size_t C, size_t f);
/* The reverse, and the gradient of one is the other's forward: out (B,h f,w f,C)
 * from in (B,h,w,f*f*C). */
void depth_to_space(float *out, const float *in, size_t B, size_t h, size_t w,
                    size_t C, size_t f);
/* out (B,h f,w f,C) = base (..., base_C's first C) + in (B,h,w,f*f*C). */
void depth_to_space_add(float *out, const float *base, size_t base_C,
                        const float *in, size_t B, size_t h, size_t w,
                        size_t C, size_t f);

#endif
