/* gamma(n): sines and cosines of a direction at four frequencies. */
#include "lib/net/harmonic.h"

#include <math.h>

void harmonic_forward(float *enc, const float *dir, size_t B)
{
    for (size_t b = 0; b < B; b++) {
        float *e = enc + b * HARMONIC_OUT;

        for (int d = 0; d < 3; d++) {
            double v = (double)dir[3 * b + (size_t)d];

            for (int k = 0; k < 4; k++) {
                e[4 * d + k] = (float)sin(ldexp(v, k));
                e[12 + 4 * d + k] = (float)cos(ldexp(v, k));
            }
            e[24 + d] = (float)v;
        }
    }
}

void harmonic_backward(float *ddir, const float *denc, const float *dir,
                       size_t B)
{
    for (size_t b = 0; b < B; b++) {
        const float *g = denc + b * HARMONIC_OUT;

        for (int d = 0; d < 3; d++) {
            double v = (double)dir[3 * b + (size_t)d];
            double sum = (double)g[24 + d];

            for (int k = 0; k < 4; k++)
                sum += ldexp((double)g[4 * d + k] * cos(ldexp(v, k)) -
                             (double)g[12 + 4 * d + k] * sin(ldexp(v, k)), k);
            ddir[3 * b + (size_t)d] += (float)sum;
        }
    }
}

/* ---- as a graph ---------------------------------------------------------- */

int harmonic_graph(struct graph *g, int dir)
{
    const float frequency[4] = {1, 2, 4, 8};
    int x = GRAPH_NODE(g, "Reshape", dir, GRAPH_INTS(g, 1, 3, 1));

    x = GRAPH_NODE(g, "Mul", x, graph_floats(g, frequency, 4));
    x = GRAPH_NODE(g, "Reshape", x, GRAPH_INTS(g, 1, 12));
    x = graph_concat(g, GRAPH_NODE(g, "Sin", x), GRAPH_NODE(g, "Cos", x));
    return graph_concat(g, x, dir);
}
