/* Curves of time and memory over one size, for the stage growth. */
#ifndef SPID_LAB_BENCH_BENCH_GROWTH_H
#define SPID_LAB_BENCH_BENCH_GROWTH_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/lab/bench/bench.h"

#define GROWTH_POINTS 12

struct growth {
    struct bench *b;
    const char *of;             /* "Gaussians": what is counted */
    const char *how;            /* "512x512, 3 channels": what stays */
    size_t n;
    double x[GROWTH_POINTS], ms[GROWTH_POINTS], mb[GROWTH_POINTS];
};

/* Whether a point at x would take less than the stage's seconds, were time to
 * grow as x does from the last point on; and there is room for it. */
bool growth_goes_on(const struct growth *g, double x);

/* A point and its row; mb: the most memory held, MB, NaN where it was not
 * looked at. */
int growth_add(struct growth *g, double x, const struct bench_times *t,
               double mb, int threads, struct error *err);

/* The notes of a curve: the exponent, that of every stretch, where half of the
 * time does not depend on x, and the memory. */
void growth_note(struct growth *g);

/* The curves that are of whole programs, in processor time: frames and people
 * (where there is a model), bytes of a stream. */
int growth_of_programs(struct bench *b, struct error *err);

#endif
