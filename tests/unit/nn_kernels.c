/* Every kernel of lib/nn at every level of instructions that this processor
 * has, against the plain one, on sizes of the shipped networks and odd ones:
 * sums may round differently (1e-5 of the largest value), conversions not at
 * all.  With --time: the least time of each, rounds of the levels alternating,
 * and its speed as a share of the widest one's. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "lib/base/half.h"
#include "lib/base/random.h"
#include "lib/nn/act.h"
#include "lib/nn/depthwise.h"
#include "lib/nn/fused_stem.h"
#include "lib/nn/kernels.h"
#include "lib/nn/rescale.h"
#include "lib/nn/winograd.h"

#define ROOM 600000      /* floats of a buffer */
#define ROUNDS 15

static float in[6][ROOM], out[3][ROOM];
static uint16_t half[ROOM];
static uint8_t bytes[ROOM];
static struct depthwise dw;
static struct rescale grow;
static struct winograd wino;
static struct nn_plan plan;

typedef void run_fn(const struct nn_kernels *k, size_t rows, size_t C);

/* Each runs one kernel on rows of C channels and writes to out (or half or
 * bytes); what is read lies in `in`. */
#define CASE(name, ...)                                                      \
    static void run_##name(const struct nn_kernels *k, size_t rows,          \
                           size_t C)                                         \
    {                                                                        \
        size_t n = rows * C;                                                 \
        (void)n;                                                             \
        __VA_ARGS__;                                                         \
    }

CASE(act_relu, k->act_forward(out[0], in[0], ACT_RELU, n))
CASE(act_hardswish, k->act_forward(out[0], in[0], ACT_HARDSWISH, n))
CASE(act_sigmoid, k->act_forward(out[0], in[0], ACT_SIGMOID, n))
CASE(act_tanh, k->act_forward(out[0], in[0], ACT_TANH, n))
CASE(act_gelu, k->act_forward(out[0], in[0], ACT_GELU, n))
CASE(act_gelu_tanh, k->act_forward(out[0], in[0], ACT_GELU_TANH, n))
CASE(act_silu, k->act_forward(out[0], in[0], ACT_SILU, n))
CASE(act_silu_backward, k->act_backward(out[0], in[0], in[1], ACT_SILU, n))
CASE(act_gelu_tanh_backward,
     k->act_backward(out[0], in[0], in[1], ACT_GELU_TANH, n))
CASE(act_backward, k->act_backward(out[0], in[0], in[1], ACT_HARDSWISH, n))
CASE(act_backward_out,
     k->act_backward_out(out[0], in[0], in[1], ACT_LRELU, n))
CASE(act_sums, memcpy(out[1], in[1], n * sizeof(float));
     k->act_sums(out[0], out[1], in[0], ACT_LRELU, rows, C))
CASE(norm_sums, k->norm_sums(out[0], in[0], in[1], rows, C))
CASE(norm_apply, k->norm_apply(out[0], in[0], in[1], in[2], in[3],
                               ACT_HARDSWISH, C * ((128 + C - 1) / C), n))
CASE(norm_backward_sums,
     k->norm_backward_sums(out[0], out[1], in[0], in[1], in[2], in[3], in[4],
                           ACT_RELU, 0, rows, C))
CASE(norm_backward_apply,
     k->norm_backward_apply(out[0], in[0], in[1], in[2],
                            C * ((128 + C - 1) / C), n))
CASE(layer_norm_forward,
     k->layer_norm_forward(out[0], out[1], out[2], in[0], in[1], in[2], 1e-6f,
                           rows, C))
CASE(layer_norm_backward,
     k->layer_norm_backward(out[0], out[1], in[0], in[1], in[2], in[3], in[4],
                            rows, C))
CASE(depthwise_forward, (void)rows; for (size_t c = 0; c < C; c += 16)
     k->depthwise_forward(out[0], in[0], out[1], &dw, 0, c, 0, dw.oh))
CASE(depthwise_backward_data, (void)rows; for (size_t c = 0; c < C; c += 16)
     k->depthwise_backward_data(out[0], in[0], out[1], &dw, 0, c, 0, dw.h))
CASE(depthwise_backward_weights, (void)rows;
     for (size_t c = 0; c < C; c += 16)
         k->depthwise_backward_weights(out[0], in[0], in[1], out[1], &dw, 0,
                                       c))
CASE(gemv, k->gemv(out[0], in[0], in[1], in[2], rows, C))
CASE(dot, out[0][0] = (float)k->dot(in[0], in[1], n))
CASE(channel_scale, k->channel_scale(out[0], in[0], in[1], in[2], rows, C))
CASE(channel_dot, k->channel_dot(out[0], in[0], in[1], rows, C))
CASE(rescale_line, (void)rows; (void)C; for (size_t y = 0; y < 64; y++)
     k->rescale_line(out[0] + y * 64 * 32, out[1], in[0], &grow, y))
CASE(rescale_line_backward, (void)rows; (void)C;
     for (size_t y = 0; y < 32; y++)
         k->rescale_line_backward(out[0] + y * 32 * 32, out[1], in[0], &grow,
                                  y))
CASE(sft_forward, k->sft_forward(out[0], in[0], in[1], 1, rows, C))
CASE(sft_backward,
     k->sft_backward(out[0], out[1], in[0], in[1], in[2], 1, rows, C))
CASE(add, memcpy(out[0], in[1], n * sizeof(float)); k->add(out[0], in[0], n))
CASE(to_bf16, k->to_bf16(half, in[0], n))
CASE(range, out[0][0] = out[0][1] = 0;
     k->range(out[0], out[0] + 1, in[0], n))
CASE(quantise, k->quantise(bytes, in[0], 100, 117, n))
CASE(fused_stem_row, struct fused_stem_rows r = { { in[0], in[1] },
                                      { (char *)in[2], (char *)in[3] }, 64 };
     k->fused_stem_row(out[0], &r, in[4], in[5], rows, C, 16))
CASE(pick_rgb, k->pick_rgb(out[0], in[0], rows, C))
CASE(pick_rgb_half, k->pick_rgb_half(out[0], half, rows, C))
CASE(widen, k->widen(out[0], half, n))
CASE(softmax, memcpy(out[0], in[0], n * sizeof(float));
     k->softmax(out[0], rows, C, C, 3))
CASE(softmax_backward, memcpy(out[0], in[0], n * sizeof(float));
     k->softmax_backward(out[0], in[1], rows, C, C, 3))
CASE(style_finish, k->style_finish(out[0], in[0], in[1], in[2], in[3], 0.3f,
                                   rows, C))
CASE(style_backward, k->style_backward(out[0], out[1], in[0], in[1], in[2],
                                       in[3], in[4], rows, C))
CASE(gemm_pack, k->gemm_pack(out[0], in[0], C, 1, rows, C))
CASE(gemm, k->gemm(out[0], C, in[0], C, 1, in[1], rows, C, C, NULL, 0))
CASE(winograd_input, (void)C; for (size_t i = 0; i < rows; i++)
     k->winograd_input(out[0], in[0], &wino, i, 4 * (ptrdiff_t)i - 1, 3))
CASE(winograd_output, (void)C; for (size_t i = 0; i < rows; i++)
     k->winograd_output(out[0], in[0], &wino, i, 4 * i, 4))

static const struct kernel_case {
    const char *name;
    run_fn *run;
    size_t rows, C, repeat;      /* calls to one timing */
    double tolerance;
} cases[] = {
#define ROW(name, rows, C, repeat, tolerance)                                \
    { #name, run_##name, rows, C, repeat, tolerance }
    ROW(act_relu, 1021, 40, 20, 0), ROW(act_hardswish, 1021, 40, 20, 1e-6),
    ROW(act_sigmoid, 1021, 40, 10, 1e-6), ROW(act_tanh, 1021, 40, 10, 1e-6),
    ROW(act_gelu, 1021, 40, 1, 1e-6),
    ROW(act_gelu_tanh, 1021, 40, 20, 1e-6), ROW(act_silu, 1021, 40, 20, 1e-6),
    ROW(act_gelu_tanh_backward, 1021, 40, 20, 1e-6),
    ROW(act_silu_backward, 1021, 40, 20, 1e-6),
    ROW(act_backward, 1021, 40, 20, 1e-6),
    ROW(act_backward_out, 1021, 40, 20, 0), ROW(act_sums, 512, 96, 10, 1e-5),
    ROW(norm_sums, 512, 24, 10, 1e-5), ROW(norm_sums, 512, 96, 10, 1e-5),
    ROW(norm_apply, 512, 40, 10, 1e-5),
    ROW(norm_backward_sums, 511, 24, 10, 1e-5),
    ROW(norm_backward_sums, 511, 96, 10, 1e-5),
    ROW(norm_backward_apply, 512, 40, 10, 1e-5),
    ROW(layer_norm_forward, 64, 768, 10, 1e-5),
    ROW(layer_norm_backward, 64, 768, 10, 1e-5),
    ROW(depthwise_forward, 1, 88, 10, 1e-5),
    ROW(depthwise_backward_data, 1, 88, 10, 1e-5),
    ROW(depthwise_backward_weights, 1, 88, 10, 1e-5),
    ROW(gemv, 72, 288, 20, 1e-5), ROW(dot, 1, 1024, 100, 1e-6),
    ROW(channel_scale, 196, 240, 10, 1e-6),
    ROW(channel_dot, 196, 240, 10, 1e-5), ROW(rescale_line, 1, 1, 2, 1e-6),
    ROW(rescale_line_backward, 1, 1, 2, 1e-6),
    ROW(sft_forward, 1024, 32, 10, 1e-6),
    ROW(sft_backward, 1024, 32, 10, 1e-6), ROW(add, 1021, 40, 10, 0),
    ROW(to_bf16, 1021, 41, 10, 0), ROW(range,
                                                                         1021,
                                                                         41,
                                                                         10,
                                                                         0),
    ROW(quantise, 1021, 41, 10, 0), ROW(fused_stem_row, 253, 32, 4, 1e-5),
    ROW(pick_rgb, 512, 32, 10, 0), ROW(pick_rgb_half, 128, 32, 10, 0),
    ROW(pick_rgb_half, 31, 3, 10, 0), ROW(widen, 1021, 41, 10, 0),
    ROW(softmax, 48, 1369, 2, 1e-5), ROW(softmax_backward, 48, 1369, 4, 1e-5),
    ROW(style_finish, 512, 64, 10, 1e-6),
    ROW(style_backward, 512, 64, 10, 1e-5), ROW(gemm_pack, 96, 96, 20, 0),
    ROW(gemm, 96, 32, 40, 1e-5), ROW(gemm, 96, 64, 20, 1e-5),
    ROW(gemm, 49, 99, 10, 1e-5), ROW(winograd_input, 8, 32, 20, 1e-5),
    ROW(winograd_output, 8, 32, 20, 1e-5),
};

#define CASES (sizeof cases / sizeof *cases)

static void kernel_prepare(void)
{
    struct random r;

    random_init(&r, 7, "nn kernels");
    for (size_t b = 0; b < 6; b++)
        for (size_t i = 0; i < ROOM; i++)
            in[b][i] = (float)random_range(&r, -1, 1);
    nn_plan_init(&plan, (struct nn_options){ NN_FROZEN, NN_F32 });
    dw = (struct depthwise){ .channels = 88, .kernel = 3, .stride = 1, .h = 28,
                             .w = 28, .oh = 28, .ow = 28, .top = 1, .left = 1,
                             .act = ACT_RELU, .taps = in[3],
                             .flipped = in[4], .bias = in[5] };
    rescale_plan(&grow, &plan, RESCALE_BILINEAR, 1, 32, 32, 64, 64, 32);
    wino = (struct winograd){ .batch = 1, .h = 34, .w = 34, .in = 32,
                              .out = 32, .act = ACT_LRELU, .v_size = 272,
                              .m_size = 272, .bias = in[5] };
}

/* Greatest difference of all that a kernel wrote, over the greatest value. */
static double kernel_apart(const float *a, const float *b, size_t n)
{
    double max = 0, size = 1e-30;

    for (size_t i = 0; i < n; i++) {
        max = fmax(max, fabs((double)a[i] - (double)b[i]));
        size = fmax(size, fabs((double)b[i]));
        if (isnan(a[i]) != isnan(b[i]))
            return INFINITY;
    }
    return max / size;
}

static void kernel_poison(void)
{
    for (size_t b = 0; b < 3; b++)
        for (size_t i = 0; i < ROOM; i++)
            out[b][i] = 0;
    memset(bytes, 99, sizeof bytes);
    for (size_t i = 0; i < ROOM; i++)
        half[i] = (uint16_t)(i * 40503u) & 0xfbff;   /* no infinity */
}

static int kernel_compare(const struct kernel_case *c, enum cpu_level level)
{
    static float want[ROOM];
    static uint16_t want_half[ROOM];
    static uint8_t want_bytes[ROOM];

    kernel_poison();
    c->run(nn_kernels_at(CPU_BASELINE), c->rows, c->C);
    memcpy(want, out[0], sizeof want);
    memcpy(want_half, half, sizeof half);
    memcpy(want_bytes, bytes, sizeof bytes);
    kernel_poison();
    c->run(nn_kernels_at(level), c->rows, c->C);
    double max = kernel_apart(out[0], want, ROOM);
    bool same = !memcmp(want_half, half, sizeof half) &&
                !memcmp(want_bytes, bytes, sizeof bytes);
    if (same && max <= c->tolerance)
        return 0;
    printf("%s %zux%zu, %s: %g (at most %g)%s\n", c->name, c->rows, c->C,
           cpu_level_name(level), max, c->tolerance,
           same ? "" : ", other bytes");
    return 1;
}

static void time_case(const struct kernel_case *c)
{
    double best[3] = { INFINITY, INFINITY, INFINITY };
    int top = (int)cpu_level();

    for (int round = 0; round < ROUNDS; round++)
        for (int i = 0; i <= top; i++) {
            const struct nn_kernels *k = nn_kernels_at((enum cpu_level)i);
            double start = cpu_seconds();

            for (size_t j = 0; j < c->repeat; j++)
                c->run(k, c->rows, c->C);
            best[i] = fmin(best[i], (cpu_seconds() - start) /
                                        (double)c->repeat);
        }
    printf("%-28s %5zu x %-5zu", c->name, c->rows, c->C);
    for (int i = top; i >= 0; i--)
        printf("  %8.2f us %5.2f", 1e6 * best[i], best[top] / best[i]);
    puts("");
}

/* Every half float, widened as lib/base/half.h has it; NaN is any NaN. */
static int halves_compare(enum cpu_level level)
{
    size_t apart = 0;

    for (size_t i = 0; i < 65536; i++)
        half[i] = (uint16_t)i;
    nn_kernels_at(level)->widen(out[0], half, 65536);
    for (size_t i = 0; i < 65536; i++) {
        const float want = half_to_float(half[i]);

        apart += isnan(want) ? !isnan(out[0][i])
                             : memcmp(&want, &out[0][i], sizeof want) != 0;
    }
    if (apart)
        printf("%s: %zu halves are other floats\n", cpu_level_name(level),
               apart);
    return apart > 0;
}

int main(int argc, char **argv)
{
    bool timing = argc > 1 && !strcmp(argv[1], "--time");
    int failures = 0;

    kernel_prepare();
    if (timing) {
        printf("%-42s", "kernel, rows x channels; time, speed");
        for (int i = (int)cpu_level(); i >= 0; i--)
            printf("  %17s", cpu_level_name((enum cpu_level)i));
        puts("");
    }
    for (size_t i = 0; i < CASES; i++) {
        if (timing)
            time_case(&cases[i]);
        for (int k = 1; k <= (int)cpu_level() && !timing; k++)
            failures += kernel_compare(&cases[i], (enum cpu_level)k);
    }
    for (int k = 0; k <= (int)cpu_level() && !timing; k++)
        failures += halves_compare((enum cpu_level)k);
    nn_plan_release(&plan);
    if (!timing)
        printf("%zu kernels at %d levels, %d failures\n", CASES,
               (int)cpu_level() + 1, failures);
    return failures != 0;
}
