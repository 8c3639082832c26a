/* Window, matte and resizing of a labelled picture, with what the matting
 * leaves out grown back. */
#include "lib/lab/fit/portrait.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/layers.h"
#include "formats/matte.h"
#include "lib/photo/network_matte.h"
#include "lib/photo/overlay.h"

int portrait_init(struct portrait *p, size_t size, struct error *err)
{
    const size_t n = size * size;

    *p = (struct portrait){.size = size};
    p->rgb = malloc(3 * n);
    p->mask = malloc(n);
    p->back = malloc(3 * n);
    p->alone = malloc(3 * n);
    p->scratch = malloc(2 * n);
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

/* Mask and back from the posed head's silhouette, by the matte network where it
 * is there and sees somebody, else by GrabCut. */
static int portrait_estimate(struct portrait *p, const uint8_t *silhouette,
                             const uint8_t *inside, struct error *err)
{
    bool absurd = true, fallback;

    if (p->net && p->size >= MATTE_SIDE &&
        network_matte(p->mask, &absurd, p->rgb, silhouette, inside, p->size,
                      p->net, err))
        return -1;
    if (absurd && matte_grabcut(p->mask, &fallback, p->rgb, silhouette, inside,
                                p->size, err))
        return -1;
    for (size_t i = 0; i < p->size * p->size; i++)
        if (!inside[i])
            p->mask[i] = 0;
    return layers_split(p->mask, p->back, p->rgb, inside, p->size, err);
}

/* Mask and back by the colour of a plain wall, else estimated. */
static int portrait_split(struct portrait *p, const uint8_t *silhouette,
                          const uint8_t *inside, struct error *err)
{
    bool plain;

    if (matte_wall(p->mask, &plain, p->rgb, silhouette, inside, p->size, err))
        return -1;
    p->plain = plain;
    if (!plain)
        return portrait_estimate(p, silhouette, inside, err);
    if (layers_fill(p->back, p->rgb, p->mask, inside, p->size, err))
        return -1;
    for (size_t i = 0; i < p->size * p->size; i++)
        if (!inside[i])
            memcpy(p->rgb + 3 * i, p->back + 3 * i, 3);
    return 0;
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
                 const struct motion *m, struct error *err)
{
    const size_t n = p->size * p->size;
    uint8_t *silhouette = p->scratch, *inside = silhouette + n;

    if (crop_resize_u8(p->rgb, p->size, rgb, W, H, 3 * W, 3, window))
        return error_set(err, EX_OSERR, "out of memory (window)");
    square_inside(inside, p->size, W, H, window);
    if (portrait_silhouette(silhouette, p->size, id, m, err) ||
        portrait_split(p, silhouette, inside, err))
        return -1;
    portrait_part(p);
    return 0;
}
