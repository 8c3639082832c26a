/* Max pooling of one row, a vector of channels at a time. */
#include "lib/nn/kernels.h"
#include "lib/nn/pool.h"
#include "lib/nn/vector.h"

/* The greatest of one window of rows x cols pixels, whose first is at p. */
VF_INLINE vf max_pool_window(vf *which, const float *p, size_t rows,
                             size_t cols, size_t step, size_t C)
{
    vf max = vf_load(p), at = vf_set(0);

    for (size_t y = 0; y < rows; y++)
        for (size_t x = 0; x < cols; x++) {
            vf v = vf_load(p + y * step + x * C);
            vf_i32 more = v > max;
            at = (vf)((more & (vf_i32)vf_set((float)(3 * y + x))) |
                      (~more & (vf_i32)at));
            max = vf_max(v, max);
        }
    *which = at;
    return max;
}

/* Row y of the output; in: the image, which: NULL or where the maxima are. */
void ISA(max_pool_row)(float *out, float *which, const float *in,
                       const struct max_pool *m, size_t y)
{
    size_t C = m->channels, step = m->w * C;
    size_t rows = m->h - 2 * y < 3 ? m->h - 2 * y : 3;

    for (size_t x = 0; x < m->ow; x++) {
        size_t cols = m->w - 2 * x < 3 ? m->w - 2 * x : 3;
        const float *p = in + 2 * y * step + 2 * x * C;

        for (size_t c = 0; c < C; c += VF_LANES) {
            vf at;
            vf_store(out + x * C + c,
                     max_pool_window(&at, p + c, rows, cols, step, C));
            if (which)
                vf_store(which + x * C + c, at);
        }
    }
}

/* Row y of the input's gradient: from the at most four windows that a pixel
 * lies in, in order. */
void ISA(max_pool_row_backward)(float *din, const float *dout,
                                const float *which, const struct max_pool *m,
                                size_t y)
{
    size_t C = m->channels, y1 = y / 2 < m->oh ? y / 2 : m->oh - 1;
    size_t y0 = y < 2 ? 0 : (y - 1) / 2;

    for (size_t x = 0; x < m->w; x++) {
        size_t x1 = x / 2 < m->ow ? x / 2 : m->ow - 1;
        size_t x0 = x < 2 ? 0 : (x - 1) / 2;

        for (size_t c = 0; c < C; c += VF_LANES) {
            vf sum = { 0 };
            for (size_t oy = y0; oy <= y1; oy++)
                for (size_t ox = x0; ox <= x1; ox++) {
                    size_t at = (oy * m->ow + ox) * C + c;
                    size_t place = 3 * (y - 2 * oy) + x - 2 * ox;

                    vf_i32 here = vf_load(which + at) == (float)place;
                    sum += (vf)(here & (vf_i32)vf_load(dout + at));
                }
            vf_store(din + x * C + c, sum);
        }
    }
}
