/* The light network: gradients of its loss against differences, mirrored
 * answers to mirrored crops, and what it says without tensors. */
#include "lib/net/light_net.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "tests/check.h"

#define N LIGHT_NET_SIDE

static const float truth[3] = {0.3f, -0.5f, 0.2f};

/* Loss alone. */
static double light_loss(const float *rgb, const struct light_net *n)
{
    return light_net_loss(truth, rgb, 1, n);
}

/* dL/dw of every seventh weight of tensor t against central differences. */
static void light_check_gradient(struct params *ps, const float *grad,
                                 size_t t, const float *rgb,
                                 const struct light_net *net)
{
    const size_t at[] = {net->hidden.weight, net->hidden.bias,
                         net->slope.weight, net->slope.bias};
    float *w = param_w(ps, at[t]);
    const float *g = grad + (param_g(ps, at[t]) - ps->g);
    const size_t n = ps->tensor[at[t]].count;
    const float step = 2e-3f;
    double off = 0, size = 0;

    for (size_t i = 0; i < n; i += n > 100 ? 7 : 1) {
        const float keep = w[i];

        w[i] = keep + step;
        const double up = light_loss(rgb, net);
        w[i] = keep - step;
        const double down = light_loss(rgb, net);
        w[i] = keep;
        const double want = (up - down) / (2 * (double)step);

        off += ((double)g[i] - want) * ((double)g[i] - want);
        size += want * want;
    }
    printf("tensor %zu: ", t);
    check("gradient's error over its norm", sqrt(off / size), 0.02);
}

int main(void)
{
    float *rgb = malloc(3 * N * N * sizeof *rgb);
    float *other = malloc(3 * N * N * sizeof *rgb);
    struct light_net net, none = {0};
    struct params ps;
    struct error err = {0};
    struct random r;
    float l[3], m[3];

    random_init(&r, 5, "crop");
    for (size_t i = 0; i < N * N; i++)
        for (size_t c = 0; c < 3; c++) {
            const float x = (float)(i % N) / N, y = (float)(i / N) / N;

            rgb[3 * i + c] = 0.2f + 0.5f * x * x + 0.2f * y +
                             0.1f * (float)random_uniform(&r);
        }
    for (size_t y = 0; y < N; y++)
        for (size_t x = 0; x < N; x++)
            memcpy(other + 3 * (y * N + x), rgb + 3 * (y * N + N - 1 - x),
                   3 * sizeof *rgb);
    params_init(&ps);
    light_net_init(&net, &ps);
    CHECK(params_allocate(&ps, &err) == 0 &&
          params_allocate_gradients(&ps, &err) == 0, "%s", err.text);
    params_randomise(&ps, 3);

    light_net_forward(l, rgb, &net);
    light_net_forward(m, other, &net);
    CHECK(l[0] != 0, "the light comes from nowhere");
    check("mirrored light", fmax(fabs((double)m[0] + l[0]),
                                 fmax(fabs((double)m[1] - l[1]),
                                      fabs((double)m[2] - l[2]))), 1e-6);

    light_loss(rgb, &net);
    float *grad = malloc(ps.total * sizeof *grad);
    memcpy(grad, ps.g, ps.total * sizeof *grad);
    for (size_t t = 0; t < 4; t++)
        light_check_gradient(&ps, grad, t, rgb, &net);

    float *slope = param_w(&ps, net.slope.bias);
    slope[1] = 30;
    light_net_forward(l, rgb, &net);
    check("length less 1",
          fabs(sqrt((double)(l[0] * l[0] + l[1] * l[1] + l[2] * l[2])) - 1),
          1e-5);
    light_net_forward(l, rgb, &none);
    CHECK(l[0] == 0 && l[1] == 0 && l[2] == 0, "a light without tensors");
    params_release(&ps);
    free(grad);
    free(other);
    free(rgb);
    return check_status();
}
