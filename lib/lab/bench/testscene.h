/* Gaussians to measure with: a file, or a seed with the statistics of a baked
 * head. */
#ifndef SPID_LAB_BENCH_TESTSCENE_H
#define SPID_LAB_BENCH_TESTSCENE_H

#include "lib/base/error.h"
#include "lib/base/gaussians.h"

#define TESTSCENE_N 108658

struct testscene {
    struct gaussians g;           /* 32 channels; arrays are owned */
    float cam[12];
};

/* n Gaussians: a head's ellipsoid, a plane with relief, a mouth sheet, in the
 * shares 20018 : 87616 : 1024; any other n thins or thickens all three, sizes
 * growing as 1/sqrt(n) so that the picture stays covered. */
int testscene_make(struct testscene *t, size_t n, uint64_t seed,
                   struct error *err);
/* A .safetensors file with mean, scale, quat, opacity, color (N,C), cam;
 * missing channels up to 32 are filled with uniform numbers in -0.5..0.5. */
int testscene_load(struct testscene *t, const char *path, struct error *err);
/* Free what it holds; zeroed then. */
void testscene_release(struct testscene *t);

/* Pairs of pixel and Gaussian with alpha >= 1/255 in a size x size picture. */
size_t testscene_pairs(const struct testscene *t, int size,
                       struct error *err);

#endif
