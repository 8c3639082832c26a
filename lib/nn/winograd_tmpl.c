/* Winograd F(4x4,3x3): the transforms (Lavin and Gray 2016), for tiles of 6x6
 * that overlap by two.  The products between them are gemm's. */
#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"
#include "lib/nn/vector.h"
#include "lib/nn/winograd.h"

/* t = B^T d for six values `step` apart, any arithmetic type */
#define INPUT_SIX(t, d)                                                      \
    do {                                                                     \
        t[0] = 4.0f * d[0] - 5.0f * d[2] + d[4];                             \
        t[1] = (d[4] - 4.0f * d[2]) + (d[3] - 4.0f * d[1]);                  \
        t[2] = (d[4] - 4.0f * d[2]) - (d[3] - 4.0f * d[1]);                  \
        t[3] = (d[4] - d[2]) + 2.0f * (d[3] - d[1]);                         \
        t[4] = (d[4] - d[2]) - 2.0f * (d[3] - d[1]);                         \
        t[5] = 4.0f * d[1] - 5.0f * d[3] + d[5];                             \
    } while (0)

/* t = A^T m: six values to four */
#define OUTPUT_SIX(t, m)                                                     \
    do {                                                                     \
        t[0] = m[0] + (m[1] + m[2]) + (m[3] + m[4]);                         \
        t[1] = (m[1] - m[2]) + 2.0f * (m[3] - m[4]);                         \
        t[2] = (m[1] + m[2]) + 4.0f * (m[3] + m[4]);                         \
        t[3] = (m[1] - m[2]) + 8.0f * (m[3] - m[4]) + m[5];                  \
    } while (0)

/* t = G w, three values to six */
#define WEIGHT_SIX(t, w)                                                     \
    do {                                                                     \
        t[0] = w[0] * (1.0 / 4);                                             \
        t[1] = (w[0] + w[2]) * (-1.0 / 6) - w[1] * (1.0 / 6);                \
        t[2] = (w[0] + w[2]) * (-1.0 / 6) + w[1] * (1.0 / 6);                \
        t[3] = w[0] * (1.0 / 24) + w[2] * (1.0 / 6) + w[1] * (1.0 / 12);     \
        t[4] = w[0] * (1.0 / 24) + w[2] * (1.0 / 6) - w[1] * (1.0 / 12);     \
        t[5] = w[2];                                                         \
    } while (0)

/* 36 planes of a panel's row, `plane` apart, from `count` kernels w (3,3), `step`
 * apart, each in double; zeros in other columns. */
void ISA(winograd_weights)(float *u, size_t plane, const float *w, size_t step,
                           size_t count)
{
    double d[9][WINOGRAD_PANEL] = { { 0 } };

    for (size_t o = 0; o < count; o++)
        for (size_t k = 0; k < 9; k++)
            d[k][o] = (double)w[o * step + k];
#pragma omp simd
    for (size_t o = 0; o < WINOGRAD_PANEL; o++) {
        double t[3][6];

#pragma GCC unroll 3
        for (size_t x = 0; x < 3; x++) {
            const double column[3] = { d[x][o], d[3 + x][o], d[6 + x][o] };
            WEIGHT_SIX(t[x], column);
        }
#pragma GCC unroll 6
        for (size_t y = 0; y < 6; y++) {
            const double row[3] = { t[0][y], t[1][y], t[2][y] };
            double six[6];

            WEIGHT_SIX(six, row);
#pragma GCC unroll 6
            for (size_t x = 0; x < 6; x++)
                u[(6 * y + x) * plane + o] = (float)six[x];
        }
    }
}

/* v (36, T, C): tile `slot` of T <- the 6x6 input pixels at (y0,x0) of one
 * image (h,w,C), zeros outside. */
void ISA(winograd_input)(float *v, const float *in, const struct winograd *g,
                         size_t slot, ptrdiff_t y0, ptrdiff_t x0)
{
    ptrdiff_t h = (ptrdiff_t)g->h, w = (ptrdiff_t)g->w;
    size_t C = g->in, plane = g->v_size;

    for (size_t c = 0; c < C; c += VEC) {
        vf t[6][6];
        for (int x = 0; x < 6; x++) {
            vf d[6], col[6];
            for (int y = 0; y < 6; y++) {
                ptrdiff_t yy = y0 + y, xx = x0 + x;

                d[y] = (vf){ 0 };
                if (yy >= 0 && yy < h && xx >= 0 && xx < w)
                    d[y] = vf_load(in + (size_t)(yy * w + xx) * C + c);
            }
            INPUT_SIX(col, d);
            for (int y = 0; y < 6; y++)
                t[y][x] = col[y];
        }
        for (int y = 0; y < 6; y++) {
            vf row[6];
            INPUT_SIX(row, t[y]);
            for (int x = 0; x < 6; x++)
                vf_store(v + (size_t)(6 * y + x) * plane + slot * C + c,
                          row[x]);
        }
    }
}

/* out (h,w,C) at (y0,x0), 4x4 pixels or what is left of the image <- act of
 * tile `slot` of m (36, T, C) plus bias (plus what out holds: add). */
void ISA(winograd_output)(float *out, const float *m, const struct winograd *g,
                          size_t slot, size_t y0, size_t x0)
{
    size_t C = g->out, plane = g->m_size;
    size_t ny = g->h - y0 < 4 ? g->h - y0 : 4;
    size_t nx = g->w - x0 < 4 ? g->w - x0 : 4;

    vf slope = vf_set(g->act == ACT_NONE ? 1
                        : g->act == ACT_RELU ? 0 : ACT_SLOPE);
    for (size_t c = 0; c < C; c += VEC) {
        vf t[4][6], bias = vf_load(g->bias + c);
        for (int x = 0; x < 6; x++) {
            vf d[6], col[4];
            for (int y = 0; y < 6; y++)
                d[y] = vf_load(m + (size_t)(6 * y + x) * plane + slot * C +
                                c);
            OUTPUT_SIX(col, d);
            for (int y = 0; y < 4; y++)
                t[y][x] = col[y];
        }
        for (size_t y = 0; y < ny; y++) {
            vf row[4];
            OUTPUT_SIX(row, t[y]);
            for (size_t x = 0; x < nx; x++) {
                float *to = out + ((y0 + y) * g->w + x0 + x) * C + c;

                vf r = row[x] + bias;
                if (g->add)
                    r += vf_load(to);
                vf_store(to, vf_max(r, slope * r));
            }
        }
    }
}
