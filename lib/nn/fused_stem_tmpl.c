/* Two rows of the feature image at a time: see fused_stem.h. */
#include "lib/nn/act.h"
#include "lib/nn/fused_stem.h"
#include "lib/nn/kernels.h"
#include "lib/nn/vector.h"

/* 16 channels of so many pixels stay in registers. */
#if defined(ISA_AVX512)
#define PIXELS 16        /* 16 registers */
#elif defined(ISA_AVX2)
#define PIXELS 6         /* 12 */
#else
#define PIXELS 2         /* 8 */
#endif

/* `pixels` (a constant) outputs from pixel x on, 16 channels of each; every
 * step asks for the line that will be read one piece later */
VEC_INLINE void fused_stem_block(float *out, const struct fused_stem_rows *in,
                                 size_t x, const float *w, const float *bias,
                                 size_t C, size_t O, const int pixels)
{
    vf acc[PIXELS][VEC_PARTS];

    for (int i = 0; i < pixels; i++)
        for (int j = 0; j < VEC_PARTS; j++)
            acc[i][j] = vf_load(bias + VEC * j);
    for (int y = 0; y < 2; y++, w += 32 * C) {
        const float *p = in->row[y] + 2 * x * C;
        const char *next = in->next[y] + x * 2 * in->step * (C / 16);

        for (size_t k = 0; k < 2 * C; k++) {
            vf b[VEC_PARTS];
            for (int j = 0; j < VEC_PARTS; j++)
                b[j] = vf_once(vf_load(w + 16 * k + VEC * j));
            if (pixels == PIXELS)
                __builtin_prefetch(next + k * in->step * PIXELS / 16);
            for (int i = 0; i < pixels; i++)
                for (int j = 0; j < VEC_PARTS; j++)
                    acc[i][j] += p[2 * C * (size_t)i + k] * b[j];
        }
    }
    for (int i = 0; i < pixels; i++)
        for (int j = 0; j < VEC_PARTS; j++)
            vf_store(out + (size_t)i * O + VEC * j,
                     vf_max(acc[i][j], ACT_SLOPE * acc[i][j]));
}

/* All pixels of a row, PIXELS at a time and then one by one. */
VEC_INLINE void fused_stem_pieces(float *out, const struct fused_stem_rows *in,
                                  const float *w, const float *bias,
                                  size_t pixels, size_t C, size_t O)
{
    for (size_t o = 0; o < O; o += 16, w += 64 * C) {
        size_t x = 0;

        for (; x + PIXELS <= pixels; x += PIXELS)
            fused_stem_block(out + x * O + o, in, x, w, bias + o, C, O, PIXELS);
        for (; x < pixels; x++)
            fused_stem_block(out + x * O + o, in, x, w, bias + o, C, O, 1);
    }
}

/* out (pixels,O) = lrelu(bias + w . the 2x2 pixels of C channels in two
 * rows); w (O/16, 4 C, 16). */
void ISA(fused_stem_row)(float *out, const struct fused_stem_rows *in,
                         const float *w, const float *bias, size_t pixels,
                         size_t C, size_t O)
{
    if (C == 32 && O == 16)      /* as shipped: the strides are constants */
        fused_stem_pieces(out, in, w, bias, pixels, 32, 16);
    else
        fused_stem_pieces(out, in, w, bias, pixels, C, O);
}

/* rgb (pixels,3) <- the first three of C channels */
void ISA(pick_rgb)(float *rgb, const float *in, size_t pixels, size_t C)
{
    for (size_t x = 0; x < pixels; x++)
        for (size_t c = 0; c < 3; c++)
            rgb[3 * x + c] = in[x * C + c];
}

/* the same from half floats */
void ISA(pick_rgb_half)(float *rgb, const uint16_t *in, size_t pixels,
                        size_t C)
{
    for (size_t x = 0; x < pixels; x++) {
        uint16_t few[VEC] = { 0 };
        const uint16_t *p = in + x * C;
        float lane[VEC];

        if (C < VEC) {
            memcpy(few, p, 3 * sizeof *few);
            p = few;
        }
        vf_store(lane, vf_load_half(p));
        memcpy(rgb + 3 * x, lane, 3 * sizeof *rgb);
    }
}

/* y <- x, half floats */
void ISA(widen)(float *y, const uint16_t *x, size_t n)
{
    size_t i = 0;

    for (; i + VEC <= n; i += VEC)
        vf_store(y + i, vf_load_half(x + i));
    for (; i < n; i++) {
        uint16_t half[VEC] = { x[i] };
        float lane[VEC];

        vf_store(lane, vf_load_half(half));
        y[i] = lane[0];
    }
}
