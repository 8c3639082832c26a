/* What a file is by its first bytes, its tensors by name, and their
 * elements. */
#include "lib/lab/import/tensorfile.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sysexits.h>
#include <xxhash.h>

#include "formats/npy.h"
#include "lib/base/file.h"
#include "lib/base/list.h"
#include "lib/lab/import/tensorfile_impl.h"

/* ---- the table of tensors ----------------------------------------------- */

int tensorfile_add(struct tensorfile *f, const char *name,
                   const struct tensor_place *p, struct error *err)
{
    struct tensorfile_tensor t = {.dtype = p->view.dtype,
                                  .ndim = p->view.ndim,
                                  .count = p->view.count};
    struct tensor_row *row;
    size_t bytes = t.count * st_dtype_size(t.dtype);
    size_t max = f->source > SIZE_MAX / 2 / TENSORFILE_GROWTH
                      ? SIZE_MAX / 2 : f->source * TENSORFILE_GROWTH;

    if (!*name || !strcmp(name, "__metadata__"))
        return error_set(err, EX_DATAERR, "a tensor is named '%s'", name);
    if (f->count == TENSORFILE_MAX)
        return error_set(err, EX_DATAERR, "tensor '%s': more than %d tensors",
                         name, TENSORFILE_MAX);
    if (bytes > max + TENSORFILE_SMALL - f->total)
        return error_set(err, EX_DATAERR, "tensor '%s': all tensors together "
                         "take more than %d times the file", name,
                         TENSORFILE_GROWTH);
    memcpy(t.dim, p->view.dim, sizeof t.dim);
    t.name = arena_text(&f->memory, name);
    if (!t.name)
        return arena_check(&f->memory, "a name", err);
    row = list_add(&f->row, &f->count, &f->room, sizeof *row, err);
    if (!row)
        return -1;
    f->total += bytes;
    *row = (struct tensor_row){t, *p};
    return 0;
}

void tensorfile_add_other(struct tensorfile *f, enum tensorfile_sort sort,
                          const char *name, const char *kind)
{
    size_t i = f->other[sort].n++;

    if (i < TENSORFILE_NOTED) {
        f->other[sort].name[i] = arena_text(&f->memory, name);
        f->other[sort].kind[i] = arena_text(&f->memory, kind);
    }
}

static int tensorfile_by_name(const void *a, const void *b, void *context)
{
    const struct tensor_row *row = context;

    return strcmp(row[*(const size_t *)a].t.name,
                  row[*(const size_t *)b].t.name);
}

/* Order by name for tensorfile_find; no two may have the same. */
static int tensorfile_sort_names(struct tensorfile *f, struct error *err)
{
    f->by_name = arena_take(&f->memory, f->count, sizeof *f->by_name);
    if (arena_check(&f->memory, "names", err))
        return -1;
    for (size_t i = 0; i < f->count; i++)
        f->by_name[i] = i;
    qsort_r(f->by_name, f->count, sizeof *f->by_name, tensorfile_by_name,
            f->row);
    for (size_t i = 1; i < f->count; i++)
        if (!tensorfile_by_name(&f->by_name[i - 1], &f->by_name[i], f->row))
            return error_set(err, EX_DATAERR, "two tensors are named '%s'",
                             f->row[f->by_name[i]].t.name);
    return 0;
}

/* ---- numpy and safetensors ---------------------------------------------- */

struct pickle *tensorfile_unpickle(struct tensorfile *f, const char *where,
                                   const void *data, size_t bytes,
                                   size_t *used, struct error *err)
{
    struct pickle *p = pickle_read(data, bytes, used, err), **to;
    size_t memory = 0;

    to = p ? list_add(&f->pickle, &f->npickle, &f->pickle_room, sizeof *to, err)
           : NULL;
    if (!to) {
        pickle_free(p);
        return NULL;
    }
    *to = p;
    if (pickle_refused(p) && !f->refused.text[0])
        error_set(&f->refused, EX_DATAERR, "%s%s%s", where,
                  *where ? ": " : "", pickle_refused(p));
    for (size_t i = 0; i < f->npickle; i++)
        memory += pickle_memory(f->pickle[i]);
    if (memory <= PICKLE_MAX_MEMORY)
        return p;
    return error_null(err, EX_DATAERR, "its pickles make more than %zu MB of "
                      "objects", PICKLE_MAX_MEMORY >> 20);
}

/* An array of objects is a pickle behind the header. */
static int tensorfile_open_objects(struct tensorfile *f, const char *name,
                                   const char *where, const void *data,
                                   size_t bytes, struct error *err)
{
    const struct pickle *p = tensorfile_unpickle(f, where, data, bytes, NULL,
                                                 err);

    return p ? tensorfile_flatten(f, name, p, err) : -1;
}

/* "dir/l_eyelid.npy" -> "l_eyelid": what an array without a name is called. */
static const char *tensorfile_array_stem(char out[TENSORFILE_NAME],
                                         const char *path)
{
    const char *slash = strrchr(path, '/'), *dot;

    snprintf(out, TENSORFILE_NAME, "%s", slash ? slash + 1 : path);
    dot = strrchr(out, '.');
    if (dot && dot != out)
        out[dot - out] = 0;
    return out;
}

/* One array, named as the file; arrays of objects hold a pickle. */
static int tensorfile_open_npy(struct tensorfile *f, struct error *err)
{
    struct tensor_place p = {.entry = SIZE_MAX};
    struct npy_header h;
    char name[TENSORFILE_NAME];

    f->format = "numpy npy";
    tensorfile_array_stem(name, f->path);
    if (npy_header_read(&h, f->map, f->bytes, f->bytes, err))
        return -1;
    if (h.kind == 'O')
        return tensorfile_open_objects(f, "", "", f->map + h.bytes,
                                       f->bytes - h.bytes, err);
    p.data = f->map + h.bytes;
    if (!npy_view(&p.view, &h))
        return error_set(err, EX_DATAERR, "dtype is not supported");
    return tensorfile_add(f, name, &p, err);
}

/* Only the header is read now: the numbers stay packed until they are taken. */
static int tensorfile_open_npz_entry(struct tensorfile *f, size_t i,
                                     struct error *err)
{
    const char *name = ziparchive_name(f->zip, i);
    struct tensor_place p = {.entry = i};
    struct npy_header h;
    char base[TENSORFILE_NAME];
    struct arena room = {0};
    void *head = arena_take(&room, NPY_HEADER_MAX, 1);
    size_t have, bytes = ziparchive_size(f->zip, i);
    int rc = -1;

    snprintf(base, sizeof base, "%.*s", (int)(strlen(name) - 4), name);
    if (arena_check(&room, "a header", err) ||
        ziparchive_peek(head, NPY_HEADER_MAX, &have, f->zip, i, err) ||
        npy_header_read(&h, head, have, bytes, err))
        goto out;
    p.skip = h.bytes;
    if (h.kind == 'O') {
        unsigned char *all = bytes > TENSORFILE_SMALL
                                 ? NULL : arena_take(&f->memory, bytes, 1);

        if (!all)
            error_set(err, EX_DATAERR, "a large array of objects");
        else if (!ziparchive_read(all, f->zip, i, err))
            rc = tensorfile_open_objects(f, base, name, all + h.bytes,
                                         bytes - h.bytes, err);
    } else if (npy_view(&p.view, &h)) {
        rc = tensorfile_add(f, base, &p, err);
    } else {
        tensorfile_add_other(f, TENSORFILE_PLAIN, base, "array");
        rc = 0;
    }
out:
    arena_release(&room);
    return rc ? error_prefix(err, "%s", name) : 0;
}

/* Each entry is an array. */
static int tensorfile_open_npz(struct tensorfile *f, struct error *err)
{
    f->format = "numpy npz";
    for (size_t i = 0; i < ziparchive_count(f->zip); i++) {
        if (!file_ends(ziparchive_name(f->zip, i), ".npy"))
            return error_set(err, EX_DATAERR, "%s: is no array (expected a "
                             "PyTorch checkpoint or .npy entries)",
                             ziparchive_name(f->zip, i));
        if (tensorfile_open_npz_entry(f, i, err))
            return -1;
    }
    return 0;
}

/* A zip with a data.pkl one folder down is PyTorch's, any other numpy's. */
static int tensorfile_open_zip(struct tensorfile *f, struct error *err)
{
    size_t found = SIZE_MAX;

    f->zip = ziparchive_open(f->path, err);
    if (!f->zip)
        return -1;
    f->source = 0;
    for (size_t i = 0; i < ziparchive_count(f->zip); i++) {
        const char *name = ziparchive_name(f->zip, i);

        f->source += ziparchive_size(f->zip, i);
        if (file_ends(name, "/data.pkl") &&
            strchr(name, '/') == strrchr(name, '/'))
            found = i;
    }
    return found == SIZE_MAX ? tensorfile_open_npz(f, err)
                             : tensorfile_torch_zip(f, found, err);
}

/* Tensors lie in the file as they are, C order. */
static int tensorfile_open_safetensors(struct tensorfile *f, struct error *err)
{
    int rc = 0;

    f->format = "safetensors";
    f->st = st_open(f->path, err);
    if (!f->st) {
        f->named = true;
        return -1;
    }
    for (size_t i = 0; i < st_count(f->st) && !rc; i++) {
        const struct st_tensor *t = st_at(f->st, i);
        struct tensor_place p = {.data = t->data, .entry = SIZE_MAX,
                                 .view = array_view_tensor(t)};

        rc = tensorfile_add(f, t->name, &p, err);
    }
    return rc;
}

/* ---- opening ------------------------------------------------------------ */

static int tensorfile_open_pickle(struct tensorfile *f, struct error *err)
{
    /* The number that the older form of PyTorch begins with. */
    static const unsigned char magic[10] = {0x6c, 0xfc, 0x9c, 0x46, 0xf9,
                                            0x20, 0x6a, 0xa8, 0x50, 0x19};
    size_t used;
    const struct pickle *p = tensorfile_unpickle(f, "", f->map, f->bytes,
                                                 &used, err);
    const struct pickle_value *root;
    char name[TENSORFILE_NAME];

    f->format = "pickle";
    if (!p)
        return f->map[0] == 0x80 ? -1
            : error_prefix(err, "neither safetensors, zip, npy nor a sound "
                           "pickle");
    root = pickle_root(p);
    if (root->kind == PICKLE_LONG && root->u.s.n == sizeof magic &&
        !memcmp(root->u.s.p, magic, sizeof magic))
        return tensorfile_torch_legacy(f, used, err);
    if (pickle_storages(p)->n)
        return error_set(err, EX_DATAERR, "a pickle with PyTorch storages "
                         "alone (expected the file that holds them too)");
    bool one = tensorfile_array(root)
               || (root->kind == PICKLE_OBJECT
                   && tensorfile_is_sparse(root->u.object));
    return tensorfile_flatten(f, one ? tensorfile_array_stem(name, f->path)
                                     : "", p, err);
}

/* The first bytes say what a file is. */
static int tensorfile_open_contents(struct tensorfile *f, struct error *err)
{
    const unsigned char *p = f->map;

    if (f->bytes >= 4 && !memcmp(p, "PK", 2) && (p[2] == 3 || p[2] == 5))
        return tensorfile_open_zip(f, err);
    if (f->bytes >= 6 && !memcmp(p, "\x93NUMPY", 6))
        return tensorfile_open_npy(f, err);
    if (f->bytes >= 10 && p[8] == '{' && !memcmp(p + 4, "\0\0\0", 4))
        return tensorfile_open_safetensors(f, err);
    if (f->bytes >= 265 && !memcmp(p + 257, "ustar", 5))
        return error_set(err, EX_DATAERR, "PyTorch's tar form of 2016 is not "
                         "read (expected a later one)");
    return tensorfile_open_pickle(f, err);
}

/* Objects beside tensors are passed over; with no tensor at all, the first of
 * them says why. */
static int tensorfile_check_refused(struct tensorfile *f, struct error *err)
{
    if (f->count || !f->refused.text[0])
        return 0;
    *err = f->refused;
    return -1;
}

struct tensorfile *tensorfile_open(const char *path, struct error *err)
{
    struct tensorfile *f = calloc(1, sizeof *f);

    if (!f || !(f->path = arena_text(&f->memory, path))) {
        free(f);
        return error_null(err, EX_OSERR, "out of memory");
    }
    f->cached = SIZE_MAX;
    f->map = file_map(&f->bytes, path, err);
    f->source = f->bytes;
    f->named = !f->map;
    if (!f->map || tensorfile_open_contents(f, err) ||
        tensorfile_sort_names(f, err) || tensorfile_check_refused(f, err)) {
        if (!f->named)
            error_prefix(err, "%s", path);
        tensorfile_close(f);
        return NULL;
    }
    XXH128_hash_t h = XXH3_128bits(f->map, f->bytes);

    snprintf(f->hash, sizeof f->hash, "%016llx%016llx",
             (unsigned long long)h.high64, (unsigned long long)h.low64);
    return f;
}

void tensorfile_close(struct tensorfile *f)
{
    if (!f)
        return;
    if (f->map)
        munmap((void *)(uintptr_t)f->map, f->bytes);
    ziparchive_close(f->zip);
    st_close(f->st);
    for (size_t i = 0; i < f->npickle; i++)
        pickle_free(f->pickle[i]);
    free(f->pickle);
    free(f->row);
    free(f->cache);
    free(f->packed);
    arena_release(&f->memory);
    free(f);
}

/* ---- looking ------------------------------------------------------------ */

const char *tensorfile_path(const struct tensorfile *f)
{
    return f->path;
}

const char *tensorfile_format(const struct tensorfile *f)
{
    return f->format;
}

const char *tensorfile_hash(const struct tensorfile *f)
{
    return f->hash;
}

size_t tensorfile_count(const struct tensorfile *f)
{
    return f->count;
}

const struct tensorfile_tensor *tensorfile_at(const struct tensorfile *f,
                                              size_t i)
{
    return i < f->count ? &f->row[i].t : NULL;
}

size_t tensorfile_find(const struct tensorfile *f, const char *name)
{
    size_t low = 0, high = f->count;

    while (low < high) {
        size_t middle = low + (high - low) / 2;
        int c = strcmp(f->row[f->by_name[middle]].t.name, name);

        if (c == 0)
            return f->by_name[middle];
        if (c < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return SIZE_MAX;
}

size_t tensorfile_others(const struct tensorfile *f, enum tensorfile_sort sort)
{
    return f->other[sort].n;
}

const char *tensorfile_other(const struct tensorfile *f,
                             enum tensorfile_sort sort, size_t i,
                             const char **kind)
{
    const char *name = f->other[sort].name[i];

    *kind = f->other[sort].kind[i] ? f->other[sort].kind[i] : "?";
    return name && *name ? name : "(unnamed)";
}

/* ---- elements ----------------------------------------------------------- */

/* All of an entry, unpacked; the last one is kept.  Tensors that share an
 * entry lie beside each other, so that one is enough; a file where they do
 * not is read again and again, but only so often. */
static const char *tensorfile_entry_unpacked(struct tensorfile *f, size_t entry,
                                             struct error *err)
{
    size_t bytes = ziparchive_size(f->zip, entry);

    if (f->cached == entry)
        return f->cache;
    if (f->unpacked / 8 > f->source + TENSORFILE_SMALL)
        return error_null(err, EX_DATAERR, "its tensors share storages in too "
                          "many places");
    f->cached = SIZE_MAX;
    free(f->cache);
    f->cache = malloc(bytes + 1);
    if (!f->cache)
        return error_null(err, EX_OSERR, "out of memory for %zu bytes", bytes);
    if (ziparchive_read(f->cache, f->zip, entry, err))
        return NULL;
    f->unpacked += bytes;
    f->cached = entry;
    return f->cache;
}

/* Whether the elements already lie as they are wanted. */
static bool tensorfile_is_packed(const struct array_view *v)
{
    struct array_view packed = *v;

    array_view_pack(&packed, false);
    for (int i = 0; i < v->ndim; i++)
        if (v->dim[i] > 1 && v->stride[i] != packed.stride[i])
            return false;
    return !v->swap;
}

const void *tensorfile_data(struct tensorfile *f, size_t i, struct error *err)
{
    const struct tensor_place *p = &f->row[i].place;
    const char *from = p->data;

    if (!p->view.count)
        return "";
    if (!from) {
        from = tensorfile_entry_unpacked(f, p->entry, err);
        if (!from) {
            error_prefix(err, "%s: tensor '%s'", f->path, f->row[i].t.name);
            return NULL;
        }
        from += p->skip;
    }
    if (tensorfile_is_packed(&p->view))
        return from;
    free(f->packed);
    f->packed = malloc(p->view.count * st_dtype_size(p->view.dtype));
    if (!f->packed)
        return error_null(err, EX_OSERR, "%s: tensor '%s': out of memory",
                          f->path, f->row[i].t.name);
    array_view_copy(f->packed, &p->view, from);
    return f->packed;
}
