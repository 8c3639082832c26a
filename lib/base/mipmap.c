/* Levels of a picture, made part by part (mipmap.h). */
#include "lib/base/mipmap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define BORDER 4                /* pixels about a square: more than crop_sample_u8
                                 * reads */

int mipmap_take(struct mipmap *m, const uint8_t *rgb, size_t W, size_t H,
                struct error *err)
{
    size_t room = 0, w = W, h = H;

    for (m->levels = 1; w > 1 && h > 1; m->levels++) {
        w /= 2;
        h /= 2;
        m->level[m->levels] = (struct mipmap_level){.W = w, .H = h};
        room += 3 * w * h;
    }
    if (room > m->room) {
        uint8_t *block = malloc(room);

        if (!block)
            return error_set(err, EX_OSERR, "no memory for a picture of %zu x "
                             "%zu pixels at half its size", W, H);
        free(m->block);
        m->block = block;
        m->room = room;
    }
    m->level[0] = (struct mipmap_level){rgb, W, H, {{0, W}, {0, H}}};
    rgb = m->block;
    for (size_t k = 1; k < m->levels; k++) {
        m->level[k].rgb = rgb;
        rgb += 3 * m->level[k].W * m->level[k].H;
    }
    return 0;
}

void mipmap_release(struct mipmap *m)
{
    free(m->block);
    memset(m, 0, sizeof *m);
}

/* The smallest range that holds a and b. */
static void mipmap_join(size_t a[2], const size_t b[2])
{
    a[0] = a[0] < b[0] ? a[0] : b[0];
    a[1] = a[1] > b[1] ? a[1] : b[1];
}

/* Level k, of which at least `part` is there. */
static const struct mipmap_level *mipmap_part(struct mipmap *m, size_t k,
                                              struct extent part)
{
    struct mipmap_level *l = m->level + k;
    struct extent all = l->made.x[1] ? l->made : part;

    mipmap_join(all.x, part.x);
    mipmap_join(all.y, part.y);
    if (!memcmp(&all, &l->made, sizeof all) || extent_is_empty(&part))
        return l;
    const size_t x = all.x[0], y = all.y[0];
    const struct mipmap_level *from = mipmap_part(
        m, k - 1, (struct extent){{2 * x, 2 * all.x[1]}, {2 * y, 2 * all.y[1]}});

    crop_halve(m->block + (l->rgb - m->block) + 3 * (y * l->W + x),
               from->rgb + 6 * (y * from->W + x), all.x[1] - x, all.y[1] - y,
               3 * l->W, 3 * from->W);
    l->made = all;
    return l;
}

const struct mipmap_level *mipmap_whole(struct mipmap *m, size_t k)
{
    const struct mipmap_level *l = m->level + k;

    return mipmap_part(m, k, (struct extent){{0, l->W}, {0, l->H}});
}

/* Pixels of a line of `length` that a square's side and its border lie on. */
static void mipmap_range(size_t range[2], double centre, double size,
                         size_t length)
{
    const double lo = floor(centre - size / 2) - BORDER;
    const double hi = ceil(centre + size / 2) + BORDER;

    range[0] = (size_t)fmin(fmax(lo, 0), (double)length);
    range[1] = (size_t)fmin(fmax(hi, (double)range[0]), (double)length);
}

void mipmap_sample(float *out, size_t n, struct mipmap *m, struct square q)
{
    const struct mipmap_level *l;
    struct extent part;
    size_t k = 0;

    for (; q.size > 2 * (double)n && k + 1 < m->levels; k++)
        q = (struct square){q.x / 2, q.y / 2, q.size / 2};
    l = m->level + k;
    mipmap_range(part.x, q.x, q.size, l->W);
    mipmap_range(part.y, q.y, q.size, l->H);
    l = mipmap_part(m, k, part);
    crop_sample_u8(out, n, l->rgb, l->W, l->H, 3 * l->W, q);
}
