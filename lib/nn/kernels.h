/* The kernels of lib/nn that are compiled once per instruction set, as one
 * table filled at first use.  Private to lib/nn; each is described where it
 * is written (*_tmpl.c). */
#ifndef SPID_NN_KERNELS_H
#define SPID_NN_KERNELS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/cpu.h"

/* Before a loop: no round of it reads what another one writes, which GCC
 * cannot see of its pointers.  Clang compares them when the loop begins, and
 * takes its own pragma for an order that it may not be able to obey. */
#ifdef __clang__
#define KERNEL_INDEPENDENT
#else
#define KERNEL_INDEPENDENT _Pragma("GCC ivdep")
#endif

struct depthwise;
struct fused_stem_rows;
struct rescale;
struct winograd;

/* Result type, name, arguments. */
#define NN_KERNELS(X)                                                        \
    X(void, act_forward, (float *y, const float *x, int act, size_t n))      \
    X(void, act_backward, (float *dx, const float *dy, const float *x,       \
                           int act, size_t n))                               \
    X(void, act_backward_out, (float *dx, const float *dy, const float *y,   \
                               int act, size_t n))                           \
    X(void, act_sums, (float *sum, float *dout, const float *out, int act,   \
                       size_t rows, size_t C))                               \
    X(void, act_sums_half, (float *sum, uint16_t *dout, const uint16_t *out, \
                            int act, size_t rows, size_t C))                 \
    X(void, norm_sums, (float *sum, const float *x, const float *shift,      \
                        size_t rows, size_t C))                              \
    X(void, norm_apply, (float *y, const float *x, const float *res,         \
                         const float *scale, const float *shift, int act,    \
                         size_t period, size_t n))                           \
    X(void, norm_backward_sums, (float *sum, float *dz, const float *dy,     \
                                 const float *x, const float *scale,         \
                                 const float *shift, const float *mean,      \
                                 int act, int last, size_t rows, size_t C))  \
    X(void, norm_backward_apply, (float *dx, const float *dz,                \
                                  const float *x, const float *abcm,         \
                                  size_t period, size_t n))                  \
    X(void, layer_norm_forward, (float *y, float *mean, float *rstd,         \
                                 const float *x, const float *w,             \
                                 const float *b, float eps, size_t rows,     \
                                 size_t C))                                  \
    X(void, layer_norm_backward, (float *dx, float *sum, const float *dy,    \
                                  const float *x, const float *mean,         \
                                  const float *rstd, const float *w,         \
                                  size_t rows, size_t C))                    \
    X(void, depthwise_forward, (float *out, const float *in, float *pad,     \
                                const struct depthwise *d, size_t image,     \
                                size_t c0, size_t y0, size_t y1))            \
    X(void, depthwise_backward_data, (float *din, const float *dout,         \
                                      float *pad, const struct depthwise *d, \
                                      size_t image, size_t c0, size_t y0,    \
                                      size_t y1))                            \
    X(void, depthwise_backward_weights, (float *dw, const float *dout,       \
                                         const float *in, float *pad,        \
                                         const struct depthwise *d,          \
                                         size_t image, size_t c0))           \
    X(void, gemv, (float *y, const float *w, const float *x, const float *b, \
                   size_t out, size_t in))                                   \
    X(double, dot, (const float *a, const float *b, size_t n))               \
    X(void, outer_backward, (float *dw, float *dx, const float *w,           \
                             const float *x, float dy, size_t n))            \
    X(void, channel_scale, (float *y, const float *x, const float *gate,     \
                            const float *add, size_t rows, size_t C))        \
    X(void, channel_dot, (float *sum, const float *a, const float *b,        \
                          size_t rows, size_t C))                            \
    X(void, rescale_line, (float *out, float *line, const float *in,          \
                          const struct rescale *r, size_t o))                 \
    X(void, rescale_line_backward, (float *din, float *line,                  \
                                   const float *dout,                        \
                                   const struct rescale *r, size_t i))        \
    X(void, sft_forward, (float *y, const float *x, const float *st,         \
                          float one, size_t rows, size_t C))                 \
    X(void, sft_backward, (float *dx, float *dst, const float *dy,           \
                           const float *x, const float *st, float one,       \
                           size_t rows, size_t C))                           \
    X(void, add, (float *y, const float *x, size_t n))                       \
    X(void, to_bf16, (uint16_t *y, const float *x, size_t n))                \
    X(void, range, (float *lo, float *hi, const float *x, size_t n))         \
    X(void, quantise, (uint8_t *y, const float *x, float inverse,            \
                       float zero, size_t n))                                \
    X(void, fused_stem_row, (float *out, const struct fused_stem_rows *in,   \
                             const float *w, const float *bias,              \
                             size_t pixels, size_t C, size_t O))             \
    X(void, pick_rgb, (float *rgb, const float *in, size_t pixels,           \
                       size_t C))                                            \
    X(void, pick_rgb_half, (float *rgb, const uint16_t *in, size_t pixels,   \
                            size_t C))                                       \
    X(void, widen, (float *y, const uint16_t *x, size_t n))                  \
    X(void, softmax_backward, (float *dp, const float *p, size_t rows,       \
                               size_t n, size_t ld, float scale))            \
    X(void, style_finish, (float *y, const float *u, const float *d,         \
                           const float *b, const float *noise, float gain,   \
                           size_t rows, size_t C))                           \
    X(void, style_backward, (float *du, float *sum, const float *dy,         \
                             const float *y, const float *u, const float *d, \
                             const float *noise, size_t rows, size_t C))     \
    X(void, gemm_pack, (float *packed, const float *B, size_t rs, size_t cs, \
                        size_t K, size_t N))                                 \
    X(void, gemm, (float *C, size_t ldc, const float *A, size_t rs,          \
                   size_t cs, const float *packed, size_t M, size_t N,       \
                   size_t K, const float *more, size_t ldm))                 \
    X(void, softmax, (float *p, size_t rows, size_t n, size_t ld,            \
                      float scale))                                          \
    X(void, winograd_weights, (float *u, size_t plane, const float *w,       \
                               size_t step, size_t count))                   \
    X(void, winograd_input, (float *v, const float *in,                      \
                             const struct winograd *g, size_t slot,          \
                             ptrdiff_t y0, ptrdiff_t x0))                    \
    X(void, winograd_output, (float *out, const float *m,                    \
                              const struct winograd *g, size_t slot,         \
                              size_t y0, size_t x0))

struct nn_kernels {
#define X(type, name, args) type (*name) args;
    NN_KERNELS(X)
#undef X
    size_t lanes;        /* floats in a vector */
};

/* The kernels for this processor and $SPID_CPU. */
const struct nn_kernels *nn_kernels(void);
/* Those of one level, for tests and benches; the caller sees to it that the
 * processor has it (cpu_level). */
const struct nn_kernels *nn_kernels_at(enum cpu_level level);

#define X(type, name, args)                                                  \
    type name##_baseline args;                                               \
    type name##_avx2 args;                                                   \
    type name##_avx512 args;
NN_KERNELS(X)
#undef X

#endif
