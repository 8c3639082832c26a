/* What an expression shows: its gradient against central differences, and
 * lengths that are known. */
#include <math.h>

#include "lib/base/random.h"
#include "lib/lab/train/expression_features.h"
#include "tests/check.h"

enum { N = EXPRESSION_FEATURES, POINTS = 3 * 68 };

static void check_lengths(void)
{
    float x[POINTS] = {0}, f[N];

    x[3 * 54] = 0.25f;          /* a corner of the mouth, to the side */
    x[3 * 62 + 1] = 0.125f;     /* the upper lip, up */
    for (int i = 22; i <= 26; i++)
        x[3 * i + 1] = 0.5f;    /* the left brow, up */
    expression_features(f, x);
    expect("mouth's width", (double)f[EXPRESSION_MOUTH_WIDTH], 0.25, 1e-6);
    expect("mouth's opening", (double)f[EXPRESSION_MOUTH_OPEN], 0.125, 1e-6);
    expect("left brow", (double)f[EXPRESSION_BROW_LEFT], 0.5, 1e-6);
    expect("right brow", (double)f[EXPRESSION_BROW_RIGHT], 0, 1e-6);
    expect("closed lids", (double)f[EXPRESSION_EYE_LEFT], 0, 2e-4);
}

static void check_gradient(void)
{
    float x[POINTS], y[POINTS], dx[POINTS] = {0}, df[N], f[2][N];
    struct random r;
    double worst = 0;

    random_init(&r, 5, "features");
    for (int i = 0; i < POINTS; i++)
        x[i] = (float)random_normal(&r);
    for (int k = 0; k < N; k++)
        df[k] = (float)random_normal(&r);
    expression_features_backward(dx, df, x);
    for (int i = 0; i < POINTS; i++) {
        const float step = 1e-2f;
        double want = 0;

        for (int s = 0; s < 2; s++) {
            for (int j = 0; j < POINTS; j++)
                y[j] = x[j] + (j == i ? (s ? step : -step) : 0);
            expression_features(f[s], y);
        }
        for (int k = 0; k < N; k++)
            want += (double)df[k] * (double)(f[1][k] - f[0][k]) /
                    (2 * (double)step);
        worst = fmax(worst, fabs(want - (double)dx[i]));
    }
    expect("gradient against differences", worst, 0, 1e-3);
}

int main(void)
{
    check_lengths();
    check_gradient();
    return check_status();
}
