/* Alignment's inner loops, every version that this processor has, against the
 * same in double precision written plainly. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/cpu.h"
#include "lib/base/random.h"
#include "lib/base/camera.h"
#include "lib/track/align_kernel.h"
#include "tests/check.h"

#define N ALIGN_SIDE
#define U ALIGN_UNKNOWNS
#define POINTS 1050             /* two blocks of the kernel's and a bit */
#define ROOM 1056
#define CODES 7                 /* directions of a face */
#define FACE 12                 /* with the light's, a multiple of 4 */

/* A picture, points that it shows, and a pose. */
struct scene {
    float rgb[12 * N * N];
    float visibility[5 * ROOM], normal[3 * ROOM];
    struct align_camera camera;
    struct align_residual r;
    float direction[3 * CODES * ROOM], x[FACE];
};

static int reference_clamp(int i)
{
    return i < 0 ? 0 : i >= N ? N - 1 : i;
}

/* Points about the picture, some of them outside or behind the camera. */
static void scene_make(struct scene *s)
{
    struct random rand;

    random_init(&rand, 3, "align kernels");
    memset(s, 0, sizeof *s);
    for (size_t i = 0; i < 12 * N * N; i++)
        s->rgb[i] = (float)random_uniform(&rand);
    s->camera = (struct align_camera){
        {0.8f, -0.6f, 0, -0.6f, -0.8f, 0, 0, 0, -1}, {0.1f, -0.05f, 11},
        1100, {50, 60}, {3, 5}, {N - 3, N - 20}};
    s->r = (struct align_residual){0.9f, 12, {0.1f, 0.02f, 10.9f}, 30};
    for (size_t i = 0; i < POINTS; i++) {
        for (size_t k = 0; k < 3; k++) {
            s->visibility[k * ROOM + i] = (float)(0.3 * random_normal(&rand));
            s->normal[k * ROOM + i] = (float)(0.6 * random_normal(&rand));
        }
        if (i % 97 == 0)
            s->visibility[2 * ROOM + i] = 12;
        s->visibility[3 * ROOM + i] = (float)(255 * random_uniform(&rand));
        s->visibility[4 * ROOM + i] = (float)random_uniform(&rand);
        for (size_t k = 0; k < 3 * CODES; k++)
            s->direction[k * ROOM + i] = (float)(0.02 * random_normal(&rand));
    }
    s->x[0] = s->r.gain;
    s->x[1] = s->r.bias;
    for (size_t k = 0; k < CODES; k++)
        s->x[ALIGN_FACE_LIGHT + k] = (float)random_normal(&rand);
}

/* Line of binomial weights along one axis, dx + dy = 1. */
static void reference_blur(double *out, const double *in, int dx, int dy)
{
    static const double weight[5] = {1, 4, 6, 4, 1};

    for (int y = 0; y < N; y++)
        for (int x = 0; x < N; x++) {
            out[N * y + x] = 0;
            for (int k = -2; k <= 2; k++)
                out[N * y + x] += weight[k + 2] / 16 *
                    in[N * reference_clamp(y + k * dy) +
                       reference_clamp(x + k * dx)];
        }
}

static void reference_picture(double *picture, const float *rgb)
{
    static double grey[N * N], line[N * N];

    for (int y = 0; y < N; y++)
        for (int x = 0; x < N; x++) {
            double sum = 0;

            for (int j = 0; j < 2; j++)
                for (int i = 0; i < 6; i++)
                    sum += rgb[6 * N * (2 * y + j) + 6 * x + i];
            grey[N * y + x] = 255 * sum / 12;
        }
    for (int k = 0; k < 2; k++) {
        reference_blur(line, grey, 1, 0);
        reference_blur(grey, line, 0, 1);
    }
    for (int y = 0; y < N; y++)
        for (int x = 0; x < N; x++) {
            double *p = picture + 3 * (N * y + x);

            p[0] = grey[N * y + x];
            p[1] = (grey[N * y + reference_clamp(x + 1)] -
                    grey[N * y + reference_clamp(x - 1)]) / 2;
            p[2] = (grey[N * reference_clamp(y + 1) + x] -
                    grey[N * reference_clamp(y - 1) + x]) / 2;
        }
}

/* x (3) by the camera and level (3) of point i; whether it may be looked at. */
static bool reference_see(double x[3], double level[3],
                          const struct scene *s, const double *picture,
                          size_t i)
{
    double uv[2];

    for (int k = 0; k < 3; k++) {
        x[k] = s->camera.t[k];
        for (int c = 0; c < 3; c++)
            x[k] += (double)s->camera.R[3 * k + c] * s->visibility[c * ROOM + i];
    }
    for (int k = 0; k < 2; k++) {
        uv[k] = s->camera.focal * x[k] / x[2] + s->camera.corner[k];
        if (x[2] < CAMERA_NEAR || uv[k] <= s->camera.low[k] ||
            uv[k] >= s->camera.high[k])
            return false;
    }
    const int left = (int)(uv[0] - 0.5), top = (int)(uv[1] - 0.5);
    const double wx = uv[0] - 0.5 - left, wy = uv[1] - 0.5 - top;

    for (int k = 0; k < 3; k++) {
        const double *p = picture + 3 * (N * top + left) + k;

        level[k] = (1 - wy) * ((1 - wx) * p[0] + wx * p[3]) +
                   wy * ((1 - wx) * p[3 * N] + wx * p[3 * N + 3]);
    }
    return true;
}

/* How the level at x changes with the unknowns. */
static void reference_row(double row[U], const struct scene *s,
                          const double x[3], const double level[3])
{
    const double f = (double)s->r.gain * s->camera.focal / x[2];
    double g[3] = {f * level[1], f * level[2],
                   -f * (level[1] * x[0] + level[2] * x[1]) / x[2]};
    double o[3] = {x[0] - s->r.centre[0], x[1] - s->r.centre[1],
                   x[2] - s->r.centre[2]};

    for (int k = 0; k < 3; k++) {
        int a = (k + 1) % 3, b = (k + 2) % 3;

        row[k] = o[a] * g[b] - o[b] * g[a];
        row[3 + k] = g[k];
    }
    row[6] = level[0];
    row[7] = 1;
}

/* One row (n) more in normal equations a x = b. */
static void reference_add(double *a, double *b, const double *row, int n,
                          double weight, double r)
{
    for (int m = 0; m < n; m++) {
        b[m] += weight * row[m] * r;
        for (int k = 0; k <= m; k++)
            a[n * m + k] += weight * row[m] * row[k];
    }
}

static void reference_sum(struct align_sums *to, const struct scene *s,
                          const double *picture)
{
    memset(to, 0, sizeof *to);
    for (size_t i = 0; i < POINTS; i++) {
        const double y = s->visibility[3 * ROOM + i], w = s->visibility[4 * ROOM + i];
        double x[3], level[3], row[U];

        if (!reference_see(x, level, s, picture, i))
            continue;
        const double r = s->r.gain * level[0] + s->r.bias - y;
        const double narrow = w / (1 + r * r / (4 * s->r.sigma * s->r.sigma));

        to->weight += w;
        to->off += w * fabs(r);
        to->x += w * level[0];
        to->y += w * y;
        to->xx += w * level[0] * level[0];
        to->xy += w * level[0] * y;
        to->yy += w * y * y;
        reference_row(row, s, x, level);
        reference_add(to->a, to->b, row, U, narrow, r);
    }
}

/* Largest difference of normal equations a x = b in n unknowns from true ones,
 * each number by its own size, b's by `square`, and at least `least`. */
static double align_equations_difference(const double *a, const double *b,
                                         const double *ta, const double *tb,
                                         int n, double square, double least)
{
    double worst = 0;

    for (int m = 0; m < n; m++) {
        const double own = sqrt(ta[n * m + m]);

        for (int k = 0; k <= m; k++)
            worst = fmax(worst, fabs(a[n * m + k] - ta[n * m + k]) /
                                    (own * sqrt(ta[n * k + k]) + least));
        worst = fmax(worst, fabs(b[m] - tb[m]) / (own * sqrt(square) + least));
    }
    return worst;
}

/* Largest difference of the sums, each by its own size. */
static double align_sums_difference(const struct align_sums *a,
                                    const struct align_sums *b)
{
    const double one[7] = {a->weight, a->off, a->x, a->y, a->xx, a->xy, a->yy};
    const double two[7] = {b->weight, b->off, b->x, b->y, b->xx, b->xy, b->yy};
    double worst = 0;

    for (int k = 0; k < 7; k++)
        worst = fmax(worst, fabs(one[k] - two[k]) / two[k]);
    return fmax(worst, align_equations_difference(a->a, a->b, b->a, b->b, U,
                                                  b->yy, 0));
}

/* s's points, moved by its directions. */
static void reference_move(struct scene *moved, const struct scene *s)
{
    *moved = *s;
    for (size_t i = 0; i < POINTS; i++)
        for (size_t k = 0; k < 3 * CODES; k++)
            moved->visibility[k % 3 * ROOM + i] +=
                s->x[ALIGN_FACE_LIGHT + k / 3] * s->direction[k * ROOM + i];
}

/* How the level changes with light and directions of point i. */
static void reference_face_row(double row[FACE], const struct scene *s,
                               const double x[3], const double level[3],
                               size_t i)
{
    double own[U];

    reference_row(own, s, x, level);
    memset(row, 0, FACE * sizeof *row);
    row[0] = level[0];
    row[1] = 1;
    for (size_t k = 0; k < 3 * CODES; k++)
        for (size_t c = 0; c < 3; c++)
            row[ALIGN_FACE_LIGHT + k / 3] +=
                own[3 + c] * s->camera.R[3 * c + k % 3] *
                s->direction[k * ROOM + i];
}

static void reference_face(struct align_face_sums *to, const struct scene *s,
                           const double *picture)
{
    static struct scene moved;

    reference_move(&moved, s);
    memset(to, 0, sizeof *to);
    for (size_t i = 0; i < POINTS; i++) {
        const double w = s->visibility[4 * ROOM + i];
        double x[3], level[3], row[FACE];

        if (!reference_see(x, level, &moved, picture, i))
            continue;
        const double r = s->r.gain * level[0] + s->r.bias -
                         s->visibility[3 * ROOM + i];
        const double narrow = w / (1 + r * r / (4 * s->r.sigma * s->r.sigma));

        to->weight += w;
        to->off += w * fabs(r);
        reference_face_row(row, s, x, level, i);
        reference_add(to->a, to->b, row, FACE, narrow, r);
    }
}

/* Largest difference of a face's sums, each by its own size. */
static double align_face_sums_difference(const struct align_face_sums *a,
                                         const struct align_face_sums *b)
{
    double worst = fmax(fabs(a->weight - b->weight) / b->weight,
                        fabs(a->off - b->off) / b->off);

    return fmax(worst, align_equations_difference(a->a, a->b, b->a, b->b, FACE,
                                                  b->a[0], 1e-9));
}

static double show_apart(const struct align_kernels *k, const struct scene *s,
                         const align_pixel *picture, const double *exact)
{
    static float level[ROOM], facing[ROOM];
    double worst = 0;

    k->show(level, facing, s->visibility, s->normal, ROOM, picture, &s->camera);
    for (size_t i = 0; i < POINTS; i++) {
        double x[3], seen[3] = {0}, along = 0;

        if (reference_see(x, seen, s, exact, i)) {
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 3; c++)
                    along -= x[r] * s->camera.R[3 * r + c] *
                             s->normal[c * ROOM + i];
            along /= sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        }
        worst = fmax(worst, fabs(level[i] - seen[0]) / 255);
        worst = fmax(worst, fabs(facing[i] - along));
    }
    return worst;
}

/* A face's sums of one version. */
static void test_face(const struct align_kernels *k, const char *name,
                      const struct scene *s, const align_pixel *picture,
                      const double *exact)
{
    static struct align_face_sums sums, truth;
    const struct align_face_points points = {
        s->visibility, s->direction, s->visibility + 3 * ROOM, s->visibility + 4 * ROOM,
        ROOM, CODES};
    char title[64];

    k->face(&sums, &points, s->x, FACE, picture, &s->camera, s->r.sigma);
    reference_face(&truth, s, exact);
    snprintf(title, sizeof title, "%s: a face's sums", name);
    check(title, align_face_sums_difference(&sums, &truth), 1e-5);
}

/* One version's functions. */
static void test_kernels(const struct align_kernels *k, const char *name,
                         const struct scene *s)
{
    static _Alignas(64) align_pixel picture[N * N];
    static double exact[3 * N * N];
    static float work[2 * N * N];
    struct align_sums sums, truth, brief;
    double worst = 0;
    char title[64];

    k->picture(picture, work, s->rgb);
    reference_picture(exact, s->rgb);
    for (size_t i = 0; i < 3 * N * N; i++)
        worst = fmax(worst, fabs(picture[i / 3][i % 3] - exact[i]));
    snprintf(title, sizeof title, "%s: picture, of 255", name);
    check(title, worst, 1e-4);
    snprintf(title, sizeof title, "%s: levels and facing", name);
    check(title, show_apart(k, s, picture, exact), 2e-5);
    k->sum(&sums, s->visibility, ROOM, picture, &s->camera, &s->r, true);
    reference_sum(&truth, s, exact);
    snprintf(title, sizeof title, "%s: sums", name);
    check(title, align_sums_difference(&sums, &truth), 1e-5);
    k->sum(&brief, s->visibility, ROOM, picture, &s->camera, &s->r, false);
    snprintf(title, sizeof title, "%s: without a step the same sums", name);
    check_that(title, brief.weight == sums.weight && brief.off == sums.off &&
                          brief.xy == sums.xy && brief.a[0] == 0);
    test_face(k, name, s, picture, exact);
}

int main(void)
{
    static struct scene s;

    scene_make(&s);
    test_kernels(&align_kernels_baseline, "baseline", &s);
#ifdef SPID_X86
    if (cpu_level() >= CPU_AVX2)
        test_kernels(&align_kernels_avx2, "AVX2", &s);
    if (cpu_level() >= CPU_AVX512)
        test_kernels(&align_kernels_avx512, "AVX-512", &s);
#endif
    return check_status();
}
