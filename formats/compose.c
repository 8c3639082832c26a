/* Premultiplied colours over a background, rounded to bytes: the plain
 * versions, and whole frames. */
#include "formats/compose.h"

#include <string.h>

#include "formats/framesink.h"
#include "lib/base/cpu.h"
#include "lib/base/half.h"

/* Rounded and clamped; NaN becomes 0. */
static uint8_t compose_level(float v)
{
    v += 0.5f;
    if (!(v > 0))
        return 0;
    return v < 255 ? (uint8_t)v : 255;
}

void compose_c(uint8_t *out, const float *color, const float *alpha,
               const uint8_t *bg, size_t bg_step, size_t n)
{
    for (size_t i = 0; i < n; i++, bg += bg_step)
        for (size_t k = 0; k < 3; k++)
            out[3 * i + k] = compose_level(color[3 * i + k] * 255
                                           + (1 - alpha[i]) * bg[k]);
}

void compose_quantise_c(uint8_t *out, const float *x, size_t n)
{
    for (size_t i = 0; i < n; i++)
        out[i] = compose_level(x[i] * 255);
}

void compose_half_c(uint16_t *out, const float *x, size_t n)
{
    for (size_t i = 0; i < n; i++)
        out[i] = float_to_half(x[i]);
}

void compose_planes_c(uint8_t *const plane[3], const uint8_t *rgb, size_t n,
                      const int32_t m[3][4])
{
    for (size_t i = 0; i < n; i++, rgb += 3)
        for (int j = 0; j < 3; j++) {
            int v = (m[j][0] * rgb[0] + m[j][1] * rgb[1] + m[j][2] * rgb[2] +
                     m[j][3]) >> 16;

            plane[j][i] = (uint8_t)(v < 0 ? 0 : v > 255 ? 255 : v);
        }
}

void compose_rgb_c(uint8_t *rgb, const uint8_t *luma, const int16_t *u,
                   const int16_t *v, size_t n, const int32_t m[3][4])
{
    for (size_t i = 0; i < n; i++, rgb += 3)
        for (int j = 0; j < 3; j++) {
            int x = (m[j][0] * luma[i] + m[j][1] * u[i] + m[j][2] * v[i] +
                     m[j][3]) >> 16;

            rgb[j] = (uint8_t)(x < 0 ? 0 : x > 255 ? 255 : x);
        }
}

/* ---- whole frames ----------------------------------------------------- */

#define RUN 256                /* pixels composed at a time */

/* The first three channels of n pixels from number `at` on, packed: in place
 * where they are, else in run [n,3]. */
static const float *compose_color_run(float *run,
                                      const struct framesink_frame *f,
                                      size_t at, size_t n)
{
    const size_t C = (size_t)f->channels;

    if (f->color && C == 3)
        return f->color + at * 3;
    if (f->color) {
        const float *c = f->color + at * C;

        for (size_t x = 0; x < n; x++, c += C)
            for (size_t k = 0; k < 3; k++)
                run[3 * x + k] = c[k];
    } else {
        const uint8_t *c = f->rgb + at * 3;

        for (size_t i = 0; i < 3 * n; i++)
            run[i] = (float)c[i] * (1.0f / 255.0f);
    }
    return run;
}

/* A coordinate of the background, at most top. */
static size_t compose_clamp(double v, size_t top)
{
    return v < (double)top ? (size_t)v : top;
}

/* n pixels of row y from column x on of the background picture, resized to
 * cover a W x H frame (four samples a pixel). */
static void compose_background_run(uint8_t *run, const struct background *bg,
                                   size_t W, size_t H, size_t x, size_t y,
                                   size_t n)
{
    const double sx = (double)bg->width / (double)W;
    const double sy = (double)bg->height / (double)H;
    const double s = sx < sy ? sx : sy;
    const double ox = ((double)bg->width - s * (double)W) / 2;
    const double oy = ((double)bg->height - s * (double)H) / 2;
    const size_t top = bg->height - 1, end = bg->width - 1;
    const uint8_t *a = bg->rgb + 3 * bg->width
                       * compose_clamp(oy + s * ((double)y + 0.25), top);
    const uint8_t *b = bg->rgb + 3 * bg->width
                       * compose_clamp(oy + s * ((double)y + 0.75), top);

    for (size_t i = 0; i < n; i++, run += 3) {
        size_t u = 3 * compose_clamp(ox + s * ((double)(x + i) + 0.25), end);
        size_t v = 3 * compose_clamp(ox + s * ((double)(x + i) + 0.75), end);

        for (size_t k = 0; k < 3; k++)
            run[k] = (uint8_t)((a[u + k] + a[v + k] + b[u + k] + b[v + k]
                                + 2) / 4);
    }
}

/* n pixels from column x of row y on. */
static void compose_run(uint8_t *out, const struct framesink_frame *f,
                        const struct background *bg, size_t x, size_t y,
                        size_t n)
{
    const struct compose_kernels *t = CPU_PICK(compose_kernels);
    const size_t at = y * f->width + x;
    float run[3 * RUN];
    uint8_t back[3 * RUN];
    const float *c = compose_color_run(run, f, at, n);

    if (!f->alpha) {
        t->quantise(out, c, 3 * n);
    } else if (!bg->rgb) {
        t->blend(out, c, f->alpha + at, bg->color, 0, n);
    } else if (bg->width == f->width && bg->height == f->height) {
        t->blend(out, c, f->alpha + at, bg->rgb + 3 * at, 3, n);
    } else {
        compose_background_run(back, bg, f->width, f->height, x, y, n);
        t->blend(out, c, f->alpha + at, back, 3, n);
    }
}

void framesink_compose(uint8_t *out, const struct framesink_frame *f,
                       const struct background *bg)
{
    static const struct background black;

    if (!f->color && !f->alpha) {
        memcpy(out, f->rgb, 3 * f->width * f->height);
        return;
    }
    for (size_t y = 0; y < f->height; y++)
        for (size_t x = 0; x < f->width; x += RUN) {
            size_t n = f->width - x < RUN ? f->width - x : RUN;

            compose_run(out + 3 * (y * f->width + x), f, bg ? bg : &black, x,
                        y, n);
        }
}

void framesink_compose_rgba(uint8_t *out, const struct framesink_frame *f)
{
    const size_t N = f->width * f->height;
    float run[3 * RUN];

    for (size_t at = 0; at < N; at += RUN) {
        size_t n = N - at < RUN ? N - at : RUN;
        const float *c = compose_color_run(run, f, at, n);

        for (size_t i = 0; i < n; i++, out += 4, c += 3) {
            float a = f->alpha ? f->alpha[at + i] : 1;
            float s = a > 0 ? 1 / a : 0;
            float v[4] = {c[0] * s, c[1] * s, c[2] * s, a};

            compose_quantise_c(out, v, 4);
        }
    }
}
