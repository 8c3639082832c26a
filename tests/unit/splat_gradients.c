/* Backward: finite differences on the double reference, the kernels against
 * the reference at every instruction set, the same bits for any threads. */
#include "lib/base/random.h"
#include "tests/reference/splat_backward.h"
#include "tests/unit/splat_scene.h"

enum { SIZE = 40, N = 120 };

static void random_gradient(float *g, size_t n)
{
    struct random r;

    random_init(&r, 3, "gradient");
    for (size_t i = 0; i < n; i++)
        g[i] = (float)random_range(&r, -1, 1);
}

/* ---- finite differences, double against double --------------------------- */

static double splat_loss(const struct reference *t, const double *d_image,
                         const double *d_alpha)
{
    size_t P = (size_t)t->width * (size_t)t->height;
    size_t C = (size_t)t->channels;
    double *image = scene_grab(P * C, sizeof *image);
    double *alpha = scene_grab(P, sizeof *alpha), sum = 0;

    if (reference_forward(image, alpha, NULL, NULL, t, NULL))
        exit(1);
    for (size_t i = 0; i < P * C; i++)
        sum += image[i] * d_image[i];
    for (size_t p = 0; p < P; p++)
        sum += alpha[p] * d_alpha[p];
    free(image);
    free(alpha);
    return sum;
}

/* Four-point difference of the loss in *x. */
static double splat_difference(double *x, double h, const struct reference *t,
                               const double *g, const double *ga)
{
    static const double at[4] = {-2, -1, 1, 2}, weight[4] = {1, -8, 8, -1};
    double x0 = *x, sum = 0;

    for (int k = 0; k < 4; k++) {
        *x = x0 + at[k] * h;
        sum += weight[k] * splat_loss(t, g, ga);
    }
    *x = x0;
    return sum / (12 * h);
}

static void finite_differences(enum splat_rules rules)
{
    struct testscene scene;
    struct reference t;
    size_t P = 16 * 16;
    float *f = scene_grab(P * 4, sizeof *f);
    double *g = scene_grab(P * 3, sizeof *g), *ga = scene_grab(P, sizeof *ga);
    double mean[3 * 30], scale[3 * 30], quat[4 * 30], opacity[30];
    double color[3 * 30], rt[12], worst = 0;
    struct reference_gradients d = {.mean = mean, .scale = scale,
                                    .quat = quat, .opacity = opacity,
                                    .color = color, .rt = rt};
    uint32_t order[30];
    struct error err = {0};

    small_scene(&scene, 30, 11);
    struct splat_camera cam = splat_camera_square(scene.cam, 16, 12);

    random_gradient(f, P * 4);
    for (size_t i = 0; i < P * 3; i++)
        g[i] = f[i];
    for (size_t p = 0; p < P; p++)
        ga[p] = f[P * 3 + p];
    if (reference_init(&t, &scene.g, &cam, 16, 16, 3, rules, 0, &err))
        exit(1);
    /* cut-offs out of the way, the order fixed, off the 0.99 clamp */
    t.alpha_cut = 1e-14;
    t.t_cut = 0;
    for (uint32_t i = 0; i < 30; i++) {
        order[i] = (i * 7) % 30;
        t.opacity[i] *= 0.9;
        t.quat[4 * i] *= 1.7;
    }
    t.order = order;
    if (reference_backward(&d, &t, g, ga, &err))
        CHECK(0, "%s", err.text);
    struct { double *x, *d; size_t n; double h; } part[] = {
        {t.mean, mean, 90, 1e-5}, {t.scale, scale, 90, 1e-5},
        {t.quat, quat, 120, 1e-5}, {t.opacity, opacity, 30, 1e-5},
        {t.color, color, 90, 1e-3}, {t.rt, rt, 12, 1e-7}};

    for (size_t k = 0; k < sizeof part / sizeof *part; k++) {
        double dd = 0, ss = 0;

        for (size_t i = 0; i < part[k].n; i += part[k].n > 12 ? 7 : 1) {
            double want = splat_difference(&part[k].x[i], part[k].h, &t, g, ga);

            dd += (part[k].d[i] - want) * (part[k].d[i] - want);
            ss += want * want;
        }
        double e = sqrt(dd / fmax(ss, 1e-300));

        printf("rules %d, part %zu: finite differences agree to %.1e\n", rules,
               k, e);
        worst = fmax(worst, e);
    }
    printf("rules %d: finite differences agree to %.1e (tolerance 1e-6)\n",
           rules, worst);
    CHECK(worst <= 1e-6, "finite differences");
    t.order = NULL;
    reference_release(&t);
    testscene_release(&scene);
    free(f);
    free(g);
    free(ga);
}

/* ---- kernels against the reference --------------------------------------- */

/* All gradients in one array: mean scale quat opacity color rt. */
static float *kernel_gradients(const struct testscene *t, size_t n, size_t C,
                               int threads, const float *d_image,
                               const float *d_alpha, const float *bg)
{
    struct splat_options o = splat_defaults(SIZE, SIZE, (int)C);
    struct splat_camera cam = splat_camera_square(t->cam, SIZE, 12);
    float *all = scene_grab(n * (11 + C) + 12, sizeof *all);
    float *image = scene_grab(SIZE * SIZE * C, sizeof *image);
    struct splat_gradients g = {all, all + 3 * n, all + 6 * n, all + 10 * n,
                                all + 11 * n, all + (11 + C) * n, NULL};
    const struct splat_picture_gradients d = {.image = d_image,
                                              .alpha = d_alpha};
    struct splat s = {0};
    struct error err = {0};

    o.gradients = true;
    o.exp_degree = 5;
    o.threads = threads;
    if (splat_init(&s, &o, &err) || splat_load(&s, &t->g, &err) ||
        splat_draw(&s, &(struct splat_pictures){.image = image}, &cam, NULL,
                   bg, &err) ||
        splat_backward(&s, &g, &d, &err))
        CHECK(0, "%s", err.text);
    splat_release(&s);
    free(image);
    return all;
}

static void splat_test_kernels(size_t C)
{
    size_t n = 10 * N, P = SIZE * SIZE, all = n * (11 + C) + 12;
    struct testscene scene;
    struct reference t;
    struct error err = {0};
    float *d_image = scene_grab(P * C, sizeof *d_image);
    float *d_alpha = scene_grab(P, sizeof *d_alpha), bg[SPLAT_MAX_CHANNELS];
    double *g = scene_grab(P * C, sizeof *g), *ga = scene_grab(P, sizeof *ga);
    double *want = scene_grab(all, sizeof *want);

    small_scene(&scene, n, 21);
    struct splat_camera cam = splat_camera_square(scene.cam, SIZE, 12);

    random_gradient(d_image, P * C);
    random_gradient(d_alpha, P);
    for (size_t i = 0; i < P * C; i++)
        g[i] = d_image[i];
    for (size_t p = 0; p < P; p++)
        ga[p] = d_alpha[p];
    if (reference_init(&t, &scene.g, &cam, SIZE, SIZE, (int)C, SPLAT_GSPLAT,
                       0, &err))
        exit(1);
    for (size_t c = 0; c < SPLAT_MAX_CHANNELS; c++)
        t.background[c] = bg[c] = 0.3f;
    struct reference_gradients d = {
        .mean = want, .scale = want + 3 * n, .quat = want + 6 * n,
        .opacity = want + 10 * n, .color = want + 11 * n,
        .rt = want + (11 + C) * n
    };

    if (reference_backward(&d, &t, g, ga, &err))
        CHECK(0, "%s", err.text);
    float *one = kernel_gradients(&scene, n, C, 1, d_image, d_alpha, bg);
    float *seven = kernel_gradients(&scene, n, C, 7, d_image, d_alpha, bg);
    size_t at[7] = {0, 3 * n, 6 * n, 10 * n, 11 * n, (11 + C) * n, all};
    static const char *const name[] = {"mean", "scale", "quat", "opacity",
                                       "color", "camera"};

    for (int k = 0; k < 6; k++) {
        double e = splat_relative(one + at[k], want + at[k], at[k + 1] - at[k]);

        printf("C %zu %s: relative L2 %.1e (tolerance 1e-3)\n", C, name[k],
               e);
        CHECK(e <= 1e-3, "%s", name[k]);
    }
    CHECK(!memcmp(one, seven, all * sizeof *one), "other bits for 7 threads");
    reference_release(&t);
    testscene_release(&scene);
    free(one);
    free(seven);
    free(d_image);
    free(d_alpha);
    free(g);
    free(ga);
    free(want);
}

static int splat_test(void)
{
    splat_test_kernels(3);
    splat_test_kernels(8);
    splat_test_kernels(32);
    return check_status();
}

int main(void)
{
    /* first what forks: a child has no threads of its parent's */
    int bad = at_each_level(splat_test);

    finite_differences(SPLAT_EXACT);
    finite_differences(SPLAT_GSPLAT);
    return bad || check_status();
}
