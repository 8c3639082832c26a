/* The renderer's stage of spid-bench, further rows: gradients, moving scenes,
 * growth with Gaussians and pixels. */
#include "lib/lab/bench/bench_splat.h"
#include "lib/splat/splat.h"
#include "lib/splat/types.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/random.h"
#include "lib/lab/bench/testscene.h"
#include "lib/splat/reference.h"

/* A renderer with all its buffers, as bench_time calls it. */
struct job {
    struct splat s;
    struct testscene scene;
    struct splat_camera cam;
    float *image, *alpha, *d_image, *gradient;
    struct splat_gradients g;
    float turn;
};

/* Buffers, a random gradient of the picture, and the renderer, loaded. */
static int bench_job_open(struct job *j, const struct splat_options *opt,
                          struct error *err)
{
    size_t pixels = (size_t)opt->width * (size_t)opt->height;
    size_t C = (size_t)opt->channels, N = j->scene.g.n;
    struct random r;

    j->cam = splat_camera_square(j->scene.cam, opt->width, 12);
    j->image = calloc(pixels * C, sizeof *j->image);
    j->alpha = calloc(pixels, sizeof *j->alpha);
    j->d_image = calloc(pixels * C, sizeof *j->d_image);
    j->gradient = calloc(N * (11 + C) + 12, sizeof *j->gradient);
    if (!j->image || !j->alpha || !j->d_image || !j->gradient)
        return error_set(err, EX_OSERR, "out of memory");
    j->g = (struct splat_gradients){
        j->gradient, j->gradient + 3 * N, j->gradient + 6 * N,
        j->gradient + 10 * N, j->gradient + 11 * N,
        j->gradient + (11 + C) * N, NULL};
    random_init(&r, 1, "bench gradient");
    for (size_t i = 0; i < pixels * C; i++)
        j->d_image[i] = (float)random_range(&r, -1, 1);
    if (splat_init(&j->s, opt, err) || splat_load(&j->s, &j->scene.g, err))
        return -1;
    return 0;
}

static void bench_job_close(struct job *j)
{
    splat_release(&j->s);
    testscene_release(&j->scene);
    free(j->image);
    free(j->alpha);
    free(j->d_image);
    free(j->gradient);
    memset(j, 0, sizeof *j);
}

/* For bench_time: a frame, the camera moved by a hair. */
static int bench_job_draw(void *context, struct error *err)
{
    struct job *j = context;
    struct splat_camera cam = j->cam;

    j->turn = j->turn > 0 ? 0 : 1e-6f;
    cam.rt[3] += j->turn;
    return splat_forward(&j->s, j->image, j->alpha, NULL, &cam, NULL, err);
}

/* And its gradients. */
static int bench_job_draw_and_back(void *context, struct error *err)
{
    struct job *j = context;

    return bench_job_draw(j, err) ||
           splat_backward(&j->s, &j->g, j->d_image, NULL, err);
}

/* ---- backward ------------------------------------------------------------ */

/* ||x - t|| / ||t|| */
static double bench_job_relative(const float *x, const double *t, size_t n)
{
    double d = 0, s = 0;

    for (size_t i = 0; i < n; i++) {
        d += (x[i] - t[i]) * (x[i] - t[i]);
        s += t[i] * t[i];
    }
    return sqrt(d) / fmax(sqrt(s), 1e-300);
}

/* Say how far the gradients are from double, array by array. */
static int bench_gradient_note(struct bench *b, struct job *j,
                               const char *config, const char *level,
                               struct error *err)
{
    size_t N = j->scene.g.n, C = (size_t)j->s.opt.channels;
    size_t all = N * (11 + C) + 12;
    size_t values = (size_t)j->s.opt.width * (size_t)j->s.opt.height * C;
    double *t = calloc(all, sizeof *t), *d = calloc(values, sizeof *d);
    struct reference truth = {0};
    int rc = -1;

    if (!t || !d) {
        error_set(err, EX_OSERR, "out of memory");
        goto out;
    }
    struct reference_gradients g = {t, t + 3 * N, t + 6 * N, t + 10 * N,
                                      t + 11 * N, t + (11 + C) * N, NULL,
                                      NULL};

    for (size_t i = 0; i < values; i++)
        d[i] = j->d_image[i];
    memset(j->gradient, 0, all * sizeof *j->gradient);
    j->turn = 1;
    if (bench_job_draw_and_back(j, err) ||
        reference_init(&truth, &j->scene.g, &j->cam, j->s.opt.width,
                       j->s.opt.height, (int)C, SPLAT_GSPLAT, 0, err) ||
        reference_backward(&g, &truth, d, NULL, err))
        goto out;
    bench_note(b,
               "splat %s%s%s gradients, relative L2 against double: mean "
               "%.1e scale %.1e quat %.1e opacity %.1e color %.1e camera %.1e",
               config, *level ? " " : "", level,
               bench_job_relative(j->g.mean, g.mean, 3 * N),
               bench_job_relative(j->g.scale, g.scale, 3 * N),
               bench_job_relative(j->g.quat, g.quat, 4 * N),
               bench_job_relative(j->g.opacity, g.opacity, N),
               bench_job_relative(j->g.color, g.color, C * N),
               bench_job_relative(j->g.rt, g.rt, 12));
    rc = 0;
out:
    reference_release(&truth);
    free(t);
    free(d);
    return rc;
}

/* Forward and backward at one instruction set; the best's rows have no word
 * for it. */
static int bench_backward_row(struct bench *b, double seconds, size_t n,
                              int size, int channels, enum cpu_level level,
                              struct error *err)
{
    struct splat_options opt = splat_defaults(size, size, channels);
    bool best = level == cpu_level();
    const char *at = best ? "" : ", ";
    const char *name = best ? "" : cpu_level_name(level);
    struct bench_times t;
    struct job j = {0};
    char config[96], knob[64];
    int rc = -1;

    opt.gradients = true;
    opt.fixed16 = false;
    opt.threads = b->threads;
    opt.level_set = true;
    opt.level = level;
    snprintf(config, sizeof config, "%dx%d N=%zu C=%d f32", size, size, n,
             channels);
    if (testscene_make(&j.scene, n, 2026, err) ||
        bench_job_open(&j, &opt, err) ||
        bench_time(&t, seconds, 10, bench_job_draw, &j, err))
        goto out;
    snprintf(knob, sizeof knob, "forward%s%s", at, name);
    bench_add(b, "splat", config, knob, b->threads, &t, NAN, NAN);
    if (bench_time(&t, seconds, 10, bench_job_draw_and_back, &j, err))
        goto out;
    snprintf(knob, sizeof knob, "forward + backward%s%s", at, name);
    bench_add(b, "splat", config, knob, b->threads, &t, NAN, NAN);
    rc = bench_gradient_note(b, &j, config, name, err);
out:
    bench_job_close(&j);
    return rc;
}

int bench_splat_backward(struct bench *b, double seconds, struct error *err)
{
    static const struct { size_t n; int size, channels; } row[] = {
        {30000, 128, 3}, {30000, 256, 3}, {30000, 128, 32},
        {30000, 256, 32}, {TESTSCENE_N, 512, 3}, {TESTSCENE_N, 512, 32}};

    for (size_t i = 0; i < sizeof row / sizeof *row; i++)
        for (int level = (int)cpu_level(); level >= 0; level--)
            if ((level == (int)cpu_level() || row[i].size == 256) &&
                bench_backward_row(b, seconds, row[i].n, row[i].size,
                                   row[i].channels, (enum cpu_level)level, err))
                return -1;
    return 0;
}

/* ---- moving -------------------------------------------------------------- */

/* The dynamic Gaussians move a little and back, as GMOV has them; the camera
 * stays. */
struct moving {
    struct job *job;
    float *mean;
    size_t count;
};

/* For bench_time: some Gaussians move, the camera stays. */
static int bench_job_draw_moved(void *context, struct error *err)
{
    struct moving *m = context;
    struct job *j = m->job;

    j->turn = j->turn > 0 ? -1e-3f : 1e-3f;
    for (size_t i = 0; i < m->count; i++)
        m->mean[3 * i] += j->turn;
    if (m->count && splat_update(&j->s, m->mean, 0, m->count, err))
        return -1;
    return splat_forward(&j->s, j->image, j->alpha, NULL, &j->cam, NULL, err);
}

/* Say how long each step of a frame takes at least. */
static int bench_phase_note(struct bench *b, struct job *j, int threads,
                            struct error *err)
{
    double min[SPLAT_PHASES] = {1e9, 1e9, 1e9, 1e9};

    if (bench_job_draw(j, err))          /* the camera may be where it was */
        return -1;
    for (int run = 0; run < 40; run++) {
        if (bench_job_draw(j, err))
            return -1;
        for (int k = 0; k < SPLAT_PHASES; k++)
            min[k] = fmin(min[k], j->s.ms[k]);
    }
    bench_note(b, "splat %d thread%s: project %.2f, sort %.2f, tile lists "
               "%.2f, draw %.2f ms (least of 40 frames)", threads,
               threads > 1 ? "s" : "", min[SPLAT_PROJECT],
               min[SPLAT_SORT], min[SPLAT_BIN], min[SPLAT_DRAW]);
    return 0;
}

/* Rows for all, some and no Gaussians moved; phases and memory. */
static int bench_moving_rows(struct bench *b, double seconds, int threads,
                             struct error *err)
{
    struct splat_options opt = splat_defaults(512, 512, 3);
    struct bench_times t;
    struct job j = {0};
    char config[96];
    int rc = -1;

    opt.threads = threads;
    if (testscene_make(&j.scene, TESTSCENE_N, 2026, err) ||
        bench_job_open(&j, &opt, err))
        goto out;
    size_t dynamic = j.scene.g.n * 20018 / TESTSCENE_N;
    struct { const char *name; size_t count; } row[] = {
        {"20018 moved, camera still", dynamic}, {"nothing moved", 0}};
    struct moving m = {&j, (float *)j.scene.g.mean, 0};

    snprintf(config, sizeof config, "512x512 N=%zu C=3 f32", j.scene.g.n);
    if (bench_time(&t, seconds, 10, bench_job_draw, &j, err))
        goto out;
    bench_add(b, "splat", config, "camera moved", threads, &t, NAN, NAN);
    for (size_t i = 0; i < 2; i++) {
        m.count = row[i].count;
        if (bench_time(&t, seconds, 10, bench_job_draw_moved, &m, err))
            goto out;
        bench_add(b, "splat", config, row[i].name, threads, &t, NAN, NAN);
    }
    if (bench_phase_note(b, &j, threads, err))
        goto out;
    double record = (double)j.scene.g.n * (3 + 3 + 4 + 1 + 3) * sizeof(float);

    bench_note(b, "splat memory: %.1f MB, %.1f times a GAUS record of three "
               "float channels (%.1f MB), picture apart",
               (double)j.s.bytes / 1e6, (double)j.s.bytes / record,
               record / 1e6);
    rc = 0;
out:
    bench_job_close(&j);
    return rc;
}

int bench_splat_moving(struct bench *b, double seconds, struct error *err)
{
    return bench_moving_rows(b, seconds, 1, err) ||
           (b->threads > 1 && bench_moving_rows(b, seconds, b->threads, err));
}

/* ---- growth -------------------------------------------------------------- */
