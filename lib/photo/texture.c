/* The photograph as texture (texture.h): the person cut out of the source
 * picture in several sizes and its confidence. */
#include "lib/photo/texture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/crop.h"
#include "lib/head/person.h"
#include "lib/photo/lookup.h"

/* ---- the person alone -------------------------------------------------- */

/* person = rgb - (1 - matte) back, no more than the matte allows. */
static void texture_cut(uint8_t *out, const uint8_t *rgb,
                        const uint8_t *matte, const uint8_t *back, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        int m = matte[i];

        for (size_t c = 0; c < 3; c++) {
            int hidden = ((255 - m) * back[3 * i + c] + 127) / 255;
            int own = rgb[3 * i + c] - hidden;

            out[4 * i + c] = (uint8_t)(own < 0 ? 0 : own > m ? m : own);
        }
        out[4 * i + 3] = (uint8_t)m;
    }
}

void texture_straight(uint8_t *out, const uint8_t *rgb, const uint8_t *matte,
                      const uint8_t *back, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        uint8_t own[4];

        texture_cut(own, rgb + 3 * i, matte + i, back + 3 * i, 1);
        for (size_t c = 0; c < 3; c++)
            out[3 * i + c] = matte[i] ? (uint8_t)(255 * own[c] / matte[i])
                                      : rgb[3 * i + c];
    }
}

/* out (s,s,4) = means of two by two pixels of in (2s,2s,4). */
static void texture_halve(uint8_t *out, const uint8_t *in, size_t s)
{
    const size_t line = 8 * s;

    for (size_t y = 0; y < s; y++)
        for (size_t x = 0; x < 4 * s; x++) {
            const uint8_t *p = in + 2 * y * line + 2 * (x & ~(size_t)3) +
                               (x & 3);

            out[4 * s * y + x] = (uint8_t)((p[0] + p[4] + p[line] +
                                            p[line + 4] + 2) / 4);
        }
}

/* Sides of the levels: the picture's own, then powers of two, so that one of
 * them is the size that the networks work at and heads are drawn at; returns
 * the bytes of all. */
static size_t texture_sides(struct texture *t, size_t S)
{
    size_t bytes = 4 * S * S, side = 1;

    t->side[0] = S;
    t->levels = 1;
    while (2 * side < S)
        side *= 2;
    while (t->levels < TEXTURE_LEVELS && side >= 2) {
        t->side[t->levels++] = side;
        bytes += 4 * side * side;
        side /= 2;
    }
    return bytes;
}

/* Level l from the one before. */
static int texture_shrink(struct texture *t, size_t l)
{
    const size_t from = t->side[l - 1], to = t->side[l];
    const double S = (double)from;

    if (from == 2 * to) {
        texture_halve(t->level[l], t->level[l - 1], to);
        return 0;
    }
    return crop_resize_u8(t->level[l], to, t->level[l - 1], from, from,
                          4 * from, 4, (struct square){S / 2, S / 2, S});
}

int texture_init(struct texture *t, const uint8_t *rgb, const uint8_t *matte,
                 const uint8_t *back, size_t S, struct error *err)
{
    memset(t, 0, sizeof *t);
    if (S < 2)
        return error_set(err, EX_DATAERR, "source picture of %zu x %zu pixels "
                         "(expected at least 2 x 2)", S, S);
    t->block = malloc(texture_sides(t, S));
    int rc = t->block ? 0 : -1;
    uint8_t *at = t->block;
    for (size_t l = 0; l < t->levels && rc == 0; l++) {
        t->level[l] = at;
        at += 4 * t->side[l] * t->side[l];
        if (l > 0)
            rc = texture_shrink(t, l);
        else
            texture_cut(t->level[0], rgb, matte, back, S * S);
    }
    if (rc == 0)
        return 0;
    texture_release(t);
    return error_set(err, EX_OSERR, "no memory for a texture of %zu pixels",
                     S);
}

int texture_read_record(struct texture *t, const struct record *srci,
                        struct error *err)
{
    struct person p = {0};
    int rc = person_read_record(&p, srci, 0, err) < 0 ? -1 : 0;

    if (rc == 0) {
        texture_release(t);
        rc = p.back ? texture_init(t, p.rgb, p.matte, p.back, p.size, err) : 0;
    }
    person_release(&p);
    return rc;
}

void texture_release(struct texture *t)
{
    free(t->block);
    memset(t, 0, sizeof *t);
}

/* ---- confidence -------------------------------------------------------- */

/* d (2): by how much the offset changes along a line of size pixels, at pixel
 * `at` of it and `step` pixels of place apart, over the same change of the
 * picture's position. */
static void texture_slope(float d[2], const float *p, size_t at, long step,
                          size_t size)
{
    const size_t most = TEXTURE_ACROSS;
    size_t back = at < most ? at : most;
    size_t ahead = size - 1 - at < most ? size - 1 - at : most;
    const float *a = p - 3 * (long)back * step, *b = p + 3 * (long)ahead * step;

    if (!(a[2] > TEXTURE_LEAST)) {
        a = p;
        back = 0;
    }
    if (!(b[2] > TEXTURE_LEAST)) {
        b = p;
        ahead = 0;
    }
    float n = 0.5f * (float)size / fmaxf((float)(back + ahead), 1);
    d[0] = n * (b[0] / b[2] - a[0] / a[2]);
    d[1] = n * (b[1] / b[2] - a[1] / a[2]);
}

float texture_zoom(const struct splat_place_view *v)
{
    const float *A = v->A;
    float square = A[0] * A[0] + A[1] * A[1] + A[2] * A[2] + A[3] * A[3];
    float area = A[0] * A[3] - A[1] * A[2];

    return 0.5f * (square - sqrtf(fmaxf(square * square - 4 * area * area, 0)));
}

float texture_stretch(const float *place, const struct splat_place_view *v,
                      float zoom, size_t x, size_t y, size_t size)
{
    const float *p = place + 3 * (y * size + x), *A = v->A;
    float dx[2], dy[2];

    texture_slope(dx, p, x, 1, size);
    texture_slope(dy, p, y, (long)size, size);
    float area = (A[0] + dx[0]) * (A[3] + dy[1]) -
                 (A[1] + dy[0]) * (A[2] + dx[1]);
    area /= fmaxf(zoom, 1e-6f);
    float t = (area - TEXTURE_STRETCHED) / (TEXTURE_SHARP - TEXTURE_STRETCHED);
    return fminf(fmaxf(t, 0), 1);
}

struct texture_rim texture_rim(const struct splat_place_view *v)
{
    const float *A = v->A;
    float square = A[0] * A[0] + A[1] * A[1] + A[2] * A[2] + A[3] * A[3];
    float area = fmaxf(A[0] * A[3] - A[1] * A[2], 1e-6f);

    /* (1 - c) / sqrt(c), c the cosine: singular values differ by it */
    float off = sqrtf(fmaxf(square / area - 2, 0));

    return (struct texture_rim){
        .turned = fminf(fmaxf((off - 0.022f) / (0.1f - 0.022f), 0), 1),
        .least = fminf(fmaxf((off - 0.006f) / (0.022f - 0.006f), 0), 1),
        .inner = fminf(fmaxf((off - 0.0014f) / (0.0098f - 0.0014f), 0), 1),
        .still = fmaxf(1 - off / 0.0014f, 0),
        .most = 2 / fminf(fmaxf(off / 0.01f, 1e-6f), 1)
    };
}

float texture_inside(const float *alpha, size_t x, size_t y, size_t size)
{
    const size_t far = (size + TEXTURE_SOFT - 1) / TEXTURE_SOFT;
    const size_t last = size - 1;
    const size_t left = x > far ? x - far : 0, up = y > far ? y - far : 0;
    const size_t right = x + far < last ? x + far : last;
    const size_t down = y + far < last ? y + far : last;

    return fminf(fminf(alpha[y * size + left], alpha[y * size + right]),
                 fminf(alpha[up * size + x], alpha[down * size + x]));
}
