/* The choice between Winograd and direct convolution by the nearest layer that
 * was measured. */
#include "lib/nn/tune.h"

#include <math.h>

/* Time of Winograd over time of the direct convolution, per layer: in float,
 * and in bfloat16. */
static const struct {
    unsigned short in, out, side;
    float ratio, ratio_bf16;
} table[] = {
#include "lib/nn/tune_table.inc"
};

/* Distance of two layers: how many doublings apart. */
static double tune_distance(double a, double b)
{
    return fabs(log2(a / b));
}

bool tune_winograd(size_t in, size_t out, size_t h, size_t w, bool bf16)
{
    double best = INFINITY;
    bool wanted = false;

    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        double d = tune_distance((double)in, table[i].in) +
                   tune_distance((double)out, table[i].out) +
                   tune_distance(sqrt((double)h * (double)w), table[i].side);

        if (d < best) {
            best = d;
            wanted = (bf16 ? table[i].ratio_bf16 : table[i].ratio) < 1.0f;
        }
    }
    return wanted;
}
