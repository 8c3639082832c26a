/* The tree of a pickle as a flat list of tensors with dotted names. */
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/import/tensorfile_impl.h"

/* The name so far; grows and shrinks as the walk goes down and up. */
struct path {
    char text[TENSORFILE_NAME];
    size_t n;
};

/* One UTF-8 character at p, at most n bytes: its length, or 0. */
static size_t flatten_utf8_length(const unsigned char *p, size_t n)
{
    size_t k = p[0] < 0x80 ? 1 : p[0] >> 5 == 6 ? 2 : p[0] >> 4 == 14 ? 3
               : p[0] >> 3 == 30 ? 4 : 0;
    unsigned c = k ? p[0] & (0xffu >> k) : 0;

    if (k == 1)
        return 1;
    if (k > n)
        return 0;
    for (size_t i = 1; i < k; i++) {
        if (p[i] >> 6 != 2)
            return 0;
        c = c << 6 | (p[i] & 63);
    }
    if (k < 2 || c < (k == 2 ? 0x80u : k == 3 ? 0x800u : 0x10000u) ||
        c > 0x10ffff || c >> 11 == 0x1b)
        return 0;
    return k;
}

/* Append a string to the name: text as it is, Python 2's bytes as latin1.
 * False when it does not fit or holds what no name should. */
static bool flatten_path_append(struct path *path, const struct pickle_value *v)
{
    const unsigned char *p = (const unsigned char *)v->u.s.p;
    size_t left = v->u.s.n;

    while (left) {
        size_t k = v->kind == PICKLE_TEXT ? flatten_utf8_length(p, left) : 1;

        if (!k || *p < 0x20 || *p == 0x7f || path->n + 5 > sizeof path->text)
            return false;
        if (v->kind == PICKLE_BYTES && *p >= 0x80) {
            path->text[path->n++] = (char)(0xc0 | *p >> 6);
            path->text[path->n++] = (char)(0x80 | (*p & 63));
        } else {
            memcpy(path->text + path->n, p, k);
            path->n += k;
        }
        p += k;
        left -= k;
    }
    path->text[path->n] = 0;
    return true;
}

/* Go down by a key, or by none; false: it cannot be in a name. */
static bool flatten_path_down(struct path *path, const struct pickle_value *key,
                              bool bare)
{
    if (path->n + 24 > sizeof path->text)
        return false;
    if (bare)
        return true;
    if (path->n)
        path->text[path->n++] = '.';
    if (key->kind == PICKLE_INT) {
        path->n += (size_t)sprintf(path->text + path->n, "%lld",
                                   (long long)key->u.i);
        return true;
    }
    path->text[path->n] = 0;
    return (key->kind == PICKLE_TEXT || key->kind == PICKLE_BYTES) &&
           flatten_path_append(path, key);
}

static int flatten_value(struct tensorfile *f, struct path *path,
                         const struct pickle_value *v, int depth,
                         struct error *err);

/* What PyTorch's modules keep their tensors under: no part of the names, as in
 * their state dictionaries. */
static bool flatten_is_bare(const struct pickle_value *key)
{
    return pickle_is(key, "_parameters") || pickle_is(key, "_buffers")
           || pickle_is(key, "_modules");
}

/* Each item under its key or number, one step further down the path; `module`:
 * they are what an object holds. */
static int flatten_items(struct tensorfile *f, struct path *path,
                         const struct pickle_value *v, bool module, int depth,
                         struct error *err)
{
    const struct pickle_list *l = &v->u.list;
    size_t before = path->n, step = v->kind == PICKLE_DICT ? 2 : 1;
    int rc = 0;

    for (size_t i = 0; i < l->n && !rc; i += step) {
        struct pickle_value index = {.kind = PICKLE_INT,
                                     .u.i = (int64_t)i};

        if (flatten_path_down(path, step == 2 ? l->item[i] : &index,
                              module && flatten_is_bare(l->item[i])))
            rc = flatten_value(f, path, l->item[i + step - 1], depth + 1, err);
        else
            tensorfile_add_other(f, TENSORFILE_PLAIN, path->text,
                                 "value under an odd key");
        path->n = before;
        path->text[before] = 0;
    }
    return rc;
}

/* An array of objects: one stands for itself. */
static int flatten_objects(struct tensorfile *f, struct path *path,
                           const struct pickle_value *v, int depth,
                           struct error *err)
{
    return v->u.list.n == 1
               ? flatten_value(f, path, v->u.list.item[0], depth + 1, err)
               : flatten_items(f, path, v, false, depth + 1, err);
}

/* An array of numbers, wherever they lie. */
static int flatten_array(struct tensorfile *f, struct path *path,
                         const struct pickle_array *a, struct error *err)
{
    struct tensor_place p = {.view = a->view, .data = a->data,
                             .entry = SIZE_MAX};

    if (!a->filled)
        return error_set(err, EX_DATAERR, "the array is never filled in");
    if (!a->known) {
        tensorfile_add_other(f, TENSORFILE_PLAIN, path->text, "array");
        return 0;
    }
    if (a->storage && a->storage->data) {
        p.data = (const char *)a->storage->data +
                 a->first * st_dtype_size(a->view.dtype);
    } else if (a->storage) {
        if (tensorfile_storage(&p, f, a->storage, err))
            return -1;
        if (p.data && a->view.count)
            p.data = (const char *)p.data +
                     a->first * st_dtype_size(a->view.dtype);
        else
            p.skip = a->first * st_dtype_size(a->view.dtype);
        p.view.swap = f->swap;
    }
    return tensorfile_add(f, path->text, &p, err);
}

/* An object that is passed over. */
static void flatten_note_object(struct tensorfile *f, const struct path *path,
                                const struct pickle_name *of)
{
    char class[PICKLE_FULL_NAME];

    pickle_full_name(class, of);
    tensorfile_add_other(f, TENSORFILE_OBJECT, path->text,
                         *class ? class : "value without a class");
}

/* chumpy's class Ch wraps an array, x of its attributes. */
static bool flatten_is_chumpy(const struct pickle_value *v)
{
    return v && v->kind == PICKLE_OBJECT
           && pickle_text_is(v->u.object->of.name, "Ch")
           && pickle_text_begins(v->u.object->of.module, "chumpy");
}

const struct pickle_array *tensorfile_array(const struct pickle_value *v)
{
    for (int i = 0; flatten_is_chumpy(v) && i < 4; i++)
        v = v->u.object->state ? pickle_get(v->u.object->state, "x") : NULL;
    return v && v->kind == PICKLE_ARRAY ? v->u.array : NULL;
}

/* The array in chumpy's wrapping. */
static int flatten_chumpy(struct tensorfile *f, struct path *path,
                          const struct pickle_value *v, struct error *err)
{
    const struct pickle_array *a = tensorfile_array(v);

    if (!v->u.object->state)
        return error_set(err, EX_DATAERR, "byte %zu: '%s' is a chumpy array "
                         "without one", v->at, path->text);
    if (!a || a->objects)
        return error_set(err, EX_DATAERR, "byte %zu: '%s' is a chumpy array "
                         "whose x is %s", v->at, path->text,
                         a ? "one of objects" : "missing");
    return flatten_array(f, path, a, err) ?
               error_prefix(err, "byte %zu: tensor '%s'", v->at, path->text)
               : 0;
}

/* One of scipy's matrices in full; of an unknown form it is passed over. */
static int flatten_sparse(struct tensorfile *f, struct path *path,
                          const struct pickle_value *v, struct error *err)
{
    struct tensor_place p = {.entry = SIZE_MAX};
    int rc = tensorfile_dense(&p, f, v->u.object, err);

    if (rc == 1)
        flatten_note_object(f, path, &v->u.object->of);
    if (!rc)
        rc = tensorfile_add(f, path->text, &p, err);
    return rc < 0 ? error_prefix(err, "byte %zu: tensor '%s'", v->at,
                                 path->text) : 0;
}

/* An object: the tensors in what was put into it, or else in its attributes.
 * One without any is passed over as a whole; so is one that leads back to
 * itself. */
static int flatten_object(struct tensorfile *f, struct path *path,
                          const struct pickle_value *v, int depth,
                          struct error *err)
{
    struct pickle_object *o = v->u.object;
    const struct pickle_value *held = o->items ? o->items : o->state;
    size_t tensors = f->count;
    int rc = 0;

    if (flatten_is_chumpy(v))
        return flatten_chumpy(f, path, v, err);
    if (tensorfile_is_sparse(o))
        return flatten_sparse(f, path, v, err);
    if (o->inside)
        return 0;
    o->inside = true;
    f->objects++;
    if (held)
        rc = flatten_items(f, path, held, held->kind == PICKLE_DICT, depth + 1,
                           err);
    f->objects--;
    o->inside = false;
    if (!rc && f->count == tensors && !f->objects)
        flatten_note_object(f, path, &o->of);
    return rc;
}

/* Any value; nesting and the number of values are bounded, since shared ones
 * can make a small pickle endless. */
static int flatten_value(struct tensorfile *f, struct path *path,
                         const struct pickle_value *v, int depth,
                         struct error *err)
{
    int rc;

    if (depth > TENSORFILE_DEPTH)
        return error_set(err, EX_DATAERR, "byte %zu: values are nested more "
                         "than %d deep", v->at, TENSORFILE_DEPTH);
    if (++f->visited > PICKLE_MAX_ITEMS)
        return error_set(err, EX_DATAERR, "byte %zu: more than %zu values, "
                         "shared ones counted again", v->at,
                         PICKLE_MAX_ITEMS);
    switch (v->kind) {
    case PICKLE_DICT:
    case PICKLE_LIST:
    case PICKLE_TUPLE:
        return flatten_items(f, path, v, false, depth, err);
    case PICKLE_NAME:
        flatten_note_object(f, path, v->u.name);
        return 0;
    case PICKLE_OBJECT:
        return flatten_object(f, path, v, depth, err);
    case PICKLE_ARRAY:
        if (v->u.array->objects)        /* their errors say where they are */
            return flatten_objects(f, path, v->u.array->objects, depth, err);
        rc = flatten_array(f, path, v->u.array, err);
        break;
    default:
        tensorfile_add_other(f, TENSORFILE_PLAIN, path->text,
                             pickle_kind_name(v));
        return 0;
    }
    if (rc)
        error_prefix(err, "byte %zu: tensor '%s'", v->at, path->text);
    return rc;
}

int tensorfile_flatten(struct tensorfile *f, const char *name,
                       const struct pickle *p, struct error *err)
{
    struct path path = {.n = 0};

    path.n = (size_t)snprintf(path.text, sizeof path.text, "%s", name);
    if (path.n >= sizeof path.text)
        return error_set(err, EX_DATAERR, "name of more than %d bytes",
                         TENSORFILE_NAME);
    return flatten_value(f, &path, pickle_root(p), 0, err);
}
