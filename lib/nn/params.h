/* The weights of a model: named tensors in one flat block, and the gradients
 * in a second block of the same layout, so that Adam, averaging, checkpoints
 * and reductions over machines see one array. */
#ifndef SPID_NN_PARAMS_H
#define SPID_NN_PARAMS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/safetensors.h"
#include "lib/base/error.h"

#define NN_NONE ((size_t)-1)     /* no tensor */

enum param_init {
    PARAM_ZERO,        /* 0 */
    PARAM_ONE,         /* 1 */
    PARAM_HE,          /* uniform, variance gain^2 / fan_in */
    PARAM_NORMAL,      /* N(0, gain^2) */
    PARAM_CONSTANT     /* gain */
};

struct param {
    char name[120];
    int ndim;
    size_t dim[5];
    size_t count;
    size_t offset;     /* into params.w and params.g, in floats, 16-aligned */
    enum param_init init;
    float gain;
    bool frozen;       /* no update: running statistics, frozen encoders */
};

struct params {
    struct param *tensor;
    size_t count, room;
    size_t total;      /* floats in w (and in g) */
    float *w;          /* NULL until params_allocate */
    float *g;          /* NULL until params_allocate_gradients */
};

/* No tensors. */
void params_init(struct params *ps);
/* Free everything; ready for declarations again. */
void params_release(struct params *ps);

/* Declare a tensor (before params_allocate); returns its index.  Names are
 * the checkpoint's, e.g. "motion.blocks.1.0.conv_pw.weight".  After it, the one
 * of that name, which must be there: a second network on the same weights. */
size_t params_add(struct params *ps, const char *name, int ndim,
                  const size_t *dims, enum param_init init, float gain);
/* Index of the tensor of that name, or (size_t)-1. */
size_t params_find(const struct params *ps, const char *name);

/* Make w; zero-filled.  params_randomise then fills it from a seed, each
 * tensor by its own name, so that adding one leaves the others alone. */
int params_allocate(struct params *ps, struct error *err);
/* Zeroed gradients g, as large as w. */
int params_allocate_gradients(struct params *ps, struct error *err);
/* Fill w by each tensor's init, from the seed and its name alone. */
void params_randomise(struct params *ps, uint64_t seed);

static inline float *param_w(const struct params *ps, size_t i)
{
    return ps->w + ps->tensor[i].offset;
}
static inline float *param_g(const struct params *ps, size_t i)
{
    return ps->g + ps->tensor[i].offset;
}

/* Fill w from a file: every tensor must be there with its shape, finite, each
 * error names file, tensor, expected and found shape.  Tensors whose name does
 * not start with prefix ("" for all) are left alone. */
int params_load(struct params *ps, const struct safetensors *st,
                const char *prefix, struct error *err);
/* The same from tensors whose names begin with `from` where prefix stands. */
int params_load_from(struct params *ps, const struct safetensors *st,
                     const char *prefix, const char *from,
                     struct error *err);
/* Allocate what was declared and fill it from the safetensors file at path. */
int params_open(struct params *ps, const char *path, struct error *err);
/* Write w with metadata pairs. */
int params_save(const struct params *ps, const char *path,
                const char *const *meta, struct error *err);

#endif
