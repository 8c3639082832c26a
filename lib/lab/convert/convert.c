/* What a kind needs, looked for in the file and written under our names. */
#include "lib/lab/convert/convert.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"
#include "lib/lab/convert/table.h"
#include "lib/nn/params.h"

const char *const convert_kinds[] = {
    "flame", "dinov2", "smirk", "gagavatar", "lam", "lpips", "arcface",
    "musiq", "topiq", "squeezenet", "fan", "model", NULL};

static convert_kind *const kind_run[] = {
    convert_flame, convert_dinov2, convert_smirk, convert_gagavatar,
    convert_lam, convert_lpips, convert_arcface, convert_musiq,
    convert_topiq, convert_squeezenet, convert_fan, convert_model};

/* ---- notes and metadata ------------------------------------------------- */

void convert_note(struct convert *c, enum convert_problem what,
                  const char *format, ...)
{
    struct convert_note *note = list_add(&c->problem, &c->problems,
                                         &c->problem_room, sizeof *note, NULL);
    char text[2 * TENSORFILE_NAME + 400];
    va_list args;

    if (what == CONVERT_MISSING || what == CONVERT_SHAPE)
        c->wrong++;
    if (!note)
        return;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    note->what = what;
    note->text = arena_text(&c->memory, text);
    c->problems -= !note->text;
}

/* "[3, any, 4]": a dimension of 0 is "any". */
static const char *convert_shape(char out[200], int ndim, const size_t *dims)
{
    size_t n = (size_t)snprintf(out, 200, "[");

    for (int i = 0; i < ndim && n < 160; i++)
        n += dims[i] ? (size_t)snprintf(out + n, 200 - n, "%s%zu",
                                        i ? ", " : "", dims[i])
                     : (size_t)snprintf(out + n, 200 - n, "%sany",
                                        i ? ", " : "");
    snprintf(out + n, 200 - n, "]");
    return out;
}

/* Note that the tensor `from` with these dimensions is missing. */
static void convert_missing(struct convert *c, const char *from, int ndim,
                            const size_t *dims)
{
    char want[200];

    convert_note(c, CONVERT_MISSING, "%s (expected %s)", from,
                 convert_shape(want, ndim, dims));
}

void convert_set_meta(struct convert *c, const char *key, const char *value)
{
    if (c->nmeta + 2 > 2 * CONVERT_META)
        return;
    c->meta[c->nmeta++] = arena_text(&c->memory, key);
    c->meta[c->nmeta++] = arena_text(&c->memory, value);
}

/* ---- looking up --------------------------------------------------------- */

int convert_open(struct convert *c, const char *path, struct error *err)
{
    for (int i = 1; i < CONVERT_FILES; i++) {
        if (c->file[i])
            continue;
        c->file[i] = tensorfile_open(path, err);
        if (!c->file[i])
            return -1;
        c->used[i] = arena_take(&c->memory, tensorfile_count(c->file[i]), 1);
        return arena_check(&c->memory, path, err) ? -1 : i;
    }
    return error_set(err, EX_USAGE, "%s: too many files", path);
}

void convert_prefix(char out[TENSORFILE_NAME], const struct convert *c,
                    int file, const char *key)
{
    const struct tensorfile *f = c->file[file];
    size_t n = strlen(key), best = SIZE_MAX;

    out[0] = 0;
    for (size_t i = 0; i < tensorfile_count(f); i++) {
        const char *name = tensorfile_at(f, i)->name;
        size_t k = strlen(name);

        if (k < n || strcmp(name + k - n, key) || k - n >= best ||
            (k > n && name[k - n - 1] != '.'))
            continue;
        best = k - n;
        snprintf(out, TENSORFILE_NAME, "%.*s", (int)best, name);
    }
}

size_t convert_find(struct convert *c, int file, const char *prefix,
                    const char *from, int ndim, const size_t *dims,
                    bool optional)
{
    char name[2 * TENSORFILE_NAME], want[200], have[200];
    const struct tensorfile_tensor *t;
    size_t i;
    bool same;

    snprintf(name, sizeof name, "%s%s", prefix, from);
    i = tensorfile_find(c->file[file], name);
    if (i == SIZE_MAX) {
        if (!optional)
            convert_missing(c, name, ndim, dims);
        return SIZE_MAX;
    }
    t = tensorfile_at(c->file[file], i);
    c->used[file][i] = true;
    same = t->ndim == ndim;
    for (int k = 0; same && k < ndim; k++)
        same = !dims[k] || dims[k] == t->dim[k];
    if (same)
        return i;
    convert_note(c, CONVERT_SHAPE, "%s %s (expected %s)", name,
                 convert_shape(have, t->ndim, t->dim),
                 convert_shape(want, ndim, dims));
    return SIZE_MAX;
}

/* ---- adding ------------------------------------------------------------- */

/* One more output tensor without data; NULL and *err. */
static struct convert_tensor *convert_add_tensor(struct convert *c,
                                                 const char *name,
                                                 enum st_dtype dtype, int ndim,
                                                 const size_t *dims,
                                                 struct error *err)
{
    struct convert_tensor *t = list_add(&c->tensor, &c->count, &c->room,
                                        sizeof *t, err);

    if (!t)
        return NULL;
    *t = (struct convert_tensor){.name = arena_text(&c->memory, name),
                                 .dtype = dtype, .ndim = ndim, .count = 1};
    for (int i = 0; i < ndim; i++)
        t->count *= t->dim[i] = dims[i];
    return arena_check(&c->memory, name, err) ? NULL : t;
}

void *convert_add(struct convert *c, const char *name, enum st_dtype dtype,
                  int ndim, const size_t *dims, struct error *err)
{
    struct convert_tensor *t = convert_add_tensor(c, name, dtype, ndim, dims,
                                                  err);

    if (!t)
        return NULL;
    t->data = arena_take(&c->memory, t->count, st_dtype_size(dtype));
    return arena_check(&c->memory, name, err) ? NULL : t->data;
}

int convert_take(struct convert *c, int file, const char *prefix,
                 const char *from, const char *to, int ndim,
                 const size_t *dims, struct error *err)
{
    size_t i = convert_find(c, file, prefix, from, ndim, dims, false);
    const struct tensorfile_tensor *in;
    struct convert_tensor *t;

    if (i == SIZE_MAX)
        return 0;
    in = tensorfile_at(c->file[file], i);
    t = convert_add_tensor(c, to, in->dtype == ST_F64 ? ST_F32 : in->dtype,
                           in->ndim, in->dim, err);
    if (!t)
        return -1;
    t->file = file;
    t->index = i;
    return 0;
}

int convert_take_params(struct convert *c, int file, const char *prefix,
                        const struct params *ps, const char *from,
                        const char *to, struct error *err)
{
    char name[256];
    size_t n = strlen(to);

    for (size_t i = 0; i < ps->count; i++) {
        const struct param *p = &ps->tensor[i];

        if (strncmp(p->name, to, n))
            continue;
        snprintf(name, sizeof name, "%s%s", from, p->name + n);
        if (convert_take(c, file, prefix, name, p->name, p->ndim, p->dim,
                         err))
            return -1;
    }
    return 0;
}

double *convert_numbers(struct convert *c, int file, size_t index,
                        struct arena *room, struct error *err)
{
    const struct tensorfile_tensor *t = tensorfile_at(c->file[file], index);
    const void *data = tensorfile_data(c->file[file], index, err);
    double *out = arena_take(room, t->count, sizeof *out);

    if (!data || arena_check(room, t->name, err))
        return NULL;
    for (size_t i = 0; i < t->count; i++)
        out[i] = array_view_number(t->dtype, data, i);
    return out;
}

/* ---- the whole ---------------------------------------------------------- */

/* An empty result, which says what it is made from. */
static int convert_begin(struct convert *c, struct tensorfile *f,
                         struct error *err)
{
    memset(c, 0, sizeof *c);
    c->file[0] = f;
    c->used[0] = arena_take(&c->memory, tensorfile_count(f), 1);
    convert_set_meta(c, "producer", "spid-import " SPID_VERSION);
    convert_set_meta(c, "source_format", tensorfile_format(f));
    convert_set_meta(c, "source_xxh128", tensorfile_hash(f));
    return arena_check(&c->memory, tensorfile_path(f), err);
}

int convert_all(struct convert *c, struct tensorfile *f, struct error *err)
{
    if (convert_begin(c, f, err))
        return -1;
    for (size_t i = 0; i < tensorfile_count(f); i++) {
        const struct tensorfile_tensor *in = tensorfile_at(f, i);
        struct convert_tensor *t = convert_add_tensor(c, in->name, in->dtype,
                                                      in->ndim, in->dim, err);
        if (!t)
            return -1;
        t->index = i;
    }
    return 0;
}

/* What no kind asks for: counts of batches and other buffers of training. */
static bool convert_is_idle(const char *name)
{
    const char *dot = strrchr(name, '.');

    return !strcmp(dot ? dot + 1 : name, "num_batches_tracked");
}

/* Tensors of the input that nothing took, but for those that never matter. */
static void convert_note_left(struct convert *c)
{
    char shape[200];

    for (int k = 0; k < CONVERT_FILES && c->file[k]; k++)
        for (size_t i = 0; i < tensorfile_count(c->file[k]); i++) {
            const struct tensorfile_tensor *t = tensorfile_at(c->file[k], i);

            if (!c->used[k][i] && !convert_is_idle(t->name))
                convert_note(c, CONVERT_LEFT, "%s %s", t->name,
                             convert_shape(shape, t->ndim, t->dim));
        }
}

int convert_as(struct convert *c, struct tensorfile *f, const char *kind,
               const struct convert_options *o, struct error *err)
{
    size_t k = 0;

    if (convert_begin(c, f, err))
        return -1;
    while (convert_kinds[k] && strcmp(kind, convert_kinds[k]))
        k++;
    if (!convert_kinds[k])
        return error_set(err, EX_USAGE, "unknown kind '%s'", kind);
    convert_set_meta(c, "kind", kind);
    c->with = o;
    if (kind_run[k](c, err))
        return -1;
    for (int i = 1; i < CONVERT_FILES && c->file[i]; i++) {
        char key[40];

        snprintf(key, sizeof key, "source_%d_xxh128", i + 1);
        convert_set_meta(c, key, tensorfile_hash(c->file[i]));
    }
    convert_note_left(c);
    return 0;
}

/* Elements of a tensor that lies in a file; float64 as float32 where the
 * output is. */
static const void *convert_fetch(void *context, size_t i, struct error *err)
{
    struct convert *c = context;
    const struct convert_tensor *t = &c->tensor[i];
    struct tensorfile *f = c->file[t->file];
    const void *data = tensorfile_data(f, t->index, err);
    enum st_dtype from = tensorfile_at(f, t->index)->dtype;
    float *out;

    if (!data || from == t->dtype)
        return data;
    free(c->scratch);
    c->scratch = out = malloc(t->count * sizeof *out);
    if (!out)
        return error_null(err, EX_OSERR, "out of memory");
    for (size_t k = 0; k < t->count; k++)
        out[k] = (float)array_view_number(from, data, k);
    return out;
}

int convert_save(struct convert *c, const char *path, struct error *err)
{
    struct st_tensor *t = arena_take(&c->memory, c->count, sizeof *t);

    if (arena_check(&c->memory, path, err))
        return -1;
    for (size_t i = 0; i < c->count; i++) {
        const struct convert_tensor *from = &c->tensor[i];

        t[i] = (struct st_tensor){.name = from->name, .dtype = from->dtype,
                                  .ndim = from->ndim, .count = from->count,
                                  .data = from->data};
        memcpy(t[i].dim, from->dim, sizeof t[i].dim);
    }
    return st_save_from(path, t, c->count, (const char *const *)c->meta,
                        convert_fetch, c, err);
}

void convert_release(struct convert *c)
{
    for (int i = 1; i < CONVERT_FILES; i++)
        tensorfile_close(c->file[i]);
    arena_release(&c->memory);
    free(c->tensor);
    free(c->problem);
    free(c->scratch);
    *c = (struct convert){.count = 0};
}
