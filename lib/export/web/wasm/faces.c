/* The first crop (formats/facedetect.h) by the page's own cascade: the worker's
 * Module.faces(pixels, W, H) lists squares, the largest first. */
#include <emscripten.h>

#include "formats/facedetect.h"

/* How many of at most `max` faces went to face (x, y, size each). */
EM_JS(int, faces_find, (double *face, int max, const uint8_t *rgb, int W, int H), {
    const found = Module.faces(HEAPU8.subarray(rgb, rgb + 3 * W * H), W, H).slice(0, max);
    found.forEach(({ x, y, size }, i) => HEAPF64.set([x, y, size], face / 8 + 3 * i));
    return found.length;
})

struct facedetect *facedetect_open(struct error *err)
{
    static char any;

    (void)err;
    return (struct facedetect *)&any;
}

void facedetect_close(struct facedetect *d)
{
    (void)d;
}

size_t facedetect_find(struct facedetect *d, struct square *face, size_t max,
                       enum facedetect_size size, bool certain,
                       struct mipmap *picture)
{
    const struct mipmap_level *l = picture->level;

    _Static_assert(sizeof *face == 3 * sizeof(double), "x, y, size");
    (void)d;
    (void)certain;
    if (size == FACEDETECT_SMALL)       /* its one search was made */
        return 0;
    return (size_t)faces_find(&face->x, (int)max, l->rgb, (int)l->W, (int)l->H);
}
