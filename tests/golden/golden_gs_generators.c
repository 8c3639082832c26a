/* Case 04: the convolutional and the linear Gaussian decoder, and the harmonic
 * encoding, with the public code's behaviour (its flags set). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/net/conv_decoder.h"
#include "lib/net/harmonic.h"
#include "lib/net/mlp_decoder.h"
#include "tests/golden/layout.h"

/* The attributes of B x N Gaussians and probes of the same sizes. */
struct sides {
    struct gaussian_out out, probe;
    size_t n, colors;
};

static void sides_init(struct sides *s, struct golden *g, size_t n,
                       size_t positions)
{
    size_t width[5] = { 32, 1, 3, 4, positions };
    float **out[5] = { &s->out.color, &s->out.opacity, &s->out.scale,
                       &s->out.quat, &s->out.position };
    float **probe[5] = { &s->probe.color, &s->probe.opacity, &s->probe.scale,
                         &s->probe.quat, &s->probe.position };

    s->n = n;
    for (int i = 0; i < 5; i++) {
        *out[i] = calloc(n * width[i] + 1, sizeof(float));
        *probe[i] = golden_probe_array(g->seed, n * width[i] + 1);
    }
}

static void sides_release(struct sides *s)
{
    float *all[10] = { s->out.color, s->out.opacity, s->out.scale,
                       s->out.quat, s->out.position, s->probe.color,
                       s->probe.opacity, s->probe.scale, s->probe.quat,
                       s->probe.position };

    for (int i = 0; i < 10; i++)
        free(all[i]);
}

static void compare_out(struct golden *g, const struct sides *s, bool position)
{
    golden_compare(g, "colors", s->out.color, s->n * 32);
    golden_compare(g, "opacities", s->out.opacity, s->n);
    golden_compare(g, "scales", s->out.scale, s->n * 3);
    golden_compare(g, "rotations", s->out.quat, s->n * 4);
    if (position)
        golden_compare(g, "positions", s->out.position, s->n);
}

static void compare_weight(struct golden *g, const struct params *ps,
                           const char *tensor)
{
    char name[160];
    size_t i = params_find(ps, tensor);

    snprintf(name, sizeof name, "grad.%s", tensor);
    golden_compare_l2(g, name, param_g(ps, i), ps->tensor[i].count);
}

static bool generators_failed(struct golden *g, int rc, const struct error *err)
{
    if (!rc)
        return false;
    printf("%s: %s\n", g->name, err->text);
    g->failed++;
    return true;
}

static size_t generators_config(const cJSON *json, const char *key)
{
    return (size_t)cJSON_GetObjectItem(json, key)->valuedouble;
}

static void generators_harmonic(struct golden *g, const float *dir, size_t B)
{
    float enc[8 * HARMONIC_OUT];

    harmonic_forward(enc, dir, B);
    golden_compare(g, "dir_encoding", enc, B * HARMONIC_OUT);
}

static void run_conv(struct golden *g, struct params *ps,
                     struct golden_weights *w, const cJSON *json)
{
    size_t B = generators_config(json, "B"), h = generators_config(json, "h");
    size_t wide = generators_config(json, "w"), n = B * h * wide;
    struct gaussian_head head = { .colors = 32,
                                  .position = GAUSSIAN_POSITION_DEPTH,
                                  .quirk_columns = true };
    struct conv_decoder d;
    struct error err = { 0 };
    struct nn_options opt = { NN_TRAIN, NN_F32 };

    conv_decoder_init(&d, ps, "", 256, 128, head);
    if (generators_failed(g,
                          params_allocate(ps, &err)
                              || params_allocate_gradients(ps, &err),
                          &err))
        return;
    golden_weights_fill(ps, w, g, "");
    if (generators_failed(g, conv_decoder_plan(&d, B, h, wide, opt, &err),
                          &err))
        return;
    struct sides s;
    sides_init(&s, g, n, 1);
    float *planes = golden_array("input.features", g->seed, n * 256, 0, 1);
    float *x = layout_rows(planes, B, h * wide, 256), ddir[24];
    float *dir = golden_f32(g, "input.dir", NULL);
    float *dx = malloc(n * 256 * sizeof *dx);
    generators_harmonic(g, dir, B);
    conv_decoder_forward(&s.out, x, dir, NULL, &d);
    compare_out(g, &s, true);
    conv_decoder_backward(dx, ddir, NULL, &s.probe, dir, NULL, &d);
    layout_compare(g, "grad.input", dx, B, h * wide, 256, true);
    golden_compare_l2(g, "grad.dir", ddir, 3 * B);
    compare_weight(g, ps, "gaussian_conv.0.weight");
    golden_weights_gradients(g, ps, w, "");
    sides_release(&s);
    free(planes);
    free(x);
    free(dx);
    free(dir);
    conv_decoder_release(&d);
}

/* (B,N,1024): from the formula, or [head_base, global] per point. */
static float *linear_input(struct golden *g, size_t B, size_t N, bool head)
{
    if (!head)
        return golden_array("input.features", g->seed, B * N * 1024, 0, 1);
    float *base = golden_array("head_base", g->seed, N * 256, 0, 0.5);
    float *global = golden_array("input.global", g->seed, B * 768, 0, 1);
    float *x = malloc(B * N * 1024 * sizeof *x);
    for (size_t r = 0; r < B * N; r++) {
        memcpy(x + r * 1024, base + r % N * 256, 256 * sizeof *x);
        memcpy(x + r * 1024 + 256, global + r / N * 768, 768 * sizeof *x);
    }
    free(base);
    free(global);
    return x;
}

static void run_linear(struct golden *g, struct params *ps,
                       struct golden_weights *w, const cJSON *json)
{
    size_t B = generators_config(json, "B"), N = generators_config(json, "N"),
           n = B * N;
    struct gaussian_head head = { .colors = 32,
                                  .position = GAUSSIAN_POSITION_NONE,
                                  .quirk_rotation = true };
    struct mlp_decoder d;
    struct error err = { 0 };
    struct nn_options opt = { NN_TRAIN, NN_F32 };

    mlp_decoder_init(&d, ps, "", 1024, 256, 128, head);
    if (generators_failed(
            g,
            params_allocate(ps, &err)
                || params_allocate_gradients(ps, &err),
            &err))
        return;
    golden_weights_fill(ps, w, g, "");
    if (generators_failed(g, mlp_decoder_plan(&d, B, N, opt, &err), &err))
        return;
    struct sides s;
    sides_init(&s, g, n, 0);
    float *x = linear_input(g, B, N,
                            cJSON_IsTrue(cJSON_GetObjectItem(json, "head")));
    float *dir = golden_f32(g, "input.dir", NULL), ddir[24];
    float *dx = malloc(n * 1024 * sizeof *dx);
    generators_harmonic(g, dir, B);
    mlp_decoder_forward(&s.out, x, dir, NULL, &d);
    compare_out(g, &s, false);
    mlp_decoder_backward(dx, ddir, &s.probe, dir, NULL, &d);
    golden_compare_l2(g, "grad.input", dx, n * 1024);
    golden_compare_l2(g, "grad.dir", ddir, 3 * B);
    compare_weight(g, ps, "feature_layers.0.weight");
    golden_weights_gradients(g, ps, w, "");
    sides_release(&s);
    free(x);
    free(dx);
    free(dir);
    mlp_decoder_release(&d);
}

static void run_gs_generators(struct golden *g)
{
    struct params ps;
    struct golden_weights w;
    cJSON *json = golden_json(g, "config");

    params_init(&ps);
    golden_weights_open(&w, g, NULL);
    if (!strncmp(golden_meta(g, "network"), "conv", 4))
        run_conv(g, &ps, &w, json);
    else
        run_linear(g, &ps, &w, json);
    golden_weights_close(&w);
    params_release(&ps);
    cJSON_Delete(json);
}

GOLDEN_CASE("04_gs_generators", run_gs_generators)
