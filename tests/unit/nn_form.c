/* The choice of convolutions' forms: by the cost model alone for processors
 * that are not here, and by processor time for this one.  It prints the times
 * that the model's constants were fitted to. */
#include <math.h>
#include <stdlib.h>
#include <time.h>

#include "lib/base/cpu.h"
#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/nn/conv.h"
#include "lib/nn/form.h"
#include "tests/check.h"


struct layer {
    struct form_layer l;
    size_t side;
};

/* Of E_m, the narrow refiner, StyleUNet and Phase A's networks. */
static const struct layer layers[] = {
    { { 3, 24, 3, 2 }, 112 }, { { 16, 24, 1, 1 }, 112 },
    { { 24, 112, 1, 1 }, 56 }, { { 112, 40, 1, 1 }, 28 },
    { { 360, 56, 1, 1 }, 14 }, { { 864, 144, 1, 1 }, 7 },
    { { 5, 16, 2, 2 }, 128 }, { { 16, 32, 2, 2 }, 128 },
    { { 32, 48, 3, 2 }, 128 }, { { 48, 32, 1, 1 }, 64 },
    { { 64, 64, 3, 1 }, 32 }, { { 32, 32, 3, 1 }, 128 },
    { { 128, 128, 3, 1 }, 64 }, { { 256, 256, 3, 1 }, 32 },
    { { 384, 1536, 1, 1 }, 37 }
};
#define LAYERS (sizeof layers / sizeof *layers)

/* Processor time. */
static double form_seconds(void)
{
    struct timespec t;

    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* A layer as a plan of this type has it. */
struct timed {
    struct params ps;
    struct conv c;
    struct nn_plan p;
    double best;
};

static void timed_open(struct timed *t, const struct layer *l,
                       enum nn_type type)
{
    struct error err = { 0 };

    params_init(&t->ps);
    conv_init(&t->c, &t->ps, "c", l->l.in, l->l.out, l->l.kernel, l->l.stride,
              true);
    t->c.act = ACT_RELU;
    t->c.pad = l->l.kernel == 2 ? CONV_NONE : CONV_HALF;
    nn_plan_init(&t->p, (struct nn_options){ NN_INFER, type });
    if (params_allocate(&t->ps, &err))
        exit(1);
    params_randomise(&t->ps, 1);
    conv_plan(&t->c, &t->p, 1, l->side, l->side);
    if (nn_plan_finish(&t->p, &err))
        exit(1);
    t->best = INFINITY;
}

static void timed_release(struct timed *t)
{
    nn_plan_release(&t->p);
    params_release(&t->ps);
}

/* The least times of the types in turn, so that others' work meets all. */
static void layer_compare(const struct layer *l, const float *in, float *out)
{
    static const enum nn_type type[] = { NN_F32, NN_FAST, NN_BF16, NN_INT8 };
    struct timed t[4];
    char what[120];

    for (int i = 0; i < 4; i++)
        timed_open(&t[i], l, type[i]);
    for (int round = 0; round < 24; round++)
        for (int i = 0; i < 4; i++) {
            double s = form_seconds();

            conv_forward(out, in, &t[i].c);
            t[i].best = fmin(t[i].best, form_seconds() - s);
        }
    for (int i = 1; i < 4; i++) {
        snprintf(what, sizeof what, "%zu -> %zu, %zux%zu of %zu: %s %.0f us, "
                 "f32 %.0f, times", l->l.in, l->l.out, l->l.kernel,
                 l->l.kernel, l->side, nn_type_name(type[i]), 1e6 * t[i].best,
                 1e6 * t[0].best);
        /* a third and 20 us for what others do to the caches */
        check(what, (t[i].best - 2e-5) / t[0].best, 1.33);
    }
    for (int i = 0; i < 4; i++)
        timed_release(&t[i]);
}

/* What processors that are not here would choose. */
static void rates_compare(void)
{
    static const struct form_rates none = { 16, 0, 0, 2 },
                                   intel = { 32, 32, 128, 2 },
                                   zen4 = { 16, 32, 64, 2 },
                                   tiles = { 32, 300, 400, 32 };
    const struct form_layer wide = { 128, 128, 3, 1 }, thin = { 16, 16, 3, 1 };
    bool less = true;

    for (size_t i = 0; i < LAYERS; i++) {
        const struct form_layer *l = &layers[i].l;

        less &= form_choose(l, FORM_INT8, &none) <= FORM_WINOGRAD;
        less &= form_choose(l, FORM_BF16, &intel) <= FORM_WINOGRAD;
    }
    check_that("no type that gains nothing over float", less);
    check_that("Winograd before bfloat16 at twice the rate",
               form_choose(&wide, FORM_BF16, &zen4) == FORM_WINOGRAD);
    check_that("unless its transforms cost as much",
               form_choose(&thin, FORM_BF16, &zen4) == FORM_BF16);
    check_that("tiles before both",
               form_choose(&wide, FORM_BF16, &tiles) == FORM_BF16);
    check_that("only what the plan allows",
               form_choose(&wide, FORM_FLOAT, &tiles) == FORM_FLOAT);
}

int main(void)
{
    const size_t max = 37 * 37 * 1536;
    float *in = malloc(max * sizeof *in), *out = malloc(max * sizeof *out);
    const struct form_rates r = form_rates();
    struct random dice;

    if (!in || !out)
        return 1;
    cpu_flush_denormals();
    parallel_set_width(1);
    random_init(&dice, 1, "forms");
    for (size_t i = 0; i < max; i++)
        in[i] = (float)random_range(&dice, -1, 1);
    rates_compare();
    printf("%s: products a cycle f32 %g, bf16 %g, int8 %g\n", cpu_name(),
           r.f32, r.bf16, r.int8);
    for (size_t i = 0; i < LAYERS; i++)
        layer_compare(&layers[i], in, out);
    free(in);
    free(out);
    return check_status();
}
