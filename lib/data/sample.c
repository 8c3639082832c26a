/* Drawing from the data: crops, their labels, and changed pictures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/geom/camera.h"
#include "lib/data/data.h"

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
    double t[3] = {f->motion.trans[0], f->motion.trans[1],
                   f->motion.trans[2]};

    crop_translation_inverse(tnet, t, q, (double)f->size,
                             camera_focal((float)f->size));
}

/* ---- backgrounds ------------------------------------------------------- */

/* A background: a plane of colours with a slope, plus waves. */
struct backdrop {
    float base[3], dx[3], dy[3], wave[3], kx, ky, phase;
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
static float sample_clamp(float x)
{
    return x < 0 ? 0 : x > 1 ? 1 : x;
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

typedef float float4 __attribute__((vector_size(16)));
typedef uint8_t byte4 __attribute__((vector_size(4)));

/* The four numbers of a pixel, 0 to 255; zeros outside. */
static inline float4 sample_pixel(const struct data_frame *f, long y, long x)
{
    byte4 p = {0, 0, 0, 0};

    if (x >= 0 && y >= 0)
        memcpy(&p, f->rgba + 4 * ((size_t)y * f->width + (size_t)x),
               sizeof p);
    return __builtin_convertvector(p, float4);
}

/* Colours and mask (n,n,4) of the square, black outside. */
static void sample_plain(float *out, size_t n, const struct data_frame *f,
                         struct square q, struct tap *tx, struct tap *ty)
{
    sample_make_taps(tx, n, q.x, q.size, f->x0, f->width);
    sample_make_taps(ty, n, q.y, q.size, f->y0, f->height);
    for (size_t y = 0; y < n; y++) {
        float wy = ty[y].w;
        for (size_t x = 0; x < n; x++) {
            float wx = tx[x].w;
            float4 top = sample_pixel(f, ty[y].a, tx[x].a) * (1 - wx) +
                         sample_pixel(f, ty[y].a, tx[x].b) * wx;
            float4 low = sample_pixel(f, ty[y].b, tx[x].a) * (1 - wx) +
                         sample_pixel(f, ty[y].b, tx[x].b) * wx;
            float4 v = (top * (1 - wy) + low * wy) * (1.0f / 255);
            memcpy(out + 4 * (y * n + x), &v, sizeof v);
        }
    }
}

/* Behind the mask. */
static void sample_replace_background(float *rgba, size_t n, struct random *r)
{
    struct backdrop b;

    sample_draw_backdrop(&b, r);
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            float *o = rgba + 4 * (y * n + x), m = o[3];
            float u = (float)x / (float)n - 0.5f;
            float v = (float)y / (float)n - 0.5f;
            float s = m < 1 ? sinf(b.kx * u + b.ky * v + b.phase) : 0;
            for (int c = 0; c < 3; c++)
                o[c] = m * o[c] +
                       (1 - m) * sample_clamp(b.base[c] + b.dx[c] * u +
                                              b.dy[c] * v + b.wave[c] * s);
        }
}

/* Gain, gamma by a curve, saturation and noise. */
static void sample_change_colours(float *rgb, size_t n, float amount,
                                  struct random *r)
{
    float gain[3], curve = amount * (float)random_range(r, -0.5, 0.5);
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
        float *p = rgb + 3 * i, luma = 0.3f * p[0] + 0.59f * p[1] +
                                       0.11f * p[2];
        uint64_t dice = noise > 0 ? random_mix(key + i) : 0;
        for (int c = 0; c < 3; c++) {
            float x = sample_clamp((p[c] + grey * (luma - p[c])) * gain[c]);
            x += curve * x * (1 - x);
            if (noise > 0)
                x += noise * ((float)(dice >> (21 * c) & 0x1fffff) *
                              (1.0f / 1048576) - 1);
            p[c] = sample_clamp(x);
        }
    }
}

/* Three-tap blur along rows, then columns: softer pictures. */
static void sample_soften(float *rgb, size_t n, float w)
{
    for (int pass = 0; pass < 2; pass++) {
        size_t step = pass ? 3 * n : 3, line = pass ? 3 : 3 * n;
        for (size_t l = 0; l < n; l++) {
            float before[3];
            memcpy(before, rgb + l * line, sizeof before);
            for (size_t i = 0; i + 1 < n; i++) {
                float *p = rgb + l * line + i * step;
                for (int c = 0; c < 3; c++) {
                    float here = p[c];
                    p[c] = (1 - 2 * w) * here + w * (before[c] + p[step + c]);
                    before[c] = here;
                }
            }
        }
    }
}

int data_sample(float *rgb, size_t n, const struct data_frame *f,
                struct square q, const struct data_augment *how,
                struct random *r, struct error *err)
{
    struct tap *tx = malloc(2 * n * sizeof *tx);
    float *rgba = malloc(4 * n * n * sizeof *rgba);
    int rc = -1;

    if (!tx || !rgba) {
        error_set(err, EX_OSERR, "out of memory (crop of %zu)", n);
        goto out;
    }
    sample_plain(rgba, n, f, q, tx, tx + n);
    if (how && random_uniform(r) < how->background)
        sample_replace_background(rgba, n, r);
    for (size_t i = 0; i < n * n; i++)
        memcpy(rgb + 3 * i, rgba + 4 * i, 3 * sizeof *rgb);
    if (how && how->colour > 0) {
        float w = how->colour * (float)random_range(r, -0.3, 0.25);
        if (w > 0)
            sample_soften(rgb, n, w);
        sample_change_colours(rgb, n * n, how->colour, r);
    }
    rc = 0;
out:
    free(rgba);
    free(tx);
    return rc;
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
    part = 1.0f / (255.0f * (float)(k * k));
    memset(rgb, 0, 3 * n * n * sizeof *rgb);
    if (mask)
        memset(mask, 0, n * n * sizeof *mask);
    for (size_t y = 0; y < f->size; y++)
        for (size_t x = 0; x < f->size; x++) {
            const uint8_t *p = f->rgba + 4 * (y * f->size + x);
            size_t o = y / k * n + x / k;
            float m = (float)p[3] * part;
            for (int c = 0; c < 3; c++)
                rgb[3 * o + c] += m * (float)p[c] * (1.0f / 255);
            if (mask)
                mask[o] += m;
        }
    return 0;
}
