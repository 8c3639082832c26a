/* Drawing from the data: crops, their labels, and changed pictures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/base/quad.h"
#include "lib/lab/data/data.h"

void data_random(struct random *r, uint64_t seed, uint64_t step,
                 uint64_t item)
{
    random_init(r, seed, "training item");
    r->key = random_mix(random_mix(r->key ^ random_mix(step)) + item);
    r->next = 0;
}

struct square data_jitter(const struct data_frame *f, float jitter,
                          struct random *r)
{
    struct square q = f->crop;

    /* most crops are second looks, which the first has put right */
    if (random_uniform(r) < 0.6)
        jitter *= 0.25f;
    q.x += jitter * 0.05 * random_normal(r) * f->crop.size;
    q.y += jitter * 0.05 * random_normal(r) * f->crop.size;
    q.size *= exp(jitter * 0.07 * random_normal(r));
    return q;
}

void data_net_translation(double tnet[3], const struct data_frame *f,
                          struct square q)
{
    double t[3] = {f->motion.t[0], f->motion.t[1], f->motion.t[2]};

    crop_translation_inverse(tnet, t, q, (double)f->size,
                             camera_focal((float)f->size));
}

/* A quad is red, green, blue and the mask of a pixel. */
typedef int32_t mask4 __attribute__((vector_size(16)));

/* ---- backgrounds ------------------------------------------------------- */

/* A background: a plane of colours with a slope, plus waves. */
struct backdrop {
    quad base, dx, dy, wave;
    float kx, ky, phase;
};

/* Another background: flat, sloping or wavy, one in five black. */
static void sample_draw_backdrop(struct backdrop *b, struct random *r)
{
    float busy = (float)random_uniform(r);

    for (int c = 0; c < 3; c++) {
        b->base[c] = (float)random_uniform(r);
        b->dx[c] = (float)random_range(r, -0.5, 0.5) * busy;
        b->dy[c] = (float)random_range(r, -0.5, 0.5) * busy;
        b->wave[c] = (float)random_range(r, -0.4, 0.4) * busy;
    }
    b->kx = (float)random_range(r, -25, 25);
    b->ky = (float)random_range(r, -25, 25);
    b->phase = (float)random_range(r, 0, 6.28);
    if (random_uniform(r) < 0.2)
        memset(b, 0, sizeof *b);
}

/* To [0,1]. */
static inline quad sample_clamp(quad x)
{
    const quad one = {1, 1, 1, 1};
    mask4 in = (mask4)x & (x > 0), over = x > 1;

    return (quad)((in & ~over) | ((mask4)one & over));
}

/* ---- sampling ---------------------------------------------------------- */

/* Bilinear taps of one axis: two pixels (or -1 outside) and the weight of
 * the second. */
struct tap {
    long a, b;
    float w;
};

/* Taps of n pixels along a side about a centre. */
static void sample_make_taps(struct tap *t, size_t n, double centre,
                             double side, size_t first, size_t count)
{
    for (size_t i = 0; i < n; i++) {
        double p = centre + side * (((double)i + 0.5) / (double)n - 0.5) -
                   0.5 - (double)first;
        double low = floor(p);
        long a = (long)low;
        t[i].w = (float)(p - low);
        t[i].a = a >= 0 && a < (long)count ? a : -1;
        t[i].b = a + 1 >= 0 && a + 1 < (long)count ? a + 1 : -1;
    }
}

typedef uint8_t byte4 __attribute__((vector_size(4)));

/* The four numbers of pixel x of a row, 0 to 255; zeros outside. */
static inline quad sample_pixel(const uint8_t *row, long x)
{
    byte4 p = {0, 0, 0, 0};

    if (x >= 0)
        memcpy(&p, row + 4 * x, sizeof p);
    return __builtin_convertvector(p, quad);
}

/* out (n,4) = row y of the frame at the taps; zeros outside. */
static void sample_row(quad *out, size_t n, const struct data_frame *f,
                       long y, const struct tap *tx)
{
    const uint8_t *row = f->rgba + 4 * (size_t)y * f->width;

    if (y < 0) {
        memset(out, 0, n * sizeof *out);
        return;
    }
    for (size_t x = 0; x < n; x++) {
        float w = tx[x].w;
        out[x] = sample_pixel(row, tx[x].a) * (1 - w) +
                 sample_pixel(row, tx[x].b) * w;
    }
}

/* Colours and mask (n,n,4) of the square, black outside.  rows (2,n): the two
 * rows of the frame that a row of the square lies between, kept for the
 * next. */
static void sample_plain(quad *out, size_t n, const struct data_frame *f,
                         struct square q, struct tap *tx, struct tap *ty,
                         quad *rows)
{
    quad *top = rows, *low = rows + n;
    long have_top = -2, have_low = -2;      /* -1 is a row: outside */

    sample_make_taps(tx, n, q.x, q.size, f->x0, f->width);
    sample_make_taps(ty, n, q.y, q.size, f->y0, f->height);
    for (size_t y = 0; y < n; y++) {
        float wy = ty[y].w;

        if (ty[y].a != have_top && ty[y].a == have_low) {
            quad *swap = top;
            top = low;
            low = swap;
            have_low = have_top;
            have_top = ty[y].a;
        }
        if (ty[y].a != have_top)
            sample_row(top, n, f, have_top = ty[y].a, tx);
        if (ty[y].b != have_low)
            sample_row(low, n, f, have_low = ty[y].b, tx);
        for (size_t x = 0; x < n; x++)
            out[y * n + x] = (top[x] * (1 - wy) + low[x] * wy) * (1.0f / 255);
    }
}

/* Two rows' pixels of a frame, weighed; the border goes on beyond it. */
static quad sample_point(const struct data_frame *f, double x, double y)
{
    const long w = (long)f->width - 1, h = (long)f->height - 1;
    const double px = x - 0.5 - (double)f->x0, py = y - 0.5 - (double)f->y0;
    const double left = floor(px), top = floor(py);
    const float u = (float)(px - left), v = (float)(py - top);
    quad row[2];

    for (long i = 0; i < 2; i++) {
        long at = (long)top + i;
        long a = (long)left, b = a + 1;

        at = at < 0 ? 0 : at > h ? h : at;
        a = a < 0 ? 0 : a > w ? w : a;
        b = b < 0 ? 0 : b > w ? w : b;
        const uint8_t *p = f->rgba + 4 * (size_t)at * f->width;
        row[i] = sample_pixel(p, a) * (1 - u) + sample_pixel(p, b) * u;
    }
    return row[0] * (1 - v) + row[1] * v;
}

/* sample_plain of a turned frame. */
static void sample_rotated(quad *out, size_t n, const struct data_frame *f,
                           struct square q)
{
    const double c = cos(f->turn), s = sin(f->turn);
    const double middle = 0.5 * (double)f->size, step = q.size / (double)n;

    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            double px = q.x - middle + step * ((double)x + 0.5) - q.size / 2;
            double py = q.y - middle + step * ((double)y + 0.5) - q.size / 2;

            out[y * n + x] = (1.0f / 255) *
                sample_point(f, middle + c * px + s * py,
                             middle - s * px + c * py);
        }
}

/* Behind the mask. */
static void sample_replace_background(quad *rgba, size_t n, struct random *r)
{
    struct backdrop b;

    sample_draw_backdrop(&b, r);
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            quad *o = rgba + y * n + x;
            float m = (*o)[3];
            float u = (float)x / (float)n - 0.5f;
            float v = (float)y / (float)n - 0.5f;
            if (m >= 1)
                continue;
            float s = sinf(b.kx * u + b.ky * v + b.phase);
            *o = m * *o + (1 - m) * sample_clamp(b.base + b.dx * u + b.dy * v +
                                                 b.wave * s);
        }
}

/* Gain, gamma by a curve, saturation and noise. */
static void sample_change_colours(quad *rgba, size_t n, float amount,
                                  struct random *r)
{
    quad gain = {0};
    float curve = amount * (float)random_range(r, -0.5, 0.5);
    float bright = 1 + amount * (float)random_range(r, -0.35, 0.3);
    float grey = amount * (float)random_range(r, -0.2, 0.6);
    float noise = amount * 0.06f * (float)random_uniform(r);
    uint64_t key = random_u64(r);

    noise *= noise < amount * 0.03f ? 0 : 1;   /* half of them have none */
    if (random_uniform(r) < 0.7)
        grey = 0;
    for (int c = 0; c < 3; c++)
        gain[c] = bright * (1 + amount * (float)random_range(r, -0.12, 0.12));
    for (size_t i = 0; i < n; i++) {
        quad p = rgba[i], x;
        float luma = 0.3f * p[0] + 0.59f * p[1] + 0.11f * p[2];

        x = sample_clamp((p + grey * (luma - p)) * gain);
        x += curve * x * (1 - x);
        if (noise > 0) {
            uint64_t dice = random_mix(key + i);
            mask4 part = {dice & 0x1fffff, dice >> 21 & 0x1fffff,
                          dice >> 42 & 0x1fffff, 0};
            x += noise * (__builtin_convertvector(part, quad) *
                          (1.0f / 1048576) - 1);
        }
        rgba[i] = sample_clamp(x);
    }
}

/* Three-tap blur along rows, then columns: softer pictures. */
static void sample_soften(quad *rgba, size_t n, float w)
{
    for (size_t y = 0; y < n; y++) {
        quad *p = rgba + y * n, before = p[0];

        for (size_t x = 0; x + 1 < n; x++) {
            quad here = p[x];
            p[x] = (1 - 2 * w) * here + w * (before + p[x + 1]);
            before = here;
        }
    }
    for (size_t x = 0; x < n; x++) {
        quad *p = rgba + x, before = p[0];

        for (size_t y = 0; y + 1 < n; y++, p += n) {
            quad here = p[0];
            p[0] = (1 - 2 * w) * here + w * (before + p[n]);
            before = here;
        }
    }
}

/* Room for a square of n x n pixels with its two rows of the frame, and the
 * square in it; the caller frees.  NULL and *err. */
static quad *sample_square(size_t n, const struct data_frame *f,
                           struct square q, struct error *err)
{
    struct tap *tx = malloc(2 * n * sizeof *tx);
    quad *rgba = aligned_alloc(64, ((n + 2) * n * sizeof *rgba + 63) / 64 *
                                       64);

    if (tx && rgba && f->turn != 0) {
        sample_rotated(rgba, n, f, q);
    } else if (tx && rgba) {
        sample_plain(rgba, n, f, q, tx, tx + n, rgba + n * n);
    } else {
        error_set(err, EX_OSERR, "out of memory (crop of %zu)", n);
        free(rgba);
        rgba = NULL;
    }
    free(tx);
    return rgba;
}

int data_sample(float *rgb, size_t n, const struct data_frame *f,
                struct square q, const struct data_augment *how,
                struct random *r, struct error *err)
{
    quad *rgba = sample_square(n, f, q, err);

    if (!rgba)
        return -1;
    if (how && random_uniform(r) < how->background)
        sample_replace_background(rgba, n, r);
    if (how && how->colour > 0) {
        float w = how->colour * (float)random_range(r, -0.3, 0.25);
        if (w > 0)
            sample_soften(rgba, n, w);
        sample_change_colours(rgba, n * n, how->colour, r);
    }
    for (size_t i = 0; i < n * n; i++)
        memcpy(rgb + 3 * i, rgba + i, 3 * sizeof *rgb);
    free(rgba);
    return 0;
}

int data_sample_plain(float *rgba, size_t n, const struct data_frame *f,
                      struct square q, struct error *err)
{
    quad *own = sample_square(n, f, q, err);

    if (!own)
        return -1;
    memcpy(rgba, own, n * n * sizeof *own);
    free(own);
    return 0;
}

int data_crop(void *frame, float *rgb, struct square q, struct error *err)
{
    return data_sample(rgb, CROP_NET, frame, q, NULL, NULL, err);
}

int data_portrait(float *rgb, float *mask, size_t n,
                  const struct data_frame *f, struct error *err)
{
    size_t k = n ? f->size / n : 0;
    float part;

    if (!k || k * n != f->size || f->width != f->size ||
        f->height != f->size)
        return error_set(err, EX_DATAERR, "pictures of %zux%zu (expected a "
                         "multiple of %zu)", f->size, f->size, n);
    part = 1 / (255 * (float)(k * k));
    memset(rgb, 0, 3 * n * n * sizeof *rgb);
    if (mask)
        memset(mask, 0, n * n * sizeof *mask);
    for (size_t y = 0; y < f->size; y++)
        for (size_t x = 0; x < f->size; x++) {
            const uint8_t *p = f->rgba + 4 * (y * f->size + x);
            const uint8_t *own = f->alone ? f->alone + 3 * (y * f->size + x)
                                          : NULL;
            size_t o = y / k * n + x / k;
            float m = (float)p[3] * part;
            for (int c = 0; c < 3; c++)
                rgb[3 * o + c] += own ? part * (float)own[c]
                                      : m * (float)p[c] * (1.0f / 255);
            if (mask)
                mask[o] += m;
        }
    return 0;
}

/* Whether something hides the person within EXCUSE pixels of (x,y). */
static bool sample_is_hidden(const struct data_frame *f, size_t x, size_t y)
{
    enum { EXCUSE = 2 };
    size_t y0 = y > EXCUSE ? y - EXCUSE : 0, x0 = x > EXCUSE ? x - EXCUSE : 0;

    for (size_t v = y0; v <= y + EXCUSE && v < f->size; v++)
        for (size_t u = x0; u <= x + EXCUSE && u < f->size; u++)
            if (f->hidden[v * f->size + u])
                return true;
    return false;
}

bool data_mask_occluded(float *target, const float *drawn, size_t channels,
                        size_t n, const struct data_frame *f)
{
    size_t k = n ? f->size / n : 0;

    if (!f->hidden || !k)
        return false;
    for (size_t i = 0; i < n * n; i++) {
        size_t x = i % n * k + k / 2, y = i / n * k + k / 2;

        if (sample_is_hidden(f, x, y))
            memcpy(target + channels * i, drawn + channels * i,
                   channels * sizeof *target);
    }
    return true;
}
