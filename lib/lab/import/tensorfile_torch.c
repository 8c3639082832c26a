/* PyTorch's checkpoints: where the storages lie that its pickle speaks of. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/import/tensorfile_impl.h"

/* ---- the zip form ------------------------------------------------------- */

/* "little" (also when absent) or "big". */
static int torch_read_byte_order(struct tensorfile *f, struct error *err)
{
    char name[300], text[8] = "";
    size_t i, n;

    snprintf(name, sizeof name, "%sbyteorder", f->prefix);
    i = ziparchive_find(f->zip, name);
    if (i == SIZE_MAX)
        return 0;
    n = ziparchive_size(f->zip, i);
    if (n >= sizeof text || ziparchive_read(text, f->zip, i, err))
        return error_set(err, EX_DATAERR, "%s: is damaged", name);
    f->swap = !strcmp(text, "big");
    if (!f->swap && strcmp(text, "little"))
        return error_set(err, EX_DATAERR, "%s: is \"%s\" (expected little or "
                         "big)", name, text);
    return 0;
}

int tensorfile_torch_zip(struct tensorfile *f, size_t i, struct error *err)
{
    const char *name = ziparchive_name(f->zip, i);
    size_t bytes = ziparchive_size(f->zip, i);
    size_t n = strlen(name) - strlen("data.pkl");
    const struct pickle *p;
    void *text;

    f->format = "PyTorch zip";
    if (n >= sizeof f->prefix)
        return error_set(err, EX_DATAERR, "%s: its name is too long", name);
    memcpy(f->prefix, name, n);
    if (bytes > TENSORFILE_SMALL)
        return error_set(err, EX_DATAERR, "%s: %zu bytes (expected at most "
                         "%zu)", name, bytes, TENSORFILE_SMALL);
    text = arena_take(&f->memory, bytes, 1);
    if (arena_check(&f->memory, name, err) || torch_read_byte_order(f, err) ||
        ziparchive_read(text, f->zip, i, err))
        return -1;
    p = tensorfile_unpickle(f, name, text, bytes, NULL, err);
    return p && !tensorfile_flatten(f, "", p, err)
               ? 0 : error_prefix(err, "%s", name);
}

/* Keys are numbers or words: what else could lead to another entry. */
static bool torch_key_text(char out[64], struct pickle_text key)
{
    if (!key.n || key.n > 60)
        return false;
    for (size_t i = 0; i < key.n; i++)
        if (!strchr("0123456789abcdefghijklmnopqrstuvwxyz"
                    "ABCDEFGHIJKLMNOPQRSTUVWXYZ_-", key.p[i]) || !key.p[i])
            return false;
    memcpy(out, key.p, key.n);
    out[key.n] = 0;
    return true;
}

/* The zip's entry that holds storage s, large enough for what is wanted. */
static int torch_zip_storage(struct tensor_place *p, struct tensorfile *f,
                             const struct pickle_storage *s, struct error *err)
{
    char name[400], key[64];
    size_t bytes = st_dtype_size(s->dtype);

    if (!torch_key_text(key, s->key))
        return error_set(err, EX_DATAERR, "storage with an odd key");
    snprintf(name, sizeof name, "%sdata/%s", f->prefix, key);
    p->entry = ziparchive_find(f->zip, name);
    if (p->entry == SIZE_MAX)
        return error_set(err, EX_DATAERR, "no entry %s", name);
    if (s->first > SIZE_MAX / 32 || s->count > SIZE_MAX / 32 ||
        ziparchive_size(f->zip, p->entry) < (s->first + s->count) * bytes)
        return error_set(err, EX_DATAERR, "storage of %zu elements of %s, "
                         "but %s has %zu bytes", s->count,
                         st_dtype_name(s->dtype), name,
                         ziparchive_size(f->zip, p->entry));
    return 0;
}

/* ---- the older form ----------------------------------------------------- */

/* As memcmp, the shorter one first. */
static int torch_by_key(const void *one, const void *other)
{
    const struct pickle_text *a = &((const struct legacy_storage *)one)->key;
    const struct pickle_text *b = &((const struct legacy_storage *)other)->key;
    size_t n = a->n < b->n ? a->n : b->n;
    int c = n ? memcmp(a->p, b->p, n) : 0;

    return c ? c : (a->n > b->n) - (a->n < b->n);
}

/* By bisection, for files may have thousands; NULL: not there. */
static struct legacy_storage *torch_legacy_find(const struct tensorfile *f,
                                                struct pickle_text key)
{
    struct legacy_storage want = {.key = key};

    return f->nlegacy ? bsearch(&want, f->legacy, f->nlegacy,
                                sizeof *f->legacy, torch_by_key) : NULL;
}

/* Where the older format holds storage s, checked likewise. */
static int torch_legacy_storage_place(struct tensor_place *p,
                                      struct tensorfile *f,
                                      const struct pickle_storage *s,
                                      struct error *err)
{
    const struct legacy_storage *l = torch_legacy_find(f, s->key);

    if (!l || !l->data)
        return error_set(err, EX_DATAERR, "its storage is not in the file");
    if (l->count < s->first || l->count - s->first < s->count ||
        l->dtype != s->dtype)
        return error_set(err, EX_DATAERR, "storage of %zu elements of %s, but "
                         "the file has %zu of %s", s->count,
                         st_dtype_name(s->dtype), l->count,
                         st_dtype_name(l->dtype));
    p->data = l->data;
    return 0;
}

int tensorfile_storage(struct tensor_place *p, struct tensorfile *f,
                       const struct pickle_storage *s, struct error *err)
{
    return f->zip ? torch_zip_storage(p, f, s, err)
                  : torch_legacy_storage_place(p, f, s, err);
}

/* The storages that the pickle names, each once, in the order of keys. */
static int torch_legacy_table(struct tensorfile *f, const struct pickle *tree,
                              struct error *err)
{
    const struct pickle_list *named = pickle_storages(tree);
    size_t n = 0;

    f->legacy = arena_take(&f->memory, named->n, sizeof *f->legacy);
    if (arena_check(&f->memory, "storages", err))
        return -1;
    for (size_t i = 0; i < named->n; i++) {
        f->legacy[i].key = named->item[i]->u.storage->key;
        f->legacy[i].dtype = named->item[i]->u.storage->dtype;
    }
    if (named->n)
        qsort(f->legacy, named->n, sizeof *f->legacy, torch_by_key);
    for (size_t i = 0; i < named->n; i++)
        if (!n || torch_by_key(&f->legacy[n - 1], &f->legacy[i]))
            f->legacy[n++] = f->legacy[i];
    f->nlegacy = n;
    return 0;
}

/* Behind the pickles: for each key, the number of elements and these. */
static int torch_legacy_data(struct tensorfile *f,
                             const struct pickle_value *keys, size_t at,
                             struct error *err)
{
    if (keys->kind != PICKLE_LIST)
        return error_set(err, EX_DATAERR, "list of storages is a %s",
                         pickle_kind_name(keys));
    for (size_t i = 0; i < keys->u.list.n; i++) {
        const struct pickle_value *key = keys->u.list.item[i];
        struct legacy_storage *l = NULL;
        uint64_t count = 0;

        if (key->kind == PICKLE_TEXT || key->kind == PICKLE_BYTES)
            l = torch_legacy_find(f, key->u.s);
        if (!l || l->data)
            return error_set(err, EX_DATAERR, "byte %zu: storage %zu of the "
                             "list is not one of the tensors', or a second "
                             "time", key->at, i);
        if (f->bytes - at >= sizeof count)
            memcpy(&count, f->map + at, sizeof count);
        if (f->bytes - at < sizeof count ||
            count > (f->bytes - at - 8) / st_dtype_size(l->dtype))
            return error_set(err, EX_DATAERR, "byte %zu: storage %zu has %llu "
                             "elements of %s (expected what %zu bytes hold)",
                             at, i, (unsigned long long)count,
                             st_dtype_name(l->dtype), f->bytes - at);
        l->data = f->map + at + 8;
        l->count = (size_t)count;
        at += 8 + (size_t)count * st_dtype_size(l->dtype);
    }
    return 0;
}

/* The next pickle of the file; *at moves behind it. */
static struct pickle *torch_next_pickle(struct tensorfile *f, size_t *at,
                                        struct error *err)
{
    size_t used;
    char where[60];
    struct pickle *p;

    snprintf(where, sizeof where, "pickle at byte %zu", *at);
    p = tensorfile_unpickle(f, where, f->map + *at, f->bytes - *at, &used, err);

    if (p)
        *at += used;
    else
        error_prefix(err, "%s", where);
    return p;
}

/* The number, the version, the machine, the tree, the keys, the storages,
 * whose elements are little-endian whatever the machine was. */
int tensorfile_torch_legacy(struct tensorfile *f, size_t at,
                            struct error *err)
{
    const struct pickle *part[4];       /* from the version to the keys */
    const struct pickle_value *version;

    f->format = "PyTorch, older form";
    for (int i = 0; i < 4; i++) {
        if (!(part[i] = torch_next_pickle(f, &at, err)))
            return -1;
        version = pickle_root(part[0]);
        if (version->kind != PICKLE_INT || version->u.i != 1001)
            return error_set(err, EX_DATAERR, "PyTorch's version is not 1001");
    }
    if (torch_legacy_table(f, part[2], err))
        return -1;
    if (torch_legacy_data(f, pickle_root(part[3]), at, err)) {
        if (f->refused.text[0])     /* a storage of a type that is not ours */
            *err = f->refused;
        return -1;
    }
    return tensorfile_flatten(f, "", part[2], err);
}
