/* Window, matte and resizing of a labelled picture, with what the matting
 * leaves out grown back. */
#include "lib/lab/fit/portrait.h"

#include <sysexits.h>

#include "lib/photo/matte.h"
#include "lib/photo/overlay.h"

/* Mean certainty of a mask, of 255, from which on its wall is plain. */
#define PLAIN 252

int portrait_init(struct portrait *p, size_t size, struct error *err)
{
    const size_t n = size * size;

    *p = (struct portrait){.size = size};
    p->rgb = arena_take(&p->memory, n, 3);
    p->mask = arena_take(&p->memory, n, 1);
    p->back = arena_take(&p->memory, n, 3);
    p->alone = arena_take(&p->memory, n, 3);
    p->confidence = arena_take(&p->memory, n, 1);
    p->head = arena_take(&p->memory, MATTE_SIDE * MATTE_SIDE, 1);
    return arena_check(&p->memory, "a picture", err);
}

void portrait_release(struct portrait *p)
{
    arena_release(&p->memory);
    *p = (struct portrait){0};
}

/* 255 where the head that m poses id into lands. */
static int portrait_silhouette(uint8_t *silhouette, size_t size,
                               const struct identity *id,
                               const struct motion *m, struct error *err)
{
    struct overlay o = {0};

    if (overlay_init(&o, id, err))
        return -1;
    overlay_silhouette(silhouette, &o, m, size);
    overlay_release(&o);
    return 0;
}

/* Mean certainty of a mask, 0 to 255, where the picture is. */
static double portrait_certainty(const struct matting *m)
{
    double sum = 0, all = 0;

    for (size_t i = 0; i < m->n * m->n; i++) {
        sum += m->confidence[i];
        all += extent_has(&m->inside, i % m->n, i / m->n);
    }
    return all > 0 ? sum / all : 0;
}

/* The person over black: what of rgb is not what the matte lets through. */
static void portrait_part(struct portrait *p)
{
    for (size_t i = 0; i < p->size * p->size; i++)
        for (size_t c = 3 * i; c < 3 * i + 3; c++) {
            int m = p->mask[i], over = (255 - m) * p->back[c] + 127;
            int own = p->rgb[c] - over / 255;

            p->alone[c] = (uint8_t)(own < 0 ? 0 : own > m ? m : own);
        }
}

int portrait_cut(struct portrait *p, const uint8_t *rgb, size_t W, size_t H,
                 struct square window, const struct identity *id,
                 const struct motion *motion, struct error *err)
{
    const size_t n = p->size * p->size;
    struct matting m = {p->size, square_extent(p->size, W, H, window), p->rgb,
                        p->mask, p->confidence, p->back};
    bool seen;

    if (crop_resize_u8(p->rgb, p->size, rgb, W, H, 3 * W, 3, window))
        return error_set(err, EX_OSERR, "out of memory (window)");
    if (portrait_silhouette(p->head, MATTE_SIDE, id, motion, err) ||
        matte_find(&m, &seen, p->head, p->net, false, err))
        return -1;
    p->plain = portrait_certainty(&m) >= PLAIN;
    for (size_t i = 0; i < n; i++)
        if (!extent_has(&m.inside, i % p->size, i / p->size))
            p->mask[i] = 0;
    portrait_part(p);
    return 0;
}
