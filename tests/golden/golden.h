/* The golden runner's shared part: files, the weight formula, comparisons.
 * A case file tests/golden/golden_NAME.c ends with
 *     GOLDEN_CASE("07_splat", run_splat)
 * and is found by the build. */
#ifndef SPID_TESTS_GOLDEN_H
#define SPID_TESTS_GOLDEN_H

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/safetensors.h"
#include "lib/nn/params.h"

struct golden {
    const char *path;        /* of the case file */
    const char *name;        /* "01_mobilenet/v0", for the printed lines */
    struct safetensors *st;
    uint64_t seed;
    int checked, failed;
    bool kinks;              /* units of the network may flip sign in float32:
                              * grad.params.stats get a tolerance of 1e-2 */
};

typedef void (*golden_run)(struct golden *g);
/* run checks the cases of that name. */
void golden_register(const char *case_name, golden_run run);

#define GOLDEN_CASE(case_name, run)                                   \
    __attribute__((constructor)) static void golden_enrol_##run(void) \
    {                                                                 \
        golden_register(case_name, run);                              \
    }

/* ---- the formula (tests/golden/data/README.md) --------------- */

double golden_u(const char *name, uint64_t seed, uint64_t i);   /* [0,1) */
float golden_v(const char *name, uint64_t seed, uint64_t i, double offset,
               double bound);
double golden_probe(uint64_t seed, uint64_t i);                 /* [-1,1) */
/* Fresh arrays (the caller frees); the process ends when memory does. */
float *golden_array(const char *name, uint64_t seed, size_t n, double offset,
                    double bound);
/* golden_array of the name "probe", offset 0 and bound 1. */
float *golden_probe_array(uint64_t seed, size_t n);
/* img and img11: planes of h x w, all leading dimensions folded into planes. */
float *golden_image(const char *name, uint64_t seed, size_t planes, size_t h,
                    size_t w, bool signed_range);

/* ---- what the case file says ------------------------------------------- */

/* Metadata as text, number or JSON; a missing key ends the run with a message,
 * golden_json returns NULL instead.  The caller deletes the cJSON. */
const char *golden_meta(const struct golden *g, const char *key);
/* The same as a number, ... */
double golden_number(const struct golden *g, const char *key);
/* ... and as JSON, or NULL. */
cJSON *golden_json(const struct golden *g, const char *key);

/* in <- metadata "input_shape" (N,C,H,W) as this toolkit orders it: N, H, W,
 * C. */
void golden_input_shape(size_t in[4], const struct golden *g);

/* The case could not run: print the error, count a failure. */
void golden_fail(struct golden *g, const struct error *err);

bool golden_has(const struct golden *g, const char *name);  /* stored input */
/* A stored tensor as doubles or floats (the caller frees); count may be
 * NULL. */
double *golden_f64(const struct golden *g, const char *name, size_t *count);
/* The same as floats. */
float *golden_f32(const struct golden *g, const char *name, size_t *count);

/* ---- weights of a network: <network>.shapes.json beside the case ------- */

struct golden_weight {
    const char *name;
    int ndim;
    size_t dim[5], n;
    double offset, bound;
    bool used;
};

struct golden_weights {
    cJSON *json;
    size_t count;
    struct golden_weight *t;
};

/* Read <network>.shapes.json; checks weights.sum of the case against the
 * formula (a line is printed).  network NULL: metadata "network". */
void golden_weights_open(struct golden_weights *w, struct golden *g,
                         const char *network);
/* Free what it holds. */
void golden_weights_close(struct golden_weights *w);
/* Fill every tensor of ps whose name is prefix + NAME from NAME's formula, or
 * from weight.NAME where the case stores it; a
 * tensor of ps that the list lacks, or another size, counts as a failure. */
void golden_weights_fill(struct params *ps, const struct golden_weights *w,
                         struct golden *g, const char *prefix);
/* Compare the gradients in ps with grad.params.stats of the case. */
void golden_weights_gradients(struct golden *g, const struct params *ps,
                              const struct golden_weights *w,
                              const char *prefix);

/* ---- comparing: one printed line each ---------------------------------- */

/* Full output x of n values against NAME (full, or its stored sample):
 * max |x - truth| <= atol, and the four statistics. */
void golden_compare(struct golden *g, const char *name, const float *x,
                    size_t n);
/* As golden_compare for double-precision code: rel * max |truth|. */
void golden_compare_f64(struct golden *g, const char *name, const double *x,
                        size_t n, double rel);
/* Relative L2 over the stored values <= rtol_l2 of the file (kinked
 * gradients). */
void golden_compare_l2(struct golden *g, const char *name, const float *x,
                       size_t n);
/* As golden_compare without the pixels where skip[i] is set (may be NULL), for
 * planes of the given size: element i belongs to pixel i % pixels. */
void golden_compare_masked(struct golden *g, const char *name, const float *x,
                           size_t n, const uint8_t *skip, size_t pixels);
/* Anything else: prints the line from the error and the tolerance. */
void golden_check(struct golden *g, const char *name, double max_abs,
                  double relative, double tolerance);

#endif
