/* The opcodes, one function each, and the table of them; those of constants
 * are in pickle_constant.c. */
#include "lib/lab/import/pickle.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/import/pickle_machine.h"

/* ---- opcodes: containers ------------------------------------------------ */

static int pickle_op_empty(struct pickle_machine *m)
{
    return pickle_push(m, pickle_make(m, m->kind));
}

/* A container of everything above the mark. */
static int pickle_op_marked(struct pickle_machine *m)
{
    size_t from = pickle_marked(m);
    struct pickle_value *v;

    if (!from)
        return -1;
    if (m->kind == PICKLE_DICT && (m->top - from) % 2)
        return pickle_fail(m, "a key without a value");
    v = pickle_make(m, m->kind);
    if (!v || pickle_move(m, &v->u.list, from))
        return -1;
    return pickle_push(m, v);
}

/* A tuple of the topmost n values. */
static int pickle_op_tuple(struct pickle_machine *m)
{
    size_t n = m->n;
    struct pickle_value *v = pickle_make(m, m->kind);

    if (!v || pickle_reserve(m, &v->u.list, n))
        return -1;
    v->u.list.n = n;
    while (n)
        if (!(v->u.list.item[--n] = pickle_pop(m)))
            return -1;
    return pickle_push(m, v);
}

/* The list that items of that kind go into: of a container of the kind, or of
 * an object. */
static struct pickle_list *pickle_open(struct pickle_machine *m,
                                       struct pickle_value *to, int kind)
{
    if (to && to->kind == PICKLE_OBJECT)
        to = pickle_object_items(m, to, kind == PICKLE_SET ? PICKLE_LIST
                                                           : kind);
    else if (!to || (int)to->kind != kind)
        pickle_fail(m, "to a %s", to ? pickle_kind_name(to) : "mark"),
            to = NULL;
    return to ? &to->u.list : NULL;
}

/* Everything above the mark into the container below it. */
static int pickle_op_add_marked(struct pickle_machine *m)
{
    size_t from = pickle_marked(m);
    struct pickle_list *to;

    if (!from)
        return -1;
    to = pickle_open(m, from > 1 ? m->stack[from - 2] : NULL, m->kind);
    if (to && m->kind == PICKLE_DICT && (m->top - from) % 2)
        return pickle_fail(m, "a key without a value");
    return to ? pickle_move(m, to, from) : -1;
}

/* The topmost n values (1, or 2: key and value) into the container below. */
static int pickle_op_add(struct pickle_machine *m)
{
    struct pickle_value *v = pickle_pop(m);
    struct pickle_value *key = v && m->n == 2 ? pickle_pop(m) : v;
    struct pickle_value *below = key ? pickle_top(m) : NULL;
    struct pickle_list *to = below ? pickle_open(m, below, m->kind) : NULL;

    if (!to || (m->n == 2 && pickle_append(m, to, key)))
        return -1;
    return pickle_append(m, to, v);
}

/* ---- opcodes: the stack and the memo ------------------------------------ */

/* POP: the topmost value goes, or a mark. */
static int pickle_op_pop(struct pickle_machine *m)
{
    if (!m->top)
        return pickle_fail(m, "the stack is empty");
    m->top--;                   /* a mark too */
    return 0;
}

/* POP_MARK: all down to the last mark goes, and the mark. */
static int pickle_op_pop_mark(struct pickle_machine *m)
{
    size_t from = pickle_marked(m);

    if (from)
        m->top = from - 1;
    return from ? 0 : -1;
}

static int pickle_op_dup(struct pickle_machine *m)
{
    return pickle_push(m, pickle_top(m));
}

/* An index into the memo: so many bytes, or none and a decimal line. */
static int pickle_memo_index(struct pickle_machine *m, uint64_t *i)
{
    char line[PICKLE_LINE], *end;

    if (m->n)
        return pickle_number(m, m->n, i);
    if (pickle_number_line(m, line))
        return -1;
    *i = strtoull(line, &end, 10);
    if (end == line || *end || line[0] == '-')
        return pickle_fail(m, "not a number");
    return 0;
}

/* PUT and its kin: the topmost value is remembered under a number. */
static int pickle_op_put(struct pickle_machine *m)
{
    uint64_t i;

    return pickle_memo_index(m, &i) ? -1 : pickle_memo_put(m, i);
}

/* GET and its kin: what was remembered, once more. */
static int pickle_op_get(struct pickle_machine *m)
{
    uint64_t i;

    return pickle_memo_index(m, &i) ? -1 : pickle_memo_get(m, i);
}

static int pickle_op_memoize(struct pickle_machine *m)
{
    return pickle_memo_put(m, m->memoized);
}

/* ---- opcodes: objects --------------------------------------------------- */

/* Why an object is made of what is at hand. */
#define PICKLE_NO_DATA "is not allowed (expected arrays and plain data)"

/* A class or function.  Nothing is imported: one that is not known is its
 * name alone. */
static struct pickle_value *pickle_make_name(struct pickle_machine *m,
                                             struct pickle_text module,
                                             struct pickle_text name)
{
    struct pickle_value *v = pickle_make(m, PICKLE_NAME);
    char full[PICKLE_FULL_NAME];

    if (!v || !(v->u.name = pickle_alloc(m, sizeof *v->u.name)))
        return NULL;
    *v->u.name = (struct pickle_name){module, name,
                                      pickle_lookup(module, name)};
    if (v->u.name->known == NAME_NONE) {
        pickle_full_name(full, v->u.name);
        pickle_refuse(m, "%s " PICKLE_NO_DATA, full);
    }
    return v;
}

/* GLOBAL: module and name, a line each. */
static int pickle_op_global(struct pickle_machine *m)
{
    struct pickle_text module, name;

    if (pickle_line(m, &module) || pickle_line(m, &name))
        return -1;
    return pickle_push(m, pickle_make_name(m, module, name));
}

/* STACK_GLOBAL: module and name from the stack. */
static int pickle_op_stack_global(struct pickle_machine *m)
{
    struct pickle_value *name = pickle_pop(m);
    struct pickle_value *module = name ? pickle_pop(m) : NULL;

    if (!module)
        return -1;
    if (name->kind != PICKLE_TEXT || module->kind != PICKLE_TEXT)
        return pickle_fail(m, "of a %s and a %s (expected text)",
                           pickle_kind_name(module), pickle_kind_name(name));
    return pickle_push(m, pickle_make_name(m, module->u.s, name->u.s));
}

/* An object made of values, whose class is among them or is NULL. */
static int pickle_push_object(struct pickle_machine *m,
                              const struct pickle_value *class,
                              const struct pickle_list *values)
{
    bool named = class && class->kind == PICKLE_NAME;

    pickle_refuse(m, PICKLE_NO_DATA);
    return pickle_push(m, pickle_make_object(m, named ? class->u.name : NULL,
                                             values));
}

/* INST: module and name, a line each, of everything above the mark. */
static int pickle_op_inst(struct pickle_machine *m)
{
    struct pickle_text module, name;
    struct pickle_value *class;
    struct pickle_list values = {0};
    size_t from;

    if (pickle_line(m, &module) || pickle_line(m, &name))
        return -1;
    class = pickle_make_name(m, module, name);
    from = class ? pickle_marked(m) : 0;
    if (!from || pickle_move(m, &values, from))
        return -1;
    return pickle_push_object(m, class, &values);
}

/* OBJ: the class and more, down to the mark. */
static int pickle_op_obj(struct pickle_machine *m)
{
    struct pickle_list values = {0};
    size_t from = pickle_marked(m);

    if (!from || pickle_move(m, &values, from))
        return -1;
    return pickle_push_object(m, values.n ? values.item[0] : NULL, &values);
}

/* NEWOBJ_EX: a class, a tuple and a dict. */
static int pickle_op_newobj_ex(struct pickle_machine *m)
{
    struct pickle_value *item[3];

    for (int i = 2; i >= 0; i--)
        if (!(item[i] = pickle_pop(m)))
            return -1;
    return pickle_push_object(m, item[0], &(struct pickle_list){item, 3, 3});
}

/* PERSID: a line, EXT: n bytes, which say nothing outside of the program that
 * wrote them. */
static int pickle_op_private(struct pickle_machine *m)
{
    struct pickle_text line;
    uint64_t code;

    if (m->n ? pickle_number(m, m->n, &code) : pickle_line(m, &line))
        return -1;
    return pickle_push_object(m, NULL, NULL);
}

static int pickle_op_refused(struct pickle_machine *m)
{
    return pickle_fail(m, PICKLE_NO_DATA);
}

/* A name and its arguments: called (REDUCE), or made new (NEWOBJ: n = 0).  An
 * object, called, is one more. */
static int pickle_op_call(struct pickle_machine *m)
{
    struct pickle_value *args = pickle_pop(m);
    struct pickle_value *name = args ? pickle_pop(m) : NULL;

    if (!name)
        return -1;
    if ((name->kind != PICKLE_NAME && name->kind != PICKLE_OBJECT)
        || args->kind != PICKLE_TUPLE)
        return pickle_fail(m, "of a %s and a %s (expected a name and a "
                           "tuple)", pickle_kind_name(name),
                           pickle_kind_name(args));
    if (name->kind == PICKLE_OBJECT || name->u.name->known == NAME_NONE)
        return pickle_push(m, pickle_make_object(
            m, name->kind == PICKLE_OBJECT ? &name->u.object->of
                                           : name->u.name, &args->u.list));
    if (m->n)
        return pickle_push(m, pickle_call(m, name->u.name, args));
    if (args->u.list.n)
        return pickle_fail(m, "of %zu arguments (expected none)",
                           args->u.list.n);
    return pickle_push(m, pickle_new(m, name->u.name));
}

/* BINPERSID: what the identifier stands for, a storage of PyTorch's. */
static int pickle_op_binpersid(struct pickle_machine *m)
{
    struct pickle_value *id = pickle_pop(m);

    return id ? pickle_push(m, pickle_persistent(m, id)) : -1;
}

/* ---- opcodes: the file -------------------------------------------------- */

/* PROTO: a version that there was when this was written. */
static int pickle_op_proto(struct pickle_machine *m)
{
    uint64_t version;

    if (pickle_number(m, m->n, &version))
        return -1;
    if (version > 5)
        return pickle_fail(m, "protocol %d (expected 0 to 5)", (int)version);
    return 0;
}

/* FRAME: only a promise of bytes, which must be there. */
static int pickle_op_frame(struct pickle_machine *m)
{
    uint64_t bytes;

    if (pickle_number(m, m->n, &bytes))
        return -1;
    if (bytes > m->size - m->at)
        return pickle_fail(m, "%llu bytes where %zu are left",
                           (unsigned long long)bytes, m->size - m->at);
    return 0;
}

/* STOP: the last value on the stack is the pickle's. */
static int pickle_op_stop(struct pickle_machine *m)
{
    m->p->root = pickle_pop(m);
    if (!m->p->root)
        return -1;
    if (m->top)
        return pickle_fail(m, "%zu values are left on the stack", m->top);
    m->stopped = true;
    return 0;
}

/* ---- the table ---------------------------------------------------------- */

static const struct {
    const char *name;
    int (*run)(struct pickle_machine *m);
    enum pickle_kind kind;
    size_t n;
} pickle_opcode[256] = {
    ['('] = {"MARK", pickle_push_mark, 0, 0},
    ['.'] = {"STOP", pickle_op_stop, 0, 0},
    ['0'] = {"POP", pickle_op_pop, 0, 0},
    ['1'] = {"POP_MARK", pickle_op_pop_mark, 0, 0},
    ['2'] = {"DUP", pickle_op_dup, 0, 0},
    ['F'] = {"FLOAT", pickle_op_float_line, 0, 0},
    ['G'] = {"BINFLOAT", pickle_op_float, 0, 8},
    ['I'] = {"INT", pickle_op_int_line, 0, 0},
    ['J'] = {"BININT", pickle_op_int, 0, 4},
    ['K'] = {"BININT1", pickle_op_int, 0, 1},
    ['L'] = {"LONG", pickle_op_int_line, 0, 0},
    ['M'] = {"BININT2", pickle_op_int, 0, 2},
    ['N'] = {"NONE", pickle_op_constant, PICKLE_NONE, 0},
    ['P'] = {"PERSID", pickle_op_private, 0, 0},
    ['Q'] = {"BINPERSID", pickle_op_binpersid, 0, 0},
    ['R'] = {"REDUCE", pickle_op_call, 0, 1},
    ['S'] = {"STRING", pickle_op_string_line, PICKLE_BYTES, 0},
    ['T'] = {"BINSTRING", pickle_op_string, PICKLE_BYTES, 4},
    ['U'] = {"SHORT_BINSTRING", pickle_op_string, PICKLE_BYTES, 1},
    ['V'] = {"UNICODE", pickle_op_text_line, PICKLE_TEXT, 0},
    ['X'] = {"BINUNICODE", pickle_op_string, PICKLE_TEXT, 4},
    ['B'] = {"BINBYTES", pickle_op_string, PICKLE_BYTES, 4},
    ['C'] = {"SHORT_BINBYTES", pickle_op_string, PICKLE_BYTES, 1},
    ['a'] = {"APPEND", pickle_op_add, PICKLE_LIST, 1},
    ['s'] = {"SETITEM", pickle_op_add, PICKLE_DICT, 2},
    ['e'] = {"APPENDS", pickle_op_add_marked, PICKLE_LIST, 0},
    ['u'] = {"SETITEMS", pickle_op_add_marked, PICKLE_DICT, 0},
    [']'] = {"EMPTY_LIST", pickle_op_empty, PICKLE_LIST, 0},
    ['}'] = {"EMPTY_DICT", pickle_op_empty, PICKLE_DICT, 0},
    [')'] = {"EMPTY_TUPLE", pickle_op_empty, PICKLE_TUPLE, 0},
    ['l'] = {"LIST", pickle_op_marked, PICKLE_LIST, 0},
    ['d'] = {"DICT", pickle_op_marked, PICKLE_DICT, 0},
    ['t'] = {"TUPLE", pickle_op_marked, PICKLE_TUPLE, 0},
    ['b'] = {"BUILD", pickle_op_build, 0, 0},
    ['c'] = {"GLOBAL", pickle_op_global, 0, 0},
    ['i'] = {"INST", pickle_op_inst, 0, 0},
    ['o'] = {"OBJ", pickle_op_obj, 0, 0},
    ['g'] = {"GET", pickle_op_get, 0, 0},
    ['h'] = {"BINGET", pickle_op_get, 0, 1},
    ['j'] = {"LONG_BINGET", pickle_op_get, 0, 4},
    ['p'] = {"PUT", pickle_op_put, 0, 0},
    ['q'] = {"BINPUT", pickle_op_put, 0, 1},
    ['r'] = {"LONG_BINPUT", pickle_op_put, 0, 4},
    [0x80] = {"PROTO", pickle_op_proto, 0, 1},
    [0x81] = {"NEWOBJ", pickle_op_call, 0, 0},
    [0x82] = {"EXT1", pickle_op_private, 0, 1},
    [0x83] = {"EXT2", pickle_op_private, 0, 2},
    [0x84] = {"EXT4", pickle_op_private, 0, 4},
    [0x85] = {"TUPLE1", pickle_op_tuple, PICKLE_TUPLE, 1},
    [0x86] = {"TUPLE2", pickle_op_tuple, PICKLE_TUPLE, 2},
    [0x87] = {"TUPLE3", pickle_op_tuple, PICKLE_TUPLE, 3},
    [0x88] = {"NEWTRUE", pickle_op_constant, PICKLE_BOOL, 1},
    [0x89] = {"NEWFALSE", pickle_op_constant, PICKLE_BOOL, 0},
    [0x8a] = {"LONG1", pickle_op_long, 0, 1},
    [0x8b] = {"LONG4", pickle_op_long, 0, 4},
    [0x8c] = {"SHORT_BINUNICODE", pickle_op_string, PICKLE_TEXT, 1},
    [0x8d] = {"BINUNICODE8", pickle_op_string, PICKLE_TEXT, 8},
    [0x8e] = {"BINBYTES8", pickle_op_string, PICKLE_BYTES, 8},
    [0x8f] = {"EMPTY_SET", pickle_op_empty, PICKLE_SET, 0},
    [0x90] = {"ADDITEMS", pickle_op_add_marked, PICKLE_SET, 0},
    [0x91] = {"FROZENSET", pickle_op_marked, PICKLE_SET, 0},
    [0x92] = {"NEWOBJ_EX", pickle_op_newobj_ex, 0, 0},
    [0x93] = {"STACK_GLOBAL", pickle_op_stack_global, 0, 0},
    [0x94] = {"MEMOIZE", pickle_op_memoize, 0, 0},
    [0x95] = {"FRAME", pickle_op_frame, 0, 8},
    [0x96] = {"BYTEARRAY8", pickle_op_string, PICKLE_BYTES, 8},
    [0x97] = {"NEXT_BUFFER", pickle_op_refused, 0, 0},
    [0x98] = {"READONLY_BUFFER", pickle_op_refused, 0, 0},
};

/* Opcodes one by one until STOP. */
static int pickle_run(struct pickle_machine *m)
{
    while (!m->stopped) {
        unsigned char c;

        m->op_at = m->at;
        m->op = "end of data";
        if (m->at == m->size)
            return pickle_fail(m, "the pickle has no STOP");
        c = m->data[m->at++];
        m->op = pickle_opcode[c].name;
        if (!pickle_opcode[c].run)
            return error_set(m->err, EX_DATAERR, "byte %zu: 0x%02x is not an "
                             "opcode (is this a pickle?)", m->op_at, c);
        m->kind = pickle_opcode[c].kind;
        m->n = pickle_opcode[c].n;
        if (pickle_opcode[c].run(m))
            return -1;
    }
    return 0;
}

struct pickle *pickle_read_any(const void *data, size_t size, size_t *used,
                               bool inner, struct error *err)
{
    struct pickle_machine m = {.data = data, .size = size, .inner = inner,
                               .err = err};
    int rc;

    m.p = calloc(1, sizeof *m.p);
    if (!m.p)
        return error_null(err, EX_OSERR, "out of memory");
    rc = pickle_run(&m);
    free(m.stack);
    free(m.memo);
    if (rc) {
        pickle_free(m.p);
        return NULL;
    }
    if (used)
        *used = m.at;
    return m.p;
}

struct pickle *pickle_read(const void *data, size_t size, size_t *used,
                           struct error *err)
{
    return pickle_read_any(data, size, used, false, err);
}

const struct pickle_value *pickle_root(const struct pickle *p)
{
    return p->root;
}

const struct pickle_list *pickle_storages(const struct pickle *p)
{
    return &p->storages;
}

const char *pickle_refused(const struct pickle *p)
{
    return p->refused.text[0] ? p->refused.text : NULL;
}

size_t pickle_memory(const struct pickle *p)
{
    return p->arena.used;
}
