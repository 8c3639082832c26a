/* The double-precision reference, third part: Eq. C, sum_i c_i w_i with w_i =
 * alpha_i prod_j<i (1 - alpha_j), pixel by pixel. */
#include "lib/splat/reference.h"

#include <stdlib.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/splat/reference_traversal.h"

/* Colours, alpha and depth of one pixel from its contributions. */
static void reference_sum_pixel(double *image, double *alpha, double *depth,
                                const struct contribution *found, size_t count,
                                double T, const struct traversal *w)
{
    const struct reference *t = w->scene;
    size_t C = (size_t)t->channels;
    double weight = 0, sum_z = 0;

    for (size_t c = 0; c < C; c++)
        image[c] = T * t->background[c];
    for (size_t k = 0; k < count; k++) {
        double wt = found[k].alpha * found[k].T;

        weight += wt;
        sum_z += wt * w->point[found[k].i].z;
        for (size_t c = 0; c < C; c++)
            image[c] += wt * t->color[found[k].i * C + c];
    }
    if (alpha)
        *alpha = 1 - T;
    if (depth)
        *depth = weight > 0 ? sum_z / weight : 0;
}

/* Row y of the picture; room (parallel_width(), longest) for lists. */
PARALLEL(reference_draw_row, y, double *, image, double *, alpha,
         double *, depth, uint8_t *, ambiguous, const struct traversal *, w,
         struct contribution *, room, size_t, longest)
{
    struct contribution *found = room + parallel_slot() * longest;
    const struct reference *t = w->scene;

    for (int x = 0; x < t->width; x++) {
        size_t at = y * (size_t)t->width + (size_t)x;
        uint8_t flag = 0;
        double T;
        size_t count =
            traversal_pixel(found, &T, ambiguous ? &flag : NULL, w, x, (int)y);

        reference_sum_pixel(image + at * (size_t)t->channels,
                            alpha ? alpha + at : NULL,
                            depth ? depth + at : NULL, found, count, T, w);
        if (ambiguous)
            ambiguous[at] = flag;
    }
}


/* Rows in parallel: no pixel depends on another. */
int reference_forward(double *image, double *alpha, double *depth,
                      uint8_t *ambiguous, const struct reference *t,
                      struct error *err)
{
    struct traversal w;

    if (traversal_init(&w, t, err))
        return -1;
    const size_t longest = traversal_longest(&w) + 1;
    struct contribution *found =
        calloc((size_t)parallel_width() * longest, sizeof *found);
    if (found)
        parallel_each(reference_draw_row, (size_t)t->height, 1, image, alpha,
                      depth, ambiguous, &w, found, longest);
    traversal_release(&w);
    if (!found)
        return error_set(err, EX_OSERR, "out of memory");
    free(found);
    return 0;
}
