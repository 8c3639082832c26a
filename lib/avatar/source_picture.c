/* The source picture for Phase A: conversion, matte, and edge padding by
 * repeated means of the neighbours that have a colour already. */
#include "lib/avatar/source_picture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/base/slices.h"
#include "lib/base/resample.h"

#define PADDING 12      /* pixels that colours run on over the matte's edge */

int source_picture_init(struct source_picture *p, size_t size,
                        struct error *err)
{
    size_t n = size * size;
    const struct slice slices[] = {
        {&p->rgb, 3 * n, false}, {&p->rgba, 4 * n, false},
        {&p->padded, n / 4 + 1, false},
        {&p->across, n / 4 + 1, false},
        {&p->list, 2 * n, false}
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

/* One row. */
PARALLEL(source_picture_inside_part, y, const float *, rgba, uint8_t *, across,
         size_t, S)
{
    for (size_t x = 0; x < S; x++) {
        const size_t from = x < 2 ? 0 : x - 2;
        const size_t to = x + 2 < S ? x + 2 : S - 1;
        bool all = true;

        for (size_t i = from; i <= to; i++)
            all = all && rgba[4 * (y * S + i) + 3] > 0.95f;
        across[y * S + x] = all;
    }
}

/* One row. */
PARALLEL(source_picture_column_part, y, uint8_t *, inside, uint8_t *, across,
         size_t, S)
{
    const size_t from = y < 2 ? 0 : y - 2;
    const size_t to = y + 2 < S ? y + 2 : S - 1;

    memcpy(inside + y * S, across + from * S, S);
    for (size_t i = from + 1; i <= to; i++)
        for (size_t x = 0; x < S; x++)
            inside[y * S + x] &= across[i * S + x];
}

/* inside (S,S): whether a pixel and all within two pixels are the person's:
 * lenses and codecs smear colours over the edge.  across (S,S): the same along
 * rows. */
static void source_picture_inside(uint8_t *inside, uint8_t *across,
                                  const float *rgba, size_t S)
{
    parallel_each(source_picture_inside_part, S, 1, rgba, across, S);

    parallel_each(source_picture_column_part, S, 1, inside, across, S);
}

/* Pixels of done (S,S) that wait for their step. */
#define WAITING 255

/* Adds the neighbours of pixel i that have no colour yet to the list; returns
 * its new length. */
static size_t source_picture_wait(uint32_t *list, size_t length,
                                  uint8_t *done, size_t S, size_t i)
{
    const size_t y = i / S, x = i % S;

    for (size_t v = y ? y - 1 : 0; v <= y + 1 && v < S; v++)
        for (size_t u = x ? x - 1 : 0; u <= x + 1 && u < S; u++)
            if (!done[v * S + u]) {
                done[v * S + u] = WAITING;
                list[length++] = (uint32_t)(v * S + u);
            }
    return length;
}

/* A pixel takes the mean of its neighbours that are wholly the person's, or got
 * a colour in an earlier step. */
static void source_picture_pad_pixel(float *rgba, const uint8_t *done,
                                     size_t S, uint8_t step, size_t i)
{
    const size_t y = i / S, x = i % S;
    float sum[3] = {0}, n = 0;

    for (size_t v = y ? y - 1 : 0; v <= y + 1 && v < S; v++)
        for (size_t u = x ? x - 1 : 0; u <= x + 1 && u < S; u++) {
            const size_t j = v * S + u;

            if (!done[j] || done[j] > step)
                continue;
            for (size_t c = 0; c < 3; c++)
                sum[c] += rgba[4 * j + c];
            n++;
        }
    for (size_t c = 0; c < 3; c++)
        rgba[4 * i + c] = sum[c] / n;
}

/* Colours go outwards over the matte's edge, PADDING steps.  done (S,S): the
 * step a pixel got its colour in; list (2,S,S): whose turn it is, and who comes
 * next. */
static void source_picture_pad(float *rgba, uint8_t *done, uint32_t *list,
                               size_t S)
{
    uint32_t *now = list, *next = list + S * S;
    size_t n = 0;

    for (size_t i = 0; i < S * S; i++)
        if (done[i] == 1)
            n = source_picture_wait(now, n, done, S, i);
    for (uint8_t step = 1; step <= PADDING; step++) {
        uint32_t *swap = now;
        size_t more = 0;

        for (size_t k = 0; k < n; k++)
            source_picture_pad_pixel(rgba, done, S, step, now[k]);
        for (size_t k = 0; k < n; k++)
            done[now[k]] = (uint8_t)(step + 1);
        for (size_t k = 0; k < n; k++)
            more = source_picture_wait(next, more, done, S, now[k]);
        now = next;
        next = swap;
        n = more;
    }
}

PARALLEL(source_picture_set_part, i, const uint8_t *, matte,
         const uint8_t *, rgb, float *, value, struct source_picture *, p)
{
    float m = matte ? value[matte[i]] : 1;

    for (size_t c = 0; c < 3; c++) {
        float x = value[rgb[3 * i + c]];

        p->rgba[4 * i + c] = x;
        p->rgb[3 * i + c] = m * x;
    }
    p->rgba[4 * i + 3] = m;
}

/* Bytes to floats, matte, then colours outwards. */
void source_picture_set(struct source_picture *p, const uint8_t *rgb,
                        const uint8_t *matte, const uint8_t *certain, bool pad)
{
    size_t S = p->size;
    float value[256];

    for (int i = 0; i < 256; i++)
        value[i] = (float)i / 255;

    p->certain = certain;
    parallel_each(source_picture_set_part, S * S, 1, matte, rgb, value, p);
    if (!pad)
        return;
    source_picture_inside(p->padded, p->across, p->rgba, S);
    source_picture_pad(p->rgba, p->padded, p->list, S);
}

bool source_picture_contains(const struct source_picture *p, const float place[2])
{
    size_t at[2];

    for (size_t i = 0; i < 2; i++) {
        const float x = floorf((place[i] + 1) / 2 * (float)p->size);

        if (!(x >= 0 && x < (float)p->size))
            return !p->certain;
        at[i] = (size_t)x;
    }
    return !p->certain || p->certain[at[1] * p->size + at[0]] > 0;
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
