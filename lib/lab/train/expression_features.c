/* The seven lengths as tables of distances and heights, and their gradients. */
#include "lib/lab/train/expression_features.h"

#include <math.h>
#include <stddef.h>

/* A feature is a mean: of distances between two landmarks, or of heights y
 * that count with a sign. */
struct pair { int feature, a, b; float share; };
struct height { int feature, landmark; float share; };

static const struct pair pair[] = {
    {EXPRESSION_MOUTH_OPEN, 62, 66, 1},
    {EXPRESSION_MOUTH_WIDTH, 48, 54, 1},
    {EXPRESSION_EYE_RIGHT, 37, 41, 0.5f}, {EXPRESSION_EYE_RIGHT, 38, 40, 0.5f},
    {EXPRESSION_EYE_LEFT, 43, 47, 0.5f}, {EXPRESSION_EYE_LEFT, 44, 46, 0.5f}
};
static const struct height height[] = {
    {EXPRESSION_SMILE, 48, 0.5f}, {EXPRESSION_SMILE, 54, 0.5f},
    {EXPRESSION_SMILE, 51, -0.5f}, {EXPRESSION_SMILE, 57, -0.5f},
    {EXPRESSION_BROW_RIGHT, 17, 0.2f}, {EXPRESSION_BROW_RIGHT, 18, 0.2f},
    {EXPRESSION_BROW_RIGHT, 19, 0.2f}, {EXPRESSION_BROW_RIGHT, 20, 0.2f},
    {EXPRESSION_BROW_RIGHT, 21, 0.2f},
    {EXPRESSION_BROW_RIGHT, 36, -0.5f}, {EXPRESSION_BROW_RIGHT, 39, -0.5f},
    {EXPRESSION_BROW_LEFT, 22, 0.2f}, {EXPRESSION_BROW_LEFT, 23, 0.2f},
    {EXPRESSION_BROW_LEFT, 24, 0.2f}, {EXPRESSION_BROW_LEFT, 25, 0.2f},
    {EXPRESSION_BROW_LEFT, 26, 0.2f},
    {EXPRESSION_BROW_LEFT, 42, -0.5f}, {EXPRESSION_BROW_LEFT, 45, -0.5f}
};
#define PAIRS (sizeof pair / sizeof *pair)
#define HEIGHTS (sizeof height / sizeof *height)

#define LENGTH_MIN 1e-4f        /* head units: closed lips have a direction */

/* d = x_a - x_b; its length, rounded off where the points meet. */
static float expression_distance(float d[3], const float *x,
                                 const struct pair *p)
{
    float sum = LENGTH_MIN * LENGTH_MIN;

    for (int i = 0; i < 3; i++) {
        d[i] = x[3 * p->a + i] - x[3 * p->b + i];
        sum += d[i] * d[i];
    }
    return sqrtf(sum);
}

void expression_features(float f[EXPRESSION_FEATURES], const float *x)
{
    float d[3];

    for (int k = 0; k < EXPRESSION_FEATURES; k++)
        f[k] = 0;
    for (size_t i = 0; i < PAIRS; i++)
        f[pair[i].feature] += pair[i].share *
                              expression_distance(d, x, &pair[i]);
    for (size_t i = 0; i < HEIGHTS; i++)
        f[height[i].feature] += height[i].share *
                                x[3 * height[i].landmark + 1];
}

void expression_features_backward(float *dx, const float *df, const float *x)
{
    float d[3];

    for (size_t i = 0; i < PAIRS; i++) {
        const struct pair *p = &pair[i];
        float length = expression_distance(d, x, p);
        float g = p->share * df[p->feature] / length;

        for (int k = 0; k < 3; k++) {
            dx[3 * p->a + k] += g * d[k];
            dx[3 * p->b + k] -= g * d[k];
        }
    }
    for (size_t i = 0; i < HEIGHTS; i++)
        dx[3 * height[i].landmark + 1] += height[i].share *
                                          df[height[i].feature];
}
