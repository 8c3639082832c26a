/* Named tensors in one block of floats: declared by the networks, started at
 * random, loaded from and saved to safetensors. */
#include "lib/nn/params.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"
#include "lib/base/random.h"

#define ALIGN 16 /* floats: one cache line */

void params_init(struct params *ps)
{
    memset(ps, 0, sizeof *ps);
}

void params_release(struct params *ps)
{
    free(ps->tensor);
    free(ps->w);
    free(ps->g);
    params_init(ps);
}

/* Growing the table may fail; the failure is kept (room = SIZE_MAX) and
 * reported by params_allocate, so that declarations need no checks. */
static bool params_grow(struct params *ps)
{
    if (ps->count < ps->room)
        return ps->room != SIZE_MAX;
    size_t room = ps->room ? 2 * ps->room : 64;
    struct param *t = realloc(ps->tensor, room * sizeof *t);
    if (t)
        ps->tensor = t;
    ps->room = t ? room : SIZE_MAX;
    return t != NULL;
}

size_t params_add(struct params *ps, const char *name, int ndim,
                  const size_t *dims, enum param_init init, float gain)
{
    if (ps->w)
        return params_find(ps, name);
    if (!params_grow(ps))
        return 0;
    struct param *t = &ps->tensor[ps->count];
    memset(t, 0, sizeof *t);
    snprintf(t->name, sizeof t->name, "%s", name);
    t->ndim = ndim;
    t->count = 1;
    for (int i = 0; i < ndim; i++) {
        t->dim[i] = dims[i];
        t->count *= dims[i];
    }
    t->offset = ps->total;
    t->init = init;
    t->gain = gain;
    ps->total += (t->count + ALIGN - 1) / ALIGN * ALIGN;
    return ps->count++;
}

size_t params_find(const struct params *ps, const char *name)
{
    for (size_t i = 0; i < ps->count; i++)
        if (!strcmp(ps->tensor[i].name, name))
            return i;
    return (size_t)-1;
}

/* A zeroed block of n floats in place of *out. */
static int params_block(float **out, size_t n, struct error *err)
{
    free(*out);
    *out = aligned_alloc(64, (n * sizeof **out + 64) / 64 * 64);
    if (!*out)
        return error_set(err, EX_OSERR, "out of memory for %zu weights", n);
    memset(*out, 0, n * sizeof **out);
    return 0;
}

int params_allocate(struct params *ps, struct error *err)
{
    if (ps->room == SIZE_MAX)
        return error_set(err, EX_OSERR, "out of memory for tensor names");
    return params_block(&ps->w, ps->total, err);
}

int params_allocate_gradients(struct params *ps, struct error *err)
{
    return params_block(&ps->g, ps->total, err);
}

/* A tensor's initial values, from its name and the seed alone. */
static void params_fill(float *w, const struct param *t, uint64_t seed)
{
    struct random r;
    double fan_in = t->ndim > 1 ? (double)t->count / (double)t->dim[0] : 1;
    double bound = t->gain * sqrt(3 / fmax(fan_in, 1));

    random_init(&r, seed, t->name);
    for (size_t i = 0; i < t->count; i++)
        switch (t->init) {
        case PARAM_ZERO: w[i] = 0; break;
        case PARAM_ONE: w[i] = 1; break;
        case PARAM_CONSTANT: w[i] = t->gain; break;
        case PARAM_HE: w[i] = (float)random_range(&r, -bound, bound); break;
        case PARAM_NORMAL: w[i] = t->gain * (float)random_normal(&r); break;
        }
}

void params_randomise(struct params *ps, uint64_t seed)
{
    for (size_t i = 0; i < ps->count; i++)
        params_fill(param_w(ps, i), &ps->tensor[i], seed);
}

int params_load(struct params *ps, const struct safetensors *st,
                const char *prefix, struct error *err)
{
    return params_load_from(ps, st, prefix, prefix, err);
}

int params_open(struct params *ps, const char *path, struct error *err)
{
    struct safetensors *st = st_open(path, err);
    int rc = st && !params_allocate(ps, err) && !params_load(ps, st, "", err)
                 ? 0 : -1;

    st_close(st);
    return rc;
}

/* The name in the file of a tensor, or false when it does not begin with
 * prefix. */
static bool params_renamed(char name[256], const struct param *t,
                           const char *prefix, const char *from)
{
    size_t n = strlen(prefix);

    if (strncmp(t->name, prefix, n))
        return false;
    snprintf(name, 256, "%s%s", from, t->name + n);
    return true;
}

int params_load_from(struct params *ps, const struct safetensors *st,
                     const char *prefix, const char *from, struct error *err)
{
    for (size_t i = 0; i < ps->count; i++) {
        const struct param *t = &ps->tensor[i];
        char name[256];

        if (params_renamed(name, t, prefix, from) &&
            st_read_f32(param_w(ps, i), st, name, t->ndim, t->dim, err))
            return -1;
    }
    return 0;
}

int params_save(const struct params *ps, const char *path,
                const char *const *meta, struct error *err)
{
    struct st_tensor *t = calloc(ps->count + 1, sizeof *t);
    int rc;

    if (!t)
        return error_set(err, EX_OSERR, "%s: out of memory", path);
    for (size_t i = 0; i < ps->count; i++) {
        const struct param *p = &ps->tensor[i];

        t[i] = (struct st_tensor){.name = p->name, .dtype = ST_F32,
                                  .ndim = p->ndim, .count = p->count,
                                  .data = param_w(ps, i)};
        memcpy(t[i].dim, p->dim, sizeof p->dim);
    }
    rc = st_save(path, t, ps->count, meta, err);
    free(t);
    return rc;
}
