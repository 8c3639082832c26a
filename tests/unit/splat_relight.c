/* The picture of the light's change against a plain double reference: a ball of
 * Gaussians that another light falls on, and the back of the ball behind it. */
#include "lib/splat/relight.h"

#include "lib/base/random.h"
#include "tests/unit/splat_scene.h"

enum { SIZE = 96, PLACES = (SIZE / RELIGHT_STEP) * (SIZE / RELIGHT_STEP),
       N = 6000 };
#define RADIUS 0.35

static const float was[LAMP_SIZE] = {0.5f, -0.2f, 0.3f, 1, 1, 1};
static const float now[LAMP_SIZE] = {-0.6f, 0.1f, 0.5f, 0.81f, 1, 1.44f};

/* Turn testscene's Gaussians into a ball of radius RADIUS about the origin. */
static void relight_ball(struct testscene *t, float *normal)
{
    struct random r;

    random_init(&r, 9, "ball");
    for (size_t i = 0; i < N; i++) {
        double n[3], length = 0;

        for (int k = 0; k < 3; k++) {
            n[k] = random_normal(&r);
            length += n[k] * n[k];
        }
        for (size_t k = 0; k < 3; k++) {
            normal[3 * i + k] = (float)(n[k] / sqrt(length));
            ((float *)t->g.mean)[3 * i + k] = (float)RADIUS *
                                              normal[3 * i + k];
            ((float *)t->g.scale)[3 * i + k] = 0.02f;
        }
        ((float *)t->g.opacity)[i] = 0.9f;
    }
    t->g.normal = normal;
    memcpy(t->g.light, was, sizeof t->g.light);
}

static double relight_light(const double n[3], const float l[3])
{
    return fmax(1 + n[0] * l[0] + n[1] * l[1] + n[2] * l[2],
                (double)GAUSSIAN_SHADOW);
}

/* What the middle of place (x,y) should say: the ball's front surface there.
 * false: too near its edge for a blurred mean to be it. */
static bool relight_want(double *want, const float cam[12], size_t x, size_t y)
{
    const double px = ((double)x + 0.5) * RELIGHT_STEP / SIZE - 0.5;
    const double py = ((double)y + 0.5) * RELIGHT_STEP / SIZE - 0.5;
    const double d[3] = {px / 6, py / 6, 1};
    const double c[3] = {(double)cam[3], (double)cam[7], (double)cam[11]};
    double dd = 0, dc = 0, cc = 0, n[3] = {0};

    for (int k = 0; k < 3; k++) {
        dd += d[k] * d[k];
        dc += d[k] * c[k];
        cc += c[k] * c[k];
    }
    const double root = dc * dc - dd * (cc - RADIUS * RADIUS);

    if (root < 0.6 * dd * RADIUS * RADIUS)
        return false;
    const double z = (dc - sqrt(root)) / dd;

    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            n[k] += (double)cam[4 * i + k] * (z * d[i] - c[i]) / RADIUS;
    *want = sqrt(relight_light(n, now) / relight_light(n, was));
    return true;
}

static void relight_draw(float *gain, float tint[3], const struct testscene *t,
                         const float light[LAMP_SIZE], int threads)
{
    static float image[3 * SIZE * SIZE], alpha[SIZE * SIZE];
    struct splat_options o = splat_defaults(SIZE, SIZE, 3);
    const struct splat_place_view view = {.A = {1, 0, 0, 1}};
    const struct splat_camera cam = splat_camera_square(t->cam, SIZE, 12);
    struct error err = {0};
    struct splat s;

    o.place = true;
    o.threads = threads;
    REQUIRE(splat_init(&s, &o, &err) == 0 && splat_load(&s, &t->g, &err) == 0,
            "%s", err.text);
    CHECK(splat_draw(&s, &(struct splat_pictures){
        .image = image, .alpha = alpha}, &cam, &view, NULL, &err) == 0, "%s",
          err.text);
    splat_relight(gain, tint, &s, light);
    splat_release(&s);
}

/* Applying it, enlarged to twice the size, against bilinear in double. */
static void relight_check_apply(const float *gain, const float tint[3])
{
    enum { BIG = 2 * SIZE, SIDE = SIZE / RELIGHT_STEP };
    float *rgb = scene_grab(3 * BIG * BIG, sizeof *rgb);
    float *alpha = scene_grab(BIG * BIG, sizeof *alpha);
    double worst = 0;

    for (size_t i = 0; i < BIG * BIG; i++) {
        alpha[i] = i % 3 ? 1 : 0.25f;
        for (size_t c = 0; c < 3; c++)
            rgb[3 * i + c] = 0.4f * alpha[i];
    }
    relight_apply(rgb, 3, alpha, gain, tint, SIZE, BIG, BIG);
    for (size_t i = 0; i < BIG * BIG; i++) {
        double at[2] = {(double)(i / BIG), (double)(i % BIG)}, w[2], sum = 0;
        size_t lo[2];

        for (int k = 0; k < 2; k++) {
            at[k] = fmin(fmax((at[k] + 0.5) / (2 * RELIGHT_STEP) - 0.5, 0),
                         SIDE - 1);
            lo[k] = (size_t)fmin(at[k], SIDE - 2);
            w[k] = at[k] - (double)lo[k];
        }
        for (size_t y = 0; y < 2; y++)
            for (size_t x = 0; x < 2; x++)
                sum += (y ? w[0] : 1 - w[0]) * (x ? w[1] : 1 - w[1]) *
                       (double)gain[(lo[0] + y) * SIDE + lo[1] + x];
        const double a = (double)alpha[i];

        for (size_t c = 0; c < 3; c++)
            worst = fmax(worst, fabs(fmin(0.4 * a * sum * (double)tint[c], a) -
                                     (double)rgb[3 * i + c]));
    }
    check("applied gain", worst, 1e-6);
    free(alpha);
    free(rgb);
}

/* Back through it: what came in has the gain as its slope, or, where that is cut
 * off, coverage has it all. */
static void relight_check_backward(const float *gain)
{
    enum { PIXELS = SIZE * SIZE };
    static float rgb[3 * PIXELS], alpha[PIXELS], slope[3 * PIXELS];
    static float drgb[3 * PIXELS], dalpha[PIXELS], probe[3 * PIXELS];
    double worst = 0;
    size_t cut = 0;
    struct random r;

    random_init(&r, 11, "backward");
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        alpha[i / 3] = i / 3 % 3 ? 1 : 0.25f;
        rgb[i] = (float)random_range(&r, 0, 1.2) * alpha[i / 3];
        drgb[i] = probe[i] = (float)random_range(&r, -1, 1);
        slope[i] = 1;
    }
    relight_apply(slope, 3, NULL, gain, NULL, SIZE, SIZE, SIZE);
    relight_apply(rgb, 3, alpha, gain, NULL, SIZE, SIZE, SIZE);
    relight_apply_backward(drgb, dalpha, rgb, 3, alpha, gain, SIZE);
    for (size_t i = 0; i < PIXELS; i++) {
        double sum = 0;

        for (size_t c = 3 * i; c < 3 * i + 3; c++) {
            const bool off = rgb[c] == alpha[i];

            cut += off;
            sum += off ? (double)probe[c] : 0;
            worst = fmax(worst, fabs((double)drgb[c] - (off ? 0 :
                         (double)probe[c] * (double)slope[c])));
        }
        worst = fmax(worst, fabs(sum - (double)dalpha[i]));
    }
    CHECK(cut > PIXELS / 10 && cut < PIXELS, "%zu colours cut off", cut);
    check("gradients", worst, 1e-6);
}

int main(void)
{
    float *normal = scene_grab(3 * N, sizeof *normal);
    float gain[PLACES], other[PLACES], tint[3];
    struct testscene t;
    double worst = 0, sum = 0;
    size_t n = 0;

    small_scene(&t, N, 7);
    relight_ball(&t, normal);
    relight_draw(gain, tint, &t, now, 2);
    for (size_t k = 0; k < PLACES; k++) {
        const size_t side = SIZE / RELIGHT_STEP;
        double want;

        if (!relight_want(&want, t.cam, k % side, k / side))
            continue;
        worst = fmax(worst, fabs(want - (double)gain[k]));
        sum += fabs(want - 1);
        n++;
    }
    CHECK(n > 20 && sum / (double)n > 0.1, "%zu places of the ball say %g", n,
          sum / (double)n);
    check("gain of a place", worst, 0.12);
    check("tint", fmax(fabs((double)tint[0] - 0.9), fabs((double)tint[2] - 1.2)),
          1e-6);
    relight_draw(other, tint, &t, now, 1);
    CHECK(!memcmp(gain, other, sizeof gain), "another number of threads");
    relight_check_apply(gain, tint);
    relight_check_backward(gain);

    relight_draw(gain, tint, &t, was, 1);
    CHECK(!relight_tinted(tint), "its own light has a colour");
    worst = 0;
    for (size_t k = 0; k < PLACES; k++)
        worst = fmax(worst, fabs((double)gain[k] - 1));
    check("gain of the same light less 1", worst, 1e-6);
    t.g.normal = NULL;
    testscene_release(&t);
    free(normal);
    return check_status();
}
