/* Directions of a head with what is zero left out, as head files hold them:
 * runs of consecutive vertices. */
#ifndef SPID_HEAD_RUNS_H
#define SPID_HEAD_RUNS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/base/half.h"

/* run[i] = direction, first vertex, how many; their values follow one another
 * in value (rows,3), half floats. */
struct runs {
    int32_t *run;               /* (n,3) */
    size_t n;
    uint16_t *value;            /* (rows,3) */
    size_t rows;
};

/* Of dirs (V,3,K): what moves less than `least` is left out. */
int runs_pack(struct runs *r, const float *dirs, size_t V, size_t K,
              double least, struct error *err);
/* Free what it holds; zeroed then. */
void runs_release(struct runs *r);

/* dirs (V,3,K), freshly allocated (the caller frees), from run (n,3) and value
 * (rows,3).  NULL and *err naming the run that leaves V or K or the values. */
float *runs_unpack(const int32_t *run, size_t n, const float *value,
                   size_t rows, size_t V, size_t K, struct error *err);

#endif
