/* White by the eyeballs and the palest skin. */
#include "lib/avatar/white_point.h"

#include <math.h>
#include <stdbool.h>

#include "lib/avatar/branch.h"

#define LIGHT 1.3f      /* of eyeballs, which lids shade, to white */
#define EYES 8          /* visible vertices of eyeballs that suffice */

/* rgb (3): mean colour of the vertices of a region (any: -1) that the picture
 * shows, as bright as `min` and more; returns their weight. */
static float white_point_mean(float rgb[3],
                              const struct white_point_colors *seen,
                              const struct head *h, int region, float min)
{
    for (size_t v = 0; v < h->V; v++)
        seen->tmp[v] = seen->trust[v] > 0.2f &&
                       (region < 0 || (h->region && h->region[v] == region))
                     ? seen->trust[v] : 0;
    return branch_mean_color(rgb, seen->pixel, seen->tmp, h->V, min);
}

void white_point(float white[3], const struct white_point_colors *seen,
                 const struct head *h)
{
    static const float pale[3] = {0.9f, 0.78f, 0.68f};
    float skin[3], gray = 0;
    float n = white_point_mean(white, seen, h, REGION_EYEBALL, 0);
    const bool eyes = n > EYES;

    for (int i = 0; i < 2 && eyes; i++)
        white_point_mean(white, seen, h, REGION_EYEBALL,
                         (white[0] + white[1] + white[2]) / 3);
    if (!eyes)
        white_point_mean(white, seen, h, -1, 0);
    for (int c = 0; c < 3; c++)
        gray += white[c] / 3;
    white_point_mean(skin, seen, h, REGION_FACE, 0);
    for (int c = 0; c < 3; c++) {   /* less of its tint: skin is tan */
        white[c] = fmaxf(LIGHT * (0.7f * white[c] + 0.3f * gray),
                         skin[c] / pale[c]);
        white[c] = fminf(fmaxf(white[c], 0.2f), 1);
    }
}
