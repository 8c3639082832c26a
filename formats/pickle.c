/* The opcodes, one function each, and the table of them. */
#include "formats/pickle.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/pickle_machine.h"

/* ---- opcodes: constants ------------------------------------------------- */

static int push_text(struct pickle_machine *m, enum pickle_kind kind,
                     const void *p, size_t n)
{
    struct pickle_value *v = p ? pickle_make(m, kind) : NULL;

    if (!v)
        return -1;
    v->u.s.p = p;
    v->u.s.n = n;
    return pickle_push(m, v);
}

static int push_int(struct pickle_machine *m, enum pickle_kind kind,
                    int64_t i)
{
    struct pickle_value *v = pickle_make(m, kind);

    if (v)
        v->u.i = i;
    return pickle_push(m, v);
}

static int push_float(struct pickle_machine *m, double f)
{
    struct pickle_value *v = pickle_make(m, PICKLE_FLOAT);

    if (v)
        v->u.f = f;
    return pickle_push(m, v);
}

/* None, True and False: kind and value. */
static int op_constant(struct pickle_machine *m, int kind, size_t value)
{
    return push_int(m, kind, (int64_t)value);
}

/* A decimal line, with or without the L of Python 2. */
static int op_int_line(struct pickle_machine *m, int kind, size_t n)
{
    char line[PICKLE_LINE], *end;
    long long i;

    (void)kind, (void)n;
    if (pickle_number_line(m, line))
        return -1;
    if (m->op[0] == 'I' && (!strcmp(line, "00") || !strcmp(line, "01")))
        return push_int(m, PICKLE_BOOL, line[1] == '1');
    i = strtoll(line, &end, 10);
    if (end == line || (*end && strcmp(end, "L")))
        return pickle_fail(m, "not a number");
    if (end - line > 18)        /* may have been cut */
        return push_text(m, PICKLE_LONG, "", 0);
    return push_int(m, PICKLE_INT, i);
}

/* A number of n bytes; only four have a sign. */
static int op_int(struct pickle_machine *m, int kind, size_t n)
{
    uint64_t i;

    (void)kind;
    if (pickle_number(m, n, &i))
        return -1;
    return push_int(m, PICKLE_INT, n == 4 ? (int32_t)(uint32_t)i
                                          : (int64_t)i);
}

/* Two's complement, lowest byte first, behind a length of n bytes. */
static int op_long(struct pickle_machine *m, int kind, size_t n)
{
    const unsigned char *p;
    uint64_t bytes, i = 0;

    (void)kind;
    if (pickle_number(m, n, &bytes) || !(p = pickle_bytes(m, bytes)))
        return -1;
    if (bytes > 8)
        return push_text(m, PICKLE_LONG, p, (size_t)bytes);
    for (size_t k = 0; k < bytes; k++)
        i |= (uint64_t)p[k] << (8 * k);
    if (bytes && bytes < 8 && p[bytes - 1] & 0x80)
        i |= ~(uint64_t)0 << (8 * bytes);
    return push_int(m, PICKLE_INT, (int64_t)i);
}

static int op_float_line(struct pickle_machine *m, int kind, size_t n)
{
    char line[PICKLE_LINE], *end;
    double f;

    (void)kind, (void)n;
    if (pickle_number_line(m, line))
        return -1;
    f = strtod(line, &end);
    if (end == line || *end)
        return pickle_fail(m, "not a number");
    return push_float(m, f);
}

static int op_float(struct pickle_machine *m, int kind, size_t n)
{
    const unsigned char *p = pickle_bytes(m, n);
    uint64_t bits = 0;
    double f;

    (void)kind;
    if (!p)
        return -1;
    for (size_t i = 0; i < n; i++)
        bits = bits << 8 | p[i];
    memcpy(&f, &bits, sizeof f);
    return push_float(m, f);
}

/* A string behind its length of n bytes. */
static int op_string(struct pickle_machine *m, int kind, size_t n)
{
    uint64_t bytes;

    if (pickle_number(m, n, &bytes))
        return -1;
    return push_text(m, kind, pickle_bytes(m, bytes), (size_t)bytes);
}

static int hex_digit(int c)
{
    return c >= '0' && c <= '9' ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* The number that n hexadecimal digits at p are; -1 when they are not. */
static long hex_number(const char *p, const char *end, int n)
{
    long v = 0;

    if (end - p < n)
        return -1;
    for (int i = 0; i < n; i++) {
        int d = hex_digit(p[i]);

        if (d < 0)
            return -1;
        v = 16 * v + d;
    }
    return v;
}

static size_t put_utf8(char *out, unsigned long c)
{
    size_t n = c < 0x80 ? 1 : c < 0x800 ? 2 : c < 0x10000 ? 3 : 4;

    if (n == 1)
        out[0] = (char)c;
    for (size_t i = n - 1; n > 1 && i > 0; i--) {
        out[i] = (char)(0x80 | (c & 63));
        c >>= 6;
    }
    if (n > 1)
        out[0] = (char)((0xf00 >> n & 0xff) | c);
    return n;
}

/* Latin1, and other characters as \uXXXX or \UXXXXXXXX. */
static int op_text_line(struct pickle_machine *m, int kind, size_t n)
{
    struct pickle_text line;
    const char *p, *end;
    char *out;

    n = 0;
    if (pickle_line(m, &line) || !(out = pickle_alloc_string(m, 2 * line.n)))
        return -1;
    for (p = line.p, end = p + line.n; p < end;) {
        int digits = *p != '\\' || end - p < 2 ? 0 : p[1] == 'u' ? 4
                     : p[1] == 'U' ? 8 : 0;
        long c = digits ? hex_number(p + 2, end, digits)
                        : (long)(unsigned char)*p;

        if (c < 0 || c > 0x10ffff)
            return pickle_fail(m, "a bad escape at %zu",
                               (size_t)(p - line.p));
        n += put_utf8(out + n, (unsigned long)c);
        p += digits ? digits + 2 : 1;
    }
    return push_text(m, kind, out, n);
}

/* One character of a Python 2 string literal; *p moves behind it. */
static int pickle_unescape(const char **p, const char *end)
{
    static const char names[] = "\\'\"abfnrtv";
    static const char values[] = "\\'\"\a\b\f\n\r\t\v";
    const char *q = *p;
    int c = (unsigned char)*q++;

    if (c == '\\' && q < end) {
        const char *named = *q ? strchr(names, *q) : NULL;

        if (named) {
            c = values[named - names];
            q++;
        } else if (*q == 'x' && hex_number(q + 1, end, 2) >= 0) {
            c = (int)hex_number(q + 1, end, 2);
            q += 3;
        }
    }
    *p = q;
    return c;
}

static int op_string_line(struct pickle_machine *m, int kind, size_t n)
{
    struct pickle_text line;
    char *out;

    n = 0;
    if (pickle_line(m, &line))
        return -1;
    if (line.n < 2 || (line.p[0] != '\'' && line.p[0] != '"') ||
        line.p[line.n - 1] != line.p[0])
        return pickle_fail(m, "the string has no quotes");
    out = pickle_alloc_string(m, line.n);
    if (!out)
        return -1;
    for (const char *p = line.p + 1, *end = line.p + line.n - 1; p < end;)
        out[n++] = (char)pickle_unescape(&p, end);
    return push_text(m, kind, out, n);
}

/* ---- opcodes: containers ------------------------------------------------ */

static int op_mark(struct pickle_machine *m, int kind, size_t n)
{
    (void)kind, (void)n;
    return pickle_push_mark(m);
}

static int op_empty(struct pickle_machine *m, int kind, size_t n)
{
    (void)n;
    return pickle_push(m, pickle_make(m, kind));
}

/* A container of everything above the mark. */
static int op_marked(struct pickle_machine *m, int kind, size_t n)
{
    size_t from = pickle_marked(m);
    struct pickle_value *v;

    (void)n;
    if (!from)
        return -1;
    if (kind == PICKLE_DICT && (m->top - from) % 2)
        return pickle_fail(m, "a key without a value");
    v = pickle_make(m, kind);
    if (!v || pickle_move(m, &v->u.list, from))
        return -1;
    return pickle_push(m, v);
}

/* A tuple of the topmost n values. */
static int op_tuple(struct pickle_machine *m, int kind, size_t n)
{
    struct pickle_value *v = pickle_make(m, kind);

    if (!v || pickle_reserve(m, &v->u.list, n))
        return -1;
    v->u.list.n = n;
    while (n)
        if (!(v->u.list.item[--n] = pickle_pop(m)))
            return -1;
    return pickle_push(m, v);
}

/* Everything above the mark into the container below it. */
static int op_add_marked(struct pickle_machine *m, int kind, size_t n)
{
    size_t from = pickle_marked(m);
    struct pickle_value *v = from > 1 ? m->stack[from - 2] : NULL;

    (void)n;
    if (!from)
        return -1;
    if (!v || (int)v->kind != kind)
        return pickle_fail(m, "to a %s", v ? pickle_kind_name(v) : "mark");
    if (kind == PICKLE_DICT && (m->top - from) % 2)
        return pickle_fail(m, "a key without a value");
    return pickle_move(m, &v->u.list, from);
}

/* The topmost n values (1, or 2: key and value) into the container below. */
static int op_add(struct pickle_machine *m, int kind, size_t n)
{
    struct pickle_value *v = pickle_pop(m);
    struct pickle_value *key = v && n == 2 ? pickle_pop(m) : v;
    struct pickle_value *to = key ? pickle_top(m) : NULL;

    if (!to)
        return -1;
    if ((int)to->kind != kind)
        return pickle_fail(m, "to a %s", pickle_kind_name(to));
    if (n == 2 && pickle_append(m, &to->u.list, key))
        return -1;
    return pickle_append(m, &to->u.list, v);
}

/* ---- opcodes: the stack and the memo ------------------------------------ */

static int op_pop(struct pickle_machine *m, int kind, size_t n)
{
    (void)kind, (void)n;
    if (!m->top)
        return pickle_fail(m, "the stack is empty");
    m->top--;                   /* a mark too */
    return 0;
}

static int op_pop_mark(struct pickle_machine *m, int kind, size_t n)
{
    size_t from = pickle_marked(m);

    (void)kind, (void)n;
    if (from)
        m->top = from - 1;
    return from ? 0 : -1;
}

static int op_dup(struct pickle_machine *m, int kind, size_t n)
{
    (void)kind, (void)n;
    return pickle_push(m, pickle_top(m));
}

/* An index into the memo: n bytes, or with n = 0 a decimal line. */
static int memo_index(struct pickle_machine *m, size_t n, uint64_t *i)
{
    char line[PICKLE_LINE], *end;

    if (n)
        return pickle_number(m, n, i);
    if (pickle_number_line(m, line))
        return -1;
    *i = strtoull(line, &end, 10);
    if (end == line || *end || line[0] == '-')
        return pickle_fail(m, "not a number");
    return 0;
}

static int op_put(struct pickle_machine *m, int kind, size_t n)
{
    uint64_t i;

    (void)kind;
    return memo_index(m, n, &i) ? -1 : pickle_memo_put(m, i);
}

static int op_get(struct pickle_machine *m, int kind, size_t n)
{
    uint64_t i;

    (void)kind;
    return memo_index(m, n, &i) ? -1 : pickle_memo_get(m, i);
}

static int op_memoize(struct pickle_machine *m, int kind, size_t n)
{
    (void)kind, (void)n;
    return pickle_memo_put(m, m->memoized);
}

/* ---- opcodes: objects --------------------------------------------------- */

/* A name for a message: printable, not too long. */
static const char *pickle_printable(char out[64], struct pickle_text s)
{
    size_t k = 0;

    for (; k < s.n && k < 60; k++)
        out[k] = s.p[k] > 32 && s.p[k] < 127 ? s.p[k] : '?';
    out[k] = 0;
    return out;
}

static int refuse_name(struct pickle_machine *m, struct pickle_text module,
                       struct pickle_text name)
{
    char a[64], b[64];

    return pickle_fail(m, "%s.%s is not allowed (expected arrays and plain "
                       "data)", pickle_printable(a, module),
                       pickle_printable(b, name));
}

static int push_name(struct pickle_machine *m, struct pickle_text module,
                     struct pickle_text name)
{
    struct pickle_value *v;
    int known = pickle_lookup(module, name);

    if (known == NAME_NONE)
        return refuse_name(m, module, name);
    v = pickle_make(m, PICKLE_NAME);
    if (v)
        v->u.name = known;
    return pickle_push(m, v);
}

static int op_global(struct pickle_machine *m, int kind, size_t n)
{
    struct pickle_text module, name;

    (void)kind, (void)n;
    if (pickle_line(m, &module) || pickle_line(m, &name))
        return -1;
    return push_name(m, module, name);
}

static int op_stack_global(struct pickle_machine *m, int kind, size_t n)
{
    struct pickle_value *name = pickle_pop(m);
    struct pickle_value *module = name ? pickle_pop(m) : NULL;

    (void)kind, (void)n;
    if (!module)
        return -1;
    if (name->kind != PICKLE_TEXT || module->kind != PICKLE_TEXT)
        return pickle_fail(m, "of a %s and a %s (expected text)",
                           pickle_kind_name(module), pickle_kind_name(name));
    return push_name(m, module->u.s, name->u.s);
}

/* Names a class and calls it in one: none of ours is made like this. */
static int op_inst(struct pickle_machine *m, int kind, size_t n)
{
    struct pickle_text module, name;

    (void)kind, (void)n;
    if (pickle_line(m, &module) || pickle_line(m, &name))
        return -1;
    return refuse_name(m, module, name);
}

static int op_refused(struct pickle_machine *m, int kind, size_t n)
{
    (void)kind, (void)n;
    return pickle_fail(m, "is not allowed (expected arrays and plain data)");
}

/* A name and its arguments: called (REDUCE), or made new (NEWOBJ: n = 0). */
static int op_call(struct pickle_machine *m, int kind, size_t n)
{
    struct pickle_value *args = pickle_pop(m);
    struct pickle_value *name = args ? pickle_pop(m) : NULL;

    (void)kind;
    if (!name)
        return -1;
    if (name->kind != PICKLE_NAME || args->kind != PICKLE_TUPLE)
        return pickle_fail(m, "of a %s and a %s (expected a name and a "
                           "tuple)", pickle_kind_name(name),
                           pickle_kind_name(args));
    if (n)
        return pickle_push(m, pickle_call(m, name->u.name, args));
    if (args->u.list.n)
        return pickle_fail(m, "of %zu arguments (expected none)",
                           args->u.list.n);
    return pickle_push(m, pickle_new(m, name->u.name));
}

static int op_build(struct pickle_machine *m, int kind, size_t n)
{
    struct pickle_value *state = pickle_pop(m);
    struct pickle_value *object = state ? pickle_top(m) : NULL;

    (void)kind, (void)n;
    return object ? pickle_build(m, object, state) : -1;
}

static int op_binpersid(struct pickle_machine *m, int kind, size_t n)
{
    struct pickle_value *id = pickle_pop(m);

    (void)kind, (void)n;
    return id ? pickle_push(m, pickle_persistent(m, id)) : -1;
}

/* ---- opcodes: the file -------------------------------------------------- */

static int op_proto(struct pickle_machine *m, int kind, size_t n)
{
    uint64_t version;

    (void)kind;
    if (pickle_number(m, n, &version))
        return -1;
    if (version > 5)
        return pickle_fail(m, "protocol %d (expected 0 to 5)", (int)version);
    return 0;
}

static int op_frame(struct pickle_machine *m, int kind, size_t n)
{
    uint64_t bytes;

    (void)kind;
    if (pickle_number(m, n, &bytes))
        return -1;
    if (bytes > m->size - m->at)
        return pickle_fail(m, "%llu bytes where %zu are left",
                           (unsigned long long)bytes, m->size - m->at);
    return 0;
}

static int op_stop(struct pickle_machine *m, int kind, size_t n)
{
    (void)kind, (void)n;
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
    int (*run)(struct pickle_machine *m, int kind, size_t n);
    int kind;               /* of the value that it makes */
    size_t n;               /* bytes or values that it takes */
} opcode[256] = {
    ['('] = {"MARK", op_mark, 0, 0},
    ['.'] = {"STOP", op_stop, 0, 0},
    ['0'] = {"POP", op_pop, 0, 0},
    ['1'] = {"POP_MARK", op_pop_mark, 0, 0},
    ['2'] = {"DUP", op_dup, 0, 0},
    ['F'] = {"FLOAT", op_float_line, 0, 0},
    ['G'] = {"BINFLOAT", op_float, 0, 8},
    ['I'] = {"INT", op_int_line, 0, 0},
    ['J'] = {"BININT", op_int, 0, 4},
    ['K'] = {"BININT1", op_int, 0, 1},
    ['L'] = {"LONG", op_int_line, 0, 0},
    ['M'] = {"BININT2", op_int, 0, 2},
    ['N'] = {"NONE", op_constant, PICKLE_NONE, 0},
    ['P'] = {"PERSID", op_refused, 0, 0},
    ['Q'] = {"BINPERSID", op_binpersid, 0, 0},
    ['R'] = {"REDUCE", op_call, 0, 1},
    ['S'] = {"STRING", op_string_line, PICKLE_BYTES, 0},
    ['T'] = {"BINSTRING", op_string, PICKLE_BYTES, 4},
    ['U'] = {"SHORT_BINSTRING", op_string, PICKLE_BYTES, 1},
    ['V'] = {"UNICODE", op_text_line, PICKLE_TEXT, 0},
    ['X'] = {"BINUNICODE", op_string, PICKLE_TEXT, 4},
    ['B'] = {"BINBYTES", op_string, PICKLE_BYTES, 4},
    ['C'] = {"SHORT_BINBYTES", op_string, PICKLE_BYTES, 1},
    ['a'] = {"APPEND", op_add, PICKLE_LIST, 1},
    ['s'] = {"SETITEM", op_add, PICKLE_DICT, 2},
    ['e'] = {"APPENDS", op_add_marked, PICKLE_LIST, 0},
    ['u'] = {"SETITEMS", op_add_marked, PICKLE_DICT, 0},
    [']'] = {"EMPTY_LIST", op_empty, PICKLE_LIST, 0},
    ['}'] = {"EMPTY_DICT", op_empty, PICKLE_DICT, 0},
    [')'] = {"EMPTY_TUPLE", op_empty, PICKLE_TUPLE, 0},
    ['l'] = {"LIST", op_marked, PICKLE_LIST, 0},
    ['d'] = {"DICT", op_marked, PICKLE_DICT, 0},
    ['t'] = {"TUPLE", op_marked, PICKLE_TUPLE, 0},
    ['b'] = {"BUILD", op_build, 0, 0},
    ['c'] = {"GLOBAL", op_global, 0, 0},
    ['i'] = {"INST", op_inst, 0, 0},
    ['o'] = {"OBJ", op_refused, 0, 0},
    ['g'] = {"GET", op_get, 0, 0},
    ['h'] = {"BINGET", op_get, 0, 1},
    ['j'] = {"LONG_BINGET", op_get, 0, 4},
    ['p'] = {"PUT", op_put, 0, 0},
    ['q'] = {"BINPUT", op_put, 0, 1},
    ['r'] = {"LONG_BINPUT", op_put, 0, 4},
    [0x80] = {"PROTO", op_proto, 0, 1},
    [0x81] = {"NEWOBJ", op_call, 0, 0},
    [0x82] = {"EXT1", op_refused, 0, 0},
    [0x83] = {"EXT2", op_refused, 0, 0},
    [0x84] = {"EXT4", op_refused, 0, 0},
    [0x85] = {"TUPLE1", op_tuple, PICKLE_TUPLE, 1},
    [0x86] = {"TUPLE2", op_tuple, PICKLE_TUPLE, 2},
    [0x87] = {"TUPLE3", op_tuple, PICKLE_TUPLE, 3},
    [0x88] = {"NEWTRUE", op_constant, PICKLE_BOOL, 1},
    [0x89] = {"NEWFALSE", op_constant, PICKLE_BOOL, 0},
    [0x8a] = {"LONG1", op_long, 0, 1},
    [0x8b] = {"LONG4", op_long, 0, 4},
    [0x8c] = {"SHORT_BINUNICODE", op_string, PICKLE_TEXT, 1},
    [0x8d] = {"BINUNICODE8", op_string, PICKLE_TEXT, 8},
    [0x8e] = {"BINBYTES8", op_string, PICKLE_BYTES, 8},
    [0x8f] = {"EMPTY_SET", op_empty, PICKLE_SET, 0},
    [0x90] = {"ADDITEMS", op_add_marked, PICKLE_SET, 0},
    [0x91] = {"FROZENSET", op_marked, PICKLE_SET, 0},
    [0x92] = {"NEWOBJ_EX", op_refused, 0, 0},
    [0x93] = {"STACK_GLOBAL", op_stack_global, 0, 0},
    [0x94] = {"MEMOIZE", op_memoize, 0, 0},
    [0x95] = {"FRAME", op_frame, 0, 8},
    [0x96] = {"BYTEARRAY8", op_string, PICKLE_BYTES, 8},
    [0x97] = {"NEXT_BUFFER", op_refused, 0, 0},
    [0x98] = {"READONLY_BUFFER", op_refused, 0, 0},
};

static int machine_run(struct pickle_machine *m)
{
    while (!m->stopped) {
        unsigned char c;

        m->op_at = m->at;
        m->op = "end of data";
        if (m->at == m->size)
            return pickle_fail(m, "the pickle has no STOP");
        c = m->data[m->at++];
        m->op = opcode[c].name;
        if (!opcode[c].run)
            return error_set(m->err, EX_DATAERR, "byte %zu: 0x%02x is not an "
                             "opcode (is this a pickle?)", m->op_at, c);
        if (opcode[c].run(m, opcode[c].kind, opcode[c].n))
            return -1;
    }
    return 0;
}

static struct pickle *machine_read(const void *data, size_t size,
                                   size_t *used, bool inner,
                                   struct error *err)
{
    struct pickle_machine m = {.data = data, .size = size, .inner = inner,
                               .err = err};
    int rc;

    m.p = calloc(1, sizeof *m.p);
    if (!m.p) {
        error_set(err, EX_OSERR, "out of memory");
        return NULL;
    }
    rc = machine_run(&m);
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
    return machine_read(data, size, used, false, err);
}

struct pickle *pickle_read_inner(const void *data, size_t size, size_t *used,
                                 struct error *err)
{
    return machine_read(data, size, used, true, err);
}

const struct pickle_value *pickle_root(const struct pickle *p)
{
    return p->root;
}

const struct pickle_list *pickle_storages(const struct pickle *p)
{
    return &p->storages;
}
