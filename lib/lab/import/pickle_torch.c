/* What PyTorch pickles: tensors on storages, which lie in files of their own
 * or, in its older form, in strings. */
#include <string.h>

#include "lib/lab/import/pickle_machine.h"

struct pickle_value *pickle_persistent(struct pickle_machine *m,
                                       const struct pickle_value *id)
{
    const struct pickle_value *type, *key, *view;
    struct pickle_value *v;
    struct pickle_storage *s;

    /* the older form: a class, and the text it was defined in */
    if (pickle_is_kind(id, PICKLE_TUPLE) && id->u.list.n > 1
        && pickle_is(pickle_item(id, 0), "module"))
        return pickle_item(id, 1);
    if (!pickle_is_kind(id, PICKLE_TUPLE) || id->u.list.n < 5
        || id->u.list.n > 6 || !pickle_is(pickle_item(id, 0), "storage"))
        return pickle_null(m, "persistent id is a %s (expected a storage)",
                           pickle_kind_name(id));
    type = pickle_item(id, 1);
    key = pickle_item(id, 2);
    if (pickle_is_kind(type, PICKLE_NAME) && type->u.name->known == NAME_NONE)
        return pickle_make_object(m, type->u.name, NULL);
    if (!pickle_is_kind(type, PICKLE_NAME)
        || type->u.name->known < NAME_STORAGE
        || (key->kind != PICKLE_TEXT && key->kind != PICKLE_BYTES))
        return pickle_null(m, "storage of type %s with a %s as key",
                           pickle_kind_name(type), pickle_kind_name(key));
    v = pickle_make(m, PICKLE_STORAGE);
    s = v ? pickle_alloc(m, sizeof *s) : NULL;
    if (!s
        || pickle_take_size(m, &s->count, pickle_item(id, 4), "storage's size"))
        return NULL;
    s->dtype = (enum st_dtype)(type->u.name->known - NAME_STORAGE);
    s->key = key->u.s;
    v->u.storage = s;
    if (pickle_append(m, &m->p->storages, v))
        return NULL;
    view = pickle_item(id, 5);
    if (!view || view->kind == PICKLE_NONE)
        return v;
    if (view->kind != PICKLE_TUPLE || view->u.list.n != 3)
        return pickle_null(m, "view of a storage is a %s (expected 3 values)",
                           pickle_kind_name(view));
    if (pickle_take_size(m, &s->first, pickle_item(view, 1), "view's offset") ||
        pickle_take_size(m, &s->count, pickle_item(view, 2), "view's size"))
        return NULL;
    return v;
}

/* (storage, offset, size, stride, ..) */
struct pickle_value *pickle_torch_tensor(struct pickle_machine *m,
                                                const struct pickle_value *args)
{
    const struct pickle_value *storage = pickle_item(args, 0);
    struct pickle_value *v = pickle_make_array(m);
    struct pickle_array *a = v ? v->u.array : NULL;
    size_t stride[ARRAY_VIEW_DIMS], reach;
    int n;

    if (!v)
        return NULL;
    if (pickle_is_kind(storage, PICKLE_OBJECT))     /* of no type of ours */
        return pickle_make_object(m, &storage->u.object->of, NULL);
    if (!pickle_is_kind(storage, PICKLE_STORAGE))
        return pickle_null(m, "tensor of a %s (expected a storage)",
                           pickle_kind_name(storage));
    a->view.ndim = pickle_take_sizes(m, a->view.dim, pickle_item(args, 2),
                                     "size of a tensor");
    n = pickle_take_sizes(m, stride, pickle_item(args, 3),
                          "stride of a tensor");
    if (a->view.ndim < 0 || n < 0
        || pickle_take_size(m, &a->first, pickle_item(args, 1),
                            "offset of a tensor"))
        return NULL;
    if (n != a->view.ndim || !array_view_pack(&a->view, false))
        return pickle_null(m, "tensor of %d dimensions has %d strides, or is "
                           "too large", a->view.ndim, n);
    memcpy(a->view.stride, stride, (size_t)n * sizeof *stride);
    reach = array_view_extent(&a->view);
    if (reach > storage->u.storage->count ||
        (reach && a->first > storage->u.storage->count - reach))
        return pickle_null(m, "tensor of %zu elements from %zu on, reaching "
                           "%zu further, in a storage of %zu", a->view.count,
                           a->first, reach, storage->u.storage->count);
    a->first = reach ? a->first + storage->u.storage->first : 0;
    a->storage = storage->u.storage;
    a->view.dtype = a->storage->dtype;
    a->known = a->filled = true;
    return v;
}

/* (bytes): a storage alone in PyTorch's older form, pickled as a string.  The
 * number, the version and the machine are left unread. */
struct pickle_value *pickle_torch_load(struct pickle_machine *m,
                                              const struct pickle_value *args)
{
    const struct pickle_value *s = pickle_item(args, 0);
    struct pickle_value *v = pickle_make(m, PICKLE_STORAGE);
    struct pickle_storage *out = v ? pickle_alloc(m, sizeof *out) : NULL;
    uint64_t count = 0;
    size_t at = 0, used, size;

    if (!out)
        return NULL;
    v->u.storage = out;
    if (!pickle_is_kind(s, PICKLE_BYTES) || m->inner)
        return pickle_null(m, "of other than bytes, or inside of another");
    if (pickle_read_again(m, s))
        return NULL;
    for (int i = 0; i < 5; i++) {
        struct error why;
        struct pickle *p = pickle_read_any(s->u.s.p + at, s->u.s.n - at, &used,
                                           true, &why);

        if (!p)
            return pickle_null(m, "pickle %d, %s", i, why.text);
        if (i == 3 && p->root->kind == PICKLE_STORAGE)
            *out = *p->root->u.storage;
        pickle_free(p);
        at += used;
    }
    size = st_dtype_size(out->dtype);
    if (s->u.s.n - at >= sizeof count)
        memcpy(&count, s->u.s.p + at, sizeof count);
    if (!out->key.n || s->u.s.n - at < sizeof count || out->first ||
        count != out->count || count > (s->u.s.n - at - 8) / size)
        return pickle_null(m, "holds no storage of %zu elements", out->count);
    out->key = (struct pickle_text){"", 0};     /* was in that pickle */
    out->data = s->u.s.p + at + 8;
    return v;
}

struct pickle_value *pickle_torch_subclass(struct pickle_machine *m,
                                           const struct pickle_value *args)
{
    const struct pickle_value *function = pickle_item(args, 0);
    const struct pickle_value *given = pickle_item(args, 2);

    if (pickle_is_kind(function, PICKLE_NAME)
        && function->u.name->known == NAME_TENSOR
        && pickle_is_kind(given, PICKLE_TUPLE))
        return pickle_torch_tensor(m, given);
    return pickle_make_object(m, NULL, NULL);
}

/* (tensor, ..) */
struct pickle_value *pickle_torch_parameter(struct pickle_machine *m,
                                            const struct pickle_value *args)
{
    struct pickle_value *tensor = pickle_item(args, 0);

    if (pickle_is_kind(tensor, PICKLE_OBJECT))
        return tensor;
    if (!pickle_is_kind(tensor, PICKLE_ARRAY) || !tensor->u.array->storage)
        return pickle_null(m, "parameter of a %s (expected a tensor)",
                           pickle_kind_name(tensor));
    return tensor;
}

struct pickle_value *pickle_torch_size(struct pickle_machine *m,
                                              const struct pickle_value *args)
{
    struct pickle_value *sizes = pickle_item(args, 0);

    if (!pickle_is_kind(sizes, PICKLE_TUPLE)
        && !pickle_is_kind(sizes, PICKLE_LIST))
        return pickle_null(m, "Size of other than a tuple");
    return sizes;
}
