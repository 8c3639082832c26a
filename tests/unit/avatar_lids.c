/* Closed lids of the shipped head: dark above, as under a brow, and bright
 * below, they come out dark at the crease, bright further down, and with a line
 * of lashes; nothing else changes, and a face that is not trusted is left
 * alone. */
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/eyes.h"
#include "lib/base/densify.h"
#include "tests/check.h"

#define HEAD_NAME "examples/model/head.safetensors"
#define SHADE 0.3f
#define SKIN 0.7f
#define PHOTO 0.6f              /* what the photograph shows at the lids */

/* Mean of rgb (V+E,3) over the lids' Gaussians that come down by lo to hi of
 * the most and are (not) of the margin. */
static double lid_mean(const float *rgb, const struct head *h,
                       const struct head_avatar *w, const struct densify *d,
                       double lo, double hi, bool margin)
{
    double sum = 0, n = 0, max = 0;

    for (size_t v = 0; v < d->V; v++)
        max = fmax(max, -h->l_eyelid[3 * v + 1]);
    for (size_t v = 0; v < d->V; v++) {
        double down = -(h->l_eyelid[3 * v + 1] + h->r_eyelid[3 * v + 1]);

        if (w->lid[v] > 0 && (w->fold[v] < w->lid[v]) == margin &&
            down >= lo * max && down <= hi * max) {
            sum += rgb[3 * v];
            n++;
        }
    }
    return n > 0 ? sum / n : NAN;
}

/* A grey photograph: shade above the eyes' middle, skin below it. */
static void lid_photograph(float *pixel, float *trust, float *rgb,
                           const float *verts, const struct head_avatar *w,
                           size_t D)
{
    double y = 0, n = 0;

    for (size_t k = 0; k < D; k++) {
        y += w->lid[k] * (double)verts[3 * k + 1];
        n += w->lid[k];
    }
    for (size_t k = 0; k < D; k++)
        for (int c = 0; c < 4; c++) {
            bool lid = w->lid[k] > 0;
            float level = lid ? PHOTO : verts[3 * k + 1] > y / n ? SHADE
                                                                 : SKIN;

            pixel[4 * k + c] = c < 3 ? level : 1;
            trust[k] = 1 - w->lid[k];
            if (c < 3)
                rgb[3 * k + c] = lid ? SHADE : level;
        }
}

static double lid_largest_change(const float *a, const float *b,
                                 const struct head_avatar *w, size_t D,
                                 bool on_lids)
{
    double max = 0;

    for (size_t k = 0; k < D; k++)
        if ((w->lid[k] > 0) == on_lids)
            max = fmax(max, fabs((double)a[3 * k] - b[3 * k]));
    return max;
}

/* How wide the left margin is, of how wide the lid is that comes down. */
static double lid_margin_width(const struct head *h,
                               const struct head_avatar *w)
{
    double lid[2] = {1e6, -1e6}, margin[2] = {1e6, -1e6};

    for (size_t v = 0; v < h->V; v++) {
        double x = h->v_template[3 * v];

        if (x < 0 || w->lid[v] < 1)
            continue;
        lid[0] = fmin(lid[0], x);
        lid[1] = fmax(lid[1], x);
        if (w->fold[v] < 1) {
            margin[0] = fmin(margin[0], x);
            margin[1] = fmax(margin[1], x);
        }
    }
    return (margin[1] - margin[0]) / (lid[1] - lid[0]);
}

int main(void)
{
    struct densify d;
    struct error err = {0};
    struct head h;

    if (head_load(&h, HEAD_NAME, &err) ||
        densify_init(&d, h.f, h.F, h.V, &err)) {
        check_error("the shipped head", false, &err);
        return check_status();
    }
    const size_t D = d.V + d.E;
    float *block = malloc(15 * D * sizeof *block), *verts = block;
    float *pixel = verts + 3 * D, *trust = pixel + 4 * D;
    float *before = trust + D, *rgb = before + 3 * D, *tmp = rgb + 3 * D;
    const struct eyes_photo source = {pixel, trust, NULL};

    if (!block)
        return 1;
    densify_forward(verts, h.v_template, &d, 3);
    lid_photograph(pixel, trust, before, verts, &h.avatar, D);
    memcpy(rgb, before, 3 * D * sizeof *rgb);
    eyes_paint_lids(rgb, &source, &h.avatar, tmp);
    expect("at the crease", lid_mean(rgb, &h, &h.avatar, &d, 0, 0.15, false), SHADE,
           0.06);
    check_range("further down", lid_mean(rgb, &h, &h.avatar, &d, 0.6, 0.9, false),
                SHADE + 0.15, SKIN);
    check_range("lashes", lid_mean(rgb, &h, &h.avatar, &d, 0.5, 1, true), 0.05,
                0.5 * SKIN);
    check_range("of the lid's width there are lashes",
                lid_margin_width(&h, &h.avatar), 0.75, 1);
    expect("beside the lids", lid_largest_change(rgb, before, &h.avatar, D, false), 0,
           0);
    memset(trust, 0, D * sizeof *trust);
    memcpy(rgb, before, 3 * D * sizeof *rgb);
    eyes_paint_lids(rgb, &source, &h.avatar, tmp);
    expect("nothing trusted", lid_largest_change(rgb, before, &h.avatar, D, true), 0,
           0);
    free(block);
    densify_release(&d);
    head_release(&h);
    return check_status();
}
