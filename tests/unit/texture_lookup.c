/* The photograph as texture: bicubic lookups against double, exact places
 * give the photograph back, where confidence ends, and the mixture, at every
 * instruction set. */
#include <math.h>
#include <string.h>

#include "lib/base/cpu.h"
#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/photo/lookup.h"
#include "lib/photo/lookup_kernel.h"
#include "lib/photo/texture.h"
#include "tests/check.h"
#include "tests/unit/levels.h"

enum { S = 128, PIXELS = S * S, PLACES = SPLAT_PLACE_CHANNELS };

static const struct splat_place_view straight = {.A = {1, 0, 0, 1}};

/* A photograph of somebody in front of something: rgb is person + (1 - matte)
 * back, rounded. */
static uint8_t rgb[3 * PIXELS], matte[PIXELS], back[3 * PIXELS];
static float color[3 * PIXELS], alpha[PIXELS], place[PLACES * PIXELS];
static float photo[TEXTURE_PHOTO * PIXELS];

static void lookup_draw_photograph(uint64_t seed)
{
    struct random r;

    random_init(&r, seed, "photograph");
    for (size_t i = 0; i < PIXELS; i++) {
        uint32_t kind = random_below(&r, 3);

        matte[i] = (uint8_t)(kind ? 255 * (kind - 1) : random_below(&r, 256));
        for (size_t c = 0; c < 3; c++) {
            uint32_t own = random_below(&r, matte[i] + 1u);

            back[3 * i + c] = (uint8_t)random_below(&r, 256);
            rgb[3 * i + c] = (uint8_t)(own + ((255u - matte[i]) *
                                              back[3 * i + c] + 127) / 255);
        }
    }
}

static void texture_of_photograph(struct texture *t)
{
    struct error err = {0};

    REQUIRE(texture_init(t, rgb, matte, back, S, &err) == 0, "%s", err.text);
}

/* Every pixel is covered and has this offset and this share. */
static void lookup_set_places(float x, float y, float seen, float cover)
{
    for (size_t i = 0; i < PIXELS; i++) {
        place[PLACES * i] = x * seen;
        place[PLACES * i + 1] = y * seen;
        place[PLACES * i + 2] = seen;
        alpha[i] = cover;
    }
}

/* ---- bicubic ------------------------------------------------------------- */

/* Keys's kernel at distance d. */
static double lookup_cubic(double d)
{
    d = fabs(d);
    if (d < 1)
        return 1.25 * d * d * d - 2.25 * d * d + 1;
    return d < 2 ? -0.75 * d * d * d + 3.75 * d * d - 6 * d + 3 : 0;
}

static double lookup_bicubic(const uint8_t *t, long n, double u, double v,
                             int c)
{
    double sum = 0;
    long x0 = (long)floor(u - 0.5), y0 = (long)floor(v - 0.5);

    for (long y = y0 - 1; y <= y0 + 2; y++)
        for (long x = x0 - 1; x <= x0 + 2; x++) {
            long cx = x < 0 ? 0 : x >= n ? n - 1 : x;
            long cy = y < 0 ? 0 : y >= n ? n - 1 : y;

            sum += lookup_cubic(u - 0.5 - (double)x) *
                   lookup_cubic(v - 0.5 - (double)y) *
                   t[4 * (cy * n + cx) + c];
        }
    return fmin(fmax(sum / 255, 0), 1);
}

static void against_double(size_t n)
{
    enum { AT = LOOKUP_RUN - 3, STRIDE = TEXTURE_PHOTO };
    static uint8_t t[4 * 65 * 65];
    static float out[STRIDE * AT];
    struct lookup_run at = {0};
    struct random r;
    double worst = 0;
    bool kept = true;
    char what[64];

    random_init(&r, n, "bicubic");
    for (size_t i = 0; i < 4 * n * n; i++)      /* nobody in the upper half */
        t[i] = i < 2 * n * n ? 0 : (uint8_t)random_below(&r, 256);
    for (size_t i = 0; i < AT; i++) {
        at.confidence[i] = i % 5 ? 1 - (float)i / AT : 0;
        at.solid[i] = (float)(i % 3) / 2;
        at.u[i] = (float)random_range(&r, -1.5, (double)n + 1.5);
        at.v[i] = (float)random_range(&r, -1.5, (double)n + 1.5);
        for (size_t k = 0; k < STRIDE; k++)
            out[STRIDE * i + k] = -3;
    }
    CPU_PICK(lookup_kernels)->bicubic(out, &at, AT, t, n);
    for (size_t i = 0; i < AT; i++)
        for (int c = 0; c < STRIDE; c++) {
            float got = out[STRIDE * i + (size_t)c];
            double shown = lookup_bicubic(t, (long)n, at.u[i], at.v[i], 3);

            if (at.confidence[i] == 0) {
                kept = kept && got == -3;
            } else if (c == 4) {
                worst = fmax(worst, fabs(got - at.confidence[i] *
                                               (1 - (1 - shown) * at.solid[i])));
            } else {
                double want = lookup_bicubic(t, (long)n, at.u[i], at.v[i], c);

                worst = fmax(worst, fabs(got - want));
            }
        }
    snprintf(what, sizeof what, "bicubic in %zu pixels against double", n);
    check(what, worst, 2e-5);
    check_that("without confidence nothing is written", kept);
}

/* Three channels in vectors against four one by one; n is no multiple. */
static void test_mix(void)
{
    enum { AT = 103 };
    float three[3 * AT], four[4 * AT], over[2][AT], from[TEXTURE_PHOTO * AT];
    struct random r;
    double worst = 0;

    random_init(&r, 5, "mix");
    for (size_t i = 0; i < TEXTURE_PHOTO * AT; i++)
        from[i] = (float)random_uniform(&r);
    for (size_t i = 0; i < AT; i++) {
        if (i % 3 == 0 || i / 10 == 4)
            from[TEXTURE_PHOTO * i + 4] = 0;
        over[0][i] = over[1][i] = (float)random_uniform(&r);
        for (size_t c = 0; c < 3; c++)
            three[3 * i + c] = four[4 * i + c] = (float)random_uniform(&r);
    }
    texture_mix(three, 3, over[0], from, AT);
    texture_mix(four, 4, over[1], from, AT);
    for (size_t i = 0; i < AT; i++) {
        worst = fmax(worst, fabs(over[0][i] - over[1][i]));
        for (size_t c = 0; c < 3; c++)
            worst = fmax(worst, fabs(three[3 * i + c] - four[4 * i + c]));
    }
    check("mixing, against one pixel at a time", worst, 2e-7);
}

/* ---- the photograph comes back ------------------------------------------ */

/* Largest difference of colour over the background from rgb, in levels. */
static double off_photograph(void)
{
    double worst = 0;

    for (size_t i = 0; i < 3 * PIXELS; i++)
        worst = fmax(worst, fabs(255 * (double)color[i] +
                                 (1 - (double)alpha[i / 3]) * back[i] -
                                 rgb[i]));
    return worst;
}

static void lookup_set_grey(void)
{
    for (size_t i = 0; i < 3 * PIXELS; i++)
        color[i] = 0.3f;
}

static void test_identity(void)
{
    const struct splat_place_view other = {
        .A = {1.1f, 0.2f, -0.2f, 1.1f}, .b = {0.07f, -0.2f},
        .shoulders = {0.6f, 0.1f, -0.2f, 0.5f, 0.1f, 0.2f},
        .neck = {0.3f, 2, 0.4f}
    };
    struct texture t;

    lookup_draw_photograph(1);
    texture_of_photograph(&t);
    lookup_set_grey();
    lookup_set_places(0, 0, 1, 1);
    texture_apply(color, alpha, &t, &straight, place, S, NULL, 0);
    check("driven by itself: the photograph, in levels", off_photograph(), 1);
    lookup_set_grey();
    lookup_set_places(0, 0, 0.6f, 0.6f);
    texture_apply(color, alpha, &t, &straight, place, S, NULL, 0);
    check("half covered, all of it placed: the same", off_photograph(), 1);
    /* another view, whose difference the offsets make up for */
    lookup_set_grey();
    for (size_t i = 0; i < PIXELS; i++) {
        float x = 2 * ((float)(i % S) + 0.5f) / S - 1;
        float y = 2 * ((float)(i / S) + 0.5f) / S - 1;
        double at[2];

        splat_place_at(at, &other, x, y);
        place[PLACES * i] = x - (float)at[0];
        place[PLACES * i + 1] = y - (float)at[1];
        place[PLACES * i + 2] = 1;
        alpha[i] = 1;
    }
    texture_apply(color, alpha, &t, &other, place, S, NULL, 0);
    check("another view, exact places: the same", off_photograph(), 1);
    texture_release(&t);
}

/* One step of a pixel to the right in the source. */
static void test_shifted(void)
{
    struct texture t;
    double worst = 0;

    memset(matte, 255, sizeof matte);
    texture_of_photograph(&t);
    lookup_set_grey();
    lookup_set_places(2.0f / S, 0, 1, 1);
    texture_apply(color, alpha, &t, &straight, place, S, NULL, 0);
    for (size_t i = 0; i < PIXELS; i++)
        for (size_t c = 0; c < 3 && i % S + 1 < S; c++)
            worst = fmax(worst, fabs(255 * (double)color[3 * i + c] -
                                     rgb[3 * (i + 1) + c]));
    check("a pixel further: the next pixel, in levels", worst, 0.05);
    texture_release(&t);
}

static void straight_colours(void)
{
    static uint8_t own[3 * PIXELS];
    double worst = 0;
    bool same = true;

    lookup_draw_photograph(2);
    texture_straight(own, rgb, matte, back, PIXELS);
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        double m = matte[i / 3] / 255.0;

        if (m == 0 || m == 1)
            same = same && own[i] == rgb[i];
        else
            worst = fmax(worst, fabs(m * own[i] + (1 - m) * back[i] -
                                     rgb[i]));
    }
    check_that("straight: without or wholly matte as they were", same);
    check("straight over the background: the photograph", worst, 1.51);
}

/* A coarser level where the picture is smaller than the photograph. */
static void test_levels(void)
{
    const struct splat_place_view twice = {.A = {2, 0, 0, 2}};
    struct texture t;
    double worst = 0;

    memset(matte, 255, sizeof matte);
    for (size_t i = 0; i < PIXELS; i++)
        memset(rgb + 3 * i, (i % S + i / S) % 2 ? 255 : 0, 3);
    texture_of_photograph(&t);
    check_that("levels of half the size each",
               t.levels == 6 && t.side[0] == S && t.side[5] == S / 32);
    lookup_set_grey();
    lookup_set_places(0, 0, 1, 1);
    texture_apply(color, alpha, &t, &twice, place, S, NULL, 0);
    for (size_t y = S / 4 + 2; y < 3 * S / 4 - 2; y++)
        for (size_t x = S / 4 + 2; x < 3 * S / 4 - 2; x++)
            worst = fmax(worst, fabs((double)color[3 * (y * S + x)] - 0.5));
    check("a chessboard at half its size is grey", worst, 0.003);
    texture_release(&t);
}

/* ---- confidence --------------------------------------------------------- */

static float lookup_confidence(size_t x, size_t y)
{
    return photo[TEXTURE_PHOTO * (y * S + x) + 4];
}

static void lookup_run(const struct texture *t)
{
    texture_lookup(photo, t, &straight, place, alpha, S);
}

/* Where no Gaussian has a place nothing is looked up; beside it all is. */
static void test_nothing(const struct texture *t)
{
    lookup_set_places(0, 0, 1, 1);
    for (size_t i = 0; i < PIXELS; i++)
        if (i % S >= S / 2)
            memset(place + PLACES * i, 0, PLACES * sizeof *place);
    lookup_run(t);
    check_that("beside nothing: full", lookup_confidence(S / 2 - 1, 9) == 1);
    check_that("nothing: zeros",
               !memcmp(photo + TEXTURE_PHOTO * (9 * S + S / 2),
                       (float[TEXTURE_PHOTO]){0},
                       TEXTURE_PHOTO * sizeof *photo));
}

static void test_shares(const struct texture *t)
{
    static const struct { float seen, alpha, confidence; } at[] = {
        {0.75f, 1, 1}, {0.5f, 1, 0.6f}, {0.25f, 0.5f, 0.6f},
        {0.1f, 1, 0}, {1, 1, 1}, {0.5f, 0.5f, 1}};

    for (size_t k = 0; k < sizeof at / sizeof *at; k++) {
        char what[64];

        lookup_set_places(0, 0, at[k].seen, at[k].alpha);
        lookup_run(t);
        snprintf(what, sizeof what, "confidence of a share of %g in %g",
                 at[k].seen, at[k].alpha);
        expect(what, lookup_confidence(40, 40), at[k].confidence, 1e-5);
    }
}

/* Nobody in the photograph is nobody in its own view; in one that has turned it is
 * somebody whom Gaussians cover wholly. */
static void test_covered(void)
{
    static const struct { float turn, alpha, confidence; } at[] = {
        {0, 1, 1}, {0.35f, 1, 0}, {0.7f, 1, 0}, {0.175f, 1, 0.5f},
        {0.35f, 0.95f, 0.5f}, {0.35f, 0.9f, 1}};
    struct texture t;

    memset(matte, 0, sizeof matte);
    texture_of_photograph(&t);
    for (size_t k = 0; k < sizeof at / sizeof *at; k++) {
        struct splat_place_view v = straight;
        char what[64];

        v.toward[0] = at[k].turn;
        lookup_set_places(0, 0, at[k].alpha, at[k].alpha);
        texture_lookup(photo, &t, &v, place, alpha, S);
        snprintf(what, sizeof what, "nobody at a turn of %g under %g",
                 at[k].turn, at[k].alpha);
        expect(what, lookup_confidence(40, 40), at[k].confidence, 1e-5);
    }
    texture_release(&t);
}

/* Where only the grain has a place it multiplies colours, linear between its
 * pixels. */
static void test_grain(struct texture *t)
{
    static const struct { float x, share, alpha, gain; } at[] = {
        {0, 1, 1, 1.5f}, {0, 1, 0.5f, 1.5f}, {1.0f / S, 1, 1, 1.25f},
        {2.0f / S, 1, 1, 1}, {0, 0.9f, 1, 1.25f}, {0, 0.7f, 1, 1},
        {0, 1.35f, 1, 1.25f}, {0, 1.6f, 1, 1}, {0, 200, 1, 1}, {1, 1, 1, 1}
    };
    static uint8_t grain[PIXELS];

    memset(grain, 128, sizeof grain);
    for (size_t i = 0; i < S; i++)
        grain[40 + i * S] = 192;
    t->grain = grain;
    t->grain_size = S;
    for (size_t k = 0; k < sizeof at / sizeof *at; k++) {
        const size_t i = 40 * S + 40;
        char what[80];

        lookup_set_grey();
        lookup_set_places(at[k].x, 0,
                          at[k].share * at[k].alpha * SPLAT_PLACE_GRAIN,
                          at[k].alpha);
        texture_apply(color, alpha, t, &straight, place, S, NULL, 0);
        snprintf(what, sizeof what, "grain %g pixels off, share %g, alpha %g",
                 (double)at[k].x * S / 2, at[k].share, at[k].alpha);
        expect(what, color[3 * i], 0.3 * (double)at[k].gain, 1e-4);
        check_that("and alpha stays", alpha[i] == at[k].alpha);
    }
    t->grain = NULL;
}

/* ---- mixture ------------------------------------------------------------ */

static void test_mixture(void)
{
    float c[10] = {0.1f, 0.2f, 0.3f, 7, 8, 0.4f, 0.5f, 0.6f, 9, 10};
    float a[2] = {0.8f, 0.9f};
    const float p[10] = {0.5f, 0.6f, 0.7f, 1, 0.25f, 1, 1, 1, 1, 0};

    texture_mix(c, 5, a, p, 2);
    expect("a quarter of the photograph: red", c[0], 0.2, 1e-6);
    expect("blue", c[2], 0.4, 1e-6);
    expect("matte", a[0], 0.85, 1e-6);
    check_that("other channels, and pixels without confidence, are kept",
               c[3] == 7 && c[4] == 8 && c[5] == 0.4f && c[7] == 0.6f &&
               a[1] == 0.9f);
}

/* Covers, shares and offsets by chance over grey. */
static void lookup_set_chance(void)
{
    struct random r;

    random_init(&r, 8, "in one");
    lookup_set_places(0, 0, 1, 1);
    for (size_t i = 0; i < PIXELS; i++) {
        alpha[i] = (float)random_uniform(&r);
        place[PLACES * i + 2] = alpha[i] * (float)random_uniform(&r);
        place[PLACES * i] = (float)random_range(&r, -1, 1) * 2 / S
                       * place[PLACES * i + 2];
    }
    lookup_set_grey();
}

/* With a refiner's field it is texture_lookup and texture_compose at the
 * refiner's own size; and a field that is the same everywhere is the same in
 * any picture. */
static void field_in_one(const struct texture *t)
{
    static float two[3 * PIXELS], cover[PIXELS], at[TEXTURE_FIELD * PIXELS];
    const size_t side = (S + TEXTURE_FIELD_STEP - 1) / TEXTURE_FIELD_STEP;
    const struct texture_field field = {at, side, side}, one = {at, 1, 1};
    const float steps[2] = {TEXTURE_FIELD_STEP, S};
    struct random r;

    random_init(&r, 9, "field");
    for (size_t i = 0; i < TEXTURE_FIELD * side * side; i++)
        at[i] = (float)random_range(&r, -0.4, 0.4);
    for (int k = 0; k < 2; k++) {
        const struct texture_field *f = k ? &one : &field;
        double off = 0;

        lookup_set_chance();
        memcpy(two, color, sizeof two);
        memcpy(cover, alpha, sizeof cover);
        lookup_run(t);
        texture_compose(two, cover, photo, f, S, S);
        texture_apply(color, alpha, t, &straight, place, S, f,
                      steps[k]);
        for (size_t i = 0; i < PIXELS; i++) {
            off = fmax(off, fabs((double)alpha[i] - cover[i]));
            for (size_t c = 0; c < 3; c++)
                off = fmax(off, fabs((double)color[3 * i + c] -
                                     two[3 * i + c]));
        }
        check(k ? "the same field everywhere, enlarged"
                : "a field: applied at once as composed", off, 2e-6);
    }
}

/* texture_apply is texture_lookup and texture_mix, whatever the threads; so is
 * what is looked up while a picture is drawn, tile by tile (whose positions are
 * exact at this size). */
static void in_one(const struct texture *t)
{
    static float two[3 * PIXELS], cover[PIXELS], shown[TEXTURE_PHOTO * PIXELS];
    static float shaded[3 * PIXELS], over[PIXELS];
    struct texture_shader mixed, beside;

    lookup_set_chance();
    memcpy(two, color, sizeof two);
    memcpy(cover, alpha, sizeof cover);
    parallel_set_width(3);
    lookup_run(t);
    texture_mix(two, 3, cover, photo, PIXELS);
    parallel_set_width(1);
    texture_shader_init(&mixed, t, &straight, S, NULL, 3);
    texture_shader_init(&beside, t, &straight, S, shown, 0);
    memcpy(shaded, color, sizeof shaded);
    memcpy(over, alpha, sizeof over);
    for (size_t i = 0; i < PIXELS; i += 16) {
        const int x = (int)(i % S), y = (int)(i / S);

        texture_shade(&beside, NULL, over + i, place + PLACES * i, x, y, 16);
        texture_shade(&mixed, shaded + 3 * i, over + i, place + PLACES * i, x, y,
                      16);
    }
    check_that("looked up while it is drawn: the same bits",
               !memcmp(shown, photo, sizeof shown) &&
               !memcmp(shaded, two, sizeof shaded) &&
               !memcmp(over, cover, sizeof over));
    texture_apply(color, alpha, t, &straight, place, S, NULL, 0);
    check_that("applied at once and by one thread: the same bits",
               !memcmp(two, color, sizeof two) &&
               !memcmp(cover, alpha, sizeof cover));
}

static int at_level(void)
{
    struct texture t;

    for (size_t n = 2; n <= 65; n = 2 * n - 1)
        against_double(n);
    test_mix();
    test_identity();
    test_shifted();
    straight_colours();
    test_levels();
    lookup_draw_photograph(3);
    texture_of_photograph(&t);
    test_nothing(&t);
    test_shares(&t);
    test_grain(&t);
    test_covered();
    test_mixture();
    in_one(&t);
    field_in_one(&t);
    texture_release(&t);
    return check_status();
}

int main(void)
{
    return at_each_level(at_level);
}
