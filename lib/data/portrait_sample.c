/* Other backgrounds at the picture's own size, then a cut like any other. */
#include "lib/data/portrait_sample.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

/* What stands behind: a picture, or colours that slope and ripple. */
struct wall {
    const struct data_frame *picture;   /* NULL: colours, 0 to 255 */
    float base[3], dx[3], dy[3], ripple, kx, ky;
};

/* A colour that the person wears or is. */
static void wall_own_colour(float base[3], const struct data_frame *f,
                            struct random *r)
{
    const uint32_t n = (uint32_t)(f->size * f->size);

    for (int tries = 0; tries < 50; tries++) {
        const uint8_t *p = f->rgba + 4 * random_below(r, n);

        for (int c = 0; c < 3; c++)
            base[c] = (float)p[c] + 12 * (float)random_normal(r);
        if (p[3] > 250)
            return;
    }
}

static void wall_draw(struct wall *w, const struct data_frame *f,
                      const struct data_frame *behind, struct random *r)
{
    double kind = random_uniform(r);
    float slope = kind < 0.4 ? 30 : 100;

    memset(w, 0, sizeof *w);
    if (kind > 0.7 && behind != f) {
        w->picture = behind;
        return;
    }
    for (int c = 0; c < 3; c++) {
        w->base[c] = 255 * (float)random_uniform(r);
        w->dx[c] = slope * (float)random_range(r, -1, 1);
        w->dy[c] = slope * (float)random_range(r, -1, 1);
    }
    if (kind < 0.4)
        wall_own_colour(w->base, f, r);
    else
        w->ripple = 40 * (float)random_uniform(r);
    w->kx = (float)random_range(r, -0.3, 0.3);
    w->ky = (float)random_range(r, -0.3, 0.3);
}

/* The wall's colour at pixel (x,y) of a picture of `size`. */
static float wall_at(const struct wall *w, size_t x, size_t y, size_t size,
                     int c)
{
    float u = (float)x / (float)size - 0.5f, v = (float)y / (float)size - 0.5f;
    float wave = w->ripple > 0 ? w->ripple * sinf(w->kx * (float)x +
                                                  w->ky * (float)y) : 0;

    if (w->picture) {
        size_t n = w->picture->size;
        size_t px = x * n / size, py = (size - 1 - y) * n / size;
        return (float)w->picture->rgba[4 * (py * n + px) + (size_t)c];
    }
    return w->base[c] + w->dx[c] * u + w->dy[c] * v + wave;
}

/* f's person before the wall, at pixel i. */
static void portrait_paint(uint8_t *to, const struct data_frame *f, size_t i,
                           const struct wall *w)
{
    const uint8_t *p = f->rgba + 4 * i;
    float m = (float)p[3] / 255;

    for (int c = 0; c < 3; c++) {
        float own = f->alone ? (float)f->alone[3 * i + (size_t)c]
                             : m * (float)p[c];
        float x = own + (1 - m) * wall_at(w, i % f->size, i / f->size,
                                          f->size, c);
        to[c] = (uint8_t)(fminf(fmaxf(x, 0), 255) + 0.5f);
    }
}

/* picture and truth (size,size,4): the portrait's colours; what hides the
 * person (0, 255) as red, with the mask.  w NULL: their own background. */
static void portrait_compose(uint8_t *picture, uint8_t *truth,
                             const struct data_frame *f,
                             const struct wall *w, bool mirror)
{
    const size_t n = f->size;

    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            size_t i = y * n + x;
            size_t o = 4 * (mirror ? y * n + n - 1 - x : i);
            bool hidden = f->hidden && f->hidden[i];

            memcpy(picture + o, f->rgba + 4 * i, 4);
            if (w && !hidden)
                portrait_paint(picture + o, f, i, w);
            truth[o] = hidden ? 255 : 0;
            truth[o + 1] = truth[o + 2] = 0;
            truth[o + 3] = f->rgba[4 * i + 3];
        }
}

/* A window about the picture, as a tracker's might lie about a face. */
static struct square portrait_window(const struct data_frame *f, float jitter,
                                     struct random *r)
{
    double size = (double)f->size, j = (double)jitter;
    struct square q = {0.5 * size, 0.5 * size, size};

    q.x += 0.06 * j * random_normal(r) * size;
    q.y += 0.06 * j * random_normal(r) * size;
    q.size *= exp(j * random_range(r, -0.3, 0.25));
    return q;
}

int portrait_sample(float *rgb, float *alpha, float *weight, size_t n,
                    const struct data_frame *f,
                    const struct data_frame *behind,
                    const struct data_augment *how, struct random *r,
                    struct error *err)
{
    const size_t pixels = f->size * f->size;
    const struct data_augment colours = {.colour = how->colour};
    struct data_frame shown = *f, truth = *f;
    float *plain = malloc(4 * n * n * sizeof *plain);
    int rc = -1;

    shown.rgba = malloc(4 * pixels);
    truth.rgba = malloc(4 * pixels);
    if (!plain || !shown.rgba || !truth.rgba) {
        error_set(err, EX_OSERR, "out of memory (portrait of %zu)", n);
        goto out;
    }
    struct square q = portrait_window(f, how->jitter, r);
    bool mirror = random_chance(r, 0.5);
    bool other = random_uniform(r) < (double)how->background;
    struct wall w;
    wall_draw(&w, f, behind, r);
    portrait_compose(shown.rgba, truth.rgba, f, other ? &w : NULL, mirror);
    if (data_sample(rgb, n, &shown, q, &colours, r, err) ||
        data_sample_plain(plain, n, &truth, q, err))
        goto out;
    for (size_t i = 0; i < n * n; i++) {
        weight[i] = plain[4 * i] > 0 ? 0 : 1;
        alpha[i] = plain[4 * i + 3];
    }
    rc = 0;
out:
    free(plain);
    free(shown.rgba);
    free(truth.rgba);
    return rc;
}
