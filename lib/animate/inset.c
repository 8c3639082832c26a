/* Setting a driven portrait into the whole photograph (inset.h). */
#include "lib/animate/inset.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/base/parallel.h"

/* In windows: over how much of it what moves comes to rest towards an edge,
 * and over how much it fades into the photograph. */
#define INSET_HOLD_SIDE 0.12
#define INSET_HOLD_BELOW 0.25
#define INSET_FADE 0.02

/* ---- edges ------------------------------------------------------------- */

/* 0 at 0 to 1 at 1, smooth. */
static float inset_step(double x)
{
    x = x < 0 ? 0 : x > 1 ? 1 : x;
    return (float)(x * x * (3 - 2 * x));
}

/* ramp (n) of so much of the length at both ends; none where an end is not
 * inside the photograph, for nothing goes on there. */
static void inset_ramp(float *ramp, size_t n, double begin, double end)
{
    for (size_t i = 0; i < n; i++) {
        double at = ((double)i + 0.5) / (double)n;
        float a = begin > 0 ? inset_step(at / begin) : 1;
        float b = end > 0 ? inset_step((1 - at) / end) : 1;

        ramp[i] = a < b ? a : b;
    }
}

/* No ramp towards edges that the photograph ends before: there is nothing to
 * go over into. */
static void inset_edges(struct inset *s)
{
    const long w = (long)s->width;
    const bool left = s->left > 0, above = s->top > 0;
    const bool right = s->left + w < (long)s->photo->width;
    const bool below = s->top + w < (long)s->photo->height;

    inset_ramp(s->hold, s->side, left * INSET_HOLD_SIDE,
               right * INSET_HOLD_SIDE);
    inset_ramp(s->fade, s->side, left * INSET_FADE, right * INSET_FADE);
    inset_ramp(s->hold_y, s->side, above * INSET_HOLD_SIDE,
               below * INSET_HOLD_BELOW);
    inset_ramp(s->fade_y, s->side, above * INSET_FADE, below * INSET_FADE);
}

/* ---- setting up -------------------------------------------------------- */

/* The portrait and its background, N by N. */
static int inset_copy_person(struct inset *s, const struct person *p,
                             struct error *err)
{
    struct person q;

    if (!p->back)
        return error_set(err, EX_DATAERR, "source picture without its "
                         "background (expected SRCI back)");
    if (person_resize(&q, p, s->side, err))
        return -1;
    s->rest = q.rgb;
    s->back = q.back;
    q.rgb = q.back = NULL;
    person_release(&q);
    return 0;
}

int inset_init(struct inset *s, const struct image *photo,
               const struct person *p, size_t side, struct error *err)
{
    const double half = (double)p->crop[2] / 2;

    memset(s, 0, sizeof *s);
    s->photo = photo;
    s->side = side;
    s->left = lround((double)p->crop[0] - half);
    s->top = lround((double)p->crop[1] - half);
    s->width = (size_t)lround(fmax((double)p->crop[2], 0));
    if (s->width < 2 || s->left >= (long)photo->width ||
        s->top >= (long)photo->height || s->left + (long)s->width <= 0 ||
        s->top + (long)s->width <= 0)
        return error_set(err, EX_DATAERR, "the portrait window lies outside "
                         "of a picture of %zu x %zu pixels", photo->width,
                         photo->height);
    s->block = malloc(4 * side * sizeof *s->block);
    if (!s->block) {
        inset_release(s);
        return error_set(err, EX_OSERR, "no memory for the photograph");
    }
    s->hold = s->block;
    s->fade = s->hold + side;
    s->hold_y = s->fade + side;
    s->fade_y = s->hold_y + side;
    inset_edges(s);
    if (inset_copy_person(s, p, err)) {
        inset_release(s);
        return -1;
    }
    return 0;
}

void inset_release(struct inset *s)
{
    free(s->rest);
    free(s->back);
    free(s->block);
    memset(s, 0, sizeof *s);
}

int inset_scratch_init(struct inset_scratch *w, const struct inset *s,
                       struct error *err)
{
    memset(w, 0, sizeof *w);
    w->change = malloc(3 * s->side * s->side * sizeof *w->change);
    nn_plan_init(&w->plan, (struct nn_options){NN_INFER, NN_F32});
    if (s->width != s->side) {
        w->sized = malloc(3 * s->width * s->width * sizeof *w->sized);
        rescale_plan(&w->resize, &w->plan, RESCALE_ANTIALIAS, 1, s->side,
                     s->side, s->width, s->width, 3);
    }
    if (w->change && (s->width == s->side || w->sized) &&
        !nn_plan_finish(&w->plan, NULL))
        return 0;
    inset_scratch_release(w);
    return error_set(err, EX_OSERR, "no memory for the photograph");
}

void inset_scratch_release(struct inset_scratch *w)
{
    free(w->change);
    free(w->sized);
    nn_plan_release(&w->plan);
    memset(w, 0, sizeof *w);
}

/* ---- a frame ----------------------------------------------------------- */

/* pivot in the picture, -1 to 1; returns its depth. */
static float inset_project(float at[2], const float pivot[3],
                           const float cam[12])
{
    float x[3];

    camera_apply(x, cam, pivot);
    x[2] = fmaxf(x[2], CAMERA_NEAR);
    at[0] = CAMERA_FOCAL * x[0] / x[2];
    at[1] = CAMERA_FOCAL * x[1] / x[2];
    return x[2];
}

struct inset_motion inset_motion(const float pivot[3], const float stay[3],
                                 const float source[12], const float cam[12])
{
    const float now[3] = {pivot[0] + stay[0], pivot[1] + stay[1],
                          pivot[2] + stay[2]};
    struct inset_motion m;
    float from[2], to[2];
    float zs = inset_project(from, pivot, source);
    float z = inset_project(to, now, cam);

    m.scale = zs / z;
    for (int i = 0; i < 2; i++)
        m.move[i] = to[i] - m.scale * from[i];
    return m;
}

/* out (4): colour and alpha at x, y in pixels of the driven portrait. */
static void inset_sample(float out[4], const struct inset *s,
                         const float *color, const float *alpha, float x,
                         float y)
{
    const float end = (float)s->side - 1;
    const float u = fminf(fmaxf(x, 0), end), v = fminf(fmaxf(y, 0), end);
    const size_t x0 = (size_t)u, y0 = (size_t)v;
    const size_t x1 = x0 + (x0 + 1 < s->side), y1 = y0 + (y0 + 1 < s->side);
    const float a = u - (float)x0, b = v - (float)y0;
    const size_t at[4] = {y0 * s->side + x0, y0 * s->side + x1,
                          y1 * s->side + x0, y1 * s->side + x1};
    const float w[4] = {(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b};

    memset(out, 0, 4 * sizeof *out);
    for (int k = 0; k < 4; k++) {
        for (size_t c = 0; c < 3; c++)
            out[c] += w[k] * color[3 * at[k] + c];
        out[3] += w[k] * alpha[at[k]];
    }
}

/* change (3) of pixel x, y of the portrait, in levels. */
static void inset_change(float change[3], const struct inset *s,
                         const float *color, const float *alpha, size_t x,
                         size_t y, const struct inset_motion *m)
{
    const float n = (float)s->side, rest = 1 - s->hold[x] * s->hold_y[y];
    const float fade = s->fade[x] * s->fade_y[y];
    const size_t i = y * s->side + x;
    float driven[4] = {color[3 * i], color[3 * i + 1], color[3 * i + 2],
                       alpha[i]};

    if (rest > 0) {
        float px = (2 * (float)x + 1) / n - 1, py = (2 * (float)y + 1) / n - 1;
        float dx = (m->scale - 1) * px + m->move[0];
        float dy = (m->scale - 1) * py + m->move[1];

        inset_sample(driven, s, color, alpha,
                     (float)x + rest * dx * n / 2,
                     (float)y + rest * dy * n / 2);
    }
    for (size_t c = 0; c < 3; c++) {
        float v = 255 * driven[c] + (1 - driven[3]) * s->back[3 * i + c];

        v = fminf(fmaxf(v, 0), 255);
        change[c] = fade * (v - s->rest[3 * i + c]);
    }
}

/* The photograph's pixels under the window, changed. */
static void inset_add(uint8_t *out, const struct inset *s, const float *change)
{
    const long w = (long)s->width, W = (long)s->photo->width;

    for (long y = 0; y < w; y++)
        for (long x = 0; x < w; x++) {
            long u = x + s->left, v = y + s->top;

            if (u < 0 || v < 0 || u >= W || v >= (long)s->photo->height)
                continue;
            uint8_t *p = out + 3 * (v * W + u);
            const float *d = change + 3 * (y * w + x);
            for (int c = 0; c < 3; c++) {
                float t = (float)p[c] + d[c] + 0.5f;

                p[c] = (uint8_t)(t < 0 ? 0 : t > 255 ? 255 : t);
            }
        }
}

/* One row. */
PARALLEL(inset_draw_part, y, const struct inset *, s, struct inset_scratch *, w,
         const float *, color, const float *, alpha,
         const struct inset_motion *, m)
{
    for (size_t x = 0; x < s->side; x++)
        inset_change(w->change + 3 * (y * s->side + x), s, color, alpha, x, y,
                     m);
}

void inset_draw(uint8_t *out, const struct inset *s, struct inset_scratch *w,
                const float *color, const float *alpha,
                const struct inset_motion *m)
{
    const float *change = w->change;

    memcpy(out, s->photo->rgb, 3 * s->photo->width * s->photo->height);

    parallel_each(inset_draw_part, s->side, 1, s, w, color, alpha, m);
    if (w->sized) {
        rescale_forward(w->sized, w->change, &w->resize);
        change = w->sized;
    }
    inset_add(out, s, change);
}
