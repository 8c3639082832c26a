/* Square crops of pictures, bilinear and area-averaged; windows and crops from
 * boxes and landmarks. */
#include "lib/base/crop.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/cpu.h"
#include "lib/base/crop_kernel.h"
#include "lib/base/parallel.h"
#include "lib/base/quad.h"

/* ---- which square ----------------------------------------------------- */

struct square crop_from_landmarks(const float *xy, size_t n)
{
    float lo[2] = {xy[0], xy[1]}, hi[2] = {xy[0], xy[1]};

    for (size_t i = 1; i < n; i++)
        for (int k = 0; k < 2; k++) {
            lo[k] = fminf(lo[k], xy[2 * i + k]);
            hi[k] = fmaxf(hi[k], xy[2 * i + k]);
        }
    return (struct square){
        (lo[0] + hi[0]) / 2.0, (lo[1] + hi[1]) / 2.0,
        CROP_GROW * fmax(hi[0] - lo[0], hi[1] - lo[1])
    };
}

/* The detector's box runs from the middle of the forehead to below the lips;
 * the landmarks from the brows to the chin, which is as wide as 0.86 of it
 * and sits lower by 0.14. */
#define DETECTION_SIDE (CROP_GROW * 0.86)
#define DETECTION_DOWN 0.14

struct square crop_from_detection(struct square face)
{
    return (struct square){
        face.x, face.y + DETECTION_DOWN * face.size,
        DETECTION_SIDE * face.size
    };
}

struct square window_from_crop(struct square crop)
{
    double face = crop.size / DETECTION_SIDE;

    return (struct square){
        crop.x, crop.y - DETECTION_DOWN * face, CROP_WINDOW * face
    };
}

struct square square_into(struct square q, struct square window, double S)
{
    const double k = S / window.size;

    return (struct square){
        (q.x - window.x) * k + S / 2, (q.y - window.y) * k + S / 2,
        q.size * k
    };
}

struct square square_out_of(struct square q, struct square window, double S)
{
    const double k = window.size / S;

    return (struct square){
        (q.x - S / 2) * k + window.x, (q.y - S / 2) * k + window.y,
        q.size * k
    };
}

/* Of n pixels over `size` about `middle` those whose middles lie in `length`. */
static void square_extent_along(size_t e[2], double middle, double size,
                                size_t n, size_t length)
{
    const double step = size / (double)n;

    e[0] = e[1] = 0;
    for (size_t i = 0; i < n; i++) {
        const double x = middle - size / 2 + ((double)i + 0.5) * step;

        if (x >= 0 && x < (double)length) {
            e[0] = e[1] ? e[0] : i;
            e[1] = i + 1;
        }
    }
}

struct extent square_extent(size_t n, size_t W, size_t H, struct square q)
{
    struct extent e;

    square_extent_along(e.x, q.x, q.size, n, W);
    square_extent_along(e.y, q.y, q.size, n, H);
    return e;
}

struct extent extent_resize(struct extent e, size_t n, size_t w)
{
    return (struct extent){{(e.x[0] * w + n - 1) / n, e.x[1] * w / n},
                           {(e.y[0] * w + n - 1) / n, e.y[1] * w / n}};
}

void extent_repeat_edges(float *rgb, size_t n, size_t step, struct extent e)
{
    if (extent_is_empty(&e))
        return;
    for (size_t i = 0; i < n * n; i++) {
        const size_t x = i % n, y = i / n;
        const size_t u = x < e.x[0] ? e.x[0] : x < e.x[1] ? x : e.x[1] - 1;
        const size_t v = y < e.y[0] ? e.y[0] : y < e.y[1] ? y : e.y[1] - 1;

        if (v * n + u != i)
            memcpy(rgb + step * i, rgb + step * (v * n + u), 3 * sizeof *rgb);
    }
}

/* ---- sampling --------------------------------------------------------- */

/* Index coordinate of output pixel i of n: pixel centres lie at integers. */
static double crop_sample_place(double centre, double size, size_t i, size_t n)
{
    return centre + (((double)i + 0.5) / (double)n - 0.5) * size - 0.5;
}

/* Lower index and weight of the next for coordinate p among n samples; -2
 * when neither is inside. */
static ptrdiff_t crop_sample_lower(double p, size_t n, float *w)
{
    double f = floor(p);

    *w = (float)(p - f);
    if (!(f >= -1 && f < (double)n)) {
        *w = 0;
        return -2;
    }
    return (ptrdiff_t)f;
}

/* One pixel, four taps, black outside. */
static void crop_sample_pixel(double *out, const uint8_t *rgb, size_t W,
                              size_t H, size_t stride, ptrdiff_t x, ptrdiff_t y,
                              double wx, double wy)
{
    out[0] = out[1] = out[2] = 0;
    for (int k = 0; k < 4; k++) {
        ptrdiff_t px = x + (k & 1), py = y + (k >> 1);
        double w = (k & 1 ? wx : 1 - wx) * (k & 2 ? wy : 1 - wy);

        if (px < 0 || py < 0 || px >= (ptrdiff_t)W || py >= (ptrdiff_t)H)
            continue;
        for (int c = 0; c < 3; c++)
            out[c] += w * (rgb[(size_t)py * stride + 3 * (size_t)px
                               + (size_t)c] / 255.0);
    }
}

/* For squares too wide for the buffers of the fast one. */
static void crop_sample_plain(float *out, size_t n, const uint8_t *rgb, size_t W,
                              size_t H, size_t stride, struct square q)
{
    for (size_t i = 0; i < n; i++) {
        float wy;
        ptrdiff_t y = crop_sample_lower(crop_sample_place(q.y, q.size, i, n), H,
                                        &wy);

        for (size_t j = 0; j < n; j++, out += 3) {
            double p[3];
            float wx;
            ptrdiff_t x = crop_sample_lower(crop_sample_place(q.x, q.size, j,
                                                              n), W, &wx);

            crop_sample_pixel(p, rgb, W, H, stride, x, y, wx, wy);
            for (int c = 0; c < 3; c++)
                out[c] = (float)p[c];
        }
    }
}

void crop_sample_ref(double *out, size_t n, const double *rgb, size_t W,
                     size_t H, struct square q)
{
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++, out += 3) {
            double px = crop_sample_place(q.x, q.size, j, n);
            double py = crop_sample_place(q.y, q.size, i, n);

            for (int c = 0; c < 3; c++) {
                double v = 0;

                for (int k = 0; k < 4; k++) {
                    double x = floor(px) + (k & 1), y = floor(py) + (k >> 1);
                    double w = (1 - fabs(px - x)) * (1 - fabs(py - y));

                    if (x >= 0 && y >= 0 && x < (double)W && y < (double)H)
                        v += w * rgb[((size_t)y * W + (size_t)x) * 3
                                     + (size_t)c];
                }
                out[c] = v;
            }
        }
}

/* ---- the fast one ----------------------------------------------------- */

#define SPAN 1024              /* picture columns of the fast path */
#define SIDE 512               /* output columns of the fast path */

/* Columns of the crop: where they start in a row buffer that begins at
 * picture column x0 - 1 of which inside is [x0, x1). */
struct columns {
    size_t x0, x1;
    int32_t at[SIDE];
    float w[SIDE];
};

/* 0, or -1 when the crop is too wide for the buffers. */
static int crop_find_columns(struct columns *c, size_t n, size_t W,
                             struct square q)
{
    double first = floor(crop_sample_place(q.x, q.size, 0, n));
    double last = floor(crop_sample_place(q.x, q.size, n - 1, n)) + 1;

    if (n > SIDE || !(last - first < SPAN - 4) || !(first > -1e8)
        || !(last < 1e8))
        return -1;
    for (size_t j = 0; j < n; j++) {
        double p = crop_sample_place(q.x, q.size, j, n), f = floor(p);

        c->at[j] = (int32_t)(f - first) * 3;
        c->w[j] = (float)(p - f);
    }
    first = first < 0 ? 0 : first > (double)W ? (double)W : first;
    last = last + 1 < 0 ? 0 : last + 1 > (double)W ? (double)W : last + 1;
    c->x0 = (size_t)first;
    c->x1 = last > first ? (size_t)last : c->x0;
    return 0;
}

void crop_sample_u8(float *out, size_t n, const uint8_t *rgb, size_t W,
                    size_t H, size_t stride, struct square q)
{
    static const uint8_t black[3 * SPAN];
    const struct crop_kernels *k = CPU_PICK(crop_kernels);
    struct columns c;
    float row[3 * SPAN + 8] = {0}, line[3 * SIDE + 4];
    double left;
    size_t skip;

    if (n == 0)
        return;
    if (crop_find_columns(&c, n, W, q) != 0) {
        crop_sample_plain(out, n, rgb, W, H, stride, q);
        return;
    }
    left = floor(crop_sample_place(q.x, q.size, 0, n));
    skip = left < 0 ? (size_t)-left : 0;   /* black columns before the first */
    for (size_t i = 0; i < n; i++, out += 3 * n) {
        float wy;
        ptrdiff_t y = crop_sample_lower(crop_sample_place(q.y, q.size, i, n), H,
                                        &wy);
        const uint8_t *a = y >= 0 ? rgb + (size_t)y * stride + 3 * c.x0
                                  : black;
        const uint8_t *b = y >= -1 && y + 1 < (ptrdiff_t)H
            ? rgb + (size_t)(y + 1) * stride + 3 * c.x0 : black;

        if (c.x1 > c.x0)
            k->blend(row + 3 * skip, a, b, wy, 3 * (c.x1 - c.x0));
        k->gather(line, row, c.at, c.w, n);
        memcpy(out, line, 3 * n * sizeof *out);
    }
}

/* One row. */
PARALLEL(crop_halve_part, y, uint8_t *, out, const uint8_t *, rgb, size_t, w,
         size_t, stride, size_t, stride_in)
{
    CPU_PICK(crop_kernels)->halve(out + y * stride, rgb + 2 * y * stride_in,
                                  rgb + (2 * y + 1) * stride_in, w);
}

void crop_halve(uint8_t *out, const uint8_t *rgb, size_t w, size_t h,
                size_t stride, size_t stride_in)
{
    parallel_each(crop_halve_part, h, 16, out, rgb, w, stride, stride_in);
}

/* ---- resizing a square to 8 bits -------------------------------------- */

/* What one output pixel takes along an axis: a triangle, antialiased. */
struct filter {
    size_t lo, count;          /* input samples inside the picture */
    float w[];                 /* of each; they sum to 1 */
};

/* Filter of output i; room for `max` weights.  None where its middle lies
 * outside the picture, as square_extent has it: what is inside takes nothing
 * of the black about it, or a window larger than the picture shows a frame. */
static void crop_filter_make(struct filter *f, double centre, double size,
                             size_t i, size_t n, size_t in, size_t max)
{
    const double s = size / (double)n, support = s > 1 ? s : 1;
    const double p = crop_sample_place(centre, size, i, n);
    const double first = fmax(ceil(p - support), 0);
    double sum = 0;
    size_t m = 0;

    f->lo = (size_t)fmin(first, (double)in);
    f->count = 0;
    if (p < -0.5 || p >= (double)in - 0.5)
        return;
    for (double j = first; j < p + support && j < (double)in && m < max;
         j++) {
        f->w[m] = (float)fmax(0, 1 - fabs(j - p) / support);
        sum += (double)f->w[m++];
    }
    for (size_t k = 0; k < m; k++)
        f->w[k] = (float)((double)f->w[k] / sum);
    f->count = m;
}

/* A resizing: an n x n picture of C channels, and the filters, of `bytes`
 * each, that make it: n across and n down.  Those across take samples from to
 * end of a picture's row. */
struct resizing {
    size_t n, C, bytes, from, end;
    const char *fx, *fy;
    void *filters;              /* all of them */
};

/* Filter i of an axis's. */
static const struct filter *crop_filter_at(const struct resizing *r,
                                           const char *axis, size_t i)
{
    return (const void *)(axis + i * r->bytes);
}

/* A row of n pixels of C channels from one of the picture's samples r->from to
 * r->end, a filter for each; out and row have room for 3 floats more. */
static inline void crop_filter_pixels(float *out, const float *row,
                                      const struct resizing *r, size_t C)
{
    for (size_t j = 0; j < r->n; j++, out += C) {
        const struct filter *f = crop_filter_at(r, r->fx, j);
        const float *p = row + (f->lo - r->from) * C;
        quad v = {0};

        for (size_t k = 0; k < f->count; k++, p += C)
            v += f->w[k] * *(const quad *)p;
        *(quad *)out = v;               /* what is too much is overwritten */
    }
}

/* The same with a number of channels that the compiler knows. */
static void crop_filter_row(float *out, const float *row,
                            const struct resizing *r)
{
    if (r->C == 3)
        crop_filter_pixels(out, row, r, 3);
    else if (r->C == 1)
        crop_filter_pixels(out, row, r, 1);
    else
        crop_filter_pixels(out, row, r, r->C);
}

/* Output rows first to end: first down the picture, as that leaves fewer rows
 * to filter across.  room: a row of the picture and one of the output, each
 * with 3 floats more. */
static void crop_filter_rows(uint8_t *out, float *room, const uint8_t *rgb,
                             size_t stride, const struct resizing *r,
                             size_t first, size_t end)
{
    const size_t line = r->n * r->C, wide = (r->end - r->from) * r->C;
    float *row = room + wide + 3;

    for (size_t i = first; i < end; i++) {
        const struct filter *f = crop_filter_at(r, r->fy, i);

        memset(room, 0, (wide + 3) * sizeof *room);
        for (size_t k = 0; k < f->count; k++)
            CPU_PICK(crop_kernels)->add(room, rgb + (f->lo + k) * stride +
                                        r->from * r->C, f->w[k], wide);
        crop_filter_row(row, room, r);
        CPU_PICK(crop_kernels)->round(out + i * line, row, line);
    }
}

/* The filters for a square of a picture of W x H; r->filters is the caller's to
 * free.  -1 without memory. */
static int crop_filters_make(struct resizing *r, size_t W, size_t H,
                             struct square q)
{
    const double s = q.size / (double)r->n;
    const size_t max = (size_t)fmin(2 * ceil(s > 1 ? s : 1) + 2,
                                     (double)(W > H ? W : H) + 2);
    const size_t n = r->n, bytes = (sizeof(struct filter) +
                                    max * sizeof(float) + 15) / 16 * 16;
    char *f = calloc(2 * n, bytes);

    if (!f)
        return -1;
    for (size_t i = 0; i < n; i++) {
        crop_filter_make((void *)(f + i * bytes), q.x, q.size, i, n, W, max);
        crop_filter_make((void *)(f + (n + i) * bytes), q.y, q.size, i, n, H,
                         max);
    }
    r->bytes = bytes;
    r->filters = f;
    r->fx = f;
    r->fy = f + n * bytes;
    r->from = n ? crop_filter_at(r, f, 0)->lo : 0;
    r->end = r->from;
    for (size_t i = 0; i < n; i++) {
        const struct filter *x = crop_filter_at(r, f, i);

        r->end = x->count ? x->lo + x->count : r->end;
    }
    return 0;
}

/* Share t of the rows. */
PARALLEL(crop_resize_u8_part, t, uint8_t *, out, float *, room, size_t, own,
         size_t, threads, const uint8_t *, rgb, size_t, stride,
         struct resizing, r)
{
    crop_filter_rows(out, room + t * own, rgb, stride, &r, r.n * t / threads,
                     r.n * (t + 1) / threads);
}

int crop_resize_u8(uint8_t *out, size_t n, const uint8_t *rgb, size_t W,
                   size_t H, size_t stride, int channels, struct square q)
{
    struct resizing r = {.n = n, .C = (size_t)channels};
    const size_t line = n * r.C, threads = (size_t)parallel_width();

    assert(r.C >= 1 && r.C <= 4);
    if (crop_filters_make(&r, W, H, q))
        return -1;
    const size_t own = (r.end - r.from) * r.C + line + 6;
    float *room = malloc(threads * own * sizeof *room);

    if (!room) {
        free(r.filters);
        return -1;
    }
    parallel_each(crop_resize_u8_part, threads, 1, out, room, own, threads, rgb,
                  stride, r);
    free(r.filters);
    free(room);
    return 0;
}
