/* Window, matte and resizing of a labelled picture, with what the matting
 * leaves out grown back. */
#include "lib/fit/portrait.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/layers.h"
#include "formats/matte.h"
#include "lib/track/overlay.h"

int portrait_init(struct portrait *p, size_t size, struct error *err)
{
    const size_t n = size * size;

    *p = (struct portrait){.size = size};
    p->rgb = malloc(3 * n);
    p->mask = malloc(n);
    p->back = malloc(3 * n);
    p->scratch = malloc(2 * n);
    if (p->rgb && p->mask && p->back && p->scratch)
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
    free(p->scratch);
    memset(p, 0, sizeof *p);
}

/* GrabCut's mask from the posed head's silhouette. */
static int portrait_mask(struct portrait *p, uint8_t *silhouette,
                         const uint8_t *inside, const struct identity *id,
                         const struct motion *m, struct error *err)
{
    struct overlay o = {0};
    int fallback, rc;

    if (overlay_init(&o, id, err))
        return -1;
    overlay_silhouette(silhouette, &o, m, p->size);
    overlay_release(&o);
    rc = matte_grabcut(p->mask, &fallback, p->rgb, silhouette, inside,
                       p->size, err);
    for (size_t i = 0; !rc && i < p->size * p->size; i++)
        if (!inside[i])
            p->mask[i] = 0;
    return rc;
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
    if (portrait_mask(p, silhouette, inside, id, m, err))
        return -1;
    return layers_split(p->mask, p->back, p->rgb, inside, p->size, err);
}
