/* make tune: time Winograd against the direct convolution on the layers of the
 * large networks, one thread, and print lib/nn/tune_table.inc. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "lib/base/cpu.h"
#include "lib/base/random.h"
#include "lib/nn/conv.h"
#include "lib/nn/winograd.h"

static const size_t layers[][2] = {
    { 16, 256 }, { 32, 128 }, { 32, 512 }, { 64, 64 }, { 64, 128 },
    { 64, 256 }, { 128, 64 }, { 128, 128 }, { 128, 296 }, { 256, 32 },
    { 256, 64 }, { 256, 148 }, { 512, 16 }, { 512, 32 }
};

/* Best of several runs, seconds; the process ends on an error. */
static double best_time(size_t C, size_t side, int method)
{
    struct params ps;
    struct conv c;
    struct nn_plan p;
    struct error err = { 0 };
    struct random r;
    size_t n = side * side * C;
    float *in = malloc(n * sizeof *in), *out = malloc(n * sizeof *out);
    params_init(&ps);
    conv_init(&c, &ps, "c", C, C, 3, 1, true);
    c.act = ACT_LRELU;
    winograd_force(method);
    nn_plan_init(&p, (struct nn_options){ NN_INFER, NN_FAST });
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
    double best = INFINITY, start = cpu_seconds();
    for (int i = 0; i < 3 || cpu_seconds() - start < 0.5; i++) {
        double t = cpu_seconds();
        conv_forward(out, in, &c);
        t = cpu_seconds() - t;
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
    printf("/* in, out, side, Winograd's time over the direct convolution's "
           "(one thread);\n * written by make tune. */\n");
    for (size_t i = 0; i < sizeof layers / sizeof *layers; i++) {
        size_t C = layers[i][0], side = layers[i][1];
        double direct = best_time(C, side, -1), wino = best_time(C, side, 1);
        printf("{ %zu, %zu, %zu, %.2ff },\n", C, C, side, wino / direct);
        fprintf(stderr, "%zu -> %zu, %zux%zu: direct %.2f ms, Winograd %.2f\n",
                C, C, side, side, 1e3 * direct, 1e3 * wino);
    }
    return 0;
}
