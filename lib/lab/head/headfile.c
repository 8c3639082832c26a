/* The list of tensors, those of the file and those in memory. */
#include "lib/lab/head/headfile.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/head/runs.h"

int headfile_open(struct headfile *f, const char *path, struct error *err)
{
    size_t n = 0;

    *f = (struct headfile){.st = st_open(path, err)};
    if (!f->st)
        return -1;
    if (st_count(f->st) > HEADFILE_TENSORS) {
        error_set(err, EX_DATAERR, "%s: %zu tensors (expected a head's, at most "
                  "%d)", path, st_count(f->st), HEADFILE_TENSORS);
        headfile_close(f);
        return -1;
    }
    for (; f->count < st_count(f->st); f->count++)
        f->tensor[f->count] = *st_at(f->st, f->count);
    for (size_t i = 0; i < HEADFILE_META &&
                       (f->meta[n] = st_meta_at(f->st, i, &f->meta[n + 1]));
         i++)
        n += 2;
    f->meta[n] = NULL;
    headfile_drop(f, "avatar.");
    return 0;
}

void headfile_close(struct headfile *f)
{
    arena_release(&f->memory);
    st_close(f->st);
    *f = (struct headfile){.st = NULL};
}

void headfile_drop(struct headfile *f, const char *prefix)
{
    size_t kept = 0;

    for (size_t i = 0; i < f->count; i++)
        if (strncmp(f->tensor[i].name, prefix, strlen(prefix)))
            f->tensor[kept++] = f->tensor[i];
    f->count = kept;
}

void headfile_put(struct headfile *f, const char *name, enum st_dtype type,
                  const void *data, size_t a, size_t b, size_t c)
{
    size_t i = 0;

    while (i < f->count && strcmp(f->tensor[i].name, name))
        i++;
    assert(i < HEADFILE_TENSORS);
    f->count += i == f->count;
    f->tensor[i] = (struct st_tensor){
        .name = name, .dtype = type, .data = data,
        .ndim = c ? 3 : b ? 2 : 1, .dim = {a, b, c},
        .count = a * (b ? b : 1) * (c ? c : 1)
    };
}

void *headfile_add(struct headfile *f, const char *name, enum st_dtype type,
                   size_t a, size_t b, size_t c, struct error *err)
{
    void *data = arena_take(&f->memory, a * (b ? b : 1) * (c ? c : 1),
                            st_dtype_size(type));

    if (arena_check(&f->memory, name, err))
        return NULL;
    headfile_put(f, name, type, data, a, b, c);
    return data;
}

float *headfile_directions(struct headfile *f, const char *name, size_t V,
                           size_t K, struct error *err)
{
    char runs[64], values[64];
    size_t dims[3] = {V, 3, K}, two[2] = {0, 3}, n, rows;
    float *out = NULL;

    snprintf(runs, sizeof runs, "%s_runs", name);
    snprintf(values, sizeof values, "%s_values", name);
    if (!st_find(f->st, runs))
        return arena_keep(&f->memory, st_load_f32(f->st, name, 3, dims, NULL,
                                                  err), err);
    int32_t *run = st_load_i32(f->st, runs, 2, two, &n, err);
    const void *value = run ? st_borrow_f16(f->st, values, 2, two, &rows, err)
                            : NULL;
    if (value)
        out = runs_unpack(&(struct runs_read){ run, n / 3, value, rows / 3,
                                               V, K }, err);
    free(run);
    return arena_keep(&f->memory, out, err);
}

int headfile_save(const struct headfile *f, const char *path,
                  struct error *err)
{
    return st_save(path, f->tensor, f->count, f->meta, err);
}
