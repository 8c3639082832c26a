/* The light network, forward and backward: once for the crop's cells, once for
 * their mirror image. */
#include "lib/net/light_net.h"

#include <math.h>
#include <string.h>

#define N LIGHT_NET_CELLS
#define IN ((size_t)N * N)
#define HIDDEN LIGHT_NET_HIDDEN
#define DARK 0.02f      /* sRGB: what is darker tells nothing of its light */

enum { HIDDEN_W, HIDDEN_B, SLOPE_W, SLOPE_B };

void light_net_init(struct light_net *n, struct params *ps)
{
    const size_t hidden[2] = {HIDDEN, IN}, slope[2] = {3, HIDDEN};

    n->ps = ps;
    n->tensor[HIDDEN_W] = params_add(ps, "light.hidden.weight", 2, hidden,
                                     PARAM_HE, 1);
    n->tensor[HIDDEN_B] = params_add(ps, "light.hidden.bias", 1, hidden,
                                     PARAM_ZERO, 0);
    n->tensor[SLOPE_W] = params_add(ps, "light.slope.weight", 2, slope,
                                    PARAM_HE, 0.1f);
    n->tensor[SLOPE_B] = params_add(ps, "light.slope.bias", 1, slope,
                                    PARAM_ZERO, 0);
}

/* cells (N,N): logs of their means, less the mean of the middle third's. */
static void light_net_look(float cells[IN], const float *rgb)
{
    const size_t step = LIGHT_NET_SIDE / N, row = 3 * LIGHT_NET_SIDE;
    const size_t lo = N / 3, hi = 2 * N / 3 + 1;
    float middle = 0;

    for (size_t i = 0; i < IN; i++) {
        const float *at = rgb + i / N * step * row + i % N * step * 3;
        float sum = 0;

        for (size_t y = 0; y < step; y++)
            for (size_t x = 0; x < 3 * step; x++)
                sum += at[y * row + x];
        cells[i] = logf(fmaxf(sum / (float)(3 * step * step), DARK));
        if (i / N >= lo && i / N < hi && i % N >= lo && i % N < hi)
            middle += cells[i] / (float)((hi - lo) * (hi - lo));
    }
    for (size_t i = 0; i < IN; i++)
        cells[i] -= middle;
}

/* The same of the mirror image. */
static void light_net_mirror(float out[IN], const float cells[IN])
{
    for (size_t i = 0; i < IN; i++)
        out[i] = cells[i / N * N + N - 1 - i % N];
}

/* hidden = relu(W cells + b), l = its slope. */
static void light_net_layers(float l[3], float hidden[HIDDEN],
                             const float cells[IN], const struct light_net *n)
{
    const float *w = param_w(n->ps, n->tensor[HIDDEN_W]);
    const float *v = param_w(n->ps, n->tensor[SLOPE_W]);

    memcpy(hidden, param_w(n->ps, n->tensor[HIDDEN_B]),
           HIDDEN * sizeof *hidden);
    memcpy(l, param_w(n->ps, n->tensor[SLOPE_B]), 3 * sizeof *l);
    for (size_t h = 0; h < HIDDEN; h++) {
        for (size_t i = 0; i < IN; i++)
            hidden[h] += w[h * IN + i] * cells[i];
        hidden[h] = fmaxf(hidden[h], 0);
        for (size_t k = 0; k < 3; k++)
            l[k] += v[k * HIDDEN + h] * hidden[h];
    }
}

/* Gradients of the tensors from dl, given what the layers saw and made. */
static void light_net_layers_backward(const float dl[3],
                                      const float hidden[HIDDEN],
                                      const float cells[IN],
                                      const struct light_net *n)
{
    const float *v = param_w(n->ps, n->tensor[SLOPE_W]);
    float *dw = param_g(n->ps, n->tensor[HIDDEN_W]);
    float *db = param_g(n->ps, n->tensor[HIDDEN_B]);
    float *dv = param_g(n->ps, n->tensor[SLOPE_W]);
    float *dc = param_g(n->ps, n->tensor[SLOPE_B]);

    for (size_t k = 0; k < 3; k++)
        dc[k] += dl[k];
    for (size_t h = 0; h < HIDDEN; h++) {
        float d = 0;

        if (!(hidden[h] > 0))
            continue;
        for (size_t k = 0; k < 3; k++) {
            dv[k * HIDDEN + h] += dl[k] * hidden[h];
            d += dl[k] * v[k * HIDDEN + h];
        }
        db[h] += d;
        for (size_t i = 0; i < IN; i++)
            dw[h * IN + i] += d * cells[i];
    }
}

/* Both passes of a crop. */
struct light_passes {
    float cells[2][IN], hidden[2][HIDDEN];
};

static void light_net_passes(float l[3], struct light_passes *p,
                             const float *rgb, const struct light_net *n)
{
    float each[2][3];

    light_net_look(p->cells[0], rgb);
    light_net_mirror(p->cells[1], p->cells[0]);
    for (int m = 0; m < 2; m++)
        light_net_layers(each[m], p->hidden[m], p->cells[m], n);
    for (int k = 0; k < 3; k++)
        l[k] = 0.5f * (each[0][k] + (k == 0 ? -1 : 1) * each[1][k]);
}

void light_net_forward(float l[3], const float *rgb,
                       const struct light_net *n)
{
    struct light_passes p;
    float length;

    memset(l, 0, 3 * sizeof *l);
    if (!n->ps)
        return;
    light_net_passes(l, &p, rgb, n);
    length = sqrtf(l[0] * l[0] + l[1] * l[1] + l[2] * l[2]);
    for (int k = 0; k < 3; k++)
        l[k] /= fmaxf(length, 1);
}

double light_net_loss(const float truth[3], const float *rgb, double scale,
                      const struct light_net *n)
{
    struct light_passes p;
    float l[3], d[2][3];
    double sum = 0;

    light_net_passes(l, &p, rgb, n);
    for (int k = 0; k < 3; k++) {
        const double e = (double)l[k] - (double)truth[k];

        sum += scale * e * e;
        d[0][k] = (float)(scale * e);
        d[1][k] = k == 0 ? -d[0][k] : d[0][k];
    }
    for (int m = 0; m < 2; m++)
        light_net_layers_backward(d[m], p.hidden[m], p.cells[m], n);
    return sum;
}
