/* The window's layers, cut out one by one, and put together again. */
#include "lib/lab/data/portrait_sample.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/data/clutter.h"

/* Layers of the window, n x n pixels each. */
struct portrait_layers {
    size_t n;
    float *memory;
    float *picture;     /* (n,n,4) colours and mask */
    float *person;      /* (n,n,4) colours times mask, and the mask */
    float *behind;      /* (n,n,4) another picture */
    float *truth;       /* (n,n,4) 1 where hidden, 1 inside */
    float *wall;        /* (n,n,3) */
    float *row;         /* (n,3) */
};

/* All planes in one block. */
static int portrait_init(struct portrait_layers *p, size_t n, struct error *err)
{
    const size_t plane = 4 * n * n;

    *p = (struct portrait_layers){.n = n};
    p->memory = malloc((4 * plane + 3 * n * n + 3 * n) * sizeof *p->memory);
    if (!p->memory)
        return error_set(err, EX_OSERR, "out of memory (portrait of %zu)", n);
    p->picture = p->memory;
    p->person = p->picture + plane;
    p->behind = p->person + plane;
    p->truth = p->behind + plane;
    p->wall = p->truth + plane;
    p->row = p->wall + 3 * n * n;
    return 0;
}

/* ---- what is cut -------------------------------------------------------- */

/* Mostly a window about the face, else one about the picture.  The tracker's is
 * about the head (lib/track/window.h). */
static struct square portrait_window(const struct data_frame *f, float jitter,
                                     struct random *r)
{
    double size = (double)f->size, j = (double)jitter, wander = 0.04 * j;
    struct square q = {0.5 * size, 0.5 * size, size};

    if (jitter > 0 && random_chance(r, 0.7))
        q = window_from_crop(f->crop);
    if (q.size > 1.3 * size)
        q.size = 1.3 * size;
    q.size *= exp(j * random_range(r, -0.25, 0.15));
    q.x += wander * random_normal(r) * q.size;
    q.y += wander * random_normal(r) * q.size;
    return q;
}

/* A part of what stands behind. */
static struct square portrait_behind(const struct data_frame *f,
                                     struct random *r)
{
    const double w = (double)f->width, h = (double)f->height;
    const double side = fmin(w, h) * random_range(r, 0.25, 1);

    return (struct square){
        (double)f->x0 + random_range(r, side / 2, w - side / 2),
        (double)f->y0 + random_range(r, side / 2, h - side / 2), side};
}

/* The row of the window's n that the chin is in, by the face crop. */
static float portrait_chin(const struct data_frame *f, struct square q,
                           size_t n)
{
    double chin = f->crop.y + 0.5 * f->crop.size / CROP_GROW;

    return (float)((chin - q.y + 0.5 * q.size) / q.size * (double)n);
}

/* The four numbers of a pixel of the person's layer, or of the truth's. */
static void portrait_person_pixel(uint8_t to[4], const struct data_frame *f,
                                  size_t i)
{
    const uint8_t *p = f->rgba + 4 * i;

    for (size_t c = 0; c < 3; c++)
        to[c] = f->alone ? f->alone[3 * i + c]
                         : (uint8_t)((p[c] * p[3] + 127) / 255);
    to[3] = p[3];
}

/* As a layer: what hides the person, and whether the truth is known here. */
static void portrait_truth_pixel(uint8_t to[4], const struct data_frame *f,
                                 size_t i)
{
    to[0] = f->hidden && f->hidden[i] ? 255 : 0;
    to[1] = 255;
    to[2] = to[3] = 0;
}

/* A layer of f, made pixel by pixel, in the window. */
static int portrait_cut(float *layer, size_t n, const struct data_frame *f,
                        struct square q,
                        void pixel(uint8_t *, const struct data_frame *,
                                   size_t), struct error *err)
{
    const size_t count = f->size * f->size;
    struct data_frame made = *f;
    int rc;

    made.rgba = malloc(4 * count);
    if (!made.rgba)
        return error_set(err, EX_OSERR, "out of memory (picture of %zu)",
                         f->size);
    for (size_t i = 0; i < count; i++)
        pixel(made.rgba + 4 * i, f, i);
    rc = data_sample_plain(layer, n, &made, q, err);
    free(made.rgba);
    return rc;
}

/* ---- what stands behind ------------------------------------------------- */

/* A colour that the person has at the outline: what stands behind there is
 * hardest to tell from hair and cloth of its own colour. */
static void portrait_own_colour(float own[3], const struct portrait_layers *p,
                                struct random *r)
{
    const size_t n = p->n, near = n / 16 + 1;

    memset(own, 0, 3 * sizeof *own);
    for (int tries = 0; tries < 400; tries++) {
        const size_t y = random_below(r, (uint32_t)n);
        const size_t x = near + random_below(r, (uint32_t)(n - 2 * near));
        const size_t beside = x - near + random_below(r, 2 * (uint32_t)near);
        const float *at = p->person + 4 * (y * n + x);

        if (at[3] < 0.98f || p->person[4 * (y * n + beside) + 3] > 0.02f)
            continue;
        memcpy(own, at, 3 * sizeof *own);
        return;
    }
}

/* Colours that slope and ripple a little. */
static void portrait_plain_wall(struct portrait_layers *p, const float own[3],
                                struct random *r)
{
    const size_t n = p->n;
    float base[3], dx[3], dy[3], kx, ky, ripple;
    float slope = random_float(r, 0, 0.4);
    bool wears = random_chance(r, 0.5);

    for (int c = 0; c < 3; c++) {
        base[c] = wears ? own[c] + 0.05f * (float)random_normal(r)
                        : random_float(r, 0, 1);
        dx[c] = slope * random_float(r, -1, 1);
        dy[c] = slope * random_float(r, -1, 1);
    }
    kx = random_float(r, -0.3, 0.3);
    ky = random_float(r, -0.3, 0.3);
    ripple = random_chance(r, 0.5) ? random_float(r, 0, 0.15) : 0;
    for (size_t i = 0; i < n * n; i++) {
        float x = (float)(i % n), y = (float)(i / n), side = (float)n;
        float w = ripple > 0 ? ripple * sinf(kx * x + ky * y) : 0;

        for (size_t c = 0; c < 3; c++)
            p->wall[3 * i + c] = base[c] + dx[c] * (x / side - 0.5f) +
                                 dy[c] * (y / side - 0.5f) + w;
    }
}

/* `behind`, shifted and beside itself; somebody's picture turned over. */
static void portrait_picture_wall(struct portrait_layers *p, bool somebody,
                                  struct random *r)
{
    const size_t n = p->n;
    size_t shift = somebody ? random_below(r, (uint32_t)n) : 0;
    bool over = somebody && random_chance(r, 0.7);

    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            size_t from = (over ? n - 1 - y : y) * n + (x + shift) % n;
            memcpy(p->wall + 3 * (y * n + x), p->behind + 4 * from,
                   3 * sizeof *p->wall);
        }
}

/* Plain, a picture, or clutter; every other one out of focus. */
static void portrait_draw_wall(struct portrait_layers *p, bool somebody,
                               struct random *r)
{
    const double pictures = somebody ? 0.35 : 0.65;
    const struct clutter_patch patch = {p->behind, p->n, 4};
    double kind = random_uniform(r);
    float own[3];

    portrait_own_colour(own, p, r);
    if (kind < 0.25)
        portrait_plain_wall(p, own, r);
    else if (kind < pictures)
        portrait_picture_wall(p, somebody, r);
    else
        clutter_paint(p->wall, p->n, &patch, own, r);
    if (kind > 0.25 && random_chance(r, 0.5)) {
        size_t radius = 1 + random_below(r, 1 + (uint32_t)p->n / 40);
        clutter_blur(p->wall, p->row, p->n, radius);
        clutter_blur(p->wall, p->row, p->n, radius);
    }
}

/* ---- together ----------------------------------------------------------- */

/* Clothes dyed: what is below the chin and about as coloured as a pixel at the
 * bottom becomes another colour, striped one time in three. */
static void portrait_recolour_clothes(struct portrait_layers *p, float chin,
                                      struct random *r)
{
    const size_t n = p->n;
    const float *cloth = NULL;
    float gain[3], kx = random_float(r, -1, 1), ky = random_float(r, -1, 1);
    float stripe = random_chance(r, 0.33) ? random_float(r, 0.1, 0.5) : 0;

    for (int tries = 0; tries < 20 && !cloth; tries++) {
        size_t row = n - 1 - random_below(r, 1 + (uint32_t)n / 8);
        const float *at = p->person + 4 * (row * n +
                                           random_below(r, (uint32_t)n));
        cloth = at[3] > 0.98f ? at : NULL;
    }
    if (!cloth)
        return;
    float was[3] = {cloth[0], cloth[1], cloth[2]};
    for (int c = 0; c < 3; c++)
        gain[c] = fminf(random_float(r, 0.02, 1) / (was[c] + 0.02f), 3);
    for (size_t y = chin > 0 ? (size_t)chin : 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            float *at = p->person + 4 * (y * n + x), far = 0;
            float w = fminf(((float)y - chin) * 12 / (float)n, 1);
            float wave = sinf(kx * (float)x + ky * (float)y);

            for (size_t c = 0; c < 3; c++)
                far += (at[c] - was[c] * at[3]) * (at[c] - was[c] * at[3]);
            w *= expf(-12 * far);
            for (size_t c = 0; c < 3; c++) {
                float dyed = gain[c] * (1 + (wave > 0 ? stripe : -stripe));
                at[c] = fminf(at[c] * (1 + w * (dyed - 1)), at[3]);
            }
        }
}

/* Another light on the person: a gain for each colour, and a curve. */
struct light {
    float gain[3], curve;
};

/* How the light on the person differs from the wall's. */
static void portrait_light_draw(struct light *l, float amount, struct random *r)
{
    float all = expf(amount * random_float(r, -0.5, 0.3));

    for (int c = 0; c < 3; c++)
        l->gain[c] = all * expf(amount * random_float(r, -0.15, 0.15));
    l->curve = amount * random_float(r, -0.5, 0.5);
}

/* to: colour c of the person's layer in that light, times the mask m. */
static float portrait_light_on(const struct light *l, float x, float m,
                               size_t c)
{
    float v = m > 0.004f ? fminf(x / m * l->gain[c], 1) : 0;

    return m * (v + l->curve * v * (1 - v));
}

/* The portrait's picture into p->picture: the person before the wall, and
 * what hides them as it was. */
static void portrait_compose(struct portrait_layers *p, const struct light *l)
{
    for (size_t i = 0; i < p->n * p->n; i++) {
        const float *own = p->person + 4 * i, *truth = p->truth + 4 * i;
        float *to = p->picture + 4 * i, open = truth[1] * (1 - truth[0]);

        for (size_t c = 0; c < 3; c++) {
            float x = portrait_light_on(l, own[c], own[3], c) +
                      (1 - own[3]) * truth[1] * p->wall[3 * i + c];
            to[c] += open * (x - to[c]);
        }
    }
}

/* The photograph ends where its frame does, or sooner, while the person goes
 * on: beyond it are its last pixels. */
static void portrait_end(struct portrait_layers *p, bool sooner,
                         struct random *r)
{
    const size_t n = p->n, room = n * 28 / 100;
    struct extent e = {{n, 0}, {n, 0}};

    for (size_t i = 0; i < n * n; i++)
        if (p->truth[4 * i + 1] > 0.99f) {
            const size_t u = i % n, v = i / n;

            e.x[0] = u < e.x[0] ? u : e.x[0];
            e.x[1] = u >= e.x[1] ? u + 1 : e.x[1];
            e.y[0] = v < e.y[0] ? v : e.y[0];
            e.y[1] = v >= e.y[1] ? v + 1 : e.y[1];
        }
    for (int k = 0; k < 4 && sooner; k++) {
        const size_t cut = random_below(r, (uint32_t)room + 1);
        size_t *end = k < 2 ? e.x : e.y;

        if (!random_chance(r, 0.4))
            continue;
        if (k % 2)
            end[1] = end[1] < n - cut ? end[1] : n - cut;
        else
            end[0] = end[0] > cut ? end[0] : cut;
    }
    extent_repeat_edges(p->picture, n, 4, e);
}

/* p->picture with its colours changed: rgb (n,n,3). */
static int portrait_finish(float *rgb, const struct portrait_layers *p,
                           bool mirror, const struct data_augment *how,
                           struct random *r, struct error *err)
{
    const struct data_augment colours = {.colour = how->colour};
    const size_t n = p->n;
    const double side = (double)n;
    struct data_frame made = {.size = n, .width = n, .height = n};
    int rc;

    made.rgba = malloc(4 * n * n);
    if (!made.rgba)
        return error_set(err, EX_OSERR, "out of memory (portrait of %zu)", n);
    for (size_t i = 0; i < n * n; i++) {
        size_t x = i % n, from = mirror ? i - x + n - 1 - x : i;
        for (size_t c = 0; c < 4; c++) {
            float v = p->picture[4 * from + c];
            made.rgba[4 * i + c] = (uint8_t)(255 * fminf(fmaxf(v, 0), 1) +
                                             0.5f);
        }
    }
    rc = data_sample(rgb, n, &made,
                     (struct square){side / 2, side / 2, side}, &colours, r,
                     err);
    free(made.rgba);
    return rc;
}

/* Coverage, and 0 for the weight of pixels whose truth is not known. */
static void portrait_truth(float *alpha, float *weight,
                           const struct portrait_layers *p, bool mirror)
{
    const size_t n = p->n;

    for (size_t i = 0; i < n * n; i++) {
        size_t x = i % n, from = mirror ? i - x + n - 1 - x : i;
        const float *truth = p->truth + 4 * from;

        alpha[i] = p->person[4 * from + 3];
        weight[i] = truth[0] > 0.01f || truth[1] < 0.99f ? 0 : 1;
    }
}

int portrait_sample(float *rgb, float *alpha, float *weight, size_t n,
                    const struct data_frame *f,
                    const struct data_frame *behind,
                    const struct data_augment *how, struct random *r,
                    struct error *err)
{
    const struct square q = portrait_window(f, how->jitter, r);
    const bool somebody = behind->crop.size > 0;
    bool mirror = random_chance(r, 0.5);
    struct portrait_layers p;
    struct light l;
    int rc = -1;

    if (portrait_init(&p, n, err))
        return -1;
    if (data_sample_plain(p.picture, n, f, q, err) ||
        portrait_cut(p.person, n, f, q, portrait_person_pixel, err) ||
        portrait_cut(p.truth, n, f, q, portrait_truth_pixel, err))
        goto out;
    if (random_uniform(r) < (double)how->background) {
        if (data_sample_plain(p.behind, n, behind,
                              portrait_behind(behind, r), err))
            goto out;
        portrait_draw_wall(&p, somebody, r);
        if (how->colour > 0 && random_chance(r, 0.5))
            portrait_recolour_clothes(&p, portrait_chin(f, q, n), r);
        portrait_light_draw(&l, how->colour, r);
        portrait_compose(&p, &l);
    }
    portrait_end(&p, how->jitter > 0 && random_chance(r, 0.5), r);
    portrait_truth(alpha, weight, &p, mirror);
    rc = portrait_finish(rgb, &p, mirror, how, r, err);
out:
    free(p.memory);
    return rc;
}
