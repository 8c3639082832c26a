/* make tune: time Winograd against the direct convolution, in float and in
 * bfloat16, on the 3x3 layers of StyleUNet, of the fusion head and of the
 * decoders, one thread, and print lib/nn/tune_table.inc. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "lib/base/cpu.h"
#include "lib/base/random.h"
#include "lib/nn/conv.h"
#include "lib/nn/winograd.h"

/* in, out, side; their order is the order of the search: ties go to the
 * first. */
static const size_t layers[][3] = {
    /* StyleUNet, from the picture inwards */
    { 16, 16, 512 }, { 16, 32, 512 }, { 32, 16, 512 }, { 32, 32, 512 },
    { 64, 32, 512 }, { 16, 32, 256 }, { 32, 32, 256 }, { 32, 64, 256 },
    { 64, 32, 256 }, { 64, 64, 256 }, { 128, 64, 256 }, { 32, 64, 128 },
    { 64, 64, 128 }, { 64, 128, 128 }, { 128, 64, 128 }, { 128, 128, 128 },
    { 256, 128, 128 }, { 64, 128, 64 }, { 128, 128, 64 }, { 128, 256, 64 },
    { 256, 128, 64 }, { 256, 256, 64 }, { 512, 256, 64 }, { 128, 256, 32 },
    { 256, 256, 32 }, { 256, 512, 32 }, { 512, 512, 32 }, { 256, 256, 16 },
    { 512, 512, 16 }, { 512, 512, 8 },
    /* fusion head and decoders */
    { 1040, 256, 37 }, { 256, 256, 74 }, { 272, 256, 148 },
    { 256, 256, 148 }, { 256, 256, 296 }, { 288, 128, 296 },
    { 128, 128, 296 }
};

/* Of the processor, so that others' work on the machine does not count. */
static double tune_seconds(void)
{
    struct timespec t;

    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Best of several runs, seconds; the process ends on an error. */
static double tune_best_time(const size_t layer[3], enum nn_type type,
                             enum winograd_choice method)
{
    struct params ps;
    struct conv c;
    struct nn_plan p;
    struct error err = { 0 };
    struct random r;
    size_t side = layer[2], n = side * side * layer[0];
    float *in = malloc(n * sizeof *in);
    float *out = malloc(side * side * layer[1] * sizeof *out);

    params_init(&ps);
    conv_init(&c, &ps, "c", layer[0], layer[1], 3, 1, true);
    c.act = ACT_LRELU;
    winograd_force(method);
    nn_plan_init(&p, (struct nn_options){ NN_INFER, type });
    if (params_allocate(&ps, &err)) {
        fprintf(stderr, "tune: %s\n", err.text);
        exit(1);
    }
    params_randomise(&ps, 1);
    conv_plan(&c, &p, 1, side, side);
    if (!in || !out || nn_plan_finish(&p, &err)) {
        fprintf(stderr, "tune: %s\n", err.text);
        exit(1);
    }
    conv_update(&c, NULL);
    random_init(&r, 1, "tune");
    for (size_t i = 0; i < n; i++)
        in[i] = (float)random_range(&r, -1, 1);
    double best = INFINITY, start = tune_seconds();
    for (int i = 0; i < 4 || tune_seconds() - start < 0.3; i++) {
        double t = tune_seconds();

        conv_forward(out, in, &c);
        t = tune_seconds() - t;
        best = t < best ? t : best;
    }
    conv_release(&c);
    nn_plan_release(&p);
    params_release(&ps);
    free(in);
    free(out);
    return best;
}

int main(void)
{
    cpu_flush_denormals();
    printf("/* in, out, side, Winograd's time over the direct convolution's, "
           "and over the\n * same in bfloat16 (one thread); written by make "
           "tune. */\n");
    for (size_t i = 0; i < sizeof layers / sizeof *layers; i++) {
        const size_t *l = layers[i];
        double direct = tune_best_time(l, NN_F32, WINOGRAD_NEVER);
        double half = tune_best_time(l, NN_BF16, WINOGRAD_NEVER);
        double wino = tune_best_time(l, NN_FAST, WINOGRAD_WHEREVER_POSSIBLE);

        printf("{ %zu, %zu, %zu, %.2ff, %.2ff },\n", l[0], l[1], l[2],
               wino / direct, wino / half);
        fprintf(stderr, "%zu -> %zu, %zux%zu: direct %.2f ms, bf16 %.2f, "
                "Winograd %.2f\n", l[0], l[1], l[2], l[2], 1e3 * direct,
                1e3 * half, 1e3 * wino);
    }
    return 0;
}
