/* The refiner's last layers in inference: two convolutions as one against the
 * two of training, and what is computed where covered pixels see it alone has
 * the same bits as where all is. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/net/narrow_refiner.h"
#include "lib/nn/form.h"
#include "tests/check.h"

enum { H = 96, W = 128, PIXELS = H * W, C = 32, CELLS = PIXELS / 16 };

static struct error err;
static float feat[PIXELS * C], photo[PIXELS * NARROW_REFINER_PHOTO];
static float alpha[PIXELS];

struct result {
    float rgb[3 * PIXELS], field[NARROW_REFINER_FIELD * CELLS];
};

static void seen_require(int rc)
{
    REQUIRE(rc == 0, "%s", err.text);
}

/* A disc, a lone pixel in a corner and one at the border are covered; the
 * other pixels are empty. */
static void seen_draw(struct random *r, double x0, double y0, double radius)
{
    for (size_t i = 0; i < PIXELS; i++) {
        const double x = (double)(i % W), y = (double)(i / W);
        const bool covered = hypot(x - x0, y - y0) < radius ||
                             i == PIXELS - 1 || i == 50 * W;

        alpha[i] = covered ? (float)random_range(r, 0.01, 1) : 0;
        for (size_t c = 0; c < C; c++)
            feat[i * C + c] = covered ? (float)random_uniform(r) : 0;
        for (size_t c = 0; c < NARROW_REFINER_PHOTO; c++)
            photo[i * NARROW_REFINER_PHOTO + c] =
                covered ? (float)random_uniform(r) : 0;
    }
}

/* Some pixel of the cell, or of one of the eight about it, is covered. */
static bool seen_is(size_t cell, long around)
{
    const long y0 = (long)(cell / (W / 4)), x0 = (long)(cell % (W / 4));

    for (long y = 4 * (y0 - around); y < 4 * (y0 + around + 1); y++)
        for (long x = 4 * (x0 - around); x < 4 * (x0 + around + 1); x++)
            if (y >= 0 && y < H && x >= 0 && x < W &&
                alpha[(size_t)y * W + (size_t)x] != 0)
                return true;
    return false;
}

static void seen_run(struct result *out, struct narrow_refiner *r,
                     bool covered)
{
    const struct feature_view view = {
        .f32 = feat, .stride = W * C, .alpha = covered ? alpha : NULL
    };

    r->photo = photo;
    if (narrow_refiner_views(r))
        narrow_refiner_forward_view(out->rgb, &view, r);
    else
        narrow_refiner_forward(out->rgb, feat, r);
    memcpy(out->field, r->k, sizeof out->field);
}

static void seen_plan(struct narrow_refiner *r, struct params *ps,
                      enum nn_mode mode, enum nn_type type)
{
    params_init(ps);
    narrow_refiner_init(r, ps, "r.", C, 32, true, true);
    seen_require(params_allocate(ps, &err));
    seen_require(params_allocate_gradients(ps, &err));
    params_randomise(ps, 4);
    for (size_t t = 0; t < ps->count; t++) {    /* none of them zeros */
        const struct param *p = &ps->tensor[t];
        struct random dice;

        random_init(&dice, 7, p->name);
        for (size_t i = 0; i < p->count && p->init == PARAM_ZERO; i++)
            param_w(ps, t)[i] = (float)random_range(&dice, -0.05, 0.05);
    }
    seen_require(narrow_refiner_plan(r, 1, H, W,
                                     (struct nn_options){mode, type}, &err));
}

static void seen_compare(struct narrow_refiner *fast)
{
    static struct result a, b;
    struct narrow_refiner exact;
    struct params ps;
    double rgb = 0, field = 0;

    seen_plan(&exact, &ps, NN_FROZEN, NN_F32);
    seen_run(&a, &exact, false);
    seen_run(&b, fast, false);
    for (size_t i = 0; i < 3 * PIXELS; i++)
        rgb = fmax(rgb, fabs((double)a.rgb[i] - (double)b.rgb[i]));
    for (size_t i = 0; i < NARROW_REFINER_FIELD * CELLS; i++)
        field = fmax(field, fabs((double)a.field[i] - (double)b.field[i]));
    check("one convolution against two: the picture", rgb, 1e-4);
    check("and the field", field, 1e-4);
    narrow_refiner_release(&exact);
    params_release(&ps);
}

static void where_seen(struct narrow_refiner *fast, struct random *dice)
{
    static struct result all, some;
    bool same = true, left = true, said = true;
    size_t skipped = 0;

    seen_draw(dice, 90, 60, 12);
    seen_run(&some, fast, true);        /* leaves values of another frame */
    seen_draw(dice, 40, 45, 25);
    seen_run(&all, fast, false);
    seen_run(&some, fast, true);
    for (size_t i = 0; i < PIXELS; i++) {
        const size_t cell = i / W / 4 * (W / 4) + i % W / 4;

        if (seen_is(cell, 0))
            same = same && !memcmp(all.rgb + 3 * i, some.rgb + 3 * i,
                                   3 * sizeof *all.rgb);
        else
            for (size_t c = 0; c < 3; c++)
                left = left && some.rgb[3 * i + c] == 0;
        skipped += !seen_is(cell, 0);
    }
    for (size_t i = 0; i < CELLS; i++)
        said = said && (!seen_is(i, 1) ||
                        !memcmp(all.field + NARROW_REFINER_FIELD * i,
                                some.field + NARROW_REFINER_FIELD * i,
                                NARROW_REFINER_FIELD * sizeof *all.field));
    check_that("covered alone: the same bits", same);
    check_that("and nothing is added where nobody is", left);
    check_that("the field where covered pixels see it: the same bits", said);
    check_that("most of it was left out", skipped > PIXELS / 2);
}

/* rgb <- the coarse picture, with what was said last; false: it may not. */
static bool seen_repeat(float *rgb, struct narrow_refiner *fast)
{
    const struct feature_view view = {
        .f32 = feat, .stride = W * C, .alpha = alpha
    };
    bool picked = true;

    fused_stem_pick(rgb, &view, &fast->stem);
    for (size_t i = 0; i < 3 * PIXELS; i++)
        picked = picked && rgb[i] == feat[i / 3 * C + i % 3];
    check_that("the coarse picture", picked);
    return narrow_end_repeat(rgb, fast->k, &fast->end, alpha, W);
}

/* The same picture again, less of it, and more. */
static void seen_again(struct narrow_refiner *fast, struct random *dice)
{
    static struct result first, again;

    seen_draw(dice, 40, 45, 25);
    seen_run(&first, fast, true);
    check_that("repeated", seen_repeat(again.rgb, fast));
    check_that("  it is the same", !memcmp(first.rgb, again.rgb,
                                           sizeof first.rgb));
    seen_draw(dice, 40, 45, 15);
    check_that("a smaller head: repeated", seen_repeat(again.rgb, fast));
    seen_draw(dice, 90, 60, 12);
    check_that("where nothing was: not", !seen_repeat(again.rgb, fast));
}

int main(void)
{
    struct narrow_refiner fast;
    struct random dice;
    struct params ps;

    random_init(&dice, 1, "refiner seen");
    form_prefer(FORM_WINOGRAD);
    seen_plan(&fast, &ps, NN_INFER, NN_FAST);
    check_that("the last layers are one", fast.end.joint.u != NULL);
    seen_draw(&dice, 60, 40, 30);
    seen_compare(&fast);
    where_seen(&fast, &dice);
    seen_again(&fast, &dice);
    narrow_refiner_release(&fast);
    params_release(&ps);
    return check_status();
}
