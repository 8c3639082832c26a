/* LPIPS against its plain definition in double: AlexNet's convolutions and
 * maxima as nested loops, differences of unit-length features. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "lib/base/random.h"
#include "lib/lab/eval/lpips.h"
#include "lib/nn/params.h"
#include "tests/check.h"
#include "tests/reference/map.h"

enum { STAGES = 5, H = 71, W = 86 };    /* odd ones: windows are left over */

static const struct {
    const char *name;
    size_t out, in, kernel, stride, pad;
    bool pool;
} net[STAGES] = {
    {"0", 64, 3, 11, 4, 2, false},   {"3", 192, 64, 5, 1, 2, true},
    {"6", 384, 192, 3, 1, 1, true},  {"8", 256, 384, 3, 1, 1, false},
    {"10", 256, 256, 3, 1, 1, false}
};

/* Weights with biases, and weights of channels that differ. */
static void make_weights(struct params *ps, const char *path)
{
    struct error err = {0};
    char name[40];

    params_init(ps);
    for (size_t i = 0; i < STAGES; i++) {
        const size_t dim[4] = {net[i].out, net[i].in, net[i].kernel,
                               net[i].kernel};
        const size_t lin[4] = {1, net[i].out, 1, 1};

        snprintf(name, sizeof name, "features.%s.weight", net[i].name);
        params_add(ps, name, 4, dim, PARAM_HE, 1.4f);
        snprintf(name, sizeof name, "features.%s.bias", net[i].name);
        params_add(ps, name, 1, dim, PARAM_NORMAL, 0.1f);
        snprintf(name, sizeof name, "lin%zu.model.1.weight", i);
        params_add(ps, name, 4, lin, PARAM_NORMAL, 0.3f);
    }
    REQUIRE(!params_allocate(ps, &err), "%s", err.text);
    params_randomise(ps, 4);
    REQUIRE(!params_save(ps, path, NULL, &err), "%s", err.text);
}

static void plain_features(struct map map[STAGES], const float *rgb,
                           const struct params *ps)
{
    static const double shift[3] = {-0.030, -0.088, -0.188};
    static const double scale[3] = {0.458, 0.448, 0.450};
    struct map in = map_make(H, W, 3);

    for (size_t i = 0; i < 3 * H * W; i++) {
        const size_t c = i % 3;

        in.v[i] = (2 * (double)rgb[c * H * W + i / 3] - 1 - shift[c]) / scale[c];
    }
    for (size_t s = 0; s < STAGES; s++) {
        const struct map *from = s ? &map[s - 1] : &in;
        struct map small = {0};

        if (net[s].pool)
            small = map_max_pool(from, false);
        map[s] = map_conv(net[s].pool ? &small : from, param_w(ps, 3 * s),
                          param_w(ps, 3 * s + 1), net[s].out, net[s].kernel,
                          net[s].stride, net[s].pad);
        map_relu(&map[s]);
        free(small.v);
    }
    free(in.v);
}

/* Mean over places of sum_c w_c (a_c/|a| - b_c/|b|)^2. */
static double plain_distance(const struct map *a, const struct map *b,
                             const float *w)
{
    const size_t n = a->h * a->w;
    double sum = 0;

    for (size_t i = 0; i < n; i++) {
        const double *x = a->v + i * a->C, *y = b->v + i * b->C;
        double la = 0, lb = 0;

        for (size_t c = 0; c < a->C; c++) {
            la += x[c] * x[c];
            lb += y[c] * y[c];
        }
        for (size_t c = 0; c < a->C; c++) {
            const double d = x[c] / (sqrt(la) + 1e-10) -
                             y[c] / (sqrt(lb) + 1e-10);

            sum += (double)w[c] * d * d;
        }
    }
    return sum / (double)n;
}

int main(void)
{
    static float rgb[2][3 * H * W];
    struct map map[2][STAGES];
    struct params ps;
    struct error err = {0};
    struct random r;
    double want = 0, got = 0;
    char path[64];

    snprintf(path, sizeof path, "/tmp/%ld-lpips-test.safetensors",
             (long)getpid());
    make_weights(&ps, path);
    random_init(&r, 7, "lpips");
    for (size_t k = 0; k < 2; k++) {
        for (size_t i = 0; i < 3 * H * W; i++)
            rgb[k][i] = (float)random_uniform(&r);
        plain_features(map[k], rgb[k], &ps);
    }
    for (size_t s = 0; s < STAGES; s++)
        want += plain_distance(&map[0][s], &map[1][s],
                               param_w(&ps, 3 * s + 2));
    for (int learns = 0; learns < 2; learns++) {
        struct lpips l;

        REQUIRE(!lpips_init(&l, LPIPS_ALEXNET, path, &err), "%s",
                err.text);
        l.learns = learns;
        REQUIRE(!lpips_distance(&got, &l, rgb[0], rgb[1], H, W, &err), "%s",
                err.text);
        /* float sums of up to 2304 products, far from where ReLU bends */
        check(learns ? "distance, planned for a gradient" : "distance",
              fabs(got - want), 1e-5 * fabs(want));
        lpips_release(&l);
    }
    for (size_t i = 0; i < 2 * STAGES; i++)
        free(map[i / STAGES][i % STAGES].v);
    params_release(&ps);
    unlink(path);
    return check_status();
}
