/* The renderer's stage of spid-bench: every knob's time and its error against
 * two pictures in double, without cut-offs and with the same rules; gradients. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/arena.h"
#include "lib/base/cpu.h"
#include "lib/base/half.h"
#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/lab/bench/testscene.h"
#include "lib/splat/reference.h"
#include "lib/splat/splat.h"
#include "lib/splat/types.h"

#define SIZE 512

/* The scene, and two truths of its picture with all channels: no cut-offs,
 * and the same rules in double. */
struct stage {
    struct bench *b;
    struct testscene scene;
    struct splat_camera cam;
    double *exact, *ruled;
    double part;                    /* seconds for one row */
};

struct knob {
    const char *name;
    int channels;
    float alpha_cut, t_cut;         /* 0: default; negative: 0 */
    int degree;                     /* 0: default */
    int fixed16;                    /* 0: default, 1: on, -1: off */
    bool half;                      /* half-precision image */
    float prune;
    bool half_colors;               /* Gaussians' colours in half precision */
    bool level_set;                 /* ... of a lower instruction set, which */
    enum cpu_level level;           /* is left out where it is the best */
};

static const struct knob knobs[] = {
    {.name = "default", .channels = 3},
    {"exact f32 (exp degree 5)", 3, .degree = 5},
    {"exp degree 4", 3, .degree = 4},
    {"exp degree 2", 3, .degree = 2},
    {"alpha cut 1/4096, no T cut", 3, .alpha_cut = 1.0f / 4096, .t_cut = -1,
     .degree = 5},
    {"alpha cut 1/1024", 3, .alpha_cut = 1.0f / 1024},
    {"alpha cut 1/128", 3, .alpha_cut = 1.0f / 128},
    {"alpha cut 1/64", 3, .alpha_cut = 1.0f / 64},
    {"no T cut", 3, .t_cut = -1},
    {"T cut 1e-3", 3, .t_cut = 1e-3f},
    {"T cut 1e-2", 3, .t_cut = 1e-2f},
    {"f16 colours", 3, .half_colors = true},
    {"f16 image", 3, .half = true},
    {"prune opacity < 0.1", 3, .prune = 0.1f},
    {"prune opacity < 0.2", 3, .prune = 0.2f},
    {"default (16-bit products)", 32, .fixed16 = 1},
    {"f32 products", 32, .fixed16 = -1},
    {"f32, exp degree 5", 32, .degree = 5, .fixed16 = -1},
    {"f32 products, f16 colours", 32, .fixed16 = -1, .half_colors = true},
    {"alpha cut 1/264", 32, .alpha_cut = 1.0f / 264, .fixed16 = 1},
    {"alpha cut 1/128", 32, .alpha_cut = 1.0f / 128, .fixed16 = 1},
    {"f16 image", 32, .fixed16 = 1, .half = true},
    {"prune opacity < 0.1", 32, .fixed16 = 1, .prune = 0.1f},
    {"avx2", 3, .level_set = true, .level = CPU_AVX2},
    {"baseline", 3, .level_set = true, .level = CPU_BASELINE},
    {"avx2", 32, .fixed16 = 1, .level_set = true, .level = CPU_AVX2},
    {"baseline", 32, .fixed16 = 1, .level_set = true, .level = CPU_BASELINE},
};

/* One renderer with its picture, as bench_time calls it. */
struct bench_frame {
    struct arena memory;
    struct splat s;
    const struct splat_camera *cam;
    float *image, *alpha;
    uint16_t *half;
    float turn;                     /* moves the camera: all is drawn anew */
};

/* Draw with a camera that moves by less than anybody can see, as in a clip. */
static int bench_frame_draw_next(void *context, struct error *err)
{
    struct bench_frame *f = context;
    struct splat_camera cam = *f->cam;
    const struct splat_pictures out = {.image = f->half ? NULL : f->image,
                                       .half = f->half, .alpha = f->alpha};

    f->turn = f->turn > 0 ? 0 : 1e-6f;
    cam.rt[3] += f->turn;
    return splat_draw(&f->s, &out, &cam, NULL, NULL, err);
}

/* Have g's colours in half precision, which arena_check tells of. */
static void bench_frame_halve_colors(struct gaussians *g, struct arena *memory)
{
    size_t values = g->n * (size_t)g->channels;
    uint16_t *h = arena_take(memory, values, sizeof *h);

    for (size_t i = 0; h && i < values; i++)
        h[i] = float_to_half(g->color[i]);
    g->color = NULL;
    g->color_half = h;
}

/* Renderer, picture and Gaussians of one knob. */
static int bench_frame_open(struct bench_frame *f,
                            const struct splat_options *opt,
                            const struct stage *st, const struct knob *k,
                            struct error *err)
{
    size_t pixels = (size_t)opt->width * (size_t)opt->height;
    size_t values = pixels * (size_t)opt->channels;
    struct gaussians g = st->scene.g;

    memset(f, 0, sizeof *f);
    f->cam = &st->cam;
    f->image = arena_take(&f->memory, values, sizeof *f->image);
    f->alpha = arena_take(&f->memory, pixels, sizeof *f->alpha);
    if (k->half)
        f->half = arena_take(&f->memory, values, sizeof *f->half);
    if (k->half_colors)
        bench_frame_halve_colors(&g, &f->memory);
    return arena_check(&f->memory, "a frame", err) ||
           splat_init(&f->s, opt, err) || splat_load(&f->s, &g, err) ? -1 : 0;
}

static void bench_frame_close(struct bench_frame *f)
{
    splat_release(&f->s);
    arena_release(&f->memory);
}

/* Error of the frame against the first channels of a 32-channel truth. */
static int bench_frame_error(double *max_abs, double *psnr,
                             struct bench_frame *f, const double *truth,
                             struct error *err)
{
    size_t C = (size_t)f->s.opt.channels;
    size_t pixels = (size_t)f->s.opt.width * (size_t)f->s.opt.height;
    double *want = malloc(pixels * C * sizeof *want);

    if (!want)
        return error_set(err, EX_OSERR, "out of memory");
    f->turn = 1;                    /* the next frame has the true camera */
    if (bench_frame_draw_next(f, err)) {
        free(want);
        return -1;
    }
    for (size_t p = 0; p < pixels; p++)
        for (size_t c = 0; c < C; c++)
            want[p * C + c] = truth[p * 32 + c];
    for (size_t i = 0; f->half && i < pixels * C; i++)
        f->image[i] = half_to_float(f->half[i]);
    bench_compare(max_abs, psnr, f->image, want, pixels * C);
    free(want);
    return 0;
}

/* The options that a knob stands for. */
static struct splat_options bench_knob_options(const struct knob *k,
                                               int threads)
{
    struct splat_options o = splat_defaults(SIZE, SIZE, k->channels);

    o.threads = threads;
    if (k->alpha_cut > 0)
        o.alpha_cut = k->alpha_cut;
    if (k->t_cut != 0)
        o.t_cut = fmaxf(k->t_cut, 0);
    if (k->degree)
        o.exp_degree = k->degree;
    if (k->fixed16)
        o.fixed16 = k->fixed16 > 0;
    o.prune = k->prune;
    o.level_set = k->level_set;
    o.level = k->level;
    return o;
}

/* What the rules cost where nothing else does: both truths compared. */
static double bench_rules_psnr(const struct stage *st, int channels)
{
    double sum = 0;

    for (size_t i = 0; i < (size_t)SIZE * SIZE * 32; i++) {
        double e = (int)(i % 32) < channels ? st->ruled[i] - st->exact[i] : 0;

        sum += e * e;
    }
    return 10 * log10((double)SIZE * SIZE * channels / fmax(sum, 1e-30));
}

/* Say how long each step of a frame takes at least. */
static int bench_phase_note(struct bench *b, struct bench_frame *f,
                            struct error *err)
{
    const int threads = f->s.opt.threads;
    double min[SPLAT_PHASES] = {1e9, 1e9, 1e9, 1e9};

    for (int run = 0; run < 40; run++) {
        if (bench_frame_draw_next(f, err))
            return -1;
        for (int k = 0; k < SPLAT_PHASES; k++)
            min[k] = fmin(min[k], f->s.ms[k]);
    }
    bench_note(b, "splat C=%d, %d thread%s: project %.2f, sort %.2f, tile "
               "lists %.2f, draw %.2f ms (least of 40 frames)",
               f->s.opt.channels, threads, plural(threads),
               min[SPLAT_PROJECT], min[SPLAT_SORT], min[SPLAT_BIN],
               min[SPLAT_DRAW]);
    return 0;
}

/* Time one knob, and hold its picture against both references. */
static int bench_knob_row(struct stage *st, const struct knob *k, int threads,
                          struct error *err)
{
    struct splat_options o = bench_knob_options(k, threads);
    struct bench_times t;
    struct bench_frame f;
    char config[96];
    double worst, psnr, worst_ruled, psnr_ruled;
    int rc = -1;

    if (k->level_set && k->level >= cpu_level())
        return 0;
    snprintf(config, sizeof config, "%dx%d N=%zu C=%d f32", SIZE, SIZE,
             st->scene.g.n, k->channels);
    if (bench_frame_open(&f, &o, st, k, err) ||
        bench_time(&t, st->part, 10, bench_frame_draw_next, &f, err) ||
        bench_frame_error(&worst, &psnr, &f, st->exact, err) ||
        bench_frame_error(&worst_ruled, &psnr_ruled, &f, st->ruled, err))
        goto out;
    bench_add(st->b, "splat", config, k->name, threads, &t, worst, psnr);
    if (!strncmp(k->name, "default", 7))
        bench_note(st->b,
                   "splat C=%d, %d thread%s: %.1f dB against double "
                   "with the same rules, %.1f dB against exact (these rules "
                   "in double: %.1f dB); %zu drawn, %zu tile pairs; %zu "
                   "frames",
                   k->channels, threads, plural(threads), psnr_ruled,
                   psnr, bench_rules_psnr(st, k->channels), f.s.drawn,
                   f.s.pairs, t.runs);
    rc = strcmp(k->name, "default") ? 0 : bench_phase_note(st->b, &f, err);
out:
    bench_frame_close(&f);
    return rc;
}

/* The picture in double under those rules, all channels; the caller frees
 * *out. */
static int bench_stage_truth(double **out, struct stage *st,
                             enum splat_rules rules, struct error *err)
{
    struct reference t;
    int rc;

    *out = malloc((size_t)SIZE * SIZE * 32 * sizeof **out);
    if (!*out)
        return error_set(err, EX_OSERR, "out of memory");
    if (reference_init(&t, &st->scene.g, &st->cam, SIZE, SIZE, 32, rules, 0,
                       err))
        return -1;
    rc = reference_forward(*out, NULL, NULL, NULL, &t, err);
    reference_release(&t);
    return rc;
}

/* ---- backward ------------------------------------------------------------ */

struct back {
    struct bench_frame f;
    float *d_image;
    struct splat_gradients g;
};

/* For bench_time: a frame and its gradients. */
static int bench_draw_and_back(void *context, struct error *err)
{
    struct back *k = context;
    const struct splat_picture_gradients d = {.image = k->d_image};

    return bench_frame_draw_next(&k->f, err) ||
           splat_backward(&k->f.s, &k->g, &d, err);
}

/* Forward and backward of n Gaussians; tests/unit/splat_gradients.c holds the
 * gradients to double. */
static int bench_backward_row(struct stage *st, size_t n, int size,
                              int channels, struct error *err)
{
    const size_t C = (size_t)channels, values = (size_t)size * (size_t)size * C;
    struct stage own = {.b = st->b};
    struct splat_options opt = splat_defaults(size, size, channels);
    float *g = calloc(n * (11 + C) + 12, sizeof *g);
    struct back k = {.d_image = malloc(values * sizeof(float)),
                     .g = {g, g + 3 * n, g + 6 * n, g + 10 * n, g + 11 * n,
                           g + (11 + C) * n, NULL}};
    struct bench_times t;
    struct random r;
    char config[96];
    int rc = -1;

    opt.gradients = true;
    opt.fixed16 = false;
    opt.threads = st->b->threads;
    random_init(&r, 1, "bench gradient");
    for (size_t i = 0; k.d_image && i < values; i++)
        k.d_image[i] = (float)random_range(&r, -1, 1);
    snprintf(config, sizeof config, "%dx%d N=%zu C=%d f32", size, size, n,
             channels);
    if (!g || !k.d_image)
        error_set(err, EX_OSERR, "out of memory");
    else if (!testscene_make(&own.scene, n, 2026, err)) {
        own.cam = splat_camera_square(own.scene.cam, size, 12);
        rc = bench_frame_open(&k.f, &opt, &own, &knobs[0], err) ||
             bench_time(&t, st->part, 10, bench_draw_and_back, &k, err);
    }
    if (rc == 0)
        bench_add(st->b, "splat", config, "forward + backward", opt.threads,
                  &t, NAN, NAN);
    bench_frame_close(&k.f);
    testscene_release(&own.scene);
    free(k.d_image);
    free(g);
    return rc;
}

/* ---- the stage ----------------------------------------------------------- */

/* Every knob on one thread, then on all. */
static int bench_all_knobs(struct stage *st, struct error *err)
{
    size_t first = st->b->rows;

    for (int pass = 0; pass < (st->b->threads > 1 ? 2 : 1); pass++) {
        parallel_alone(pass == 0);
        for (size_t k = 0; k < sizeof knobs / sizeof *knobs; k++)
            if (bench_knob_row(st, &knobs[k], pass ? st->b->threads : 1, err))
                return -1;
    }
    parallel_alone(false);
    bench_pareto(st->b, first);
    return 0;
}

int bench_splat(struct bench *b, struct error *err)
{
    struct stage st = {.b = b};
    double begun;
    int rc = -1;

    if (b->scene ? testscene_load(&st.scene, b->scene, err)
        : testscene_make(&st.scene, TESTSCENE_N, 2026, err))
        return -1;
    st.cam = splat_camera_square(st.scene.cam, SIZE, 12);
    st.part = b->seconds / (4.0 * sizeof knobs / sizeof *knobs);
    bench_note(b, "splat scene: %s, %zu Gaussians, %zu (pixel, Gaussian) "
               "pairs with alpha >= 1/255", b->scene ? b->scene : "seed 2026",
               st.scene.g.n, testscene_pairs(&st.scene, SIZE, err));
    if (bench_stage_truth(&st.exact, &st, SPLAT_EXACT, err))
        goto out;
    begun = cpu_seconds();
    if (bench_stage_truth(&st.ruled, &st, SPLAT_GSPLAT, err))
        goto out;
    bench_note(b, "splat C=32, %d thread%s: the plain renderer in double with "
               "the same rules took %.0f ms", b->threads, plural(b->threads),
               (cpu_seconds() - begun) * 1e3);
    if (bench_all_knobs(&st, err) ||
        bench_backward_row(&st, 30000, 128, 3, err) ||
        bench_backward_row(&st, 30000, 256, 3, err) ||
        bench_backward_row(&st, TESTSCENE_N, 512, 32, err))
        goto out;
    rc = 0;
out:
    free(st.exact);
    free(st.ruled);
    testscene_release(&st.scene);
    return rc;
}
