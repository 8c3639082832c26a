/* Scenes with the statistics of a baked head (how many Gaussians of what size
 * and opacity lie where), drawn from a seed. */
#include "lib/lab/bench/testscene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/safetensors.h"
#include "lib/base/random.h"
#include "lib/splat/reference.h"
#include "lib/splat/splat.h"

#define CHANNELS 32

/* Arrays for n Gaussians in two blocks. */
static int testscene_allocate(struct testscene *t, size_t n, struct error *err)
{
    float *f = malloc((n + 1) * (3 + 3 + 4 + 1 + CHANNELS) * sizeof *f);
    uint8_t *branch = malloc(n + 1);

    memset(t, 0, sizeof *t);
    if (!f || !branch) {
        free(f);
        free(branch);
        return error_set(err, EX_OSERR, "out of memory");
    }
    t->g = (struct gaussians){
        .n = n, .channels = CHANNELS, .mean = f, .scale = f + 3 * n,
        .quat = f + 6 * n, .opacity = f + 10 * n, .color = f + 11 * n,
        .branch = branch};
    return 0;
}

void testscene_release(struct testscene *t)
{
    free((void *)t->g.mean);
    free((void *)t->g.branch);
    memset(t, 0, sizeof *t);
}

/* One element of the mixture: half uniform in 0.05..0.99, 30 % high, 20 %
 * low. */
static float testscene_opacity(struct random *r)
{
    double kind = random_uniform(r);

    if (kind < 0.5)
        return (float)random_range(r, 0.05, 0.99);
    return (float)(kind < 0.8 ? random_range(r, 0.85, 0.99)
                   : random_range(r, 0.05, 0.2));
}

/* Log-normal scales about sigma, any rotation, an opacity of the mixture. */
static void testscene_put_shape(struct testscene *t, size_t i, double sigma,
                                double spread, struct random *r)
{
    float *scale = (float *)t->g.scale + 3 * i;
    float *quat = (float *)t->g.quat + 4 * i;
    double len = 0, q[4];

    for (int k = 0; k < 3; k++)
        scale[k] = (float)(sigma * exp(spread * random_normal(r)));
    for (int k = 0; k < 4; k++) {
        q[k] = random_normal(r);
        len += q[k] * q[k];
    }
    for (int k = 0; k < 4; k++)
        quat[k] = (float)(q[k] / sqrt(len));
    ((float *)t->g.opacity)[i] = testscene_opacity(r);
}

/* Smooth colours with noise; the other channels uniform. */
static void testscene_put_colors(struct testscene *t, size_t i,
                                 struct random *r)
{
    const float *m = t->g.mean + 3 * i;
    float *c = (float *)t->g.color + CHANNELS * i;

    for (int k = 0; k < 3; k++)
        c[k] = (float)fmin(fmax(0.5 + 0.35 * sin(9 * m[k] + 2 * k) +
                                0.12 * random_normal(r), 0), 1);
    for (int k = 3; k < CHANNELS; k++)
        c[k] = (float)random_range(r, -0.5, 0.5);
}

/* Centre i. */
static void testscene_put_mean(struct testscene *t, size_t i, double x,
                               double y, double z)
{
    float *m = (float *)t->g.mean + 3 * i;

    m[0] = (float)x;
    m[1] = (float)y;
    m[2] = (float)z;
}

/* A point of the head's surface. */
static void testscene_on_ellipsoid(struct testscene *t, size_t i,
                                   struct random *r)
{
    double z = random_range(r, -1, 1), a = random_range(r, 0, 2 * M_PI);
    double s = sqrt(1 - z * z);

    testscene_put_mean(t, i, 0.45 * s * cos(a), 0.6 * s * sin(a), 0.5 * z);
}

/* Cell k of an across x down grid over the square of that half width. */
static void testscene_on_sheet(struct testscene *t, size_t i, size_t k,
                               size_t across, struct random *r)
{
    double cell = 2 / (double)across;
    double x = -1 + cell * ((double)(k % across) + 0.5);
    double y = 1 - cell * ((double)(k / across) + 0.5);
    double relief = -0.55 + 1.1 * exp(-2.2 * (x * x + y * y)) +
                    0.01 * random_normal(r);

    y += 0.3 * cell * random_normal(r);
    x += 0.3 * cell * random_normal(r);
    testscene_put_mean(t, i, x, y, relief);
}

/* Cell k of the mouth sheet's grid. */
static void testscene_on_mouth(struct testscene *t, size_t i, size_t k,
                               size_t across, struct random *r)
{
    double x = ((double)(k % across) + 0.5) / (double)across * 2 - 1;
    double y = ((double)(k / across) + 0.5) / (double)across * 2 - 1;

    testscene_put_mean(t, i, 0.1 * x, -0.25 + 0.06 * y,
                       0.42 + 0.01 * random_normal(r));
}

int testscene_make(struct testscene *t, size_t n, uint64_t seed,
                   struct error *err)
{
    static const float cam[12] = {
        0.99021602f, 0, 0.13954312f, 0.01f,
        -0.0069742491f, -0.99875027f, 0.049490172f, -0.02f,
        0.13936873f, -0.049979169f, -0.98897851f, 12};
    size_t dynamic = n * 20018 / TESTSCENE_N, mouth = n * 1024 / TESTSCENE_N;
    size_t flat = n - dynamic - mouth;
    size_t across = (size_t)fmax(ceil(sqrt((double)flat)), 1);
    size_t teeth = (size_t)fmax(ceil(sqrt((double)mouth)), 1);
    double grow = sqrt((double)TESTSCENE_N / (double)(n ? n : 1));
    struct random r;

    if (testscene_allocate(t, n, err))
        return -1;
    random_init(&r, seed, "testscene");
    memcpy(t->cam, cam, sizeof cam);
    for (size_t i = 0; i < n; i++) {
        int branch = i < dynamic ? 0 : i < dynamic + flat ? 1 : 2;

        if (branch == 0)
            testscene_on_ellipsoid(t, i, &r);
        else if (branch == 1)
            testscene_on_sheet(t, i, i - dynamic, across, &r);
        else
            testscene_on_mouth(t, i, i - dynamic - flat, teeth, &r);
        testscene_put_shape(t, i,
                            grow * (branch == 0   ? 0.014
                                    : branch == 1 ? 0.0078
                                                  : 0.006),
                            branch == 1 ? 0.33 : 0.25, &r);
        testscene_put_colors(t, i, &r);
        ((uint8_t *)t->g.branch)[i] = (uint8_t)branch;
    }
    return 0;
}

/* Copy a tensor of the file over the scene's array. */
static int testscene_take(void *out, const struct safetensors *st,
                          const char *name, size_t n, size_t row,
                          struct error *err)
{
    size_t dims[2] = {n, row}, count;
    float *x = st_load_f32(st, name, row > 1 ? 2 : 1, dims, &count, err);

    if (!x)
        return -1;
    memcpy(out, x, count * sizeof *x);
    free(x);
    return 0;
}

/* All arrays of a file but the branches. */
static int testscene_take_all(struct testscene *t, const struct safetensors *st,
                              size_t channels, struct error *err)
{
    size_t n = t->g.n, dims[2] = {n, channels}, count, cam[2] = {3, 4};
    float *x;

    if (testscene_take((void *)t->g.mean, st, "mean", n, 3, err) ||
        testscene_take((void *)t->g.scale, st, "scale", n, 3, err) ||
        testscene_take((void *)t->g.quat, st, "quat", n, 4, err) ||
        testscene_take((void *)t->g.opacity, st, "opacity", n, 1, err) ||
        !(x = st_load_f32(st, "color", 2, dims, &count, err)))
        return -1;
    uint64_t key = random_name("bench.colors") ^ 2026;

    for (size_t i = 0; i < n * CHANNELS; i++) {
        size_t c = i % CHANNELS;
        double u = (double)(random_mix(key + i) >> 40) / 16777216;

        ((float *)t->g.color)[i] =
            c < channels ? x[i / CHANNELS * channels + c] : (float)(u - 0.5);
    }
    free(x);
    memset((void *)t->g.branch, 0, n);
    const struct st_tensor *b = st_find(st, "branch");

    if (b && b->dtype == ST_U8 && b->count == n)
        memcpy((void *)t->g.branch, b->data, n);
    if (!(x = st_load_f32(st, "cam", 2, cam, &count, err)))
        return -1;
    memcpy(t->cam, x, sizeof t->cam);
    free(x);
    return 0;
}

int testscene_load(struct testscene *t, const char *path, struct error *err)
{
    struct safetensors *st = st_open(path, err);
    int rc = -1;

    memset(t, 0, sizeof *t);
    if (!st)
        return -1;
    const struct st_tensor *c = st_find(st, "color");

    if (!c || c->ndim != 2 || c->dim[1] < 1 || c->dim[1] > CHANNELS) {
        error_set(err, EX_DATAERR, "%s: no color (N,C) (expected 1 to %d "
                  "channels)", path, CHANNELS);
        goto out;
    }
    if (testscene_allocate(t, c->dim[0], err) ||
        testscene_take_all(t, st, c->dim[1], err))
        goto out;
    rc = 0;
out:
    st_close(st);
    if (rc)
        testscene_release(t);
    return rc;
}

size_t testscene_pairs(const struct testscene *t, int size, struct error *err)
{
    struct splat_camera cam = splat_camera_square(t->cam, size, 12);
    struct reference truth;
    size_t pairs = 0;

    if (reference_init(&truth, &t->g, &cam, size, size, 1, SPLAT_GSPLAT, 0,
                       err))
        return 0;
    for (size_t i = 0; i < t->g.n; i++) {
        struct reference_point p;

        reference_project(&p, &truth, i);
        double limit = log(truth.opacity[i] * 255);

        if (!p.front || !(limit > 0))
            continue;
        double rx = sqrt(2 * limit * p.cov[0]), ry = sqrt(2 * limit * p.cov[2]);
        int x0 = (int)fmax(p.x - rx - 1, 0), x1 = (int)fmin(p.x + rx + 1, size);
        int y0 = (int)fmax(p.y - ry - 1, 0), y1 = (int)fmin(p.y + ry + 1, size);

        for (int y = y0; y < y1; y++)
            for (int x = x0; x < x1; x++) {
                double dx = x + 0.5 - p.x, dy = y + 0.5 - p.y;

                pairs += 0.5 * (p.conic[0] * dx * dx + p.conic[2] * dy * dy) +
                             p.conic[1] * dx * dy <= limit;
            }
    }
    reference_release(&truth);
    return pairs;
}
