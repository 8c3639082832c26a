/* The refiner that is shown the photograph: it starts as the one that is not,
 * and its gradients (weights, features, photograph) agree with differences
 * along themselves. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/net/narrow_refiner.h"
#include "lib/net/refiner.h"
#include "tests/check.h"

enum { S = 32, C = 8, PHOTO = 5, FIELD = 4, N = S * S,
       OUT = 3 * N + FIELD * N / 16 };

#define SMALL 1e-3f     /* nothing reaches NARROW_REFINER_MAX */

static float feat[C * N], photo[PHOTO * N], rgb[3 * N], probe[OUT];
static float dfeat[C * N], dphoto[PHOTO * N], turn[RELATIVE_POSE_SIZE];

static void photo_fill(float *x, size_t n, const char *name, double size)
{
    struct random r;

    random_init(&r, 7, name);
    for (size_t i = 0; i < n; i++)
        x[i] = (float)(size * random_normal(&r));
}

static struct nn_plans plans;

static void photo_make(struct refiner *r, struct params *ps, bool shown,
                       enum nn_mode mode)
{
    const struct refiner_config c = {
        .type = REFINER_NARROW, .channels = C, .width = 8, .turn = true,
        .photo = shown
    };
    struct error err = {0};

    params_init(ps);
    REQUIRE(refiner_init(r, ps, "r.", &c, &err) == 0 &&
            params_allocate(ps, &err) == 0 &&
            params_allocate_gradients(ps, &err) == 0, "%s", err.text);
    params_randomise(ps, 3);
    REQUIRE(refiner_plan(r, 1, S, S, (struct nn_options){mode, NN_F32},
                         &err) == 0, "%s", err.text);
}

/* The last layer's weights times `by`, so that what it adds is small or not. */
static void photo_scale_rgb(struct params *ps, float by)
{
    for (size_t k = 0; k < ps->count; k++)
        for (size_t i = 0; strstr(ps->tensor[k].name, "r.rgb.") &&
                           i < ps->tensor[k].count; i++)
            param_w(ps, k)[i] *= by;
}

static double photo_loss(struct refiner *r)
{
    double sum = 0;

    nn_plans_update(&plans, true);
    refiner_turn(r, turn);
    refiner_photo(r, photo);
    refiner_forward(rgb, feat, r);
    for (size_t i = 0; i < 3 * N; i++)
        sum += (double)probe[i] * (double)rgb[i];
    for (size_t i = 3 * N; i < OUT; i++)
        sum += (double)probe[i] * (double)refiner_field(r)[i - 3 * N];
    return sum;
}

/* The derivative along d (n) by differences of the loss, over d's square. */
static void photo_along(const char *what, float *x, const float *d, size_t n,
                        struct refiner *r)
{
    double square = 0, f[2], best = 1;
    float *keep = malloc(2 * n * sizeof *keep), *way = keep + n;

    memcpy(keep, x, n * sizeof *x);
    memcpy(way, d, n * sizeof *x);
    for (size_t i = 0; i < n; i++)
        square += (double)d[i] * (double)d[i];
    for (double e = 0.1; e > 1e-4; e /= 3) {
        for (int s = 0; s < 2; s++) {
            for (size_t i = 0; i < n; i++)
                x[i] = keep[i] + (float)((s ? e : -e) / sqrt(square)) * way[i];
            f[s] = photo_loss(r);
        }
        best = fmin(best, fabs((f[1] - f[0]) / (2 * e * sqrt(square)) - 1));
    }
    memcpy(x, keep, n * sizeof *x);
    free(keep);
    check_that("a gradient there is", square > 0);
    check(what, best, 1e-3);
}

static void photo_gradients(void)
{
    struct refiner r;
    struct params ps;

    photo_make(&r, &ps, true, NN_TRAIN);
    for (size_t k = 0; k < ps.count; k++)
        photo_fill(param_w(&ps, k), ps.tensor[k].count, ps.tensor[k].name, 0.2);
    photo_scale_rgb(&ps, SMALL);
    photo_loss(&r);
    memset(ps.g, 0, ps.total * sizeof *ps.g);
    refiner_backward(&(struct refiner_gradients){dfeat, NULL, dphoto}, probe,
                     probe + 3 * N, &r);
    for (size_t k = 0; k < ps.count; k++)
        if (strstr(ps.tensor[k].name, "photo.") ||
            strstr(ps.tensor[k].name, "field."))
            photo_along(ps.tensor[k].name, param_w(&ps, k), param_g(&ps, k),
                        ps.tensor[k].count, &r);
    photo_along("fold.1", param_w(&ps, params_find(&ps, "r.fold.1.weight")),
                param_g(&ps, params_find(&ps, "r.fold.1.weight")), 8 * 4 * 4,
                &r);
    photo_along("photograph", photo, dphoto, PHOTO * N, &r);
    photo_along("features", feat, dfeat, C * N, &r);
    refiner_release(&r);
    nn_plans_release(&plans);
    params_release(&ps);
}

/* What it adds is held, in training and in use, and has no gradient then. */
static void photo_held(enum nn_mode mode)
{
    struct refiner r;
    struct params ps;
    double max = 0, min = 1, slope = 0;

    photo_make(&r, &ps, true, mode);
    photo_fill(ps.w, ps.total, "weights", 0.2);
    photo_scale_rgb(&ps, 1e6f);
    photo_loss(&r);
    for (size_t i = 0; i < 3 * N; i++) {
        const double added = fabs((double)rgb[i] -
                                  (double)feat[i / 3 * C + i % 3]);

        max = fmax(max, added);
        min = fmin(min, added);
    }
    check("held to the most", max - (double)NARROW_REFINER_MAX, 1e-6);
    check("all of it", (double)NARROW_REFINER_MAX - min, 1e-6);
    if (mode == NN_TRAIN) {
        const size_t k = params_find(&ps, "r.rgb.bias");

        memset(ps.g, 0, ps.total * sizeof *ps.g);
        refiner_backward(&(struct refiner_gradients){dfeat, NULL, dphoto},
                         probe, probe + 3 * N, &r);
        for (size_t i = 0; i < ps.tensor[k].count; i++)
            slope = fmax(slope, fabs((double)param_g(&ps, k)[i]));
        check("no gradient beyond it", slope, 0);
    }
    refiner_release(&r);
    nn_plans_release(&plans);
    params_release(&ps);
}

/* What is said of all pixels of a place, n numbers, said of each. */
static void photo_repeat(float *each, const float *all, size_t n)
{
    for (size_t i = 0; i < 16; i++)
        memcpy(each + i * n, all, n * sizeof *all);
}

/* Tensors by their names, the new ones at their start, and a correction of each
 * pixel that is the same all over a place. */
static void begins_the_same(void)
{
    static float plain[3 * N];
    struct refiner a, b;
    struct params pa, pb;
    double off = 0, said = 0;

    photo_make(&a, &pa, false, NN_INFER);
    photo_make(&b, &pb, true, NN_INFER);
    for (size_t k = 0; k < pa.count; k++) {
        const size_t i = params_find(&pb, pa.tensor[k].name);
        const size_t n = pb.tensor[i].count;

        photo_fill(param_w(&pb, i), n, pa.tensor[k].name, 0.2);
        if (n < pa.tensor[k].count)
            photo_repeat(param_w(&pa, k), param_w(&pb, i), n);
        else
            memcpy(param_w(&pa, k), param_w(&pb, i), n * sizeof(float));
    }
    photo_scale_rgb(&pa, SMALL);
    photo_scale_rgb(&pb, SMALL);
    nn_plans_update(&plans, true);
    refiner_turn(&a, turn);
    refiner_forward(plain, feat, &a);
    photo_loss(&b);
    for (size_t i = 0; i < 3 * N; i++)
        off = fmax(off, fabs((double)rgb[i] - (double)plain[i]));
    for (size_t i = 0; i < FIELD * N / 16; i++)
        said = fmax(said, fabs((double)refiner_field(&b)[i]));
    check("it begins as without the photograph", off, 1e-5);
    check("and says nothing of it", said, 0);
    check_that("without config.photo no field", refiner_field(&a) == NULL);
    refiner_release(&a);
    refiner_release(&b);
    nn_plans_release(&plans);
    params_release(&pa);
    params_release(&pb);
}

int main(void)
{
    nn_plans_use(&plans);
    photo_fill(feat, C * N, "features", 0.5);
    photo_fill(photo, PHOTO * N, "photograph", 0.5);
    photo_fill(probe, OUT, "probe", 1);
    photo_fill(turn, RELATIVE_POSE_SIZE, "turn", 0.3);
    begins_the_same();
    photo_held(NN_INFER);
    photo_held(NN_TRAIN);
    photo_gradients();
    return check_status();
}
