/* YUV4MPEG2: headers, and planes to RGB and back with fixed-point
 * arithmetic. */
#include "formats/y4m.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/compose.h"
#include "formats/image.h"
#include "lib/base/cpu.h"

/* ---- the header ------------------------------------------------------- */

/* Kind and siting. */
static int y4m_parse_chroma(struct y4m *y, const char *v, size_t n)
{
    static const struct {
        const char *name;
        enum y4m_chroma chroma;
        double x, y;
    } kinds[] = {
        {"420jpeg", Y4M_420, 0.5, 0.5}, {"420", Y4M_420, 0.5, 0.5},
        {"420mpeg2", Y4M_420, 0, 0.5}, {"420paldv", Y4M_420, 0, 0},
        {"422", Y4M_422, 0, 0}, {"444", Y4M_444, 0, 0},
        {"mono", Y4M_MONO, 0, 0},
    };

    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        if (strlen(kinds[i].name) != n || strncmp(kinds[i].name, v, n))
            continue;
        y->chroma = kinds[i].chroma;
        y->site_x = kinds[i].x;
        y->site_y = kinds[i].y;
        return 0;
    }
    return -1;
}

/* "30000:1001". */
static int y4m_parse_ratio(const char *v, int *num, int *den)
{
    int a, b;

    if (sscanf(v, "%d:%d", &a, &b) != 2 || a < 0 || b < 0)
        return -1;
    *num = a;
    *den = b;
    return 0;
}

/* Pixels. */
static int y4m_parse_side(const char *v, size_t *side)
{
    char *end;
    long n = strtol(v, &end, 10);

    if (end == v || (*end && *end != ' ') || n < 1 || n > IMAGE_MAX_SIDE)
        return -1;
    *side = (size_t)n;
    return 0;
}

/* One word of the header by its first letter. */
static int y4m_parse_field(struct y4m *y, const char *p, size_t n)
{
    switch (*p) {
    case 'W': return y4m_parse_side(p + 1, &y->width);
    case 'H': return y4m_parse_side(p + 1, &y->height);
    case 'C': return y4m_parse_chroma(y, p + 1, n - 1);
    case 'F': return y4m_parse_ratio(p + 1, &y->rate_num, &y->rate_den);
    case 'A': return y4m_parse_ratio(p + 1, &y->aspect_num, &y->aspect_den);
    case 'X':
        if (n == 16 && strncmp(p, "XCOLORRANGE=FULL", n) == 0)
            y->full = true;
        return 0;
    default: return 0;
    }
}

int y4m_parse(struct y4m *y, const char *line, struct error *err)
{
    const char *p = line;

    memset(y, 0, sizeof *y);
    y->rate_num = 25;
    y->rate_den = 1;
    y->chroma = Y4M_420;
    y->site_x = y->site_y = 0.5;
    if (strncmp(p, "YUV4MPEG2", 9) != 0)
        return error_set(err, EX_DATAERR, "not a Y4M header (expected "
                         "'YUV4MPEG2')");
    for (p += 9; *p; ) {
        size_t n;

        p += strspn(p, " ");
        n = strcspn(p, " ");
        if (n && y4m_parse_field(y, p, n) != 0)
            return error_set(err, EX_DATAERR, "Y4M field '%.*s' cannot be "
                             "used (8 bits; 420jpeg, 420mpeg2, 420paldv, 422,"
                             " 444 or mono; sides 1 to %d)", (int)n, p,
                             IMAGE_MAX_SIDE);
        p += n;
    }
    if (!y->width || !y->height)
        return error_set(err, EX_DATAERR, "Y4M header has no %s",
                         y->width ? "height" : "width");
    if (y->rate_num < 1 || y->rate_den < 1) {
        y->rate_num = 25;
        y->rate_den = 1;
    }
    return 0;
}

size_t y4m_header(char *line, size_t size, const struct y4m *y)
{
    return (size_t)snprintf(
        line, size, "YUV4MPEG2 W%zu H%zu F%d:%d Ip A%d:%d C444 "
        "XCOLORRANGE=%s\n", y->width, y->height, y->rate_num, y->rate_den,
        y->aspect_num, y->aspect_den, y->full ? "FULL" : "LIMITED");
}

/* Of a chroma plane; 0 when there is none. */
static size_t y4m_chroma_width(const struct y4m *y)
{
    switch (y->chroma) {
    case Y4M_444: return y->width;
    case Y4M_MONO: return 0;
    default: return (y->width + 1) / 2;
    }
}

/* Of a chroma plane. */
static size_t y4m_chroma_height(const struct y4m *y)
{
    return y->chroma == Y4M_420 ? (y->height + 1) / 2 : y->height;
}

size_t y4m_frame_bytes(const struct y4m *y)
{
    return y->width * y->height +
           2 * y4m_chroma_width(y) * y4m_chroma_height(y);
}

/* ---- the colours ------------------------------------------------------ */

/* Luma weights, and the ranges of luma and chroma in levels. */
struct matrix {
    double kr, kb, y0, ys, cs;
};

/* BT.709 or BT.601, studio or full range. */
static struct matrix y4m_matrix_of(const struct y4m *y)
{
    struct matrix m = {0.2126, 0.0722, 16, 219, 224};

    if (y->bt601) {
        m.kr = 0.299;
        m.kb = 0.114;
    }
    if (y->full) {
        m.y0 = 0;
        m.ys = m.cs = 255;
    }
    return m;
}

#define FIX 16                 /* fraction bits of the integer arithmetic */

/* To FIX fractional bits. */
static int y4m_fixed_of(double v)
{
    return (int)lrint(v * (1 << FIX));
}

/* w (3,4), fixed point: Y, Cb and Cr from red, green, blue and 1, rounding
 * included. */
static void y4m_weights(int32_t w[3][4], const struct y4m *y)
{
    const struct matrix m = y4m_matrix_of(y);
    const double ys = m.ys / 255, cs = m.cs / 255;
    const double b2 = cs / (2 * (1 - m.kb)), r2 = cs / (2 * (1 - m.kr));
    const int half = 1 << (FIX - 1), c0 = y4m_fixed_of(128) + half;
    const int yr = y4m_fixed_of(m.kr * ys), yb = y4m_fixed_of(m.kb * ys);
    const int br = y4m_fixed_of(-m.kr * b2), bb = y4m_fixed_of(cs / 2);
    const int rb = y4m_fixed_of(-m.kb * r2), rr = y4m_fixed_of(cs / 2);
    const int32_t of[3][4] = {
        {yr, y4m_fixed_of(ys) - yr - yb, yb, y4m_fixed_of(m.y0) + half},
        {br, -br - bb, bb, c0}, {rr, -rr - rb, rb, c0}};

    memcpy(w, of, sizeof of);
}

void y4m_from_rgb(uint8_t *planes, const uint8_t *rgb, const struct y4m *y)
{
    const size_t N = y->width * y->height;
    int32_t m[3][4];

    y4m_weights(m, y);
    CPU_PICK(compose_kernels)->planes((uint8_t *[3]){planes, planes + N,
                                                     planes + 2 * N}, rgb, N, m);
}

/* Where a row of chroma lies for luma row i: the upper of two, and the weight
 * of the lower in 1/4 (sites are multiples of half a luma pixel). */
static size_t y4m_chroma_at(size_t i, double site, size_t n, int *weight)
{
    double c = ((double)i - site) / 2;
    size_t k;

    if (c <= 0) {
        *weight = 0;
        return 0;
    }
    k = (size_t)c;
    if (k + 1 >= n) {
        *weight = 0;
        return n - 1;
    }
    *weight = (int)lrint((c - (double)k) * 4);
    return k;
}

#define CHROMA_RUN 256          /* pixels of a row at a time; even */
#define CHROMA_HALF (CHROMA_RUN / 2)
#define CHROMA_ROOM (CHROMA_HALF + 16)  /* and their neighbours; whole vectors */

/* A run's samples of a row of chroma where one is of two pixels: from the one
 * before `first` to the one after the run, the row's ends repeated. */
static void y4m_chroma_samples(uint8_t *out, const uint8_t *row, size_t width,
                               size_t first)
{
    const size_t left = width - first;
    const size_t n = left < CHROMA_HALF + 1 ? left : CHROMA_HALF + 1;

    out[0] = row[first ? first - 1 : 0];
    memcpy(out + 1, row + first, n);
    out[n + 1] = row[width - 1];
}

/* Chroma of luma row v from column u0 (even) on, in 1/16 levels from the
 * middle: a run, of which what is past the row's end is anything.  Where chroma
 * is halved, the first of two pixels lies between its sample and the one
 * before, the second between that and the next. */
static void y4m_chroma_run(int16_t *out, const uint8_t *plane, int step,
                           const struct y4m *y, size_t v, size_t u0)
{
    const size_t cw = y4m_chroma_width(y);
    const int before = (int)lrint(2 * y->site_x), after = 2 - before;
    uint8_t upper[CHROMA_ROOM] = {0}, lower[CHROMA_ROOM] = {0};
    int16_t c[CHROMA_ROOM];
    int weight = 0;             /* of the lower row, in 1/4 */

    if (y->chroma == Y4M_420)
        v = y4m_chroma_at(v, y->site_y, y4m_chroma_height(y), &weight);
    plane += (ptrdiff_t)v * step;
    if (y->chroma == Y4M_444) {
        for (size_t i = 0; i < CHROMA_RUN && u0 + i < cw; i++)
            out[i] = (int16_t)(16 * (plane[u0 + i] - 128));
        return;
    }
    y4m_chroma_samples(upper, plane, cw, u0 / 2);
    y4m_chroma_samples(lower, weight ? plane + step : plane, cw, u0 / 2);
    for (int i = 0; i < CHROMA_ROOM; i++)
        c[i] = (int16_t)(upper[i] * (4 - weight) + lower[i] * weight - 4 * 128);
    for (int i = 0; i < CHROMA_HALF; i++) {
        out[2 * i] = (int16_t)(c[i] * before + c[i + 1] * (4 - before));
        out[2 * i + 1] = (int16_t)(c[i + 1] * (4 - after) + c[i + 2] * after);
    }
}

/* The reverse of y4m_weights, in fixed point: red, green and blue from luma,
 * two chroma values in 1/16 levels from their middle, and 1. */
static void y4m_inverse_weights(int32_t w[3][4], const struct y4m *y)
{
    const struct matrix m = y4m_matrix_of(y);
    const double kg = 1 - m.kr - m.kb, c = 255 / m.cs / 16;
    const int ys = y4m_fixed_of(255 / m.ys);
    const int rv = y4m_fixed_of(2 * (1 - m.kr) * c);
    const int bu = y4m_fixed_of(2 * (1 - m.kb) * c);
    const int gu = y4m_fixed_of(-2 * (1 - m.kb) * m.kb / kg * c);
    const int gv = y4m_fixed_of(-2 * (1 - m.kr) * m.kr / kg * c);
    const int l = (1 << (FIX - 1)) - (int)m.y0 * ys;
    const int32_t of[3][4] = {{ys, 0, rv, l}, {ys, gu, gv, l}, {ys, bu, 0, l}};

    memcpy(w, of, sizeof of);
}

void y4m_rows_to_rgb(uint8_t *rgb, size_t stride,
                     const uint8_t *const plane[3], const int step[3],
                     const struct y4m *y)
{
    const struct compose_kernels *kernels = CPU_PICK(compose_kernels);
    int16_t u[CHROMA_RUN] = {0}, v[CHROMA_RUN] = {0};
    int32_t m[3][4];

    y4m_inverse_weights(m, y);
    for (size_t i = 0; i < y->height; i++, rgb += stride)
        for (size_t x = 0; x < y->width; x += CHROMA_RUN) {
            const size_t left = y->width - x;

            if (y->chroma != Y4M_MONO) {
                y4m_chroma_run(u, plane[1], step[1], y, i, x);
                y4m_chroma_run(v, plane[2], step[2], y, i, x);
            }
            kernels->rgb(rgb + 3 * x, plane[0] + (ptrdiff_t)i * step[0] + x, u,
                         v, left < CHROMA_RUN ? left : CHROMA_RUN, m);
        }
}

void y4m_to_rgb(uint8_t *rgb, const uint8_t *planes, const struct y4m *y)
{
    const size_t N = y->width * y->height, width = y4m_chroma_width(y);
    const uint8_t *cb = planes + N, *cr = cb + width * y4m_chroma_height(y);
    const int step[3] = {(int)y->width, (int)width, (int)width};

    y4m_rows_to_rgb(rgb, 3 * y->width, (const uint8_t *[3]){planes, cb, cr},
                    step, y);
}
