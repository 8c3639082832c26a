/* The photograph as texture (texture.h): the person cut out of the source
 * picture in several sizes and its confidence. */
#include "lib/photo/texture.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/crop.h"
#include "lib/base/parallel.h"
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

/* Row y of n pixels. */
PARALLEL(texture_cut_row, y, uint8_t *, out, const uint8_t *, rgb,
         const uint8_t *, matte, const uint8_t *, back, size_t, n)
{
    const size_t i = y * n;

    texture_cut(out + 4 * i, rgb + 3 * i, matte + i, back + 3 * i, n);
}

PARALLEL(texture_straight_pixel, i, uint8_t *, out, const uint8_t *, rgb,
         const uint8_t *, matte, const uint8_t *, back)
{
    uint8_t own[4];

    texture_cut(own, rgb + 3 * i, matte + i, back + 3 * i, 1);
    for (size_t c = 0; c < 3; c++)
        out[3 * i + c] = matte[i] ? (uint8_t)(255 * own[c] / matte[i])
                                  : rgb[3 * i + c];
}

void texture_straight(uint8_t *out, const uint8_t *rgb, const uint8_t *matte,
                      const uint8_t *back, size_t n)
{
    parallel_each(texture_straight_pixel, n, 1, out, rgb, matte, back);
}

/* Row y of out (s,s,4): means of two by two pixels of in (2s,2s,4). */
PARALLEL(texture_halve_row, y, uint8_t *, out, const uint8_t *, in, size_t, s)
{
    const size_t line = 8 * s;

    for (size_t x = 0; x < 4 * s; x++) {
        const uint8_t *p = in + 2 * y * line + 2 * (x & ~(size_t)3) + (x & 3);

        out[4 * s * y + x] = (uint8_t)((p[0] + p[4] + p[line] + p[line + 4] +
                                        2) / 4);
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
        parallel_each(texture_halve_row, to, 1, t->level[l], t->level[l - 1],
                      to);
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
            parallel_each(texture_cut_row, S, 1, t->level[0], rgb, matte, back,
                          S);
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
    if (person_is_further(srci))
        return 0;
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
