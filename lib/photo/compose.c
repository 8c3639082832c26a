/* The photograph into a picture by its confidence (texture.h), forward and
 * backward. */
#include "lib/photo/texture.h"

#include <math.h>
#include <string.h>

#include "lib/base/cpu.h"
#include "lib/base/parallel.h"
#include "lib/base/quad.h"
#include "lib/photo/lookup.h"
#include "lib/photo/lookup_kernel.h"

/* The smaller one, a where b is not a number: fminf is a call. */
static inline float compose_min(float a, float b)
{
    return b < a ? b : a;
}

/* x within 0..max. */
static inline float compose_within(float x, float max)
{
    return x > 0 ? compose_min(x, max) : 0;
}

void texture_mix(float *color, size_t channels, float *alpha,
                 const float *photo, size_t n)
{
    if (channels == 3) {
        CPU_PICK(lookup_kernels)->mix(color, alpha, photo, n);
        return;
    }
    for (size_t i = 0; i < n; i++) {
        const float *p = photo + TEXTURE_PHOTO * i;

        if (p[4] == 0)
            continue;
        for (size_t c = 0; c < 3; c++)
            color[channels * i + c] +=
                p[4] * (p[c] - color[channels * i + c]);
        alpha[i] += p[4] * (p[3] - alpha[i]);
    }
}

void texture_clamp_to_alpha(float *color, size_t channels, const float *alpha,
                            size_t n)
{
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++)
            color[channels * i + c] = compose_within(color[channels * i + c],
                                                     alpha[i]);
}

/* ---- the field --------------------------------------------------------- */

/* Where pixel x of a line lies between two of n places, `step` pixels apart:
 * a and b, and the weight of b. */
struct compose_tap {
    size_t a, b;
    float w;
};

static struct compose_tap compose_tap_make(size_t x, size_t n, float step)
{
    float at = ((float)x + 0.5f) / step - 0.5f;
    float low = floorf(at);
    size_t a = low > 0 ? (size_t)low : 0, b = (size_t)(low + 1);

    a = a < n ? a : n - 1;
    b = b < n ? b : n - 1;
    return (struct compose_tap){a, b, at - low};
}

/* The field's numbers at one of its places, */
static quad compose_place(const struct texture_field *f, size_t y, size_t x)
{
    return *(const quad *)(f->at + TEXTURE_FIELD * (y * f->width + x));
}

/* and at a pixel. */
static quad compose_field_at(const struct texture_field *f,
                             struct compose_tap y, struct compose_tap x)
{
    quad up = compose_place(f, y.a, x.a), down = compose_place(f, y.b, x.a);

    up += x.w * (compose_place(f, y.a, x.b) - up);
    down += x.w * (compose_place(f, y.b, x.b) - down);
    return up + y.w * (down - up);
}

/* Photograph p (4) as the field f has it beside what the picture has itself, was
 * (rgb, alpha): brightened and, as far as it is doubted, in the picture's colours
 * where both cover the pixel.  What it covers is not doubted: an outline is seen
 * in whatever light. */
static inline quad compose_doubt(const float *p, quad was, quad f)
{
    const quad gain = {1 + f[1], 1 + f[2], 1 + f[3], 1};
    const float doubt = compose_within(f[0], 1);
    const float both = compose_min(was[3], p[3]);
    const quad photo = gain * *(const quad *)p;
    quad color = photo;

    if (doubt > 0 && both > 0)
        color += doubt * (both / was[3] * was - both / p[3] * photo);
    color[3] = p[3];
    return color;
}

void texture_field_row(float *photo, const float *color, const float *alpha,
                       const struct texture_field *f, float step, size_t x,
                       size_t n, size_t y)
{
    const struct compose_tap ty = compose_tap_make(y, f->height, step);

    for (size_t i = 0; i < n; i++, photo += TEXTURE_PHOTO, color += 3) {
        const quad was = {color[0], color[1], color[2], alpha[i]};

        if (photo[4] != 0)
            *(quad *)photo = compose_doubt(
                photo, was,
                compose_field_at(f, ty, compose_tap_make(x + i, f->width, step)));
    }
}

/* dfield += d at the pixel. */
static void compose_field_add(float *dfield, const struct texture_field *f,
                              struct compose_tap y, struct compose_tap x,
                              const float d[TEXTURE_FIELD])
{
    const size_t at[4] = {y.a * f->width + x.a, y.a * f->width + x.b,
                          y.b * f->width + x.a, y.b * f->width + x.b};
    const float w[4] = {(1 - y.w) * (1 - x.w), (1 - y.w) * x.w,
                        y.w * (1 - x.w), y.w * x.w};

    for (size_t k = 0; k < 4; k++)
        for (size_t c = 0; c < TEXTURE_FIELD; c++)
            dfield[TEXTURE_FIELD * at[k] + c] += w[k] * d[c];
}

/* ---- forward ----------------------------------------------------------- */

#define COMPOSE_RUN 64          /* pixels at a time, */
#define COMPOSE_PLACES (COMPOSE_RUN / TEXTURE_FIELD_STEP + 2)   /* ... between
                                                                 * so many */

/* The field between two of its lines, at places from the one left of pixel x0
 * on. */
static void compose_field_line(quad line[COMPOSE_PLACES],
                               const struct texture_field *f,
                               struct compose_tap y, size_t x0)
{
    for (size_t k = 0; k < COMPOSE_PLACES; k++) {
        size_t x = x0 / TEXTURE_FIELD_STEP + k;

        x = x ? x - 1 : 0;
        x = x < f->width ? x : f->width - 1;
        const quad a = compose_place(f, y.a, x);
        line[k] = a + y.w * (compose_place(f, y.b, x) - a);
    }
}

/* One pixel: rgb (3) and its alpha. */
static inline void compose_pixel(float *rgb, float *alpha, const float *p,
                                 quad f)
{
    quad is = {rgb[0], rgb[1], rgb[2], *alpha};

    is += p[4] * (compose_doubt(p, is, f) - is);
    for (size_t c = 0; c < 3; c++)
        rgb[c] = is[c];
    *alpha = is[3];
}

/* n pixels of a row; line: the field's, from the place left of the first. */
static void compose_run(float *rgb, float *alpha, const float *photo,
                        const quad line[COMPOSE_PLACES], size_t n)
{
    for (size_t x = 0; x < n; x++, rgb += 3, alpha++, photo += TEXTURE_PHOTO) {
        /* half a place to the left of the pixel's own */
        const size_t at = x + TEXTURE_FIELD_STEP / 2;
        const size_t k = at / TEXTURE_FIELD_STEP;
        const float w = ((float)(at % TEXTURE_FIELD_STEP) + 0.5f) /
                        TEXTURE_FIELD_STEP;

        if (photo[4] != 0)
            compose_pixel(rgb, alpha, photo,
                          line[k] + w * (line[k + 1] - line[k]));
        for (size_t c = 0; c < 3; c++)
            rgb[c] = compose_within(rgb[c], *alpha);
    }
}

/* One row. */
PARALLEL(texture_compose_part, y, const struct texture_field *, field,
         float *, rgb, float *, alpha, const float *, photo, size_t, width)
{
    quad line[COMPOSE_PLACES] = { { 0 } };

    for (size_t x = 0; x < width; x += COMPOSE_RUN) {
        const size_t i = y * width + x, left = width - x;

        if (field->at)
            compose_field_line(
                line, field,
                compose_tap_make(y, field->height, TEXTURE_FIELD_STEP), x);
        compose_run(rgb + 3 * i, alpha + i, photo + TEXTURE_PHOTO * i, line,
                    left < COMPOSE_RUN ? left : COMPOSE_RUN);
    }
}

void texture_compose(float *rgb, float *alpha, const float *photo,
                     const struct texture_field *field, size_t height,
                     size_t width)
{
    parallel_each(texture_compose_part, height, 1, field, rgb, alpha, photo,
                  width);
}

/* ---- backward ---------------------------------------------------------- */

/* compose_doubt's gradients, given that of its colours dq (3): drgb, dalpha and
 * dp (3 and the matte's) are added to, df is written. */
static void compose_doubt_backward(float *drgb, float *dalpha, float *dp,
                                   float df[TEXTURE_FIELD], const float dq[3],
                                   const float *rgb, float alpha,
                                   const float *p, quad f)
{
    const float doubt = compose_within(f[0], 1);
    const float both = compose_min(alpha, p[3]);
    const float own = both > 0 ? both / alpha : 0;
    const float photo = both > 0 ? both / p[3] : 0;
    float by_own = 0, by_photo = 0;     /* what own and photo move */

    for (int c = 0; c < 3; c++) {
        const float gain = 1 + f[c + 1], d = dq[c] * (1 - doubt * photo);

        by_own += dq[c] * rgb[c];
        by_photo += dq[c] * gain * p[c];
        drgb[c] += dq[c] * doubt * own;
        dp[c] += d * gain;
        df[c + 1] = d * p[c];
    }
    df[0] = f[0] > 0 && f[0] < 1 ? own * by_own - photo * by_photo : 0;
    if (both > 0 && alpha < p[3]) {
        *dalpha -= doubt * by_photo / p[3];
        dp[3] += doubt * by_photo * photo / p[3];
    } else if (both > 0) {
        dp[3] += doubt * by_own / alpha;
        *dalpha -= doubt * by_own * own / alpha;
    }
}

/* compose_pixel's lines from the last to the first, given what went in. */
static void compose_pixel_backward(float *drgb, float *dalpha, float *dp,
                                   float df[TEXTURE_FIELD], const float *rgb,
                                   float alpha, const float *p, quad f)
{
    const quad was = {rgb[0], rgb[1], rgb[2], alpha};
    const quad to = compose_doubt(p, was, f), is = was + p[4] * (to - was);
    float dq[3];

    /* out = min(max(is, 0), alpha) */
    for (int c = 0; c < 3; c++) {
        if (is[c] > is[3])
            *dalpha += drgb[c];
        if (is[c] > is[3] || is[c] < 0)
            drgb[c] = 0;
    }
    dp[3] = *dalpha * p[4];
    dp[4] = *dalpha * (to[3] - alpha);
    *dalpha *= 1 - p[4];
    for (int c = 0; c < 3; c++) {
        dp[4] += drgb[c] * (to[c] - rgb[c]);
        dq[c] = drgb[c] * p[4];
        drgb[c] *= 1 - p[4];
    }
    compose_doubt_backward(drgb, dalpha, dp, df, dq, rgb, alpha, p, f);
}

void texture_compose_backward(float *drgb, float *dalpha, float *dphoto,
                              float *dfield, const float *rgb,
                              const float *alpha, const float *photo,
                              const struct texture_field *field,
                              size_t height, size_t width)
{
    memset(dphoto, 0, TEXTURE_PHOTO * height * width * sizeof *dphoto);
    if (field->at)
        memset(dfield, 0, TEXTURE_FIELD * field->height * field->width *
                          sizeof *dfield);
    for (size_t y = 0; y < height; y++) {
        struct compose_tap ty = compose_tap_make(y, field->height,
                                                 TEXTURE_FIELD_STEP);

        for (size_t x = 0, i = y * width; x < width; x++, i++) {
            struct compose_tap tx = compose_tap_make(x, field->width,
                                                     TEXTURE_FIELD_STEP);
            const float *p = photo + TEXTURE_PHOTO * i;
            float df[TEXTURE_FIELD] = {0};
            quad f = {0};

            if (p[4] != 0 && field->at)
                f = compose_field_at(field, ty, tx);
            compose_pixel_backward(drgb + 3 * i, dalpha + i,
                                   dphoto + TEXTURE_PHOTO * i, df,
                                   rgb + 3 * i, alpha[i], p, f);
            if (p[4] != 0 && field->at)
                compose_field_add(dfield, field, ty, tx, df);
        }
    }
}
