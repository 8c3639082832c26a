/* Window, matte and resizing of a labelled picture, with what the matting
 * leaves out grown back. */
#include "lib/lab/fit/portrait.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/photo/matte.h"
#include "lib/photo/overlay.h"

/* Mean certainty of a mask, of 255, from which on its wall is plain. */
#define PLAIN 252

int portrait_init(struct portrait *p, size_t size, struct error *err)
{
    const size_t n = size * size;

    *p = (struct portrait){.size = size};
    p->rgb = malloc(3 * n);
    p->mask = malloc(n);
    p->back = malloc(3 * n);
    p->alone = malloc(3 * n);
    p->scratch = malloc(2 * n + MATTE_SIDE * MATTE_SIDE);
    if (p->rgb && p->mask && p->back && p->alone && p->scratch)
        return 0;
    portrait_release(p);
    return error_set(err, EX_OSERR, "out of memory (picture of %zux%zu)",
                     size, size);
}

void portrait_release(struct portrait *p)
{
    free(p->rgb);
    free(p->mask);
    free(p->back);
    free(p->alone);
    free(p->scratch);
    memset(p, 0, sizeof *p);
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
        all += m->inside[i] > 0;
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
    uint8_t *confidence = p->scratch, *inside = confidence + n, *head = inside + n;
    struct matting m = {p->size, p->rgb, inside, p->mask, confidence, p->back};
    bool seen;

    if (crop_resize_u8(p->rgb, p->size, rgb, W, H, 3 * W, 3, window))
        return error_set(err, EX_OSERR, "out of memory (window)");
    square_inside(inside, p->size, W, H, window);
    if (portrait_silhouette(head, MATTE_SIDE, id, motion, err) ||
        matte_find(&m, &seen, head, p->net, false, err))
        return -1;
    p->plain = portrait_certainty(&m) >= PLAIN;
    for (size_t i = 0; i < n; i++)
        if (!inside[i])
            p->mask[i] = 0;
    portrait_part(p);
    return 0;
}
