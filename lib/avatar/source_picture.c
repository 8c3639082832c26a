/* The source picture for Phase A: conversion, matte, and edge padding by
 * repeated means of the neighbours that have a colour already. */
#include "lib/avatar/source_picture.h"

#include <stdlib.h>
#include <string.h>

#include "lib/base/slices.h"
#include "lib/geom/resample.h"

#define PADDING 12      /* pixels that colours run on over the matte's edge */

int source_picture_init(struct source_picture *p, size_t size,
                        struct error *err)
{
    size_t n = size * size;
    const struct slice slices[] = {
        {&p->rgb, 3 * n, false}, {&p->rgba, 4 * n, false},
        {(float **)&p->padded, n / 4 + 1, false}
    };

    p->size = size;
    return slices_allocate(&p->block, slices, sizeof slices / sizeof *slices,
                           false, err);
}

void source_picture_release(struct source_picture *p)
{
    free(p->block);
    memset(p, 0, sizeof *p);
}

/* Whether pixel i and all within two pixels are the person's: lenses and
 * codecs smear colours over the edge. */
static uint8_t source_picture_inside(const float *rgba, size_t S, size_t i)
{
    for (int k = 0; k < 25; k++) {
        long y = (long)(i / S) + k / 5 - 2, x = (long)(i % S) + k % 5 - 2;

        if (y < 0 || x < 0 || y >= (long)S || x >= (long)S)
            continue;
        if (rgba[4 * ((size_t)y * S + (size_t)x) + 3] <= 0.95f)
            return 0;
    }
    return 1;
}

/* Whether a pixel of the three by three about i may be done: all of them for
 * pixels at the border. */
static bool source_picture_near(const uint8_t *done, size_t S, size_t i)
{
    const size_t y = i / S, x = i % S;

    if (y == 0 || x == 0 || y + 1 == S || x + 1 == S)
        return true;
    const uint8_t *up = done + i - S - 1, *on = up + S, *down = on + S;

    return up[0] | up[1] | up[2] | on[0] | on[2] | down[0] | down[1] |
           down[2];
}

/* One step of colours outwards over the matte's edge: a pixel that is not
 * wholly the person's takes the mean of its neighbours that are, or became so
 * in an earlier step.  done (S,S) is the step a pixel got its colour in. */
static void source_picture_pad(float *rgba, uint8_t *done, size_t S,
                               uint8_t step)
{
    for (size_t i = 0; i < S * S; i++) {
        float sum[3] = {0}, n = 0;

        if (done[i] || !source_picture_near(done, S, i))
            continue;
        for (int k = 0; k < 9; k++) {
            long y = (long)(i / S) + k / 3 - 1, x = (long)(i % S) + k % 3 - 1;

            if (y < 0 || x < 0 || y >= (long)S || x >= (long)S)
                continue;
            size_t j = (size_t)y * S + (size_t)x;
            if (!done[j] || done[j] > step)
                continue;
            for (size_t c = 0; c < 3; c++)
                sum[c] += rgba[4 * j + c];
            n++;
        }
        if (n == 0)
            continue;
        for (size_t c = 0; c < 3; c++)
            rgba[4 * i + c] = sum[c] / n;
        done[i] = (uint8_t)(step + 1);
    }
}

/* Bytes to floats, matte, then PADDING steps outwards. */
void source_picture_set(struct source_picture *p, const uint8_t *rgb,
                        const uint8_t *matte, bool pad)
{
    size_t S = p->size;

#pragma omp parallel for schedule(static)
    for (size_t i = 0; i < S * S; i++) {
        float m = matte ? (float)matte[i] / 255 : 1;

        for (size_t c = 0; c < 3; c++) {
            float x = (float)rgb[3 * i + c] / 255;

            p->rgba[4 * i + c] = x;
            p->rgb[3 * i + c] = m * x;
        }
        p->rgba[4 * i + 3] = m;
    }
#pragma omp parallel for schedule(static)
    for (size_t i = 0; i < S * S; i++)
        p->padded[i] = source_picture_inside(p->rgba, S, i);
    for (uint8_t step = 1; step <= PADDING && pad; step++)
        source_picture_pad(p->rgba, p->padded, S, step);
}

void source_picture_sample(float *out, const struct source_picture *p,
                           const float *place, size_t N)
{
    grid_sample(out, p->rgba, place, 1, p->size, p->size, 4, N, false,
                RESAMPLE_BORDER);
}

/* The picture is a constant: only its places have a gradient. */
void source_picture_sample_backward(float *dplace, const float *dout,
                                    const struct source_picture *p,
                                    const float *place, size_t N)
{
    grid_sample_backward(NULL, dplace, dout, p->rgba, place, 1, p->size,
                         p->size, 4, N, false, RESAMPLE_BORDER);
}
