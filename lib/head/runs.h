/* Directions of a head with what is zero left out, as head files hold them:
 * runs of consecutive vertices. */
#ifndef SPID_HEAD_RUNS_H
#define SPID_HEAD_RUNS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

/* run[i] = direction, first vertex, how many; their values follow one another
 * in value (rows,3), half floats. */
struct runs {
    int32_t *run;               /* (n,3) */
    size_t n;
    uint16_t *value;            /* (rows,3) */
    size_t rows;
};

/* Of dirs (V,3,K): what moves less than `min` is left out. */
int runs_pack(struct runs *r, const float *dirs, size_t V, size_t K,
              double min, struct error *err);
/* Free what it holds; zeroed then. */
void runs_release(struct runs *r);

/* Packed directions as they are read: run (n,3) of value (rows,3), half
 * floats that may lie at any address, for V vertices and K directions. */
struct runs_read {
    const int32_t *run;
    size_t n;
    const void *value;
    size_t rows, V, K;
};

/* -1 and *err naming the run that leaves V or K or the values. */
int runs_check(const struct runs_read *r, struct error *err);
/* dirs (to - from,3,K), zeros at first, of checked runs: vertices from to
 * to - 1. */
void runs_unpack_some(float *dirs, const struct runs_read *r, size_t from,
                      size_t to);
/* dirs (V,3,K), freshly allocated (the caller frees); NULL and *err when the
 * runs fail their check. */
float *runs_unpack(const struct runs_read *r, struct error *err);

#endif
