/* Places in the source picture: blended beside the colours, and their
 * gradients, at every instruction set against double precision; colours keep
 * their bits, whatever is drawn beside them. */
#include "lib/base/random.h"
#include "tests/reference/splat_backward.h"
#include "tests/unit/splat_scene.h"

enum { SIZE = 40, N = 1200, PLACES = SPLAT_PLACE_CHANNELS };

static const struct splat_place_view view = {
    .A = {0.9f, 0.2f, -0.15f, 1.1f}, .b = {0.05f, -0.1f},
    .shoulders = {0.7f, -0.3f, 0.1f, -0.4f, 0.2f, 0.1f},
    .neck = {0.4f, 1.5f, 0.6f}, .toward = {0.3f, -0.2f}
};

/* A small scene whose Gaussians have places; a third was not seen, and every
 * fourth is the plane's. */
static void places_scene(struct testscene *t, size_t n, uint64_t seed)
{
    float *uv = scene_grab(2 * n, sizeof *uv),
          *seen = scene_grab(n, sizeof *seen),
          *tilt = scene_grab(2 * n, sizeof *tilt);
    struct random r;

    small_scene(t, n, seed);
    random_init(&r, seed, "places");
    for (size_t i = 0; i < 2 * n; i++)
        uv[i] = (float)random_uniform(&r);
    for (size_t i = 0; i < n; i++)
        seen[i] = i % 3 == 0 ? 0 : i % 3 == 1 ? 1 : (float)random_uniform(&r);
    for (size_t i = 0; i < 2 * n; i++)      /* from whole to not at all */
        tilt[i] = (float)random_range(&r, -6, 6);
    for (size_t i = 0; i < n; i++)
        ((uint8_t *)t->g.branch)[i] = i % 4 == 1;
    t->g.uv = uv;
    t->g.seen = seen;
    t->g.tilt = tilt;
}

static void places_release(struct testscene *t)
{
    free((void *)t->g.uv);
    free((void *)t->g.seen);
    free((void *)t->g.tilt);
    testscene_release(t);
}

/* What is left of Gaussian i's opacity. */
static double places_left(const struct gaussians *g, size_t i)
{
    return exp2(-(double)gaussian_halved(
                    gaussians_thin(g, i),
                    gaussian_more(g->tilt + 2 * i, view.toward)));
}

/* The places in the grain of all n. */
static void places_reference_grain(struct reference_places *r, size_t n,
                                   const struct gaussians *g,
                                   const float rt[12], float facing)
{
    r->around = scene_grab(2 * n, sizeof *r->around);
    r->grain = scene_grab(n, sizeof *r->grain);
    r->unrolled = scene_grab(n, sizeof *r->unrolled);
    for (size_t i = 0; i < n; i++) {
        const bool has = g->around[2 * i] >= -1;

        r->grain[i] = has ? splat_place_grain((float)r->confidence[i]) : 0;
        r->unrolled[i] = splat_place_unrolled(g->normal + 3 * i, rt, facing);
        for (size_t k = 0; k < 2; k++)
            r->around[2 * i + k] =
                has ? 2 * (double)g->around[2 * i + k] - 1 : 0;
    }
}

/* t's reference, whose pictures end in the channels of places; size pixels a
 * side. */
static int places_reference(struct reference *r, struct reference_places *p,
                            const struct testscene *t, int channels, int size,
                            struct error *err)
{
    const struct splat_camera cam = splat_camera_square(t->cam, size, 12);
    const struct gaussians *g = &t->g;
    const struct splat_place_side side = splat_place_side(&view);
    const size_t C = (size_t)channels;
    double *color;

    if (reference_init(r, g, &cam, size, size, channels, SPLAT_GSPLAT, 0, err))
        return -1;
    color = scene_grab(r->n * (C + PLACES), sizeof *color);
    *p = (struct reference_places){
        .view = view, .uv = scene_grab(2 * r->n, sizeof *p->uv),
        .confidence = scene_grab(r->n, sizeof *p->confidence),
        .shorter = scene_grab(r->n, sizeof *p->shorter)
    };
    for (size_t i = 0; i < r->n; i++) {
        const float more = gaussian_more(g->tilt + 2 * i, view.toward);

        memcpy(color + i * (C + PLACES), r->color + i * C, C * sizeof *color);
        r->opacity[i] *= places_left(g, i);
        p->confidence[i] = gaussians_seen(g, i) * gaussian_visible(more);
        p->shorter[i] = splat_place_shorter(more - 1, side.facing);
        for (size_t k = 0; k < 2; k++)
            p->uv[2 * i + k] = 2 * (double)g->uv[2 * i + k] - 1;
    }
    if (g->around)
        places_reference_grain(p, r->n, g, cam.rt, side.facing);
    free(r->color);
    r->color = color;
    r->channels += PLACES;
    reference_places_fill(r, p);
    return 0;
}

static void random_numbers(float *g, size_t n, uint64_t seed)
{
    struct random r;

    random_init(&r, seed, "gradient");
    for (size_t i = 0; i < n; i++)
        g[i] = (float)random_range(&r, -1, 1);
}

/* ---- forward ------------------------------------------------------------- */

/* Colours (and halves instead, if there are any) and places of a scene. */
static void draw_places(float *image, float *place, const struct testscene *t,
                        const struct splat_options *o)
{
    struct splat_camera cam = splat_camera_square(t->cam, SIZE, 12);
    struct splat_pictures out = {.image = image, .place = place};
    struct splat s = {0};
    struct error err = {0};

    check_error("drawn", splat_init(&s, o, &err) == 0 &&
                splat_load(&s, &t->g, &err) == 0 &&
                splat_draw(&s, &out, &cam, &view, NULL, &err) == 0, &err);
    splat_release(&s);
}

/* Largest difference of places from double where no cut-off is doubtful. */
static double places_error(const float *place, const struct testscene *t)
{
    struct reference truth;
    struct reference_places places;
    struct error err = {0};
    size_t P = SIZE * SIZE;
    double *want = scene_grab(P * (PLACES + 1), sizeof *want), worst = 0;
    uint8_t *skip = scene_grab(P, 1);

    if (places_reference(&truth, &places, t, 1, SIZE, &err) ||
        reference_forward(want, NULL, NULL, skip, &truth, &err))
        exit(1);
    for (size_t p = 0; p < P; p++)
        for (size_t c = 0; c < PLACES && !skip[p]; c++)
            worst = fmax(worst, fabs(place[PLACES * p + c] -
                                      want[(PLACES + 1) * p + 1 + c]));
    reference_places_release(&places);
    reference_release(&truth);
    free(want);
    free(skip);
    return worst;
}

static void places_forward(int channels, bool depth)
{
    struct testscene t;
    struct splat_options o = splat_defaults(SIZE, SIZE, channels);
    size_t P = SIZE * SIZE, C = (size_t)channels;
    float *plain = scene_grab(P * C, sizeof *plain);
    float *image = scene_grab(P * C, sizeof *image);
    float *place = scene_grab(P * PLACES, sizeof *place);
    float *other = scene_grab(P * PLACES, sizeof *other);
    char what[64];

    places_scene(&t, N, 41);
    const uint8_t *branch = t.g.branch;

    o.depth = depth;
    o.threads = 1;
    o.exp_degree = 5;
    t.g.branch = NULL;
    draw_places(plain, NULL, &t, &o);
    o.place = true;
    draw_places(image, place, &t, &o);
    check_that("colours have the bits that they have without places",
               !memcmp(plain, image, P * C * sizeof *image));
    t.g.branch = branch;
    draw_places(image, place, &t, &o);
    check_that("but where the plane thins out",
               memcmp(plain, image, P * C * sizeof *image) != 0);
    memcpy(plain, image, P * C * sizeof *image);
    snprintf(what, sizeof what, "C %d: places against double", channels);
    check(what, places_error(place, &t), 5e-5);
    o.threads = 7;
    draw_places(image, other, &t, &o);
    check_that("the same bits for 7 threads",
               !memcmp(place, other, P * PLACES * sizeof *place) &&
               !memcmp(plain, image, P * C * sizeof *image));
    places_release(&t);
    free(plain);
    free(image);
    free(place);
    free(other);
}

/* What is left of seen, by the way from source_mean over the reach. */
static void places_reach(void)
{
    static const struct { double way, left; } at[] = {
        {0, 1}, {1.0 / 3, 1}, {0.5, 0.84375}, {2.0 / 3, 0.5}, {1, 0}, {9, 0}
    };
    const float source_mean[3] = {0.1f, -0.2f, 0.3f};
    double worst = 0, lid = 0;

    for (size_t k = 0; k < sizeof at / sizeof *at; k++) {
        const float up = (float)(0.03 * at[k].way);
        const float aside = (float)(0.04 * at[k].way);
        const float risen[3] = {0.1f, -0.2f + up, 0.3f + aside};
        const float sunk[3] = {0.1f, -0.2f - up, 0.3f + aside};

        worst = fmax(worst, fabs(0.8 * at[k].left -
                                 gaussian_seen(0.8f, 0.05f, source_mean, risen)));
        worst = fmax(worst, fabs(0.8 - gaussian_seen(0.8f, 0, source_mean, risen)));
        lid = fmax(lid, fabs(0.8 * at[k].left -
                             gaussian_seen(0.8f, -0.05f, source_mean, sunk)));
        lid = fmax(lid, fabs(0.8 * at[k].left -
                             gaussian_seen(0.8f, -0.04f, source_mean, risen)));
    }
    check("seen within reach of home", worst, 1e-5);
    check("of a lid: the way up does not count", lid, 1e-5);
}

/* What a frame shows of a surface, by depth's slope along the way that the
 * camera went. */
static void places_shown(void)
{
    static const struct { double tilt, way, shown; } at[] = {
        {0, 0.7, 1}, {5, 0, 1}, {1, 1.0 / 3, 1},    /* 4/3 of it: 0.75 */
        {1, 1, (0.5 - 0.4) / 0.35}, {3, 0.5, 0},    /* twice; 2.5 times */
        {-1, 0.7, 1}, {-1, 0.825, 0.5}, {-1, 0.95, 0}, {-9, 0.5, 0}
    };
    double worst = 0;

    for (size_t k = 0; k < sizeof at / sizeof *at; k++)
        for (int axis = 0; axis < 2; axis++) {
            float tilt[2] = {3, 3}, way[2] = {0};

            tilt[axis] = (float)at[k].tilt;
            way[axis] = (float)at[k].way;
            worst = fmax(worst, fabs(gaussian_visible(gaussian_more(tilt, way)) -
                                     at[k].shown));
        }
    check("shown by slope and way", worst, 1e-6);
    check("the plane's opacity is whole till there",
          gaussian_halved(GAUSSIAN_THIN, 1 / GAUSSIAN_DRAWN), 0);
    check("and falls by eight halves where nothing is",
          fabs(8 - gaussian_halved(GAUSSIAN_THIN, 1 / GAUSSIAN_TORN)), 1e-5);
}

/* Places in the grain: beside those in the photograph, and alone, where they are all
 * there is. */
static void places_grain(void)
{
    struct testscene t;
    struct splat_options o = splat_defaults(SIZE, SIZE, 3);
    float *image = scene_grab(SIZE * SIZE * 3, sizeof *image);
    float *place = scene_grab(SIZE * SIZE * PLACES, sizeof *place);
    float *around = scene_grab(2 * N, sizeof *around);
    float *normal = scene_grab(3 * N, sizeof *normal), most = 0;
    struct random r;

    places_scene(&t, N, 47);
    random_init(&r, 47, "grain");
    for (size_t i = 0; i < 2 * N; i++)
        around[i] = i % 10 < 2 ? -9 : (float)random_range(&r, -0.5, 1.5);
    for (size_t i = 0; i < 3 * N; i++)
        normal[i] = i % 21 < 3 ? 0 : (float)random_range(&r, -0.5, 0.5);
    t.g.around = around;
    t.g.normal = normal;
    o.place = true;
    o.exp_degree = 5;
    draw_places(image, place, &t, &o);
    check("places of both against double", places_error(place, &t), 5e-5);
    memset((float *)t.g.seen, 0, N * sizeof *t.g.seen);
    draw_places(image, place, &t, &o);
    check("places in the grain alone, of their weight",
          places_error(place, &t) / SPLAT_PLACE_GRAIN, 5e-5);
    for (size_t p = 0; p < SIZE * SIZE; p++)
        most = fmaxf(most, place[PLACES * p + 2] / SPLAT_PLACE_GRAIN);
    check_range("which is what covers a pixel", (double)most, 0.5, 1);
    places_release(&t);
    free(image);
    free(place);
    free(around);
    free(normal);
}

/* Gaussians move, some beyond their reach, and the view changes, while the
 * camera stays. */
static void places_moving(void)
{
    struct testscene t;
    float *source_mean = scene_grab(3 * N, sizeof *source_mean);
    float *reach = scene_grab(N, sizeof *reach);
    struct splat_options o = splat_defaults(SIZE, SIZE, 3);
    struct splat s = {0};
    struct error err = {0};
    size_t P = SIZE * SIZE;
    float *image = scene_grab(P * 3, sizeof *image);
    float *place = scene_grab(P * PLACES, sizeof *place);
    float *fresh = scene_grab(P * PLACES, sizeof *fresh);
    struct splat_pictures out = {.image = image, .place = place};
    struct splat_place_view first = {.A = {1, 0, 0, 1}};

    places_scene(&t, N, 43);
    memcpy(source_mean, t.g.mean, 3 * N * sizeof *source_mean);
    for (size_t i = 0; i < N; i += 2)
        reach[i] = (i % 4 ? 0.001f : -0.001f) * (float)(i % 60);
    t.g.source_mean = source_mean;
    t.g.reach = reach;
    o.place = true;
    o.exp_degree = 5;
    struct splat_camera cam = splat_camera_square(t.cam, SIZE, 12);
    bool ok = splat_init(&s, &o, &err) == 0 &&
              splat_load(&s, &t.g, &err) == 0 &&
              splat_draw(&s, &out, &cam, &first, NULL, &err) == 0;

    for (size_t i = 100; i < 500; i++)
        ((float *)t.g.mean)[3 * i] += 0.02f;
    ok = ok && splat_update(&s, t.g.mean + 300, 100, 400, &err) == 0 &&
         splat_draw(&s, &out, &cam, &first, NULL, &err) == 0 &&
         splat_draw(&s, &out, &cam, &view, NULL, &err) == 0;
    check_error("drawn thrice", ok, &err);
    draw_places(image, fresh, &t, &o);
    check_that("moved, another view: as drawn anew",
               !memcmp(place, fresh, P * PLACES * sizeof *place));
    check("moved: places against double", places_error(place, &t), 5e-5);
    t.g.reach = NULL;
    draw_places(image, fresh, &t, &o);
    check_that("which the reach has changed",
               memcmp(place, fresh, P * PLACES * sizeof *place) != 0);
    splat_release(&s);
    places_release(&t);
    free(source_mean);
    free(reach);
    free(image);
    free(place);
    free(fresh);
}

/* ---- backward ------------------------------------------------------------ */

/* Rows of one Gaussian's gradients, and the camera's after them. */
enum { MEAN = 0, SCALE = 3, QUAT = 6, OPACITY = 10, PLACE = 11, COLOR = PLACE + PLACES };

static float *kernel_gradients(const struct testscene *t, size_t C,
                               int threads,
                               const struct splat_picture_gradients *d)
{
    struct splat_options o = splat_defaults(SIZE, SIZE, (int)C);
    struct splat_camera cam = splat_camera_square(t->cam, SIZE, 12);
    size_t n = t->g.n;
    float *all = scene_grab(n * (COLOR + C) + 12, sizeof *all);
    float *image = scene_grab(SIZE * SIZE * C, sizeof *image);
    float *place = scene_grab(SIZE * SIZE * PLACES, sizeof *place);
    struct splat_pictures out = {.image = image, .place = place};
    struct splat_gradients g = {
        .mean = all, .scale = all + SCALE * n, .quat = all + QUAT * n,
        .opacity = all + OPACITY * n, .place = all + PLACE * n,
        .color = all + COLOR * n, .rt = all + (COLOR + C) * n};
    struct splat s = {0};
    struct error err = {0};

    o.gradients = o.place = true;
    o.threads = threads;
    check_error("gradients", splat_init(&s, &o, &err) == 0 &&
                splat_load(&s, &t->g, &err) == 0 &&
                splat_draw(&s, &out, &cam, &view, NULL, &err) == 0 &&
                splat_backward(&s, &g, d, &err) == 0, &err);
    splat_release(&s);
    free(image);
    free(place);
    return all;
}

/* The reference's: channels and places are one picture there. */
static double *reference_gradients_of(const struct testscene *t, size_t C,
                                      const struct splat_picture_gradients *d)
{
    size_t n = t->g.n, P = SIZE * SIZE, K = C + PLACES;
    double *all = scene_grab(n * (COLOR + C) + 12, sizeof *all);
    double *color = scene_grab(n * K, sizeof *color);
    double *g = scene_grab(P * K, sizeof *g), *ga = scene_grab(P, sizeof *ga);
    struct reference_places places;
    struct reference_gradients to = {
        .mean = all, .scale = all + SCALE * n, .quat = all + QUAT * n,
        .opacity = all + OPACITY * n, .color = color,
        .rt = all + (COLOR + C) * n, .places = &places};
    struct reference truth;
    struct error err = {0};

    for (size_t p = 0; p < P; p++) {
        for (size_t c = 0; c < K; c++)
            g[p * K + c] = c < C ? d->image[p * C + c]
                                 : d->place[p * PLACES + c - C];
        ga[p] = d->alpha[p];
    }
    if (places_reference(&truth, &places, t, (int)C, SIZE, &err) ||
        reference_backward(&to, &truth, g, ga, &err))
        exit(1);
    for (size_t i = 0; i < n; i++)      /* of the opacity that is given */
        all[OPACITY * n + i] *= places_left(&t->g, i);
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < K; c++)
            all[c < C ? COLOR * n + i * C + c : PLACE * n + i * PLACES + c - C] =
                color[i * K + c];
    reference_places_release(&places);
    reference_release(&truth);
    free(color);
    free(g);
    free(ga);
    return all;
}

static void places_backward(size_t C)
{
    static const char *const name[] = {"mean", "scale", "quat", "opacity",
                                       "place", "color", "camera"};
    struct testscene t;
    size_t P = SIZE * SIZE, all = N * (COLOR + C) + 12;
    size_t at[8] = {0, SCALE * N, QUAT * N, OPACITY * N, PLACE * N,
                    COLOR * N, (COLOR + C) * N, all};
    float *f = scene_grab(P * (C + PLACES + 1), sizeof *f);
    struct splat_picture_gradients d = {f, f + P * C, f + P * (C + 1)};

    places_scene(&t, N, 21);
    random_numbers(f, P * (C + PLACES + 1), 3);
    double *want = reference_gradients_of(&t, C, &d);
    float *one = kernel_gradients(&t, C, 1, &d);
    float *seven = kernel_gradients(&t, C, 7, &d);

    for (int k = 0; k < 7; k++) {
        char what[64];

        snprintf(what, sizeof what, "C %zu %s: relative L2", C, name[k]);
        check(what,
              splat_relative(one + at[k], want + at[k], at[k + 1] - at[k]),
              1e-3);
    }
    check_that("the same bits for 7 threads",
               !memcmp(one, seven, all * sizeof *one));
    places_release(&t);
    free(f);
    free(want);
    free(one);
    free(seven);
}

/* ---- the reference against finite differences ---------------------------- */

static double places_loss(const struct reference *t,
                          const struct reference_places *p, const double *g)
{
    size_t values = (size_t)t->width * (size_t)t->height * (size_t)t->channels;
    double *image = scene_grab(values, sizeof *image), sum = 0;

    reference_places_fill(t, p);
    if (reference_forward(image, NULL, NULL, NULL, t, NULL))
        exit(1);
    for (size_t i = 0; i < values; i++)
        sum += image[i] * g[i];
    free(image);
    return sum;
}

/* Relative error of d against four-point differences of the loss in x (n). */
static double difference_error(double *x, const double *d, size_t n, double h,
                               const struct reference *t,
                               const struct reference_places *p,
                               const double *g)
{
    static const double at[4] = {-2, -1, 1, 2}, weight[4] = {1, -8, 8, -1};
    double dd = 0, ss = 0;

    for (size_t i = 0; i < n; i++) {
        double x0 = x[i], want = 0;

        for (int k = 0; k < 4; k++) {
            x[i] = x0 + at[k] * h;
            want += weight[k] * places_loss(t, p, g) / (12 * h);
        }
        x[i] = x0;
        dd += (d[i] - want) * (d[i] - want);
        ss += want * want;
    }
    return sqrt(dd / fmax(ss, 1e-300));
}

static void finite_differences(void)
{
    enum { FEW = 12, SMALL = 16, K = PLACES + 1 };
    struct testscene scene;
    struct reference t;
    struct reference_places places;
    struct error err = {0};
    double mean[3 * FEW], scale[3 * FEW], opacity[FEW], color[K * FEW], rt[12];
    double g[SMALL * SMALL * K];
    float f[SMALL * SMALL * K];
    uint32_t order[FEW];
    struct reference_gradients d = {.mean = mean, .scale = scale,
                                    .opacity = opacity, .color = color,
                                    .rt = rt, .places = &places};

    places_scene(&scene, FEW, 11);

    random_numbers(f, SMALL * SMALL * K, 5);
    for (size_t i = 0; i < SMALL * SMALL * K; i++)
        g[i] = f[i];
    if (places_reference(&t, &places, &scene, 1, SMALL, &err))
        exit(1);
    t.alpha_cut = 1e-14;            /* cut-offs out of the way */
    t.t_cut = 0;
    for (uint32_t i = 0; i < FEW; i++) {
        order[i] = i * 7 % FEW;
        t.opacity[i] *= 0.9;
    }
    t.order = order;
    if (reference_backward(&d, &t, g, NULL, &err))
        exit(1);
    check("finite differences: mean",
          difference_error(t.mean, mean, 3 * FEW, 1e-5, &t, &places, g),
          1e-6);
    check("finite differences: scale",
          difference_error(t.scale, scale, 3 * FEW, 1e-5, &t, &places, g),
          1e-6);
    check("finite differences: opacity",
          difference_error(t.opacity, opacity, FEW, 1e-5, &t, &places, g),
          1e-6);
    check("finite differences: camera",
          difference_error(t.rt, rt, 12, 1e-7, &t, &places, g),
          1e-6);
    t.order = NULL;
    reference_places_release(&places);
    reference_release(&t);
    places_release(&scene);
}

/* ---- refused ------------------------------------------------------------- */

static void places_refuses(void)
{
    struct testscene t;
    struct splat_options o = splat_defaults(SIZE, SIZE, 3);
    struct splat s = {0};
    struct error err = {0};
    float image[SIZE * SIZE * 3], place[SIZE * SIZE * 3];
    struct splat_pictures out = {.image = image, .place = place};

    places_scene(&t, 40, 3);
    struct splat_camera cam = splat_camera_square(t.cam, SIZE, 12);

    check_that("made without places", splat_init(&s, &o, &err) == 0 &&
               splat_load(&s, &t.g, &err) == 0);
    check_that("then they cannot be drawn",
               splat_draw(&s, &out, &cam, &view, NULL, &err) != 0);
    splat_release(&s);
    o.place = true;
    ((float *)t.g.seen)[7] = 1.5f;
    check_that("seen over 1 is refused by number",
               splat_init(&s, &o, &err) == 0 &&
               splat_load(&s, &t.g, &err) != 0 &&
               strstr(err.text, "seen[7]") != NULL);
    splat_release(&s);
    places_release(&t);
}

static int places_test(void)
{
    places_forward(3, false);
    places_forward(3, true);
    places_forward(4, false);
    places_forward(32, false);
    places_grain();
    places_moving();
    places_backward(3);
    places_backward(8);
    places_backward(32);
    return check_status();
}

int main(void)
{
    int bad = at_each_level(places_test);

    places_reach();
    places_shown();
    finite_differences();
    places_refuses();
    return bad || check_status();
}
