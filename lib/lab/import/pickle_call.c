/* The things whose meaning is known, and how each is made from its arguments
 * and its state; PyTorch's are in pickle_torch.c.  Every other is an object.
 * None of them runs anything. */
#include <string.h>

#include "lib/lab/import/pickle_machine.h"

static const struct {
    const char *module, *name;
    int value;
} names[] = {
    {"__builtin__", "object", NAME_OBJECT},
    {"builtins", "object", NAME_OBJECT},
    {"__builtin__", "set", NAME_SET},
    {"builtins", "set", NAME_SET},
    {"__builtin__", "frozenset", NAME_SET},
    {"builtins", "frozenset", NAME_SET},
    {"__builtin__", "bytes", NAME_BYTES},
    {"builtins", "bytes", NAME_BYTES},
    {"__builtin__", "bytearray", NAME_BYTES},
    {"builtins", "bytearray", NAME_BYTES},
    {"_codecs", "encode", NAME_ENCODE},
    {"copy_reg", "_reconstructor", NAME_RECONSTRUCTOR},
    {"copyreg", "_reconstructor", NAME_RECONSTRUCTOR},
    {"collections", "OrderedDict", NAME_ORDERED_DICT},
    {"numpy", "ndarray", NAME_NDARRAY},
    {"numpy", "dtype", NAME_DTYPE},
    {"numpy.core.multiarray", "_reconstruct", NAME_RECONSTRUCT},
    {"numpy._core.multiarray", "_reconstruct", NAME_RECONSTRUCT},
    {"numpy.core.multiarray", "scalar", NAME_SCALAR},
    {"numpy._core.multiarray", "scalar", NAME_SCALAR},
    {"numpy.core.numeric", "_frombuffer", NAME_FROMBUFFER},
    {"numpy._core.numeric", "_frombuffer", NAME_FROMBUFFER},
    {"torch._utils", "_rebuild_tensor", NAME_TENSOR},
    {"torch._utils", "_rebuild_tensor_v2", NAME_TENSOR},
    {"torch._utils", "_rebuild_parameter", NAME_PARAMETER},
    {"torch._utils", "_rebuild_parameter_with_state", NAME_PARAMETER},
    {"torch._tensor", "_rebuild_from_type_v2", NAME_SUBCLASS},
    {"torch", "Size", NAME_SIZE},
    {"torch.storage", "_load_from_bytes", NAME_LOAD},
    {"torch.jit._pickle", "build_intlist", NAME_LIST},
    {"torch.jit._pickle", "build_doublelist", NAME_LIST},
    {"torch.jit._pickle", "build_boollist", NAME_LIST},
    {"torch.jit._pickle", "build_tensorlist", NAME_LIST},
    {"torch", "FloatStorage", NAME_STORAGE + ST_F32},
    {"torch", "DoubleStorage", NAME_STORAGE + ST_F64},
    {"torch", "HalfStorage", NAME_STORAGE + ST_F16},
    {"torch", "BFloat16Storage", NAME_STORAGE + ST_BF16},
    {"torch", "LongStorage", NAME_STORAGE + ST_I64},
    {"torch", "IntStorage", NAME_STORAGE + ST_I32},
    {"torch", "ShortStorage", NAME_STORAGE + ST_I16},
    {"torch", "CharStorage", NAME_STORAGE + ST_I8},
    {"torch", "ByteStorage", NAME_STORAGE + ST_U8},
    {"torch", "BoolStorage", NAME_STORAGE + ST_BOOL},
};

int pickle_lookup(struct pickle_text module, struct pickle_text name)
{
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (pickle_text_is(name, names[i].name)
            && pickle_text_is(module, names[i].module))
            return names[i].value;
    /* a class that the same file defines, in code that nobody reads */
    if (pickle_text_begins(module, "__torch__"))
        return NAME_SCRIPT;
    return NAME_NONE;
}

/* The name of a value, for messages. */
static const char *pickle_name_text(int name)
{
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (names[i].value == name)
            return names[i].name;
    return name == NAME_SCRIPT ? "a class of TorchScript" : "?";
}

/* ---- arguments ---------------------------------------------------------- */

struct pickle_value *pickle_item(const struct pickle_value *t, size_t i)
{
    return i < t->u.list.n ? t->u.list.item[i] : NULL;
}

bool pickle_is_kind(const struct pickle_value *v, enum pickle_kind kind)
{
    return v && v->kind == kind;
}

int pickle_take_size(struct pickle_machine *m, size_t *out,
                            const struct pickle_value *v, const char *what)
{
    if (!pickle_is_kind(v, PICKLE_INT) || v->u.i < 0)
        return pickle_fail(m, "%s is %s (expected a number, 0 or more)",
                           what, v ? v->kind == PICKLE_INT ? "negative"
                                     : pickle_kind_name(v) : "missing");
    *out = (size_t)v->u.i;
    return 0;
}

int pickle_take_sizes(struct pickle_machine *m, size_t out[ARRAY_VIEW_DIMS],
                             const struct pickle_value *v, const char *what)
{
    if (pickle_is_kind(v, PICKLE_INT)) { /* numpy takes a bare number too */
        return pickle_take_size(m, out, v, what) ? -1 : 1;
    }
    if (!pickle_is_kind(v, PICKLE_TUPLE) && !pickle_is_kind(v, PICKLE_LIST))
        return pickle_fail(m, "%s is %s (expected a tuple)", what,
                           v ? pickle_kind_name(v) : "missing");
    if (v->u.list.n > ARRAY_VIEW_DIMS)
        return pickle_fail(m, "%s has %zu numbers (expected at most %d)",
                           what, v->u.list.n, ARRAY_VIEW_DIMS);
    for (size_t i = 0; i < v->u.list.n; i++)
        if (pickle_take_size(m, &out[i], v->u.list.item[i], what))
            return -1;
    return (int)v->u.list.n;
}

int pickle_read_again(struct pickle_machine *m, const struct pickle_value *s)
{
    m->decoded += s->u.s.n;
    return m->decoded > m->size
               ? pickle_fail(m, "the same bytes too many times") : 0;
}

/* ---- Python's own ------------------------------------------------------- */

/* No arguments, or pairs: Python 2 gives them as a list of lists. */
static struct pickle_value *pickle_call_dict(struct pickle_machine *m,
                                             const struct pickle_value *args)
{
    struct pickle_value *v = pickle_make(m, PICKLE_DICT);
    const struct pickle_value *pairs = pickle_item(args, 0);

    if (!v || !pairs)
        return v;
    if (!pickle_is_kind(pairs, PICKLE_LIST))
        return pickle_null(m, "OrderedDict of a %s (expected a list)",
                           pickle_kind_name(pairs));
    for (size_t i = 0; i < pairs->u.list.n; i++) {
        const struct pickle_value *pair = pairs->u.list.item[i];

        if ((pair->kind != PICKLE_LIST && pair->kind != PICKLE_TUPLE) ||
            pair->u.list.n != 2)
            return pickle_null(m, "OrderedDict of a %s (expected pairs)",
                               pickle_kind_name(pair));
        if (pickle_append(m, &v->u.list, pair->u.list.item[0]) ||
            pickle_append(m, &v->u.list, pair->u.list.item[1]))
            return NULL;
    }
    return v;
}

/* set(list): its items, shared with the list. */
static struct pickle_value *pickle_call_set(struct pickle_machine *m,
                                            const struct pickle_value *args)
{
    struct pickle_value *v = pickle_make(m, PICKLE_SET);
    const struct pickle_value *items = pickle_item(args, 0);

    if (!v || !items)
        return v;
    if (!pickle_is_kind(items, PICKLE_LIST)
        && !pickle_is_kind(items, PICKLE_TUPLE))
        return pickle_null(m, "set of a %s (expected a list)",
                           pickle_kind_name(items));
    v->u.list = items->u.list;
    v->u.list.room = v->u.list.n;       /* appending copies */
    return v;
}

/* Text back to the bytes that Python 3 wrote as text. */
static struct pickle_value *pickle_call_encode(struct pickle_machine *m,
                                               const struct pickle_value *args)
{
    const struct pickle_value *text = pickle_item(args, 0);
    const struct pickle_value *code = pickle_item(args, 1);
    struct pickle_value *v;
    char *out;
    size_t n = 0;

    if (!pickle_is_kind(text, PICKLE_TEXT) || !code ||
        !(pickle_is(code, "latin1") || pickle_is(code, "latin-1")))
        return pickle_null(m, "encode of other than text in latin1");
    if (pickle_read_again(m, text))
        return NULL;
    v = pickle_make(m, PICKLE_BYTES);
    out = v ? pickle_alloc_string(m, text->u.s.n) : NULL;
    if (!out)
        return NULL;
    for (size_t i = 0; i < text->u.s.n; i++) {
        unsigned c = (unsigned char)text->u.s.p[i];

        if (c >= 0x80) {
            unsigned next = i + 1 < text->u.s.n
                                ? (unsigned char)text->u.s.p[++i] : 0;

            if ((c != 0xc2 && c != 0xc3) || next >> 6 != 2)
                return pickle_null(m, "the text at %zu is not latin1", i);
            c = (c & 3) << 6 | (next & 63);
        }
        out[n++] = (char)c;
    }
    v->u.s.p = out;
    v->u.s.n = n;
    return v;
}

/* bytes() and bytearray(bytes): the bytes. */
static struct pickle_value *pickle_call_bytes(struct pickle_machine *m,
                                              const struct pickle_name *name,
                                              const struct pickle_value *args)
{
    struct pickle_value *given = pickle_item(args, 0);

    if (!given)
        return pickle_make(m, PICKLE_BYTES);
    return pickle_is_kind(given, PICKLE_BYTES)
               ? given : pickle_make_object(m, name, NULL);
}

/* copyreg._reconstructor(class, base, of the base): an object without state.
 */
static struct pickle_value *pickle_call_reconstructor(
    struct pickle_machine *m, const struct pickle_value *args)
{
    const struct pickle_value *cls = pickle_item(args, 0);
    const struct pickle_value *base = pickle_item(args, 1);

    if (!pickle_is_kind(cls, PICKLE_NAME) || !pickle_is_kind(base, PICKLE_NAME))
        return pickle_null(m, "_reconstructor of other than a class and its "
                           "base");
    return cls->u.name->known == NAME_NONE
               ? pickle_make_object(m, cls->u.name, &args->u.list)
               : pickle_new(m, cls->u.name);
}

/* TorchScript's lists of one type: the list. */
static struct pickle_value *pickle_call_list(struct pickle_machine *m,
                                             const struct pickle_value *args)
{
    struct pickle_value *list = pickle_item(args, 0);

    if (pickle_is_kind(list, PICKLE_LIST))
        return list;
    return pickle_null(m, "list of a %s (expected a list)",
                       pickle_kind_name(list));
}

/* ---- numpy -------------------------------------------------------------- */

/* "f8", "<i4", "O8", ..; what we cannot hold stays unknown. */
static struct pickle_value *pickle_call_dtype(struct pickle_machine *m,
                                              const struct pickle_value *args)
{
    const struct pickle_value *text = pickle_item(args, 0);
    struct pickle_value *v = pickle_make(m, PICKLE_DTYPE);
    struct pickle_dtype *d = v ? pickle_alloc(m, sizeof *d) : NULL;
    enum st_dtype dtype;
    struct pickle_text s;

    if (!d)
        return NULL;
    v->u.dtype = d;
    if (!text || (text->kind != PICKLE_TEXT && text->kind != PICKLE_BYTES))
        return pickle_null(m, "dtype of a %s (expected text)",
                           pickle_kind_name(text));
    s = text->u.s;
    if (s.n && memchr("<>|=", s.p[0], 4)) {
        d->swap = s.p[0] == '>';
        s.p++;
        s.n--;
    }
    d->kind = s.n ? s.p[0] : '?';
    if (s.n == 2 && s.p[1] >= '1' && s.p[1] <= '8')
        d->size = (size_t)(s.p[1] - '0');
    d->known = array_view_dtype(&dtype, d->kind, d->size);
    return v;
}

/* (version, byte order, subarray, names, fields, size, alignment, flags) */
static int pickle_build_dtype(struct pickle_machine *m,
                              struct pickle_value *object,
                              const struct pickle_value *state)
{
    struct pickle_dtype *d = object->u.dtype;
    const struct pickle_value *order, *names_of;

    if (!pickle_is_kind(state, PICKLE_TUPLE) || state->u.list.n < 5)
        return pickle_fail(m, "state of a dtype is a %s (expected 5 or more "
                           "values)", pickle_kind_name(state));
    order = pickle_item(state, 1);
    names_of = pickle_item(state, 3);
    d->swap = pickle_is(order, ">");
    if (!pickle_is_kind(pickle_item(state, 2), PICKLE_NONE) ||
        !pickle_is_kind(names_of, PICKLE_NONE))
        d->known = false;               /* a structure */
    return 0;
}

struct pickle_value *pickle_make_array(struct pickle_machine *m)
{
    struct pickle_value *v = pickle_make(m, PICKLE_ARRAY);

    if (v && !(v->u.array = pickle_alloc(m, sizeof *v->u.array)))
        return NULL;
    return v;
}

/* Shape and dtype into an array; fails when the product is too large. */
static int pickle_set_shape(struct pickle_machine *m, struct pickle_array *a,
                            const struct pickle_value *shape,
                            const struct pickle_value *dtype, bool fortran)
{
    if (!pickle_is_kind(dtype, PICKLE_DTYPE))
        return pickle_fail(m, "array of a %s (expected a dtype)",
                           pickle_kind_name(dtype));
    a->view.ndim = pickle_take_sizes(m, a->view.dim, shape,
                                     "shape of an array");
    if (a->view.ndim < 0)
        return -1;
    a->known = dtype->u.dtype->known;
    a->view.swap = dtype->u.dtype->swap;
    if (a->known)
        array_view_dtype(&a->view.dtype, dtype->u.dtype->kind,
                         dtype->u.dtype->size);
    if (!array_view_pack(&a->view, fortran))
        return pickle_fail(m, "shape of an array is too large");
    return 0;
}

/* The array's bytes, which are as many as its shape says. */
static int pickle_set_data(struct pickle_machine *m, struct pickle_array *a,
                           const struct pickle_value *data)
{
    a->filled = true;
    if (!a->known)
        return 0;
    if (!pickle_is_kind(data, PICKLE_BYTES))
        return pickle_fail(m, "data of an array are a %s (expected bytes)",
                           pickle_kind_name(data));
    if (data->u.s.n != a->view.count * st_dtype_size(a->view.dtype))
        return pickle_fail(m, "array of %zu elements of %s has %zu bytes",
                           a->view.count, st_dtype_name(a->view.dtype),
                           data->u.s.n);
    a->data = data->u.s.p;
    return 0;
}

/* (version, shape, dtype, is_fortran, data), or without the version */
static int pickle_build_array(struct pickle_machine *m,
                              struct pickle_value *object,
                              const struct pickle_value *state)
{
    struct pickle_array *a = object->u.array;
    const struct pickle_value *dtype, *data, *order;
    size_t first;

    if (!pickle_is_kind(state, PICKLE_TUPLE) || state->u.list.n < 4 ||
        state->u.list.n > 5 || a->filled || a->storage)
        return pickle_fail(m, "state of an array is a %s (expected 4 or 5 "
                           "values, once)", pickle_kind_name(state));
    first = state->u.list.n - 4;
    dtype = pickle_item(state, first + 1);
    order = pickle_item(state, first + 2);
    data = pickle_item(state, first + 3);
    if (pickle_set_shape(
            m, a, pickle_item(state, first), dtype,
            (order->kind == PICKLE_BOOL || order->kind == PICKLE_INT)
                && order->u.i))
        return -1;
    if (dtype->u.dtype->kind == 'O' && pickle_is_kind(data, PICKLE_LIST)) {
        a->filled = true;
        a->objects = data;
        return 0;
    }
    return pickle_set_data(m, a, data);
}

/* (dtype, bytes) */
static struct pickle_value *pickle_call_scalar(struct pickle_machine *m,
                                               const struct pickle_value *args)
{
    struct pickle_value *v = pickle_make_array(m), *shape;

    shape = v ? pickle_make(m, PICKLE_TUPLE) : NULL;
    if (!shape ||
        pickle_set_shape(m, v->u.array, shape, pickle_item(args, 0), false) ||
        pickle_set_data(m, v->u.array, pickle_item(args, 1)))
        return NULL;
    return v;
}

/* (bytes, dtype, shape, 'C' or 'F') */
static struct pickle_value *pickle_call_frombuffer(
    struct pickle_machine *m, const struct pickle_value *args)
{
    const struct pickle_value *order = pickle_item(args, 3);
    struct pickle_value *v = pickle_make_array(m);

    if (!v
        || pickle_set_shape(m, v->u.array, pickle_item(args, 2),
                            pickle_item(args, 1),
                            order && pickle_is(order, "F"))
        || pickle_set_data(m, v->u.array, pickle_item(args, 0)))
        return NULL;
    return v;
}

/* ---- objects ------------------------------------------------------------ */

struct pickle_value *pickle_make_object(struct pickle_machine *m,
                                        const struct pickle_name *name,
                                        const struct pickle_list *args)
{
    struct pickle_value *v = pickle_make(m, PICKLE_OBJECT);
    struct pickle_object *o = v ? pickle_alloc(m, sizeof *o) : NULL;

    if (!o)
        return NULL;
    v->u.object = o;
    if (name)
        o->of = *name;
    /* Counter({..}), UserList([..]): what it is made of is what it holds. */
    for (size_t i = 0; args && i < args->n && !o->items; i++)
        if (args->item[i]->kind == PICKLE_DICT
            || args->item[i]->kind == PICKLE_LIST)
            o->items = args->item[i];
    return v;
}

struct pickle_value *pickle_object_items(struct pickle_machine *m,
                                         struct pickle_value *object,
                                         enum pickle_kind kind)
{
    struct pickle_object *o = object->u.object;

    if (!o->own || o->items->kind != kind) {
        o->items = pickle_make(m, kind);
        o->own = o->items != NULL;
    }
    return o->items;
}

/* The attributes of an object: a dict, or the first in a tuple of such, as
 * classes with slots have it; other states say nothing. */
static int pickle_build_object(struct pickle_value *object,
                               struct pickle_value *state)
{
    for (size_t i = 0; state->kind == PICKLE_TUPLE && i < state->u.list.n; i++)
        if (state->u.list.item[i]->kind == PICKLE_DICT)
            state = state->u.list.item[i];
    if (state->kind == PICKLE_DICT)
        object->u.object->state = state;
    return 0;
}

/* ---- what the opcodes call ---------------------------------------------- */

struct pickle_value *pickle_new(struct pickle_machine *m,
                                const struct pickle_name *name)
{
    if (name->known == NAME_ORDERED_DICT)
        return pickle_make(m, PICKLE_DICT);
    if (name->known == NAME_SCRIPT)
        return pickle_make_object(m, name, NULL);
    return pickle_null(m, "%s is not a class to make things of",
                       pickle_name_text(name->known));
}

struct pickle_value *pickle_call(struct pickle_machine *m,
                                 const struct pickle_name *name,
                                 const struct pickle_value *args)
{
    switch (name->known) {
    case NAME_ORDERED_DICT: return pickle_call_dict(m, args);
    case NAME_SET: return pickle_call_set(m, args);
    case NAME_BYTES: return pickle_call_bytes(m, name, args);
    case NAME_ENCODE: return pickle_call_encode(m, args);
    case NAME_LIST: return pickle_call_list(m, args);
    case NAME_RECONSTRUCTOR: return pickle_call_reconstructor(m, args);
    case NAME_DTYPE: return pickle_call_dtype(m, args);
    case NAME_RECONSTRUCT: return pickle_make_array(m);
    case NAME_SCALAR: return pickle_call_scalar(m, args);
    case NAME_FROMBUFFER: return pickle_call_frombuffer(m, args);
    case NAME_TENSOR: return pickle_torch_tensor(m, args);
    case NAME_LOAD: return pickle_torch_load(m, args);
    case NAME_PARAMETER: return pickle_torch_parameter(m, args);
    case NAME_SUBCLASS: return pickle_torch_subclass(m, args);
    case NAME_SIZE: return pickle_torch_size(m, args);
    default:
        return pickle_null(m, "%s is not a function to call",
                           pickle_name_text(name->known));
    }
}

int pickle_op_build(struct pickle_machine *m)
{
    struct pickle_value *state = pickle_pop(m);
    struct pickle_value *object = state ? pickle_top(m) : NULL;

    if (!object)
        return -1;
    switch (object->kind) {
    case PICKLE_ARRAY: return pickle_build_array(m, object, state);
    case PICKLE_DTYPE: return pickle_build_dtype(m, object, state);
    case PICKLE_OBJECT: return pickle_build_object(object, state);
    case PICKLE_DICT:                   /* attributes: not data */
        if (state->kind == PICKLE_DICT)
            return 0;
        /* fall through */
    default:
        return pickle_fail(m, "of a %s", pickle_kind_name(object));
    }
}
