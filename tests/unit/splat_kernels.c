/* Every instruction set's kernels against the double reference, forward: odd
 * sizes, all channel counts, thread counts, moved Gaussians. */
#include "tests/unit/splat_scene.h"

/* One picture by the kernels; the caller frees. */
static float *kernel_test_draw(const struct testscene *t,
                               struct splat_options o, float *alpha,
                               float *depth, const float *bg)
{
    struct splat_camera cam = splat_camera_square(t->cam, o.width, 12);
    struct splat s = {0};
    struct error err = {0};
    size_t values = (size_t)o.width * (size_t)o.height * (size_t)o.channels;
    float *image = scene_grab(values, sizeof *image);
    const struct splat_pictures out = {.image = image, .alpha = alpha,
                                       .depth = depth};

    memset(image, 0x7f, values * sizeof *image);      /* junk */
    cam.cy = 0.5f * (float)o.height;
    if (splat_init(&s, &o, &err) || splat_load(&s, &t->g, &err) ||
        splat_draw(&s, &out, &cam, NULL, bg, &err))
        CHECK(0, "%s", err.text);
    splat_release(&s);
    return image;
}

/* Pixels where the reference comes within 1e-5 of a cut-off are not compared:
 * the decision may fall either way. */
static void kernel_compare(size_t n, int width, int height, int channels,
                           int degree, bool depth)
{
    struct testscene t;
    struct reference truth;
    struct error err = {0};
    struct splat_options o = splat_defaults(width, height, channels);
    size_t P = (size_t)width * (size_t)height, C = (size_t)channels;
    double *want = scene_grab(P * C, sizeof *want),
           *wa = scene_grab(P, sizeof *wa);
    double *wz = scene_grab(P, sizeof *wz), worst = 0, worst_a = 0, worst_z = 0;
    float *alpha = scene_grab(P, sizeof *alpha), *z = scene_grab(P, sizeof *z);
    float bg[SPLAT_MAX_CHANNELS];
    uint8_t *skip = scene_grab(P, 1);
    double tol = 2e-5;

    small_scene(&t, n, 7 + n);
    for (int c = 0; c < SPLAT_MAX_CHANNELS; c++)
        bg[c] = 0.03f * (float)c;
    struct splat_camera cam = splat_camera_square(t.cam, width, 12);

    cam.cy = 0.5f * (float)height;
    o.exp_degree = degree;
    o.depth = depth;
    if (degree == 5)
        o.fixed16 = false;
    float *image = kernel_test_draw(&t, o, alpha, depth ? z : NULL, bg);

    if (reference_init(&truth, &t.g, &cam, width, height, channels,
                       SPLAT_GSPLAT, 0, &err))
        exit(1);
    for (size_t c = 0; c < C; c++)
        truth.background[c] = bg[c];
    if (reference_forward(want, wa, wz, skip, &truth, &err))
        CHECK(0, "%s", err.text);
    for (size_t p = 0; p < P; p++) {
        if (skip[p])
            continue;
        for (size_t c = 0; c < C; c++)
            worst = fmax(worst, fabs(image[p * C + c] - want[p * C + c]));
        worst_a = fmax(worst_a, fabs(alpha[p] - wa[p]));
        if (depth && wa[p] > 0.01)
            worst_z = fmax(worst_z, fabs(z[p] - wz[p]));
    }
    /* degree 3 decides cut-offs by up to 7.5e-5: a Gaussian of weight 1/255 or
     * of the last 1e-2 of T may be there or not */
    if (degree < 5)
        tol = 8e-3;
    printf("N %zu, %dx%d, C %d, degree %d: image %.1e alpha %.1e depth %.1e\n",
           n, width, height, channels, degree, worst, worst_a, worst_z);
    CHECK(worst <= tol && worst_a <= tol, "over %.1e", tol);
    CHECK(worst_z <= 1e-4 + 20 * tol, "depth");
    reference_release(&truth);
    testscene_release(&t);
    free(image);
    free(want);
    free(wa);
    free(wz);
    free(alpha);
    free(z);
    free(skip);
}

static void same_for_any_threads(int channels)
{
    static const int threads[] = {1, 2, 7};
    struct testscene t;
    float *first = NULL;
    size_t bytes = 100 * 90 * (size_t)channels * sizeof(float);

    small_scene(&t, 3000, 5);
    for (int k = 0; k < 3; k++) {
        struct splat_options o = splat_defaults(100, 90, channels);

        o.threads = threads[k];
        float *image = kernel_test_draw(&t, o, NULL, NULL, NULL);

        if (!first)
            first = image;
        else {
            CHECK(!memcmp(first, image, bytes), "%d threads, C %d: other bits",
                  threads[k], channels);
            free(image);
        }
    }
    printf("threads 1, 2, 7, C %d: the same bits\n", channels);
    free(first);
    testscene_release(&t);
}

/* splat_update, camera still or not, against loading anew. */
static void kernel_moving(void)
{
    struct testscene t;
    struct splat_options o = splat_defaults(64, 64, 3);
    struct splat s = {0};
    struct error err = {0};
    float *image = scene_grab(64 * 64 * 3, sizeof *image);
    static const float shift[3] = {0.01f, -0.02f, 0.015f};

    small_scene(&t, 2000, 9);
    struct splat_camera cam = splat_camera_square(t.cam, 64, 12);

    if (splat_init(&s, &o, &err) || splat_load(&s, &t.g, &err) ||
        splat_draw(&s, &(struct splat_pictures){.image = image}, &cam, NULL,
                   NULL, &err))
        CHECK(0, "%s", err.text);
    for (int round = 0; round < 2; round++) {
        float *mean = (float *)t.g.mean;

        for (size_t i = 300; i < 1000; i++)
            mean[3 * i] += 0.03f;
        cam.rt[3] += 0.02f * (float)round;
        t.cam[3] = cam.rt[3];
        if (splat_update(&s, mean + 900, 300, 700, &err) ||
            splat_draw(&s, &(struct splat_pictures){.image = image}, &cam,
                       NULL, NULL, &err))
            CHECK(0, "%s", err.text);
        float *fresh = kernel_test_draw(&t, o, NULL, NULL, NULL);

        CHECK(!memcmp(fresh, image, 64 * 64 * 3 * sizeof *image),
              "moved, round %d: not as drawn anew", round);
        free(fresh);
    }
    if (splat_load(&s, &t.g, &err))
        CHECK(0, "%s", err.text);
    for (size_t i = 3 * 1900; i < 3 * 2000; i++)
        ((float *)t.g.mean)[i] += shift[i % 3];
    if (splat_update(&s, t.g.mean + 3 * 1900, 1900, 100, &err) ||
        splat_draw(&s, &(struct splat_pictures){.image = image}, &cam, NULL,
                   NULL, &err))
        CHECK(0, "%s", err.text);
    float *fresh = kernel_test_draw(&t, o, NULL, NULL, NULL);

    CHECK(!memcmp(fresh, image, 64 * 64 * 3 * sizeof *image), "shifted");
    printf("moved and shifted Gaussians: as drawn anew\n");
    free(fresh);
    free(image);
    splat_release(&s);
    testscene_release(&t);
}

static int kernel_test(void)
{
    static const int channels[] = {1, 2, 3, 4, 5, 16, 17, 32};
    static const size_t counts[] = {0, 1, 15, 16, 17, 400};

    for (size_t i = 0; i < 8; i++)
        kernel_compare(700, 37, 50, channels[i], 5, i % 2);
    for (size_t i = 0; i < 6; i++)
        kernel_compare(counts[i], 33, 16, 3, 5, true);
    kernel_compare(50, 1, 1, 3, 5, false);
    kernel_compare(700, 48, 48, 3, 3, false);
    kernel_compare(700, 48, 48, 3, 4, false);
    kernel_compare(700, 48, 48, 32, 3, true);
    same_for_any_threads(3);
    same_for_any_threads(32);
    kernel_moving();
    return check_status();
}

int main(void)
{
    return at_each_level(kernel_test);
}
