/* The light network, forward and backward: once for the crop's cells, once for
 * their mirror image. */
#include "lib/net/light_net.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec3.h"
#include "lib/nn/act.h"

#define N LIGHT_NET_CELLS
#define IN ((size_t)N * N)
#define HIDDEN LIGHT_NET_HIDDEN

void light_net_init(struct light_net *n, struct params *ps)
{
    dense_init(&n->hidden, ps, "light.hidden", IN, HIDDEN, 1);
    dense_init(&n->slope, ps, "light.slope", HIDDEN, 3, 0.1f);
}

/* cells (N,N): logs of their means, less the mean of the middle third's. */
static void light_net_cells(float cells[IN], const float *rgb)
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
        cells[i] = logf(fmaxf(sum / (float)(3 * step * step), SRGB_DARK));
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
    dense_forward(hidden, cells, &n->hidden);
    act_forward(hidden, hidden, ACT_RELU, HIDDEN);
    dense_forward(l, hidden, &n->slope);
}

/* Gradients of the tensors from dl, given what the layers saw and made. */
static void light_net_layers_backward(const float dl[3],
                                      const float hidden[HIDDEN],
                                      const float cells[IN],
                                      const struct light_net *n)
{
    float d[HIDDEN] = {0}, unused[IN] = {0};

    dense_backward(d, dl, hidden, &n->slope);
    act_backward_out(d, d, hidden, ACT_RELU, HIDDEN);
    dense_backward(unused, d, cells, &n->hidden);
}

/* Both passes of a crop. */
struct light_passes {
    float cells[2][IN], hidden[2][HIDDEN];
};

static void light_net_passes(float l[3], struct light_passes *p,
                             const float *rgb, const struct light_net *n)
{
    float each[2][3];

    light_net_cells(p->cells[0], rgb);
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
    if (!n->hidden.ps)
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
