/* Rasterising the source mesh onto the plane's cells: the coverage map C of
 * Section 3.2 by counting sub-cell points, and a z-buffer by scan lines with
 * 1/z linear on the screen. */
#include "lib/avatar/coverage.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/base/camera.h"
#include "lib/base/parallel.h"

#define SUB 8   /* sample rows and columns of a cell: one byte holds a row */

/* A corner of a triangle: cells (x, y) and camera depth. */
struct corner {
    float x, y, z;
};

/* Corners of face f on a map of n x n cells; false when one is behind the
 * camera. */
static bool coverage_triangle(struct corner c[3], const float *verts,
                              const int32_t *f, const float cam[12], size_t n)
{
    for (int k = 0; k < 3; k++) {
        float uv[2], z;

        camera_project(uv, &z, cam, (float)n, verts + 3 * (size_t)f[k], 1);
        if (!(z > CAMERA_NEAR))
            return false;
        c[k] = (struct corner){uv[0], uv[1], z};
    }
    return true;
}

/* First index i >= 0 whose centre (i + 0.5) is at or beyond x, at most n. */
static int32_t coverage_first_centre(float x, float n)
{
    const float least = x > 0.5f ? x - 0.5f : 0, at = least < n ? least : n;
    const int32_t below = (int32_t)at;

    return below + ((float)below < at);
}

/* Which of n centres of each of SUB rows, from row on, lie in the triangle: those
 * from `from` to before `to`, if that is more. */
static void coverage_spans(int32_t from[SUB], int32_t to[SUB],
                           const struct corner c[3], size_t row, size_t n)
{
    float lo[SUB], hi[SUB];

    for (int l = 0; l < SUB; l++) {
        lo[l] = INFINITY;
        hi[l] = -INFINITY;
    }
    for (int k = 0; k < 3; k++) {
        const struct corner a = c[k], b = c[(k + 1) % 3];
        const float top = fminf(a.y, b.y), bottom = fmaxf(a.y, b.y);

#pragma omp simd
        for (int l = 0; l < SUB; l++) {
            const float y = (float)row + (float)l + 0.5f;
            const float x = a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x);
            const int meets = (y >= top) & (y < bottom);

            lo[l] = (meets & (x < lo[l])) ? x : lo[l];
            hi[l] = (meets & (x > hi[l])) ? x : hi[l];
        }
    }
#pragma omp simd
    for (int l = 0; l < SUB; l++) {
        from[l] = coverage_first_centre(lo[l], (float)n);
        to[l] = coverage_first_centre(hi[l], (float)n);
    }
}

/* Rows whose centres the triangle may hold: from rows[0] to before rows[1]. */
static void coverage_rows(size_t rows[2], const struct corner c[3], size_t n)
{
    const float end = (float)n;

    rows[0] = (size_t)coverage_first_centre(
        fminf(fminf(c[0].y, c[1].y), c[2].y), end);
    rows[1] = (size_t)coverage_first_centre(
        fmaxf(fmaxf(c[0].y, c[1].y), c[2].y), end);
}

/* Set bits a..b-1 of a row of bytes. */
static void coverage_set_bits(uint8_t *row, size_t a, size_t b)
{
    if (a >= b)
        return;
    const size_t first = a / SUB, last = (b - 1) / SUB;
    const int from = 0xff << a % SUB, to = 0xff >> (SUB - 1 - (b - 1) % SUB);

    if (first == last) {
        row[first] |= (uint8_t)(from & to);
        return;
    }
    row[first] |= (uint8_t)from;
    memset(row + first + 1, 0xff, last - first - 1);
    row[last] |= (uint8_t)to;
}

size_t coverage_scratch(size_t n)
{
    size_t bits = SUB * n * n, blur = 2 * n * n * sizeof(float);

    return bits > blur ? bits : blur;
}

/* The number of bits in each byte of a word. */
static uint64_t coverage_bits(uint64_t x)
{
    x -= x >> 1 & 0x5555555555555555;
    x = (x & 0x3333333333333333) + (x >> 2 & 0x3333333333333333);
    return (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0f;
}

/* Row i of C (n,n): the share of its cells' bits that are set, in SUB rows of n
 * bytes. */
PARALLEL(coverage_count, i, float *, C, const uint8_t *, bits, size_t, n)
{
    for (size_t j = 0; j < n; j += sizeof(uint64_t)) {
        const size_t some = n - j < sizeof(uint64_t) ? n - j : sizeof(uint64_t);
        uint64_t sum = 0;           /* of 64 at most in each byte */
        uint8_t count[sizeof sum];

        for (size_t s = 0; s < SUB; s++) {
            uint64_t row = 0;

            memcpy(&row, bits + (i * SUB + s) * n + j, some);
            sum += coverage_bits(row);
        }
        memcpy(count, &sum, sizeof sum);
        for (size_t k = 0; k < some; k++)
            C[i * n + j + k] = (float)count[k] / (SUB * SUB);
    }
}

/* One bit for each of a cell's 64 points, set by scan lines, in the rows of
 * cells that are one share's: all but every `shares`th are the others'. */
PARALLEL(coverage_set_points, share, uint8_t *, bits, const float *, verts,
         const int32_t *, faces, size_t, F, const float *, cam, size_t, n,
         size_t, shares)
{
    const size_t m = SUB * n;

    for (size_t f = 0; f < F; f++) {
        struct corner c[3];
        size_t rows[2];
        int32_t from[SUB], to[SUB];

        if (!coverage_triangle(c, verts, faces + 3 * f, cam, n))
            continue;
        for (int k = 0; k < 3; k++) {
            c[k].x *= SUB;
            c[k].y *= SUB;
        }
        coverage_rows(rows, c, m);
        const size_t first = rows[0] / SUB;
        size_t own = first + (share + shares - first % shares) % shares;
        for (; own * SUB < rows[1]; own += shares) {
            coverage_spans(from, to, c, own * SUB, m);
            for (size_t l = 0; l < SUB; l++)
                coverage_set_bits(bits + (own * SUB + l) * n, (size_t)from[l],
                                  (size_t)to[l]);
        }
    }
}

/* Points in the triangles, counted. */
void coverage_fraction(float *C, const float *verts, const int32_t *faces,
                       size_t F, const float cam[12], size_t n, void *scratch)
{
    const size_t shares = (size_t)parallel_width();
    uint8_t *bits = scratch;

    memset(bits, 0, SUB * n * n);
    parallel_each(coverage_set_points, shares, 1, bits, verts, faces, F, cam, n,
                  shares);
    parallel_each(coverage_count, n, 1, C, bits, n);
}

/* w times count numbers of x, added to out. */
static void coverage_add(float *out, const float *x, size_t count, float w)
{
#pragma omp simd
    for (size_t j = 0; j < count; j++)
        out[j] += w * x[j];
}

/* Row i of x along itself, and below, rows of x about it down, into out's. */
PARALLEL(coverage_blur_along, i, float *, out, const float *, x, size_t, n,
         const float *, w, size_t, r)
{
    memset(out + i * n, 0, n * sizeof *out);
    for (size_t k = 0; k <= 2 * r; k++) {
        const size_t to = k < r ? r - k : 0, from = k > r ? k - r : 0;

        if (to + from < n)
            coverage_add(out + i * n + to, x + i * n + from, n - to - from,
                         w[k]);
    }
}

PARALLEL(coverage_blur_down, i, float *, out, const float *, x, size_t, n,
         const float *, w, size_t, r)
{
    memset(out + i * n, 0, n * sizeof *out);
    for (size_t k = 0; k <= 2 * r; k++)
        if (i + k >= r && i + k < n + r)
            coverage_add(out + i * n, x + (i + k - r) * n, n, w[k]);
}

/* Two passes of a separable filter of 3 sigma to either side. */
void coverage_blur(float *out, const float *x, size_t n, float sigma,
                   float *tmp)
{
    enum { MAX = 32 };
    float w[2 * MAX + 1], sum = 0;
    int r = (int)ceilf(3 * sigma);

    r = r < 1 ? 1 : r > MAX ? MAX : r;
    for (int k = -r; k <= r; k++)
        sum += w[k + r] = expf(-0.5f * (float)(k * k) / (sigma * sigma));
    for (int k = 0; k <= 2 * r; k++)
        w[k] /= sum;
    parallel_each(coverage_blur_along, n, 1, tmp, x, n, w, (size_t)r);
    parallel_each(coverage_blur_down, n, 1, out, tmp, n, w, (size_t)r);
}

void coverage_map(float *C, const float *verts, const int32_t *faces, size_t F,
                  const float cam[12], size_t n, void *scratch)
{
    float *fraction = scratch;

    coverage_fraction(C, verts, faces, F, cam, n, scratch);
    memcpy(fraction, C, n * n * sizeof *C);
    coverage_blur(C, fraction, n, 1, fraction + n * n);
    for (size_t i = 0; i < n * n; i++)
        C[i] = fminf(C[i], 1);
}

void coverage_distance(float *out, const float *coverage, size_t n)
{
    for (size_t row = 0; row < n * n; row += n) {
        float left = INFINITY, right = INFINITY;

        for (size_t k = row; k < row + n; k++)
            out[k] = left = coverage[k] >= COVERAGE_WHOLE ? 0 : left + 1;
        for (size_t k = row + n; k-- > row; ) {
            right = coverage[k] >= COVERAGE_WHOLE ? 0 : right + 1;
            out[k] = fminf(out[k], right);
            out[k] = isfinite(out[k]) ? out[k] : 0;
        }
    }
}

/* A number that is linear on a triangle: at corner 0, and per cell. */
struct linear {
    float at, x, y;
};

/* From its values at the corners (v[0], and the other two less v[0]). */
static struct linear coverage_linear(const float v[3],
                                     const struct corner c[3], float det)
{
    float x1 = c[1].x - c[0].x, y1 = c[1].y - c[0].y;
    float x2 = c[2].x - c[0].x, y2 = c[2].y - c[0].y;

    return (struct linear){v[0], (v[1] * y2 - v[2] * y1) / det,
                           (x1 * v[2] - x2 * v[1]) / det};
}

/* One triangle into own rows of z and value; attributes at its corners. */
static void coverage_depth_face(float *z, float *value, size_t channels,
                                const struct corner c[3],
                                const float *const attribute[3], size_t n,
                                size_t share, size_t shares)
{
    float det = (c[1].x - c[0].x) * (c[2].y - c[0].y) -
                (c[2].x - c[0].x) * (c[1].y - c[0].y);
    float a = 1 / c[0].z;
    size_t rows[2];
    int32_t from[SUB], to[SUB];
    struct linear v[COVERAGE_CHANNELS];

    if (det == 0)
        return;
    /* 1/z is linear on the screen */
    struct linear g = coverage_linear((float[3]){a, 1 / c[1].z - a,
                                                 1 / c[2].z - a}, c, det);
    for (size_t k = 0; k < channels; k++) {
        const float at = attribute[0][k];

        v[k] = coverage_linear((float[3]){at, attribute[1][k] - at,
                                          attribute[2][k] - at}, c, det);
    }
    coverage_rows(rows, c, n);
    for (size_t i = rows[0]; i < rows[1]; i++) {
        const size_t l = (i - rows[0]) % SUB;
        float y = (float)i + 0.5f - c[0].y;

        if (l == 0)
            coverage_spans(from, to, c, i, n);
        if (i % shares != share)
            continue;
        for (int32_t j = from[l]; j < to[l]; j++) {
            float x = (float)j + 0.5f - c[0].x;
            float d = 1 / (g.at + g.x * x + g.y * y);
            size_t at = i * n + (size_t)j;

            if (!(d < z[at]))
                continue;
            z[at] = d;
            for (size_t k = 0; k < channels; k++)
                value[channels * at + k] = v[k].at + v[k].x * x + v[k].y * y;
        }
    }
}

/* All triangles into one share's rows. */
PARALLEL(coverage_depth_share, share, float *, z, float *, value,
         size_t, channels, const float *, verts, const float *, attribute,
         const int32_t *, faces, size_t, F, const float *, cam, size_t, n,
         size_t, shares)
{
    for (size_t f = 0; f < F; f++) {
        const int32_t *at = faces + 3 * f;
        const float *const corner[3] = {
            attribute + channels * (size_t)at[0],
            attribute + channels * (size_t)at[1],
            attribute + channels * (size_t)at[2]
        };
        struct corner c[3];

        if (coverage_triangle(c, verts, at, cam, n))
            coverage_depth_face(z, value, channels, c, corner, n, share,
                                shares);
    }
}

/* A z-buffer at the cells' centres. */
void coverage_depth(float *z, float *value, size_t channels,
                    const float *verts, const float *attribute,
                    const int32_t *faces, size_t F, const float cam[12],
                    size_t n)
{
    const size_t shares = (size_t)parallel_width();

    for (size_t i = 0; i < n * n; i++)
        z[i] = INFINITY;
    memset(value, 0, channels * n * n * sizeof *value);
    parallel_each(coverage_depth_share, shares, 1, z, value, channels, verts,
                  attribute, faces, F, cam, n, shares);
}

/* Row i of out: the least of the rows of x up to r before and after it. */
PARALLEL(coverage_near_rows, i, float *, out, const float *, x, size_t, n,
         size_t, r)
{
    const size_t from = i > r ? i - r : 0, to = i + r < n ? i + r : n - 1;
    float *row = out + i * n;

    memcpy(row, x + from * n, n * sizeof *row);
    for (size_t k = from + 1; k <= to; k++)
        for (size_t j = 0; j < n; j++)
            row[j] = x[k * n + j] < row[j] ? x[k * n + j] : row[j];
}

/* The same along row i. */
PARALLEL(coverage_near_columns, i, float *, out, const float *, x, size_t, n,
         size_t, r)
{
    const float *from = x + i * n;
    float *row = out + i * n;

    memcpy(row, from, n * sizeof *row);
    for (size_t k = 1; k <= r; k++) {
        for (size_t j = k; j < n; j++)
            row[j] = from[j - k] < row[j] ? from[j - k] : row[j];
        for (size_t j = 0; j + k < n; j++)
            row[j] = from[j + k] < row[j] ? from[j + k] : row[j];
    }
}

void coverage_near(float *near, const float *z, size_t n, size_t r, float *tmp)
{
    parallel_each(coverage_near_rows, n, 1, tmp, z, n, r);
    parallel_each(coverage_near_columns, n, 1, near, tmp, n, r);
}

PARALLEL(coverage_seen_part, k, const float *, cam, const float *, x,
         const float *, z, float *, seen, size_t, n, float, slack)
{
    float uv[2], depth, sum = 0;

    camera_project(uv, &depth, cam, (float)n, x + 3 * k, 1);
    seen[k] = 0;
    if (!(depth > CAMERA_NEAR) || !(uv[0] >= 0) || !(uv[1] >= 0) ||
        !(uv[0] <= (float)n) || !(uv[1] <= (float)n))
        return;
    float fx = floorf(uv[0] - 0.5f), fy = floorf(uv[1] - 0.5f);
    for (int q = 0; q < 4; q++) {
        long j = (long)fx + (q & 1), i = (long)fy + (q >> 1);

        j = j < 0 ? 0 : j >= (long)n ? (long)n - 1 : j;
        i = i < 0 ? 0 : i >= (long)n ? (long)n - 1 : i;
        sum += depth <= z[(size_t)i * n + (size_t)j] + slack;
    }
    seen[k] = 0.25f * sum;
}

/* The depth test of each point against the four cells around it. */
void coverage_seen(float *seen, const float *x, size_t N, const float *z,
                   size_t n, const float cam[12], float slack)
{
    parallel_each(coverage_seen_part, N, 1, cam, x, z, seen, n, slack);
}
