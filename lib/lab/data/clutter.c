/* Shapes upon shapes, the largest first. */
#include "lib/lab/data/clutter.h"

#include <math.h>
#include <string.h>

enum shape_form { SHAPE_BOX, SHAPE_OVAL, SHAPE_BAR, SHAPE_FORMS };
enum shape_fill {
    FILL_SLOPE, FILL_STRIPES, FILL_RIPPLE, FILL_PATCH,
    FILL_GRAIN                  /* streaks, as wood, curtains and hair have */
};

struct shape {
    enum shape_form form;
    enum shape_fill fill;
    float x, y, half[2], c, s;  /* pixels; cosine and sine of its turn */
    float base[3], second[3];   /* colours; second: what is added at its end */
    float ku, kv, phase;        /* of stripes and ripples, 1 / pixels */
    float px, py, zoom;         /* where in the patch; pixels a pixel */
    float rim;                  /* how much darker the last pixels are */
};

/* A share `wears` has the person's own colour, the rest any: a matte must not
 * go by colour alone. */
static void clutter_shape_colour(struct shape *h, const float own[3],
                                 float wears, struct random *r)
{
    float grey = random_float(r, 0, 1), vivid = random_float(r, 0, 1);
    bool same = random_chance(r, (double)wears);

    for (int c = 0; c < 3; c++) {
        float any = random_float(r, 0, 1);
        h->base[c] = same ? own[c] + random_float(r, -0.08, 0.08)
                          : grey + vivid * vivid * (any - grey);
        h->second[c] = random_float(r, -0.12, 0.12);
    }
    grey = random_float(r, -0.25, 0.25);
    for (int c = 0; c < 3; c++)
        h->second[c] += grey;
}

/* Size by a power law, about upright more often than not. */
static void clutter_shape_place(struct shape *h, size_t n, float largest,
                                struct random *r)
{
    const float side = (float)n;
    float size = largest * side * powf(random_float(r, 0.02, 1), 1.2f);
    float turn = random_chance(r, 0.6) ? random_float(r, -0.06, 0.06)
                                       : random_float(r, -1.6, 1.6);
    float flat = expf(random_float(r, -1, 1));

    h->form = (enum shape_form)random_below(r, SHAPE_FORMS);
    h->x = random_float(r, -0.1, 1.1) * side;
    h->y = random_float(r, -0.1, 1.1) * side;
    h->half[0] = size * flat;
    h->half[1] = size / flat;
    if (h->form == SHAPE_BAR) {
        h->half[0] = random_float(r, 0.4, 0.02 * (double)side + 0.5);
        h->half[1] = random_float(r, 0.1, 0.8) * side;
        turn += random_chance(r, 0.5) ? 1.5708f : 0;
    }
    h->c = cosf(turn);
    h->s = sinf(turn);
}

/* Place, colours and filling, all at random. */
static void clutter_shape_draw(struct shape *h, size_t n, float largest,
                               const struct clutter_patch *patch,
                               const float own[3], float wears,
                               struct random *r)
{
    float fill = random_float(r, 0, 1);
    float wave = expf(random_float(r, -3.2, 0.3));

    clutter_shape_place(h, n, largest, r);
    clutter_shape_colour(h, own, wears, r);
    h->fill = fill < 0.35f ? FILL_SLOPE
              : fill < 0.45f ? FILL_STRIPES
              : fill < 0.65f ? FILL_GRAIN
              : fill < 0.8f || !patch->rgb ? FILL_RIPPLE : FILL_PATCH;
    h->ku = wave * random_float(r, -1, 1);
    h->kv = wave * random_float(r, -1, 1);
    h->phase = random_float(r, 0, 6.28);
    h->px = random_float(r, 0, (double)patch->n);
    h->py = random_float(r, 0, (double)patch->n);
    h->zoom = random_float(r, -1.5, 1.5);
    h->rim = random_chance(r, 0.4) ? random_float(r, -0.2, 0.4) : 0;
}

/* A patch's colours, back and forth at its borders. */
static const float *clutter_patch_at(const struct clutter_patch *p, float x,
                                     float y)
{
    const float n = (float)p->n;
    float u = fabsf(fmodf(x, 2 * n)), v = fabsf(fmodf(y, 2 * n));

    u = fminf(u < n ? u : 2 * n - u, n - 1);
    v = fminf(v < n ? v : 2 * n - v, n - 1);
    return p->rgb + p->step * ((size_t)v * p->n + (size_t)u);
}

/* Noise of period 1 between whole numbers, -1 to 1. */
static float clutter_noise(float x)
{
    const float cell = floorf(x), t = x - cell;
    float end[2];

    for (int i = 0; i < 2; i++) {
        uint32_t k = (uint32_t)((int32_t)cell + i) * 0x9e3779b9u;

        k = (k ^ k >> 15) * 0x85ebca6bu;
        k = (k ^ k >> 13) * 0xc2b2ae35u;
        end[i] = (float)(k >> 8) / 0x800000p0f - 1;
    }
    return end[0] + t * (end[1] - end[0]);
}

/* Streaks along v, which wander: four octaves of noise across them. */
static float clutter_grain(const struct shape *h, float u, float v)
{
    const float wander = 3 * sinf(0.03f * v + h->phase);
    float x = (u + wander) * (0.05f + 0.1f * fabsf(h->ku)), w = 0, a = 0.6f;

    for (int octave = 0; octave < 4; octave++, x *= 2.3f, a *= 0.7f)
        w += a * clutter_noise(x + 100 * h->phase);
    return w;
}

/* The shape's colour at (u,v), pixels along its own axes. */
static void clutter_shape_at(float to[3], const struct shape *h,
                             const struct clutter_patch *patch, float u,
                             float v)
{
    float w = 0.5f * v / h->half[1];

    if (h->fill == FILL_STRIPES)
        w = sinf(h->ku * u + h->kv * v + h->phase) > 0 ? 0.8f : -0.8f;
    if (h->fill == FILL_RIPPLE)
        w = sinf(h->ku * u + h->phase + 2 * sinf(h->kv * v));
    if (h->fill == FILL_GRAIN)
        w = clutter_grain(h, u, v);
    for (int c = 0; c < 3; c++)
        to[c] = h->base[c] + w * h->second[c];
    if (h->fill == FILL_PATCH)
        memcpy(to,
               clutter_patch_at(patch, h->px + h->zoom * u,
                                h->py + h->zoom * v),
               3 * sizeof *to);
}

/* How deep inside the shape (u,v) lies, pixels or so; negative outside. */
static float clutter_shape_depth(const struct shape *h, float u, float v)
{
    float a = fabsf(u) / h->half[0], b = fabsf(v) / h->half[1];

    if (h->form == SHAPE_OVAL)
        return (1 - sqrtf(a * a + b * b)) * fminf(h->half[0], h->half[1]);
    return fminf((1 - a) * h->half[0], (1 - b) * h->half[1]);
}

static size_t clutter_clip(float x, size_t n)
{
    return x < 0 ? 0 : x > (float)n ? n : (size_t)x;
}

/* Over the wall, antialiased at its edge, which may be darker or paler. */
static void clutter_shape_paint(float *wall, size_t n, const struct shape *h,
                                const struct clutter_patch *patch)
{
    float rx = fabsf(h->c) * h->half[0] + fabsf(h->s) * h->half[1] + 1;
    float ry = fabsf(h->s) * h->half[0] + fabsf(h->c) * h->half[1] + 1;
    size_t x0 = clutter_clip(h->x - rx, n), x1 = clutter_clip(h->x + rx + 1, n);
    size_t y0 = clutter_clip(h->y - ry, n), y1 = clutter_clip(h->y + ry + 1, n);

    for (size_t y = y0; y < y1; y++)
        for (size_t x = x0; x < x1; x++) {
            float dx = (float)x - h->x, dy = (float)y - h->y, rgb[3];
            float u = h->c * dx + h->s * dy, v = h->c * dy - h->s * dx;
            float depth = clutter_shape_depth(h, u, v) + 0.5f;
            float a = fminf(depth, 1);
            float *to = wall + 3 * (y * n + x);

            if (a <= 0)
                continue;
            clutter_shape_at(rgb, h, patch, u, v);
            for (int c = 0; c < 3; c++) {
                float shade = depth < 3 ? rgb[c] * (1 - h->rim) : rgb[c];
                to[c] += a * (fminf(fmaxf(shade, 0), 1) - to[c]);
            }
        }
}

void clutter_paint(float *wall, size_t n, const struct clutter_patch *patch,
                   const float own[3], struct random *r)
{
    uint32_t count = 2 + random_below(r, random_chance(r, 0.5) ? 12 : 59);
    float wears = random_float(r, 0, 0.6);
    struct shape h;

    clutter_shape_draw(&h, n, 1, patch, own, wears, r);
    h.form = SHAPE_BOX;
    h.half[0] = h.half[1] = 4 * (float)n;
    /* shapes are mixed with what is there, the first one, too */
    memset(wall, 0, 3 * n * n * sizeof *wall);
    clutter_shape_paint(wall, n, &h, patch);
    for (uint32_t i = 0; i < count; i++) {
        float left = 1 - (float)i / (float)count;

        clutter_shape_draw(&h, n, 0.08f + 0.5f * left * left, patch, own,
                           wears, r);
        clutter_shape_paint(wall, n, &h, patch);
    }
}

/* Of one line of n pixels, `step` numbers apart. */
static void clutter_blur_line(float *line, size_t step, float *row, size_t n,
                              size_t radius)
{
    float sum[3] = {0};

    for (size_t i = 0; i < n; i++)
        memcpy(row + 3 * i, line + step * i, 3 * sizeof *row);
    for (size_t i = 0; i < n + radius; i++) {
        for (size_t c = 0; c < 3; c++) {
            if (i < n)
                sum[c] += row[3 * i + c];
            if (i > 2 * radius)
                sum[c] -= row[3 * (i - 2 * radius - 1) + c];
        }
        if (i < radius)
            continue;
        size_t at = i - radius, lo = at > radius ? at - radius : 0;
        size_t hi = at + radius < n ? at + radius : n - 1;
        for (size_t c = 0; c < 3; c++)
            line[step * at + c] = sum[c] / (float)(hi - lo + 1);
    }
}

void clutter_blur(float *wall, float *row, size_t n, size_t radius)
{
    for (size_t y = 0; y < n; y++)
        clutter_blur_line(wall + 3 * n * y, 3, row, n, radius);
    for (size_t x = 0; x < n; x++)
        clutter_blur_line(wall + 3 * x, 3 * n, row, n, radius);
}
